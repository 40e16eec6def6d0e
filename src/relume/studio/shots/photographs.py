"""The photographs of a folder, sorted into brackets, with what to doubt of each, and small pictures of them."""

from __future__ import annotations

import tempfile
import threading
import warnings
from collections import OrderedDict
from collections.abc import Sequence
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl
from relume.studio.shots.folder import Folder

ENCODED = ("JPEG", "PNG", "TIFF", "HEIF")
SIDE = 192
"""Pixels of the longer side of a small picture."""
WHITE, BLACK = 0.97, 0.02
"""Shares of white beyond which a pixel says little of the light."""
USELESS = 0.98
"""Share of such pixels from which on a photograph is marked."""
LARGEST_STEP = 4.0
"""Stops between two exposures beyond which few pixels are well exposed in both."""
KEPT = 3000


def brackets(folder: Folder, out: Path) -> list[dict[str, Any]]:
    """Every bracket, single photograph and radiance map below a folder, for JSON, in the order of their folders.

    out : the folder of results, which is passed over
    """
    found: list[dict[str, Any]] = []
    for parent, paths in groupby(folder.pictures(out), key=lambda path: path.parent):
        photographs: list[Path] = []
        for path in paths:
            try:
                kind = rl.files.kind_of(path)
                if kind in (*ENCODED, "RAW"):
                    rl.files.read_facts(path)
            except rl.RelumeError as error:
                found.append(_entry(folder, [path], [], "broken", [_line(error, path)]))
                continue
            if kind not in (*ENCODED, "RAW", "KTX2"):
                found.append(_entry(folder, [path], [], "map", []))
            elif kind != "KTX2":
                photographs.append(path)
        if photographs:
            found += _sorted_into_brackets(folder, parent, photographs)
    return found


def _sorted_into_brackets(folder: Folder, parent: Path, paths: Sequence[Path]) -> list[dict[str, Any]]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            groups = rl.capture.group_files(paths)
    except rl.RelumeError as error:
        return [_entry(folder, paths, [], "photographs", [_line(error, parent)])]
    result = []
    for group in groups:
        facts = [rl.files.read_facts(path) for path in group]
        result.append(_entry(folder, group, facts, "photographs", _doubts(facts)))
    # Of several brackets in a folder each has a name of its own.
    if sum(len(group) > 1 for group in groups) > 1:
        for entry, group in zip(result, groups, strict=True):
            if len(group) > 1:
                first, last = min(group), max(group)
                entry["name"] += f", {first.stem} … {last.stem}"
    return result


def _entry(
    folder: Folder, paths: Sequence[Path], facts: Sequence[rl.files.Facts], kind: str, doubts: list[str]
) -> dict[str, Any]:
    frames: list[dict[str, Any]] = [{"path": folder.name(path)} for path in paths]
    for frame, each in zip(frames, facts, strict=False):
        exposure = each.exposure
        frame |= {
            "size": each.size, "camera": each.camera,
            "seconds": exposure and exposure.seconds, "f_number": exposure and exposure.f_number,
            "iso": exposure and exposure.iso,
        }  # fmt: skip
    name = folder.name(paths[0])
    if len(paths) > 1:
        name = folder.root.name if paths[0].parent == folder.root else folder.name(paths[0].parent)
    return {"name": name, "kind": kind, "patterns": _patterns(folder, paths), "frames": frames, "doubts": doubts}


def _patterns(folder: Folder, paths: Sequence[Path]) -> list[str]:
    """The photographs as a shot file names them: by a pattern where they are all of their kind in their folder."""
    parent, ending = paths[0].parent, paths[0].suffix
    pattern = f"*{ending}" if parent == folder.root else f"{folder.name(parent)}/*{ending}"
    plain = not any(c in folder.name(path) for path in paths for c in "[]?*")
    if len(paths) > 1 and plain and set(folder.named([pattern])) == set(paths):
        return [pattern]
    return [folder.name(path) for path in paths]


def _doubts(facts: Sequence[rl.files.Facts]) -> list[str]:
    """What a photographer should know of a bracket before it is merged."""
    found = []
    if any(each.exposure is None for each in facts):
        found.append("no exposure time in the EXIF: give times in the shot file")
    seconds = sorted(each.exposure.seconds for each in facts if each.exposure is not None)
    steps = [float(np.log2(b / a)) for a, b in pairwise(seconds)]
    if any(step > LARGEST_STEP for step in steps):
        found.append(f"{max(steps):.0f} stops lie between two exposures: the light between them is measured badly")
    if len({each.size for each in facts}) > 1:
        found.append("of different sizes")
    if any(each.settings.automatic_white for each in facts):
        found.append("automatic white balance: its colours may differ from frame to frame")
    return found


def _line(error: Exception, path: Path) -> str:
    return " ".join(str(error).removeprefix(f"{path}: ").split())


class Thumbnails:
    """Small pictures, kept as long as their files do not change; safe to use from several threads."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[Path, int, int], tuple[bytes, str]] = OrderedDict()
        self._changing = threading.Lock()

    def of(self, path: Path) -> tuple[bytes, str]:
        """A small JPEG of a picture, and what to doubt of it at a glance, "" for nothing; raises RelumeError."""
        facts = path.stat()
        key = path, facts.st_mtime_ns, facts.st_size
        with self._changing:
            if key in self._kept:
                return self._kept[key]
        made = _thumbnail(path)
        with self._changing:
            self._kept[key] = made
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        return made


def _thumbnail(path: Path) -> tuple[bytes, str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        image = rl.read(path)
    doubt = ""
    if isinstance(image, rl.Photograph):
        shares = _smaller(image.pixels) / np.iinfo(image.pixels.dtype).max
        light = shares.max(-1)
        for words, useless in (("white", light > WHITE), ("black", light < BLACK)):
            if (share := float(useless.mean())) > USELESS:
                doubt = f"{100 * share:.0f} % {words}"
    else:
        light = _smaller(image.radiance)
        grey = float(np.median(light @ [0.2126, 0.7152, 0.0722]))
        shares = np.clip(0.18 * light / max(grey, 1e-12), 0, 1) ** (1 / 2.2)
    codes = np.round(255 * np.nan_to_num(shares)).astype(np.uint8)
    with tempfile.TemporaryDirectory() as scratch:
        small = Path(scratch) / "small.jpg"
        rl.write(small, rl.Photograph(codes))
        return small.read_bytes(), doubt


def _smaller(pixels: np.ndarray) -> np.ndarray:
    """Means of whole squares of pixels, as many as leave SIDE pixels at most."""
    step = max(1, -(-max(pixels.shape[:2]) // SIDE))
    height, width = max(1, pixels.shape[0] // step), max(1, pixels.shape[1] // step)
    step_y, step_x = pixels.shape[0] // height, pixels.shape[1] // width
    whole = pixels[: height * step_y, : width * step_x]
    return whole.reshape(height, step_y, width, step_x, -1).mean((1, 3), dtype=np.float32)

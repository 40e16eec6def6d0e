"""The maps of a film as files: a folder of OpenEXR files, or one zarr store, whole or not there at all."""

from __future__ import annotations

import secrets
import shutil
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from relume.cluster.renaming import put_in_place
from relume.errors import Doubt, OutputNotWritten, doubt_of, warn
from relume.image import files
from relume.image.files.encodings import SUFFIXES, OpenEXR
from relume.image.radiance import RadianceMap
from relume.probe.video.calibrating import FilmCalibration
from relume.probe.video.merging import MomentMap, gains_darkest
from relume.sphere.map_store import SUFFIX, MapStore, file_in_store, required_zarr

LARGEST_HALF = 65504.0
Written = Callable[[int, MomentMap], Path]
"""Writes a frame's map, counted from 0, and gives its file; several threads may do so at once."""


def is_store_name(out: Path) -> bool:
    """Whether maps go into one zarr store, by the ending of its name."""
    return out.suffix.lower() == SUFFIX


def require_bare(out: Path) -> None:
    """Refuse a folder that holds anything, a file in its place, a name of one map, a store where zarr is missing."""
    if out.suffix.lower() in SUFFIXES:
        raise ValueError(f"{out}: a film gives many maps, and this names one; name a folder or a .zarr")
    if is_store_name(out):
        required_zarr()
    if out.is_dir() and any(out.iterdir()):
        what = "store" if is_store_name(out) else "folder"
        raise OutputNotWritten(f"{out}: holds files already, between which maps would be lost; choose another {what}")
    if out.exists() and not out.is_dir():
        raise OutputNotWritten(f"{out}: a file; maps are written to a folder: choose another name")


@contextmanager
def appearing(out: Path) -> Iterator[Path]:
    """A folder beside `out` that becomes it when all goes well, and is removed when anything fails.

    What is warned of inside names `out` instead.
    """
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        folder = out.with_name(f".{out.name}.{secrets.token_hex(4)}")
        folder.mkdir()
    except OSError as error:
        raise OutputNotWritten(f"{out}: cannot be written: {error.strerror}; choose another place") from None
    try:
        with _warned_as(folder, out):
            yield folder
        if out.is_dir():
            out.rmdir()
        put_in_place(folder, out)
    except OSError as error:
        raise OutputNotWritten(f"{out}: cannot be written: {error.strerror}; choose another place") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def _warned_as(folder: Path, out: Path) -> Iterator[None]:
    """Warnings that name a folder or its files, as those of `out`; what is warned of many files is said of one."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", UserWarning)
        try:
            yield
        finally:
            doubts = [doubt_of(each.message) for each in caught if issubclass(each.category, UserWarning)]
            others = [each for each in caught if not issubclass(each.category, UserWarning)]
    for each in others:  # of other libraries: it says nothing of the light
        warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
    of_files = defaultdict[str, list[Doubt]](list)
    for each in doubts:
        line = each.line.replace(str(folder), str(out))
        # Of two files of one kind the words are the same, their numbers are not.
        kind = "".join(character for character in line if not character.isdigit())
        of_files[kind].append(Doubt(line, each.effect))
    for alike in of_files.values():
        worst = max(alike, key=lambda each: each.effect or 0.0)
        others_too = f"; so it is of {len(alike) - 1} more" if len(alike) > 1 else ""
        warn(worst.line + others_too, worst.effect)


def writer(folder: Path, found: FilmCalibration, rows: int, *, half: bool, variance: bool, store: bool) -> Written:
    """What writes the maps of a film into an empty folder, as map_000001.exr and so on or as one store.

    half : 16 bits a value, unless light is beyond what that holds
    variance : whether it is kept
    """

    def picture(each: MomentMap) -> RadianceMap:
        kept = each.variance(found.tables) if variance else None
        return RadianceMap(each.radiance, kept, each.clipped, attributes={"mapping": "latlong"})

    def write_file(number: int, each: MomentMap) -> Path:
        path = folder / f"map_{number + 1:06d}.exr"
        files.write(path, picture(each), OpenEXR(half))
        return path

    if not store:
        return write_file
    # A store is of one type, and no light is brighter than what the darkest exposure shows as white.
    most = float((found.tables.exposure[255] / gains_darkest(found.takes)).max())
    kind = np.float16 if half and most < LARGEST_HALF else np.float32
    if half and kind is np.float32:
        warn(f"{folder}: radiance is stored as float, not half: light up to {most:.3g} is beyond {LARGEST_HALF:g}", 0.0)
    rate = {"rate": f"{float(found.rate):.10g}"}
    begun = MapStore.begun(folder, found.count, rows, kind, variance=variance, attributes=rate)
    return lambda number, each: begun.write(number, picture(each))


def names_in(out: Path, count: int) -> tuple[Path, ...]:
    """The files of so many maps, as `writer` names them."""
    if is_store_name(out):
        return tuple(file_in_store(out, number) for number in range(count))
    return tuple(out / f"map_{number + 1:06d}.exr" for number in range(count))

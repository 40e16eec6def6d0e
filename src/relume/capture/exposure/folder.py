"""A folder of photographs: its pictures in the order of their names, and the list of exposures beside them."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import numpy as np

from relume.capture.exposure.sidecar import ExposureList, read_times
from relume.errors import NotABracket, UnreadableFile, warn
from relume.image.files.encodings import SUFFIXES
from relume.image.files.signatures import PHOTOGRAPHS, kind_of
from relume.image.photograph import Exposure

_LISTS = (".txt", ".csv", ".tsv", ".hdrgen", ".lst", ".list")
_ENDINGS = (*SUFFIXES, ".png", ".jpg", ".jpeg")
_WORDS = 5  # beside the name in a line of a list: time, f-number, gain, ISO, filters
_SAME = 0.01  # of an exposure: lists agree within the rounding of what they print


def expand(paths: Iterable[str | os.PathLike[str]]) -> tuple[Path, ...]:
    """The paths with every folder replaced by the photographs and camera raws in it, in the order of their names.

    Folders inside come after, each by itself. Lists, radiance maps and what is hidden are passed over; what a file is
    its content says. Raises NotABracket for a folder without photographs.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        pictures = _all_in(path) if path.is_dir() else [path]
        if not pictures:
            raise NotABracket(f"{path}: no photograph is in this folder; name the photographs, or their folder")
        found.extend(pictures)
    return tuple(found)


def every_picture(paths: Iterable[str | os.PathLike[str]], out: Path) -> tuple[Path, ...]:
    """The files, and of folders all photographs and radiance maps in them, absolute; a file given twice counts once.

    out : folder that is passed over where it lies inside another: what was written there is no input
    In a folder a file counts by its content or by its ending, so that a damaged one is not passed over. Raises
    UnreadableFile for what is not there, and for a folder without pictures; ValueError where `out` is such a folder.
    """
    found: dict[Path, None] = {}
    for path in map(Path, paths):
        pictures = [path]
        if path.is_dir():
            if path.resolve() == out.resolve():
                raise ValueError(
                    f"{path}: both the folder of the inputs and that of the outputs, which a second run would take for "
                    "inputs; choose another -o"
                )
            inside = out.absolute() if path.absolute() in out.absolute().parents else None
            pictures = [each for each in _all_in(path, _may_be_picture) if inside not in each.absolute().parents]
        if not path.exists():
            raise UnreadableFile(f"{path}: no such file or folder; check the path")
        if not pictures:
            raise UnreadableFile(f"{path}: no picture is in this folder; name the files, or their folder")
        found.update(dict.fromkeys(picture.absolute() for picture in pictures))
    if not found:
        raise UnreadableFile("no files were given; name files, or folders of them")
    return tuple(found)


def folders_in(folder: Path) -> list[Path]:
    """The folders in a folder, those that are hidden apart, in the order of their names."""
    inner = [path for path in folder.iterdir() if path.is_dir() and not path.name.startswith(".")]
    return sorted(inner, key=name_order)


def _all_in(folder: Path, wanted: Callable[[Path], bool] | None = None) -> list[Path]:
    here = pictures_in(folder, wanted)
    return here + [path for each in folders_in(folder) for path in _all_in(each, wanted)]


def pictures_in(folder: Path, wanted: Callable[[Path], bool] | None = None) -> list[Path]:
    """The photographs and camera raws in a folder, or what else is wanted, in the order of their names, 9 before 10."""
    files = [path for path in folder.iterdir() if not path.name.startswith(".") and path.is_file()]
    return sorted(filter(wanted or _is_photograph, files), key=name_order)


def name_order(path: str | os.PathLike[str]) -> tuple[object, ...]:
    """A key that sorts file names as people number them: IMG_9 before IMG_10."""
    words = re.split(r"(\d+)", Path(path).name.lower())
    return tuple((int(word), "") if word.isdecimal() else (-1, word) for word in words)


def listed_exposures(paths: Sequence[Path], brightness: Callable[[], Sequence[float]] | None) -> list[Exposure | None]:
    """What the lists of exposures in the photographs' folder give for each; None where they give nothing.

    paths : photographs of one folder
    brightness : gives their mean pixel values (`ExposureList.exposures_of`); None where pixels are not to be looked at

    Of several lists that name all the photographs the first by name counts, once they agree. Where none names all, the
    one that names most counts, with a warning. Raises NotABracket where lists disagree.
    """
    folder = paths[0].parent
    lists = [found for path in sorted(folder.iterdir(), key=name_order) if (found := _list_in(path, paths))]
    pictures = pictures_in(folder) if any(not found.names for found in lists) else []
    listed: dict[str, list[Exposure | None]] = {}
    for found in lists:
        if found.names:
            listed[found.path] = found.exposures_of(paths, [0] * len(paths), brightness)
        elif len(found.exposures) == len(pictures):
            listed[found.path] = found.exposures_of(paths, [pictures.index(path) for path in paths], brightness)
    listed = {path: exposures for path, exposures in listed.items() if any(exposures)}
    if not listed:
        for found in lists if brightness is not None else []:
            _warn_of_strangers(found, paths, len(pictures))
        return [None] * len(paths)
    _refuse_disagreement(listed, paths)
    chosen = max(listed, key=lambda path: sum(exposure is not None for exposure in listed[path]))
    missing = [path.name for path, exposure in zip(paths, listed[chosen], strict=True) if exposure is None]
    if missing and brightness is not None:
        warn(f"{chosen}: does not name {', '.join(missing)}; add them to the list")
    return listed[chosen]


def lists_beside(paths: Iterable[Path]) -> tuple[Path, ...]:
    """The files in the folders of photographs that may be lists of their exposures, in the order of their paths."""
    folders = sorted({path.parent for path in paths})
    return tuple(path for folder in folders for path in sorted(folder.iterdir()) if _may_be_list(path))


def _may_be_list(path: Path) -> bool:
    return path.suffix.lower() in _LISTS and not path.name.startswith(".") and path.is_file()


def _is_photograph(path: Path) -> bool:
    try:
        return kind_of(path) in (*PHOTOGRAPHS, "RAW")
    except UnreadableFile:
        return False


def _may_be_picture(path: Path) -> bool:
    if path.name.lower().endswith(_ENDINGS):
        return True
    try:
        return bool(kind_of(path))
    except UnreadableFile:
        return False


def _list_in(path: Path, paths: Sequence[Path]) -> ExposureList | None:
    if not _may_be_list(path):
        return None
    try:
        return read_times(path)
    except UnreadableFile as error:
        # A text that puts a number beside the photographs was meant as their list; a readme describes them in words.
        try:
            lines = path.read_text("utf-8", errors="replace").lower().splitlines()
        except OSError:
            return None
        named = {p.name.lower() for p in paths for line in lines if _lists(line, p.name.lower())}
        if len(named) > len(paths) // 2:
            warn(f"{error}; it is passed over")
        return None


def _lists(line: str, name: str) -> bool:
    """Whether a line of a text names a photograph and little else, as lines of a list do."""
    before, found, after = line.partition(name)
    others = re.split(r"[\s,;]+", f"{before} {after}".strip())
    numbered = any(letter.isdecimal() for word in others for letter in word)
    return bool(found) and any(others) and len(others) <= (_WORDS if numbered else 2)


def _warn_of_strangers(found: ExposureList, paths: Sequence[Path], pictures: int) -> None:
    if found.names:
        warn(
            f"{found.path}: lists exposures, but of none of the photographs, such as {paths[0].name}; it is passed over"
        )
    elif len(found.exposures) > 1:
        warn(
            f"{found.path}: {len(found.exposures)} numbers for {pictures} photographs in its folder; it is passed over"
        )


def _refuse_disagreement(listed: dict[str, list[Exposure | None]], paths: Sequence[Path]) -> None:
    """Refuse lists of which no single scale makes one the other: only ratios matter to a merge."""
    (first, reference), *others = listed.items()
    for other, exposures in others:
        pairs = [(a.factor, b.factor, p) for a, b, p in zip(reference, exposures, paths, strict=True) if a and b]
        ratios = np.array([a / b for a, b, _ in pairs])
        if len(pairs) and np.ptp(np.log(ratios)) > _SAME:
            odd = pairs[int(np.argmax(np.abs(np.log(ratios / np.median(ratios)))))][2]
            raise NotABracket(
                f"{first} and {other} disagree about {odd.name}; take one of them away, or name the right one "
                "with --times"
            )

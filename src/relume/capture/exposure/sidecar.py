"""Lists of exposures that people keep beside their photographs, in the forms such lists have.

Read are Debevec's image_list.txt and hdr_image_list.txt (name, exposure, 1/shutter, f/stop, gain in dB, ND filters),
pfstools' .hdrgen (name, 1/shutter, aperture, ISO, ND), lists of names and times, CSV with a header, and bare numbers in
the order of the files.
"""

from __future__ import annotations

import csv
import math
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.errors import NotABracket, UnreadableFile
from relume.image.photograph import Exposure

_LARGEST = 1_000_000  # bytes; a list of a thousand photographs has a tenth of it
_HDRGEN = ("name", "reciprocal", "f_number", "iso", "filters")
# Tried in this order: "1/shutter_speed" is a reciprocal before it is a shutter.
_COLUMNS = (
    (r"(file|name|image|picture|photo|frame)", "name"),
    (r"(1/|reciprocal|inverse)", "reciprocal"),
    (r"(f|f[/ _-]?(stop|number|#)s?|aperture)$", "f_number"),
    (r"(iso|asa|sensitivity)", "iso"),
    (r"gain", "gain"),
    (r"nd|filter", "filters"),
    (r"(ev|stops?)$", "stops"),
    (r"shutter", "shutter"),
    (r"(exposure|time|sec|s$|t$|duration)(?!.*bias)", "seconds"),
)


@dataclass(frozen=True)
class ExposureList:
    """The exposures that a file lists.

    path : the file
    names : of the photographs as listed; empty where the numbers stand for the photographs in the order of their names
    exposures : one an entry; filters are counted as less time, gain as ISO (100 at 0 dB, twice as much per 3 dB)
    either : the file does not say whether its numbers are seconds or reciprocals; `exposures` take them for seconds
    stops : exposure values listed beside them, rising with exposure; empty where there are none
    """

    path: str
    names: tuple[str, ...]
    exposures: tuple[Exposure, ...]
    either: bool = False
    stops: tuple[float, ...] = ()

    def exposures_of(
        self, paths: Sequence[Path], places: Sequence[int], brightness: Callable[[], Sequence[float]] | None
    ) -> list[Exposure | None]:
        """The exposure of each photograph, None for those that are not listed.

        paths : of the photographs; the suffix does not count where no listed name fits whole: lists outlive conversions
        places : of each, its place among the photographs in the order of their names, where the list has no names
        brightness : gives their mean pixel values, asked for only where nothing but the pixels can separate seconds
            from reciprocals; without it such a list gives nothing
        Raises NotABracket where its numbers fit the brightness neither as seconds nor as reciprocals.
        """
        entries = [self._entry(path, place) for path, place in zip(paths, places, strict=True)]
        exposures = self.exposures
        if self.either and any(entry is not None for entry in entries):
            if brightness is None:
                return [None] * len(paths)
            seen = [(entry, value) for entry, value in zip(entries, brightness(), strict=True) if entry is not None]
            exposures = self._decided(*zip(*seen, strict=True))
        return [None if entry is None else exposures[entry] for entry in entries]

    def _entry(self, path: Path, place: int) -> int | None:
        if not self.names:
            return place if place < len(self.exposures) else None
        listed = [re.split(r"[/\\]", name)[-1].lower() for name in self.names]
        for wanted, offered in ((path.name.lower(), listed), (path.stem.lower(), [Path(n).stem for n in listed])):
            if wanted in offered:
                return offered.index(wanted)
        return None

    def _decided(self, places: Sequence[int], brightness: Sequence[float]) -> tuple[Exposure, ...]:
        """The exposures with the numbers read as seconds or as reciprocals: longer exposures are brighter."""
        turned = replace(self, exposures=tuple(replace(e, seconds=1 / e.seconds) for e in self.exposures))
        fitting = [
            reading for reading in (self, turned) if reading._agrees_with_stops() and reading._rises(places, brightness)
        ]
        if len(fitting) != 1:
            raise NotABracket(
                f"{self.path}: neither as seconds nor as reciprocals do its numbers rise with the brightness of the "
                "photographs; write seconds, like 1/30, beside the names"
            )
        return fitting[0].exposures

    def _agrees_with_stops(self) -> bool:
        if not self.stops:
            return True
        listed = np.log2([e.seconds for e in self.exposures])
        # Marked speeds depart from whole stops by a tenth; a third is another exposure.
        return bool(np.ptp(listed - np.array(self.stops)) < 1 / 3)

    def _rises(self, places: Sequence[int], brightness: Sequence[float]) -> bool:
        factors = np.array([self.exposures[place].factor for place in places])
        order = np.sign(np.subtract.outer(factors, factors)) * np.sign(np.subtract.outer(brightness, brightness))
        # All but a few pairs: the darkest photographs of a long bracket differ by noise alone.
        return bool((order > 0).sum() > 4 * (order < 0).sum())


def read_times(path: str | os.PathLike[str]) -> ExposureList:
    """The exposures listed in a text file; raises UnreadableFile, in one line, for what is no such list."""
    rows, comments = _rows(Path(path))
    if not rows:
        raise UnreadableFile(f"{path}: lists nothing; write a name and a time per line, like IMG_1.jpg 1/30")
    if all(_is_number(word) for row in rows for word in row):
        return _bare(Path(path), rows)
    header = next((c for c in map(_columns, reversed(comments)) if "name" in c and len(set(c) - {""}) > 1), None)
    if len(rows[0]) == 1 and rows[0][0].isdecimal():
        count, rows = int(rows[0][0]), rows[1:]
        if count != len(rows):
            raise UnreadableFile(
                f"{path}: says that it lists {count} photographs, and lists {len(rows)}; mend the list"
            )
    elif any(_columns(rows[0])) and not any(_is_number(word) for word in rows[0][1:]):
        header, rows = _columns(rows[0]), rows[1:]
    columns = _fitted(Path(path), header, rows, comments)
    return _table(path, columns, rows)


def _rows(path: Path) -> tuple[list[list[str]], list[list[str]]]:
    """Words of the lines that list something, and of those that comment."""
    try:
        if path.stat().st_size > _LARGEST:
            raise UnreadableFile(f"{path}: larger than any list of exposures; give a text file")
        text = path.read_text("utf-8-sig")
    except FileNotFoundError:
        raise UnreadableFile(f"{path}: no such file; check the path") from None
    except (OSError, UnicodeDecodeError):
        raise UnreadableFile(f"{path}: no text that can be read; write a name and a time per line") from None
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    separator = next((s for s in (",", ";", "\t") if any(s in line for line in lines if line[0] != "#")), None)
    kept: tuple[list[list[str]], list[list[str]]] = ([], [])
    for line in lines:
        comment, line = line[0] == "#", line.lstrip("#")
        words = line.split() if separator is None or (comment and separator not in line) else _split(line, separator)
        if words := [word.strip() for word in words]:
            kept[comment].append(words)
    return kept


def _split(line: str, separator: str) -> list[str]:
    words = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    return words[:-1] if words and not words[-1].strip() else words


def _columns(words: Sequence[str]) -> tuple[str, ...]:
    """What each word of a header says of its column, "" where that is nothing we know."""
    return tuple(next((kind for pattern, kind in _COLUMNS if re.match(pattern, w.lower())), "") for w in words)


def _fitted(
    path: Path, header: tuple[str, ...] | None, rows: list[list[str]], comments: list[list[str]]
) -> tuple[str, ...]:
    """The kind of every column: by the header where one fits, else by the form of the list."""
    widths = {len(row) for row in rows}
    if not rows or len(widths) != 1:
        raise UnreadableFile(f"{path}: its lines have different numbers of columns; write each like the others")
    if header is not None and len(header) == min(widths):
        return header
    if path.suffix.lower() == ".hdrgen" and min(widths) in (4, 5):
        return _HDRGEN[: min(widths)]
    if min(widths) == 2:
        said = " ".join(word for comment in comments for word in comment).lower()
        if re.search(r"1/|reciprocal|inverse", said):
            return ("name", "reciprocal")
        return ("name", "seconds" if re.search(r"\bsec|\(s\)", said) else "shutter")
    raise UnreadableFile(f'{path}: nothing says what its columns are; begin it with a line like "name seconds f/stop"')


def _table(path: str | os.PathLike[str], columns: tuple[str, ...], rows: list[list[str]]) -> ExposureList:
    if "name" not in columns or not {"seconds", "reciprocal", "shutter", "stops"} & set(columns):
        raise UnreadableFile(f'{path}: names no column of times; begin it with a line like "name seconds f/stop"')
    names, exposures, plain, stops = [], [], True, []
    for row in rows:
        cells = {kind: cell for kind, cell in zip(columns, row, strict=True) if kind and cell}
        names.append(cells.get("name", ""))
        try:
            exposures.append(_exposure(cells))
            stops.extend([number_in(cells["stops"])] if "stops" in cells else [])
        except (KeyError, ValueError, OverflowError, ZeroDivisionError) as error:
            raise UnreadableFile(f'{path}: "{" ".join(row)}" is not an exposure ({error}); mend the line') from None
        plain &= _is_plain(cells.get("shutter", "1/2"))
    listed: dict[str, Exposure] = {}
    for name, exposure in zip(names, exposures, strict=True):
        if listed.setdefault(name, exposure) != exposure:
            raise UnreadableFile(f"{path}: lists {name} twice with different exposures; take one line out")
    timed = not {"seconds", "reciprocal"} & set(columns) and "shutter" in columns
    return ExposureList(str(path), tuple(names), tuple(exposures), timed and plain, tuple(stops) if timed else ())


def _exposure(cells: dict[str, str]) -> Exposure:
    """Debevec's rules: the gain doubles the exposure per 3 dB, a filter of one stop halves it."""
    readings = [number_in(cells[kind]) for kind in ("seconds", "shutter") if kind in cells]
    readings += [1 / number_in(cells["reciprocal"])] if "reciprocal" in cells else []
    if readings and max(readings) > 1.05 * min(readings):
        raise ValueError("its time and its reciprocal disagree")
    seconds = readings[0] if readings else 2.0 ** number_in(cells["stops"])
    gain, iso = number_in(cells.get("gain", "0")), number_in(cells.get("iso", "0"))
    if gain:
        iso = 100.0 * 2.0 ** (gain / 3.0)
    f_number = number_in(cells.get("f_number", "0").lower().removeprefix("f/"))
    seconds *= 2.0 ** -number_in(cells.get("filters", "0"))
    return Exposure(seconds, f_number or None, iso or None, "sidecar")


def _bare(path: Path, rows: list[list[str]]) -> ExposureList:
    """Numbers alone: in one line or a line each, and perhaps a second line of stops."""
    if len(rows) == 1 or {len(row) for row in rows} == {1}:
        times, stops = [word for row in rows for word in row], []
    elif len(rows) == 2 and len(rows[0]) == len(rows[1]):
        times, stops = rows
    else:
        raise UnreadableFile(f"{path}: numbers without names; write a name and a time per line")
    try:
        exposures = tuple(Exposure(number_in(word), source="sidecar") for word in times)
        return ExposureList(
            str(path), (), exposures, all(map(_is_plain, times)), tuple(number_in(word) for word in stops)
        )
    except (ValueError, ZeroDivisionError) as error:
        raise UnreadableFile(f"{path}: no list of exposure times ({error}); write seconds, like 1/30") from None


def number_in(word: str) -> float:
    """The number that a word gives, as a fraction too and with or without its unit; raises ValueError for none."""
    # Not through Fraction, which would write out 1e999999999 in full.
    above, slash, below = re.sub(r'\s*("|s|sec|seconds|db|stops?)$', "", word.strip().lower()).partition("/")
    number = float(above) / float(below) if slash else float(above)
    if not math.isfinite(number):
        raise ValueError(f"{word} is no number")
    return number


def _is_number(word: str) -> bool:
    try:
        number_in(word)
    except (ValueError, ZeroDivisionError):
        return False
    return True


def _is_plain(word: str) -> bool:
    """Whether a number says neither by a fraction nor by a unit that it is seconds."""
    return not re.search(r'[/"a-z]', word.lower())

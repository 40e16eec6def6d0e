"""Headers of Radiance pictures: lines of text, an empty one, and one with the size and the axes.

Lines of the form KEY=value are variables; the others are the commands that made the picture. EXPOSURE, COLORCORR and
PIXASPECT are cumulative, and so is VIEW: later options add to earlier ones (Radiance File Formats, "Picture File
Format").
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np

from relume.errors import FormatError
from relume.image.files.metadata import gps
from relume.image.files.metadata.attributes import PREFIX, RADIANCE
from relume.image.files.read_options import ReadOptions
from relume.image.primaries import REC709, Primaries
from relume.image.radiance import RadianceMap

FORMAT = "Radiance"
"""The format's name in error messages."""

RGBE, XYZE = "32-bit_rle_rgbe", "32-bit_rle_xyze"
_RESOLUTION = re.compile(rb"([-+][XY]) *(\d{1,9}) ([-+][XY]) *(\d{1,9})")
_VARIABLE = re.compile(r"([A-Za-z]\w*|relume:[^=]+)=(.*)", re.ASCII)
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", re.ASCII)
_CONTROL = re.compile(r"[\0-\x09\x0b-\x1f\x7f]")
_KEY = re.compile(r"[A-Z][A-Z0-9_]*")  # as Radiance writes its own
_UNIT = "unit"  # under "relume:"
_POSITION = "LATLONG"  # degrees north and east, in one line
_UNDERSTOOD = ("FORMAT", "EXPOSURE", "COLORCORR", "PRIMARIES", "PIXASPECT", _POSITION)
_FIRST_READ = 2**16  # bytes; no header of a program is as long
_MOST_LINES = 2**16  # each costs a microsecond or two; no program writes as many
_MEND = "mend the line or remove it"
_OPENCV_BUFFER = 127  # characters that OpenCV reads of a header line at a time


@dataclass(frozen=True)
class Header:
    """What stands before the pixels.

    xyz : they are X, Y, Z, not R, G, B
    axes : that the scan lines follow each other along, and the pixels in them, like ("-Y", "+X"): downwards, and right
    lines, length : scan lines, and pixels in each
    start : the byte where the pixels begin
    scale : (3,) float64, the product of all EXPOSURE and COLORCORR, which the pixels were multiplied by
    primaries : None where it does not say
    unit : "relative" or "cd/m²"
    attributes : all else, by our names
    """

    xyz: bool
    axes: tuple[str, str]
    lines: int
    length: int
    start: int
    scale: np.ndarray
    primaries: Primaries | None
    unit: str
    attributes: dict[str, str]

    @property
    def gamma(self) -> str:
        """What a GAMMA line gives for the pixels, "" where they are linear."""
        gamma = self.attributes.get("GAMMA", "1")
        return "" if _NUMBER.fullmatch(gamma) and float(gamma) == 1 else gamma

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the upright picture."""
        return (self.lines, self.length) if self.axes[0][1] == "X" else (self.length, self.lines)


def read_header(path: str | os.PathLike[str], file: BinaryIO, options: ReadOptions = ReadOptions()) -> Header:
    """The header; raises FormatError for one that is damaged, and names the line."""
    data = file.read(min(_FIRST_READ, options.metadata))
    while not _is_whole(data) and len(data) < options.metadata and (more := file.read(options.metadata - len(data))):
        data += more
    end = data.find(b"\n\n")
    if 0 <= data.find(b"\r\n\r\n") < (end if end >= 0 else len(data)):
        raise FormatError(
            path,
            FORMAT,
            "its header",
            "line ends of LF",
            "CR LF, which a converter put into the pixels too",
            "copy it again in binary mode",
        )
    stop = data.find(b"\n", end + 2)
    if end < 0 or stop < 0:
        found = f"none in {len(data)} bytes"
        raise FormatError(path, FORMAT, "its header", "an empty line and one with the size", found)
    if data.count(b"\n", 0, end) > _MOST_LINES:
        raise FormatError(path, FORMAT, "its header", f"at most {_MOST_LINES} lines", "more")
    match = _RESOLUTION.fullmatch(data[end + 2 : min(stop, end + 100)].strip())
    if match is None or match[1][1:] == match[3][1:]:
        shown = repr(data[end + 2 : min(stop, end + 42)].decode("latin-1"))
        raise FormatError(path, FORMAT, f"resolution line, byte {end + 2}", 'one like "-Y 512 +X 1024"', shown)
    values = _values(data[:end].decode("utf-8", "replace"))
    axes = match[1].decode(), match[3].decode()
    xyz = _is_xyz(path, values.get("FORMAT", []))
    attributes = _attributes(path, values)
    unit = "cd/m²" if attributes.pop(_UNIT, "") == "cd/m2" else "relative"
    scale, primaries = _scale(path, values), _primaries(path, values)
    return Header(xyz, axes, int(match[2]), int(match[4]), stop + 1, scale, primaries, unit, attributes)


def header_of(image: RadianceMap, *, xyz: bool) -> bytes:
    """The header of a picture, its pixels in rows from the top, each from the left."""
    kept = kept_attributes(image)
    position = _position_of(image.attributes)
    lines = [
        _variable_of(name, value) for name, value in image.attributes.items() if name in kept and name not in position
    ]
    lines += [f"{_POSITION}= {' '.join(position.values())}"] if position else []
    lines += [f"{PREFIX}{_UNIT}=cd/m2"] if image.unit == "cd/m²" else []
    # X, Y, Z have no primaries, and their white is always that of equal energy.
    lines += [] if xyz else [f"PRIMARIES= {' '.join(f'{value:.4f}' for value in REC709.values)}"]
    # OpenCV knows no FORMAT but in the last line, and takes the rest of a line that fills its buffer for an empty one.
    lines = [line + " " * (len(line.encode("utf-8", "replace")) % _OPENCV_BUFFER == 0) for line in lines]
    width, height = image.size
    whole = ["#?RADIANCE", *lines, f"FORMAT={XYZE if xyz else RGBE}", "", f"-Y {height} +X {width}", ""]
    return "\n".join(whole).encode("utf-8", "replace")


def kept_attributes(image: RadianceMap) -> set[str]:
    """Names of the attributes that a header can hold: no name has "=" or a line break, and none is "unit"."""
    return {name for name in image.attributes if name and name == _flat(name) and "=" not in name and name != _UNIT}


def _is_whole(data: bytes) -> bool:
    end = data.find(b"\n\n")
    return (end >= 0 and data.find(b"\n", end + 2) >= 0) or b"\r\n\r\n" in data


def _values(text: str) -> dict[str, list[str]]:
    """What each variable is set to, in order."""
    values: dict[str, list[str]] = {}
    for match in filter(None, map(_VARIABLE.fullmatch, _CONTROL.sub(" ", text).split("\n"))):
        values.setdefault(match[1], []).append(match[2].strip())
    return values


def _is_xyz(path: str | os.PathLike[str], formats: list[str]) -> bool:
    if any(value not in (RGBE, XYZE) for value in formats) or len(set(formats)) > 1:
        shown = " and ".join(dict.fromkeys(value[:40] for value in formats[:4]))
        raise FormatError(path, FORMAT, "FORMAT line", f"{RGBE} or {XYZE}", shown or "nothing", "convert it to one")
    return formats[-1:] == [XYZE]


def _attributes(path: str | os.PathLike[str], values: dict[str, list[str]]) -> dict[str, str]:
    names = {key: name for name, key in RADIANCE.items()}
    attributes = {}
    for key, said in values.items():
        if key in _UNDERSTOOD:
            continue
        name = names.get(key, key).removeprefix(PREFIX)
        attributes[name] = " ".join(said) if key == RADIANCE["view"] else "; ".join(dict.fromkeys(said))
    aspect = math.prod(float(_numbers(path, "PIXASPECT", value, 1)[0]) for value in values.get("PIXASPECT", []))
    if not 1e-6 < aspect < 1e6:
        raise FormatError(path, FORMAT, "PIXASPECT line", "a pixel's height by its width", f"{aspect:g}", _MEND)
    if "PIXASPECT" in values:
        attributes["pixel_aspect"] = f"{1 / aspect:.7g}"
    return {**_position_in(values.get(_POSITION, [])), **attributes}


def _position_in(said: list[str]) -> dict[str, str]:
    """Latitude and longitude, by the last line that has them; lines that make no sense as they are."""
    for words in (line.split() for line in reversed(said)):
        if all(map(_NUMBER.fullmatch, words)) and len(words) == 2:
            position = {"latitude": words[0], "longitude": words[1]}
            if len(gps.of_texts(position)) == 2:
                return position
    return {_POSITION: "; ".join(dict.fromkeys(said))} if said else {}


def _scale(path: str | os.PathLike[str], values: dict[str, list[str]]) -> np.ndarray:
    scale = np.ones(3)
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):
        for key, count in (("EXPOSURE", 1), ("COLORCORR", 3)):
            for value in values.get(key, []):
                scale *= _numbers(path, key, value, count)
    if not (np.all(np.isfinite(scale)) and np.all(scale > 0)):
        raise FormatError(path, FORMAT, "EXPOSURE lines", "positive numbers", f"a product of {scale.tolist()}", _MEND)
    return scale


def _primaries(path: str | os.PathLike[str], values: dict[str, list[str]]) -> Primaries | None:
    if "PRIMARIES" not in values:
        return None
    numbers = _numbers(path, "PRIMARIES", values["PRIMARIES"][-1], 8)
    if not numbers.any():  # Photoshop: it does not say
        return None
    try:
        return Primaries.of(numbers)
    except ValueError as error:
        raise FormatError(path, FORMAT, "PRIMARIES line", "x, y of R, G, B and white", str(error), _MEND) from None


def _numbers(path: str | os.PathLike[str], key: str, value: str, count: int) -> np.ndarray:
    words = value.split()
    if len(words) != count or not all(map(_NUMBER.fullmatch, words)):
        raise FormatError(path, FORMAT, f"{key} line", f"{count} number(s)", repr(value[:40]), _MEND)
    return np.array([float(word) for word in words])


def _position_of(attributes: Mapping[str, str]) -> dict[str, str]:
    """The texts of latitude and longitude where both are numbers that a line can hold; else none."""
    position = {name: attributes.get(name, "") for name in ("latitude", "longitude")}
    numbers = all(map(_NUMBER.fullmatch, position.values()))
    return position if numbers and len(gps.of_texts(position)) == 2 else {}


def _variable_of(name: str, value: str) -> str:
    """The header line of an attribute: Radiance's own where it has one."""
    text = _flat(value)
    if name == "pixel_aspect":
        try:
            if 1e-6 < float(text) < 1e6:
                return f"PIXASPECT= {1 / float(text):.7g}"
        except ValueError:
            pass
    elif name in RADIANCE:
        return f"{RADIANCE[name]}= {text}"
    elif _KEY.fullmatch(name) and name not in (*_UNDERSTOOD, *RADIANCE.values()):
        return f"{name}= {text}"
    return f"{PREFIX}{name}={text}"


def _flat(text: str) -> str:
    return " ".join(text.split())

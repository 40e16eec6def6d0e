"""The formats that radiance is written in, as values that are passed in: `write(path, image, LogLuv(bits=24))`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePath
from typing import Literal


@dataclass(frozen=True)
class OpenEXR:
    """An .exr; the one format that keeps everything.

    half : store 16 bits a value, in half the space, with an error of at most 1/2048 of it from 6.1e-5 to 65504; below,
        of at most 3e-8, so that what is less than that becomes 0. A layer with a value beyond 65504, or that loses more
        than 1/2048 of more than 1 value of 100, is stored as float; a warning counts what is lost, or would be.
        Off because nobody who did not ask should lose digits
    """

    half: bool = False


@dataclass(frozen=True)
class RadianceHDR:
    """A .hdr or .pic of four bytes a pixel: three mantissas and their exponent, rounded to nearest.

    xyz : XYZE, which holds every visible colour, in place of RGBE, which every program reads
    compressed : by runs; flat files are read by old programs too
    """

    xyz: bool = False
    compressed: bool = True


@dataclass(frozen=True)
class FloatTIFF:
    """A TIFF of 32-bit floats, bit for bit.

    compressed : ZIP with the floating-point predictor, which is lossless
    """

    compressed: bool = True


@dataclass(frozen=True)
class LogLuv:
    """A TIFF of log luminance and CIE u′v′ (Larson 1998).

    bits : 32, an error of 0.14 % over 38 orders of magnitude, run-length coded; 24, 0.54 % over 4.8; 16, luminance
        alone as in 32
    """

    bits: Literal[16, 24, 32] = 32

    def __post_init__(self) -> None:
        if self.bits not in (16, 24, 32):
            raise ValueError(f"bits is {self.bits}; LogLuv has 16 (luminance alone), 24 or 32")


@dataclass(frozen=True)
class PFM:
    """A portable float map, bit for bit, without any metadata.

    grey : one channel, "Pf"; refused for a picture whose channels differ
    big_endian : the byte order of old workstations
    """

    grey: bool = False
    big_endian: bool = False


@dataclass(frozen=True)
class RawFloat:
    """Debevec's .float: 32-bit floats and nothing else, not even the size; gzipped where the name ends in .gz.

    big_endian : the byte order of old workstations
    """

    big_endian: bool = False


Encoding = OpenEXR | RadianceHDR | FloatTIFF | LogLuv | PFM | RawFloat

SUFFIXES: dict[str, Encoding] = {
    ".exr": OpenEXR(),
    ".hdr": RadianceHDR(),
    ".pic": RadianceHDR(),
    ".rgbe": RadianceHDR(),
    ".xyze": RadianceHDR(xyz=True),
    ".tif": FloatTIFF(),
    ".tiff": FloatTIFF(),
    ".pfm": PFM(),
    ".float": RawFloat(),
    ".float.gz": RawFloat(),
}


def suffix_of(path: PurePath) -> str:
    """The ending that names a format, in small letters; ".float.gz" is one."""
    name = path.name.lower()
    return ".float.gz" if name.endswith(".float.gz") else path.suffix.lower()

"""What a developed picture is shown on, as values that are passed in: `write_display(path, values, DisplayP3())`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from relume.image.colour import PQ_PEAK, hlg_gamma

DIFFUSE_WHITE = 203.0
"""cd/m², what a white sheet of paper is shown as on HDR screens (ITU-R BT.2408, table 1)."""


@dataclass(frozen=True)
class Srgb:
    """An ordinary screen: PNG, JPEG (8 bits) or TIFF of sRGB values, with their profile.

    bits : 8 or 16; 8, which every program reads
    """

    bits: Literal[8, 16] = 8

    def __post_init__(self) -> None:
        _refuse_bits(self.bits)


@dataclass(frozen=True)
class DisplayP3:
    """A screen of wider primaries, as phones and laptops have: PNG, JPEG (8 bits) or TIFF, with its profile.

    bits : 8 or 16; 8, which every program reads
    """

    bits: Literal[8, 16] = 8

    def __post_init__(self) -> None:
        _refuse_bits(self.bits)


@dataclass(frozen=True)
class PQ:
    """An HDR screen by absolute luminance (SMPTE ST 2084, BT.2100): a 10-bit AVIF.

    peak : cd/m², brighter is shown as that; 1000 is what most HDR pictures are made for
    white : cd/m², what the display value 1 is shown as; 203 is BT.2408's
    """

    peak: float = 1000.0
    white: float = DIFFUSE_WHITE

    def __post_init__(self) -> None:
        _refuse_levels(self.white, self.peak, PQ_PEAK)


@dataclass(frozen=True)
class HLG:
    """An HDR screen by hybrid log-gamma (BT.2100), which ordinary screens show too: a 10-bit AVIF.

    peak : cd/m² of the screen that it is made for, 400 to 2000, which sets the system gamma: 1.2 at 1000
    white : cd/m², what the display value 1 is shown as there; 203 is BT.2408's, and three quarters of the signal
    """

    peak: float = 1000.0
    white: float = DIFFUSE_WHITE

    def __post_init__(self) -> None:
        _refuse_levels(self.white, self.peak, PQ_PEAK)
        hlg_gamma(self.peak)


@dataclass(frozen=True)
class HdrGainMap:
    """A JPEG that every program shows, with a gain map by which HDR screens show what is brighter than white.

    headroom : stops above white that are kept; 3 are 1600 cd/m² above BT.2408's white, more than most screens have
    quality : of both JPEGs, 1 to 100; 95 shows no blocks
    """

    headroom: float = 3.0
    quality: int = 95

    def __post_init__(self) -> None:
        if not 0 < self.headroom <= 16:
            raise ValueError(f"headroom is {self.headroom}; expected stops above white, more than 0 and at most 16")
        if not isinstance(self.quality, int) or not 1 <= self.quality <= 100:
            raise ValueError(f"quality is {self.quality}; give a whole number, 1 to 100")


Display = Srgb | DisplayP3 | PQ | HLG | HdrGainMap


def _refuse_bits(bits: int) -> None:
    if bits not in (8, 16):
        raise ValueError(f"bits is {bits}; expected 8 or 16")


def _refuse_levels(white: float, peak: float, most: float) -> None:
    if not 0 < white <= peak <= most:
        raise ValueError(f"white is {white} and peak {peak} cd/m²; expected 0 < white ≤ peak ≤ {most:g}")

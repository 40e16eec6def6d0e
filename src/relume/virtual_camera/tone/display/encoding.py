"""What a developed picture is shown on, as values that are passed in, and the codes that such a screen is sent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np

from relume.image.bands import in_threads
from relume.image.colour import PQ_PEAK, encode_hlg, encode_pq, encode_srgb, hlg_gamma, hlg_scene
from relume.image.primaries import BT2020, P3, REC709, between
from relume.virtual_camera.tone.display.code_table import Clipping, CodeTable, code_table, coded

DIFFUSE_WHITE = 203.0
"""cd/m², what a white sheet of paper is shown as on HDR screens (ITU-R BT.2408, table 1)."""


@dataclass(frozen=True)
class _OfBits:
    """A screen whose codes have 8 or 16 bits."""

    bits: Literal[8, 16] = 8

    def __post_init__(self) -> None:
        if self.bits not in (8, 16):
            raise ValueError(f"bits is {self.bits}; expected 8 or 16")


@dataclass(frozen=True)
class _OfLevels:
    """An HDR screen by its peak and by what the display value 1 is shown as, cd/m²."""

    peak: float = 1000.0
    white: float = DIFFUSE_WHITE

    def __post_init__(self) -> None:
        if not 0 < self.white <= self.peak <= PQ_PEAK:
            raise ValueError(
                f"white is {self.white} and peak {self.peak} cd/m²; expected 0 < white ≤ peak ≤ {PQ_PEAK:g}"
            )


@dataclass(frozen=True)
class Srgb(_OfBits):
    """An ordinary screen: PNG, JPEG (8 bits) or TIFF of sRGB values, with their profile.

    bits : 8 or 16; 8, which every program reads
    """


@dataclass(frozen=True)
class DisplayP3(_OfBits):
    """A screen of wider primaries, as phones and laptops have: PNG, JPEG (8 bits) or TIFF, with its profile.

    bits : 8 or 16; 8, which every program reads
    """


@dataclass(frozen=True)
class PQ(_OfLevels):
    """An HDR screen by absolute luminance (SMPTE ST 2084, BT.2100): a 10-bit AVIF.

    peak : cd/m², brighter is shown as that; 1000 is what most HDR pictures are made for
    white : cd/m², what the display value 1 is shown as; 203 is BT.2408's
    """


@dataclass(frozen=True)
class HLG(_OfLevels):
    """An HDR screen by hybrid log-gamma (BT.2100), which ordinary screens show too: a 10-bit AVIF.

    peak : cd/m² of the screen that it is made for, 400 to 2000, which sets the system gamma: 1.2 at 1000
    white : cd/m², what the display value 1 is shown as there; 203 is BT.2408's, and three quarters of the signal
    """

    def __post_init__(self) -> None:
        super().__post_init__()
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


_MOST = np.float32(1e30)  # infinity times a matrix's 0 is no number
_ROWS = 64


def encoded(
    values: np.ndarray,
    display: Display = Srgb(),
    *,
    gain: float = 1.0,
    through: Callable[[np.ndarray], np.ndarray] | None = None,
) -> np.ndarray:
    """The codes of `encoded_and_clipped` alone, for pictures whose ends have been looked at."""
    return encoded_and_clipped(values, display, gain=gain, through=through)[0]


def encoded_and_clipped(
    values: np.ndarray,
    display: Display = Srgb(),
    *,
    gain: float = 1.0,
    through: Callable[[np.ndarray], np.ndarray] | None = None,
) -> tuple[np.ndarray, Clipping]:
    """Codes (H, W, 3) of linear display values, and the share of pixels that the display cannot show as they are.

    values : (H, W, 3) float32, linear Rec. 709, 1 = white
    display : sRGB by default, which every program shows
    gain : what values are multiplied by first. Of radiance it is an exposure, and with sRGB both are one pass
    through : what makes display values of `values`, of any of their rows alike, before that; none where they are
    returns : uint8, or uint16 for 16 bits, PQ and HLG, whose signal 1 is 65535; of a gain map the base. sRGB codes are
        the rounding of the curve exactly, those of others of the float32 values in their primaries
    Raises ValueError for NaN, whose first pixel it names, and for another shape or type.
    """
    if through is not None and not isinstance(display, Srgb):
        values = through(values)
    match display:
        case Srgb(bits):
            return coded(values, _srgb(bits), gain, through)
        case HdrGainMap():
            return coded(values, _srgb(8), gain)
        case DisplayP3(bits):
            return coded(_banded(values, between(REC709, P3), gain), _srgb(bits))
        case PQ(peak, white):
            return coded(_banded(values, between(REC709, BT2020), gain), _pq(peak, white))
        case HLG(peak, white):
            light = _banded(
                values, between(REC709, BT2020), gain, lambda rows: hlg_scene(white * rows, peak) + np.minimum(rows, 0)
            )
            return coded(light, _hlg())


@lru_cache(maxsize=2)
def _srgb(bits: int) -> CodeTable:
    return code_table(encode_srgb, bits)


@lru_cache(maxsize=4)
def _pq(peak: float, white: float) -> CodeTable:
    return code_table(lambda values: encode_pq(np.minimum(white * values, peak)), 16)


@lru_cache(maxsize=1)
def _hlg() -> CodeTable:
    return code_table(encode_hlg, 16)


def _banded(
    values: np.ndarray,
    matrix: np.ndarray,
    gain: float,
    further: Callable[[np.ndarray], np.ndarray] | None = None,
) -> np.ndarray:
    """The values times gain in other primaries, some rows at a time, and each band taken further by `further`."""
    if values.ndim != 3 or values.shape[2] != 3 or values.dtype != np.float32:
        raise ValueError(f"values are {values.shape} {values.dtype}; expected (H, W, 3) float32")
    if not (np.isfinite(gain) and gain > 0):
        raise ValueError(f"gain is {gain}; expected a positive number")
    columns = (gain * matrix.T).astype(np.float32)
    result = np.empty_like(values)

    def work(begin: int, end: int) -> None:
        rows = np.clip(values[begin:end], -_MOST, _MOST) @ columns
        result[begin:end] = rows if further is None else further(rows)

    in_threads(work, len(values), chunk=_ROWS)
    return result

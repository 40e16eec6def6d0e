"""Linear display values made into the codes that a screen is sent."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from relume.image.colour import encode_hlg, encode_pq, encode_srgb, hlg_scene
from relume.image.primaries import BT2020, P3, REC709, between
from relume.virtual_camera.tone.display.clipping import Clipping
from relume.virtual_camera.tone.display.code_table import CodeTable, code_table, coded
from relume.virtual_camera.tone.display.displays import HLG, PQ, Display, DisplayP3, HdrGainMap, Srgb

_MOST = np.float32(1e30)  # infinity times a matrix's 0 is no number
_ROWS = 64


def encoded(values: np.ndarray, display: Display = Srgb(), *, gain: float = 1.0) -> np.ndarray:
    """The codes of `encoded_and_clipped` alone, for pictures whose ends have been looked at."""
    return encoded_and_clipped(values, display, gain=gain)[0]


def encoded_and_clipped(
    values: np.ndarray, display: Display = Srgb(), *, gain: float = 1.0
) -> tuple[np.ndarray, Clipping]:
    """Codes (H, W, 3) of linear display values, and the share of pixels that the display cannot show as they are.

    values : (H, W, 3) float32, linear Rec. 709, 1 = white
    display : sRGB by default, which every program shows
    gain : what values are multiplied by first. Of radiance it is an exposure, and with sRGB both are one pass
    returns : uint8, or uint16 for 16 bits, PQ and HLG, whose signal 1 is 65535; of a gain map the base. sRGB codes are
        the rounding of the curve exactly, those of others of the float32 values in their primaries
    Raises ValueError for NaN, whose first pixel it names, and for another shape or type.
    """
    match display:
        case Srgb(bits):
            return coded(values, _srgb(bits), gain)
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
    from relume._kernel import in_threads

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

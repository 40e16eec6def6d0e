"""A developed picture written for the display it is meant for."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np

from relume.image import files
from relume.image.bands import in_threads
from relume.image.photograph import Photograph
from relume.image.primaries import P3, REC709
from relume.virtual_camera.tone.display.code_table import Clipping, clipping_of
from relume.virtual_camera.tone.display.encoding import (
    HLG,
    PQ,
    Display,
    DisplayP3,
    HdrGainMap,
    Srgb,
    encoded_and_clipped,
)

_ROWS = 64
_SUFFIXES = {
    Srgb: (".png", ".jpg", ".jpeg", ".tif", ".tiff"),
    DisplayP3: (".png", ".jpg", ".jpeg", ".tif", ".tiff"),
    PQ: (".avif",),
    HLG: (".avif",),
    HdrGainMap: (".jpg", ".jpeg"),
}


def write_display(
    path: str | os.PathLike[str],
    values: np.ndarray,
    display: Display = Srgb(),
    *,
    gain: float = 1.0,
    through: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Clipping:
    """Write linear display values, whole or not at all, as a picture for `display`.

    path : .png, .jpg (8 bits, quality 95, full colour resolution) or .tif for `Srgb` and `DisplayP3`, each with its
        ICC profile; .avif for `PQ` and `HLG`; .jpg for `HdrGainMap`
    values : (H, W, 3) float32, linear Rec. 709, 1 = white; in PQ, HLG and gain maps what is above 1 stays brighter
    gain : what values are multiplied by first; of radiance it is an exposure
    through : makes display values of `values` before that; nothing is done unless given
    returns : the share of pixels that the file cannot hold as they are, for the caller to report
    Raises ValueError for NaN, another suffix or shape, and where the part that writes AVIF is missing;
    OutputNotWritten.
    """
    require_suffix_for(path, display)
    suffix = Path(path).suffix.lower()
    if isinstance(display, HdrGainMap):
        values = values if through is None else through(values)
        return _write_gain_map(path, values if gain == 1 else values * np.float32(gain), display)
    if isinstance(display, Srgb | DisplayP3) and display.bits == 16 and suffix in (".jpg", ".jpeg"):
        raise ValueError(f"{path}: a JPEG holds 8 bits a channel; write .png or .tif, or give bits=8")
    codes, clipping = encoded_and_clipped(values, display, gain=gain, through=through)
    if isinstance(display, PQ | HLG):
        from relume.image.files.photographs import avif

        avif.write_avif(path, codes, avif.PQ if isinstance(display, PQ) else avif.HLG)
    else:
        files.write(path, Photograph(codes, "developed picture", profile=profile_of(display)))
    return clipping


def require_suffix_for(path: str | os.PathLike[str], display: Display) -> None:
    """Refuse, before any work is done, a file that a display's pictures are not written to; raises ValueError."""
    suffix = Path(path).suffix.lower()
    if suffix not in (wanted := _SUFFIXES[type(display)]):
        kind = type(display).__name__
        others = [each.__name__ for each, suffixes in _SUFFIXES.items() if suffix in suffixes]
        hint = f"; that is for {' or '.join(others)}" if others else ""
        raise ValueError(f'{path} ends in "{suffix}"{hint}; a picture for {kind} is written to {", ".join(wanted)}')


def profile_of(display: Srgb | DisplayP3) -> bytes:
    """The ICC profile of what `encoded` makes for a display, for a photograph that carries it."""
    from relume.image.files.metadata.icc_profile import screen_profile

    return screen_profile(P3, "Display P3") if isinstance(display, DisplayP3) else screen_profile(REC709, "sRGB")


def _write_gain_map(path: str | os.PathLike[str], values: np.ndarray, display: HdrGainMap) -> Clipping:
    from relume.image.files.gain_map import gain_map

    base, dark = encoded_and_clipped(values, display)
    brightest = np.float32(2.0**display.headroom)
    bright = np.empty_like(values)

    def work(begin: int, end: int) -> np.ndarray:
        bright[begin:end] = np.clip(values[begin:end], 0, brightest)
        return np.count_nonzero(values[begin:end] > brightest, axis=(0, 1))

    above = np.sum(in_threads(work, len(values), chunk=_ROWS), axis=0)
    gain_map.write_rendition(path, bright, base, display.quality)
    return Clipping(clipping_of(above, np.zeros(3), values.shape[0] * values.shape[1]).above, dark.below)

"""Two renditions of a picture, one for ordinary and one for bright displays, made into a JPEG with a gain map.

The gains are computed against the base as it comes out of its JPEG, so that what the JPEG loses is made good. What
remains is what 8 bits of gain and the map's own JPEG cannot hold; it is measured. libultrahdr (imagecodecs) would make
the base itself by its own tone curve, where here it is the picture that relume has developed.
"""

from __future__ import annotations

import io
import math
import os

import numpy as np
from PIL import Image

from relume.image.bands import in_threads
from relume.image.colour import luminance, triple
from relume.image.files.gain_map import applying as gain_map_applying
from relume.image.files.gain_map import layout as gain_map_layout
from relume.image.files.gain_map import metadata as gain_map_metadata
from relume.image.files.gain_map.applying import Pictures
from relume.image.files.gain_map.metadata import GainMapMetadata, rounded
from relume.image.files.metadata import icc_profile, xmp
from relume.image.files.metadata.icc_profile import screen_profile
from relume.image.files.photographs import jpeg_segments as jpeg
from relume.image.primaries import REC709

_OFFSET = 1 / 64  # of Ultra HDR 1.1: keeps the gains of dark pixels small
_LEAST = 1e-6  # stops
_LOST = 0.05  # of luminance, in 1 pixel of 100: what is for the eye loses as much in any JPEG
_LONGEST = 65500  # pixels a side that libjpeg writes
_ROWS = 64


def encoded_rendition(
    path: str | os.PathLike[str], bright: np.ndarray, base: np.ndarray, quality: int
) -> tuple[bytes, str]:
    """A gain-map JPEG of two renditions of a picture, both made for displays: nothing of it is measured light.

    bright : (H, W, 3) float32, linear Rec. 709, 1 = the base's white, finite and at least 0
    base : (H, W, 3) uint8 sRGB, what every program shows
    returns : all bytes of the file, and a sentence on what it loses, "" where that is little
    Raises ValueError for a size that no JPEG has.
    """
    height, width = bright.shape[:2]
    if max(height, width) > _LONGEST or min(height, width) < 1:
        raise ValueError(f"{path}: the picture is {width} x {height}; a JPEG has 1 to {_LONGEST} a side: write .exr")
    base_jpeg = _jpeg(base, quality)
    shown = _decoded(base_jpeg)
    linear = icc_profile.srgb().curves[:, 0]
    metadata = _metadata(bright, shown, linear)
    map_jpeg = _jpeg(_codes(bright, shown, linear, metadata), quality)
    given = Pictures(shown, _decoded(map_jpeg), icc_profile.srgb().curves, REC709, REC709, metadata)
    return _assembled(base_jpeg, map_jpeg, metadata), _losses(given, bright)


def _metadata(bright: np.ndarray, shown: np.ndarray, linear: np.ndarray) -> GainMapMetadata:
    """Gains from the least to the greatest of each channel, for the base as it is `shown`."""

    def work(begin: int, end: int) -> tuple[np.ndarray, np.ndarray]:
        gains = _gains(bright[begin:end], linear[shown[begin:end]])
        return gains.min((0, 1)), gains.max((0, 1))

    parts = in_threads(work, len(bright), chunk=_ROWS)
    # Outwards to a fraction that both forms hold, so that no gain is beyond the codes.
    low = triple(np.array([rounded(float(gain) - _LEAST) for gain in np.min([part[0] for part in parts], axis=0)]))
    high = triple(np.array([rounded(float(gain) + _LEAST) for gain in np.max([part[1] for part in parts], axis=0)]))
    headroom = rounded(max(math.log2(max(float(bright.max(initial=0)), 1.0)), 2**-10))
    return GainMapMetadata(low, high, bright_headroom=headroom)


def _gains(bright: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Stops from the base as it is `shown` (linear) to the bright picture, per channel."""
    return np.log2((bright + np.float32(_OFFSET)) / (shown + np.float32(_OFFSET)))


def _codes(bright: np.ndarray, shown: np.ndarray, linear: np.ndarray, metadata: GainMapMetadata) -> np.ndarray:
    """(H, W, 3) uint8 gain map."""
    low, high = np.array(metadata.low, np.float32), np.array(metadata.high, np.float32)
    codes = np.empty(bright.shape, np.uint8)

    def work(begin: int, end: int) -> None:
        gains = _gains(bright[begin:end], linear[shown[begin:end]])
        codes[begin:end] = np.rint(255 * np.clip((gains - low) / (high - low), 0, 1))

    in_threads(work, len(bright), chunk=_ROWS)
    return codes


def _jpeg(codes: np.ndarray, quality: int) -> bytes:
    file = io.BytesIO()
    Image.fromarray(codes).save(file, "JPEG", quality=quality, subsampling=0)
    return file.getvalue()


def _decoded(data: bytes) -> np.ndarray:
    """What a reader sees of a JPEG that was just made, and so is whole."""
    with Image.open(io.BytesIO(data)) as image:
        return np.asarray(image)


def _losses(given: Pictures, bright: np.ndarray) -> str:
    """What the file loses of luminance, where it is much; shares of light below the offset are taken of the offset."""
    found, wanted = luminance(gain_map_applying.bright(given)), luminance(bright)
    half, most = np.percentile(np.abs(found - wanted) / np.maximum(wanted, np.float32(_OFFSET)), (50, 99))
    if most <= _LOST:
        return ""
    return f"a gain map keeps luminance to {half:.1%} in half of the pixels and {most:.1%} in 99 of 100"


def _assembled(base: bytes, gain_map: bytes, metadata: GainMapMetadata) -> bytes:
    """Both JPEGs with all that describes them, in the order of Ultra HDR 1.1, figure 1."""
    block = jpeg.segment(jpeg.APP2, jpeg.ISO_GAIN_MAP + gain_map_metadata.to_iso(metadata))
    parameters = gain_map_metadata.with_description(xmp.packet({}), gain_map_metadata.description(metadata))
    gain_map = jpeg.with_segments(gain_map, [jpeg.segment(jpeg.APP1, jpeg.XMP + parameters), block])
    packet = gain_map_metadata.with_description(xmp.packet({}), gain_map_metadata.directory(len(gain_map)))
    heads = [
        jpeg.segment(jpeg.APP1, jpeg.XMP + packet),
        jpeg.segment(jpeg.APP2, jpeg.ICC + b"\x01\x01" + screen_profile(REC709, "sRGB")),
        jpeg.segment(jpeg.APP2, jpeg.ISO_GAIN_MAP + gain_map_metadata.VERSION),
    ]
    return gain_map_layout.assembled(base, gain_map, heads)

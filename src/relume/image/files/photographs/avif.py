"""AVIF pictures for HDR screens: 10 bits, PQ or HLG, BT.2020, by libavif and AOM (imagecodecs)."""

from __future__ import annotations

import os

import numpy as np

from relume.image.bands import in_threads
from relume.image.files.atomic import replacing
from relume.image.files.signatures import one_line

PQ, HLG = 16, 18
"""Transfer characteristics as ITU-T H.273, table 3, numbers them."""
_BT2020 = 9  # H.273, tables 2 and 4: its primaries, and its matrix of non-constant luminance
_BITS = 10
_QUALITY = 95  # of 100: a smooth grade is off by one of 1023 at most and shows no bands
_SPEED = 10  # 6 takes five times as long for files of the same size
_THREADS = min(os.cpu_count() or 1, 16)
_ROWS = 64


def write_avif(path: str | os.PathLike[str], signal: np.ndarray, transfer: int) -> None:
    """Write a picture for HDR screens as a 10-bit 4:2:0 AVIF, colours tagged 9/16/9 (PQ) or 9/18/9 (HLG), full range.

    signal : (H, W, 3) uint16, R′, G′, B′ of BT.2020 primaries through the transfer curve, 65535 = 1
    transfer : `PQ` or `HLG`

    4:2:0 (a pixel has its own luma and shares its colour with three neighbours) is what every screen decodes.
    Raises ValueError for a size that AV1 has not; OutputNotWritten.
    """
    import imagecodecs

    try:
        encoded = imagecodecs.avif_encode(
            _ten_bits(signal),
            level=_QUALITY,
            speed=_SPEED,
            bitspersample=_BITS,
            pixelformat=imagecodecs.AVIF.PIXEL_FORMAT.YUV420,
            codec=imagecodecs.AVIF.CODEC_CHOICE.AOM,
            primaries=_BT2020,
            transfer=transfer,
            matrix=_BT2020,
            numthreads=_THREADS,
        )
    except imagecodecs.AvifError as error:
        height, width = signal.shape[:2]
        raise ValueError(
            f"{path}: a picture of {width}×{height} pixels is not written as AVIF ({one_line(error)}); resize it, or "
            "write a gain map"
        ) from None
    with replacing(path) as temporary:
        temporary.write_bytes(encoded)


def _ten_bits(signal: np.ndarray) -> np.ndarray:
    """uint16 codes 0 to 1023 of 0 to 65535, rounded."""
    codes = np.empty_like(signal)

    def work(begin: int, end: int) -> None:
        codes[begin:end] = (signal[begin:end].astype(np.uint32) * 1023 + 32767) // 65535

    in_threads(work, len(signal), chunk=_ROWS)
    return codes

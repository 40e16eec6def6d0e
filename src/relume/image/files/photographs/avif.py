"""AVIF pictures for HDR screens: 10 bits, PQ or HLG, BT.2020, by libavif and AOM (imagecodecs)."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from relume.image.files.atomic import replacing
from relume.image.files.signatures import one_line

PQ, HLG = 16, 18
"""Transfer characteristics as ITU-T H.273, table 3, numbers them."""
_BT2020 = 9  # H.273, tables 2 and 4: its primaries, and its matrix of non-constant luminance
_BITS = 10
_SPEED = 10  # 6 takes five times as long for files of the same size
_THREADS = min(os.cpu_count() or 1, 16)
_ROWS = 64


def write_avif(path: str | os.PathLike[str], signal: np.ndarray, transfer: int, *, quality: int = 95) -> None:
    """Write a picture for HDR screens as a 10-bit 4:2:0 AVIF, colours tagged 9/16/9 (PQ) or 9/18/9 (HLG), full range.

    signal : (H, W, 3) uint16, R′, G′, B′ of BT.2020 primaries through the transfer curve, 65535 = 1
    transfer : `PQ` or `HLG`
    quality : 0 to 100; at 95 a smooth grade is off by one of 1023 at most and shows no bands

    4:2:0 (a pixel has its own luma and shares its colour with three neighbours) is what every screen decodes.
    Raises ValueError for another shape or suffix, and a size that AV1 has not; OutputNotWritten.
    """
    if Path(path).suffix.lower() != ".avif":
        raise ValueError(f'{path} ends in "{Path(path).suffix}"; PQ and HLG pictures are written to .avif')
    if signal.ndim != 3 or signal.shape[2] != 3 or signal.dtype != np.uint16:
        raise ValueError(f"signal is {signal.shape} {signal.dtype}; expected (H, W, 3) uint16")
    if transfer not in (PQ, HLG):
        raise ValueError(f"transfer is {transfer}; expected 16, PQ, or 18, HLG")
    if not 0 <= quality <= 100:
        raise ValueError(f"quality is {quality}; expected 0 to 100, the best")
    import imagecodecs

    try:
        encoded = imagecodecs.avif_encode(
            _ten_bits(signal),
            level=quality,
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
    from relume._kernel import in_threads

    codes = np.empty_like(signal)

    def work(begin: int, end: int) -> None:
        codes[begin:end] = (signal[begin:end].astype(np.uint32) * 1023 + 32767) // 65535

    in_threads(work, len(signal), chunk=_ROWS)
    return codes

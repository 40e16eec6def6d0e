"""AVIF pictures for HDR screens: 10 bits, PQ or HLG, BT.2020, by SVT-AV1. PyAV is imported at first use.

SVT-AV1 has 4:2:0 alone: a pixel has its own luma, and shares its colour with three neighbours.
"""

from __future__ import annotations

import os
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import OutputNotWritten
from relume.image.files.atomic import replacing
from relume.image.files.signatures import one_line

PQ, HLG = 16, 18
"""Transfer characteristics as ITU-T H.273, table 3, numbers them."""
_BT2020 = 9  # H.273, tables 2 and 4: its primaries, and its matrix of non-constant luminance
_FULL_RANGE = 2  # FFmpeg's number; black is 0 and white 1023
_FORMAT = "yuv420p10le"
_ENCODER = "libsvtav1"
_WIDEST, _HIGHEST = 16384, 8704  # what SVT-AV1 takes
_SMALLEST = 64  # at 16 rows of 130 pixels SVT-AV1 4.1 waits for itself for ever; 64 is the least it was made for
_PRESET = "8"  # 24 megapixels in about a second; 6 takes four times as long for files a fifth smaller
_PAIRS = 32  # of rows


def write_avif(path: str | os.PathLike[str], signal: np.ndarray, transfer: int, *, rate_factor: int = 2) -> None:
    """Write a picture for HDR screens as a 10-bit 4:2:0 AVIF, colours tagged 9/16/9 (PQ) or 9/18/9 (HLG), full range.

    signal : (H, W, 3) uint16, R′, G′, B′ of BT.2020 primaries through the transfer curve, 65535 = 1
    transfer : `PQ` or `HLG`
    rate_factor : SVT-AV1's constant rate factor, 1 to 63; at 2 a value is off by about one of 1023 where there is
        noise, so that grades do not show as bands

    Raises ValueError for another shape or suffix, a size that the encoder refuses, and where PyAV or its encoder is
    missing; OutputNotWritten.
    """
    if Path(path).suffix.lower() != ".avif":
        raise ValueError(f'{path} ends in "{Path(path).suffix}"; PQ and HLG pictures are written to .avif')
    if signal.ndim != 3 or signal.shape[2] != 3 or signal.dtype != np.uint16:
        raise ValueError(f"signal is {signal.shape} {signal.dtype}; expected (H, W, 3) uint16")
    if transfer not in (PQ, HLG):
        raise ValueError(f"transfer is {transfer}; expected 16, PQ, or 18, HLG")
    if not 1 <= rate_factor <= 63:
        raise ValueError(f"rate_factor is {rate_factor}; expected 1, the best, to 63")
    height, width = signal.shape[:2]
    if min(height, width) < _SMALLEST or width > _WIDEST or height > _HIGHEST:
        raise ValueError(
            f"{path}: the picture is {width}×{height}; an AVIF by SVT-AV1 is {_SMALLEST}×{_SMALLEST} to "
            f"{_WIDEST}×{_HIGHEST} pixels: resize it, or write a gain map"
        )
    _refuse_without_encoder()
    with replacing(path) as temporary:
        _encode(path, temporary, planes(signal), transfer, rate_factor)


def planes(signal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Luma (H, W) and the two chroma (⌈H/2⌉, ⌈W/2⌉), uint16 of 10 bits, full range (BT.2100-2, tables 6 and 9).

    signal : (H, W, 3) uint16, R′, G′, B′; 65535 = 1. A chroma value is the mean of the four pixels that share it
    """
    from relume._kernel import in_threads
    from relume.image.files.photographs.avif_kernels import luma_and_chroma

    height, width = signal.shape[:2]
    half = ((height + 1) // 2, (width + 1) // 2)
    luma, blue, red = np.empty((height, width), np.uint16), np.empty(half, np.uint16), np.empty(half, np.uint16)
    in_threads(lambda begin, end: luma_and_chroma(signal, begin, end, luma, blue, red), half[0], chunk=_PAIRS)
    return luma, blue, red


def _refuse_without_encoder() -> None:
    try:
        import av
    except ImportError:
        raise ValueError('an AVIF needs PyAV, which is not installed: pip install "relume[video]"') from None
    if _ENCODER not in av.codecs_available or "avif" not in av.formats_available:
        raise ValueError("this PyAV was built without SVT-AV1 or AVIF; install PyAV's own wheel, or write a gain map")


def _encode(
    path: str | os.PathLike[str],
    temporary: Path,
    parts: tuple[np.ndarray, np.ndarray, np.ndarray],
    transfer: int,
    rate_factor: int,
) -> None:
    import av
    from av.error import FFmpegError

    # The encoder tells its settings on stderr, where they would stand among a program's own lines, unless told not to.
    os.environ.setdefault("SVT_LOG", "1")
    options = {"crf": str(rate_factor), "preset": _PRESET, "svtav1-params": "avif=1"}
    height, width = parts[0].shape
    try:
        with av.open(str(temporary), "w", format="avif") as container:
            stream: Any = container.add_stream(_ENCODER, rate=Fraction(1), options=options)
            stream.width, stream.height, stream.pix_fmt = width, height, _FORMAT
            frame: Any = av.VideoFrame(width, height, _FORMAT)
            for plane, part in zip(frame.planes, parts, strict=True):
                rows = np.frombuffer(plane, np.uint16).reshape(plane.height, -1)
                rows[:, : part.shape[1]] = part
            for tagged in (stream.codec_context, frame):
                tagged.color_primaries, tagged.color_trc, tagged.colorspace = _BT2020, transfer, _BT2020
                tagged.color_range = _FULL_RANGE
            container.mux(stream.encode(frame))
            container.mux(stream.encode())
    except (OSError, FFmpegError) as error:
        reason = one_line(getattr(error, "strerror", None) or error)
        raise OutputNotWritten(f"{path}: cannot be written: {reason}; choose another place") from error

"""Movies: 8-bit sRGB frames as H.264 in .mp4, which every browser and player shows.

PyAV is imported at first use.
"""

from __future__ import annotations

import contextlib
import os
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from relume.errors import OutputNotWritten
from relume.image.files.atomic import replacing
from relume.image.files.signatures import one_line

_QUALITY = "16"
"""x264's constant rate factor: finer than what looks like the frames (18), so that an editor may cut it again."""
_BT709 = 1  # ITU-T H.273: primaries, transfer and matrix of Rec. 709 all have the number 1
_LIMITED = 1  # black 16, white 235, which players expect of H.264


class Movie:
    """A movie that takes frame after frame and becomes a file when its block ends well, and no file when it fails.

        with Movie("turntable.mp4") as movie:
            movie.add(frame)

    path : ends in .mp4
    frames_per_second : 24 unless given, cinema's, which every player shows without dropping or doubling frames

    4:2:0 colour needs even sizes, so that the last row and column of an odd one are repeated once.

    Raises ValueError for another suffix, a rate that is not above 0, a movie without frames, or where PyAV is missing;
    OutputNotWritten.
    """

    def __init__(self, path: str | os.PathLike[str], frames_per_second: float | Fraction = 24) -> None:
        try:
            import av  # noqa: F401
        except ImportError:
            raise ValueError('a movie needs PyAV, which is not installed: pip install "relume[video]"') from None
        self.path = Path(path)
        if self.path.suffix.lower() != ".mp4":
            raise ValueError(f'{path} ends in "{self.path.suffix}"; a movie is written to .mp4')
        if not 0 < frames_per_second < 1000:
            raise ValueError(f"frames_per_second is {frames_per_second}; expected above 0 and below 1000, as 24")
        self.rate = Fraction(frames_per_second).limit_denominator(1001)  # 1001 is NTSC's: 24000/1001
        self._shape: tuple[int, ...] | None = None
        self._container: Any = None
        self._stream: Any = None

    def __enter__(self) -> Movie:
        self._place = replacing(self.path)
        self._temporary = self._place.__enter__()
        return self

    def add(self, frame: np.ndarray) -> None:
        """Append a frame, (H, W, 3) uint8 sRGB; raises ValueError for another shape or kind, OutputNotWritten."""
        import av

        if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3 or 0 in frame.shape:
            raise ValueError(f"a frame is {frame.shape} {frame.dtype}; expected (H, W, 3) uint8")
        if self._shape not in (None, frame.shape):
            raise ValueError(
                f"a frame is {frame.shape}, those before it {self._shape}; frames of a movie have one size"
            )
        height, width = frame.shape[:2]
        even = np.pad(frame, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
        with self._as_output_error():
            if self._shape is None:
                self._open(even.shape[1], even.shape[0])
            self._shape = frame.shape
            picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(even), format="rgb24")
            picture = picture.reformat(format="yuv420p", dst_colorspace=_BT709, dst_color_range=_LIMITED)
            self._container.mux(self._stream.encode(picture))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is None and self._container is None:
                raise ValueError(f"{self.path}: a movie without frames; add at least one")
            if error is None:
                with self._as_output_error():
                    self._container.mux(self._stream.encode())
                    self._container.close()
        except BaseException:
            self._abandon()
            raise
        if error is None:
            self._place.__exit__(None, None, None)
        else:
            self._abandon()

    def _open(self, width: int, height: int) -> None:
        import av

        self._container = av.open(str(self._temporary), "w", format="mp4", options={"movflags": "+faststart"})
        self._stream = self._container.add_stream("libx264", rate=self.rate, options={"crf": _QUALITY})
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, "yuv420p"
        codec = self._stream.codec_context
        codec.color_primaries = codec.color_trc = codec.colorspace = _BT709

    def _abandon(self) -> None:
        """Close and remove the temporary file; the block's own error, an OSError too, is not the file's."""
        with contextlib.suppress(Exception):
            if self._container is not None:
                self._container.close()
        with contextlib.suppress(_Abandoned):
            self._place.__exit__(_Abandoned, _Abandoned(), None)

    @contextlib.contextmanager
    def _as_output_error(self) -> Any:
        """What PyAV raises, as OutputNotWritten."""
        from av.error import FFmpegError

        try:
            yield
        except (OSError, FFmpegError) as error:
            reason = one_line(getattr(error, "strerror", None) or error)
            raise OutputNotWritten(f"{self.path}: cannot be written: {reason}; choose another place") from error


class _Abandoned(Exception):
    """Makes `replacing` remove its temporary file."""

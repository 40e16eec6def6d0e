"""Frames of anyone's videos, one after another or by their number.

PyAV is imported at first use.
"""

from __future__ import annotations

import bisect
import contextlib
import itertools
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image.files.signatures import one_line
from relume.image.files.video.wholeness import Wholeness, damaged, undamaged_pictures, warn_of_early_end
from relume.image.photograph import Photograph

_BT709 = 1  # ITU-T H.273: primaries, transfer and matrix of Rec. 709 all have the number 1
VIDEOS = (".mp4", ".mov", ".m4v", ".mkv", ".webm", ".avi", ".mxf", ".mpg", ".mpeg", ".mts")
"""Suffixes of the containers that video cameras and editors write."""
_UNSPECIFIED, _BT601 = 2, 5
_HIGH_DEFINITION = 720
"""Rows from which on a video that does not say its matrix has that of Rec. 709, below that of Rec. 601."""
_HDR = {16: "PQ", 18: "HLG"}
"""H.273's numbers of the transfers that are for HDR screens."""
_TIMED = ("mov", "matroska")
"""Containers, by their first name of FFmpeg, that hold the time at which each picture is shown."""
_ASTRAY = 16
"""Pictures by which times after a jump are off at most: H.264 holds back as many."""


@dataclass(frozen=True)
class Video:
    """What a video file holds.

    path : of it
    frames : how many pictures
    rate : a second, on average
    """

    path: Path
    frames: int
    rate: Fraction

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in pixels, upright: of the first picture, which is decoded for it."""
        height, width = read_video_frame(self.path, 1).pixels.shape[:2]
        return width, height


def is_video(path: str | os.PathLike[str]) -> bool:
    """Whether a file goes by the suffix of a video."""
    return Path(path).suffix.lower() in VIDEOS


def read_video(path: str | os.PathLike[str]) -> Video:
    """How many pictures a video has and at which rate; raises as `read_video_frame`.

    Warns where it ends before its container says it does.
    """
    index = _index_of(Path(path))
    warn_of_early_end(Path(path), index.early)
    return Video(Path(path), len(index.times), index.rate)


def read_video_frame(path: str | os.PathLike[str], number: int) -> Photograph:
    """One picture of a video as an encoded photograph, upright: 8 bits, or 16 where the video has more.

    number : 1 for the first, as frames of films are numbered; it is the picture that `video_frames` gives at this place
    Colours are converted by the matrix and range that the video names; one that names none has Rec. 709's matrix from
    720 rows on and Rec. 601's below. Values keep the video's own curve. Containers other than .mp4, .mov, .mkv and
    .webm are decoded once as a whole before the first picture. Raises UnreadableFile for a damaged picture, for a
    number that it has not and for one made for HDR screens; ValueError where PyAV is missing. Warns of fields.
    """
    path = Path(path)
    index = _index_of(path)
    if not 1 <= number <= len(index.times):
        raise UnreadableFile(f"{path}: it has the frames 1 to {len(index.times)}, and frame {number} was asked for")
    for start in index.starts(number):
        with _decoding(path) as (container, stream):
            container.seek(start, stream=stream, backward=True)
            frame = _sought(container.decode(stream), index, number)
            if frame is not None and not frame.is_corrupt:
                return _photograph(path, frame, number)
    # No place before the picture leads to it: all are counted, as `video_frames` does.
    with _decoding(path) as (container, stream):
        for frame in itertools.islice(container.decode(stream), number - 1, number):
            if frame.is_corrupt:
                raise damaged(path, number)
            return _photograph(path, frame, number)
    raise UnreadableFile(f"{path}: frame {number} cannot be decoded; convert the video to H.264 in .mp4")


@dataclass(frozen=True)
class _Index:
    """Where the pictures of a video are.

    times : when each is shown, in the video's own unit, in order; None where its container does not say
    keys : times of the pictures that need no other, from which decoding can start
    prints : a checksum of each picture where several may have one time, else empty
    rate : a second
    early : how it ends before its container says so, in words, else empty
    """

    times: tuple[int | None, ...]
    keys: tuple[int, ...]
    prints: tuple[int, ...]
    rate: Fraction
    early: str

    def starts(self, number: int) -> Iterator[int]:
        """Key pictures from which to decode in search of a picture.

        The one just before it is not enough: pictures between two key pictures may need both.
        """
        time = self.times[number - 1]
        before = 0 if time is None else bisect.bisect_right(self.keys, time)
        for back in (2, 5):
            if before > back:
                yield self.keys[before - back]

    def is_past(self, time: int | None, number: int) -> bool:
        """Whether a picture shown at this time comes so late that the sought one comes no more."""
        last = self.times[min(number - 1 + _ASTRAY, len(self.times) - 1)]
        return time is not None and last is not None and time > last


def _sought(frames: Iterator[Any], index: _Index, number: int) -> Any:
    """The sought one among the pictures that are decoded after a jump; None where it is not there."""
    for place, frame in enumerate(frames):
        if index.prints:
            # Times after a jump may be off, and pictures broken: only what looks like the picture is it.
            if _print(frame) == index.prints[number - 1]:
                return frame
        # The first picture after a jump may be one whose neighbours were not decoded.
        elif frame.pts == index.times[number - 1] and (place > 0 or frame.key_frame):
            return frame
        if index.is_past(frame.pts, number):
            return None
    return None


def _index_of(path: Path) -> _Index:
    try:
        facts = path.stat()
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be opened: {one_line(error.strerror or error)}; check the path") from None
    return _indexed(path, facts.st_size, facts.st_mtime_ns)


@lru_cache(maxsize=16)
def _indexed(path: Path, size: int, modified: int) -> _Index:
    with _decoding(path) as (container, stream):
        rate = stream.average_rate
        index = _by_packets(container, stream, rate)
    if index is None:
        with _decoding(path) as (container, stream):
            index = _by_pictures(container, stream, rate)
    if not index.times or not rate:
        raise UnreadableFile(f"{path}: its pictures have no times; convert the video to H.264 in .mp4")
    return index


def _by_packets(container: Any, stream: Any, rate: Fraction) -> _Index | None:
    """The index of a container that says when each picture is shown, without decoding; None of another."""
    # VP8 has packets of pictures that are never shown.
    if container.format.name.split(",")[0] not in _TIMED or stream.codec_context.name in ("vp8", "libvpx"):
        return None
    # An edit list discards pictures before the first that is shown; they are there for decoding alone.
    whole, packets = Wholeness(container, stream), []
    for packet in container.demux(stream):
        whole.take(packet)
        if packet.size and not packet.is_discard:
            packets.append(packet)
    times = [packet.pts for packet in packets]
    if None in times or len(set(times)) < len(times):
        return None
    keys = sorted(packet.pts for packet in packets if packet.is_keyframe)
    return _Index(tuple(sorted(times)), tuple(keys), (), rate, whole.early())


def _by_pictures(container: Any, stream: Any, rate: Fraction) -> _Index:
    """The index of any video: every picture is decoded, as `video_frames` does."""
    times, keys, prints = list[int | None](), list[int](), list[int]()
    whole = Wholeness(container, stream)
    for packet in container.demux(stream):
        whole.take(packet)
        for frame in packet.decode():
            whole.show(frame)
            times.append(frame.pts)
            prints.append(_print(frame))
            if frame.key_frame and frame.pts is not None:
                keys.append(frame.pts)
    return _Index(tuple(times), tuple(sorted(keys)), tuple(prints), rate, whole.early())


def _print(frame: Any) -> int:
    """A checksum of a decoded picture's values, without what pads its rows."""
    result = 0
    parts = frame.format.components
    for plane in frame.planes:
        held = plane.width * -(-parts[0].bits // 8) * (1 if len(frame.planes) >= len(parts) else len(parts))
        rows = np.frombuffer(plane, np.uint8)[: plane.height * plane.line_size].reshape(plane.height, plane.line_size)
        result = zlib.crc32(rows[:, :held].tobytes(), result)
    return result


def video_frames(path: str | os.PathLike[str]) -> Iterator[np.ndarray]:
    """All frames of a video one after another, (H, W, 3) uint8, upright.

    They are converted and refused as by `read_video_frame`. Raises UnreadableFile at a damaged one too; warns at the
    end where the video ends before its container says it does.
    """
    path = Path(path)
    with _decoding(path) as (container, stream):
        for number, frame in enumerate(undamaged_pictures(path, container, stream), 1):
            yield _photograph(path, frame, number, deep=False).pixels


def video_rate(path: str | os.PathLike[str]) -> Fraction:
    """The frames a second that a video states, 24 where it states none; raises as `read_video_frame`."""
    with _decoding(Path(path)) as (_, stream):
        return Fraction(stream.average_rate or 24)


@contextlib.contextmanager
def _decoding(path: Path) -> Iterator[tuple[Any, Any]]:
    """The open container and its first video stream; what PyAV raises is an UnreadableFile."""
    try:
        import av
        from av.error import FFmpegError
    except ImportError:
        raise ValueError('a video needs PyAV, which is not installed: pip install "relume[video]"') from None
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise UnreadableFile(f"{path}: holds no pictures; give the video")
            stream = container.streams.video[0]
            # Frames are decoded side by side: a half of the time on two cores.
            stream.thread_type = "AUTO"
            yield container, stream
    except (OSError, FFmpegError) as error:
        reason = one_line(getattr(error, "strerror", None) or error)
        raise UnreadableFile(f"{path}: cannot be read as a video: {reason}; copy it again or convert it") from None


def _photograph(path: Path, frame: Any, number: int, deep: bool = True) -> Photograph:
    """A decoded picture as a photograph, upright.

    deep : whether a video of more than 8 bits gives 16
    """
    if (made_for := _HDR.get(int(frame.color_trc))) is not None:
        raise UnreadableFile(f"{path}: made for HDR screens ({made_for}); convert it to Rec. 709 or sRGB")
    if frame.interlaced_frame:
        warn(f"{path}: its pictures are fields of two moments, row by row; make whole pictures of them first")
    deep = deep and frame.format.components[0].bits > 8
    matrix = int(frame.colorspace)
    if matrix == _UNSPECIFIED:
        matrix = _BT709 if frame.height >= _HIGH_DEFINITION else _BT601
    from av.video.reformatter import ColorRange, Interpolation

    exactly = Interpolation.BICUBIC | Interpolation.ACCURATE_RND | Interpolation.FULL_CHR_H_INT
    full = {"src_color_range": ColorRange.JPEG} if int(frame.color_range) == int(ColorRange.JPEG) else {}
    picture = frame.reformat(
        format="rgb48le" if deep else "rgb24", src_colorspace=matrix, interpolation=exactly, **full
    )
    # The turn that players make, counter-clockwise.
    pixels = np.rot90(picture.to_ndarray(), k=round(frame.rotation / 90) % 4)
    return Photograph(np.ascontiguousarray(pixels), f"{path.name}, frame {number}")

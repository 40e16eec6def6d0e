"""Whether all of a video is there: packets that are damaged, and how many pictures its container says it has."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from relume.errors import UnreadableFile, warn

_COUNTED = ("mov", "avi")
"""Containers, by their first name of FFmpeg, that say how many pictures they hold, also where the end is cut off."""
_LASTING = ("matroska", "mxf")
"""Those that say how long they last."""
_NOTHING_SHOWN = 1.0


@dataclass
class Wholeness:
    """What came of a video, beside what its container says.

    packets : that held anything
    pictures : how many were decoded; 0 where packets alone are read
    until : seconds, to which the last picture is shown
    lost : times of damaged packets whose picture has not come
    """

    container: Any
    stream: Any
    packets: int = 0
    pictures: int = 0
    until: float = 0.0
    lost: set[int] = field(default_factory=set)

    def take(self, packet: Any) -> None:
        """Count a packet of the container."""
        self.packets += bool(packet.size)
        if packet.is_corrupt:
            self.lost.add(packet.pts if packet.pts is not None else packet.dts)
        elif packet.size:
            self._lasts(packet)

    def show(self, frame: Any) -> bool:
        """Count a picture that is decoded; whether it is undamaged."""
        self.pictures += 1
        self._lasts(frame)
        damaged = frame.is_corrupt or bool(self.lost & {frame.pts, frame.dts})
        self.lost -= {frame.pts, frame.dts}
        return not damaged

    def early(self) -> str:
        """How a video ends before its container says it does, in words; empty for one that does not.

        Transport streams and others that do not say it are whole.
        """
        rate = self.stream.average_rate
        if not rate:
            return ""
        kind, found = self.container.format.name.split(",")[0], self.pictures or self.packets - len(self.lost)
        if kind in _COUNTED:
            # An AVI has numbers without a packet, of pictures that are shown again; an MP4 packets that are not shown.
            reached = max(self.packets - len(self.lost), round(self.until * float(rate)))
            missing = self.stream.frames - reached
        else:
            missing = round((self._seconds(kind) - self.until) * float(rate))
        if missing <= 0 and not self.lost:
            return ""
        stated = self.stream.frames if kind in _COUNTED else 0
        return f"ends early: {found} of {stated or found + max(missing, len(self.lost))} frames"

    def _lasts(self, shown: Any) -> None:
        if shown.pts is not None:
            one = float(1 / self.stream.average_rate) if self.stream.average_rate else 0.0
            length = max(float((shown.duration or 0) * shown.time_base), one)
            self.until = max(self.until, float(shown.pts * shown.time_base) + length)

    def _seconds(self, kind: str) -> float:
        """How long the pictures last by the container; 0 where it does not say."""
        if kind not in _LASTING:
            return 0.0
        if (text := self.stream.metadata.get("DURATION")) and text.count(":") == 2:
            hours, minutes, seconds = (float(part) for part in text.split(":"))
            return 3600 * hours + 60 * minutes + seconds
        if self.stream.duration:
            return float(self.stream.duration * self.stream.time_base)
        # Of several streams the longest counts, and sound may go on.
        alone = len(self.container.streams) == 1 and self.container.duration
        return self.container.duration / 1e6 if alone else 0.0


def undamaged_pictures(path: Path, container: Any, stream: Any) -> Iterator[Any]:
    """A video's decoded pictures one after another.

    Raises UnreadableFile at a damaged one. Warns at the end where the video ends before its container says it does.
    """
    whole = Wholeness(container, stream)
    for packet in container.demux(stream):
        whole.take(packet)
        for frame in packet.decode():
            if not whole.show(frame):
                raise damaged(path, whole.pictures)
            yield frame
    warn_of_early_end(path, whole.early())


def damaged(path: Path, number: int) -> UnreadableFile:
    """That a picture, 1 for the first, is damaged."""
    return UnreadableFile(f"{path}: frame {number} is damaged in the file; copy it again, or cut it to what is whole")


def warn_of_early_end(path: Path, words: str) -> None:
    """Warn of what `Wholeness.early` says, if anything: of frames that are missing no light is right."""
    if words:
        warn(f"{path} {words}; copy it again", _NOTHING_SHOWN)

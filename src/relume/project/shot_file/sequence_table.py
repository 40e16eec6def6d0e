"""The tables of a shot file that make it a sequence: which frames, and the keys of what moves in them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Annotated, Literal, Protocol

from pydantic import Field, field_validator, model_validator

from relume.project.schema import Names, Positive, Table, Vector

MOST = 1_000_000
"""Frames of a sequence, at most: eleven hours of cinema."""
Frame = Annotated[float, Field(ge=0)]


class ObjectKey(Table):
    """Where an object is at a frame; what a key does not say is interpolated between the keys that do."""

    frame: Frame
    translate: Vector | None = None
    rotate: Vector | None = None
    scale: Positive | None = None


class CameraKey(Table):
    """Where the plate's camera was at a frame."""

    frame: Frame
    position: Vector | None = None
    look_at: Vector | None = None
    focal_length: Positive | None = None


class LightKey(Table):
    """How far the light is turned about +Y at a frame, degrees, and how much brighter it is, stops."""

    frame: Frame
    turn: float | None = None
    exposure: float | None = None


class SequenceTable(Table):
    """Which frames are made, and how time goes in them.

    frames : as "1-120", "1-120x2" or "1-120:2" for every second, "5,7,9", or a list of numbers
    rate : a second
    interpolation : between keys
    shutter : when it opens and closes, shares of a frame's time about the frame's moment; without it nothing blurs
    plates : one photograph or radiance map a frame, for a camera that moves or a place that changes; the last number in
        each name is its frame's. Or one video, whose first picture is number 1
    offset : frames added to those of the sequence for the numbers of the plates
    """

    frames: tuple[int, ...]
    rate: Positive = 24.0
    interpolation: Literal["linear", "smooth", "step"] = "linear"
    shutter: tuple[float, float] | None = None
    plates: Names | None = None
    offset: int = 0

    @field_validator("frames", mode="before")
    @classmethod
    def _listed(cls, value: object) -> object:
        return frames_in(value) if isinstance(value, str) else value

    @field_validator("frames")
    @classmethod
    def _some(cls, value: tuple[int, ...]) -> tuple[int, ...]:
        if not value or min(value) < 0 or len(value) > MOST:
            raise ValueError(f"{len(value)} frames; give 1 to {MOST}, numbered from 0 up, as 1-120")
        return tuple(sorted(set(value)))

    @model_validator(mode="after")
    def _shutter_in_order(self) -> SequenceTable:
        if self.shutter is not None and not -1 <= self.shutter[0] <= self.shutter[1] <= 1:
            raise ValueError(
                f"shutter is {list(self.shutter)}; expected shares from -1 to 1, in order, as [-0.25, 0.25]"
            )
        return self


def frames_in(text: str) -> tuple[int, ...]:
    """The frames that a text lists: numbers and ranges with commas between them; "1-9x2" is every second from 1.

    OpenJD writes "1-9:2" for the same, and ranges that fall have a step that does, as 9-1x-2. Raises ValueError naming
    the part that is neither.
    """
    found: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d+)(?:\s*-\s*(\d+)(?:\s*[x:]\s*(-?\d+))?)?\s*", part, re.ASCII)
        if match is None or len(part) > 40:
            raise ValueError(f"{part.strip()[:40]!r} is no frame; give numbers and ranges, as 1-120, 1-120x2 or 5,7,9")
        first, last, step = int(match[1]), int(match[2] or match[1]), int(match[3] or 1)
        if step == 0 or (last - first) * step < 0:
            raise ValueError(f"{part.strip()!r} has no frames; the first comes first, and every step is 1 or more")
        if (last - first) // step + len(found) >= MOST:
            raise ValueError(f"{part.strip()!r} makes more than {MOST} frames; expected fewer")
        found.extend(range(first, last + (1 if step > 0 else -1), step))
    return tuple(found)


def frames_as_text(frames: Iterable[int]) -> str:
    """The shortest list of numbers and ranges that farms read, as 1-9:2,12: rising, each frame once."""
    parts: list[str] = []
    left = sorted(set(frames))
    while left:
        # As far as the step of the first two goes.
        step = left[1] - left[0] if len(left) > 1 else 1
        length = next((k for k in range(1, len(left)) if left[k] != left[0] + k * step), len(left))
        run, left = left[:length], left[length:]
        if len(run) < 3:
            parts += map(str, run)
        else:
            parts.append(f"{run[0]}-{run[-1]}" + (f":{step}" if step > 1 else ""))
    return ",".join(parts)


class _Key(Protocol):
    @property
    def frame(self) -> float: ...


def require_rising(keys: Sequence[_Key]) -> None:
    """Raises ValueError where two keys have one frame, or a later one comes first."""
    for first, second in pairwise(keys):
        if second.frame <= first.frame:
            raise ValueError(
                f"keyframes: frame {second.frame:g} comes after {first.frame:g}; give them in rising order"
            )

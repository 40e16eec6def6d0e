"""An arm of strobes: it turns once about the subject, and its lamps flash one after another all the while.

Light Stage 2: "Thirty strobe lights are arrayed along the length of the arm, and flash in rapid sequence repeatedly as
the arm rotates" (Hawkins, Cohen, Tchou & Debevec 2001). So a film runs along the arm first and about the axis second;
the arm of the first Light Stage, with its one lamp, goes the other way (`rotating_arm`). Angles are measured as there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.errors import InvalidStage, warn
from relume.lightstage.field.lights import StageLights


@dataclass(frozen=True)
class StrobeArm:
    """A semicircular arm of strobes from +Y to −Y, filmed with a frame a flash.

    lamps : on the arm, at the middles of as many bands of the half circle; they flash from the top down
    columns : sequences of flashes a turn; the film holds lamps · columns frames of light
    start : the frame of the first flash
    azimuth : of the arm at the first flash, radians from +Z towards +X
    clockwise : it turns from +Z towards −X
    drift : how much of the way to the next column the arm turns during one sequence: 1, as it turns steadily, unless
        given; 0 for an arm that stands still while its lamps flash
    upwards : they flash from the bottom up

    Raises ValueError for fewer than one lamp or column, a start below 0, and a drift beyond 0 to 1.
    """

    lamps: int
    columns: int
    start: int = 0
    azimuth: float = 0.0
    clockwise: bool = False
    drift: float = 1.0
    upwards: bool = False

    def __post_init__(self) -> None:
        if self.lamps < 1 or self.columns < 1 or self.start < 0:
            raise ValueError(
                f"{self.lamps} lamps, {self.columns} columns, start {self.start}; expected ≥ 1, ≥ 1 and ≥ 0"
            )
        if not 0 <= self.drift <= 1 or not np.isfinite(self.azimuth):
            raise ValueError(f"drift {self.drift}, azimuth {self.azimuth}; expected a drift of 0 to 1 and an angle")

    def directions(self) -> np.ndarray:
        """Unit directions (lamps · columns, 3) towards the lamps in the order of their flashes."""
        lamp, column = np.tile(np.arange(self.lamps), self.columns), np.repeat(np.arange(self.columns), self.lamps)
        along = self.lamps - 1 - lamp if self.upwards else lamp
        inclination = (along + 0.5) * np.pi / self.lamps
        turned = (column + self.drift * lamp / self.lamps) / self.columns
        azimuth = self.azimuth + (-1 if self.clockwise else 1) * 2 * np.pi * turned
        across = np.sin(inclination)
        return np.stack([across * np.sin(azimuth), np.cos(inclination), across * np.cos(azimuth)], axis=-1)

    def grid_lights(self, frame_count: int) -> tuple[np.ndarray, StageLights]:
        """The frames (N,) of all lights, ring by ring from the top as grids are, and the lights.

        Names are `frame_000123`, so that they sort as frames follow. Warns of frames after the turn, which are left
        out. Raises InvalidStage where a film of `frame_count` frames does not hold every flash of the turn.
        """
        count = self.lamps * self.columns
        held = frame_count - self.start
        if held < count:
            sequences, rest = divmod(max(held, 0), self.lamps)
            raise InvalidStage(
                f"the film of {frame_count} frames holds {sequences} sequences of {self.lamps} lamps and {rest} more "
                f"frames from frame {self.start}, not the {self.columns} of a turn; check the lamps and the start, or "
                "give fewer columns"
            )
        if held > count:
            warn(f"the film goes on for {held - count} frames after the arm's turn; they are left out")
        flashes = np.arange(count).reshape(self.columns, self.lamps).T
        order = (flashes[::-1] if self.upwards else flashes).ravel()
        frames = order + self.start
        names = tuple(f"frame_{frame:06d}" for frame in frames)
        return frames, StageLights.towards(self.directions()[order], names, grid=(self.lamps, self.columns))

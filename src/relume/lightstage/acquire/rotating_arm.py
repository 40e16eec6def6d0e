"""A spinning stage: one lamp on two axes, filmed, so that every frame is a light of its own.

The lamp goes round the vertical axis without a stop while its inclination is lowered a step a revolution (Debevec et
al. 2000, §3.1). Azimuth is measured at +Y from +Z towards +X, inclination from +Y; radians. Revolutions are counted
from where the azimuth is `start_azimuth`: after k + s of them, 0 ≤ s < 1, the lamp is s of a turn beyond, on ring k.

The film is a video, whose frames are 8-bit sRGB as players show them, or a folder of frames.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.capture.exposure.folder import name_order
from relume.errors import BallNotFound, InvalidStage
from relume.image import files
from relume.image.files.video import video_frames
from relume.image.photograph import Photograph
from relume.lightstage.acquire.ball_highlights import MirrorBall, find_highlight
from relume.lightstage.acquire.stage_file import LightEntry, Stage
from relume.lightstage.field.lights import StageLights

FRAMES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".exr", ".hdr")

WRONG = np.radians(20)
"""An azimuth that is farther off than that is another thing than the lamp."""
FEWEST = 8
"""Highlights from which a rotation is found; two unknowns, and some of the readings are wrong."""
_MID_EXPOSURE = 0.25
"""Of a frame's time, when the lamp is where the frame shows it: film and video mostly open the shutter for a half."""

GridLights = Callable[[int], tuple[np.ndarray, StageLights]]
"""Which frames (N,) of a film of so many hold the lights of a grid, and these lights in the same order."""


@dataclass(frozen=True)
class SteadyRotation:
    """A motor: the same rate throughout.

    revolutions_per_frame : of the stage over the film's frames a second: 25 a minute at 30 a second is 1/72
    start : the frame, with its fraction, in which the first ring begins
    """

    revolutions_per_frame: float
    start: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.revolutions_per_frame < 0.5 or not np.isfinite(self.start):
            raise ValueError(
                f"{self}: expected revolutions a frame above 0 and below a half, and a finite start; turn slower, or "
                "film faster"
            )

    def revolutions(self, frames: np.ndarray) -> np.ndarray:
        """How far the lamp has gone in the middle of each frame's exposure."""
        return (np.asarray(frames, np.float64) + _MID_EXPOSURE - self.start) * self.revolutions_per_frame


@dataclass(frozen=True)
class RotatingArm:
    """The course of the lamp.

    rotation : round the vertical axis
    rings : how many there are; 32 in the paper
    first_inclination, step : of the first ring, and from each to the next; rings at the middles of 32 bands of the
        half circle unless given, (k + ½) π/32
    start_azimuth : where each ring begins; +Z, from where the camera looks, unless given
    clockwise : whether it turns from +Z towards −X; not unless given
    """

    rotation: SteadyRotation
    rings: int = 32
    first_inclination: float = float(np.pi / 64)
    step: float = float(np.pi / 32)
    start_azimuth: float = 0.0
    clockwise: bool = False

    def __post_init__(self) -> None:
        last = self.first_inclination + (self.rings - 1) * self.step
        if self.rings < 1 or not (0 <= self.first_inclination <= np.pi and -1e-9 <= last <= np.pi + 1e-9):
            raise ValueError(
                f"{self.rings} rings from {self.first_inclination:.3f} by {self.step:.3f} rad; expected one or more "
                "whose inclinations lie between 0 and π"
            )

    def directions(self, frames: np.ndarray) -> np.ndarray:
        """Unit directions (N, 3) towards the lamp at frames (N,); NaN before the first ring and after the last."""
        counted = self.rotation.revolutions(frames)
        inside = (counted >= 0) & (counted < self.rings)
        inclination = np.where(inside, self.first_inclination + np.floor(counted) * self.step, np.nan)
        azimuth = self.start_azimuth + (-1 if self.clockwise else 1) * 2 * np.pi * counted
        across = np.sin(inclination)
        return np.stack([across * np.sin(azimuth), np.cos(inclination), across * np.cos(azimuth)], axis=-1)

    def grid_lights(self, columns: int, frame_count: int) -> tuple[np.ndarray, StageLights]:
        """The frames (N,) of an even grid, and its lights, each where the lamp was in its own frame.

        They are nearest to the azimuths (j + ½)/columns of a turn from the start. Names are `frame_000123`, so that
        they sort as frames follow. Raises InvalidStage where a film of `frame_count` frames does not go so far, or has
        fewer frames a turn than columns: one of them would be two lights.
        """
        counted = self.rotation.revolutions(np.arange(frame_count))
        inside = np.flatnonzero((counted >= 0) & (counted < self.rings))
        if len(inside) == 0 or counted[-1] < self.rings - 1 / columns or counted[0] > 1 / columns:
            reached = f"revolutions {counted[0]:.2f} to {counted[-1]:.2f}"
            raise InvalidStage(
                f"the film of {frame_count} frames shows {reached}, not the {self.rings} rings of the stage; check the "
                "rate and the start, or give fewer rings"
            )
        wanted = np.arange(self.rings)[:, None] + (np.arange(columns) + 0.5) / columns
        after = np.clip(np.searchsorted(counted, wanted), 1, frame_count - 1)
        chosen = np.where(counted[after] - wanted < wanted - counted[after - 1], after, after - 1)
        if len(np.unique(chosen)) != chosen.size:
            raise InvalidStage(
                f"{len(inside) / self.rings:.1f} frames a turn are fewer than {columns} columns; take fewer columns"
            )
        frames = chosen.ravel()
        grid = (self.rings, columns) if self.step > 0 else None
        names = tuple(f"frame_{frame:06d}" for frame in frames)
        return frames, StageLights.towards(self.directions(frames), names, grid=grid)


def fit_rotation(directions: np.ndarray, *, start_azimuth: float = 0.0, clockwise: bool = False) -> SteadyRotation:
    """The rate and the start of a steady rotation, from where a mirrored ball shows the lamp in each frame.

    directions : (N, 3) of all frames in their order; NaN where it was not seen. The first pass of the start azimuth
        after the first sight begins the first ring

    Of all rates the one is taken that, undone, leaves the azimuths most alike (their periodogram's peak), so that
    gaps and wrong readings do not matter; a line through what is left refines it. sin θ weighs, because near the pole
    an azimuth says little.
    Raises InvalidStage for too few, and for azimuths that no rate makes alike.
    """
    seen = np.flatnonzero(np.isfinite(directions).all(axis=1))
    if len(seen) < FEWEST:
        raise InvalidStage(f"the lamp is seen in {len(seen)} frames; its rotation is found from {FEWEST} or more")
    x, _, z = directions[seen].T
    phasor = (z + 1j * x) if not clockwise else (z - 1j * x)
    time = seen + _MID_EXPOSURE

    def likeness(rates: np.ndarray) -> np.ndarray:
        return np.abs(np.exp(-2j * np.pi * rates[:, None] * time) @ phasor) / np.abs(phasor).sum()

    # A peak is one over the film's length wide: four samples across it, then ever finer about the best.
    length = float(np.ptp(time)) + 1
    width = 1 / (4 * length)
    rates = np.arange(width, 0.5, width)
    best = float(rates[int(np.argmax(np.concatenate([likeness(part) for part in np.array_split(rates, 64)])))])
    while width > 1e-4 / length:
        rates = best + np.linspace(-width, width, 41)
        best, width = float(rates[int(np.argmax(likeness(rates)))]), width / 10
    if likeness(np.array([best]))[0] < 0.5:
        raise InvalidStage(
            "the lamp's azimuths follow no steady rotation this way round; turn the sense, or give each pass's signal"
        )
    # What is left of each azimuth, about the most common one: a line through those that are near gives rate and start.
    turned = np.exp(-2j * np.pi * best * time) @ phasor
    left = np.angle(phasor * np.exp(-2j * np.pi * best * time) / turned)
    slope, offset = 0.0, 0.0
    for _ in range(10):
        near = np.abs(left - offset - slope * time) < WRONG
        slope, offset = np.polyfit(time[near], left[near], 1, w=np.abs(phasor[near]))
    rate = best + slope / (2 * np.pi)
    phase = np.angle(turned) + offset + (1 if clockwise else -1) * start_azimuth
    start = float(-phase / (2 * np.pi * rate))
    return SteadyRotation(float(rate), float(start + np.ceil((time[0] - start) * rate - 1e-6) / rate))


def fit_rings(directions: np.ndarray, rotation: SteadyRotation) -> tuple[float, float]:
    """The first inclination and the step of the rings, from where a mirrored ball shows the lamp.

    directions : (N, 3) of all frames; NaN where it was not seen

    The median of each complete ring stands for it, and a line through the medians is fitted by least squares. Raises
    InvalidStage where fewer than two rings were seen.
    """
    counted = rotation.revolutions(np.arange(len(directions)))
    inclination = np.arccos(np.clip(directions[:, 1], -1, 1))
    complete = int(np.floor(counted[-1] + 1 / max(len(directions), 1)))
    rows = [(k, inclination[(np.floor(counted) == k) & np.isfinite(inclination)]) for k in range(complete)]
    seen = [(k, float(np.median(row))) for k, row in rows if len(row)]
    if len(seen) < 2:
        raise InvalidStage(f"the lamp is seen on {len(seen)} rings; its step is found from two or more")
    step, first = np.polyfit([k for k, _ in seen], [i for _, i in seen], 1)
    return float(first), float(step)


def lamp_directions(pictures: Iterable[np.ndarray], ball: MirrorBall) -> np.ndarray:
    """Where a mirrored ball shows the lamp in each frame (H, W, 3) of a film: (N, 3) unit, NaN where it shows none."""
    directions = []
    for picture in pictures:
        try:
            point = find_highlight(picture, ball.outline)
        except BallNotFound:
            directions.append(np.full(3, np.nan))
        else:
            directions.append(ball.reflections(np.array([point]))[1][0])
    return np.array(directions).reshape(-1, 3)


def frame_paths(folder: str | os.PathLike[str]) -> tuple[Path, ...]:
    """The frames in a folder in the order of their names, 9 before 10; raises InvalidStage where there are none."""
    found = [path for path in Path(folder).iterdir() if path.suffix.lower() in FRAMES and not path.name.startswith(".")]
    if not found:
        raise InvalidStage(f"{folder}: no frames; it holds none of {', '.join(FRAMES)}")
    return tuple(sorted(found, key=name_order))


def stage_of_frames(paths: Sequence[Path], grid_lights: GridLights) -> Stage:
    """The stage of a film's frames, all in one folder and in their order; none is read.

    Raises InvalidStage where the film does not go round the stage.
    """
    frames, lights = grid_lights(len(paths))
    return _stage([paths[frame].name for frame in frames], lights)


def unpack_video(video: str | os.PathLike[str], folder: Path, grid_lights: GridLights) -> Stage:
    """Write the frames of a stage's grid as PNG to a folder, and give the stage of them.

    Raises InvalidStage where the film does not go round the stage, UnreadableFile, OutputNotWritten.
    """
    frame_count = sum(1 for _ in video_frames(video))
    frames, lights = grid_lights(frame_count)
    names = {int(frame): f"{name}.png" for frame, name in zip(frames, lights.names, strict=True)}
    for index, pixels in enumerate(video_frames(video)):
        if index in names:
            files.write(folder / names[index], Photograph(pixels, names[index]))
    return _stage(list(names.values()), lights)


def _stage(names: list[str], lights: StageLights) -> Stage:
    entries = tuple(
        LightEntry({"": (file,)}, (x, y, z), name=name, solid_angle=float(angle))
        for file, name, (x, y, z), angle in zip(
            names, lights.names, lights.directions.tolist(), lights.solid_angles, strict=True
        )
    )
    return Stage(entries, grid=lights.grid)

"""A stage's lamps over a sequence of maps: a table of intensities for each frame, for a live performance in a stage.

"If the required lighting is known beforehand, live-action performance can be captured and composited into live-action
footage … with correct photometric interactions" (course slides, Light Stage 3.0).
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from relume.errors import warn
from relume.image.files import write_text
from relume.lightstage.driving.driving import Drive, LampPrimaries, driven, seen_of
from relume.lightstage.driving.subjects import MeasuredSubject, SurfaceSubject
from relume.lightstage.field.lights import StageLights
from relume.sphere.environment_map import EnvironmentMap


@dataclass(frozen=True, eq=False)
class DriveSequence:
    """What every lamp of a stage is set to in each frame.

    frames : settings, one a map, of the same lights and primaries; they say what each map's own solve reached
    """

    frames: tuple[Drive, ...]

    @property
    def intensities(self) -> np.ndarray:
        """The intensities (T, N, P) float64 of frames, lights and primaries."""
        return np.stack([frame.intensities for frame in self.frames])

    @property
    def headroom(self) -> float:
        """By what all maps could be multiplied with no lamp above its maximum in any frame."""
        return min(frame.headroom for frame in self.frames)

    @property
    def clipped(self) -> dict[str, int]:
        """Lamps that are at their maximum, by name, with the number of frames in which one of their primaries is."""
        first = self.frames[0]
        bound = np.array([frame.headroom < 1 for frame in self.frames])
        at_maximum = (self.intensities >= first.primaries.maximum * (1 - 1e-9)).any(axis=2) & bound[:, None]
        counts = at_maximum.sum(axis=0)
        return {name: int(count) for name, count in zip(first.lights.names, counts, strict=True) if count}

    @property
    def flicker(self) -> float:
        """How far intensities jump: the rms of their second differences over time as a share of their rms.

        0 under still light and where it changes evenly; of fewer than three frames 0.
        """
        values = self.intensities
        power = float(np.sqrt(np.mean(values**2)))
        return float(np.sqrt(np.mean(np.diff(values, 2, axis=0) ** 2))) / power if len(values) > 2 and power else 0.0


def drive_sequence(
    lights: StageLights,
    maps: Iterable[EnvironmentMap],
    primaries: LampPrimaries | None = None,
    subject: SurfaceSubject | MeasuredSubject = SurfaceSubject(),
    *,
    closeness: float = 0.1,
    smoothing: float = 0.0,
    progress: Callable[[int], None] | None = None,
) -> DriveSequence:
    """The intensities of `drive` for each of the maps, one a frame, as of a `LightSequence`.

    Each frame's least squares has one answer, which follows the map continuously: still light gives the same numbers
    to the bit, and what flickers did so in the maps.

    lights : the stage's lamps
    maps : environment maps, one a frame
    primaries, subject, closeness : as of `drive`
    smoothing : standard deviation, in frames, of a Gaussian over the intensities' time, which is no lag, as frames to
        come are known too; 0 unless given, as it also rounds changes that are meant. It stays within 0 and the
        maximum; `residual` is each frame's own without it
    progress : called with the number of frames that are done
    Warns once of all frames that the stage cannot show. Raises ValueError for no maps, and a smoothing below 0.
    """
    if not 0 <= smoothing < np.inf:
        raise ValueError(f"the smoothing is {smoothing}; give frames, 0 or more")
    lamps = LampPrimaries.rgb() if primaries is None else primaries
    seen = seen_of(lights, lamps, subject)
    frames: list[Drive] = []
    for light in maps:
        frames.append(driven(lights, light, lamps, seen, subject, closeness))
        if progress is not None:
            progress(len(frames))
    if not frames:
        raise ValueError("no maps to drive the stage by; give one or more")
    if smoothing > 0:
        steady = gaussian_filter1d(np.stack([frame.intensities for frame in frames]), smoothing, axis=0, mode="nearest")
        frames = [replace(frame, intensities=values) for frame, values in zip(frames, steady, strict=True)]
    sequence = DriveSequence(tuple(frames))
    _warn(sequence)
    return sequence


def write_drive_sequence(path: str | os.PathLike[str], sequence: DriveSequence) -> None:
    """Write the table as .csv, whole or not at all: frame, light and one column a primary.

    path : .csv
    sequence : as `drive_sequence` solved it

    Frames count from 1. As in `write_drive`, numbers are shares of the maximum where there is one, else factors on a
    primary's irradiance. Raises ValueError for another suffix, OutputNotWritten.
    """
    if not str(path).lower().endswith(".csv"):
        raise ValueError(f"{path}: the settings of a sequence are written to .csv; choose such a name")
    first = sequence.frames[0]
    unit = first.primaries.maximum if np.isfinite(first.primaries.maximum) else 1.0
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(["frame", "light", *first.primaries.names])
    for number, values in enumerate(sequence.intensities / unit, 1):
        for name, row in zip(first.lights.names, values, strict=True):
            table.writerow([number, name, *(f"{value:.9g}" for value in row)])
    write_text(path, text.getvalue())


def _warn(sequence: DriveSequence) -> None:
    short = [number for number, frame in enumerate(sequence.frames, 1) if frame.headroom < 1]
    if short:
        names = [name for name, _ in sorted(sequence.clipped.items(), key=lambda each: -each[1])]
        lamps = f"lamps {', '.join(names[:5])}{' …' if len(names) > 5 else ''} are" if names else "lamps are"
        warn(
            f"in {len(short)} of {len(sequence.frames)} frames, first in {short[0]}, {lamps} at their maximum and the "
            f"stage stays below the maps' level; show the maps times {sequence.headroom:.3g}"
        )
    missed = max(frame.beyond_gamut for frame in sequence.frames)
    if missed > 0.01:
        warn(
            f"up to {missed:.1%} of a frame's light has colours that no mix of "
            f"{', '.join(sequence.frames[0].primaries.names)} makes; the nearest are shown"
        )

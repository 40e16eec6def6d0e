"""A performance under strobes that repeat every n frames: at each moment, its reflectance field (Light Stage 4).

"If the strobes are very fast relative to the frame rate, and all the differently illuminated images are captured and
stored, then performances can be arbitrarily re-illuminated in post-production" (course slides, Light Stage 4.0). A
frame shows one lamp. What another lamp would have shown then is brought from its own frames before and after, along
the motion between them, or between tracking frames, in which all lamps flash.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from relume.errors import InvalidStage
from relume.image import files
from relume.image.files.video import video_frames
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.lightstage.acquire.encoding import PhotographEncoding
from relume.lightstage.acquire.light_files import LIST, read_directions, read_lp
from relume.lightstage.acquire.rotating_arm import frame_paths
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.relight import relight
from relume.lightstage.relighting.relight_settings import RelightSettings
from relume.lightstage.relighting.relit_files import write_frames
from relume.lightstage.relighting.stage_lighting import StageLighting
from relume.lightstage.strobes.frame_motion import FrameMotion, motion_of, warped
from relume.sphere.environment_map import EnvironmentMap

_MISSED = 0.2
"""Of the mean light of a lamp's frames, below which one of them shows that the lamp did not flash."""


@dataclass(frozen=True, eq=False)
class StrobeCycle:
    """What flashes in each frame of a period, which repeats.

    lights : in the order of their flashes, a frame each
    tracking : places in the period, from 0, of frames in which all lamps flash; the lamps' own come between. None
        unless given: then motion is sought between successive frames of one lamp, a period apart
    start : the frame at which the first period begins

    Raises ValueError for a start below 0 and places that are not in the period.
    """

    lights: StageLights
    tracking: tuple[int, ...] = ()
    start: int = 0

    def __post_init__(self) -> None:
        inside = all(0 <= place < self.period for place in self.tracking)
        if self.start < 0 or len(set(self.tracking)) != len(self.tracking) or not inside:
            raise ValueError(
                f"start {self.start}, tracking frames {list(self.tracking)} in a period of {self.period}; expected "
                "places from 0 below the period, each once, and a start from 0"
            )

    @staticmethod
    def listed(path: str | os.PathLike[str], tracking: Sequence[int] = (), start: int = 0) -> StrobeCycle:
        """The cycle whose lamps an .lp, or a plain list of directions, names in the order of their flashes.

        path : the .lp, or the list
        tracking, start : as of the cycle itself
        Raises InvalidStage.
        """
        if Path(path).suffix.lower() == LIST:
            names, directions = read_lp(path)
            return StrobeCycle(StageLights.towards(directions, names), tuple(tracking), start)
        return StrobeCycle(StageLights.towards(read_directions(path)), tuple(tracking), start)

    @property
    def period(self) -> int:
        """Frames after which all repeats."""
        return len(self.lights) + len(self.tracking)

    @property
    def lamp_places(self) -> list[int]:
        """The place of each lamp in the period."""
        return [place for place in range(self.period) if place not in self.tracking]


@dataclass(frozen=True, eq=False)
class StrobeFilm:
    """A film under a cycle of strobes: two periods or more.

    frame : the radiance (H, W, 3) float32 of the film's frame of a number, per irradiance 1 of its lamp
    frame_count : of the film
    cycle : of its lamps

    Raises InvalidStage for a film that is no whole number of periods, has fewer than two, lacks a lamp's flash, or
    whose tracking frames are darker than its lamps'. Every frame is read once for that.
    """

    frame: Callable[[int], np.ndarray]
    frame_count: int
    cycle: StrobeCycle

    def __post_init__(self) -> None:
        held, period = self.frame_count - self.cycle.start, self.cycle.period
        if held < 2 * period or held % period:
            raise InvalidStage(
                f"the film has {held} frames from frame {self.cycle.start} on, {max(held, 0) / period:.2f} periods of "
                f"{period}; expected a whole number of periods, 2 or more: check lamps, start and the film's end"
            )
        means = np.array([float(np.mean(self.frame(self.cycle.start + number))) for number in range(held)])
        self._check(means.reshape(-1, period))

    def _check(self, means: np.ndarray) -> None:
        """Refuse flashes that are missing, from the mean of each frame (periods, period)."""
        places = self.cycle.lamp_places
        usual = np.median(means, axis=0)
        missed = np.argwhere((means < _MISSED * usual) | (means <= 0))
        lamps = [(turn, place) for turn, place in missed if place in places]
        if lamps:
            turn, place = lamps[0]
            name = self.cycle.lights.names[places.index(place)]
            raise InvalidStage(
                f"frame {self.cycle.start + turn * self.cycle.period + place} is dark, where the lamp {name!r} should "
                f"flash ({len(lamps)} such frames); leave that part of the film, or the lamp, out"
            )
        dark = [place for place in self.cycle.tracking if usual[place] <= np.median(usual[places])]
        if dark:
            raise InvalidStage(
                f"frame {self.cycle.start + dark[0]} is no tracking frame: all lamps should flash in it, and it is "
                "darker than a lamp's own; check the places of the tracking frames and the start"
            )

    @property
    def times(self) -> range:
        """The frames at which every lamp has one of its own before or there, and one after or there."""
        places = self.cycle.lamp_places
        return range(self.cycle.start + places[-1], self.frame_count - self.cycle.period + places[0] + 1)

    def field(self, time: float) -> Pictures:
        """The reflectance field at a time, in frames, fractions too; raises ValueError outside of `times`.

        Each lamp's frames before and after are brought there along the motion, and mixed by how near they are. A
        frame that is there already is taken as it is. Motion is even over a period, or from one tracking frame to the
        next, so acceleration a leaves about a·period²/8 pixels.
        """
        if not self.times[0] <= time <= self.times[-1]:
            raise ValueError(
                f"no field at frame {time:g}: all lamps are known from {self.times[0]} to {self.times[-1]}"
            )
        values = [self._lamp(number, time) for number in range(len(self.cycle.lights))]
        return Pictures(np.stack(values), self.cycle.lights)

    def _lamp(self, number: int, time: float) -> np.ndarray:
        """What one lamp shows at a time."""
        first = self.cycle.start + self.cycle.lamp_places[number]
        before = first + int((time - first) // self.cycle.period) * self.cycle.period
        share = (time - before) / self.cycle.period
        if share == 0:
            return np.asarray(self.frame(before), np.float32)
        motion = self._motions[number if not self.cycle.tracking else 0]
        earlier, later = (
            warped(self.frame(taken), motion.places(time, taken)) for taken in (before, before + self.cycle.period)
        )
        return ((1 - share) * earlier + share * later).astype(np.float32)

    @cached_property
    def _motions(self) -> list[FrameMotion]:
        """Of all lamps from tracking frames, else of each lamp from its own."""
        period, start = self.cycle.period, self.cycle.start
        turns = np.arange((self.frame_count - start) // period)[:, None] * period + start
        if self.cycle.tracking:
            return [motion_of((turns + np.array(sorted(self.cycle.tracking))).ravel(), self.frame)]
        return [motion_of((turns + place).ravel(), self.frame) for place in self.cycle.lamp_places]


def read_strobes(source: str | os.PathLike[str], cycle: StrobeCycle, *, encoding: str | None = None) -> StrobeFilm:
    """A strobe film from a video, which is held in memory as 8-bit frames, or from a folder of frames.

    source : the video, or the folder
    cycle : which lamps burn in which frame
    encoding : of photographs, "srgb", "linear" or a response file; sRGB, as players show videos, unless given
    Raises as `StrobeFilm`, UnreadableFile and InvalidStage.
    """
    path = Path(source)
    curve = PhotographEncoding.named(encoding or "srgb", path if path.is_dir() else path.parent)
    if path.is_dir():
        paths = frame_paths(path)

        def from_folder(number: int) -> np.ndarray:
            if files.has_radiance(paths[number]):
                return files.read_radiance(paths[number]).radiance
            return curve.linearised(files.read_photograph(paths[number]))

        return StrobeFilm(from_folder, len(paths), cycle)
    frames = list(video_frames(path))
    return StrobeFilm(lambda number: curve.linearised(Photograph(frames[number], path.name)), len(frames), cycle)


def relit_strobes(
    film: StrobeFilm,
    lights: StageLighting | EnvironmentMap | Sequence[StageLighting | EnvironmentMap],
    settings: RelightSettings = RelightSettings(),
) -> Iterator[RadianceMap]:
    """The performance under any light: a picture for each of the film's `times`, each relit from its own field.

    film : the performance, as `read_strobes` read it
    lights : one for all, or one for each of `times`
    settings : as of `relight`
    Raises ValueError for another number of lights, and as `relight`.
    """
    several = list(lights) if isinstance(lights, Sequence) else [lights] * len(film.times)
    if len(several) != len(film.times):
        raise ValueError(f"{len(several)} lights for the {len(film.times)} frames that have all lamps; give one each")
    return (
        relight(film.field(time), light, settings=settings) for time, light in zip(film.times, several, strict=True)
    )


def relight_strobes(
    film: StrobeFilm,
    lights: StageLighting | EnvironmentMap | Sequence[StageLighting | EnvironmentMap],
    out: str | os.PathLike[str],
    settings: RelightSettings = RelightSettings(),
    *,
    stops: float = 0.0,
) -> int:
    """Write `relit_strobes` as an .mp4 or a folder of frames, as `relight_frames` does, and return their number.

    film : the performance, as `read_strobes` read it
    lights : one for all frames, or one a frame
    out : the .mp4, or the folder
    settings : as of `relight`
    stops : to brighten .mp4 and .png by
    """
    return write_frames(out, relit_strobes(film, lights, settings), stops)

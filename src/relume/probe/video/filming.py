"""`probe_film`: a film of a mirrored ball, or of a 360° camera, in several exposures → an environment map a frame."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from relume.capture.response.camera_profile import CameraProfile
from relume.errors import Doubt, GatheredDoubts, ranked
from relume.image.files.video import is_video, video_frames
from relume.image.radiance import SATURATED
from relume.probe.video.calibrating import BallFilm, FilmCalibration, SphericalFilm, calibrate_film
from relume.probe.video.map_files import appearing, is_store_name, names_in, require_bare, writer
from relume.probe.video.merging import Collected, MomentMap, gains_darkest, merged
from relume.probe.video.motion import brought, flow_between
from relume.probe.video.steadying import Steadying
from relume.sphere.mappings.mapping import LatLong

UNKNOWN_CURVE = 0.2
"""How far a curve that is not known may change the picture, as for single photographs of a ball."""
CLIPPED_DOUBT = 1e-4
"""Share of the light, in lower bounds, from which on saturated lamps make a doubt."""
One = TypeVar("One")
Other = TypeVar("Other")


@dataclass(frozen=True)
class FilmSettings:
    """How a film becomes maps.

    size : rows of the maps; 512 shows what a ball 300 pixels wide does
    period : frames after which the exposures repeat; found unless given
    stops : how much darker each exposure is than the brightest: of facets, else of films, else of the frames of a
        period from the film's first on; found in the film unless given
    steadying : over time; its `latency` and that of alternating exposures add up
    steady_exposure : refuse a film in which everything becomes brighter or darker at once, as by a camera's automatic
    half : store 16 bits a value, with an error of at most 1/2048 of it: a tenth of what a film of 8 bits knows, in a
        sixth of the space and a third of the time
    keep_variance : write the variance too
    """

    size: int = 512
    period: int | None = None
    stops: tuple[float, ...] | None = None
    steadying: Steadying = Steadying()
    steady_exposure: bool = True
    half: bool = True
    keep_variance: bool = False

    def __post_init__(self) -> None:
        if self.size < 8:
            raise ValueError(f"size is {self.size}; a map has at least 8 rows, best 512")
        if self.period is not None and not 1 <= self.period <= 8:
            raise ValueError(f"the period is {self.period} frames; expected 1 to 8")


@dataclass(frozen=True, eq=False)
class FilmProbe:
    """The light that a film showed.

    paths : of the maps, one a frame; of a store their files in it
    calibration : where the film shows the light, and its exposures
    latency : frames by which a map would come later than its frame in a live picture
    clipped : the greatest share of a frame's light that is a lower bound
    clipped_frames : how many frames have any
    stored : half or float, the values in the files
    doubts : what the user should know
    """

    paths: tuple[Path, ...]
    calibration: FilmCalibration
    latency: int
    clipped: float
    clipped_frames: int
    stored: str
    doubts: tuple[Doubt, ...]

    def facts(self) -> dict[str, Any]:
        """Frames, rate, exposures with their errors, rims and latency, for a person."""
        found = self.calibration
        stops = [each.stops for each in found.exposures]
        facts: dict[str, Any] = {
            "frames": found.count,
            "maps a second": float(found.rate),
            "exposures, stops darker": [
                f"{0 - value:.3f} ± {error:.3f}" if error else f"{0 - value:.2f}" for value, error in stops
            ],
            "exposures repeat after": found.courses[0].period,
            "latency, frames": self.latency,
            "stored as": self.stored,
        }
        if any(found.rims):
            facts["rims"] = [",".join(f"{value:.1f}" for value in rim) for rims in found.rims for rim in rims]
        facts["saturated, share of the light at most"] = f"{self.clipped:.3g}"
        return facts


def is_film(path: str | os.PathLike[str]) -> bool:
    """Whether a `path` is that of a video, by its suffix, as .mp4, .mov, .mkv or .mts."""
    return is_video(path)


def probe_film(
    films: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    kind: BallFilm | SphericalFilm = BallFilm(),
    settings: FilmSettings = FilmSettings(),
    *,
    profile: CameraProfile | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> FilmProbe:
    """Make an environment map of every frame of a film, as `out`/map_000001.exr and so on, or as one zarr store.

    films : one, or several of one light that ran together, of one length and rate
    out : a folder, made where it is missing, and empty; named .zarr it becomes a store. All
        maps come into it at once when the last is made
    kind : what the film shows: a mirrored ball, once or through a multi-image filter, or all directions
    settings : size of the maps, exposures, and how they are steadied
    profile : of the camera (`rl.capture.read_profile`), for its response and balance; sRGB unless given, which is off
        by as much as the stated errors and variance say
    progress : called with "look" and "maps" and the share that is done

    The maps are lat-long, relative: the brightest exposure shows 1 as white. Layer `clipped` holds 1 where even the
    darkest exposure is saturated, and 3 where nothing shows the light and it is continued from beside. A folder
    or store of them is what `LightSequence` takes (Waese & Debevec 2001, "A Real Time High Dynamic Range Light Probe").
    Raises UnreadableFile, BallNotFound, NotABracket for exposures that cannot be found or that jump, and for films that
    did not run together; OutputNotWritten; ValueError, also where `out` has the suffix of one picture.
    """
    paths = [Path(films)] if isinstance(films, str | os.PathLike) else [Path(film) for film in films]
    if not paths:
        raise ValueError("no films were given; name a film of a mirrored ball, or of a 360° camera")
    out = Path(out)
    require_bare(out)
    with GatheredDoubts() as gathered:
        # What holds for all frames, found once; a film that cannot be used is refused here.
        progress("look", 0.0)
        found = calibrate_film(
            paths, kind, settings.size, period=settings.period, stops=settings.stops, profile=profile,
            steady=settings.steady_exposure,
        )  # fmt: skip
        progress("look", 1.0)

        # A map of every frame; the files are written by the threads that make the maps.
        shares = []
        with appearing(out) as folder:
            write = writer(
                folder, found, settings.size, half=settings.half, variance=settings.keep_variance,
                store=is_store_name(out),
            )  # fmt: skip

            def written(numbered: tuple[int, MomentMap]) -> float:
                write(*numbered)
                return _clipped_share(numbered[1])

            for share in film_maps(found, settings.steadying, then=written):
                shares.append(share)
                progress("maps", len(shares) / found.count)
    doubts = [*gathered.doubts]
    if profile is None:
        doubts.append(Doubt(
            f"{paths[0].name}: its curve is not known and was taken for sRGB, which no camera's is: exposures that "
            "are found are off by as much as their errors say; give --profile of the camera, or --stops", UNKNOWN_CURVE,
        ))  # fmt: skip
    # What lamps brighter than all exposures leave unknown.
    most, frames = max(shares), sum(share > 0 for share in shares)
    if most > CLIPPED_DOUBT:
        doubts.append(Doubt(
            f"{paths[0].name}: lamps saturate even the darkest exposure in {frames} of {found.count} frames, where "
            f"they are at least {100 * most:.2g} % of the light; add a darker exposure", most,
        ))  # fmt: skip
    stored = "half" if settings.half else "float"
    latency = settings.steadying.latency + _reach(found, settings.steadying)
    return FilmProbe(names_in(out, found.count), found, latency, most, frames, stored, ranked(doubts))


def film_maps(
    found: FilmCalibration, steadying: Steadying, then: Callable[[tuple[int, MomentMap]], Other]
) -> Iterator[Other]:
    """What `then` makes of each frame's number and map, in the frames' order; frames are made side by side."""
    with ThreadPoolExecutor(max(os.cpu_count() or 1, 1)) as pool:
        ahead = 2 * max(os.cpu_count() or 1, 1)
        frames = zip(*(video_frames(film) for film in found.films), strict=False)
        collected = _in_order(pool, lambda each: _collected(found, *each), enumerate(frames), ahead)
        moments = _in_order(pool, lambda each: _moment(found, *each), _windows(found, collected, steadying), ahead)
        steady = enumerate(steadying.steadied(moments, found.tables))
        yield from _in_order(pool, lambda each: then((each[0], each[1]())), steady, ahead)


def _in_order(
    pool: ThreadPoolExecutor, work: Callable[[One], Other], items: Iterable[One], ahead: int
) -> Iterator[Other]:
    """`work` of each, in order, with so many under way."""
    waiting: deque[Future[Other]] = deque()
    try:
        for item in items:
            waiting.append(pool.submit(work, item))
            if len(waiting) >= ahead:
                yield waiting.popleft().result()
        while waiting:
            yield waiting.popleft().result()
    finally:
        for each in waiting:
            each.cancel()


@dataclass(frozen=True, eq=False)
class _FilmFrame:
    """What one frame of one film collected, and the least gain (3,) of its takes."""

    phase: int
    sums: Collected
    darkest: np.ndarray


def _collected(found: FilmCalibration, number: int, frames: Sequence[np.ndarray]) -> list[_FilmFrame]:
    """What a moment's frames collected, film by film."""
    result = []
    for film, frame in enumerate(frames):
        takes = found.of_frame(film, number)
        sums = Collected.nothing(len(found.blind.seen))
        for take in takes:
            take.collect(frame, found.tables, sums)
        result.append(_FilmFrame(number % found.courses[film].period, sums, gains_darkest(takes)))
    return result


_Near = tuple[int, int, _FilmFrame]
"""The film, how many frames later, and the frame."""


def _windows(
    found: FilmCalibration, collected: Iterable[list[_FilmFrame]], steadying: Steadying
) -> Iterator[tuple[list[_FilmFrame], list[_Near]]]:
    """Each moment's frames, with the frames nearest in time that have the exposures it lacks."""
    period = max(course.period for course in found.courses)
    after = _reach(found, steadying)
    held: dict[int, list[_FilmFrame]] = {}
    waiting: deque[int] = deque()

    def lacking(number: int) -> tuple[list[_FilmFrame], list[_Near]]:
        near: list[_Near] = []
        for film, here in enumerate(held[number]):
            for phase in set(range(found.courses[film].period)) - {here.phase}:
                # The first frames have none before them, and wait for those after them.
                within = [at for at in held if abs(at - number) < period and (at <= number + after or at < period)]
                gaps = [at - number for at in within if held[at][film].phase == phase]
                closest = min(map(abs, gaps), default=0)
                near += [(film, gap, held[number + gap][film]) for gap in gaps if abs(gap) == closest]
        return held[number], near

    for number, frames in enumerate(collected):
        held[number] = frames
        waiting.append(number)
        while number >= period - 1 and len(waiting) > after:
            yield lacking(waiting.popleft())
        held.pop(number - period - after, None)
    while waiting:
        yield lacking(waiting.popleft())


def _reach(found: FilmCalibration, steadying: Steadying) -> int:
    """Frames after each that lend it exposures: none where nothing may come later than its frame."""
    period = max(course.period for course in found.courses)
    return 0 if steadying.after == 0 else period // 2


def _moment(found: FilmCalibration, now: Sequence[_FilmFrame], near: Sequence[_Near]) -> MomentMap:
    """The map of a moment; what other films and frames show is moved to where the first film's frame shows it."""
    first, size = now[0], len(found.blind.seen)
    sums = Collected(first.sums.light.copy(), first.sums.exposure.copy())
    others = [(film, 0, frame) for film, frame in enumerate(now) if film] + list(near)
    for film, gap, other in others:
        flow = flow_between(other.sums, first.sums, found.tables, (other.darkest, first.darkest))
        opposite = [frame for at_film, at, frame in near if at_film == film and gap and at == -gap]
        if flow is None and opposite:
            # Too far apart in exposure: half of the way between the frames before and after, which are of one.
            whole = flow_between(other.sums, opposite[0].sums, found.tables, (other.darkest, opposite[0].darkest))
            flow = None if whole is None else whole / 2
        if flow is None:
            flow = np.zeros((size, 2 * size, 2), np.float32)
        sums.add(brought(other.sums, first.sums, found.tables, (other.darkest, first.darkest), flow))
    darkest = np.min([each.darkest for each in (*now, *(frame for _, _, frame in near))], axis=0)
    return merged(sums, darkest, found.tables, found.blind)


def _clipped_share(each: MomentMap) -> float:
    """The share of a map's light that is lower bounds."""
    if not each.saturated:
        return 0.0
    flux = each.radiance.sum(axis=-1) * LatLong().solid_angles(len(each.clipped))
    return float(flux[each.clipped == SATURATED].sum() / max(float(flux.sum()), 1e-30))

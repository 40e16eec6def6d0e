"""What is known of a film before its maps are made: where the light is seen in it, and in which exposures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from relume.capture.response.camera_profile import CameraProfile
from relume.errors import BallNotFound, NotABracket, UnreadableFile, warn
from relume.image.files.video import video_frames, video_rate
from relume.probe.video.exposure_course import ExposureCourse, exposure_course
from relume.probe.video.exposure_ratios import ExposureRatio, ratio_of_quantiles
from relume.probe.video.facets import find_facets, followed, laid_on_another
from relume.probe.video.light_tables import LightTables, looked_up
from relume.probe.video.lookup import BallLookup, BallPlace, Circle, Continuation, FrameLookup, Lookup
from relume.probe.video.merging import Take

KEPT = 8
"""Frames, spread over the film, by which facets and exposures are found."""
LOOKED_AT = 4000
"""Pixels of each frame by which its exposure is followed."""


@dataclass(frozen=True)
class BallFilm:
    """A film of a mirrored ball, seen once a frame or through the facets of a multi-image filter.

    facets : how often the filter shows the ball; 1 without one, 5 of Waese & Debevec's
    rims : (x, y, radius) of the ball in each facet, pixels, in any order; found unless given
    follow_rims : whether a lone rim that is given is moved to where it is seen near there. Of facets the given rim of
        the brightest is taken as it is, and the others are moved onto it
    place : of the ball and its camera
    """

    facets: int = 1
    rims: tuple[Circle, ...] = ()
    follow_rims: bool = True
    place: BallPlace = BallPlace()

    def __post_init__(self) -> None:
        if not 1 <= self.facets <= 16:
            raise ValueError(f"{self.facets} facets; expected 1 to 16, like 5")
        if self.rims and len(self.rims) != self.facets:
            raise ValueError(
                f"{len(self.rims)} rims for {self.facets} facets; give one each, or none to have them found"
            )


@dataclass(frozen=True)
class SphericalFilm:
    """An equirectangular film, as 360° cameras write it: its middle is −Z, and +X lies to its right."""


@dataclass(frozen=True, eq=False)
class FilmFacts:
    """One film, looked through once.

    path : of it
    rate : frames a second
    kept : frames spread over it, with their numbers
    small : exposures (N, 3) of every frame, at the same few places
    """

    path: Path
    rate: Fraction
    kept: tuple[tuple[int, np.ndarray], ...]
    small: tuple[np.ndarray, ...]


@dataclass(frozen=True, eq=False)
class FilmCalibration:
    """How films become maps: all that is found once and holds for every frame.

    films : paths
    rate : frames a second
    count : frames
    takes : every exposure, film by film, phase by phase, facet by facet
    courses : of each film's exposures
    rims : of each film's ball, by facet from the brightest; none of a 360° film
    exposures : of each take, ln over the brightest's with its error
    tables : of pixel values
    blind : of what no take shows
    """

    films: tuple[Path, ...]
    rate: Fraction
    count: int
    takes: tuple[Take, ...]
    courses: tuple[ExposureCourse, ...]
    rims: tuple[tuple[Circle, ...], ...]
    exposures: tuple[ExposureRatio, ...]
    tables: LightTables
    blind: Continuation

    def of_frame(self, film: int, number: int) -> list[Take]:
        """The takes that a film's frame holds.

        film : its number, from 0
        number : of the frame, from 0
        """
        phase = number % self.courses[film].period
        return [take for take in self.takes if take.film == film and take.phase == phase]


def calibrate_film(
    films: Sequence[Path], kind: BallFilm | SphericalFilm, size: int, *, period: int | None = None,
    stops: Sequence[float] | None = None, profile: CameraProfile | None = None, steady: bool = True,
) -> FilmCalibration:  # fmt: skip
    """Find where a film, or several that ran together, shows the light, and its exposures.

    films : of one length and rate
    kind : what they show
    size : rows of the maps
    period : frames after which exposures repeat; found unless given
    stops : how much darker each exposure is than the first: of facets, else of films, else of the frames of a period
    profile : of the camera, for its response and balance; sRGB unless given; warns of its vignetting and scale
    steady : whether a film whose exposure jumps is refused
    Raises UnreadableFile, BallNotFound, NotABracket, ValueError.
    """
    tables = _tables_of(profile)
    if stops is not None:
        tables = replace(tables, assumed_ratio=0.0)
    facets = kind.facets if isinstance(kind, BallFilm) else 1
    by_facet, by_film, by_frame = _stops_for(stops, facets, len(films), period)
    facts = [_looked_through(Path(film), tables) for film in films]
    _require_alike(facts)
    courses, rims, parts = [], [], []
    for each in facts:
        name = each.path.name
        courses.append(exposure_course(each.small, period, by_frame, tables, name, steady=steady))
        lookups, ratios, found = _seen_in(each, kind, courses[-1], size, by_facet, tables)
        rims.append(found)
        parts.append((lookups, ratios))
    between = _films_ratios(facts, courses, parts, by_film, tables)
    # The exposure of each take: the film's, the phase's and the facet's.
    takes, exposures = [], []
    for film, (course, (lookups, ratios)) in enumerate(zip(courses, parts, strict=True)):
        for phase, phase_ratio in enumerate(course.ratios):
            for lookup, ratio in zip(lookups, ratios, strict=True):
                terms = (between[film], phase_ratio, ratio)
                logarithm = np.sum([term.logarithm for term in terms], axis=0)
                errors = [term.error for term in terms] + [tables.assumed_ratio * logarithm]
                exposures.append(ExposureRatio(logarithm, np.sqrt(np.sum(np.square(errors), axis=0))))
                takes.append(Take(film, phase, lookup, np.exp(logarithm)))
    least = min(take.gain.mean() for take in takes)
    takes = [replace(take, darkest=bool(take.gain.mean() < 1.01 * least)) for take in takes]
    blind = Continuation(np.any([lookup.seen for lookups, _ in parts for lookup in lookups], axis=0))
    return FilmCalibration(
        tuple(each.path for each in facts), facts[0].rate, len(facts[0].small), tuple(takes), tuple(courses),
        tuple(rims), tuple(exposures), tables, blind,
    )  # fmt: skip


def _tables_of(profile: CameraProfile | None) -> LightTables:
    """The tables of a profile, of sRGB without one; warns of what a profile knows and films do not use."""
    if profile is None:
        return LightTables.of(None)
    camera = profile.camera or "a camera"
    if profile.response is None:
        raise ValueError(f"the profile of {camera} is of raws, and holds no response; give one of photographs")
    unused = [name for name, held in (("vignetting", profile.vignetting), ("scale", profile.scale)) if held is not None]
    if unused:
        warn(
            f"the profile of {camera} holds {' and '.join(unused)}, which films do not use: their light is relative, "
            "and the lens's fall-off stays in it"
        )
    return LightTables.of(profile.response, profile.balance)


def _stops_for(
    stops: Sequence[float] | None, facets: int, films: int, period: int | None
) -> tuple[Sequence[float] | None, Sequence[float] | None, Sequence[float] | None]:
    """The stops, as those of facets, films or frames."""
    if stops is None:
        return None, None, None
    kinds = {"facets": facets, "films": films}
    for position, (what, number) in enumerate(kinds.items()):
        if number > 1:
            if len(stops) != number:
                raise ValueError(f"{len(stops)} stops for {number} {what}; give one each, 0 for the brightest")
            return (sorted(stops), None, None) if position == 0 else (None, stops, None)
    if period is not None and len(stops) != period:
        raise ValueError(f"{len(stops)} stops for exposures that repeat after {period} frames; give one each")
    if len(stops) < 2:
        raise ValueError("one stop for one exposure says nothing; give one for each exposure, or leave them out")
    return None, None, stops


def _looked_through(path: Path, tables: LightTables) -> FilmFacts:
    """Every frame's exposure, and a few frames spread over the film."""
    kept, small, every = list[tuple[int, np.ndarray]](), list[np.ndarray](), 1
    rate = video_rate(path)
    for number, frame in enumerate(video_frames(path)):
        step = max(1, int(np.sqrt(frame.shape[0] * frame.shape[1] / LOOKED_AT)))
        small.append(looked_up(tables.exposure, np.ascontiguousarray(frame[::step, ::step])).reshape(-1, 3))
        if number % every == 0:
            kept.append((number, frame))
            if len(kept) > 2 * KEPT:
                kept, every = kept[::2], 2 * every
    if not small:
        raise UnreadableFile(f"{path}: a film without frames; copy it again")
    return FilmFacts(path, rate, tuple(kept), tuple(small))


def _require_alike(facts: Sequence[FilmFacts]) -> None:
    """Refuse films that did not run together."""
    first = facts[0]
    for other in facts[1:]:
        if other.rate != first.rate:
            raise NotABracket(
                f"{other.path}: {float(other.rate):g} frames a second, but {first.path.name} has "
                f"{float(first.rate):g}; films of one light have one rate"
            )
        if len(other.small) != len(first.small):
            raise NotABracket(
                f"{other.path}: {len(other.small)} frames, but {first.path.name} has {len(first.small)}; cut both to "
                "the same moments"
            )


def _seen_in(
    film: FilmFacts, kind: BallFilm | SphericalFilm, course: ExposureCourse, size: int,
    stops: Sequence[float] | None, tables: LightTables,
) -> tuple[list[Lookup], tuple[ExposureRatio, ...], tuple[Circle, ...]]:  # fmt: skip
    """Where a film's frames show the light, the exposures of its facets, and the rims."""
    one = (ExposureRatio(np.zeros(3), np.zeros(3)),)
    if isinstance(kind, SphericalFilm):
        height, width = film.kept[0][1].shape[:2]
        if width != 2 * height:
            raise UnreadableFile(
                f"{film.path}: frames of {width}×{height} pixels; an equirectangular film is twice as wide as high"
            )
        return [FrameLookup(size)], one, ()
    # Of exposures that alternate the one is looked at in which most is neither white nor black.
    frames = list(_by_use(film, tables))
    if kind.rims:
        follow = kind.follow_rims and kind.facets == 1
        rims = (followed(frames[0], kind.rims[0], tables, film.path.name),) if follow else kind.rims
    else:
        rims = _found(frames, kind.facets, tables, film.path.name)
    if kind.facets == 1:
        return [BallLookup(kind.place, rims[0], size)], one, rims
    rims, aside, ratios = laid_on_another(frames, rims, kind.place, stops, tables, film.path.name)
    return [BallLookup(kind.place, rim, size, at) for rim, at in zip(rims, aside, strict=True)], ratios, rims


def _by_use(film: FilmFacts, tables: LightTables) -> Iterator[np.ndarray]:
    """A film's kept frames, those first that show most well."""
    shown = [((small > tables.black) & (small < tables.white)).mean() for small in film.small]
    for _, frame in sorted(film.kept, key=lambda pair: -shown[pair[0]])[:KEPT]:
        yield frame


def _found(frames: Sequence[np.ndarray], facets: int, tables: LightTables, name: str) -> tuple[Circle, ...]:
    """The rims in the first of a few frames that shows them."""
    *others, last = frames[:3]
    for frame in others:
        with suppress(BallNotFound):
            return find_facets(frame, facets, tables, name)
    return find_facets(last, facets, tables, name)


def _films_ratios(
    facts: Sequence[FilmFacts], courses: Sequence[ExposureCourse],
    parts: Sequence[tuple[list[Lookup], tuple[ExposureRatio, ...]]], stops: Sequence[float] | None,
    tables: LightTables,
) -> list[ExposureRatio]:  # fmt: skip
    """ln of each film's exposure over the brightest film's."""
    if stops is not None:
        logarithms = -np.asarray(stops, np.float64) * np.log(2)
        return [ExposureRatio(np.full(3, each - logarithms.max()), np.zeros(3)) for each in logarithms]
    result = [ExposureRatio(np.zeros(3), np.zeros(3))]
    light = []
    for film, course, (lookups, _) in zip(facts, courses, parts, strict=True):
        brightest = int(np.argmax([ratio.logarithm.mean() for ratio in course.ratios]))
        frames = [frame for number, frame in film.kept if number % course.period == brightest] or [film.kept[0][1]]
        light.append(np.concatenate([looked_up(tables.exposure, lookups[0].cut(f)).reshape(-1, 3) for f in frames]))
    for film, samples in zip(facts[1:], light[1:], strict=True):
        result.append(ratio_of_quantiles(light[0], samples, tables, film.path.name))
    most = max(range(len(result)), key=lambda number: result[number].logarithm.mean())
    return [ExposureRatio(each.logarithm - result[most].logarithm, each.error) for each in result]

"""`relume probe`: photographs of a mirrored ball in, an environment map out; a film in, a map a frame out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Group, Parameter

import relume as rl
from relume.cli.arguments import Accept, ClusterWord, DryRun, refuse_file_for_folder, require_files, require_suffix
from relume.cli.console import (
    OutputOptions,
    finish,
    finish_each,
    one_by_one,
    print_facts,
    progress,
    spread,
    warnings_as_doubts,
)
from relume.cli.option_types import Point, Seconds, TimesFromNames, numbers

Rim = tuple[float, float, float] | tuple[float, ...]
Times = Annotated[
    Seconds | None, Parameter(help="Exposure time of each photograph, like 1/30,1/60; replaces the EXIF.")
]
MapsOut = Annotated[
    Path,
    Parameter(
        alias="-o", help="The equirectangular (lat-long) environment map to write, .exr or .hdr; of a film a folder "
        "for its maps, or a zarr store, .zarr.",
    ),
]  # fmt: skip
EachPlace = Annotated[
    bool,
    Parameter(
        negative="",
        help="Make a map of every place to -o FOLDER/place.exr. A place is a folder inside the folder that is "
        "given. Give the folder above the places: of PLACES/* the folders of views would count as places. A "
        "place without a ball is named, the others are written, and what is there is kept.",
    ),
]


@Parameter(name="*")
@dataclass(frozen=True)
class ViewOptions:
    """The views of the ball, and where their cameras stood."""

    second: Annotated[
        list[Path] | None,
        Parameter(
            help="A bracket of the same ball from another side, best a quarter turn away.",
            negative="",
            consume_multiple=True,
        ),
    ] = None
    view: Annotated[
        list[str] | None,
        Parameter(
            negative="", help='One more view, again for each: a folder, a file, or a pattern like "left/*.jpg", quoted.'
        ),
    ] = None
    camera: Annotated[
        Point, Parameter(help="Where the camera stood, as X,Y,Z in metres from the ball's centre, Y up.")
    ] = (0.0, 0.0, 1.0)
    second_camera: Annotated[Point, Parameter(help="Where the camera of --second stood.")] = (1.0, 0.0, 0.0)
    turn: Annotated[
        tuple[float, ...] | None,
        numbers(
            "DEGREES,…",
            like="0,90,180",
            help="Degrees by which the camera was carried round the ball for each view, counter-clockwise from "
            "above, like 0,90,180. Unless given, folders and --view are registered by what they show.",
        ),
    ] = None

    def all(self, photographs: Sequence[Path]) -> list[rl.probe.BallPhotographs]:
        """Every view with its photographs, and its camera where that is given."""
        views = rl.probe.find_ball_photographs([*photographs, *(self.view or [])])
        if not views:
            raise ValueError("no photographs were given; name a bracket of the ball, or a folder for each view")
        if self.turn is not None:
            views = rl.probe.placed_views(views, self.camera, [math.radians(angle) for angle in self.turn])
        else:
            views[:1] = rl.probe.placed_views(views[:1], self.camera, [0.0])
        if self.second:
            if len(views) > 1 and self.turn is None:
                raise ValueError("--second is the other of two views; give more than two with --view or as folders")
            views.append(rl.probe.BallPhotographs(tuple(self.second), self.second_camera))
        return views


@Parameter(name="*")
@dataclass(frozen=True)
class BallOptions:
    """The ball: its size, its reflectance, and its rim in the photographs."""

    distance: Annotated[
        float | None, Parameter(help="Metres from the camera to the ball's centre, instead of --camera's own length.")
    ] = None
    radius: Annotated[
        float | None, Parameter(help="The ball's radius in metres, where the EXIF has no focal length.")
    ] = None
    reflectance: Annotated[
        tuple[float, float, float] | str | None,
        numbers(
            "R,G,B",
            like="0.6 or 0.6,0.5,0.4 or chrome",
            repeated=True,
            words=("chrome",),
            help='The ball\'s reflectance seen straight on: one number, R,G,B, or "chrome"; 1 unless given.',
        ),
    ] = None
    fresnel: Annotated[
        bool, Parameter(help="Whether --reflectance rises to 1 at grazing, as metals' and coatings' does.")
    ] = True
    pick: Annotated[
        list[Rim | str] | None,
        numbers(
            "X,Y,RADIUS",
            like="726,487,283, three points X,Y,X,Y,X,Y or auto",
            words=("auto",),
            help="The ball's rim in pixels, once for each view: X,Y,RADIUS; three points or more as X,Y,X,Y,X,Y; "
            'or "auto" to have it found. It is followed where it is seen near there, else taken as it is.',
        ),
    ] = None
    pick_exactly: Annotated[
        bool, Parameter(negative="", help="Take what is picked as it is, without following the rim near it.")
    ] = False

    def measured(self) -> rl.probe.BallReflectance:
        """The reflectance of --reflectance and --fresnel."""
        if self.reflectance is None:
            return rl.probe.BallReflectance()
        normal = self.reflectance
        if isinstance(normal, str):
            normal = rl.probe.CHROME_STEEL.normal
        return rl.probe.BallReflectance(normal, self.fresnel)

    def picked(self, views: Sequence[rl.probe.BallPhotographs]) -> list[rl.probe.BallPhotographs]:
        """The views with the outlines that were picked; "auto" has one found."""
        picks = self.pick or []
        if len(picks) > len(views):
            number = f"{len(views)} view{'s' * (len(views) > 1)}"
            raise ValueError(f"--pick: {len(picks)} are given for {number}; give one each")
        result = list(views)
        for index, pick in enumerate(picks):
            if isinstance(pick, str):
                continue
            if len(pick) == 3:
                outline = rl.probe.outline_of_circle(*pick)
            elif len(pick) >= 6 and len(pick) % 2 == 0:
                outline = rl.probe.outline_through(list(zip(pick[::2], pick[1::2], strict=True)))
            else:
                raise ValueError(f"--pick: {pick} is not a rim; write X,Y,RADIUS, or three points or more, in pixels")
            result[index] = replace(result[index], outline=outline)
        return result


@Parameter(name="*", group=Group("Films"))
@dataclass(frozen=True)
class FilmOptions:
    """A film, in one or several exposures, which becomes a folder of maps."""

    facets: Annotated[
        int, Parameter(help="How often each frame shows the ball, as a multi-image filter does; --pick again for each.")
    ] = 1
    facet_angle: Annotated[
        float, Parameter(help="Degrees: arctan of the distance between facets over that from lens to ball.")
    ] = 0.0
    spherical: Annotated[
        bool, Parameter(negative="", help="Frames are equirectangular, as 360° cameras write them.")
    ] = False
    stops: Annotated[
        tuple[float, ...] | None,
        numbers(
            "STOPS,…",
            like="0,3,6,10,13",
            help="How much darker each exposure is than the first: of the facets, else of several films that ran "
            "together, else of the frames of a period. Found in the film unless given.",
        ),
    ] = None
    period: Annotated[int | None, Parameter(help="Frames after which exposures repeat; found unless given.")] = None
    before: Annotated[int, Parameter(help="Frames before each that steady it.")] = 1
    after: Annotated[int, Parameter(help="Frames after each that steady it, which a live picture waits for.")] = 1
    light_changes: Annotated[
        bool, Parameter(negative="", help="The light itself becomes brighter or darker all over at once.")
    ] = False

    def settings(self, size: int) -> rl.probe.FilmSettings:
        """The settings of these options."""
        steadying = rl.probe.Steadying(self.before, self.after)
        return rl.probe.FilmSettings(size, self.period, self.stops, steadying, not self.light_changes)

    def kind(self, views: ViewOptions, ball: BallOptions) -> rl.probe.BallFilm | rl.probe.SphericalFilm:
        """What the film shows."""
        if self.spherical:
            return rl.probe.SphericalFilm()
        length = ball.distance or math.hypot(*views.camera)
        away = {} if ball.radius is None else {"distance": length / ball.radius}
        angle = math.radians(self.facet_angle)
        place = rl.probe.BallPlace(views.camera, angle=angle, reflectance=ball.measured(), **away)
        rims = [rim for rim in ball.pick or [] if not isinstance(rim, str)]
        if any(len(rim) != 3 for rim in rims):
            raise ValueError("--pick: of a film give each rim as X,Y,RADIUS")
        rims = tuple((rim[0], rim[1], rim[2]) for rim in rims)
        return rl.probe.BallFilm(self.facets, rims, not ball.pick_exactly, place)


def probe(
    photographs: Annotated[
        list[Path] | None,
        Parameter(
            help="A bracket of the ball, one photograph or radiance map of it, or a folder a view; or a film, or films "
            "that ran together.", negative="",
        ),
    ] = None,
    /,
    *,
    out: MapsOut,
    views: ViewOptions = ViewOptions(),
    ball: BallOptions = BallOptions(),
    film: FilmOptions = FilmOptions(),
    picture: Annotated[
        Path | None,
        Parameter(help="Draw every view's ball with its rim, or where no ball is found what is round, as this .png."),
    ] = None,
    balance: Annotated[
        bool, Parameter(negative="", help="Bring all views to the brightness of the first before they are blended.")
    ] = False,
    profile: Annotated[
        Path | None, Parameter(help="The camera's profile from `relume merge --save-profile`; else recovered.")
    ] = None,
    times: Times = None,
    times_from_names: TimesFromNames = False,
    size: Annotated[int, Parameter(help="Rows of the map.")] = 512,
    accept: Accept = False,
    each: EachPlace = False,
    cluster: ClusterWord = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:  # fmt: skip
    """Find the mirrored ball, unwrap it with the camera's perspective, and blend all views into an environment map.

    What no view saw is filled smoothly and marked: the map's `clipped` layer holds 3 there and 1 where light is
    saturated, and an EXR has a layer `confidence`, 0 to 1. A view whose camera's place is not given is registered to
    the first. Of a film a map of every frame goes into the folder or .zarr store -o, merged from the exposures that its
    frames hold or alternate between.
    """
    if photographs and all(rl.probe.is_film(path) for path in photographs):
        given = {"second": views.second, "view": views.view, "turn": views.turn, "picture": picture, "times": times}
        _refuse_of_one_ball(given, "a film", each=each or None, balance=balance or None, cluster=cluster)
        _film(photographs, out, film.kind(views, ball), film.settings(size), profile, accept, dry_run, output)
        return
    settings = rl.probe.ProbeSettings(
        size=size, radius=ball.radius, distance=ball.distance, reflectance=ball.measured(),
        follow_picked=not ball.pick_exactly, balance=balance,
    )  # fmt: skip
    if each:
        given = {"second": views.second, "view": views.view, "pick": ball.pick, "picture": picture, "times": times}
        _refuse_of_one_ball(given, "many")
        turns = None if views.turn is None else [math.radians(angle) for angle in views.turn]
        chosen = {"camera": views.camera, "turns": turns, "profile": profile, "times_from_names": times_from_names}
        _each(photographs or [], out, chosen | {"settings": settings}, cluster, accept, dry_run, output)
        return
    if cluster is not None:
        raise ValueError("--cluster is for many balls; give --each too, or leave it out")
    with warnings_as_doubts(output) as doubts:
        # What is to be done; refused before any work where it cannot.
        require_suffix(out, ".exr", ".hdr")
        if picture is not None:
            require_suffix(picture, ".png", option="--picture")
        require_files([*(views.second or []), *([profile] if profile else [])])
        placed = ball.picked(views.all(photographs or []))
        known = rl.capture.read_profile(profile) if profile else None
        if dry_run:
            where = "given" if all(each.camera for each in placed) else "to be found by registration"
            names = [each.name for each in placed]
            print_facts(output, {"would write": str(out), "views": names, "their cameras": where})
            finish(output, doubts, accept=True)
            return

        # The work.
        try:
            with progress(output) as advance, one_by_one(advance) as step:
                result = rl.probe.probe_ball(
                    placed, times=times, times_from_names=times_from_names, profile=known, settings=settings,
                    progress=step,
                )  # fmt: skip
        except rl.errors.BallNotFound as refused:
            if picture is not None and refused.radiance is not None:
                with rl.files.replacing(picture) as temporary:
                    temporary.write_bytes(rl.report.candidates_plot(refused))
            raise
        rl.probe.write_probe(out, result.probe)
        if picture is not None:
            with rl.files.replacing(picture) as temporary:
                temporary.write_bytes(rl.report.rim_plot(result.views, result.names))

        # What came of it.
        written = {"written": str(out)} | ({} if picture is None else {"picture": str(picture)})
        noted = {"doubts": [each.words for each in result.doubts]} if output.json else {}
        print_facts(output, written | result.facts(listed=output.json) | noted)
        finish(output, [*doubts, *result.doubts], accept=accept)


def _refuse_of_one_ball(given: dict[str, object], what: str, **more: object) -> None:
    """Refuse what belongs to the photographs of one ball alone beside --each, and beside a film."""
    for name, value in (given | more).items():
        if value is not None and what == "many":
            raise ValueError(f"--{name} is of one ball, and --each unwraps many; leave it out")
        if value is not None:
            raise ValueError(f"--{name} is for photographs, and {what} is given; leave it out")


def _film(
    films: list[Path], out: Path, kind: rl.probe.BallFilm | rl.probe.SphericalFilm, settings: rl.probe.FilmSettings,
    profile: Path | None, accept: bool, dry_run: bool, output: OutputOptions,
) -> None:  # fmt: skip
    """Make a map of every frame, or say what would be made."""
    with warnings_as_doubts(output) as doubts:
        require_files([*films, *([profile] if profile else [])])
        known = rl.capture.read_profile(profile) if profile else None
        if dry_run:
            first = str(out) if out.suffix == ".zarr" else f"{out}/map_000001.exr …"
            print_facts(output, {"would write": first, "films": [str(path) for path in films]})
            finish(output, doubts, accept=True)
            return
        with progress(output) as advance:
            made = rl.probe.probe_film(films, out, kind, settings, profile=known, progress=advance)
        print_facts(output, {"written": str(out)} | made.facts())
        finish(output, [*doubts, *made.doubts], accept=accept)


def _each(
    folders: list[Path], out: Path, chosen: dict[str, Any], cluster: str | None, accept: bool, dry_run: bool,
    output: OutputOptions,
) -> None:  # fmt: skip
    """Unwrap the ball of every place by itself, or list what would be written."""
    with warnings_as_doubts(output) as doubts:
        refuse_file_for_folder(out)
        with spread(None if dry_run else cluster, output) as (workers, advance):
            made = rl.probe.probe_each(folders, out, **chosen, dry_run=dry_run, cluster=workers, progress=advance)
        finish_each(output, made, out, "places", doubts, dry_run=dry_run, accept=accept)

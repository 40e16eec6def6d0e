"""`relume probe`: photographs of a mirrored ball in, an illumination map out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, Times, read_point, read_times, require_files, require_suffix
from relume.cli.console import OutputOptions, finish, note, print_facts, warnings_as_notes

if TYPE_CHECKING:
    from relume.cli.probe_views import Group, ViewPicture
    from relume.probe.ball.blending import Probe
    from relume.probe.ball.reflectance import BallReflectance
    from relume.probe.ball.silhouette import Outline
    from relume.probe.ball.unwrapping import BallView

FAR = 20.0
"""Ball radii from the camera to the ball where nothing tells: a metre for a ball of 5 cm."""
CROPPED = 4.0
"""Ball radii below which a distance told by the EXIF is that of a crop: nobody photographs a ball from 15 cm."""


def probe(
    photographs: Annotated[
        list[Path] | None,
        Parameter(help="A bracket of the ball, one photograph or radiance map of it, or a folder a view.", negative=""),
    ] = None,
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The lat-long illumination map to write, .exr or .hdr.")],
    second: Annotated[
        list[Path] | None,
        Parameter(
            help="A bracket of the same ball from another side, best a quarter turn away.",
            negative="",
            consume_multiple=True,
        ),
    ] = None,
    view: Annotated[
        list[str] | None,
        Parameter(
            negative="", help='One more view, again for each: a folder, a file, or a pattern like "left/*.jpg", quoted.'
        ),
    ] = None,
    camera: Annotated[
        str,
        Parameter(
            allow_leading_hyphen=True, help="Where the camera stood, as X,Y,Z in metres from the ball's centre, Y up."
        ),
    ] = "0,0,1",
    second_camera: Annotated[
        str, Parameter(allow_leading_hyphen=True, help="Where the camera of --second stood.")
    ] = "1,0,0",
    turn: Annotated[
        str | None,
        Parameter(
            allow_leading_hyphen=True,
            help="Degrees by which the camera was carried round the ball for each view, counter-clockwise from above, "
            "like 0,90,180; folders and --view are registered without unless given.",
        ),
    ] = None,
    distance: Annotated[
        float | None, Parameter(help="Metres from the camera to the ball's centre, instead of --camera's own length.")
    ] = None,
    radius: Annotated[
        float | None, Parameter(help="The ball's radius in metres, where the EXIF has no focal length.")
    ] = None,
    reflectance: Annotated[
        str | None,
        Parameter(help='The ball\'s reflectance seen straight on: one number, R,G,B, or "chrome"; 1 unless given.'),
    ] = None,
    fresnel: Annotated[
        bool, Parameter(help="Whether --reflectance rises to 1 at grazing, as metals' and coatings' does.")
    ] = True,
    pick: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            allow_leading_hyphen=True,
            help="The ball's rim in pixels, once for each view: X,Y,RADIUS, or three points or more as X,Y,X,Y,X,Y; "
            '"auto" to have it sought.',
        ),
    ] = None,
    pick_exactly: Annotated[
        bool, Parameter(negative="", help="Take what is picked as it is, without following the rim near it.")
    ] = False,
    picture: Annotated[
        Path | None, Parameter(help="Draw every view's ball with the rim that was taken, as this .png.")
    ] = None,
    balance: Annotated[
        bool, Parameter(negative="", help="Bring all views to the brightness of the first before they are blended.")
    ] = False,
    profile: Annotated[
        Path | None, Parameter(help="The camera's profile from `relume merge --save-profile`; else recovered.")
    ] = None,
    times: Times = None,
    size: Annotated[int, Parameter(help="Rows of the map.")] = 512,
    accept: Annotated[bool, Parameter(negative="", help="Exit with 0 although the result is doubtful.")] = False,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Find the mirrored ball, unwrap it with the camera's perspective, and blend any number of views into a light map.

    What no view saw is filled smoothly and marked: the map's `clipped` layer holds 3 there and 1 where light is
    saturated, and an EXR has a layer `confidence`, 0 to 1. A view whose camera's place is not told is registered to
    the first.
    """
    from relume.capture.response.camera_profile import read_profile
    from relume.cli import probe_views
    from relume.cli.probe_facts import facts_of, remark
    from relume.probe.ball.blending import assemble
    from relume.probe.ball.registration import ToldPlaces, UnknownTurns

    doubts: list[str] = []
    with warnings_as_notes(output):
        require_suffix(out, ".exr", ".hdr")
        if picture is not None:
            require_suffix(picture, ".png", option="--picture")
        if size < 2:
            raise ValueError(f"--size is {size}; a map has at least 2 rows, best 512")
        require_files([*(second or []), *([profile] if profile else [])])
        first = _carried(read_point(camera, "--camera"), distance)
        groups = probe_views.grouped(photographs or [])
        for word in view or []:
            groups += probe_views.from_pattern(word)
        if not groups:
            raise ValueError("no photographs were given; name a bracket of the ball, or a folder for each view")
        told = len(groups) == 1
        if turn is not None:
            groups, told = probe_views.placed(groups, first, _turns(turn, len(groups))), True
        else:
            groups = probe_views.placed(groups, first, [0.0] * len(groups))
        if second:
            if not told:
                raise ValueError("--second is the other of two views; give more than two with --view or as folders")
            place = _carried(read_point(second_camera, "--second-camera"), distance)
            groups.append(probe_views.Group(tuple(second), place))
        seconds, picks = read_times(times), _picks(pick or [], len(groups))
        mirror = _reflectance(reflectance, fresnel)
        known = read_profile(profile) if profile else None
        if known is not None and known.response is None:
            raise ValueError(f"--profile {profile}: a profile of camera raws, and these are encoded photographs")
        if dry_run:
            views = [_named(group.paths) for group in groups]
            where = "told" if told else "to be found by registration"
            print_facts(output, {"would write": str(out), "views": views, "their cameras": where})
            return
        pictures = probe_views.quietly_read(
            lambda: probe_views.read_pictures(
                groups, times=seconds, profile=known, told=lambda line: note(output, line), doubted=doubts.append
            ),
            lambda line: note(output, line),
        )
        views = [
            _view(each, group, chosen, pick_exactly, radius, distance, mirror, output)
            for each, group, chosen in zip(pictures, groups, picks, strict=True)
        ]
        names = [_named(group.paths) for group in groups]
        if picture is not None:
            _draw(picture, views, names)
        doubts += [_rival(view, name) for view, name in zip(views, names, strict=True) if view.outline.rivals]
        unscaled = len(views) > 1 and not all(each.exposed for each in pictures)
        if unscaled and not balance:
            note(output, "not every view tells its exposure, so all are brought to the brightness of the first")
        balanced = balance or unscaled
        result = assemble(views, size=size, registration=ToldPlaces() if told else UnknownTurns(), balanced=balanced)
        _write(out, result)
        for line in result.notes:
            if not (balanced and "times as bright" in line):
                doubts.append(_explained(line, result, told))
        remark(result, output, len(views))
        written = {"written": str(out)} | ({} if picture is None else {"picture": str(picture)})
        print_facts(output, written | facts_of(views, result, told, output))
        finish(output, doubts, accept=accept)


def _carried(place: tuple[float, float, float], distance: float | None) -> tuple[float, float, float]:
    """A camera's place, brought to a distance from the ball."""
    length = math.hypot(*place)
    if length == 0:
        raise ValueError("--camera: 0,0,0 is the ball's centre; give where the camera stood")
    if distance is None:
        return place
    if not distance > 0:
        raise ValueError(f"--distance is {distance}; give metres from the camera to the ball's centre")
    x, y, z = (value * distance / length for value in place)
    return x, y, z


def _turns(text: str, count: int) -> list[float]:
    """Radians for each view; raises ValueError for what is no number, or another number of them."""
    try:
        turns = [math.radians(float(word)) for word in text.replace(",", " ").split()]
    except ValueError:
        raise ValueError(f'--turn: "{text}" are no angles; write degrees, like 0,90,180') from None
    if len(turns) != count:
        raise ValueError(f"--turn: {len(turns)} angles for {count} views; give one for each, 0 for the first")
    return turns


def _picks(words: Sequence[str], count: int) -> list[Outline | None]:
    """The outline picked for each view; None where it is to be sought."""
    import numpy as np

    from relume.probe.ball.silhouette import outline_of_circle, outline_through

    if len(words) > count:
        raise ValueError(f"--pick: {len(words)} are given for {count} view{'s' * (count > 1)}; give one for each")
    picked: list[Outline | None] = []
    for word in words:
        if word == "auto":
            picked.append(None)
            continue
        try:
            numbers = [float(each) for each in word.replace(",", " ").split()]
        except ValueError:
            numbers = []
        if len(numbers) == 3:
            picked.append(outline_of_circle(*numbers))
        elif len(numbers) >= 6 and len(numbers) % 2 == 0:
            picked.append(outline_through(np.array(numbers).reshape(-1, 2)))
        else:
            raise ValueError(f'--pick: "{word}" is no rim; write X,Y,RADIUS, or three points or more, in pixels')
    return picked + [None] * (count - len(picked))


def _reflectance(text: str | None, rising: bool) -> BallReflectance:
    from relume.probe.ball.reflectance import CHROME_STEEL, BallReflectance

    if text is None:
        return BallReflectance()
    if text == "chrome":
        return BallReflectance(CHROME_STEEL.normal, rising)
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        numbers = []
    if len(numbers) == 1:
        numbers *= 3
    if len(numbers) != 3 or not all(0 < number <= 1 for number in numbers):
        raise ValueError(f'--reflectance: "{text}" is none; write a share above 0 and up to 1, R,G,B, or chrome')
    return BallReflectance((numbers[0], numbers[1], numbers[2]), rising)


def _named(paths: Sequence[Path]) -> str:
    return paths[0].name if len(paths) == 1 else f"{paths[0].name} … {paths[-1].name}"


def _view(
    picture: ViewPicture,
    group: Group,
    picked: Outline | None,
    exactly: bool,
    radius: float | None,
    distance: float | None,
    mirror: BallReflectance,
    output: OutputOptions,
) -> BallView:
    import numpy as np

    from relume.probe.ball.rim_selection import picked_rim
    from relume.probe.ball.unwrapping import unwrap_ball

    assert group.camera is not None
    camera, centre = np.array(group.camera), np.zeros(3)
    length, focal_length = float(np.linalg.norm(camera)), picture.focal_length
    if picked is not None and not exactly:
        picked = picked_rim(picture.picture.radiance, picked, picture.name, focal_length)

    def found(focal_length: float | None, size: float) -> BallView:
        return unwrap_ball(
            picture.picture, camera=camera, centre=centre, focal_length=focal_length, radius=size, outline=picked,
            reflectance=mirror, name=picture.name,
        )  # fmt: skip

    if focal_length is not None:
        result = found(focal_length, radius or length / FAR)
        if result.distance >= CROPPED:
            return result
        note(
            output,
            f"{picture.name}: its EXIF puts the camera {result.distance:.1f} ball radii away, as that of a crop does, "
            "so its focal length is left out",
        )
    if radius is None:
        away = f"{length:.3g} m" if distance is not None else "a camera"
        note(
            output,
            f"{picture.name}: nothing tells how far the camera was in ball radii; {FAR:.0f} are taken for {away}; "
            "give --radius and --distance, metres",
        )
    return found(None, length / FAR if radius is None else radius)


def _write(out: Path, result: Probe) -> None:
    import numpy as np

    from relume.image import files
    from relume.sphere.environment_files import as_radiance_map

    picture = as_radiance_map(result.light)
    if out.suffix.lower() == ".hdr":
        files.write(out, picture)
        return
    mask = np.zeros(picture.radiance.shape[:2], np.uint8) if picture.clipped is None else picture.clipped
    layers = {"radiance": picture.radiance, "clipped": mask, "confidence": result.confidence}
    files.write_layers(out, layers, unit=picture.unit, attributes=picture.attributes)


def _draw(out: Path, views: Sequence[BallView], names: Sequence[str]) -> None:
    from relume.image import files
    from relume.report.ball_plot import rim_plot

    drawn = rim_plot(views, names)
    with files.replacing(out) as temporary:
        temporary.write_bytes(drawn)


def _rival(view: BallView, name: str) -> str:
    """The doubt about a rim beside which others are seen as well."""
    outline = view.outline
    (x, y), (other_x, other_y, other) = outline.centre, outline.rivals[0]
    return (
        f"{name}: the rim was taken at x,y,radius {x:.1f},{y:.1f},{outline.radius:.1f}, and {other_x:.1f},"
        f"{other_y:.1f},{other:.1f} is seen about as well; look at it with --picture and tell it with --pick"
    )


def _explained(line: str, result: Probe, told: bool) -> str:
    """A doubt of registration, with what most often is behind it."""
    words = line.split()
    if not told or "does not fit" not in line or words[:1] != ["view"]:
        return line
    turned = math.degrees(result.corrections[int(words[1]) - 1])
    return (
        f"{line}; registration turned it by {turned:.1f}°, and is its height told (--camera X,Y,Z with Y up)? Folders "
        "or --view without --turn have the turn found"
    )

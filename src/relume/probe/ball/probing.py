"""`probe_ball`: photographs of a mirrored ball in, an environment map out."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.capture.brackets.settings import MergeSettings
from relume.capture.response.camera_profile import CameraProfile
from relume.errors import WRONG, Doubt, GatheredDoubts, ranked
from relume.image import files
from relume.image.radiance import OUTSIDE, SATURATED
from relume.probe.ball.blending import Probe, blend_views
from relume.probe.ball.reflectance import BallReflectance
from relume.probe.ball.registration import KnownPlaces, UnknownPlaces
from relume.probe.ball.rim_selection import picked_rim
from relume.probe.ball.unwrapping import BallView, unwrap_ball
from relume.probe.ball.view_files import BallPhotographs, Point, ViewPicture, read_view_pictures
from relume.sphere.environment_files import as_radiance_map

FAR = 20.0
"""Ball radii from the camera to the ball where the distance is unknown: a metre for a ball of 5 cm."""
CROPPED = 4.0
"""Ball radii below which a distance by the EXIF is that of a crop: nobody photographs a ball from 15 cm."""
ALIKE = 0.03
"""Radii by which two rims may differ whose light is much the same; beyond, one of them is of something else."""
SMALL, SEEN, OFF = 25.0, 0.5, 1.2
"""Pixels of radius and share of the rim below which what is seen of a rim decides little, and by how many pixels it was
off: of a real ball 40 pixels wide, of which 38 % was seen."""


@dataclass(frozen=True)
class ProbeSettings:
    """How views of a ball become an environment map.

    size : rows of the map; 512 is what a ball 600 pixels wide resolves
    radius : of the ball in metres, where the EXIF has no focal length
    distance : metres from the cameras to the ball's centre, instead of the length of their places
    reflectance : of the ball
    follow_picked : whether a rim is followed in the picture near an outline that was picked
    balance : whether all views are brought to the brightness of the first before they are blended
    merge : how brackets become radiance
    """

    size: int = 512
    radius: float | None = None
    distance: float | None = None
    reflectance: BallReflectance = BallReflectance()
    follow_picked: bool = True
    balance: bool = False
    merge: MergeSettings = MergeSettings()

    def __post_init__(self) -> None:
        if self.size < 2:
            raise ValueError(f"size is {self.size}; a map has at least 2 rows, best 512")
        if self.distance is not None and not self.distance > 0:
            raise ValueError(f"distance is {self.distance}; give metres from the camera to the ball's centre")


@dataclass(frozen=True, eq=False)
class BallProbe:
    """The light that a ball showed.

    probe : the environment map, with what it was blended from
    views, names : of the ball
    places_known : whether the places of all cameras were given, so that registration only refined them
    notes : what a photographer should know and need not act on, a line each
    warnings : why the result should not be used without looking at it, a line each
    doubts : all of these, with their effect on the light
    """

    probe: Probe
    views: tuple[BallView, ...]
    names: tuple[str, ...]
    places_known: bool
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    doubts: tuple[Doubt, ...] = ()

    def facts(self, *, listed: bool = True) -> dict[str, Any]:
        """Every view's ball, how the views lie and the energy; `listed` gives the balls as one list, for machines."""
        balls = [_ball_facts(view) for view in self.views]
        facts: dict[str, Any] = {"balls": balls}
        if not listed:
            facts = {f"ball {number}" if len(balls) > 1 else "ball": ball for number, ball in enumerate(balls, 1)}
        probe = self.probe
        if len(self.views) > 1:
            facts["camera places given"] = self.places_known
            facts["turned by registration"] = [f"{math.degrees(c):.2f}°" for c in probe.corrections]
            facts["brightness against the first"] = [round(gain, 3) for gain in probe.gains]
            facts["surroundings, ball radii away"] = round(1 / probe.nearness, 1) if probe.nearness > 1e-3 else "far"
            if not self.places_known and probe.turns is not None:
                towards = [turn @ view.towards_camera for turn, view in zip(probe.turns, self.views, strict=True)]
                start = math.atan2(towards[0][0], towards[0][2])
                facts["turns found"] = [
                    f"{math.degrees(math.atan2(x, z) - start) % 360:.1f}°" for x, _, z in (t.tolist() for t in towards)
                ]
        else:
            facts["turned by registration"] = ["0.00°"]
        _, rising, _ = next(iter(self.views)).towards_camera.tolist()
        up = math.degrees(math.asin(min(max(rising, -1.0), 1.0)))
        wrong = "" if abs(up) > 0.05 else "; if it looked down, the light is tilted by as much: give its place"
        facts["camera above the ball's level"] = f"{up + 0.0:.1f}°{wrong}"
        return facts | probe.light.audit().facts()


def probe_ball(
    photographs: Sequence[BallPhotographs],
    *,
    times: Sequence[float] | None = None,
    times_from_names: bool = False,
    profile: CameraProfile | None = None,
    settings: ProbeSettings = ProbeSettings(),
    progress: Callable[[str], None] = lambda step: None,
) -> BallProbe:
    """Merge the brackets, find the mirrored ball, unwrap it with the camera's perspective, and blend the views.

    photographs : one entry a view; `find_ball_photographs` makes them of paths. Where the place of a camera is not
        given, the views are registered to the first, whose camera stands at (0, 0, 1) unless given
    times : seconds of all photographs, in their order; they replace the EXIF exposures
    times_from_names : read them from the names instead, as `read_bracket` does, view by view
    profile : of the camera; recovered from the brackets unless given, sRGB for single photographs
    settings : the ball, the size of the map, how views are blended
    progress : called with the name of each step as it begins

    Raises UnreadableFile, NotABracket, BallNotFound, ValueError.
    """
    if not photographs:
        raise ValueError("no photographs were given; name a bracket of the ball, or a folder for each view")
    known = len(photographs) == 1 or all(each.camera is not None for each in photographs)
    stand = photographs[0].camera or (0.0, 0.0, 1.0)
    cameras = [_at_distance(each.camera or stand, settings.distance) for each in photographs]

    # Radiance of each view, with every warning kept as a note, or said where the job fails.
    with GatheredDoubts() as gathered:
        read = read_view_pictures(
            photographs, times=times, times_from_names=times_from_names, profile=profile, settings=settings.merge,
            progress=progress,
        )  # fmt: skip
        notes = [*read.doubts]
        progress("ball")
        views = [
            _view(picture, np.array(camera), each, settings, notes)
            for picture, camera, each in zip(read.pictures, cameras, photographs, strict=True)
        ]
        names = tuple(each.name for each in photographs)
        for view, each in zip(views, photographs, strict=True):
            notes += rim_doubts(view, each.name, picked=each.outline is not None)

        # One light of all views.
        unscaled = len(views) > 1 and not all(each.exposed for each in read.pictures)
        if unscaled and not settings.balance:
            line = "the exposure of some views is unknown, so all are brought to the brightness of the first"
            notes.append(Doubt(line, 0.1))
        balanced = settings.balance or unscaled
        registration = KnownPlaces() if known else UnknownPlaces()
        progress("register and blend" if len(views) > 1 else "unwrap")
        probe = blend_views(views, size=settings.size, registration=registration, balanced=balanced)
    disagreeing = (each for each in probe.notes if not (balanced and "times as bright" in each.line))
    notes += [_explained(each, probe, known) for each in disagreeing]

    # What the map lacks.
    measured = probe.light.audit()
    if measured.unseen > 0:
        again = "photograph from a second side" if len(views) == 1 else "photograph from one more side"
        line = f"{measured.unseen:.3g} sr are seen by no view and were filled from beside; {again}"
        # What is filled in is off by its own size in places, and by less on the whole.
        notes.append(Doubt(line, probe.share(OUTSIDE) / 2))
    if measured.clipped > 0:
        line = f"{measured.clipped:.3g} sr are saturated in every photograph; add shorter exposures"
        notes.append(Doubt(line, probe.share(SATURATED)))
    doubts = ranked([*gathered.doubts, *notes])
    lesser, wrong = (tuple(each.line for each in doubts if each.wrong is kind) for kind in (False, True))
    return BallProbe(probe, tuple(views), names, known, lesser, wrong, doubts)


def write_probe(path: str | os.PathLike[str], probe: Probe) -> None:
    """Write the environment map; an EXR has layers `clipped` and `confidence`, 0 to 1.

    path : .exr or .hdr
    probe : as `blend_views` or `probe_ball` made it
    Raises OutputNotWritten.
    """
    path = Path(path)
    picture = as_radiance_map(probe.light)
    if path.suffix.lower() == ".hdr":
        files.write(path, picture)
        return
    mask = np.zeros(picture.radiance.shape[:2], np.uint8) if picture.clipped is None else picture.clipped
    layers = {"radiance": picture.radiance, "clipped": mask, "confidence": probe.confidence}
    files.write_layers(path, layers, unit=picture.unit, attributes=picture.attributes)


def _at_distance(place: Point, distance: float | None) -> Point:
    """A camera's place, brought to a distance from the ball."""
    length = math.hypot(*place)
    if length == 0:
        raise ValueError("camera: 0,0,0 is the ball's centre; give where the camera stood")
    if distance is None:
        return place
    x, y, z = (value * distance / length for value in place)
    return x, y, z


def _view(
    picture: ViewPicture, camera: np.ndarray, photographs: BallPhotographs, settings: ProbeSettings, notes: list[Doubt]
) -> BallView:
    """The ball in one picture, by the EXIF's focal length or else by its radius and distance."""
    length, focal_length, outline = float(np.linalg.norm(camera)), picture.focal_length, photographs.outline
    if outline is not None and settings.follow_picked:
        outline = picked_rim(picture.picture.radiance, outline, picture.name, focal_length)

    def found(focal_length: float | None, radius: float) -> BallView:
        return unwrap_ball(
            picture.picture, camera=camera, centre=np.zeros(3), focal_length=focal_length, radius=radius,
            outline=outline, reflectance=settings.reflectance, name=picture.name,
            measured=settings.radius is not None and (settings.distance or photographs.camera) is not None,
        )  # fmt: skip

    if focal_length is not None:
        result = found(focal_length, settings.radius or length / FAR)
        if result.distance >= CROPPED:
            return result
        line = (
            f"{picture.name}: its EXIF puts the camera {result.distance:.1f} ball radii away, as that of a crop does, "
            "so its focal length is left out"
        )
        notes.append(Doubt(line, 0.0))
    if settings.radius is None:
        away = f"{length:.3g} m" if settings.distance is not None else "a camera"
        line = (
            f"{picture.name}: the camera's distance in ball radii is unknown; {FAR:.0f} are taken for {away}; "
            "give --radius and --distance, metres"
        )
        # From 10 to 40 radii away what the rim shows turns by some degrees, what the middle shows does not.
        notes.append(Doubt(line, 0.03))
    return found(None, length / FAR if settings.radius is None else settings.radius)


def rim_doubts(
    view: BallView,
    name: str,
    remedy: str = "look at it with --picture and choose it with --pick",
    *,
    picked: bool = False,
) -> list[Doubt]:
    """The doubts about a rim beside which others are seen as well, and one that is rough, or small and little seen."""
    outline = view.outline
    (x, y), radius = outline.centre, outline.radius
    taken = f"{name}: the rim was taken at x,y,radius {x:.1f},{y:.1f},{radius:.1f}, and"
    doubts: list[Doubt] = []
    # The best seen of them; where less than half of the rim is seen, the one that would change most.
    rivals = outline.rivals if outline.coverage < SEEN else outline.rivals[:1]
    beside = []
    for other_x, other_y, other in rivals:
        line = f"{taken} {other_x:.1f},{other_y:.1f},{other:.1f} is seen about as well; {remedy}"
        beside.append(_off_by(line, radius, float(np.hypot(other_x - x, other_y - y)), other - radius))
    doubts += sorted(beside, key=lambda doubt: -(doubt.effect or 0.0))[:1]
    if picked:
        return doubts
    if outline.roughly:
        line = f"{taken} the ball is blurred, small or hidden so far that it may be another thing; {remedy}"
        doubts.append(Doubt(line, WRONG))
    elif radius < SMALL and outline.coverage < SEEN:
        line = (
            f"{taken} no more than {100 * outline.coverage:.0f} % of so small a rim is seen, which may be a pixel off; "
        )
        doubts.append(_off_by(f"{line}{remedy}, or photograph the ball larger", radius, OFF, 0.0))
    return doubts


def _off_by(line: str, radius: float, shift: float, growth: float) -> Doubt:
    """A rim that may be off by so many pixels, with its effect.

    What the middle mirrors turns by twice the shift in radii, and a diffuse surface's light by no more than that; near
    the rim what lies outside is taken as light, or light is left out.
    """
    effect = max(2 * (shift + abs(growth)) / radius, abs((1 + growth / radius) ** 2 - 1))
    return Doubt(line, effect if max(shift, abs(growth)) <= ALIKE * radius else max(WRONG, effect))


def _explained(doubt: Doubt, probe: Probe, known: bool) -> Doubt:
    """A doubt of registration, with what most often is behind it."""
    words = doubt.line.split()
    if not known or "does not fit" not in doubt.line or words[:1] != ["view"]:
        return doubt
    turned = math.degrees(probe.corrections[int(words[1]) - 1])
    line = (
        f"{doubt.line}; registration turned it by {turned:.1f}°, and was the camera's height given (--camera X,Y,Z "
        "with Y up)? Folders or --view without --turn have the turn found"
    )
    return Doubt(line, doubt.effect)


def _ball_facts(view: BallView) -> dict[str, Any]:
    outline = view.outline
    found: dict[str, Any] = {
        "x": round(outline.centre[0], 2),
        "y": round(outline.centre[1], 2),
        "radius": round(outline.radius, 2),
        "radii away": round(view.distance, 2),
    }
    if outline.semi_axes is not None and outline.semi_axes[0] > 1.001 * outline.semi_axes[1]:
        found["semi-axes"] = [round(axis, 2) for axis in outline.semi_axes]
    return found

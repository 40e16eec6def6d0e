"""The last step of `insert`: the rendered change matched to the plate, composited over it, and developed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.composite.differential import Additive, Ratio, composed
from relume.composite.mattes import read_matte
from relume.errors import warn
from relume.image.bands import SMALL, in_bands
from relume.image.colour_space import to_own_primaries
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.project.insertion.photographs import Calibrated
from relume.project.insertion.place import Place
from relume.project.insertion.prepared import film_of
from relume.project.shot_file.match_table import MatchTable
from relume.project.shot_file.shot import Shot
from relume.project.stages import Steps
from relume.renderers.results import Change
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.grain import Grain
from relume.virtual_camera.plate_matching.grain_measuring import bracket_grain, radiance_grain
from relume.virtual_camera.plate_matching.matching import (
    Match,
    add_grain,
    apply_vignetting,
    composite_into_photograph,
    match_to_plate,
)
from relume.virtual_camera.plate_matching.sharpness import Sharpness, measured_sharpness

GREY = 118 / 255
"""The pixel value of a middle grey, sRGB's of 0.18."""
SOFT = 1.0
"""Pixels of blur above which a plate's measured sharpness is doubted: its edges are then few or of defocused things."""


@dataclass(frozen=True, eq=False)
class Development:
    """How the composite becomes a picture.

    film : the picture is developed on it
    bracket : the plate's photographs, where `index` is of one
    index : of the photograph that the picture is made in, where there is one
    """

    film: Film
    bracket: Bracket | None = None
    index: int | None = None

    @property
    def photograph(self) -> Photograph | None:
        """The photograph that the picture is made in, or None."""
        return None if self.bracket is None or self.index is None else self.bracket.photographs[self.index]


@dataclass(frozen=True, eq=False)
class Composite:
    """The composite, and what it was made from.

    radiance : (H, W, 3) float32 scene-linear
    picture, before : the developed composite, and the plate developed alike
    change : what the objects change, as it was composited
    without : (H, W, 3) the model of the place without objects
    match : what of the plate's look the objects were given
    """

    radiance: np.ndarray
    picture: Photograph
    before: Photograph
    change: Change
    without: np.ndarray
    match: Match


@dataclass(frozen=True, eq=False)
class Look:
    """What was measured of the plate's look; None leaves the objects as rendered.

    sharpness : of the plate
    radiance_grain, photograph_grain : of the plate's radiance, and of the photograph that the picture is made in
    """

    sharpness: Sharpness | None
    radiance_grain: Grain | None
    photograph_grain: Grain | None


def development_of(shot: Shot, calibrated: Calibrated) -> Development:
    """How the shot's composite is developed: on the film of the photograph whose middle value is nearest to grey."""
    table, bracket = shot.develop, calibrated.bracket
    if bracket is None or table.response == "srgb":
        return Development(film_of(calibrated.plate).brighter(table.exposure))
    middles = [float(np.median(p.pixels)) / np.iinfo(p.pixels.dtype).max for p in bracket.photographs]
    index = int(np.argmin(np.abs(np.array(middles) - GREY)))
    response = calibrated.response(bracket.photographs[index].camera)
    film = Film(float(bracket.exposures[index]), response).brighter(table.exposure)
    return Development(film, bracket, index if table.exposure == 0 else None)


def composited(
    shot: Shot, calibrated: Calibrated, place: Place, change: Change, development: Development, steps: Steps
) -> Composite:
    """The change, matched to the plate's look, over the plate; scene-linear and developed. Raises InvalidShot."""
    plate = calibrated.plate
    # What the objects are given of the plate's look.
    look = plate_look(shot, calibrated, development, steps)
    match = Match(
        place.vignetting, look.sharpness, look.radiance_grain, look.photograph_grain, shot.match.seed
    )  # fmt: skip
    with steps.timed("composite"):
        # Scene-linear, without grain.
        real = place.recovered
        textured = None if real is None else real.textured
        put_away = steps.stages.put_away
        change = match_to_plate(change, match, plate.radiance, textured, put_away)
        without = plate.radiance if real is None else real.without
        occluder = None
        if shot.match.occluder is not None:
            occluder = read_matte(shot.path(shot.match.occluder), plate.size)
        mode = Ratio(apply_vignetting(without, match)) if shot.match.mode == "ratio" else Additive()
        composite = put_away(composed(plate.radiance, change, mode=mode, occluder=occluder))
        if occluder is not None:
            change = _behind(change, occluder)
        # With grain, and developed.
        photograph, film = development.photograph, development.film
        grainy = add_grain(composite, change.matte, match)
        grainy = composite if grainy is composite else put_away(grainy)
        if photograph is None:
            picture, before = (_developed(each, film, development) for each in (grainy, plate.radiance))
        else:
            picture = _in_photograph(photograph, film, composite, plate.radiance, change.matte, match)
            before = photograph
    return Composite(grainy, picture, before, change, without, match)


def plate_look(shot: Shot, calibrated: Calibrated, development: Development, steps: Steps) -> Look:
    """The plate's sharpness and grain, which the objects are given; measured once."""
    made_from = _look_made_from(shot, calibrated, development)
    return steps.keep("match", made_from, lambda: _look(shot, calibrated, development))


def begin_plate_look(shot: Shot, calibrated: Calibrated, development: Development, steps: Steps) -> None:
    """Begin to measure it beside what follows; not of a large plate, which takes memory and all cores for it."""
    if calibrated.plate.radiance.size <= 3 * SMALL:
        made_from = _look_made_from(shot, calibrated, development)
        steps.begin("match", made_from, lambda: _look(shot, calibrated, development))


def _look_made_from(shot: Shot, calibrated: Calibrated, development: Development) -> list[object]:
    bracket = development.bracket
    return [
        calibrated.plate, development.index, calibrated.cameras,
        None if bracket is None else [bracket.exposures, [each.pixels for each in bracket.photographs]],
        shot.match.sharpness, shot.match.grain, shot.plate.denoise,
    ]  # fmt: skip


def _in_photograph(
    photograph: Photograph, film: Film, composite: np.ndarray, plate: np.ndarray, matte: np.ndarray, match: Match
) -> Photograph:
    """The photograph with what the composite (H, W, 3) has and the plate has not, developed on its film."""
    height, width = matte.shape
    grain = match.photograph_grain
    noise = None if grain is None else grain.draw((width, height), match.seed)
    pixels = photograph.pixels.copy()

    def work(rows: slice) -> None:
        if not matte[rows].any() and np.array_equal(composite[rows], plate[rows]):
            return
        after, bare = (film.pixel_values(to_own_primaries(each[rows], photograph)) for each in (composite, plate))
        part = replace(photograph, pixels=photograph.pixels[rows], outside=None)
        own = None if noise is None else noise[rows]
        pixels[rows] = composite_into_photograph(part, after, bare, matte[rows], match, own).pixels

    in_bands(height, width, work)
    return replace(photograph, pixels=pixels, name="developed picture")


def _developed(radiance: np.ndarray, film: Film, development: Development) -> Photograph:
    """Radiance on the plate's film, in the colour space of its photographs, as whose profile it is marked."""
    if development.bracket is None:
        return develop(radiance, film)
    first = development.bracket.photographs[0]
    return replace(develop(to_own_primaries(radiance, first), film), profile=first.profile)


def _behind(change: Change, occluder: np.ndarray) -> Change:
    """The change behind an occluder (H, W) that is 1 where it covers."""
    share = (1 - occluder).astype(np.float32)
    return replace(
        change,
        matte=change.matte * share,
        objects=change.objects * share[..., None],
        difference=change.difference * share[..., None],
    )


def _look(shot: Shot, calibrated: Calibrated, development: Development) -> Look:
    """The plate's sharpness and grain, as far as [match] asks for them."""
    plate, table, bracket = calibrated.plate, shot.match, development.bracket
    grain = photograph_grain = None
    if table.grain and not shot.plate.denoise:
        grain = radiance_grain(plate)
    if table.grain and bracket is not None and development.index is not None:
        camera = bracket.photographs[development.index].camera
        photograph_grain = bracket_grain(bracket, development.index, calibrated.response(camera))
    return Look(_sharpness(table, plate), grain, photograph_grain)


def _sharpness(table: MatchTable, plate: RadianceMap) -> Sharpness | None:
    """The sharpness that [match] gives or asks to be measured; warns where the plate shows little of it."""
    if table.sharpness is not True:
        return Sharpness(float(table.sharpness)) if table.sharpness else None
    sharpness = measured_sharpness(plate)
    if sharpness is None:
        warn(
            "match.sharpness: the plate shows no clean edge to measure its sharpness at; the objects stay as sharp "
            "as they are rendered, or give a number of pixels"
        )
    elif sharpness.sigma > SOFT:
        warn(
            f"match.sharpness: the plate's edges are blurred by σ = {sharpness.sigma:.2f} pixels, and so are the "
            "objects; where those edges are out of focus, give a smaller number"
        )
    return sharpness

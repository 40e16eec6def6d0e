"""Fitting what was rendered into the plate: matched, composited and developed."""

from __future__ import annotations

import warnings
from dataclasses import astuple, replace

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.capture.lens.vignetting import Vignetting
from relume.capture.response.calibration import Calibration
from relume.composite.differential import Additive, Ratio, composed
from relume.composite.mattes import read_matte
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.project.shot_file.shot import Shot
from relume.project.stages import Arrays
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.grain import Grain, bracket_grain, radiance_grain
from relume.virtual_camera.plate_matching.matching import (
    Match,
    add_grain,
    apply_vignetting,
    composite_into_photograph,
    match_to_plate,
)
from relume.virtual_camera.plate_matching.sharpness import Sharpness, measured_sharpness

_GRAIN = ("values", "deviation", "correlation")
GREY = 118 / 255
"""The pixel value of a middle grey, sRGB's of 0.18."""
SOFT = 1.0
"""Pixels of blur above which a plate's measured sharpness is doubted: its edges are then few or of defocused things."""


def film_of(
    shot: Shot, plate: RadianceMap, bracket: Bracket | None, calibrations: dict[str, Calibration]
) -> tuple[Film, int | None]:
    """The film the picture is developed on, and the number of the photograph it sits in, where there is one."""
    table = shot.develop
    if bracket is None or table.response == "srgb":
        # Without a camera's curve, the plate's bright end is put just below white.
        film = Film(1 / max(float(np.percentile(plate.radiance, 99)), 1e-30))
        return film.brighter(table.exposure), None
    # The photograph whose middle value is nearest to middle grey is the one the picture sits in.
    middles = [float(np.median(p.pixels)) / np.iinfo(p.pixels.dtype).max for p in bracket.photographs]
    index = int(np.argmin(np.abs(np.array(middles) - GREY)))
    response = calibrations[bracket.photographs[index].camera].response
    film = Film(float(bracket.exposures[index]), response).brighter(table.exposure)
    return film, index if table.exposure == 0 else None


def looks_of(
    shot: Shot,
    plate: RadianceMap,
    bracket: Bracket | None,
    index: int | None,
    calibrations: dict[str, Calibration],
) -> Arrays:
    """What of the plate's look is measured, for keeping: its sharpness and its grain."""
    table = shot.match
    sharpness = None
    if table.sharpness is True:
        sharpness = measured_sharpness(plate)
        if sharpness is None:
            warnings.warn(
                "match.sharpness: the plate shows no clean edge to measure its sharpness at; the objects stay as sharp "
                "as they are rendered, or give a number of pixels",
                stacklevel=2,
            )
        elif sharpness.sigma > SOFT:
            warnings.warn(
                f"match.sharpness: the plate's edges are blurred by σ = {sharpness.sigma:.2f} pixels, and so are the "
                "objects; where those edges are out of focus, give a smaller number",
                stacklevel=2,
            )
    elif table.sharpness:
        sharpness = Sharpness(float(table.sharpness))
    grains: dict[str, Grain | None] = {}
    if table.grain and not shot.plate.denoise:
        grains["radiance"] = radiance_grain(plate)
    if table.grain and bracket is not None and index is not None:
        photograph = bracket.photographs[index]
        grains["photograph"] = bracket_grain(bracket, index, calibrations[photograph.camera].response)
    arrays: Arrays = {} if sharpness is None else {"sharpness": np.array(astuple(sharpness), np.float64)}
    for name, grain in grains.items():
        if grain is not None:
            arrays |= {f"{name}.{part}": getattr(grain, part) for part in _GRAIN}
    return arrays


def match_from(arrays: Arrays, vignetting: Vignetting | None, seed: int) -> Match:
    """What the objects are given of the plate's look."""
    sharpness = None
    if "sharpness" in arrays:
        sigma, error, edges = arrays["sharpness"]
        sharpness = Sharpness(float(sigma), float(error), int(edges))
    grains = {
        name: Grain(*(arrays[f"{name}.{part}"] for part in _GRAIN)) if f"{name}.values" in arrays else None
        for name in ("radiance", "photograph")
    }
    return Match(vignetting, sharpness, grains["radiance"], grains["photograph"], seed)


def vignetting_of(shot: Shot, plate: RadianceMap, camera: Camera) -> Vignetting | None:
    """The fall-off that is in the plate; None where there is none."""
    return shot.match.vignetting_in(shot.folder, camera.focal_length, plate.size)


def even_plate(plate: RadianceMap, vignetting: Vignetting | None) -> RadianceMap:
    """The plate without its fall-off: what the scene's radiance was, for recovering reflectance."""
    if vignetting is None:
        return plate
    return replace(plate, radiance=(plate.radiance / vignetting.falloff(plate.size)[..., None]).astype(np.float32))


def fitted(
    shot: Shot, plate: RadianceMap, change: Change, without: np.ndarray, match: Match
) -> tuple[np.ndarray, Change]:
    """The scene-linear composite without grain, and the change as it went in: matched, behind what is in front."""
    table = shot.match
    change = match_to_plate(change, match)
    occluder = None if table.occluder is None else read_matte(shot.folder / table.occluder, plate.size)
    mode = Ratio(apply_vignetting(without, match)) if table.mode == "ratio" else Additive()
    composite = composed(plate.radiance, change, mode=mode, occluder=occluder)
    if occluder is not None:
        behind = (1 - occluder).astype(np.float32)
        change = replace(
            change,
            matte=change.matte * behind,
            objects=change.objects * behind[..., None],
            difference=change.difference * behind[..., None],
        )
    return composite, change


def developed(
    composite: np.ndarray,
    plate: RadianceMap,
    matte: np.ndarray,
    match: Match,
    film: Film,
    photograph: Photograph | None,
) -> tuple[np.ndarray, Photograph, Photograph]:
    """The composite with its grain, the picture, and the plate developed alike: the photograph where there is one."""
    grainy = add_grain(composite, matte, match)
    if photograph is None:
        return grainy, develop(grainy, film), develop(plate.radiance, film)
    values = film.pixel_values(composite), film.pixel_values(plate.radiance)
    return grainy, composite_into_photograph(photograph, *values, matte, match), photograph

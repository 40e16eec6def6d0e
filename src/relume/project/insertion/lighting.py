"""From the shot's photographs to calibrated radiance: responses, the plate and the light, each a kept stage."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.capture.exposure.bracket import Bracket, read_bracket, require_told
from relume.capture.merging import merge
from relume.capture.response.calibration import Calibration, recover_response
from relume.errors import InvalidShot, NotABracket
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.probe.ball.blending import Probe, assemble
from relume.probe.ball.unwrapping import unwrap_ball
from relume.project.shot_file.shot import BallPhotographs, Shot
from relume.project.stages import Arrays
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap

WHITE = 255
"""Photographs are balanced at their white (see `Response.balanced_at`)."""


@dataclass(frozen=True, eq=False)
class Photographs:
    """Every photograph of a shot, as brackets; the plate's is None where the plate is a radiance map already."""

    plate: Bracket | None
    plate_map: RadianceMap | None
    balls: tuple[Bracket, ...]


def read_photographs(shot: Shot) -> Photographs:
    """Read all the brackets of a shot."""
    paths = shot.files(shot.plate.photographs)
    first = files.read(paths[0])
    plate = plate_map = None
    if isinstance(first, RadianceMap):
        if len(paths) > 1:
            raise InvalidShot(
                f"plate.photographs: {paths[0]} is a radiance map; give it alone, or a bracket without it"
            )
        plate_map = first
    else:
        plate = read_bracket(paths, times=shot.plate.times)
    balls = tuple(read_bracket(shot.files(b.photographs), times=b.times) for b in shot.light.balls or ())
    taken = [*([plate] if plate else []), *balls]
    require_told(taken)
    _require_one_scale(taken)
    return Photographs(plate, plate_map, balls)


def _require_one_scale(brackets: list[Bracket]) -> None:
    """Refuse brackets of which only some tell aperture or ISO: their scales would differ by what the others tell."""
    for attribute in ("f_number", "iso"):
        tells = [getattr(b.photographs[0].exposure, attribute) is not None for b in brackets]
        if any(tells) and not all(tells):
            known, unknown = brackets[tells.index(True)].name, brackets[tells.index(False)].name
            raise NotABracket(
                f"{unknown} tells no {attribute} and {known} does, so their scales differ; give times for all or none"
            )


def calibrate(photographs: Photographs) -> dict[str, Calibration]:
    """The response of each camera by its name, from all the brackets it took, balanced at white."""
    brackets: dict[str, list[Bracket]] = {}
    for bracket in (photographs.plate, *photographs.balls):
        if bracket is not None:
            brackets.setdefault(bracket.photographs[0].camera, []).append(bracket)
    found = {}
    for camera, taken in brackets.items():
        found[camera] = recover_response(taken).balanced_at(WHITE)
    return found


def calibration_arrays(calibrations: dict[str, Calibration]) -> Arrays:
    """For keeping: a few thousand of the observations are enough for the plot."""
    arrays: Arrays = {"cameras": np.array(list(calibrations))}
    for index, calibration in enumerate(calibrations.values()):
        arrays |= {
            f"{index}.log_exposure": calibration.response.log_exposure,
            f"{index}.noise": calibration.response.noise,
            f"{index}.residual": calibration.residual,
        }
        for channel, samples in enumerate(calibration.samples):
            arrays[f"{index}.samples.{channel}"] = samples[:: max(1, len(samples) // 2000)]
    return arrays


def calibrations_from(arrays: Arrays) -> dict[str, Calibration]:
    """The inverse of `calibration_arrays`."""
    found = {}
    for index, camera in enumerate(arrays["cameras"]):
        response = Response(arrays[f"{index}.log_exposure"], arrays[f"{index}.noise"])
        samples = tuple(arrays[f"{index}.samples.{channel}"] for channel in range(3))
        found[str(camera)] = Calibration(response, samples, arrays[f"{index}.residual"])  # pyright: ignore[reportArgumentType]
    return found


def measure_light(shot: Shot, brackets: Sequence[Bracket], calibrations: dict[str, Calibration]) -> Probe:
    """Merge every bracket of the ball, unwrap and blend."""
    ball = shot.light.ball
    tables: Sequence[BallPhotographs] = shot.light.balls or ()
    if ball is None or not tables:
        raise InvalidShot("light: balls and ball are both needed")
    views = []
    for table, bracket in zip(tables, brackets, strict=True):
        picture = merge(bracket, calibrations[bracket.photographs[0].camera].response)
        if picture.clipped is not None and (picture.clipped == 0).mean() < 0.01:
            raise NotABracket(f"{bracket.name}: almost nothing is measured; add longer and shorter exposures")
        reflectance = np.array(ball.reflectance, np.float32)
        picture = RadianceMap(picture.radiance / reflectance, None, picture.clipped, picture.unit)
        views.append(
            unwrap_ball(
                picture,
                camera=np.array(table.camera),
                centre=np.array(ball.centre),
                focal_length=table.focal_length or bracket.focal_length,
                radius=ball.radius,
                name=bracket.name,
            )
        )
    return assemble(views, size=shot.light.size)


def probe_arrays(probe: Probe) -> Arrays:
    """For keeping."""
    return {
        "radiance": probe.light.radiance,
        "corrections": np.array(probe.corrections),
        "nearness": np.array(probe.nearness),
        "clipped": np.array(probe.clipped_solid_angle),
        "marks": np.zeros(0, np.uint8) if probe.light.clipped is None else probe.light.clipped,
        "turns": np.zeros((0, 3, 3)) if probe.turns is None else probe.turns,
        "gains": np.array(probe.gains),
        "unseen": np.array(probe.unseen_solid_angle),
        "confidence": probe.confidence,
        "notes": np.array(probe.notes, dtype=np.str_),
    }


def probe_from(arrays: Arrays) -> Probe:
    """The inverse of `probe_arrays`."""
    return Probe(
        EnvironmentMap(arrays["radiance"], clipped=arrays["marks"] if arrays["marks"].size else None),
        tuple(map(float, arrays["corrections"])),
        float(arrays["nearness"]),
        float(arrays["clipped"]),
        arrays["confidence"],
        tuple(map(str, arrays["notes"])),
        arrays["turns"] if arrays["turns"].size else None,
        tuple(map(float, arrays["gains"])),
        float(arrays["unseen"]),
    )


def light_from_map(path: Path) -> Probe:
    """A finished map as light; nothing of it is uncertain."""
    try:
        light = as_environment(files.read_radiance(path))
    except ValueError as error:
        raise InvalidShot(f"{path}: {error}") from None
    return Probe(light, (), 0.0, 0.0, np.ones(light.radiance.shape[:2], np.float32))

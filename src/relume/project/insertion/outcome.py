"""What the main job made, and how it is written to the output folder."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.capture.response.calibration import DOUBTFUL_MISFIT, Calibration
from relume.errors import OutputNotWritten
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import BLACK, SATURATED, RadianceMap
from relume.probe.ball.blending import Probe
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.fit import CameraFit
from relume.sphere.environment_files import as_radiance_map
from relume.surface.reflectance import RecoveredLocal
from relume.virtual_camera.plate_matching.matching import Match

DARK = 0.03
"""The reflectance of coal and of black velvet: what reflects less is hardly found."""


@dataclass(frozen=True, eq=False)
class Inserted:
    """What the job made.

    composite : (H, W, 3) float32 scene-linear
    picture, before : the developed composite and the plate developed alike
    plate, camera, fit, probe, calibrations : what it was made from; `fit` tells how well the camera agrees
    recovered : the real surfaces, or None where there are none
    change : what the objects change, as it was composited
    without : (H, W, 3) the model of the place without objects
    match : what of the plate's look the objects were given
    seconds : of each stage; kept stages take next to none
    kept : the stages that an earlier run had made
    notes : what the user should know, a line each
    """

    composite: np.ndarray
    picture: Photograph
    before: Photograph
    plate: RadianceMap
    camera: Camera
    fit: CameraFit
    probe: Probe
    calibrations: dict[str, Calibration]
    recovered: RecoveredLocal | None
    change: Change
    without: np.ndarray
    match: Match
    seconds: dict[str, float]
    kept: tuple[str, ...]
    notes: tuple[str, ...]


def notes_on(
    plate: RadianceMap,
    probe: Probe,
    recovered: RecoveredLocal | None,
    calibrations: dict[str, Calibration],
    matte_of_objects: np.ndarray | None = None,
) -> tuple[str, ...]:
    """What the user should know of the measurements, a line each."""
    notes = list(probe.notes)
    if plate.clipped is not None and plate.clipped.any():
        white, black = int((plate.clipped == SATURATED).sum()), int((plate.clipped == BLACK).sum())
        if white:
            notes.append(f"{white} pixels of the plate are white in every photograph; take shorter exposures as well")
        if black:
            notes.append(f"{black} pixels of the plate are black in every photograph; take longer exposures as well")
    if probe.clipped_solid_angle > 0:
        notes.append(
            f"{probe.clipped_solid_angle:.2g} sr of the light are saturated in every photograph: the light is a lower "
            "bound there; add shorter exposures of the ball"
        )
    notes += recovered.notes if recovered is not None else ()
    for found in recovered.surfaces if recovered is not None else ():
        if found.measured is not None and max(found.measured) < DARK:
            stops = np.log2(0.2 / max(*found.measured, 1e-6))
            notes.append(
                f"the surface reflects only {max(found.measured):.2g} of the light that was measured, less than coal; "
                f"the light is far too strong for the plate (are the exposures of both right?), by some {stops:.0f} "
                "stops if the surface is a usual one"
            )
        if found.measured is not None and max(found.measured) > 1:
            notes.append(
                f"the surface reflects {max(found.measured):.2f} times the light that was measured; the light is too "
                "weak (was the ball's reflectance given? were its lamps saturated?)"
            )
    if len(calibrations) > 1:
        notes.append("plate and light come from different cameras; their scales are not tied to each other")
    if matte_of_objects is not None and not matte_of_objects.any():
        notes.append("no object is seen in the picture; are they in metres, and in the frame that the camera is in?")
    for camera, calibration in calibrations.items():
        if calibration.residual.max() > DOUBTFUL_MISFIT:
            notes.append(
                f"the response of {camera or 'the camera'} fits badly (misfit {calibration.residual.max():.2f}); are "
                "the exposure times right, and did nothing move?"
            )
    return tuple(notes)


def require_folder(out: Path) -> None:
    """Refuse an output folder that cannot be written, before any work is done."""
    existing = next((p for p in (out, *out.parents) if p.exists()), Path("."))
    if not existing.is_dir():
        raise OutputNotWritten(f"{out}: {existing} is not a folder; choose another -o")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise OutputNotWritten(f"{out}: no permission to write in {existing}; choose another -o")


def write_outcome(result: Inserted, out: Path) -> None:
    """Write everything but the report."""
    unit, change = result.plate.unit, result.change
    model = (1 - change.matte[..., None]) * result.without + change.difference + change.objects
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"{out}: cannot be made ({error.strerror}); choose another -o") from None
    files.write(out / "composite.exr", RadianceMap(result.composite, unit=unit))
    files.write(out / "composite.png", result.picture)
    files.write_layers(
        out / "layers.exr",
        {
            "with": model.astype(np.float32),
            "without": result.without.astype(np.float32),
            "objects": change.objects,
            "difference": change.difference,
            "matte": change.matte,
            "depth": change.depth,
            "normal": change.normal,
            "albedo": change.albedo,
            "variance": change.objects_variance + change.difference_variance,
            **({} if result.recovered is None else {"reflectance": result.recovered.albedo}),
        },
        unit=unit,
    )
    files.write(out / "light.exr", as_radiance_map(result.probe.light))
    for index, calibration in enumerate(result.calibrations.values()):
        name = "response.json" if index == 0 else f"response_{index}.json"
        files.write_text(out / name, calibration.response.to_json())

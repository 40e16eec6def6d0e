"""The result of `insert`: what it holds, what the user should know of it, and its files."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.capture.response.calibration import DOUBTFUL_MISFIT
from relume.errors import OutputNotWritten
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import BLACK, SATURATED, RadianceMap
from relume.project.insertion.composite import Composite
from relume.project.insertion.photographs import Calibrated
from relume.project.insertion.place import Place
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.sphere.environment_files import as_radiance_map

DARK = 0.03
"""The reflectance of coal and of black velvet: hardly anything reflects less."""


@dataclass(frozen=True, eq=False)
class Inserted:
    """The result of `insert`: the last links of its chain, and what the user should know.

    calibrated : radiance of plate and light
    place : camera, light and real surfaces
    composited : the composite and its layers
    seconds : of each step; kept stages take next to none
    kept : the stages that an earlier run had made
    notes : what the user should know, a line each
    """

    calibrated: Calibrated
    place: Place
    composited: Composite
    seconds: dict[str, float]
    kept: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def composite(self) -> np.ndarray:
        """(H, W, 3) float32, scene-linear."""
        return self.composited.radiance

    @property
    def picture(self) -> Photograph:
        """The developed composite."""
        return self.composited.picture

    @property
    def plate(self) -> RadianceMap:
        """The plate's radiance."""
        return self.calibrated.plate

    @property
    def camera(self) -> Camera:
        """The plate's camera."""
        return self.place.camera

    @property
    def change(self) -> Change:
        """What the objects change, as it was composited."""
        return self.composited.change


def notes_on(calibrated: Calibrated, place: Place, matte_of_objects: np.ndarray | None) -> tuple[str, ...]:
    """What the user should know of the measurements, a line each.

    matte_of_objects : None where there are no objects
    """
    plate, probe, recovered, calibrations = (
        calibrated.plate, calibrated.probe, place.recovered, calibrated.calibrations,
    )  # fmt: skip
    notes = list(probe.notes)
    # What was not measured.
    if plate.clipped is not None and plate.clipped.any():
        white, black = int((plate.clipped == SATURATED).sum()), int((plate.clipped == BLACK).sum())
        single = calibrated.bracket is not None and len(calibrated.bracket.photographs) == 1
        if white and single:
            notes.append(
                f"{white} pixels of the plate are white and stay so; what is seen through a shadow there is a guess"
            )
        elif white:
            notes.append(f"{white} pixels of the plate are white in every photograph; take shorter exposures as well")
        if black and not single:
            notes.append(f"{black} pixels of the plate are black in every photograph; take longer exposures as well")
    if probe.clipped_solid_angle > 0:
        notes.append(
            f"{probe.clipped_solid_angle:.2g} sr of the light are saturated in every photograph: the light is a lower "
            "bound there; add shorter exposures of the ball"
        )
    # What the real surfaces say of the light.
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
    # What else may be wrong.
    if len(calibrated.cameras) > 1 and calibrated.untied is None:
        notes.append(
            "plate and light come from different cameras: only their exposures tie their scales, to about half a stop; "
            "give light.scale if the objects come out too dark or too bright"
        )
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
    without, recovered = result.composited.without, result.place.recovered
    model = (1 - change.matte[..., None]) * without + change.difference + change.objects
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
            "without": without.astype(np.float32),
            "objects": change.objects,
            "difference": change.difference,
            "matte": change.matte,
            "depth": change.depth,
            "normal": change.normal,
            "albedo": change.albedo,
            "variance": change.objects_variance + change.difference_variance,
            **({} if recovered is None else {"reflectance": recovered.albedo}),
        },
        unit=unit,
    )
    files.write(out / "light.exr", as_radiance_map(result.calibrated.probe.light))
    for index, calibration in enumerate(result.calibrated.calibrations.values()):
        name = "response.json" if index == 0 else f"response_{index}.json"
        files.write_text(out / name, calibration.response.to_json())

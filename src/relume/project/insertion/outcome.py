"""The result of `insert`: what it holds, what the user should know of it, and its files."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import Doubt, OutputNotWritten
from relume.image import files
from relume.image.bands import in_bands
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.project.insertion.composite import Composite
from relume.project.insertion.photographs import Calibrated
from relume.project.insertion.place import Place
from relume.project.stages import Stages
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.sphere.environment_files import as_radiance_map


@dataclass(frozen=True, eq=False)
class Inserted:
    """The result of `insert`: the last links of its chain, and what the user should know.

    calibrated : radiance of plate and light
    place : camera, light and real surfaces
    composited : the composite and its layers
    seconds : of each step; kept stages take next to none
    kept : the stages that an earlier run had made
    doubts : what the user should know, what matters most first
    """

    calibrated: Calibrated
    place: Place
    composited: Composite
    seconds: dict[str, float]
    kept: tuple[str, ...]
    doubts: tuple[Doubt, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """The doubts, a line each."""
        return tuple(doubt.line for doubt in self.doubts)

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


def require_folder(out: Path) -> None:
    """Refuse an output folder that cannot be written, before any work is done."""
    existing = next((p for p in (out, *out.parents) if p.exists()), Path("."))
    if not existing.is_dir():
        raise OutputNotWritten(f"{out}: {existing} is not a folder; choose another -o")
    if not os.access(existing, os.W_OK | os.X_OK):
        raise OutputNotWritten(f"{out}: no permission to write in {existing}; choose another -o")


def write_picture(result: Inserted, out: Path, name: str) -> None:
    """Write the composite alone, as radiance and developed, under a name without its ending."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"{out}: cannot be made ({error.strerror}); choose another -o") from None
    files.write(out / f"{name}.exr", RadianceMap(result.composite, unit=result.plate.unit))
    files.write(out / f"{name}.png", result.picture)


def write_outcome(result: Inserted, out: Path, stages: Stages) -> None:
    """Write everything but the report.

    stages : of the job; what is not needed is put away beside them
    """
    unit, change = result.plate.unit, result.change
    without, recovered = result.composited.without, result.place.recovered
    model = np.empty(without.shape, np.float32)

    def work(rows: slice) -> None:
        shows = 1 - change.matte[rows, :, None]
        model[rows] = shows * without[rows] + change.difference[rows] + change.objects[rows]
        # Of a large plate, what was read: the planes together are more than all else.
        stages.mapped.release()

    in_bands(without.shape[0], without.shape[1], work)
    model = stages.put_away(model)
    variance = stages.put_away(change.objects_variance + change.difference_variance)
    write_picture(result, out, "composite")
    files.write_layers(
        out / "layers.exr",
        {
            "with": model,
            "without": without.astype(np.float32, copy=False),
            "objects": change.objects,
            "difference": change.difference,
            "matte": change.matte,
            "depth": change.depth,
            "normal": change.normal,
            "albedo": change.albedo,
            "variance": variance,
            **({} if recovered is None else {"reflectance": recovered.albedo}),
        },
        unit=unit,
        between=stages.mapped.release,
    )
    files.write(out / "light.exr", as_radiance_map(result.calibrated.probe.light))
    for index, calibration in enumerate(result.calibrated.calibrations.values()):
        name = "response.json" if index == 0 else f"response_{index}.json"
        files.write_text(out / name, calibration.response.to_json())

"""The shot file's [[views]]: further photographs of the real surfaces, which un-light them together with the plate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import model_validator

from relume.errors import InvalidShot, RelumeError
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.project.schema import Table, Vector
from relume.project.shot_file.camera_table import CameraTable, camera_fit
from relume.scene.scene import Infinite, Scene
from relume.sphere.environment_files import as_environment

if TYPE_CHECKING:
    from relume.composite.surface.several_plates import LitView


class ViewTable(Table):
    """A further photograph of the place: from another side, in another light, or both.

    photograph : a radiance map, as `relume merge` writes it, on the scale of its light
    camera : where it was taken from, as [camera] says it of the plate
    map : the light in it, where that is another than the plate's
    probe : where that map was taken, metres; the place of the plate's own light unless given
    """

    photograph: str
    camera: CameraTable
    map: str | None = None
    probe: Vector | None = None

    @model_validator(mode="after")
    def _stands_alone(self) -> ViewTable:
        if self.camera.of_ball is not None:
            raise ValueError("camera: a further photograph's place is given, not found from the ball")
        if self.probe is not None and self.map is None:
            raise ValueError("probe is the place of a map; give map, or leave probe out")
        return self

    def lit(self, place: Scene, folder: Path, number: int) -> LitView:
        """The photograph with its camera and light; raises InvalidShot naming the key.

        place : of the plate, without objects
        number : of the table, for messages
        """
        try:
            picture = files.read(folder / self.photograph)
            if not isinstance(picture, RadianceMap):
                raise ValueError(f"{self.photograph} is a photograph with a curve; merge it to a radiance map first")
            fit = camera_fit(self.camera, picture.size, folder, None)
            scene = place
            if self.map is not None:
                light = as_environment(files.read_radiance(folder / self.map))
                where = self.probe or place.probe
                # Lamps that hang in the plate's light are not those of another.
                scene = replace(place, light=light, lights=(), probe=where)
                if self.probe is not None and isinstance(place.distant, Infinite):
                    raise ValueError("probe says nothing of a distant scene at infinity; leave it out")
        except (ValueError, RelumeError) as error:
            raise InvalidShot(f"views.{number}: {error}") from None
        from relume.composite.surface.several_plates import LitView

        return LitView(picture, fit.camera, scene)

    def files(self) -> tuple[str, ...]:
        """The files that the table names."""
        return (self.photograph,) if self.map is None else (self.photograph, self.map)

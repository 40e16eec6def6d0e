"""A shot ready to be rendered, by relume or by another program: scene, camera, plate and how it is developed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.light.constellations.residual import KeyLights
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

WHITE_PERCENTILE = 99
"""Of a plate without a film: the radiance that is put just below white."""


def film_of(plate: RadianceMap) -> Film:
    """The film of a plate without a camera's curve: its bright end is put just below white."""
    return Film(1 / max(float(np.percentile(plate.radiance, WHITE_PERCENTILE)), 1e-30))


@dataclass(frozen=True, eq=False)
class PreparedShot:
    """A shot ready to be rendered: all of `insert` up to the render.

    scene : the light as the probe saw it, the real surfaces with their reflectance, and the objects
    camera : the plate's
    plate : scene-linear, in the light's unit
    photograph : the developed plate, for the eye; made from the plate by `film` unless given
    film : what the plate is developed by; the sRGB curve with the plate's bright end at white unless given
    keys : lights taken out of the scene's map, as `light.key_lights` and `extract_sun` find them, for programs that
        find small lights in a map by chance alone. They are exported as lamps and `keys.residual` as the map; without
        them the whole map is
    samples : rays a pixel, as the shot file says
    depth : bounces

    Raises ValueError where the plate is not of the camera's size.
    """

    scene: Scene
    camera: Camera
    plate: RadianceMap
    photograph: Photograph | None = None
    film: Film | None = None
    keys: KeyLights | None = None
    samples: int = 256
    depth: int = 12

    def __post_init__(self) -> None:
        size = (self.camera.width, self.camera.height)
        if self.plate.size != size:
            raise ValueError(f"the plate is {self.plate.size} pixels and its camera {size}; give both alike")
        if self.photograph is not None and self.photograph.size != size:
            raise ValueError(f"the photograph is {self.photograph.size} pixels and its camera {size}; give both alike")

    def developed_by(self) -> Film:
        """The film, or that of `film = None`."""
        return film_of(self.plate) if self.film is None else self.film

    def picture(self) -> Photograph:
        """The photograph, or the plate developed."""
        if self.photograph is not None:
            return self.photograph
        return develop(self.plate.radiance, self.developed_by())

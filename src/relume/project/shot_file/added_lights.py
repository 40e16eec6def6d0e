"""The shot file's light.added: lights that were never there, kept apart from the light that was measured.

Each is a disc of even radiance far away, in the scene's frame. It shines on the objects and casts their shadows; the
plate's own pixels, which it never lit, stay as they are.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import Field, field_validator, model_validator

from relume.project.schema import GreyOrColour, Table, Vector
from relume.project.shot_file.sequence_table import Frame, require_rising
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import pixel_directions


class AddedLightKey(Table):
    """An added light at a frame; what a key does not say is interpolated between the keys that do."""

    frame: Frame
    direction: Vector | None = None
    irradiance: GreyOrColour | None = None
    size: float | None = None


class AddedLight(Table):
    """One added light.

    direction : towards it, from where the light was measured
    irradiance : that it gives a surface which faces it, in the plate's unit: a number, or red, green and blue
    size : degrees across; 10 unless given, a lamp with a shade at two metres
    on : whether it shines
    keyframes : what it is at frames of a sequence
    """

    direction: Vector
    irradiance: GreyOrColour
    size: Annotated[float, Field(ge=0.5, le=120)] = 10.0
    on: bool = True
    keyframes: tuple[AddedLightKey, ...] = ()

    @model_validator(mode="after")
    def _keys_rise(self) -> AddedLight:
        require_rising(self.keyframes)
        return self

    @field_validator("direction")
    @classmethod
    def _points_somewhere(cls, value: Vector) -> Vector:
        if not np.linalg.norm(value) > 0:
            raise ValueError("direction is 0; give the vector towards the light, like [0.3, 0.8, 0.5]")
        return value

    @field_validator("irradiance")
    @classmethod
    def _gives_light(cls, value: Vector) -> Vector:
        if min(value) < 0:
            raise ValueError("irradiance is below 0; a light takes none away")
        return value

    def shining_in(self, light: EnvironmentMap) -> EnvironmentMap:
        """The light with this one in it: pixels across the disc's edge have their share of it."""
        towards = np.array(self.direction) / np.linalg.norm(self.direction)
        cosines = np.clip(pixel_directions(light.mapping, light.size) @ towards, -1, 1)
        angles = 2 * np.arcsin(np.sqrt(np.maximum((1 - cosines) / 2, 0)))  # of the chord: exact near 0
        areas = light.mapping.solid_angles(light.size)
        shares = np.clip((np.radians(self.size) / 2 - angles) / np.maximum(np.sqrt(areas), 1e-9) + 0.5, 0, 1)
        if not (shares * areas).any():  # smaller than a pixel
            shares[np.unravel_index(np.argmax(np.where(areas > 0, cosines, -2)), cosines.shape)] = 1.0
        # E = ∫ L cos θ dω of one radiance L.
        radiance = np.array(self.irradiance) / float((shares * areas * np.maximum(cosines, 0)).sum())
        return replace(light, radiance=(light.radiance + shares[..., None] * radiance).astype(np.float32))

"""The light of a scene file: its map or its colour, the lights that are no part of either, and the film for them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from relume.image import files
from relume.image.colour import luminance
from relume.project.scene_file.images import naming
from relume.project.schema import GreyOrColour, Positive, Table, Vector
from relume.scene.lights import (
    AmbientLight,
    Attenuation,
    DistantLight,
    Light,
    Linear,
    PointLight,
    SphereLight,
    SquareLaw,
    Unattenuated,
)
from relume.scene.motion.moving_objects import columns_turned
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import bounds
from relume.sphere.directions import UP, rotation_about
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong
from relume.virtual_camera.film.film import Film

EVEN_ROWS = 4
"""Rows of a map that is the same everywhere."""


class LightTable(Table):
    """The light of the distant scene: a map, turned about +Y counter-clockwise as seen from above, or one colour."""

    map: str | None = None
    colour: GreyOrColour | None = None
    turn: float = 0.0
    scale: Positive = 1.0

    @model_validator(mode="after")
    def _one_source(self) -> LightTable:
        if (self.map is None) == (self.colour is None):
            raise ValueError(f"has {'neither' if self.map is None else 'both'}; give one of map and colour")
        if self.colour is not None and "turn" in self.model_fields_set:
            raise ValueError("has turn, but a colour is the same from everywhere; remove turn")
        return self


class LinearTable(Table):
    """Light that falls linearly to nothing at a reach, metres."""

    linear: float


def _word_or_table(value: object) -> object:
    if isinstance(value, dict) or value in ("square", "none"):
        return value
    raise ValueError(f'got {value!r}; expected "square", "none" or {{ linear = REACH }}')


AttenuationTable = Annotated[
    Annotated[Literal["square", "none"], Tag("word")] | Annotated[LinearTable, Tag("table")],
    Discriminator(lambda value: "table" if isinstance(value, dict | LinearTable) else "word"),
    BeforeValidator(_word_or_table),
]


class PointTable(Table):
    """A point that shines alike in all directions."""

    kind: Literal["point"]
    position: Vector
    intensity: GreyOrColour
    falloff: AttenuationTable = "square"


class DistantTable(Table):
    """Parallel light, as of the sun."""

    kind: Literal["distant"]
    towards: Vector
    irradiance: GreyOrColour


class SphereTable(Table):
    """A lamp that has a size: a sphere that shines evenly."""

    kind: Literal["sphere"]
    position: Vector
    radius: Positive
    radiance: GreyOrColour


class AmbientTable(Table):
    """The same light from everywhere that nothing shadows."""

    kind: Literal["ambient"]
    radiance: GreyOrColour


AnyLightTable = Annotated[PointTable | DistantTable | AmbientTable | SphereTable, Field(discriminator="kind")]


def distant_light(table: LightTable | None, path: Path) -> EnvironmentMap:
    """The light from infinity, black without a table; raises InvalidScene naming the key.

    path : the scene file, beside which the map is looked for
    """
    if table is None:
        return _even((0.0, 0.0, 0.0))
    if table.colour is not None:
        with naming(f"{path}: light.colour"):
            light = _even(table.colour)
    else:
        with naming(f"{path}: light.map"):
            light = read_light(path.parent / (table.map or ""))
    with naming(f"{path}: light.scale"):
        return _adjusted(light, table)


def light_of(table: PointTable | DistantTable | AmbientTable | SphereTable, place: str) -> Light:
    """The light that a table stands for; raises InvalidScene naming the key below `place`."""
    with naming(place):
        match table:
            case PointTable():
                return PointLight(table.position, table.intensity, attenuation(table.falloff, f"{place}.falloff"))
            case DistantTable():
                return DistantLight(table.towards, table.irradiance)
            case SphereTable():
                return SphereLight(table.position, table.radius, table.radiance)
            case AmbientTable():
                return AmbientLight(table.radiance)


def attenuation(table: Literal["square", "none"] | LinearTable, place: str) -> Attenuation:
    """How light falls with distance; raises InvalidScene naming the `place`."""
    if isinstance(table, LinearTable):
        with naming(place):
            return Linear(table.linear)
    return SquareLaw() if table == "square" else Unattenuated()


def read_light(path: Path) -> EnvironmentMap:
    """The environment map in a file; raises UnreadableFile, or ValueError where its mapping is unknown."""
    picture = files.read_radiance(path)
    try:
        return as_environment(picture)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _even(colour: tuple[float, float, float]) -> EnvironmentMap:
    return EnvironmentMap(np.broadcast_to(np.array(colour, np.float32), (EVEN_ROWS, 2 * EVEN_ROWS, 3)).copy())


def _adjusted(light: EnvironmentMap, table: LightTable) -> EnvironmentMap:
    with np.errstate(over="ignore"):
        scaled = replace(light, radiance=(light.radiance * table.scale).astype(np.float32))
    angle = np.radians(table.turn % 360)
    if not angle:
        return scaled
    if not isinstance(light.mapping, LatLong):
        return scaled.rotated(rotation_about(UP, angle))
    return replace(scaled, radiance=columns_turned(scaled.radiance, angle).astype(np.float32))


def metered_scene(scene: Scene) -> Film:
    """The film of a photographer with an incident light meter among the objects, the same for every frame of a movie.

    The mean radiance of the light map becomes ½, as `metered` has it, or a white card that faces all of the scene's
    other lights becomes white, whichever takes less light: for one light of strength 1, of irradiance π, as Whitted's
    pictures have it, exposure 1. Exposure 1 too where nothing shines.
    """
    mean = float(luminance(scene.light.total())) / (4 * np.pi)
    low, high = bounds(scene.objects)
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    card = mean + sum(_shown_by_white(light, middle, radius) for light in scene.lights)
    brightest = max(card, 2 * mean)
    return Film(1 / brightest) if 0 < brightest < np.inf else Film()


def _shown_by_white(light: Light, middle: np.ndarray, radius: float) -> float:
    """The luminance of a white card that faces a light; one within the objects is metered at their border."""
    if isinstance(light, AmbientLight):
        return _luminance(light.radiance)
    if isinstance(light, DistantLight):
        return _luminance(light.irradiance) / np.pi
    distance = max(float(np.linalg.norm(np.asarray(light.position) - middle)), radius)
    if isinstance(light, SphereLight):
        # What faces a sphere of light gets π L (r/d)²; on the sphere itself, and from within, π L.
        return _luminance(light.radiance) * min(light.radius / max(distance, light.radius), 1.0) ** 2
    share = float(light.falloff.at(np.array(distance))) if distance > 0 else np.inf
    return _luminance(light.intensity) * share / np.pi


def _luminance(colour: tuple[float, float, float]) -> float:
    return float(luminance(np.asarray(colour, np.float64)))

"""The lights of a scene file that are no part of its map: `[[lights]]`, and the keys of those that move or change."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import numpy as np
from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from relume.errors import InvalidScene
from relume.project.keyed_values import table_at, values_at
from relume.project.scene_file.images import naming
from relume.project.scene_file.spectra import AMOUNTS, SpectrumTable, with_spectrum
from relume.project.schema import GreyOrColour, Positive, Table, Vector
from relume.project.shot_file.sequence_table import Frame, require_rising
from relume.scene.lights import (
    AmbientLight,
    Attenuation,
    DistantLight,
    Light,
    Linear,
    PointLight,
    RectangleLight,
    SphereLight,
    SquareLaw,
    Unattenuated,
)
from relume.scene.motion.keyframes import Interpolation


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


class LampKey(Table):
    """What a lamp is at a frame; what a key does not say is interpolated between the keys that do."""

    frame: Frame
    exposure: float | None = None


class PointKey(LampKey):
    """A point's place and intensity at a frame."""

    position: Vector | None = None
    intensity: GreyOrColour | None = None


class DistantKey(LampKey):
    """A sun's direction and irradiance at a frame."""

    towards: Vector | None = None
    irradiance: GreyOrColour | None = None


class SphereKey(LampKey):
    """A sphere's place, size and radiance at a frame."""

    position: Vector | None = None
    radius: Positive | None = None
    radiance: GreyOrColour | None = None


class RectangleKey(LampKey):
    """A rectangle's place, direction, size and radiance at a frame."""

    position: Vector | None = None
    towards: Vector | None = None
    look_at: Vector | None = None
    size: tuple[Positive, Positive] | None = None
    radiance: GreyOrColour | None = None
    up: Vector | None = None


class AmbientKey(LampKey):
    """Ambient radiance at a frame."""

    radiance: GreyOrColour | None = None


class LampTable(Table):
    """What all lamps have.

    exposure : stops by which it is brighter
    spectrum : of its light, which its amount, a single number, is then the luminance of
    keyframes : what it is at frames of a sequence
    """

    exposure: float = 0.0
    spectrum: SpectrumTable | None = None
    keyframes: Sequence[LampKey] = ()

    @model_validator(mode="after")
    def _keys_rise(self) -> LampTable:
        require_rising(self.keyframes)
        return self


class PointTable(LampTable):
    """A point that shines alike in all directions."""

    kind: Literal["point"]
    position: Vector
    intensity: GreyOrColour
    falloff: AttenuationTable = "square"
    keyframes: tuple[PointKey, ...] = ()


class DistantTable(LampTable):
    """Parallel light, as of the sun."""

    kind: Literal["distant"]
    towards: Vector
    irradiance: GreyOrColour
    keyframes: tuple[DistantKey, ...] = ()


class SphereTable(LampTable):
    """A lamp that has a size: a sphere that shines evenly."""

    kind: Literal["sphere"]
    position: Vector
    radius: Positive
    radiance: GreyOrColour
    keyframes: tuple[SphereKey, ...] = ()


class RectangleTable(LampTable):
    """A flat lamp: a rectangle that shines evenly to one side.

    towards, look_at : the direction that it faces, or the place; one of the two, and the keys have the same one
    """

    kind: Literal["rectangle"]
    position: Vector
    towards: Vector | None = None
    look_at: Vector | None = None
    size: tuple[Positive, Positive]
    radiance: GreyOrColour
    up: Vector = (0.0, 1.0, 0.0)
    keyframes: tuple[RectangleKey, ...] = ()

    @model_validator(mode="after")
    def _faces_one_way(self) -> RectangleTable:
        if (self.towards is None) == (self.look_at is None):
            fault = "missing" if self.towards is None else "there are towards and look_at, which say the same"
            raise ValueError(f"towards: {fault}; give one of towards, a direction, and look_at, a place")
        own, other = ("towards", "look_at") if self.look_at is None else ("look_at", "towards")
        if any(getattr(key, other) is not None for key in self.keyframes):
            raise ValueError(f"keyframes have {other}, but the lamp has {own}; give the same in both")
        if self.look_at == self.position:
            raise ValueError(f"look_at {list(self.position)} is where the lamp stands; it faces no direction")
        return self

    def direction(self) -> Vector:
        """The direction that it faces, of any length."""
        if self.look_at is None:
            assert self.towards is not None  # _faces_one_way
            return self.towards
        x, y, z = np.subtract(self.look_at, self.position).tolist()
        return (x, y, z)


class AmbientTable(LampTable):
    """The same light from everywhere that nothing shadows."""

    kind: Literal["ambient"]
    radiance: GreyOrColour
    keyframes: tuple[AmbientKey, ...] = ()


LampTableOfAKind = PointTable | DistantTable | AmbientTable | SphereTable | RectangleTable
AnyLampTable = Annotated[LampTableOfAKind, Field(discriminator="kind")]
Lamp = TypeVar("Lamp", bound=LampTable)


def lamps_of(tables: Sequence[LampTableOfAKind], path: Path) -> tuple[Light, ...]:
    """The lights of `[[lights]]`, as they are without their keys; raises InvalidScene naming the key.

    path : the scene file, beside which the files of spectra are looked for
    """
    return tuple(_lamp_of(each, f"{path}: lights.{index}", path.parent) for index, each in enumerate(tables))


def lamps_at(tables: Sequence[LampTableOfAKind], frame: float, between: Interpolation, path: Path) -> tuple[Light, ...]:
    """The lights at a frame of a sequence; raises InvalidScene naming the key and the frame."""
    return tuple(_lamp_at(each, index, frame, between, path) for index, each in enumerate(tables))


def attenuation(table: Literal["square", "none"] | LinearTable, place: str) -> Attenuation:
    """How light falls with distance; raises InvalidScene naming the `place`."""
    if isinstance(table, LinearTable):
        with naming(place):
            return Linear(table.linear)
    return SquareLaw() if table == "square" else Unattenuated()


def _lamp_at(table: LampTableOfAKind, index: int, frame: float, between: Interpolation, path: Path) -> Light:
    place = f"{path}: lights.{index}"
    if not table.keyframes:
        return _lamp_of(table, place, path.parent)
    names = [name for name in type(table.keyframes[0]).model_fields if name != "frame"]
    changes = values_at(table.keyframes, frame, between, names)
    return _lamp_of(table_at(table, changes, place, frame, InvalidScene), f"{place}: at frame {frame:g}", path.parent)


def _lamp_of(table: LampTableOfAKind, place: str, folder: Path) -> Light:
    """The light that a table stands for; raises InvalidScene naming the key below `place`."""
    table = with_spectrum(_exposed(table), place, folder)
    with naming(place):
        match table:
            case PointTable():
                return PointLight(table.position, table.intensity, attenuation(table.falloff, f"{place}.falloff"))
            case DistantTable():
                return DistantLight(table.towards, table.irradiance)
            case SphereTable():
                return SphereLight(table.position, table.radius, table.radiance)
            case RectangleTable():
                return RectangleLight(table.position, table.direction(), table.size, table.radiance, table.up)
            case AmbientTable():
                return AmbientLight(table.radiance)


def _exposed(table: Lamp) -> Lamp:
    """A lamp's table with its stops in its amount of light."""
    if not table.exposure:
        return table
    changes: dict[str, Any] = {}
    for name in AMOUNTS:
        if hasattr(table, name):
            with np.errstate(over="ignore"):
                changes[name] = tuple((np.exp2(table.exposure) * np.array(getattr(table, name))).tolist())
    return table.model_copy(update=changes)

"""The shot file: one TOML that says which photographs, camera, light, surfaces and objects make a composite.

Paths are relative to the file; lengths are metres, angles degrees. An unknown key is an error, never ignored.
"""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from relume.errors import InvalidShot, UnreadableFile

Vector = tuple[float, float, float]
Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0)]
Names = Annotated[list[str], BeforeValidator(lambda value: [value] if isinstance(value, str) else value)]
Mirrored = Annotated[float, Field(gt=0, le=1)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Plate(_Table):
    """The photograph that receives the objects: a bracket, a single photograph or one radiance map."""

    photographs: Names = Field(min_length=1)
    times: list[Positive] | None = None
    denoise: bool = False


class Grid(_Table):
    """A chequered board on the ground, photographed by the plate's camera."""

    photograph: str
    squares: tuple[Annotated[int, Field(ge=3)], Annotated[int, Field(ge=3)]]
    square: Positive


class Pose(_Table):
    """Where the plate's camera stood and looked, horizon level."""

    position: Vector
    look_at: Vector


class CameraTable(_Table):
    """The plate's camera: from a grid, or given."""

    grid: Grid | None = None
    pose: Pose | None = None
    focal_length: Positive | None = None

    @model_validator(mode="after")
    def _one_source(self) -> CameraTable:
        if self.grid is not None and self.grid.squares[0] <= self.grid.squares[1]:
            raise ValueError(
                f"grid.squares is {list(self.grid.squares)}; the long side comes first, and must be longer"
            )
        if (self.grid is None) == (self.pose is None):
            raise ValueError("give one of grid and pose")
        return self


class BallPhotographs(_Table):
    """A bracket of the mirrored ball and where its camera stood."""

    photographs: Names = Field(min_length=1)
    camera: Vector
    times: list[Positive] | None = None
    focal_length: Positive | None = None


class Ball(_Table):
    """The mirrored ball; `reflectance` of its surface, 1 unless measured."""

    centre: Vector
    radius: Positive
    reflectance: Mirrored | tuple[Mirrored, Mirrored, Mirrored] = 1.0


class Distant(_Table):
    """The shape of the distant scene."""

    shape: Literal["infinite"] = "infinite"


class Light(_Table):
    """The light of the place: photographs of a mirrored ball, or a finished map."""

    balls: list[BallPhotographs] | None = None
    ball: Ball | None = None
    map: str | None = None
    size: Annotated[int, Field(ge=16, le=8192)] = 512
    distant: Distant = Distant()

    @model_validator(mode="after")
    def _one_source(self) -> Light:
        if (self.balls is None) == (self.map is None):
            raise ValueError("give one of balls and map")
        if self.balls is not None and (self.ball is None or not self.balls):
            raise ValueError("balls need ball = { centre, radius }")
        return self


class Local(_Table):
    """A real surface that the objects affect."""

    shape: Literal["plane"]
    size: tuple[Positive, Positive] | None = None
    height: float = 0.0
    reflectance: Literal["recover"] | tuple[Share, Share, Share] = "recover"


class MaterialTable(_Table):
    """What to change of a mesh's own material."""

    base_color: tuple[Share, Share, Share] | None = None
    metallic: Share | None = None
    roughness: Share | None = None
    transmission: Share | None = None
    ior: Annotated[float, Field(ge=1)] | None = None


class Object(_Table):
    """A mesh to insert, placed by its own transform and then scaled, turned and moved."""

    mesh: str
    scale: Positive = 1.0
    rotate: Vector = (0.0, 0.0, 0.0)
    translate: Vector = (0.0, 0.0, 0.0)
    material: MaterialTable = MaterialTable()


class RenderTable(_Table):
    """How long to render."""

    samples: Annotated[int, Field(ge=2, le=1_000_000)] = 256
    noise: Positive | None = None
    depth: Annotated[int, Field(ge=1, le=1000)] = 12
    seed: Annotated[int, Field(ge=0)] = 0
    denoise: bool = False


class DevelopTable(_Table):
    """How the composite becomes a picture: the plate's response, or the sRGB curve; exposure in stops on top."""

    response: Literal["plate", "srgb"] = "plate"
    exposure: float = 0.0


class Shot(_Table):
    """A whole shot file; `folder` is where its relative paths start."""

    plate: Plate
    camera: CameraTable
    light: Light
    local: list[Local] = [Local(shape="plane")]
    objects: list[Object] = []
    render: RenderTable = RenderTable()
    develop: DevelopTable = DevelopTable()
    folder: Path = Field(default=Path("."), exclude=True)

    def files(self, patterns: Sequence[str]) -> list[Path]:
        """The files that names and patterns stand for, in order; raises UnreadableFile where one is none."""
        found: list[Path] = []
        for pattern in patterns:
            path = self.folder / pattern
            matches = sorted(self.folder.glob(pattern), key=_natural) if any(c in pattern for c in "*?[") else [path]
            if not matches:
                raise UnreadableFile(f"{path}: no such photographs; check the pattern in the shot file")
            found.extend(matches)
        return found


def _natural(path: Path) -> list[tuple[int, int | str]]:
    """IMG_2 before IMG_10, as a person counts, so that a list of times goes to the right photographs."""
    return [(0, int(part)) if part.isdigit() else (1, part) for part in re.split(r"(\d+)", str(path))]


def read_shot(path: str | Path) -> Shot:
    """Read a shot file; raises InvalidShot naming the key and what it should be."""
    path = Path(path)
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InvalidShot(f"{path}: no such shot file; check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidShot(f"{path}: cannot be read ({error.__class__.__name__}); is it a text file?") from None
    except tomllib.TOMLDecodeError as error:
        raise InvalidShot(f"{path}: not valid TOML: {error}") from None
    if "folder" in table:
        raise InvalidShot(f"{path}: folder: unknown key; remove it")
    try:
        return Shot.model_validate(table | {"folder": path.parent})
    except ValidationError as error:
        raise InvalidShot(f"{path}: {_first_fault(error, table)}") from None


def _first_fault(error: ValidationError, table: dict[str, Any]) -> str:
    fault = error.errors()[0]
    place = ".".join(
        str(part) for part in fault["loc"] if not str(part).startswith(("tuple", "literal", "constrained"))
    )
    if fault["type"] == "extra_forbidden":
        near = difflib.get_close_matches(str(fault["loc"][-1]), _known_keys(fault["loc"]), 1)
        return f"{place}: unknown key" + (f"; did you mean {near[0]}?" if near else "; remove it or see the docs")
    if fault["type"] == "missing":
        return f"{place}: missing; the shot file must have it"
    message = fault["msg"].removeprefix("Value error, ")
    return f"{place}: {message[:1].lower()}{message[1:]}" + (f" (got {fault['input']!r})" if fault["loc"] else "")


def _known_keys(place: tuple[int | str, ...]) -> list[str]:
    """The keys of the table that `place` lies in."""
    model: Any = Shot
    for part in place[:-1]:
        if isinstance(part, str) and part in model.model_fields:
            model = _model_within(model.model_fields[part].annotation) or model
    return list(model.model_fields)


def _model_within(annotation: Any) -> Any:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((m for a in getattr(annotation, "__args__", ()) if (m := _model_within(a)) is not None), None)

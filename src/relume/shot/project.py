"""The shot file: one TOML that says which photographs, camera, light, surfaces and objects make a composite.

Paths are relative to the file; lengths are metres, angles degrees. An unknown key is an error, never ignored.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from relume.errors import InvalidShot, UnreadableFile
from relume.shot.schema import Names, Positive, Share, Table, Vector, checked, read_toml

Mirrored = Annotated[float, Field(gt=0, le=1)]


class Plate(Table):
    """The photograph that receives the objects: a bracket, a single photograph or one radiance map."""

    photographs: Names = Field(min_length=1)
    times: list[Positive] | None = None
    denoise: bool = False


class Grid(Table):
    """A chequered board on the ground, photographed by the plate's camera."""

    photograph: str
    squares: tuple[Annotated[int, Field(ge=3)], Annotated[int, Field(ge=3)]]
    square: Positive


class Pose(Table):
    """Where the plate's camera stood and looked, horizon level."""

    position: Vector
    look_at: Vector


class CameraTable(Table):
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


class BallPhotographs(Table):
    """A bracket of the mirrored ball and where its camera stood."""

    photographs: Names = Field(min_length=1)
    camera: Vector
    times: list[Positive] | None = None
    focal_length: Positive | None = None


class Ball(Table):
    """The mirrored ball; `reflectance` of its surface, 1 unless measured."""

    centre: Vector
    radius: Positive
    reflectance: Mirrored | tuple[Mirrored, Mirrored, Mirrored] = 1.0


class Distant(Table):
    """The shape of the distant scene."""

    shape: Literal["infinite"] = "infinite"


class Light(Table):
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


class Surface(Table):
    """The shape of a real surface."""

    shape: Literal["plane"]
    size: tuple[Positive, Positive] | None = None
    height: float = 0.0


class Local(Surface):
    """A real surface that the objects affect."""

    reflectance: Literal["recover"] | tuple[Share, Share, Share] = "recover"


class MaterialTable(Table):
    """What to change of a mesh's own material."""

    base_color: tuple[Share, Share, Share] | None = None
    metallic: Share | None = None
    roughness: Share | None = None
    transmission: Share | None = None
    ior: Annotated[float, Field(ge=1)] | None = None


class Placement(Table):
    """How a mesh is scaled, then turned about x, y and z, then moved, after its own transform."""

    scale: Positive = 1.0
    rotate: Vector = (0.0, 0.0, 0.0)
    translate: Vector = (0.0, 0.0, 0.0)


class Object(Placement):
    """A mesh to insert."""

    mesh: str
    material: MaterialTable = MaterialTable()


class RenderTable(Table):
    """How long to render."""

    samples: Annotated[int, Field(ge=2, le=1_000_000)] = 256
    noise: Positive | None = None
    depth: Annotated[int, Field(ge=1, le=1000)] = 12
    seed: Annotated[int, Field(ge=0)] = 0
    denoise: bool = False


class DevelopTable(Table):
    """How the composite becomes a picture: the plate's response, or the sRGB curve; exposure in stops on top."""

    response: Literal["plate", "srgb"] = "plate"
    exposure: float = 0.0


class Shot(Table):
    """A whole shot file; `folder` is where its relative paths start."""

    plate: Plate
    camera: CameraTable
    light: Light
    local: list[Local] = Field(default_factory=lambda: [Local(shape="plane")])
    objects: list[Object] = Field(default_factory=list)
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
    table = read_toml(path, "shot file", InvalidShot)
    if "folder" in table:
        raise InvalidShot(f"{path}: folder: unknown key; remove it")
    return checked(Shot, table, path, "shot file", InvalidShot).model_copy(update={"folder": path.parent})

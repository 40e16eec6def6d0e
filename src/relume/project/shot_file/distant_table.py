"""The shot file's light.distant: onto what the light is projected."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import model_validator

from relume.errors import InvalidShot
from relume.project.schema import Positive, Table, Vector
from relume.scene.distant import Box, Distant, Dome, Enclosure, Infinite
from relume.scene.shapes.meshes import read_meshes

_NEEDS = {"infinite": set(), "dome": {"radius"}, "box": {"low", "high"}, "mesh": {"mesh"}}
_MAY = {"dome": {"centre"}}


class DistantTable(Table):
    """The shape of the distant scene.

    shape : infinite, unless it is a dome of a radius about a centre, a box from one corner to the other, or a mesh
    """

    shape: Literal["infinite", "dome", "box", "mesh"] = "infinite"
    radius: Positive | None = None
    centre: Vector | None = None
    low: Vector | None = None
    high: Vector | None = None
    mesh: str | None = None

    @model_validator(mode="after")
    def _what_the_shape_needs(self) -> DistantTable:
        given = {name for name in ("radius", "centre", "low", "high", "mesh") if getattr(self, name) is not None}
        if lacking := sorted(_NEEDS[self.shape] - given):
            raise ValueError(f"a distant scene that is a {self.shape} needs {' and '.join(lacking)}")
        if foreign := sorted(given - _NEEDS[self.shape] - _MAY.get(self.shape, set())):
            raise ValueError(f"{', '.join(foreign)}: not of a distant scene that is {self.shape}; leave it out")
        if self.low is not None and self.high is not None and not np.all(np.less(self.low, self.high)):
            raise ValueError(
                f"the box goes from {list(self.low)} to {list(self.high)}; each of low lies below its high"
            )
        return self


def distant_scene(table: DistantTable, folder: Path) -> Distant:
    """What a table describes; raises UnreadableFile for a mesh that cannot be read."""
    if table.shape == "dome":
        assert table.radius is not None  # _what_the_shape_needs
        return Dome(table.radius, table.centre or (0.0, 0.0, 0.0))
    if table.shape == "box":
        assert table.low is not None and table.high is not None
        return Box(table.low, table.high)
    if table.shape == "mesh":
        assert table.mesh is not None
        parts = read_meshes(folder / table.mesh)
        starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
        vertices = np.concatenate([part.vertices for part in parts])
        faces = np.concatenate([part.faces + start for part, start in zip(parts, starts, strict=False)])
        try:
            return Enclosure(vertices, faces.astype(np.int32))
        except ValueError as error:
            raise InvalidShot(f"light.distant.mesh: {table.mesh}: {error}") from None
    return Infinite()

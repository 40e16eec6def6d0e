"""A scene file's [whitted]: the settings of that renderer."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from pydantic import model_validator

from relume.project.scene_file.images import naming
from relume.project.scene_file.lamps import AttenuationTable, attenuation
from relume.project.schema import Table
from relume.renderers.whitted.antialiasing import Antialiasing
from relume.renderers.whitted.whitted import Whitted


class WhittedSettings(Table):
    """How trees are traced and pixels subdivided; what is left out is as in `Whitted`."""

    depth: int | None = None
    contribution: float | None = None
    attenuation: AttenuationTable | None = None
    subdivisions: int | None = None
    tolerance: float | None = None
    antialiasing: bool = True
    constellation: int | None = None
    rays: int | None = None
    clear_shadows: bool | None = None

    @model_validator(mode="after")
    def _of_use(self) -> WhittedSettings:
        for name in ("subdivisions", "tolerance"):
            if not self.antialiasing and getattr(self, name) is not None:
                raise ValueError(f"has {name}, but antialiasing is false; remove one of them")
        return self


def whitted_of(table: WhittedSettings | None, path: Path) -> Whitted:
    """The renderer that the table describes; raises InvalidScene naming the key."""
    if table is None:
        return Whitted()
    place = f"{path}: whitted"
    given: dict[str, Any] = table.model_dump(
        exclude_none=True, exclude={"attenuation", "antialiasing", "subdivisions", "tolerance"}
    )
    with naming(place):
        finer = table.model_dump(exclude_none=True, include={"subdivisions", "tolerance"})
        given["antialiasing"] = replace(Antialiasing(), **finer) if table.antialiasing else None
        if table.attenuation is not None:
            given["attenuation"] = attenuation(table.attenuation, f"{place}.attenuation")
        return Whitted(**given)

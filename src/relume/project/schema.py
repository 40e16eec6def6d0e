"""The types of keys in TOML files of projects; the tables themselves are those of `relume.scene.toml_tables`."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Discriminator, Field, Tag

from relume.scene.toml_tables import Positive as Positive
from relume.scene.toml_tables import SomeTable as SomeTable
from relume.scene.toml_tables import Table as Table
from relume.scene.toml_tables import Vector as Vector
from relume.scene.toml_tables import checked as checked
from relume.scene.toml_tables import read_toml as read_toml

Share = Annotated[float, Field(ge=0, le=1)]
Names = Annotated[list[str], BeforeValidator(lambda value: [value] if isinstance(value, str) else value)]
Channels = Annotated[
    Annotated[float, Tag("number")] | Annotated[Vector, Tag("colour")],
    Discriminator(lambda value: "colour" if isinstance(value, list | tuple) else "number"),
]
"""A number, or one for each channel."""
GreyOrColour = Annotated[Vector, BeforeValidator(lambda value: [value] * 3 if _is_number(value) else value)]
"""One number for each channel, or a single one for grey."""
Paint = Annotated[
    Annotated[str, Tag("image")] | Annotated[Vector, Tag("colour")],
    Discriminator(lambda value: "image" if isinstance(value, str) else "colour"),
]
"""An image's path, or a colour."""


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)

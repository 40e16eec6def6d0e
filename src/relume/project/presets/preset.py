"""Presets: a whole virtual camera in a TOML file that a person can read, checked key by key.

Paths are relative to the file; angles are degrees, lengths as each key says. An unknown key is an error.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_type_hints

import numpy as np
from pydantic import Field, create_model

from relume.errors import InvalidShot, RelumeError
from relume.project.presets.kinds import TABLES, Make
from relume.project.schema import Positive, Table, checked, read_toml
from relume.virtual_camera.steps import Screen
from relume.virtual_camera.view import FIELD_OF_VIEW
from relume.virtual_camera.virtual_camera import VirtualCamera

WHAT = "preset"
BUILTIN = Path(__file__).with_name("builtin")


class ViewTable(Table):
    """Of the scene: the angle seen across, degrees; cd/m² per unit of a relative map; the seed of all randomness."""

    field_of_view: Annotated[float, Field(gt=0, lt=180)] = round(float(np.degrees(FIELD_OF_VIEW)), 6)
    luminance: Positive | None = None
    seed: Annotated[int, Field(ge=0)] = 0


class ScreenTable(Table):
    """The display's luminances, cd/m²; what is left out is that of the operator's own screen."""

    white: Positive | None = None
    black: Positive | None = None


@dataclass(frozen=True, eq=False)
class Preset:
    """A camera from a preset's tables.

    title : a line on it
    camera : the virtual camera
    view : what the preset says of the scene
    has_tone : whether it chooses a tone operator or a film, in place of plain exposure
    """

    title: str = ""
    camera: VirtualCamera = VirtualCamera()
    view: ViewTable = ViewTable()
    has_tone: bool = False


def read_preset(path: str | os.PathLike[str]) -> Preset:
    """A preset from its TOML file, or a built-in one by its name, like "night".

    Raises InvalidShot naming file and key, and errors of the files that the preset names.
    """
    table, place = preset_table(path)
    return preset_of(table, place)


def preset_table(path: str | os.PathLike[str]) -> tuple[dict[str, Any], Path]:
    """A preset's tables, unchecked, and the file they are from."""
    place = preset_file(path)
    return read_toml(place, WHAT, InvalidShot), place


def preset_file(path: str | os.PathLike[str]) -> Path:
    """The file itself, or that of the built-in preset of that name; raises InvalidShot."""
    place = Path(path)
    if place.is_file() or place.suffix:
        return place
    names = builtin_presets()
    if str(path) not in names:
        raise InvalidShot(f"{path}: no such preset; give a .toml, or one of {', '.join(names)}")
    return BUILTIN / f"{path}.toml"


def preset_of(table: Mapping[str, Any], place: Path = Path()) -> Preset:
    """The preset that tables make; raises InvalidShot naming the key.

    place : the file they are from, for messages and relative paths; none for those of the command line
    """
    origin = place if place.name else Path("the options")
    table = dict(table)
    if isinstance(table.get("display"), dict):
        table["display"] = {"kind": "srgb", **table["display"]}
    read: Any = checked(_schema(), table, origin, WHAT, InvalidShot)
    parts: dict[str, Any] = {}
    for name, kinds in TABLES.items():
        given = getattr(read, name)
        if given is None:
            continue
        make = kinds[given.kind] if isinstance(kinds, Mapping) else kinds
        try:
            parts[name] = _made(make, given, place.parent)
        except RelumeError:
            raise
        except ValueError as error:
            raise InvalidShot(f"{origin}: {name}: {error}") from None
    return Preset(read.title, VirtualCamera(**parts, stops=read.exposure), read.view, "tone" in parts)


def builtin_presets() -> dict[str, str]:
    """The built-in presets: name → what it is, in a line."""
    return {each.stem: read_toml(each, WHAT, InvalidShot)["title"] for each in sorted(BUILTIN.glob("*.toml"))}


@cache
def _schema() -> type[Table]:
    """The preset as a pydantic model: a model for each kind of each table, from what its maker is called with."""
    tables: dict[str, Any] = {}
    for name, kinds in TABLES.items():
        if isinstance(kinds, Mapping):
            models = [_model(make, kind) for kind, make in kinds.items()]
            tables[name] = (Annotated[Union[tuple(models)], Field(discriminator="kind")] | None, None)  # noqa: UP007
        else:
            tables[name] = (_model(kinds) | None, None)
    stops = Annotated[float, Field(ge=-100, le=100)]
    return create_model(
        "PresetTables", __base__=Table, title=(str, ""), exposure=(stops, 0.0), view=(ViewTable, ViewTable()), **tables
    )


def _model(make: Make, kind: str | None = None) -> type[Table]:
    """A table with the arguments of a function, or the fields of a dataclass, as keys."""
    hints = get_type_hints(make)
    keys: dict[str, Any] = {} if kind is None else {"kind": (Literal[kind], ...)}
    for name, argument in inspect.signature(make).parameters.items():
        if name == "folder":
            continue
        if hints[name] is Screen:
            keys[name] = (ScreenTable, ScreenTable())
        else:
            keys[name] = (hints[name], ... if argument.default is argument.empty else argument.default)
    return create_model(kind or make.__name__, __base__=Table, **keys)


def _made(make: Make, table: Table, folder: Path) -> Any:
    """The value that a checked table stands for: only its own keys are given, the rest keeps its default."""
    given = {key: getattr(table, key) for key in table.model_fields_set if key != "kind"}
    parameters = inspect.signature(make).parameters
    if isinstance(screen := given.get("screen"), ScreenTable):
        changes = {key: getattr(screen, key) for key in screen.model_fields_set}
        given["screen"] = replace(parameters["screen"].default, **changes)
    return make(**given, **({"folder": folder} if "folder" in parameters else {}))

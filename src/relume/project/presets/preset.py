"""Presets: a whole virtual camera in a TOML file that a person can read, checked key by key.

Paths are relative to the file; angles are degrees, lengths as each key says. An unknown key is an error.
"""

from __future__ import annotations

import inspect
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, Optional, Union, get_type_hints

import numpy as np
from pydantic import Field, create_model

from relume.errors import InvalidShot, RelumeError
from relume.project.presets.kinds import TABLES, Make
from relume.project.schema import Positive, Table, checked, read_toml
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.view import FIELD_OF_VIEW
from relume.virtual_camera.virtual_camera import VirtualCamera

WHAT = "preset"
PATHS = ("tone.config", "tone.response", "glare.picture", "vignetting.profile")
"""Keys that name files."""
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
class CameraPreset:
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

    @staticmethod
    def read(
        path: str | os.PathLike[str] | None, *changes: Mapping[str, Any] | str, place: Path | None = None
    ) -> CameraPreset:
        """A preset from its TOML file, or a built-in one by its name, like "night"; None starts from plain exposure.

        path : the file, .toml, or a name; None for plain exposure
        changes : put above the file one after another: tables of a preset, whose paths start at the working folder when
            they are absolute, or words like "tone.key=0.36". A table of another kind replaces the one in the file
        place : the file that holds the changes, for messages and their relative paths

        Raises InvalidShot naming file and key, and errors of the files that the preset names.
        """
        table = {} if path is None else read_toml(preset_file(path), WHAT, InvalidShot)
        if path is not None and place is not None:
            _place_paths(table, preset_file(path).parent)
        for change in changes:
            _put_above(table, _setting(change) if isinstance(change, str) else change)
        return preset_of(table, place or (Path() if path is None else preset_file(path)))

    @staticmethod
    def builtin() -> dict[str, str]:
        """The built-in presets: name → what it is, in a line."""
        return {each.stem: read_toml(each, WHAT, InvalidShot)["title"] for each in sorted(BUILTIN.glob("*.toml"))}

    @staticmethod
    def keys() -> dict[str, dict[str, dict[str, Any]]]:
        """Every key that a preset may have, with what it is unless given: table → kind → key → that.

        A table without kinds has the kind "". A key that has to be given, and one that is found in the picture unless
        given, has None; luminances of a screen are "screen.white" and "screen.black".
        """
        view = {name: each.default for name, each in ViewTable.model_fields.items()}
        found: dict[str, dict[str, dict[str, Any]]] = {"view": {"": view}}
        for name, kinds in TABLES.items():
            makers = kinds if isinstance(kinds, Mapping) else {"": kinds}
            found[name] = {kind: _defaults(make) for kind, make in makers.items()}
        return found

    @staticmethod
    def text(path: str | os.PathLike[str]) -> str:
        """The TOML of a preset, to start one's own from.

        path : the file, .toml, or the name of a built-in one, like "night"
        Raises InvalidShot.
        """
        return preset_file(path).read_text(encoding="utf-8")


def preset_file(path: str | os.PathLike[str]) -> Path:
    """The file itself, or that of the built-in preset of that name; raises InvalidShot."""
    place = Path(path)
    if place.is_file() or place.suffix:
        return place
    names = CameraPreset.builtin()
    if str(path) not in names:
        raise InvalidShot(f"{path}: no such preset; give a .toml, or one of {', '.join(names)}")
    return BUILTIN / f"{path}.toml"


def preset_of(table: Mapping[str, Any], place: Path = Path()) -> CameraPreset:
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
    return CameraPreset(read.title, VirtualCamera(**parts, stops=read.exposure), read.view, "tone" in parts)


def _put_above(table: dict[str, Any], given: Mapping[str, Any]) -> None:
    """Put `given` above a table: a table of another kind replaces the one that is there, else keys are added."""
    for key, value in given.items():
        there = table.get(key)
        if (
            isinstance(there, dict)
            and isinstance(value, Mapping)
            and value.get("kind", there.get("kind")) == there.get("kind")
        ):
            _put_above(there, value)
        else:
            table[key] = value


def _setting(text: str) -> dict[str, Any]:
    """KEY=VALUE as tables; a value that is no TOML is a word, and a path starts at the working folder."""
    key, equals, value = text.partition("=")
    for written in (value, f'"{value}"'):
        try:
            table = tomllib.loads(f"{key} = {written}") if equals and key.strip() else {}
        except tomllib.TOMLDecodeError:
            continue
        if key.strip() in PATHS:
            ((part, inner),) = table.items()
            table = {part: {name: _from_here(path) for name, path in inner.items()}}
        if table:
            return table
    raise InvalidShot(f'"{text}": expected KEY=VALUE, like tone.key=0.36')


def _place_paths(table: dict[str, Any], folder: Path) -> None:
    """Make the paths of a preset absolute, which start at a folder."""
    for name, key in (words.split(".") for words in PATHS):
        part = table.get(name)
        if isinstance(part, dict) and isinstance(part.get(key), str) and not part[key].startswith("ocio://"):
            part[key] = str((folder / part[key]).resolve())


def _from_here(path: Any) -> Any:
    return str(Path(path).resolve()) if isinstance(path, str) and not path.startswith("ocio://") else path


@cache
def _schema() -> type[Table]:
    """The preset as a pydantic model: a model for each kind of each table, from what its maker is called with."""
    tables: dict[str, Any] = {}
    for name, kinds in TABLES.items():
        if isinstance(kinds, Mapping):
            models = [_model(make, kind) for kind, make in kinds.items()]
            tables[name] = (Optional[Annotated[Union[tuple(models)], Field(discriminator="kind")]], None)  # noqa: UP007, UP045
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
        if hints[name] is DisplayRange:
            keys[name] = (ScreenTable, ScreenTable())
        else:
            keys[name] = (hints[name], ... if argument.default is argument.empty else argument.default)
    return create_model(kind or make.__name__, __base__=Table, **keys)


def _defaults(make: Make) -> dict[str, Any]:
    """The keys of a table that this makes, with what they are unless given."""
    found: dict[str, Any] = {}
    for name, argument in inspect.signature(make).parameters.items():
        if isinstance(argument.default, DisplayRange):
            found |= {f"{name}.white": argument.default.white, f"{name}.black": argument.default.black}
        elif name != "folder":
            found[name] = None if argument.default is argument.empty else argument.default
    return found


def _made(make: Make, table: Table, folder: Path) -> Any:
    """The value that a checked table stands for: only its own keys are given, the rest keeps its default."""
    given = {key: getattr(table, key) for key in table.model_fields_set if key != "kind"}
    parameters = inspect.signature(make).parameters
    if isinstance(screen := given.get("screen"), ScreenTable):
        changes = {key: getattr(screen, key) for key in screen.model_fields_set}
        given["screen"] = replace(parameters["screen"].default, **changes)
    return make(**given, **({"folder": folder} if "folder" in parameters else {}))

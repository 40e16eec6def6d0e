"""Reading a stage file with pydantic: every fault is one line that names the file, the key and the remedy.

See `stage_file` for the form, its frame and its units.
"""

from __future__ import annotations

import difflib
import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePath
from typing import Annotated, Any, Self

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from relume.errors import InvalidStage
from relume.lightstage.acquire.stage_file import LightEntry, Stage, StageCamera, TargetCard, Vector

_CAMERA = "camera_"
_MESH = "mesh"
"""A key at the top that means nothing here, but where the subject's geometry is sought (`stage_geometry`)."""
_SIMILARITY = 0.8
"""Of two keys, as `difflib` counts it, from which on one is the other misspelt: "subject" and "object" have 0.77."""


def _three(value: object) -> object:
    if not isinstance(value, list) or len(value) != 3:
        raise ValueError("expected three numbers")
    return value


def _inside(name: str) -> str:
    if PurePath(name).anchor or ".." in PurePath(name).parts:
        raise ValueError(f"{name} is not inside the stage's folder; put the pictures beside the file")
    return name


_Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
_Count = Annotated[int, Field(strict=True, gt=0)]
_Text = Annotated[str, Field(strict=True, min_length=1)]
_Vector = Annotated[tuple[_Number, _Number, _Number], BeforeValidator(_three)]
_Colour = Annotated[
    tuple[_Positive, _Positive, _Positive],
    BeforeValidator(lambda value: _three(value) if isinstance(value, list) else [value] * 3),
]
_Pixel = Annotated[int, Field(strict=True, ge=0)]


def _listed(value: object) -> object:
    return value if isinstance(value, list) else [value]


_Names = Annotated[tuple[Annotated[_Text, AfterValidator(_inside)], ...], Field(min_length=1), BeforeValidator(_listed)]
_Given: Any = None
"""The default of a key that may be left out, but may not be null."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class _Light(_Table):
    """One light, as the file describes it."""

    file: _Names = _Given
    files: Annotated[dict[str, _Names], Field(min_length=1)] = _Given
    name: _Text | None = None
    direction: _Vector = _Given
    position: _Vector = _Given
    inclination: _Number = _Given
    azimuth: _Number = _Given
    solid_angle: _Positive | None = None
    irradiance: _Colour = _Given
    exposure: Annotated[tuple[_Positive, ...], BeforeValidator(_listed)] | None = None

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.file is None) == (self.files is None):
            raise ValueError(f'{"neither" if self.file is None else "both"} "file" and "files"; give one of them')
        if self.direction is not None and self.position is not None:
            raise ValueError('both "direction" and "position"; give one of them')
        angles = self.inclination is not None and self.azimuth is not None
        if self.direction is None and self.position is None and not angles:
            raise ValueError('no direction; give "direction", "position" or "inclination" and "azimuth"')
        if self.direction is not None and not any(self.direction):
            raise ValueError(f"the direction {list(self.direction)} has no length; point it towards the light")
        if self.exposure is not None and any(len(names) != len(self.exposure) for names in self._files().values()):
            raise ValueError(f"{len(self.exposure)} exposures, but not as many files; give one a file")
        return self

    def _files(self) -> dict[str, tuple[str, ...]]:
        return {"": self.file} if self.files is None else self.files

    def entry(self, irradiance: Vector) -> LightEntry:
        """The same as a value; `irradiance` is that of all lights that have none of their own."""
        direction = self.direction
        if direction is None and self.position is None:
            across = np.sin(self.inclination)
            direction = (
                float(across * np.sin(self.azimuth)),
                float(np.cos(self.inclination)),
                float(across * np.cos(self.azimuth)),
            )
        own = irradiance if self.irradiance is None else self.irradiance
        files = self._files()
        return LightEntry(files, direction, self.position, self.name, self.solid_angle, own, self.exposure)


class _Camera(_Table):
    position: _Vector
    look_at: _Vector
    hfov_deg: Annotated[_Number, Field(gt=0, lt=180)]

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if self.position == self.look_at:
            raise ValueError(f"it stands where it looks at, {list(self.position)}; give two places")
        return self

    def value(self) -> StageCamera:
        return StageCamera(self.position, self.look_at, float(np.radians(self.hfov_deg)))


class _AllLights(_Table):
    irradiance_at_normal_incidence: _Colour = (1.0, 1.0, 1.0)
    angular_diameter_deg: _Number | None = None


class _Grid(_Table):
    inclination: _Count
    azimuth: _Count


class _Target(_Table):
    rectangle: tuple[_Pixel, _Pixel, _Count, _Count]
    reflectance: Annotated[_Positive, Field(le=1)]


class _StageTable(_Table):
    model_config = ConfigDict(extra="ignore", frozen=True)

    lights: Annotated[list[_Light], Field(min_length=1)]
    cameras: dict[str, _Camera] = {}
    light: _AllLights = _AllLights()
    grid: _Grid | None = None
    encoding: _Text = "srgb"
    subject: _Vector = (0.0, 0.0, 0.0)
    target: _Target | None = None


def read_stage_file(path: str | os.PathLike[str]) -> Stage:
    """The stage that a stage file describes; its pictures are not looked at.

    Raises InvalidStage for a file that is missing, no JSON, or has a wrong value, an unknown key in one of its tables,
    a misspelt one at the top, or a light without direction.
    """
    try:
        table = json.loads(Path(path).read_text("utf-8-sig"))
    except FileNotFoundError:
        raise InvalidStage(
            f"{path}: no such file; name the folder of the pictures, its stage.json or its .lp"
        ) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidStage(f"{path}: cannot be read ({error.__class__.__name__}); is it a text file?") from None
    except (json.JSONDecodeError, RecursionError) as error:
        raise InvalidStage(f"{path}: not valid JSON: {error}; correct it") from None
    if not isinstance(table, dict):
        raise InvalidStage(f'{path}: expected a table with "lights"')
    _refuse_misspelt(table, str(path))
    if not table.get("lights"):
        raise InvalidStage(f'{path}: has no "lights"; list one table a light, with its file and direction')
    # Cameras are written in two ways.
    named = {key: value for key, value in table.items() if key.startswith(_CAMERA)}
    cameras = table.get("cameras", {})
    if isinstance(cameras, dict):
        cameras = cameras | {key.removeprefix(_CAMERA): value for key, value in named.items()}
    try:
        found = _StageTable.model_validate({**table, "cameras": cameras})
    except ValidationError as error:
        raise InvalidStage(f"{path}: {_fault(dict(error.errors()[0]), table)}") from None
    stage = Stage(
        tuple(light.entry(found.light.irradiance_at_normal_incidence) for light in found.lights),
        {name: camera.value() for name, camera in found.cameras.items()},
        None if found.grid is None else (found.grid.inclination, found.grid.azimuth),
        found.encoding,
        found.subject,
        None if found.target is None else TargetCard(found.target.rectangle, found.target.reflectance),
        None if (diameter := found.light.angular_diameter_deg) is None else float(np.radians(diameter)),
        {key: value for key, value in table.items() if key not in _StageTable.model_fields and key not in named},
    )
    _require_consistent(stage, str(path))
    return stage


def _fault(error: Mapping[str, Any], table: Mapping[str, Any]) -> str:
    """Where a value is wrong, what it is and what is expected, in one line."""
    place, key = error["loc"], str(error["loc"][-1])
    unknown, missing = error["type"] == "extra_forbidden", error["type"] == "missing"
    where = _where(place[:-1] if unknown or missing else place, table)
    if unknown:
        near = _nearest_key(key, _keys_beside(place))
        hint = f"did you mean {near}?" if near else f"expected {', '.join(_keys_beside(place))}"
        return f'{where}: unknown key "{key}"; {hint}'
    if missing:
        return f'{where}: no "{key}"; expected {", ".join(_keys_beside(place))}'
    if error["type"] == "value_error":
        return f"{where}: {error['msg'].removeprefix('Value error, ')}"
    expected = error["msg"]
    shorter = {
        "Input should be": "expected",
        "a valid": "a",
        "greater than": "above",
        "less than or equal to": "at most",
    }
    for words, plain in shorter.items():
        expected = expected.replace(words, plain)
    return f"{where}: got {error['input']!r:.60}; {expected}"


def _where(place: Iterable[int | str], table: Mapping[str, Any]) -> str:
    """A place in the file as a person writes it."""
    parts = list(place)
    if parts[:1] == ["cameras"] and len(parts) > 1:
        parts = [f"camera {parts[1]}", *parts[2:]]
    text = ".".join(str(part) for part in parts)
    for part in parts:
        if isinstance(part, int):
            text = text.replace(f".{part}", f"[{part}]", 1)
    if parts[:1] == ["lights"] and len(parts) == 2:
        entry = table["lights"][parts[1]]
        named = entry.get("file") if isinstance(entry, dict) else None
        text += f" ({named})" if isinstance(named, str) else ""
    return text


def _keys_beside(place: tuple[int | str, ...]) -> list[str]:
    tables = {"lights": _Light, "cameras": _Camera, "light": _AllLights, "grid": _Grid, "target": _Target}
    return list(tables[str(place[0])].model_fields) if str(place[0]) in tables else list(_StageTable.model_fields)


def _nearest_key(key: str, known: list[str]) -> str | None:
    begun = [each for each in known if len(key) > 2 and each.startswith(key)]
    near = begun or difflib.get_close_matches(key, known, 1)
    return near[0] if near else None


def _refuse_misspelt(table: Mapping[str, Any], path: str) -> None:
    """Refuse keys at the top that are nearly known ones; what is unlike them all is another program's."""
    known = [*_StageTable.model_fields, _MESH]
    for key in table:
        if key in known or key.startswith(_CAMERA):
            continue
        before, line, name = key.partition("_")
        meant = _misspelt(key, known)
        if meant is None and line and _misspelt(before, ["camera", "cameras"]):
            meant = _CAMERA + name
        if meant is not None:
            raise InvalidStage(
                f'{path}: unknown key "{key}"; did you mean {meant}? Rename it if it means another thing'
            )


def _misspelt(key: str, known: list[str]) -> str | None:
    """The known key that differs from a key in little: a letter or two, their order, or capitals."""
    word = key.lower()
    swapped = [each for each in known if sorted(each) == sorted(word)]
    near = swapped or difflib.get_close_matches(word, known, 1, _SIMILARITY)
    return near[0] if near else None


def _require_consistent(stage: Stage, path: str) -> None:
    """Refuse lights that the same cameras did not all see, files used twice, names of no camera, a wrong grid."""
    seen = set(stage.lights[0].files)
    used: dict[str, str] = {}
    labels: set[str] = set()
    for entry in stage.lights:
        if set(entry.files) != seen:
            odd = sorted(set(entry.files) ^ seen)[0]
            raise InvalidStage(
                f'{path}: the light "{entry.label}" and the first are not of the same cameras ("{odd}"); '
                "give every light a picture of each camera"
            )
        if entry.label in labels:
            raise InvalidStage(f'{path}: two lights are called "{entry.label}"; give each its own name and file')
        labels.add(entry.label)
        for name in (name for names in entry.files.values() for name in names):
            if name in used:
                raise InvalidStage(
                    f'{path}: {name} is the picture of two lights, "{used[name]}" and "{entry.label}"; '
                    "give each its own"
                )
            used[name] = entry.label
    if stage.cameras and (unknown := sorted(seen - set(stage.cameras) - {""})):
        cameras = ", ".join(stage.cameras)
        raise InvalidStage(f'{path}: files of a camera "{unknown[0]}", but there are {cameras}; add it')
    if stage.grid is not None and stage.grid[0] * stage.grid[1] != len(stage.lights):
        raise InvalidStage(
            f"{path}: a grid of {stage.grid[0]} × {stage.grid[1]} lights, but it lists {len(stage.lights)}; add what "
            "is missing, or leave out grid"
        )

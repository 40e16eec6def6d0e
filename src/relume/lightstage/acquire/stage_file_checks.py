"""The values of a stage file, checked one by one: every fault is one line that names the file, the key and the remedy.

See `stage_file` for the form, its frame and its units.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

import numpy as np

from relume.errors import InvalidStage
from relume.lightstage.acquire.stage_file import LightEntry, Stage, StageCamera, TargetCard, Vector

_LIGHT_KEYS = (
    "file files name direction position inclination azimuth solid_angle irradiance exposure".split()  # of a light
)
_TOP_KEYS = "lights cameras light grid encoding subject target".split()
_COMMON_KEYS = ("irradiance_at_normal_incidence", "angular_diameter_deg")
_VIEW_KEYS = ("position", "look_at", "hfov_deg")
_GRID_KEYS = ("inclination", "azimuth")
_MESH = "mesh"
"""A key at the top that means nothing here, but where the subject's geometry is sought (`reading.stage_geometry`)."""
_CAMERA = "camera_"
_LIKENESS = 0.8
"""Of two keys, as `difflib` counts it, from which on one is the other misspelt: "subject" and "object" have 0.77."""


def stage_of(table: object, path: str) -> Stage:
    """The stage that the table of a stage file describes; raises InvalidStage."""
    if not isinstance(table, dict):
        raise InvalidStage(f'{path}: holds a {_kind(table)}; expected a table with "lights"')
    _refuse_misspelt(table, path)
    entries = table.get("lights")
    if not isinstance(entries, list) or not entries:
        raise InvalidStage(f'{path}: has no "lights"; list one table a light, with its file and direction')
    common = _table(table.get("light", {}), f"{path}: light")
    _refuse_unknown(common, _COMMON_KEYS, f"{path}: light")
    irradiance = _colour(
        common.get("irradiance_at_normal_incidence", 1.0), f"{path}: light.irradiance_at_normal_incidence"
    )
    diameter = common.get("angular_diameter_deg")
    lights = tuple(_light(entry, irradiance, f"{path}: lights[{i}]") for i, entry in enumerate(entries))
    cameras = _cameras(table, path)
    _require_alike(lights, cameras, path)
    return Stage(
        lights,
        cameras,
        _grid(table.get("grid"), len(lights), path),
        _text(table.get("encoding", "srgb"), f"{path}: encoding"),
        _vector(table.get("subject", [0, 0, 0]), f"{path}: subject"),
        None if table.get("target") is None else _target(table["target"], f"{path}: target"),
        None if diameter is None else float(np.radians(_number(diameter, f"{path}: light.angular_diameter_deg"))),
        {key: value for key, value in table.items() if key not in _TOP_KEYS and not key.startswith(_CAMERA)},
    )


def _light(entry: object, irradiance: Vector, where: str) -> LightEntry:
    table = _table(entry, where)
    _refuse_unknown(table, _LIGHT_KEYS, where)
    if ("file" in table) == ("files" in table):
        raise InvalidStage(f'{where}: {"both" if "file" in table else "neither"} "file" and "files"; give one of them')
    told = table["files"] if "files" in table else {"": table["file"]}
    files = {str(name): _names(names, f"{where}.files") for name, names in _table(told, f"{where}.files").items()}
    if not files:
        raise InvalidStage(f'{where}: "files" names no camera; give the picture of each')
    where = f"{where} ({next(iter(files.values()))[0]})"
    direction, position = _place(table, where)
    exposure = table.get("exposure")
    if exposure is not None:
        exposure = tuple(
            _positive(e, f"{where}.exposure") for e in (exposure if isinstance(exposure, list) else [exposure])
        )
        if any(len(names) != len(exposure) for names in files.values()):
            raise InvalidStage(f"{where}: {len(exposure)} exposures, but not as many files; give one a file")
    solid_angle = table.get("solid_angle")
    return LightEntry(
        files,
        direction,
        position,
        None if table.get("name") is None else _text(table["name"], f"{where}.name"),
        None if solid_angle is None else _positive(solid_angle, f"{where}.solid_angle"),
        _colour(table["irradiance"], f"{where}.irradiance") if "irradiance" in table else irradiance,
        exposure,
    )


def _place(table: Mapping[str, Any], where: str) -> tuple[Vector | None, Vector | None]:
    """The direction or the position of a light: whichever it has."""
    if "direction" in table and "position" in table:
        raise InvalidStage(f'{where}: both "direction" and "position"; give one of them')
    if "position" in table:
        return None, _vector(table["position"], f"{where}.position")
    if "direction" in table:
        direction = _vector(table["direction"], f"{where}.direction")
    elif "inclination" in table and "azimuth" in table:
        inclination, azimuth = (_number(table[key], f"{where}.{key}") for key in ("inclination", "azimuth"))
        across = np.sin(inclination)
        direction = (float(across * np.sin(azimuth)), float(np.cos(inclination)), float(across * np.cos(azimuth)))
    else:
        raise InvalidStage(f'{where}: no direction; give "direction", "position" or "inclination" and "azimuth"')
    if not np.linalg.norm(direction) > 0:
        raise InvalidStage(f"{where}.direction: {list(direction)} has no length; point it towards the light")
    return direction, None


def _cameras(table: Mapping[str, Any], path: str) -> dict[str, StageCamera]:
    told = dict(_table(table.get("cameras", {}), f"{path}: cameras"))
    told |= {key.removeprefix(_CAMERA): value for key, value in table.items() if key.startswith(_CAMERA)}
    return {str(name): _view(view, f"{path}: camera {name}") for name, view in told.items()}


def _view(view: object, where: str) -> StageCamera:
    table = _table(view, where)
    _refuse_unknown(table, _VIEW_KEYS, where)
    for key in _VIEW_KEYS:
        if key not in table:
            raise InvalidStage(f'{where}: no "{key}"; a camera has position, look_at and hfov_deg')
    degrees = _number(table["hfov_deg"], f"{where}.hfov_deg")
    if not 0 < degrees < 180:
        raise InvalidStage(f"{where}.hfov_deg: {degrees:g}; expected degrees across, above 0 and below 180")
    position, target = (_vector(table[key], f"{where}.{key}") for key in ("position", "look_at"))
    if position == target:
        raise InvalidStage(f"{where}: it stands where it looks at, {list(position)}; give two places")
    return StageCamera(position, target, float(np.radians(degrees)))


def _require_alike(lights: tuple[LightEntry, ...], cameras: Mapping[str, StageCamera], path: str) -> None:
    """Refuse lights that the same cameras did not all see, files used twice, and names of no camera."""
    seen = set(lights[0].files)
    used: dict[str, str] = {}
    labels: set[str] = set()
    for entry in lights:
        if set(entry.files) != seen:
            odd = sorted(set(entry.files) ^ seen)[0]
            raise InvalidStage(
                f'{path}: the light "{entry.label}" and the first are not of the same cameras ("{odd}"); '
                "give every light a picture of each camera"
            )
        if entry.label in labels:
            raise InvalidStage(f'{path}: two lights are called "{entry.label}"; give each its own name and file')
        labels.add(entry.label)
        for names in entry.files.values():
            for name in names:
                if name in used:
                    raise InvalidStage(
                        f'{path}: {name} is the picture of two lights, "{used[name]}" and "{entry.label}"; '
                        "give each its own"
                    )
                used[name] = entry.label
    if cameras and (unknown := sorted(seen - set(cameras) - {""})):
        raise InvalidStage(f'{path}: files of a camera "{unknown[0]}", but there are {", ".join(cameras)}; add it')


def _grid(grid: object, count: int, path: str) -> tuple[int, int] | None:
    if grid is None:
        return None
    table = _table(grid, f"{path}: grid")
    _refuse_unknown(table, _GRID_KEYS, f"{path}: grid")
    size = [table.get(key) for key in _GRID_KEYS]
    if not all(isinstance(n, int) and n > 0 for n in size):
        raise InvalidStage(f'{path}: grid: expected whole numbers "inclination" and "azimuth", got {dict(table)}')
    rows, columns = (int(n) for n in size if n is not None)
    if rows * columns != count:
        raise InvalidStage(
            f"{path}: a grid of {rows} × {columns} lights, but it lists {count}; add what is missing, or leave out grid"
        )
    return rows, columns


def _target(value: object, where: str) -> TargetCard:
    table = _table(value, where)
    _refuse_unknown(table, ["rectangle", "reflectance"], where)
    corner = _list(table.get("rectangle"), f"{where}.rectangle")
    if len(corner) != 4 or not all(isinstance(n, int) for n in corner) or min(corner) < 0 or min(corner[2:]) < 1:
        raise InvalidStage(f"{where}.rectangle: got {corner}; expected [left, top, width, height] in whole pixels")
    reflectance = _positive(table.get("reflectance"), f"{where}.reflectance")
    if reflectance > 1:
        raise InvalidStage(f"{where}.reflectance: {reflectance:g}; expected at most 1")
    return TargetCard((corner[0], corner[1], corner[2], corner[3]), reflectance)


# Single values


def _refuse_unknown(table: Mapping[str, Any], known: Sequence[str], where: str) -> None:
    for key in table:
        if key not in known:
            begun = [each for each in known if len(key) > 2 and each.startswith(key)]
            near = begun or difflib.get_close_matches(key, known, 1)
            hint = f"did you mean {near[0]}?" if near else f"expected {', '.join(known)}"
            raise InvalidStage(f'{where}: unknown key "{key}"; {hint}')


def _refuse_misspelt(table: Mapping[str, Any], path: str) -> None:
    """Refuse keys at the top that are nearly known ones; what is unlike them all is another program's."""
    known = [*_TOP_KEYS, _MESH]
    for key in table:
        if key in known or key.startswith(_CAMERA):
            continue
        before, line, name = key.partition("_")
        meant = _nearest(key, known)
        if meant is None and line and _nearest(before, ["camera", "cameras"]):
            meant = _CAMERA + name
        if meant is not None:
            raise InvalidStage(
                f'{path}: unknown key "{key}"; did you mean {meant}? Rename it if it means another thing'
            )


def _nearest(key: str, known: Sequence[str]) -> str | None:
    """The known key that differs from a key in little: a letter or two, their order, or capitals."""
    word = key.lower()
    turned = [each for each in known if sorted(each) == sorted(word)]
    near = turned or difflib.get_close_matches(word, known, 1, _LIKENESS)
    return near[0] if near else None


def _kind(value: object) -> str:
    return {list: "list", str: "text", type(None): "nothing"}.get(type(value), type(value).__name__)


def _table(value: object, where: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InvalidStage(f"{where}: got {value!r:.60}; expected a table")
    return value


def _list(value: object, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise InvalidStage(f"{where}: got {value!r:.60}; expected a list")
    return value


def _text(value: object, where: str) -> str:
    if not isinstance(value, str) or not value:
        raise InvalidStage(f"{where}: got {value!r:.60}; expected a text")
    return value


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise InvalidStage(f"{where}: got {value!r:.60}; expected a number")
    return float(value)


def _positive(value: object, where: str) -> float:
    number = _number(value, where)
    if number <= 0:
        raise InvalidStage(f"{where}: got {number:g}; expected a number above 0")
    return number


def _vector(value: object, where: str) -> Vector:
    if not isinstance(value, list) or len(value) != 3:
        raise InvalidStage(f"{where}: got {value!r:.60}; expected three numbers")
    x, y, z = (_number(part, where) for part in value)
    return x, y, z


def _colour(value: object, where: str) -> Vector:
    red, green, blue = _vector(value, where) if isinstance(value, list) else (_number(value, where),) * 3
    if min(red, green, blue) <= 0:
        raise InvalidStage(f"{where}: got {value!r:.60}; expected numbers above 0: a dark light shows nothing")
    return red, green, blue


def _names(value: object, where: str) -> tuple[str, ...]:
    names = tuple(_text(name, where) for name in (value if isinstance(value, list) else [value]))
    if not names:
        raise InvalidStage(f"{where}: an empty list; name at least one picture")
    for name in names:
        if PurePath(name).is_absolute() or ".." in PurePath(name).parts:
            raise InvalidStage(f"{where}: {name} is not inside the stage's folder; put the pictures beside the file")
    return names

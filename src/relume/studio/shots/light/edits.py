"""The light edited as a whole, as in HDR Shop: turned, scaled, converted, and a slice of it painted on elsewhere.

Every edit writes a map of its own into `lights/` and has the shot name it: what was measured stays beside.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import relume as rl
from relume.studio.shots.folder import PAINT, Folder

LIGHTS = "lights"
"""The folder of edited maps."""
GREY_RADIUS = 5.0
"""Pixels about the one that was clicked, whose mean shall be neutral."""
DIFFUSE_ROWS = 72
"""Of a diffusely integrated map, which varies slowly: 2.5° each."""
VIEW = (1024, 1024)
"""Pixels of a view that is cut out to be painted on."""


def edited_map(source: Path, folder: Folder, asked: Mapping[str, Any]) -> tuple[Path, dict[str, Any]]:
    """Write a map turned, scaled, blurred, in another mapping or size; its path, and its energy before and after.

    asked : turn, (yaw, pitch, roll) in degrees; stops; gains, by which red, green and blue are multiplied; grey, a
        pixel about which the map shall be neutral; blur, degrees; mapping, by its name; size, rows
    Raises ValueError, RelumeError.
    """
    turn = tuple(math.radians(_number(each, "turn")) for each in asked.get("turn") or (0, 0, 0))
    if len(turn) != 3:
        raise ValueError("turn is yaw, pitch and roll in degrees")
    name, size = asked.get("mapping"), asked.get("size")
    conversion = rl.light.MapConversion(
        mapping=None if not name else rl.mappings.mapping_named(str(name)),
        size=None if size is None else int(_number(size, "size")),
        turn=(turn[0], turn[1], turn[2]) if any(turn) else None,
    )
    picture = rl.as_radiance_map(rl.read_environment(source))
    operations = _operations(asked)
    if operations:
        picture = rl.light.edit(picture, operations).picture
    target = _free(folder, LIGHTS, "light", ".exr")
    return target, rl.light.convert_map(rl.as_environment(picture), target, conversion).facts


def _operations(asked: Mapping[str, Any]) -> list[rl.light.Edit]:
    """What is done to a map before it is turned and converted: first what names its pixels."""
    found: list[rl.light.Edit] = []
    if asked.get("grey") is not None:
        x, y = (int(_number(each, "grey")) for each in _listed(asked["grey"], 2, "grey is a pixel, x and y"))
        found.append(rl.light.NeutralAt(x, y, GREY_RADIUS))
    gains = [_number(each, "gains") for each in _listed(asked.get("gains") or [1, 1, 1], 3, "gains are three numbers")]
    if any(gain != 1 for gain in gains):
        found.append(rl.light.Balance((gains[0], gains[1], gains[2])))
    if stops := _number(asked.get("stops", 0), "stops"):
        found.append(rl.light.Gain.of_stops(stops))
    if blur := _number(asked.get("blur", 0), "blur"):
        found.append(rl.light.SphericalBlur(math.radians(blur)))
    return found


def _listed(value: object, count: int, what: str) -> list[object]:
    if not isinstance(value, list) or len(value) != count:
        raise ValueError(what)
    return value


def diffuse_map(source: Path, target: Path) -> None:
    """Write what a white matte surface would reflect that faces each direction: the map integrated diffusely.

    target : .exr, lat-long; under constant light it is that light. Raises RelumeError
    """
    found = rl.light.reflection_map(rl.read_environment(source), rl.light.lobe_named("lambert"), DIFFUSE_ROWS)
    rl.write(target, rl.as_radiance_map(found.light))


def cut_slice(source: Path, folder: Folder, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Write one exposure of the map, or of a view cut out of it, as a PNG to paint on; what was written.

    asked : stops, chosen to fit unless given; view, (yaw, pitch, field) in degrees, or box, left, top, width and height
        in pixels: the whole map unless given
    """
    picture = rl.read_radiance(source)
    target = _free(folder, PAINT, "slice", ".png")
    if asked.get("view") is not None:
        yaw, pitch, field = (math.radians(_number(each, "view")) for each in asked["view"])
        view = rl.light.CameraView((yaw, pitch, 0.0), field)
        picture = rl.light.crop_view(rl.read_environment(source), view, VIEW)
        rl.write(_view_of(target), picture)
        picture = rl.read_radiance(_view_of(target))  # as the way back will have it
    stops = asked.get("stops")
    box = None if asked.get("box") is None else _box(asked)
    made = rl.light.write_slice(picture, target, None if stops is None else _number(stops, "stops"), box=box)
    return {"path": folder.name(target), "stops": made["stops"], "white": made["white"], "unit": made["unit"]}


def cut_rectangle(source: Path, folder: Folder, asked: Mapping[str, Any]) -> dict[str, Any]:
    """Write a rectangle of a picture of its own: radiance as .exr, a photograph as .png; where it is, and its size.

    asked : box, left, top, width and height in pixels
    A part of a map is no whole sphere: the file no longer says a mapping. Raises ValueError, RelumeError.
    """
    target = _free(folder, PAINT, "crop", ".exr" if rl.files.has_radiance(source) else ".png")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the page says itself that a part of a map is none
        made = rl.light.change_format(source, target, rl.light.FormatChange(crop=_box(asked)))
    return {"path": folder.name(target), "size": made["size"]}


def painted_map(source: Path, folder: Folder, asked: Mapping[str, Any]) -> tuple[Path, dict[str, Any]]:
    """Write the map with what was painted on its slice; its path, and how much changed.

    asked : slice, as `cut_slice` named it; scale, whether lights beyond the slice's white stay lights
    Raises LookupError for a slice there is none of, ValueError, RelumeError.
    """
    path = folder.path(str(asked.get("slice", "")))
    if path.parent != folder.root / PAINT:
        raise LookupError
    painted = rl.light.PaintedSlice(path, scale=asked.get("scale") is True)
    target, view = _free(folder, LIGHTS, "light", ".exr"), _view_of(path)
    if view.is_file():
        before = rl.read_radiance(view)
        result = rl.light.paint_over(before, painted, view.name)
        changed = view.with_name(f"{path.stem}_painted.exr")
        rl.write(changed, replace(result.picture, attributes={**before.attributes, **result.picture.attributes}))
        rl.write(target, rl.as_radiance_map(rl.light.put_view(rl.read_environment(source), changed)))
    else:
        result = rl.light.paint_over(rl.read_radiance(source), painted, source.name)
        rl.write(target, result.picture)
    return target, {**result.facts, "doubts": list(result.doubts)}


def pointed_at(table: Mapping[str, Any], name: str, photograph: str | None) -> list[dict[str, Any]]:
    """The edits of a shot that make this map its light.

    photograph : of the ball, by the plate's camera; it goes on to say where that stood, where the ball did
    """
    light, camera = table.get("light", {}), table.get("camera", {})
    changes: list[dict[str, Any]] = [{"set": ["light", "map"], "value": name}]
    ball = light.get("ball")
    if not light.get("balls") or not isinstance(ball, dict):
        return changes
    # It was measured on the plate's scale and in the scene's frame.
    changes += [{"set": ["light", "scale"], "value": 1.0}] if "scale" not in light else []
    centre = ball.get("centre") or [0.0, ball["radius"], 0.0]
    changes += [{"set": ["light", "probe"], "value": centre}, {"remove": ["light", "ball"]}]
    changes += [{"remove": ["light", "balls"]}]
    if not any(key in camera for key in ("grid", "pose", "lines", "file")):
        given = camera.get("ball", {})
        seen = {} if "rim" in given or "photograph" in given or photograph is None else {"photograph": photograph}
        changes += [{"set": ["camera", "ball"], "value": {**given, **seen, "radius": ball["radius"]}}]
    return changes


def _free(folder: Folder, place: str, stem: str, ending: str) -> Path:
    """A name that nothing has yet, in a folder of the shot's."""
    within = folder.root / place
    if within.is_symlink():
        raise ValueError(f"{place} is a link elsewhere; nothing is written there")
    try:
        within.mkdir(exist_ok=True)
    except OSError as error:
        raise rl.errors.OutputNotWritten(f"{within}: cannot be made ({error.strerror})") from None
    number = 1
    while (within / f"{stem}-{number}{ending}").exists():
        number += 1
    return within / f"{stem}-{number}{ending}"


def _view_of(path: Path) -> Path:
    return path.with_name(f"{path.stem}_view.exr")


def _box(asked: Mapping[str, Any]) -> tuple[int, int, int, int]:
    given = asked.get("box")
    if not isinstance(given, list) or len(given) != 4:
        raise ValueError("box is left, top, width and height in pixels")
    left, top, width, height = (int(_number(each, "box")) for each in given)
    return left, top, width, height


def _number(value: object, name: str) -> float:
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise ValueError(f"{name} is a number, or some of them")
    try:
        number = float(value)
    except OverflowError:  # a whole number of more than 308 digits
        number = math.inf
    if not math.isfinite(number):
        raise ValueError(f"{name} is a finite number, or some of them")
    return number

"""A camera of Blender's, by way of a small JSON file that a script writes there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.pose import UpAxis, pose, require_aspect

FORMAT = "relume camera 1"
"""What the script writes under "format"."""

SCRIPT = """\
# Writes the scene's camera for relume. In Blender: Scripting, Open, Run; or without its window:
#     blender scene.blend --background --python this.py
# The file lies beside the .blend; name it under [camera] file = "camera.json".
import json
import os

import bpy

scene = bpy.context.scene
camera, render = scene.camera, scene.render
if camera is None or camera.data.type != "PERSP":
    raise SystemExit("the scene has no perspective camera; choose one under Scene, Camera")
placed = camera.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world
lens, field = camera.data, camera.data.dof
focus = None
if field.use_dof:
    focus = field.focus_distance
    if field.focus_object is not None:
        to_object = placed.inverted() @ field.focus_object.matrix_world.translation
        focus = -to_object.z
camera_facts = {
    "format": "FORMAT",
    "matrix_world": [list(row) for row in placed],
    "unit": scene.unit_settings.scale_length,
    "lens": lens.lens,
    "sensor_width": lens.sensor_width,
    "sensor_height": lens.sensor_height,
    "sensor_fit": lens.sensor_fit,
    "shift": [lens.shift_x, lens.shift_y],
    "resolution": [render.resolution_x, render.resolution_y],
    "pixel_aspect": [render.pixel_aspect_x, render.pixel_aspect_y],
    "f_number": field.aperture_fstop if field.use_dof else None,
    "focus": focus,
}
path = os.path.join(os.path.dirname(bpy.data.filepath) or os.getcwd(), "camera.json")
with open(path, "w") as file:
    json.dump(camera_facts, file, indent=1)
print("wrote", path)
""".replace("FORMAT", FORMAT)


def blender_camera_script() -> str:
    """The text of a Python script for Blender that writes its scene's camera as camera.json beside the .blend."""
    return SCRIPT


def read_blender_camera(path: Path, width: int, height: int, up: UpAxis | None, unit: float | None) -> Camera:
    """Read the file that `blender_camera_script` writes: pose, sensor, fit, shift and depth of field.

    up : "z" unless given, as Blender has it
    unit : metres to a unit; from the scene unless given
    Raises UnreadableFile for another file, or one written for a render of another aspect than the picture.
    """
    facts = _read_facts(path)
    try:
        resolution = float(facts["resolution"][0]), float(facts["resolution"][1])
        squareness = float(facts["pixel_aspect"][0]) / float(facts["pixel_aspect"][1])
        sensors = float(facts["sensor_width"]), float(facts["sensor_height"])
        shift = float(facts["shift"][0]), float(facts["shift"][1])
        lens, fit, metres = float(facts["lens"]), str(facts["sensor_fit"]), unit or float(facts["unit"])
        f_number, focus = facts.get("f_number"), facts.get("focus")
        # Blender blurs as if a unit were a metre.
        aperture = metres * lens / 1000 / (2 * float(f_number)) if f_number else 0.0
        distance = float(focus) * metres if focus is not None else np.inf
        matrix = facts["matrix_world"]
    except (KeyError, IndexError, TypeError, ValueError, ZeroDivisionError) as error:
        raise UnreadableFile(f"{path}: its camera lacks something ({error!r}); run the script again") from None
    require_aspect(path, (width, height), resolution)
    if abs(squareness - 1) > 1e-6:
        raise UnreadableFile(f"{path}: its pixels are not square; set the render's pixel aspect to 1 and 1")
    # The sensor's named side is fitted to the picture's; AUTO fits the width to whichever is longer.
    upright = fit == "VERTICAL" or (fit == "AUTO" and height > width)
    side = height if upright else width
    sensor = sensors[1] if fit == "VERTICAL" else sensors[0]
    if not (lens > 0 and sensor > 0 and np.isfinite([lens, sensor, *shift]).all()):
        raise UnreadableFile(f"{path}: a lens of {lens} mm on a sensor of {sensor} mm; run the script again")
    # The shift is the picture's against the lens, in shares of the fitted side: right and up.
    centre = (width / 2 - shift[0] * side, height / 2 + shift[1] * side)
    position, rotation = pose(path, matrix, up or "z", metres)
    try:
        return Camera(
            width, height, lens / sensor * side, position, rotation,
            centre if any(shift) else None, aperture=aperture, focus=distance,
        )  # fmt: skip
    except ValueError as error:
        raise UnreadableFile(f"{path}: {error}; run the script again") from None


def _read_facts(path: Path) -> dict[str, Any]:
    try:
        facts = json.loads(path.read_bytes())
    except OSError as error:
        raise UnreadableFile(f"{path}: cannot be read ({error.strerror or error}); check the path") from None
    except (RecursionError, ValueError) as error:
        raise UnreadableFile(f"{path}: not valid JSON ({error}); run the script again") from None
    if not isinstance(facts, dict) or facts.get("format") != FORMAT:
        raise UnreadableFile(
            f"{path}: not a camera; expected what fSpy exports, or what relume's script writes in Blender"
        )
    return facts

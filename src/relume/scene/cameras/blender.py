"""A camera of Blender's, by way of a small JSON file that a script writes there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.pose import UpAxis, pose, require_aspect
from relume.scene.motion.keyframes import Slerp

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


def facts_now():
    placed = camera.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world
    lens, field = camera.data, camera.data.dof
    focus = None
    if field.use_dof:
        focus = field.focus_distance
        if field.focus_object is not None:
            to_object = placed.inverted() @ field.focus_object.matrix_world.translation
            focus = -to_object.z
    return {
        "matrix_world": [list(row) for row in placed],
        "lens": lens.lens,
        "shift": [lens.shift_x, lens.shift_y],
        "f_number": field.aperture_fstop if field.use_dof else None,
        "focus": focus,
    }


lens = camera.data
camera_facts = facts_now() | {
    "format": "FORMAT",
    "unit": scene.unit_settings.scale_length,
    "sensor_width": lens.sensor_width,
    "sensor_height": lens.sensor_height,
    "sensor_fit": lens.sensor_fit,
    "resolution": [render.resolution_x, render.resolution_y],
    "pixel_aspect": [render.pixel_aspect_x, render.pixel_aspect_y],
}
# Where it is in every frame of the scene, if it moves.
now, frames = scene.frame_current, []
for frame in range(scene.frame_start, scene.frame_end + 1):
    scene.frame_set(frame)
    frames.append(facts_now())
scene.frame_set(now)
if any(frame != frames[0] for frame in frames):
    camera_facts["frames"] = frames
    camera_facts["rate"] = render.fps / render.fps_base
path = os.path.join(os.path.dirname(bpy.data.filepath) or os.getcwd(), "camera.json")
with open(path, "w") as file:
    json.dump(camera_facts, file, indent=1)
print("wrote", path)
""".replace("FORMAT", FORMAT)


def blender_camera_script() -> str:
    """The text of a Python script for Blender that writes its scene's camera as camera.json beside the .blend."""
    return SCRIPT


def read_blender_camera(
    path: Path, width: int, height: int, up: UpAxis | None, unit: float | None, time: float | None = None
) -> Camera:
    """Read the file that `blender_camera_script` writes: pose, sensor, fit, shift and depth of field.

    up : "z" unless given, as Blender has it
    unit : metres to a unit; from the scene unless given
    time : seconds since the scene's first frame, of a camera that moves; between two frames it turns the shorter way
        and all else goes in straight lines
    Raises UnreadableFile for another file, or one written for a render of another aspect than the picture.
    """
    facts = _read_facts(path)
    try:
        if time is not None and facts.get("frames"):
            facts = facts | _between(facts["frames"], time * float(facts["rate"]))
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
    except (AttributeError, KeyError, IndexError, TypeError, ValueError, ZeroDivisionError) as error:
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


def blender_span(path: Path) -> tuple[float, float] | None:
    """Seconds from the first to the last frame of a camera that moves; None for one at rest; raises UnreadableFile."""
    facts = _read_facts(path)
    frames, rate = facts.get("frames"), facts.get("rate")
    if not isinstance(frames, list) or not isinstance(rate, int | float) or not rate > 0:
        return None
    return 0.0, (len(frames) - 1) / float(rate)


def _between(frames: list[dict[str, Any]], place: float) -> dict[str, Any]:
    """The facts between two of the frames; the first ones' and the last ones' beyond."""
    index = int(np.clip(np.floor(place), 0, max(len(frames) - 2, 0)))
    first, second = frames[index], frames[min(index + 1, len(frames) - 1)]
    share = float(np.clip(place - index, 0, 1))
    if share in (0.0, 1.0):
        return second if share else first
    from scipy.spatial.transform import Rotation

    mixed: dict[str, Any] = {}
    for name in ("lens", "shift", "f_number", "focus"):
        one, other = first.get(name), second.get(name)
        lost = one is None or other is None
        mixed[name] = one if lost else ((1 - share) * np.array(one) + share * np.array(other)).tolist()
    ends = [np.asarray(each["matrix_world"], np.float64) for each in (first, second)]
    matrix = (1 - share) * ends[0] + share * ends[1]
    turns = np.stack(
        [Rotation.from_matrix(end[:3, :3] / np.cbrt(np.linalg.det(end[:3, :3]))).as_quat() for end in ends]
    )
    turn = Slerp().between(np.array([0.0, 1.0]), turns, 0, share)
    matrix[:3, :3] = Rotation.from_quat(turn).as_matrix()
    return mixed | {"matrix_world": matrix.tolist()}


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

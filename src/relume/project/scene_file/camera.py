"""A scene file's [camera]: where the picture is taken from, through which lens, and how both change by the frame."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from relume.errors import InvalidScene
from relume.project.keyed_values import table_at, values_at
from relume.project.scene_file.images import naming
from relume.project.schema import Positive, Table, Vector
from relume.project.shot_file.camera_file import CameraFile
from relume.project.shot_file.sequence_table import CameraKey, require_rising
from relume.scene.cameras.camera import Camera
from relume.scene.motion.keyframes import Interpolation
from relume.sphere.directions import rotation_about

LARGEST = 65536
"""Pixels along a side of a picture."""
SIZE = (640, 480)
"""Pixels of a picture unless given."""
FIELD_OF_VIEW = 40.0
"""Degrees across, unless given."""
KEYED = ("position", "target", "look_at", "field_of_view", "focal_length", "roll", "aperture", "focus")
"""What keys of a camera may change."""

Pixels = Annotated[int, Field(ge=1, le=LARGEST)]
Angle = Annotated[float, Field(gt=0, lt=180)]


def _one_of_each(table: SceneCameraKey | CameraTable) -> None:
    for first, second in (("target", "look_at"), ("field_of_view", "focal_length")):
        if getattr(table, first) is not None and getattr(table, second) is not None:
            raise ValueError(f"has {first} and {second}, which say the same; leave one of them out")


class SceneCameraKey(CameraKey):
    """A camera at a frame: what a shot's camera has, or the words of this file; and its lens.

    target : the point that it looks at, as `look_at`
    field_of_view : degrees across, in place of `focal_length`, pixels
    roll, aperture, focus : as in `CameraTable`
    """

    target: Vector | None = None
    field_of_view: Angle | None = None
    roll: float | None = None
    aperture: Annotated[float, Field(ge=0)] | None = None
    focus: Positive | None = None

    @model_validator(mode="after")
    def _says_it_once(self) -> SceneCameraKey:
        _one_of_each(self)
        return self


class CameraTable(Table):
    """Where the picture is taken from: by two points, or by the camera of another program, which may move.

    target, look_at : the point that it looks at; one of them
    field_of_view : degrees across; 40 unless it or `focal_length`, pixels of this size, is given
    roll : degrees by which the camera leans counter-clockwise, so that the picture's verticals lean to the right
    file : a camera of glTF, USD, Blender or fSpy, in place of all of these
    aperture, focus : diameter of the lens and the distance it is focused on, metres; a pinhole unless given
    keyframes : of a sequence; what a key does not say is interpolated between those that do
    """

    position: Vector | None = None
    target: Vector | None = None
    look_at: Vector | None = None
    field_of_view: Angle | None = None
    focal_length: Positive | None = None
    roll: float | None = None
    file: Annotated[CameraFile | None, BeforeValidator(lambda v: {"path": v} if isinstance(v, str) else v)] = None
    size: tuple[Pixels, Pixels] = SIZE
    aperture: Annotated[float, Field(ge=0)] | None = None
    focus: Positive | None = None
    keyframes: tuple[SceneCameraKey, ...] = ()

    @property
    def aim(self) -> Vector | None:
        """The point that it looks at."""
        return self.look_at if self.target is None else self.target

    @model_validator(mode="after")
    def _one_camera(self) -> CameraTable:
        _one_of_each(self)
        require_rising(self.keyframes)
        own = [name for name in KEYED if name not in ("aperture", "focus") and getattr(self, name) is not None]
        if self.file is not None and (own or self.keyframes):
            raise ValueError(
                f"has file and {(own or ['keyframes'])[0]}; the file says where it is, leave one of them out"
            )
        for name, words in {"position": ("position",), "target": ("target", "look_at")}.items():
            given = [getattr(table, word) for table in (self, *self.keyframes) for word in words]
            if self.file is None and all(value is None for value in given):
                raise ValueError(f"{name}: missing; the scene file must have it")
        if self.position is not None and self.position == self.aim:
            raise ValueError(f"target {list(self.position)} is where the camera stands; give another point to look at")
        opened = [self.aperture, *(key.aperture for key in self.keyframes)]
        focused = [self.focus, *(key.focus for key in self.keyframes)]
        if any(opened) and not any(focused):
            raise ValueError("has an aperture and no focus; give the distance in metres that is sharp")
        if any(focused) and not any(opened) and self.file is None:
            raise ValueError("has a focus and no aperture, so that all is sharp; give the lens's diameter in metres")
        return self

    def at(self, frame: float, between: Interpolation, path: Path) -> CameraTable:
        """The table at a frame of a sequence, without its keys; raises InvalidScene naming the key."""
        if not self.keyframes:
            return self
        changes = values_at(self.keyframes, frame, between, KEYED)
        # Two words for one thing: the key's takes the place of the table's own.
        for first, second in (("target", "look_at"), ("field_of_view", "focal_length")):
            if first in changes and second in changes:
                raise InvalidScene(f"{path}: camera.keyframes: have {first} and {second}; say it by one of them alone")
            for word, other in ((first, second), (second, first)):
                if word in changes and getattr(self, other) is not None:
                    changes[other] = None
        return table_at(self, changes, f"{path}: camera", frame, InvalidScene)


def camera_of(table: CameraTable, path: Path, seconds: float | None = None, rate: float = 24.0) -> Camera:
    """The camera of a table without keys.

    path : the scene file, beside which the camera's is looked for
    seconds : since a file's camera began to move; None for a camera at rest
    rate : frames a second of a sequence, for files whose cameras go by frames
    Raises InvalidScene naming the key.
    """
    with naming(f"{path}: camera{'' if table.file is None else '.file'}"):
        lens = {
            **({} if table.aperture is None else {"aperture": table.aperture / 2}),
            **({} if table.focus is None else {"focus": table.focus}),
        }
        if table.file is not None:
            asked = table.file if seconds is None else table.file.after(seconds, rate)
            read = asked.read(table.size, path.parent)
            return replace(read, **lens) if lens else read
        position, target = np.array(table.position), np.array(table.aim)
        if np.array_equal(position, target):
            raise ValueError(f"target {target.tolist()} is where the camera stands; give another point to look at")
        width, height = table.size
        length = table.focal_length or focal_length_of(width, table.field_of_view or FIELD_OF_VIEW)
        camera = Camera.looking_at(position, target, width=width, height=height, focal_length=length)
        if table.roll:
            camera = replace(camera, rotation=camera.rotation @ rotation_about([0, 0, 1], np.radians(table.roll)))
        return replace(camera, **lens) if lens else camera


def focal_length_of(width: int, field_of_view: float) -> float:
    """In pixels, of a field of view across in degrees."""
    return float(width / 2 / np.tan(np.radians(field_of_view) / 2))

"""The file of a stage, `stage.json`: which picture was taken under which light, where from, and how it is encoded.

    {
      "lights": [{"file": "olat/a.exr", "direction": [0, 1, 0]}, …],
      "cameras": {"front": {"position": [0, 0, 4], "look_at": [0, 0, 0], "hfov_deg": 28}},
      "light": {"irradiance_at_normal_incidence": 1, "angular_diameter_deg": 2},
      "grid": {"inclination": 12, "azimuth": 24},
      "encoding": "srgb",
      "subject": [0, 0, 0],
      "target": {"rectangle": [10, 20, 64, 64], "reflectance": 0.18}
    }

A light has one of `file` (a name, or a list of names: a bracket) and `files` (camera name → the same); a `direction`
towards it, a `position` in metres, or `inclination` from +Y and `azimuth` from +Z towards +X in radians; and may have
`name`, `solid_angle` (sr), `irradiance` (a number or R, G, B; 1 unless `light` gives another) and `exposure` (seconds,
one a file). `camera_NAME` is another way to write `cameras.NAME`. `target` is a white or grey card in the pictures, on
which an import measures what each light gives. Only `lights` is required. Other keys at the top are kept and passed
over, but for those that are nearly one of these; unknown keys of all else are refused. Files are beside the stage file;
the frame is `sphere.directions`'.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from relume.lightstage.field.lights import StageLights
from relume.scene.cameras.camera import Camera

STAGE_FILE = "stage.json"
FILLED = 1e-3
"""How far, as a share, given solid angles may sum from 4π and still be believed: files round their numbers."""
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class StageCamera:
    """A camera of the stage: where it stands and looks, metres, and its field of view across, radians."""

    position: Vector
    look_at: Vector
    field_of_view: float

    def camera(self, width: int, height: int) -> Camera:
        """The camera that takes pictures of this size."""
        focal_length = width / 2 / np.tan(self.field_of_view / 2)
        return Camera.looking_at(
            np.array(self.position), np.array(self.look_at), width=width, height=height, focal_length=focal_length
        )


@dataclass(frozen=True)
class TargetCard:
    """A white or grey target in the pictures: (left, top, width, height) in pixels, and its reflectance, 0 to 1.

    rectangle : left, top, width and height, pixels from the upper left corner
    reflectance : 0.9 as of a chart's white, 0.18 as of a grey card
    """

    rectangle: tuple[int, int, int, int]
    reflectance: float


@dataclass(frozen=True)
class LightEntry:
    """One light of a stage file.

    files : camera name → its picture, or its bracket; the name is "" where the file names no camera
    direction : towards the light, of any length; None where `position` is given
    position : metres
    name : what it is called; that of its first file unless given
    solid_angle : sr, None where not given
    irradiance : R, G, B at normal incidence where the subject is
    exposure : seconds, one a file; None where not given
    """

    files: Mapping[str, tuple[str, ...]]
    direction: Vector | None = None
    position: Vector | None = None
    name: str | None = None
    solid_angle: float | None = None
    irradiance: Vector = (1.0, 1.0, 1.0)
    exposure: tuple[float, ...] | None = None

    @property
    def label(self) -> str:
        return self.name or next(iter(self.files.values()))[0]


@dataclass(frozen=True)
class Stage:
    """What a stage file says.

    lights : in the file's order
    cameras : by name, in the file's order
    grid : (rows, columns) of inclination and azimuth, None where the lights are none
    encoding : "srgb", "linear" or the name of a response file, of photographs; radiance maps are linear as they are
    subject : the point, metres, from which lights with a position are looked at
    target : in the pictures; None where there is none
    angular_diameter : of a light, radians; None where not given
    others : keys at the top that mean nothing here
    """

    lights: tuple[LightEntry, ...]
    cameras: Mapping[str, StageCamera] = field(default_factory=dict)
    grid: tuple[int, int] | None = None
    encoding: str = "srgb"
    subject: Vector = (0.0, 0.0, 0.0)
    target: TargetCard | None = None
    angular_diameter: float | None = None
    others: Mapping[str, Any] = field(default_factory=dict)

    def stage_lights(self) -> StageLights:
        """The lights, whose cells are those given where they fill the sphere, else spherical Voronoi cells.

        Raises ValueError for two lights in one direction.
        """
        subject = np.array(self.subject)
        towards = np.array(
            [np.array(e.position) - subject if e.direction is None else e.direction for e in self.lights]  # type: ignore[arg-type]
        )
        near = all(entry.position is not None for entry in self.lights)
        positions = np.array([entry.position for entry in self.lights]) if near else None
        names = tuple(entry.label for entry in self.lights)
        lights = StageLights.towards(towards, names, positions=positions, grid=self._ordered_grid(towards))
        given = np.array([np.nan if e.solid_angle is None else e.solid_angle for e in self.lights])
        if abs(given.sum() / (4 * np.pi) - 1) < FILLED:  # False for NaN
            scaled = given * (4 * np.pi / given.sum())
            return StageLights(lights.directions, scaled, names, positions, lights.grid)
        return lights

    def _ordered_grid(self, towards: np.ndarray) -> tuple[int, int] | None:
        """The grid, where the lights stand in its order: rows of one height each, from +Y down."""
        if self.grid is None:
            return None
        heights = (towards[:, 1] / np.linalg.norm(towards, axis=1)).reshape(self.grid)
        level = np.ptp(heights, axis=1).max() < 1e-3
        return self.grid if level and np.all(np.diff(heights.mean(axis=1)) < 0) else None


def stage_towards(
    names: Sequence[str], directions: np.ndarray, cameras: Mapping[str, StageCamera] | None = None
) -> Stage:
    """The stage of one picture a light, in directions (N, 3)."""
    pairs = zip(names, directions.tolist(), strict=True)
    return Stage(tuple(LightEntry({"": (name,)}, tuple(direction)) for name, direction in pairs), cameras or {})

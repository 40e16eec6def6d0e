"""Orientation presets: what a panorama's file means to other programs, and our light turned to fit.

Every program agrees that a lat-long map has the zenith on top; where its middle points is each one's own affair. An
`Orientation` says where in *our* world (+Y up, right-handed) a program shows each point of a file that it loads with
its default settings, and `orient_for` lays light out so that it comes from where our world has it. The program's own
axes are ours, number for number, unless `axes` says otherwise.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.sphere.directions import rotation_about
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, Mapping
from relume.sphere.mappings.squares import EqualArea

_AHEAD_IS_PLUS_X = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""The middle of the file shows +X and +Z lies to its right."""
_AHEAD_IS_PLUS_Z = np.diag([-1.0, 1.0, -1.0])
"""The middle of the file shows +Z and −X lies to its right."""


def rotation_from_angles(yaw: float, pitch: float = 0.0, roll: float = 0.0) -> np.ndarray:
    """The rotation (3, 3) by angles in radians: roll about +Z, then pitch about +X, then yaw about +Y, right-handed."""
    x, y, z = np.eye(3)
    return rotation_about(y, yaw) @ rotation_about(x, pitch) @ rotation_about(z, roll)


@dataclass(frozen=True, eq=False)
class Orientation:
    """Where a program shows the points of a file, in directions of our world.

    name : the program, as `ORIENTATIONS` lists it
    mapping : the mapping of the file
    rotation : (3, 3), turns the direction that `mapping` gives a point into the one where the program shows it
    mirrored : the file is held against our mapping left to right first, as if seen from outside
    axes : which of the program's axes are our +X, +Y and −Z
    source : where that is written, or in what it was seen
    """

    name: str
    mapping: Mapping
    rotation: np.ndarray
    mirrored: bool
    axes: str
    source: str

    def directions(self, points: np.ndarray) -> np.ndarray:
        """Where, in our world, the program shows image points (…, 2) of a file: unit directions (…, 3)."""
        return self.mapping.directions(self._held(points)) @ self.rotation.T

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        """The image points (…, 2) of the file that the program shows in directions (…, 3) of our world."""
        return self._held(self.mapping.image_points(np.asarray(directions, np.float64) @ self.rotation))

    def _held(self, points: np.ndarray) -> np.ndarray:
        if not self.mirrored:
            return points
        return np.stack([1 - points[..., 0], points[..., 1]], axis=-1)


def orient_for(light: EnvironmentMap, orientation: Orientation, size: int | None = None) -> EnvironmentMap:
    """The light laid out as a program reads it: loaded there with default settings, it comes from where it came here.

    light : in our frame and any mapping
    orientation : the program's, of `rl.mappings.ORIENTATIONS`
    size : rows of the file; the present number unless given

    A lat-long map that is turned by whole columns keeps its pixels; any other is resampled, its energy kept. The result
    is *for the program*: read by us it is light from elsewhere, until `orient_back` turns it back.
    """
    turned = light.remapped(orientation.mapping, size or light.size, orientation.rotation.T)
    return _flipped(turned) if orientation.mirrored else turned


def orient_back(light: EnvironmentMap, orientation: Orientation) -> EnvironmentMap:
    """A map that is laid out for a program, in our frame again (as a lat-long map): what `orient_for` did, undone.

    light : as the program reads it
    orientation : the program's, of `rl.mappings.ORIENTATIONS`
    Raises ValueError when the map's mapping is not the one the program reads.
    """
    if light.mapping.name != orientation.mapping.name:
        raise ValueError(f"a {light.mapping.name} map; {orientation.name} reads {orientation.mapping.name} maps only")
    straight = _flipped(light) if orientation.mirrored else light
    return straight.remapped(LatLong(), light.size, orientation.rotation)


def _flipped(light: EnvironmentMap) -> EnvironmentMap:
    clipped = None if light.clipped is None else np.ascontiguousarray(light.clipped[:, ::-1])
    return replace(light, radiance=np.ascontiguousarray(light.radiance[:, ::-1]), clipped=clipped)


_SAME = "its axes are ours"


def _lat_long(name: str, rotation: np.ndarray, axes: str, source: str) -> Orientation:
    return Orientation(name, LatLong(), rotation, False, axes, source)


ORIENTATIONS: dict[str, Orientation] = {
    orientation.name: orientation
    for orientation in (
        _lat_long(
            "blender",
            _AHEAD_IS_PLUS_X,
            "+X is our +X, +Z our +Y, +Y our −Z: (x, y, z) here is (x, −z, y) there, as its importers turn Y-up files",
            "Cycles, intern/cycles/kernel/camera/projection.h, direction_to_equirectangular; rendered with bpy 5.0.1",
        ),
        _lat_long(
            "usd",
            _AHEAD_IS_PLUS_Z,
            _SAME + ", on a stage of upAxis = Y (a DomeLight's pole is +Y on any stage)",
            "UsdLux, DomeLight: the OpenEXR specification, latitude 0, longitude 0 points to +Z, π/2 to +X",
        ),
        _lat_long(
            "gltf",
            _AHEAD_IS_PLUS_X,
            _SAME,
            "KhronosGroup/glTF pull request 1761, Appendix D: a draft; glTF holds cubes only (EXT_lights_image_based)",
        ),
        _lat_long(
            "three",
            _AHEAD_IS_PLUS_X,
            _SAME,
            "three.js, src/renderers/shaders/ShaderChunk/common.glsl.js, equirectUv; rendered with r187",
        ),
        _lat_long(
            "mitsuba",
            _AHEAD_IS_PLUS_Z,
            _SAME,
            "Mitsuba 3, src/emitters/envmap.cpp (its first and last rows stand at the poles themselves); rendered",
        ),
        Orientation(
            "pbrt",
            EqualArea(),
            # Our square shows (x, z) round +Y and pbrt's shows (x, y) round +z: mirror x, then exchange.
            np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]),
            True,
            _SAME + ", with `Scale -1 1 1` before LookAt: pbrt's camera alone is left-handed",
            "pbrt-v4, src/pbrt/lights.h, ImageInfiniteLight, and util/math.cpp, EqualAreaSquareToSphere",
        ),
        _lat_long(
            "arnold",
            _AHEAD_IS_PLUS_Z,
            _SAME,
            "Autodesk/arnold-usd, read_light.cpp and write_light.cpp: a DomeLight and a skydome_light of format latlong"
            " have the same file and matrix",
        ),
        _lat_long(
            "radiance",
            np.eye(3),
            "+X is our +X, +Z our +Y, +Y our −Z: (x, y, z) here is (x, −z, y) there",
            "Radiance has no default: .rad files written by relume bring their mapping; traced with rtrace 6.0a",
        ),
    )
}
"""What a file means to each program that loads it with its default settings, by the program's name."""


def orientation_named(name: str) -> Orientation:
    """The orientation of a program, of `rl.mappings.ORIENTATIONS`.

    name : of the program, like "blender"
    Raises ValueError that names all there are.
    """
    if name not in ORIENTATIONS:
        raise ValueError(f'there is no orientation for "{name}"; there are {", ".join(ORIENTATIONS)}')
    return ORIENTATIONS[name]

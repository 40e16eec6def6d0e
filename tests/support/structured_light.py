"""Photographs of a scene under a projector's patterns, by the ray caster, with the shape as truth beside them.

Each camera pixel is the mean over a lattice of rays. What a ray meets is lit by the projector where nothing lies
between, with the pattern blurred by the projector's lens; light that is scattered below the surface or between surfaces
is the pattern's mean over a wide neighbourhood. The camera adds noise of photons and of reading, and its response.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy import ndimage

from relume.image import files
from relume.image.colour import encode_srgb
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.lightstage.geometry.pattern_photographs import PatternPhotographs
from relume.lightstage.geometry.patterns import LIST, ProjectorPatterns, write_patterns
from relume.lightstage.geometry.rig import ScannerRig
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Mesh

ALBEDO = np.array([0.6, 0.42, 0.34])
SPREAD = 24.0
"""Projector pixels, the deviation of how far light is scattered: one and a half periods, so that no cosine is left."""

HEAD = Path(__file__).resolve().parents[3] / "shared" / "stages" / "head"
LIFE = 0.2
"""The stage's head is 1.66 m wide; a fifth of it is life-sized."""


@dataclass(frozen=True, eq=False)
class Shooting:
    """How a scene is photographed.

    blur : of the projector's lens, the deviation in projector pixels
    scattered : the share of the light that comes by way of other places
    noise : deviations of reading, and of photons at white, of a white of 1
    exposure : of the camera, so that white is about 1
    room : light beside the projector's
    rays : per pixel, each way
    """

    blur: float = 1.0
    scattered: float = 0.15
    noise: tuple[float, float] = (0.002, 0.004)
    exposure: float = 1.0
    room: float = 0.02
    rays: int = 2


@dataclass(frozen=True, eq=False)
class Seen:
    """What the camera's rays meet: per ray, the projector's place, how much it lights it, and whose pixel it is."""

    places: np.ndarray
    light: np.ndarray
    shape: tuple[int, int]
    rays: int


def sight(
    shapes: Sequence[Mesh], rig: ScannerRig, rays: int = 2, albedo: Callable[[np.ndarray], np.ndarray] | None = None
) -> Seen:
    """What the camera sees of matte shapes, lit by the projector with 1 where it stands straight before it.

    albedo : of points (N, 3), (N,); 1 everywhere unless given
    """
    camera, projector = rig.camera, rig.projector
    fine = np.stack(
        np.meshgrid((np.arange(camera.width * rays) + 0.5) / rays, (np.arange(camera.height * rays) + 0.5) / rays),
        axis=-1,
    )
    directions = camera.rays_through(fine).reshape(-1, 3)
    caster, surfaces = RayCaster.of(shapes), Surfaces.of(shapes)
    hits = caster.nearest(camera.position, directions)
    met = hits.shape >= 0
    found = surfaces.at(camera.position, directions, hits)
    point, normal = found.point, found.shading_normal
    offset = projector.position - point
    distance = np.linalg.norm(offset, axis=-1, keepdims=True)
    towards = offset / np.maximum(distance, 1e-30)
    cosine = np.einsum("nk,nk->n", towards, normal)
    lit = met & (cosine > 0) & (np.einsum("nk,nk->n", towards, found.geometric_normal) > 0)
    start = point + 1e-5 * found.geometric_normal
    lit[lit] = ~caster.occluded(start[lit], towards[lit], distance[lit, 0] * (1 - 1e-4))
    places = projector.project(point)
    inside = np.all((places >= 0) & (places <= [projector.width, projector.height]), axis=-1)
    reflected = 1.0 if albedo is None else albedo(point)
    middle = np.median(distance[met])
    light = np.where(lit & inside, cosine * (middle / np.maximum(distance[:, 0], 1e-6)) ** 2 * reflected, 0)
    return Seen(np.where(lit[:, None], places, 0), light, (camera.height, camera.width), rays)


def pictures(seen: Seen, patterns: ProjectorPatterns, shooting: Shooting = Shooting(), seed: int = 0) -> np.ndarray:
    """The photographs' exposures (K, H, W, 3) float32 in the order of the patterns' names."""
    generator = np.random.default_rng(seed)
    height, width = seen.shape
    made = []
    for name, pattern in patterns.pictures():
        # Every pattern is the same all along one axis.
        line, place = (pattern[:, 0], 1) if "_y" in name else (pattern[0], 0)
        centres = np.arange(len(line)) + 0.5
        share = shooting.scattered
        arriving = [
            np.interp(seen.places[:, place], centres, ndimage.gaussian_filter1d(line, width, mode="nearest"))
            for width in (shooting.blur, SPREAD)
        ]
        light = seen.light * ((1 - share) * arriving[0] + share * arriving[1])
        fine = light.reshape(height, seen.rays, width, seen.rays).mean(axis=(1, 3))
        picture = shooting.exposure * (fine[..., None] * ALBEDO / ALBEDO.max() + shooting.room)
        read, photons = shooting.noise
        deviation = np.sqrt(read**2 + photons**2 * np.maximum(picture, 0))
        made.append(picture + deviation * generator.standard_normal(picture.shape, np.float32))
    return np.stack(made).astype(np.float32)


def photographed(
    shapes: Sequence[Mesh], rig: ScannerRig, patterns: ProjectorPatterns, shooting: Shooting = Shooting(), seed: int = 0
) -> PatternPhotographs:
    """The photographs in memory, through a camera of 8 bits on the sRGB curve."""
    return as_photographs(pictures(sight(shapes, rig, shooting.rays), patterns, shooting, seed), patterns)


def as_photographs(exposures: np.ndarray, patterns: ProjectorPatterns) -> PatternPhotographs:
    """Exposures as they are read back from a camera of 8 bits on the sRGB curve."""
    codes, values = encoded(exposures), np.arange(256) / 255
    linear = np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)[codes]
    names = patterns.names
    colour = linear[names.index("white")] - linear[names.index("black")]
    return PatternPhotographs(
        patterns, linear.mean(axis=-1).astype(np.float32), (codes == 255).any(axis=(0, 3)), colour.astype(np.float32)
    )


def encoded(exposures: np.ndarray) -> np.ndarray:
    """Codes of 8 bits on the sRGB curve; what is above white is clipped, as a camera does."""
    return np.rint(255 * encode_srgb(np.clip(exposures, 0, 1))).astype(np.uint8)


def write_photographs(
    folder: Path, exposures: np.ndarray, patterns: ProjectorPatterns, *, leave_out: Sequence[str] = ()
) -> None:
    """The photographs as PNG files named as their patterns are, with projector.json."""
    write_patterns(folder / "shown", patterns)
    (folder / LIST).write_text((folder / "shown" / LIST).read_text())
    for name, picture in zip(patterns.names, exposures, strict=True):
        if name not in leave_out:
            files.write(folder / f"{name}.png", Photograph(encoded(picture)))


def write_radiance(folder: Path, exposures: np.ndarray, patterns: ProjectorPatterns) -> None:
    """The same as radiance maps."""
    write_patterns(folder / "shown", patterns)
    (folder / LIST).write_text((folder / "shown" / LIST).read_text())
    for name, picture in zip(patterns.names, exposures, strict=True):
        files.write(folder / f"{name}.exr", RadianceMap(picture))


def rig(
    width: int, height: int, *, distance: float, target: np.ndarray, slant: float, field: float = 0.32
) -> ScannerRig:
    """A camera on +Z of a target and a projector of 320×240 to its right, both aimed at it.

    field : metres that the camera sees across at the target; slant : radians between the two
    """
    camera = Camera.looking_at(
        target + np.array([0, 0, distance]), target, width=width, height=height, focal_length=width * distance / field
    )
    place = target + distance * np.array([np.sin(slant), 0.05, np.cos(slant)])
    projector = Camera.looking_at(place, target, width=320, height=240, focal_length=320 * distance / (field * 1.15))
    return ScannerRig(camera, projector)


def rig_around(turn: float, pixels: int) -> ScannerRig:
    """A rig 0.84 m from the origin, walked round it by an angle, radians; its camera is so many pixels wide."""
    first = rig(pixels, pixels * 3 // 4, distance=0.84, target=np.zeros(3), slant=np.radians(20), field=0.3)
    place = 0.84 * np.array([np.sin(turn), 0, np.cos(turn)])
    size = {"width": first.camera.width, "height": first.camera.height}
    return first.placed(Camera.looking_at(place, np.zeros(3), focal_length=first.camera.focal_length, **size))


def departures(shapes: Sequence[Mesh], camera: Camera, points: np.ndarray, where: np.ndarray) -> np.ndarray:
    """How far each point (H, W, 3) lies from the surface that the camera sees there, along its normal, metres (N,)."""
    rays = camera.rays()[where]
    caster, surfaces = RayCaster.of(shapes), Surfaces.of(shapes)
    hits = caster.nearest(camera.position, rays)
    found = surfaces.at(camera.position, rays, hits)
    off = np.einsum("nk,nk->n", points[where] - found.point, found.geometric_normal)
    return np.where(hits.shape >= 0, off, np.nan)


SQUARES, SQUARE = (9, 7), 0.03


def boards(
    rig: ScannerRig, patterns: ProjectorPatterns, target: np.ndarray, count: int = 6, shooting: Shooting = Shooting()
) -> list[np.ndarray]:
    """Exposures of a chequered board of 9×7 squares of 30 mm, held at several slants about the target."""
    return [exposures_of_board(rig, patterns, target, number, shooting) for number in range(count)]


def exposures_of_board(
    rig: ScannerRig, patterns: ProjectorPatterns, target: np.ndarray, number: int, shooting: Shooting = Shooting()
) -> np.ndarray:
    """The board at the slant of this number."""
    turns = np.radians([[20, 5, 2], [-22, 8, 0], [4, 25, -3], [6, -24, 4], [18, 18, 8], [-15, -20, -8], [0, 0, 3]])
    pitch, yaw, roll = turns[number % len(turns)]
    tip = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    swing = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    turn = np.array([[np.cos(roll), -np.sin(roll), 0], [np.sin(roll), np.cos(roll), 0], [0, 0, 1]])
    rotation = swing @ tip @ turn
    middle = target + np.array([0.01 * (number % 3 - 1), 0.01 * (number % 2), 0.03 * (number % 4 - 1.5)])
    half = 0.5 * SQUARE * (np.array(SQUARES) + 1.2)
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [*half, 0]
    mesh = Mesh(
        (middle + corners @ rotation.T).astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32), Material()
    )

    def albedo(points: np.ndarray) -> np.ndarray:
        own = ((points - middle) @ rotation)[:, :2] / SQUARE + 0.5 * np.array(SQUARES)
        square = np.floor(own).astype(int)
        within = np.all((own >= 0) & (own < SQUARES), axis=1)
        return np.where(within & (square.sum(axis=1) % 2 == 0), 0.08, 0.9)

    return pictures(sight([mesh], rig, shooting.rays, albedo), patterns, shooting, seed=number)


@cache
def head_of_stage() -> tuple[Mesh, ...]:
    """The light stage's head, as large as life."""
    found = read_meshes(HEAD / "objects" / "subject.glb")
    return tuple(
        replace(mesh, vertices=(LIFE * mesh.vertices).astype(np.float32)) for mesh in found if mesh.name == "head"
    )


def ball(radius: float = 0.09) -> Mesh:
    """A fine ball at the origin."""
    import trimesh

    made = trimesh.creation.icosphere(subdivisions=5, radius=radius)
    return Mesh(
        made.vertices.astype(np.float32),
        made.faces.astype(np.int32),
        Material(),
        (made.vertices / radius).astype(np.float32),
    )

"""A room whose every surface shines as a function of where it is: photographs of it are exact, from anywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.image.radiance import RadianceMap
from relume.renderers.projective.atlas import atlas_of
from relume.renderers.projective.photographs import ProjectedPhotograph
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.shapes.shapes import Mesh

GREY = Diffuse((0.5, 0.5, 0.5))
EYES = [
    ((-2.4, 1.6, 1.6), (0, 0.7, 0)),
    ((2.4, 1.5, 1.7), (0, 0.7, 0)),
    ((2.3, 1.7, -1.6), (0, 0.9, 0)),
    ((-2.4, 1.4, -1.5), (0.5, 1.3, 0)),
    ((0.1, 0.4, 1.8), (0.6, 2.6, -0.4)),
]
"""Where five photographs of the room are taken from, and what they look at; the last looks up to the lamp."""
LAMP = 40.0
"""Radiance of the lamp at the ceiling, some eighty times the walls'."""


def box(low, high, name, inward=False):
    """A box of twelve triangles, which face inwards or outwards."""
    corners = np.array([[(low, high)[(i >> axis) & 1][axis] for axis in range(3)] for i in range(8)], np.float32)
    quads = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    faces = np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))], np.int32)
    return Mesh(corners, faces[:, ::-1].copy() if inward else faces, GREY, name=name)


def meshes():
    """The room, 6 × 3 × 5 m, and two blocks that stand in it."""
    return (
        box((-3, 0, -2.5), (3, 3, 2.5), "room", inward=True),
        box((-0.9, 0, -0.6), (-0.1, 1.1, 0.2), "block"),
        box((0.7, 0, -0.9), (1.5, 0.5, -0.1), "bench"),
    )


def flat_floor():
    """A floor of its own, a centimetre above the room's."""
    corners = np.array([[-2.9, 0.01, 2.4], [2.9, 0.01, 2.4], [2.9, 0.01, -2.4], [-2.9, 0.01, -2.4]], np.float32)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), GREY, name="floor")


def ridged_floor():
    """The same with a ridge along z in its middle, 6 cm high and 30 cm wide."""
    row = np.array([[-2.9, 0, 2.4], [-0.15, 0, 2.4], [0, 0.06, 2.4], [0.15, 0, 2.4], [2.9, 0, 2.4]])
    corners = np.concatenate([row, row * [1, 1, -1]]).astype(np.float32)
    faces = np.array([face for i in range(4) for face in ((i, i + 1, i + 6), (i, i + 6, i + 5))], np.int32)
    return Mesh(corners, faces, GREY, name="floor")


def radiance_at(points):
    """What the surfaces send out at points (N, 3), alike in all directions: (N, 3)."""
    x, y, z = points.T
    bands = 0.5 + 0.3 * np.sin(5 * x + 2 * y) * np.cos(4 * z - y)
    tint = np.stack([0.8 + 0.2 * np.sin(2 * y), 0.7 + 0.2 * np.cos(x), 0.6 + 0.3 * np.sin(z)], axis=-1)
    lamp = (np.abs(x - 1) < 0.4) & (np.abs(z) < 0.3) & (y > 2.99)
    return np.where(lamp[:, None], LAMP, bands[:, None] * tint)


def camera(eye, target=(0, 0.7, 0), width=160, height=120, focal_length=85.0):
    return Camera.looking_at(np.array(eye), np.array(target), width=width, height=height, focal_length=focal_length)


def seen_by(view, samples=4):
    """(H, W, 3) float32, the mean radiance of each pixel of a camera in the room."""
    caster, total = RayCaster.of(meshes()), np.zeros((view.height * view.width, 3))
    x, y = np.meshgrid(np.arange(view.width), np.arange(view.height))
    for step in range(samples**2):
        across, down = (np.array(divmod(step, samples)) + 0.5) / samples
        rays = view.rays_through(np.stack([x + across, y + down], axis=-1)).reshape(-1, 3)
        total += radiance_at(view.position + caster.nearest(view.position, rays).distance[:, None] * rays)
    return (total / samples**2).reshape(view.height, view.width, 3).astype(np.float32)


def photographs(count=5, **size):
    """Photographs of the room."""
    views = [camera(eye, target, **size) for eye, target in EYES[:count]]
    return tuple(
        ProjectedPhotograph(view, RadianceMap(seen_by(view)), f"view {index}") for index, view in enumerate(views)
    )


def decibels(picture, truth, where=None):
    """PSNR of pictures developed by the sRGB curve at white 1, over pixels (H, W) bool."""
    from relume.image.colour import encode_srgb

    square = (encode_srgb(np.clip(picture, 0, 1)) - encode_srgb(np.clip(truth, 0, 1))) ** 2
    return -10 * np.log10(max(float(np.mean(square if where is None else square[where])), 1e-12))


def seen_from_behind(mesh):
    """The mesh with its triangles the other way round."""
    return replace(mesh, faces=mesh.faces[:, ::-1].copy())


def painted(mesh, radiance, texel=0.1, largest=512):
    """The mesh with a radiance of points (N, 3), (N,), as its emissive texture."""
    atlas = atlas_of(mesh, texel, largest)
    image = np.zeros((atlas.size[1], atlas.size[0], 3), np.float32)
    image[atlas.rows, atlas.columns] = radiance(atlas.points)[:, None]
    return replace(atlas.mesh, material=Material((0.0, 0.0, 0.0), specular=0.0, emission=image))


def irradiance_at(points, normals, rays=4096):
    """The irradiance (N, 3) at points (N, 3) of unit normals (N, 3) in the room, by chance: the lamp apart."""
    caster, random = RayCaster.of(meshes()), np.random.default_rng(7)
    spots = np.stack([random.uniform(0.6, 1.4, 256), np.full(256, 3.0), random.uniform(-0.3, 0.3, 256)], axis=-1)
    ways = random.normal(size=(rays, 3))
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    found = np.zeros((len(points), 3))
    for index, (point, normal) in enumerate(zip(points, normals, strict=True)):
        upper = ways * np.sign(ways @ normal)[:, None]
        shown = radiance_at(point + caster.nearest(point, upper).distance[:, None] * upper)
        # The lamp, which few rays meet, by its own spots.
        shown[shown[:, 0] == LAMP] = 0
        found[index] = 2 * np.pi * ((upper @ normal)[:, None] * shown).mean(axis=0)
        away = spots - point
        distance = np.linalg.norm(away, axis=-1)
        toward = away / distance[:, None]
        clear = ~caster.occluded(point, toward, 0.999 * distance)
        found[index] += (
            LAMP * 0.48 * np.mean(clear * np.maximum(toward @ normal, 0) * np.maximum(toward[:, 1], 0) / distance**2)
        )
    return found

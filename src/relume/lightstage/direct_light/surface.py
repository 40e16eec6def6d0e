"""What the pixels of a camera see of a given mesh, and how a distant light falls on it: cosine, shadow and gloss.

Every pixel is seen through side² rays, even over its square; a filter over neighbouring pixels makes up the rest of
what a camera gathers. World frame, metres; pixels are rows × columns, flattened.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.renderers.raytrace.parallel_light import Asking, Shadows
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh
from relume.sphere.directions import rotation_between

_GOLDEN_TURN = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True, eq=False)
class Sample:
    """Where one ray of each pixel met the mesh; K of them did.

    pixels : (K,) int64, places in the flattened block
    points : (K, 3) float64, metres, a hair off the surface
    normals : (K, 3) float32, towards the camera's side
    towards_eye : (K, 3) float32
    outside : (K,) bool, which points are surely outside the closed mesh (`Shadows.outside`)
    """

    pixels: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    towards_eye: np.ndarray
    outside: np.ndarray


@dataclass(frozen=True, eq=False)
class Geometry:
    """A mesh made ready for rays.

    caster, surfaces : its triangles
    shadows : the same, for light from infinity
    extent : metres, the diagonal of its box
    """

    caster: RayCaster
    surfaces: Surfaces
    shadows: Shadows
    extent: float

    @staticmethod
    def of(meshes: Sequence[Mesh]) -> Geometry:
        """Raises ValueError where there is none, and for one that is not finite."""
        if not meshes:
            raise ValueError("no mesh was given; give one or leave the geometry out")
        vertices = np.concatenate([mesh.vertices for mesh in meshes])
        extent = float(np.linalg.norm(vertices.max(axis=0) - vertices.min(axis=0)))
        caster = RayCaster.of(meshes)
        return Geometry(caster, Surfaces.of(meshes), Shadows.of(caster), extent)


def samples_of(
    geometry: Geometry, camera: Camera, rows: np.ndarray, side: int, threads: int | None = None
) -> tuple[Sample, ...]:
    """What side² rays a pixel meet in these rows (R,) of a camera's picture."""
    offsets = (np.arange(side) + 0.5) / side
    x, y = np.arange(camera.width), rows
    return tuple(_sample(geometry, camera, x + across, y + down, threads) for down in offsets for across in offsets)


def _sample(geometry: Geometry, camera: Camera, x: np.ndarray, y: np.ndarray, threads: int | None) -> Sample:
    through = camera.rays_through(np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)).reshape(-1, 3)
    hits = geometry.caster.nearest(camera.position, through, threads=threads)
    met = np.flatnonzero(hits.shape >= 0)
    surface = geometry.surfaces.at(camera.position, through, hits)
    facing = [_towards(normal[met], -through[met]) for normal in (surface.shading_normal, surface.geometric_normal)]
    points = surface.point[met] + 2e-5 * geometry.extent * facing[1]
    outside = geometry.shadows.outside(points, camera.position, threads)
    return Sample(met, points, facing[0].astype(np.float32), -through[met].astype(np.float32), outside)


def _towards(normals: np.ndarray, side: np.ndarray) -> np.ndarray:
    """The normals, turned over where they face away from `side`."""
    return np.where(np.einsum("kc,kc->k", normals, side)[:, None] < 0, -normals, normals)


def disc_directions(centre: np.ndarray, radius: float, count: int) -> np.ndarray:
    """Unit directions (count, 3) spread evenly over a disc of `radius` radians about a direction; one is its centre."""
    if count == 1:
        return np.array(centre, np.float64)[None]
    place = np.arange(count)
    # Neighbouring rays of a pixel take places far apart on the disc: a step of about 0.6 that meets every one of them.
    stride = next(step for step in range(max(1, round(0.6 * count)), 2 * count + 1) if np.gcd(step, count) == 1)
    away = radius * np.sqrt(((place * stride) % count + 0.5) / count)
    turn = _GOLDEN_TURN * place
    local = np.stack([np.sin(away) * np.cos(turn), np.sin(away) * np.sin(turn), np.cos(away)], axis=1)
    return local @ rotation_between([0.0, 0.0, 1.0], centre).T


@dataclass(frozen=True, eq=False)
class Reached:
    """What a light reaches of samples, before their gloss is known.

    samples, lights : each sample and the direction (3,) float32 that it is lit from
    incident : of each sample (K,) float32, n·l
    lit : of each sample, its points with light, int64
    """

    samples: Sequence[Sample]
    lights: tuple[np.ndarray, ...]
    incident: tuple[np.ndarray, ...]
    lit: tuple[np.ndarray, ...]

    @staticmethod
    def of(geometry: Geometry, samples: Sequence[Sample], direction: np.ndarray, radius: float) -> Reached:
        """Light comes to each sample from a place of its own on the disc of `radius` radians about a direction."""
        places = disc_directions(direction, radius, len(samples))
        lights = tuple(places.astype(np.float32))
        incident = tuple(sample.normals @ light for sample, light in zip(samples, lights, strict=True))
        asking = [
            Asking(sample.points, np.flatnonzero(cosines > 0), sample.outside, place)
            for sample, cosines, place in zip(samples, incident, places, strict=True)
        ]
        hidden = geometry.shadows.over_each(asking)
        lit = tuple(one.numbers[~dark] for one, dark in zip(asking, hidden, strict=True))
        return Reached(samples, lights, incident, lit)

    def shone(self, pixels: int, alpha: float) -> np.ndarray:
        """`direct_light` of so many pixels, for a width of gloss."""
        # Numba is imported only where the kernel is used.
        from relume.lightstage.direct_light.shading_kernel import add_light

        found = np.zeros((2, pixels), np.float32)
        for sample, light, incident, lit in zip(self.samples, self.lights, self.incident, self.lit, strict=True):
            add_light(found, sample.pixels, sample.normals, sample.towards_eye, light, incident, lit, np.float32(alpha))
        return found / np.float32(len(self.samples))


def direct_light(
    geometry: Geometry, samples: Sequence[Sample], pixels: int, direction: np.ndarray, radius: float, alpha: float
) -> np.ndarray:
    """What a light of irradiance 1 does to each pixel: (2, pixels) float32, irradiance and reflected gloss.

    The first is the mean of max(0, n·l) over what is not in shadow; the second that of a microfacet reflection
    D F G / (4 n·v) (GGX: Walter et al. 2007, eq. 20, 33, 34; Schlick's Fresnel term).

    samples : of the pixels; light comes to each from a place of its own on the disc
    direction, radius : (3,) unit and radians, the disc of the light
    alpha : width of the microfacets' slopes
    """
    return Reached.of(geometry, samples, direction, radius).shone(pixels, alpha)


def over_neighbours(values: np.ndarray, columns: int, share: float) -> np.ndarray:
    """Pictures (…, rows · columns) filtered by (share, 1 − 2 share, share) both ways; borders repeat."""
    picture = values.reshape(*values.shape[:-1], -1, columns)
    edge = [(0, 0)] * (picture.ndim - 2)
    tall = np.pad(picture, [*edge, (1, 1), (0, 0)], mode="edge")
    picture = np.float32(1 - 2 * share) * picture + np.float32(share) * (tall[..., :-2, :] + tall[..., 2:, :])
    wide = np.pad(picture, [*edge, (0, 0), (1, 1)], mode="edge")
    picture = np.float32(1 - 2 * share) * picture + np.float32(share) * (wide[..., :-2] + wide[..., 2:])
    return picture.reshape(values.shape)

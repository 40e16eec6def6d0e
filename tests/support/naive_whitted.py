"""The slow twin of Whitted's renderer: eq. 1 and 2 as the paper prints them, one ray at a time (Whitted 1980, §2).

Smooth materials without bumps, on spheres, planes and meshes.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

import naive
from relume.light.constellations.constellation import constellation
from relume.renderers.whitted.whitted import Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.lights import AmbientLight, DistantLight, PointLight
from relume.scene.materials.materials import Diffuse
from relume.scene.materials.whitted import Checks, Paint, WhittedMaterial
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Plane, Shape, Sphere
from relume.sphere.directions import normalised

NEAR = 4e-6
"""A ray ignores what it meets within this share of the way that led from the eye to where it begins."""


@dataclass(frozen=True, eq=False)
class Node:
    """Where a ray from the eye, or from a parent, meets a surface.

    point, distance : metres, world; along the ray
    normal, face : N, and what it would be without smooth shading; both on the side that the ray comes from
    index : k_n, of the far side to the near side
    way : metres from the eye along the rays
    """

    point: np.ndarray
    distance: float
    normal: np.ndarray
    face: np.ndarray
    index: float
    uv: tuple[float, float]
    material: WhittedMaterial
    way: float


def picture(scene: Scene, camera: Camera, renderer: Whitted) -> np.ndarray:
    """One ray through the middle of each pixel, (H, W, 3)."""
    rays = camera.rays()
    seen = [radiance(scene, camera.position, ray, renderer) for ray in rays.reshape(-1, 3)]
    return np.reshape(seen, rays.shape)


def radiance(scene: Scene, origin: np.ndarray, direction: np.ndarray, renderer: Whitted) -> np.ndarray:
    """What an eye at `origin` sees in a direction, (3,)."""
    node = meet(scene, origin, direction, 0.0)
    if node is None:
        return scene.light.lookup(direction) if renderer.background else np.zeros(3)
    return intensity(scene, node, direction, renderer, 0, np.ones(3))


def intensity(
    scene: Scene, node: Node, incoming: np.ndarray, renderer: Whitted, depth: int, weight: np.ndarray
) -> np.ndarray:
    """I of eq. 2 at a node, with the highlights of eq. 1.

    incoming : V, towards the surface
    depth : of the node, 0 at the root
    weight : (3,), the share of the pixel that this intensity has
    """
    material = node.material
    k_d, k_s, k_t = paint(material.diffuse, node), np.array(material.specular), np.array(material.transmission)
    if material.fresnel:
        reflected_share = reflectance(-float(incoming @ node.normal), node.index)
        k_s, k_t = k_s * reflected_share, k_t * (1 - reflected_share)
    if material.coated:
        k_d = k_d * (1 - reflected_share if material.fresnel else 1 - k_s)
        k_t = k_t if material.fresnel else k_t * (1 - k_s)
    highlight = np.array(material.specular if material.highlight is None else material.highlight)

    i_a = sum((np.array(light.radiance) for light in scene.lights if isinstance(light, AmbientLight)), np.zeros(3))
    total = i_a * (k_d if material.ambient is None else np.array(material.ambient))
    for towards, distance, irradiance, shines in lights_of(scene, node.point, renderer):
        facing = float(node.normal @ towards)
        if facing <= 0 or float(node.face @ towards) <= 0:
            continue
        light = irradiance * let_through(scene, node, towards, distance, renderer) / math.pi
        total = total + k_d * light * facing
        if shines:
            halfway = normalised(towards - incoming)
            total = total + highlight * light * max(float(node.normal @ halfway), 0) ** material.exponent

    for coefficient, direction in (
        (k_s, reflected(incoming, node.normal)),
        (k_t, refracted(incoming, node.normal, node.index)),
    ):
        carried = weight * coefficient
        if direction is None or depth + 1 >= renderer.depth or carried.max() < max(renderer.contribution, 1e-300):
            continue
        child = meet(scene, node.point, direction, node.way)
        if child is None:
            total = total + coefficient * scene.light.lookup(direction)
        else:
            kept = min(float(renderer.attenuation.at(np.array(child.distance))), 1.0)
            total = total + coefficient * kept * intensity(scene, child, direction, renderer, depth + 1, carried * kept)
    return total


# --- directions and coefficients -------------------------------------------------------------------------------------


def reflected(incoming: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """R = V′ + 2N, with V′ = V/|V·N|."""
    longer = incoming / abs(float(incoming @ normal))
    return normalised(longer + 2 * normal)


def refracted(incoming: np.ndarray, normal: np.ndarray, k_n: float) -> np.ndarray | None:
    """P = k_f (N + V′) − N, with k_f = (k_n² |V′|² − |V′ + N|²)^(−½); none where k_f is imaginary."""
    longer = incoming / abs(float(incoming @ normal))
    squared = k_n**2 * float(longer @ longer) - float((longer + normal) @ (longer + normal))
    return normalised((normal + longer) / math.sqrt(squared) - normal) if squared > 0 else None


def reflectance(cosine: float, k_n: float) -> float:
    """Fresnel's law for light that is not polarised: the mean of its two amplitudes squared; 1 beyond the critical
    angle."""
    sine = math.sqrt(max(1 - cosine**2, 0)) / k_n
    if sine >= 1:
        return 1.0
    inside = math.sqrt(1 - sine**2)
    across = (cosine - k_n * inside) / (cosine + k_n * inside)
    along = (k_n * cosine - inside) / (k_n * cosine + inside)
    return (across**2 + along**2) / 2


def paint(colour: Paint, node: Node) -> np.ndarray:
    """A colour, the cube of checks that the point is in, or the picture there."""
    if isinstance(colour, Checks):
        x, y, z = node.point / colour.size
        odd = (math.floor(x) + math.floor(y + 0.5) + math.floor(z)) % 2
        return np.array(colour.second if odd else colour.first)
    if not isinstance(colour, np.ndarray) or colour.ndim == 1:
        return np.array(colour, np.float64)
    rows, columns = colour.shape[:2]
    across, down = node.uv[0] * columns - 0.5, (1 - node.uv[1]) * rows - 0.5
    total = np.zeros(3)
    for i, vertical in ((math.floor(down), 1 - down % 1), (math.floor(down) + 1, down % 1)):
        for j, horizontal in ((math.floor(across), 1 - across % 1), (math.floor(across) + 1, across % 1)):
            total += vertical * horizontal * colour[i % rows, j % columns]
    return total


# --- lights ----------------------------------------------------------------------------------------------------------


def lights_of(
    scene: Scene, point: np.ndarray, renderer: Whitted
) -> Iterator[tuple[np.ndarray, float, np.ndarray, bool]]:
    """The unit direction towards each light, how far it is, the irradiance of a surface that faces it, and whether it
    has highlights."""
    for light in scene.lights:
        if isinstance(light, DistantLight):
            yield normalised(light.towards), math.inf, np.array(light.irradiance), True
        elif isinstance(light, PointLight):
            offset = np.array(light.position) - point
            distance = float(np.linalg.norm(offset))
            yield offset / distance, distance, np.array(light.intensity) * light.falloff.at(np.array(distance)), True
    if renderer.constellation and scene.light.radiance.any():
        # S rays see the map itself: highlights of what stands for it would be seen twice.
        stars = stars_of(scene.light, renderer.constellation)
        for towards, irradiance in zip(stars.directions, stars.irradiance, strict=True):
            yield towards, math.inf, irradiance, False


stars_of = lru_cache(constellation)


def let_through(scene: Scene, node: Node, towards: np.ndarray, distance: float, renderer: Whitted) -> np.ndarray:
    """The share of a light that arrives at a node, (3,): 0 in shadow, k_t for every surface of a transparent shape."""
    share, point, way, left = np.ones(3), node.point, node.way, distance
    while share.max() > 1e-9:
        blocker = meet(scene, point, towards, way)
        if blocker is None or blocker.distance >= left:
            return share
        if not renderer.clear_shadows:
            return np.zeros(3)
        share = share * blocker.material.transmission
        if blocker.material.coated and not blocker.material.fresnel:
            share = share * (1 - np.array(blocker.material.specular))
        if blocker.material.fresnel:
            share = share * (1 - reflectance(-float(towards @ blocker.normal), blocker.index))
        point, way, left = blocker.point, blocker.way, left - blocker.distance
    return np.zeros(3)


# --- intersections ---------------------------------------------------------------------------------------------------


def meet(scene: Scene, origin: np.ndarray, direction: np.ndarray, way: float) -> Node | None:
    """The next node on a ray that begins after a way of so many metres."""
    shapes = (*scene.local, *scene.objects)
    skipped = NEAR * way + 1e-9 * float(np.abs(origin).sum()) if way > 0 else 0.0
    distance, number, triangle = naive.nearest_hit(shapes, origin + skipped * direction, direction)
    if number < 0:
        return None
    distance += skipped
    point = origin + distance * direction
    shape = shapes[number]
    face, normal, uv = surface(shape, triangle, point)
    outside = float(face @ direction) < 0
    side = 1.0 if outside else -1.0
    material = WhittedMaterial(shape.material.reflectance) if isinstance(shape.material, Diffuse) else shape.material
    assert isinstance(material, WhittedMaterial) and material.roughness == 0 and material.bumps is None
    # What lets no light through has no inside to come from.
    index = material.ior if outside or not any(material.transmission) else 1 / material.ior
    return Node(point, distance, side * normal, side * face, index, uv, material, way + distance)


def surface(shape: Shape, triangle: int, point: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
    """Outward normal, the same for shading, and texture coordinates."""
    if isinstance(shape, Sphere):
        x, y, z = normal = (point - np.array(shape.centre)) / shape.radius
        uv = 0.5 + math.atan2(x, -z) / math.tau, 1 - math.acos(max(-1.0, min(1.0, y))) / math.pi
        return normal, normal, uv
    if isinstance(shape, Plane):
        up = np.array([0.0, 1.0, 0.0])
        return up, up, (0.5 + point[0] / shape.extent[0], 0.5 - point[2] / shape.extent[1])
    assert isinstance(shape, Mesh)
    corners = shape.faces[triangle]
    a, b, c = shape.vertices[corners].astype(np.float64)
    area = np.cross(b - a, c - a)
    # The weight of a vertex is the share of the area that lies opposite it.
    weights = np.array([np.cross(q - p, point - p) @ area for p, q in ((b, c), (c, a), (a, b))]) / (area @ area)
    face = normalised(area)
    normal = face if shape.normals is None else normalised(weights @ shape.normals[corners])
    u, v = np.zeros(2) if shape.uv is None else weights @ shape.uv[corners]
    return face, normal, (float(u), float(v))

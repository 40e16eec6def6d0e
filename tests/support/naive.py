"""Slow twins: the same definitions written out one element at a time, to hold the fast code against."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence

import numpy as np

from relume.scene.shapes.shapes import Mesh, Patches, Polygon, Shape, Sphere


def lookup(radiance: np.ndarray, mapping: str, direction: np.ndarray) -> np.ndarray:
    """Radiance (3,) of a map from one direction, bilinear; over a lat-long's pole one meets the other side."""
    height, width = radiance.shape[:2]
    x, y, z = (float(c) for c in direction)
    if mapping == "latlong":
        u, v = 0.5 + math.atan2(x, -z) / math.tau, math.acos(max(-1.0, min(1.0, y))) / math.pi
    else:
        towards = -z if mapping == "angular" else z
        angle = math.acos(max(-1.0, min(1.0, towards)))
        radius = angle / math.pi if mapping == "angular" else math.sin(angle / 2)
        azimuth = math.atan2(y, x) if x or y else 0.0  # every azimuth is right there; the first is taken
        u, v = 0.5 + radius * math.cos(azimuth) / 2, 0.5 - radius * math.sin(azimuth) / 2
    column, row = u * width - 0.5, v * height - 0.5
    left, top = math.floor(column), math.floor(row)
    total, weight = np.zeros(3), 0.0
    for j, vertical in ((top, 1 - (row - top)), (top + 1, row - top)):
        for i, horizontal in ((left, 1 - (column - left)), (left + 1, column - left)):
            if mapping == "latlong":
                across = i + width // 2 if j < 0 or j >= height else i
                pixel = radiance[min(max(j, 0), height - 1), across % width]
            else:
                j, i = min(max(j, 0), height - 1), min(max(i, 0), width - 1)
                pixel = radiance[j, i]
                # A pixel wholly beside the disc shows nothing and does not count.
                nearest = [min(max(0.5, k / width), (k + 1) / width) - 0.5 for k in (i, j)]
                if math.hypot(*nearest) >= 0.5:
                    continue
            total += vertical * horizontal * pixel
            weight += vertical * horizontal
    return total / weight


def nearest_hit(shapes: Sequence[Shape], origin: np.ndarray, direction: np.ndarray) -> tuple[float, int, int]:
    """Distance, shape and triangle (patch) that a ray meets first; ∞, −1 and 0 if none. Patches are fine triangles."""
    best = (math.inf, -1, 0)
    for number, shape in enumerate(shapes):
        distance, face = math.inf, 0
        if isinstance(shape, Mesh):
            distances = distances_to_triangles(shape.vertices.astype(np.float64)[shape.faces], origin, direction)
            face = int(np.argmin(distances))
            distance = float(distances[face])
        elif isinstance(shape, Sphere):
            # |o + t d − c|² = r², a quadratic in t.
            from_centre = origin - np.asarray(shape.centre)
            half, constant = float(from_centre @ direction), float(from_centre @ from_centre) - shape.radius**2
            if half**2 >= constant:
                root = math.sqrt(half**2 - constant)
                distance = next((t for t in (-half - root, -half + root) if t > 0), math.inf)
        elif isinstance(shape, Polygon):
            distance = distance_to_polygon(shape.vertices, origin, direction)
        elif isinstance(shape, Patches):
            corners = np.concatenate([patch_triangles(net.tobytes(), 32) for net in shape.control])
            distances = distances_to_triangles(corners, origin, direction)
            face = int(np.argmin(distances)) // (2 * 32**2)
            distance = float(distances.min())
        elif direction[1]:
            to_plane = float((shape.height - origin[1]) / direction[1])
            x, _, z = origin + to_plane * direction
            if to_plane > 0 and abs(x) <= shape.extent[0] / 2 and abs(z) <= shape.extent[1] / 2:
                distance = to_plane
        if distance < best[0]:
            best = (distance, number, face)
    return best


def distances_to_triangles(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Where a ray meets each of the triangles (M, 3, 3); ∞ where it does not."""
    a, b, c = np.moveaxis(corners, 1, 0)
    normals = np.cross(b - a, c - a)
    slopes = normals @ direction
    heights = np.sum(normals * (a - origin), axis=-1)
    distances = np.divide(heights, slopes, out=np.full(len(slopes), -1.0), where=slopes != 0)
    points = origin + distances[:, None] * direction
    inside = distances > 0
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= np.sum(np.cross(end - start, points - start) * normals, axis=-1) >= 0
    return np.where(inside, distances, np.inf)


def distance_to_polygon(vertices: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> float:
    """Where a ray meets a polygon (N, 3); ∞ where it does not: the vertices turn round the point, or they do not."""
    following = np.roll(vertices, -1, axis=0)
    normal = np.cross(vertices, following).sum(axis=0)
    slope = float(normal @ direction)
    distance = float(normal @ (vertices[0] - origin)) / slope if slope else -1.0
    start, end = vertices - (origin + distance * direction), following - (origin + distance * direction)
    sines = np.cross(start, end) @ (normal / np.linalg.norm(normal))
    turned = float(np.arctan2(sines, np.sum(start * end, axis=-1)).sum())
    return distance if distance > 0 and abs(turned) > math.pi else math.inf


def patch_point(net: np.ndarray, u: float, v: float) -> np.ndarray:
    """The point of a bicubic Bézier patch (4, 4, 3) at (u, v), by de Casteljau's halving of the way."""
    for t in (u, v):
        points = net
        while len(points) > 1:
            points = (1 - t) * points[:-1] + t * points[1:]
        net = points[0]
    return net


@functools.lru_cache
def patch_triangles(control: bytes, count: int) -> np.ndarray:
    """A patch, the bytes of its (4, 4, 3) control points, as 2·count² triangles with corners on it: (M, 3, 3)."""
    net, steps = np.frombuffer(control).reshape(4, 4, 3), np.linspace(0, 1, count + 1)
    grid = np.array([[patch_point(net, u, v) for v in steps] for u in steps])
    first = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:]], axis=2)
    second = np.stack([grid[:-1, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2)
    return np.concatenate([first.reshape(-1, 3, 3), second.reshape(-1, 3, 3)])


def latlong_pixels(radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where each pixel of a lat-long map points, (H·W, 3), and its radiance × solid angle, (H·W, 3)."""
    directions, areas = _latlong(*radiance.shape[:2])
    return directions.copy(), radiance.reshape(-1, radiance.shape[2]).astype(np.float64) * areas[:, None]


@functools.lru_cache(maxsize=32)
def _latlong(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """The directions (H·W, 3) and solid angles (H·W,) of the pixels."""
    directions, areas = [], []
    for j in range(height):
        top, bottom = math.pi * j / height, math.pi * (j + 1) / height
        area = math.tau / width * (math.cos(top) - math.cos(bottom))
        polar = (top + bottom) / 2
        for i in range(width):
            longitude = math.tau * (i + 0.5) / width - math.pi
            ring = math.sin(polar)
            directions.append((ring * math.sin(longitude), math.cos(polar), -ring * math.cos(longitude)))
            areas.append(area)
    return np.array(directions), np.array(areas)


def reflection_sums(
    radiance: np.ndarray, function: Callable[[np.ndarray], np.ndarray], rows: int, every: int = 1
) -> np.ndarray:
    """Σ I[L] · Area[L] · f(N·L) of Miller & Hoffman (1984, §6), entry by entry: (rows, 2·rows, 3).

    every : sum for one column in so many
    """
    directions, flux = latlong_pixels(radiance)
    lit = flux.any(axis=1)  # what is black adds nothing
    directions, flux = directions[lit], flux[lit]
    entries, _ = latlong_pixels(np.zeros((rows, 2 * rows, 3)))
    chosen = entries.reshape(rows, 2 * rows, 3)[:, ::every]
    table = np.stack([function(np.clip(directions @ n, -1, 1)) @ flux for n in chosen.reshape(-1, 3)])
    return table.reshape(chosen.shape)


def wigner(degree: int, order: int, spin: int, angle: float) -> float:
    """d^l_{m,k}(θ) by Wigner's own sum of factorials."""
    factorial, total = math.factorial, 0.0
    for s in range(max(0, spin - order), min(degree + spin, degree - order) + 1):
        below = (
            factorial(degree + spin - s) * factorial(s) * factorial(order - spin + s) * factorial(degree - order - s)
        )
        cosine, sine = math.cos(angle / 2), math.sin(angle / 2)
        powers = cosine ** (2 * degree + spin - order - 2 * s) * sine ** (order - spin + 2 * s)
        total += (-1) ** (order - spin + s) / below * powers
    scale = factorial(degree + order) * factorial(degree - order) * factorial(degree + spin) * factorial(degree - spin)
    return math.sqrt(scale) * total


def ggx(alpha: float, normal: np.ndarray, eye: np.ndarray, light: np.ndarray) -> float:
    """f_r · N·L of white GGX with separable Smith masking (Walter et al. 2007, eqs. 20, 33 and 34)."""
    n_l, n_e = float(normal @ light), float(normal @ eye)
    if n_l <= 0 or n_e <= 0:
        return 0.0
    half = (light + eye) / np.linalg.norm(light + eye)
    cosine = float(normal @ half)
    tangent2 = 1 / cosine**2 - 1
    distribution = alpha**2 / (math.pi * cosine**4 * (alpha**2 + tangent2) ** 2)
    masking = 1.0
    for c in (n_l, n_e):
        masking *= 2 / (1 + math.sqrt(1 + alpha**2 * (1 / c**2 - 1)))
    return distribution * masking / (4 * n_e)


def ward(alpha: float, normal: np.ndarray, eye: np.ndarray, light: np.ndarray) -> float:
    """f_r · N·L of Ward's isotropic gaussian (Ward 1992, eq. 4)."""
    n_l, n_e = float(normal @ light), float(normal @ eye)
    if n_l <= 0 or n_e <= 0:
        return 0.0
    half = (light + eye) / np.linalg.norm(light + eye)
    delta = math.acos(min(1.0, float(normal @ half)))
    gaussian = math.exp(-(math.tan(delta) ** 2) / alpha**2) / (4 * math.pi * alpha**2)
    return gaussian / math.sqrt(n_l * n_e) * n_l


def phong(n: float, normal: np.ndarray, eye: np.ndarray, light: np.ndarray) -> float:
    """f_r · N·L of the Phong lobe that keeps energy, (n + 2)/2π · (R·L)ⁿ (Lewis 1994)."""
    reflected = 2 * float(eye @ normal) * normal - eye
    n_l = float(normal @ light)
    return (n + 2) / math.tau * max(0.0, float(reflected @ light)) ** n * n_l if n_l > 0 else 0.0

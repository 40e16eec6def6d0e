"""Finding mirrored balls: real sets and virtual ones under hundreds of changes, and pictures that hold none.

    python benchmarks/ball_finding.py [--kinds crops,stands] [--every 4] [--verbose]

Real photographs lie in `../shared/data/ball`; their rims were measured by eye in enlargements and then fitted, and
stand here as literals. The room's balls lie in `../shared/shoots`; their rims follow from where their cameras stood.
Other balls are traced under photographed environment maps, in front of the same map, so that they mirror what is around
them. Printed are, for each kind: found (centre and radius within 1 %), off (within 3 %), wrong, refused, refused with
the ball among the picks that are offered, and the longest processor time. A doubt is a wrong ball with exit code 4, and
wrong is one with 0. What holds no ball has to be refused.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from relume.errors import BallNotFound
from relume.image.colour import decode_srgb, encode_srgb
from relume.image.files import read_photograph, read_radiance
from relume.image.radiance import RadianceMap
from relume.probe.ball.probing import rim_doubts
from relume.probe.ball.reflectance import CHROME_STEEL, BallReflectance
from relume.probe.ball.silhouette import Cone, outline_of
from relume.probe.ball.unwrapping import unwrap_ball
from relume.sphere.environment_files import read_environment
from relume.sphere.mappings.mapping import LatLong

SHARED = Path(__file__).resolve().parents[2] / "shared"
Circle = tuple[float, float, float]

REAL: dict[str, Circle] = {
    "pietka_room/raw1.jpg": (755.3, 549.4, 73.0),
    "pietka_room/raw2.jpg": (755.6, 549.2, 73.0),
    "pietka_room/raw3.jpg": (755.5, 549.2, 73.0),
    "pietka_room/rec1.jpg": (73.75, 73.15, 73.0),
    "pietka_room/rec2.jpg": (73.65, 73.15, 73.0),
    "pietka_room/rec3.jpg": (73.6, 73.0, 73.0),
    "uiuc_desk/0024.jpg": (189.8, 190.4, 188.4),
    "uiuc_desk/0060.jpg": (189.3, 188.2, 187.5),
    "uiuc_desk/0120.jpg": (188.7, 185.9, 187.5),
    "uiuc_desk/0205.jpg": (189.5, 187.0, 187.6),
    "uiuc_desk/0553.jpg": (188.6, 189.4, 187.5),
    "xu_bracket5/cp_t5.jpg": (223.5, 222.0, 221.0),
    "xu_bracket5/cp_t20.jpg": (224.6, 222.0, 221.0),
    "xu_bracket5/cp_t40.jpg": (223.4, 226.0, 221.0),
    "xu_bracket5/cp_t80.jpg": (221.5, 224.6, 221.0),
    "xu_bracket5/cp_t320.jpg": (223.5, 224.7, 221.0),
}
"""Centre and radius in pixels of the real balls, by path under `data/ball`.

Of one photograph a set the edge was read at 11 to 16 places in its unrolled rim, where the surroundings show it, and
the circle fitted: it leaves 0.4 pixels of 188 (uiuc), 0.8 of 221 (xu, no perfect ball), 0.3 of 73 (pietka). The others
of a set were laid on it by correlation, to a few tenths of a pixel.
"""
ROOM = 5960.26 / np.sqrt((1.0 + 0.12**2) / 0.05**2 - 1)
"""Radius in pixels of the room's balls: f/√(D² − 1)."""
WITHOUT = (
    "data/ball/pietka_room/raw0.jpg",
    "data/ball/uiuc_desk/empty.jpg",
    "shoots/room/plate/IMG_0002.jpg",
    "shoots/room/plate_grid.jpg",
    "data/brackets/arch_full/img_2.5.jpg",
    "data/brackets/garage/1_160.JPG",
    "data/brackets/garage/1_40.JPG",
    "data/brackets/ghost_hall/IMG_0960.JPG",
    "data/brackets/ghost_lady/Img2.jpg",
    "data/brackets/handheld_street/IMG_4210.jpg",
    "data/brackets/memorial/memorial0064.png",
    "data/brackets/memorial/memorial0070.png",
    "data/brackets/room/stack_room_exp_3.jpg",
    "data/brackets/window/1_15.jpg",
    "data/brackets/window/1_250.jpg",
)
MAPS = (
    "data/hdri/three/quarry_01_1k.hdr",
    "data/hdri/three/royal_esplanade_1k.hdr",
    "data/hdri/three/venice_sunset_1k.hdr",
    "data/hdri/spruit_sunrise/spruit_sunrise_1k.hdr",
    "data/probes/latlong_small/ennis.hdr",
    "data/probes/latlong_small/grace.hdr",
    "data/probes/latlong_small/uffizi.hdr",
    "data/hdri/pmndrs/studio.exr",
)


@dataclass(frozen=True, eq=False)
class Case:
    """One picture: scene-linear (H, W, 3), where its ball is (None: there is none), and its focal length if known."""

    kind: str
    name: str
    picture: np.ndarray
    truth: Circle | None
    focal_length: float | None = None
    single: bool = True

    def as_(self, kind: str, what: str, picture: np.ndarray, truth: Circle | None) -> Case:
        return replace(self, kind=kind, name=f"{self.name} {what}", picture=picture, truth=truth, focal_length=None)


# What real photographs and virtual ones there are.


def photograph(path: str) -> np.ndarray:
    pixels = read_photograph(SHARED / path).pixels
    return decode_srgb(pixels.astype(np.float32) / np.iinfo(pixels.dtype).max).astype(np.float32)


def base(path: str) -> Case:
    truth = REAL[path.removeprefix("data/ball/")] if "data/ball" in path else (320.0, 320.0, float(ROOM))
    return Case("frames", path.split("/", 2)[-1], photograph(path), truth)


BASES = (
    "data/ball/pietka_room/raw2.jpg",
    "data/ball/uiuc_desk/0060.jpg",
    "data/ball/xu_bracket5/cp_t20.jpg",
    "shoots/room/ball_0/IMG_0004.jpg",
)


def bases() -> list[Case]:
    return [base(path) for path in BASES]


def exposed_to_eight_bits(radiance: np.ndarray, grey: float, seed: int = 0, noise: float = 0.01) -> np.ndarray:
    """As a camera would give it, linear again: `grey` is what the median becomes, of white."""
    generator = np.random.default_rng(seed)
    light = radiance * (grey / max(float(np.median(radiance)), 1e-9))
    light = light + generator.normal(0, noise, light.shape) * np.sqrt(np.maximum(light, 0) * 0.1 + 1e-4)
    return decode_srgb(np.rint(255 * encode_srgb(np.clip(light, 0, 1))) / 255).astype(np.float32)


def looked_up(chart: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """A lat-long chart (H, 2H, 3) at unit directions (…, 3)."""
    points = LatLong().image_points(directions).astype(np.float32)
    height, width = chart.shape[:2]
    x, y = points[..., 0] * width - 0.5, points[..., 1] * height - 0.5
    return cv2.remap(chart, x, np.clip(y, 0, height - 1), cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)


def traced(
    chart: np.ndarray, size: tuple[int, int], focal_length: float, axis: np.ndarray, distance: float, heading: float,
    reflectance: BallReflectance = BallReflectance(),
) -> np.ndarray:  # fmt: skip
    """A ball at `distance` radii along `axis` (pixel frame) before a lat-long chart that it mirrors; 9 rays a pixel."""
    width, height = size
    total = np.zeros((height, width, 3), np.float32)
    cosine, sine = np.cos(heading), np.sin(heading)
    world = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]) @ np.diag([1.0, -1.0, -1.0])
    for dy in (1 / 6, 0.5, 5 / 6):
        for dx in (1 / 6, 0.5, 5 / 6):
            x, y = np.arange(width) + dx - width / 2, np.arange(height)[:, None] + dy - height / 2
            ray = np.stack(np.broadcast_arrays(x, y, focal_length), -1).astype(np.float64)
            ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
            along = distance * (ray @ axis)
            within = along**2 - distance**2 + 1
            hit = within > 0
            point = (along - np.sqrt(np.maximum(within, 0)))[..., None] * ray
            normal = point - distance * axis
            normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
            seen = np.where(hit[..., None], ray - 2 * (ray * normal).sum(-1, keepdims=True) * normal, ray)
            light = looked_up(chart, seen @ world.T)
            cosine_there = np.clip(-(ray * normal).sum(-1), 0, 1)
            light = np.where(hit[..., None], light * reflectance.at(cosine_there), light)
            total += light.astype(np.float32)
    return total / 9


def ellipse_of(axis: np.ndarray, distance: float, size: tuple[int, int], focal_length: float) -> Circle:
    outline = outline_of(Cone(axis, distance), size, focal_length)
    return (*outline.centre, outline.radius)


def towards(x: float, y: float, radius: float, size: tuple[int, int], focal_length: float) -> tuple[np.ndarray, float]:
    """Axis and distance of a ball that looks about `radius` pixels large about (x, y)."""
    axis = np.array([x - size[0] / 2, y - size[1] / 2, focal_length])
    length = float(np.linalg.norm(axis))
    return axis / length, float(np.hypot(1, length / radius))


# The changes.


def cropped(case: Case, kind: str, what: str, left: float, top: float, width: float, height: float) -> Case:
    """A window of whole pixels; what lies beyond the picture is left out."""
    assert case.truth is not None
    x0, y0 = max(round(left), 0), max(round(top), 0)
    part = case.picture[y0 : max(round(top + height), y0 + 8), x0 : max(round(left + width), x0 + 8)]
    x, y, r = case.truth
    return case.as_(kind, what, np.ascontiguousarray(part), (x - x0, y - y0, r))


def scaled(case: Case, kind: str, what: str, factor: float) -> Case:
    height, width = case.picture.shape[:2]
    size = (max(round(width * factor), 8), max(round(height * factor), 8))
    how = cv2.INTER_AREA if factor < 1 else cv2.INTER_CUBIC
    picture = np.maximum(cv2.resize(case.picture, size, interpolation=how), 0)
    assert case.truth is not None
    x, y, r = case.truth
    across, down = size[0] / width, size[1] / height
    return case.as_(kind, what, picture, (x * across, y * down, r * float(np.sqrt(across * down))))


def rotated(case: Case, kind: str, degrees: float) -> Case:
    assert case.truth is not None
    x, y, r = case.truth
    matrix = cv2.getRotationMatrix2D((x - 0.5, y - 0.5), degrees, 1.0)
    size = case.picture.shape[1], case.picture.shape[0]
    picture = cv2.warpAffine(case.picture, matrix, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)
    return case.as_(kind, f"turned {degrees:g}°", picture, (x, y, r))


@cache
def ground(width: int, height: int) -> np.ndarray:
    """A photograph without a ball, of this size."""
    picture = photograph("data/brackets/garage/1_40.JPG")
    side = min(picture.shape[0] * width // height, picture.shape[1])
    part = picture[: side * height // width, :side]
    return cv2.resize(part, (width, height), interpolation=cv2.INTER_AREA)


def about_the_ball(case: Case, radii: float) -> Case:
    """Cropped so that `radii` of the ball's radius lie to all sides; before another photograph where its own ends."""
    assert case.truth is not None
    x, y, r = case.truth
    reach = radii * r
    height, width = case.picture.shape[:2]
    beyond = int(max(0, reach - min(x, y, width - x, height - y))) + 1
    if beyond < 0.1 * r:
        wide = cv2.copyMakeBorder(case.picture, beyond, beyond, beyond, beyond, cv2.BORDER_REPLICATE)
    else:
        own = cv2.copyMakeBorder(case.picture, beyond, beyond, beyond, beyond, cv2.BORDER_REPLICATE)
        behind = ground(own.shape[1], own.shape[0])
        behind = behind * (float(np.median(case.picture)) / max(float(np.median(behind)), 1e-6))
        cover = inside(own.shape, (x + beyond, y + beyond, r - 0.5))
        wide = (own * cover + behind * (1 - cover)).astype(np.float32)
    moved = replace(case, picture=wide, truth=(x + beyond, y + beyond, r))
    return cropped(moved, case.kind, "", x + beyond - reach, y + beyond - reach, 2 * reach, 2 * reach)


def inside(shape: tuple[int, ...], circle: Circle) -> np.ndarray:
    """The share of every pixel that a circle covers, to first order, (H, W, 1)."""
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    return np.clip(circle[2] - np.hypot(x - circle[0], y - circle[1]) + 0.5, 0, 1)[..., None].astype(np.float32)


def blotches(shape: tuple[int, ...], period: float, seed: int) -> np.ndarray:
    """Soft noise (H, W, 1) about 1."""
    small = np.random.default_rng(seed).normal(0, 1, (int(shape[0] / period) + 3, int(shape[1] / period) + 3))
    return cv2.resize(small.astype(np.float32), (shape[1], shape[0]), interpolation=cv2.INTER_CUBIC)[..., None]


def with_stand(case: Case, hidden: float, seed: int, level: float) -> Case:
    """A cup or a bottle before the ball's lower rim, hiding so many degrees of it."""
    assert case.truth is not None
    x, y, r = case.truth
    shape = case.picture.shape
    down, across = np.mgrid[: shape[0], : shape[1]] + 0.5
    half = np.radians(hidden / 2)
    top, wide = y + r * np.cos(half), r * np.sin(half)
    # A cup's mouth is an ellipse; below it the sides run straight down.
    mouth = ((across - x) / wide) ** 2 + ((down - top) / (0.25 * wide)) ** 2 < 1
    cup = mouth | ((np.abs(across - x) < wide) & (down > top))
    tone = level * (0.7 + 0.3 * np.cos(np.pi * np.clip((across - x) / max(wide, 1), -1, 1)))[..., None]
    tone = tone * np.exp(0.04 * blotches(shape, max(r / 12, 1), seed)) * np.array([1.0, 0.9, 0.75])
    soft = cv2.GaussianBlur(cup.astype(np.float32), (0, 0), 0.7)[..., None]
    grey = float(np.median(case.picture))
    return case.as_("stands", f"stand {hidden:g}°", (case.picture * (1 - soft) + soft * tone * grey).astype(np.float32),
                    case.truth)  # fmt: skip


Maker = Callable[[tuple[int, ...], Circle, float], tuple[np.ndarray, np.ndarray]]
"""From a shape, a place and a grey level: how a thing covers the picture (H, W, 1), and its radiance (H, W, 3)."""


def _normals(shape: tuple[int, ...], circle: Circle) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    y, x = np.mgrid[: shape[0], : shape[1]] + 0.5
    u, v = (x - circle[0]) / circle[2], (y - circle[1]) / circle[2]
    return u, v, np.sqrt(np.maximum(1 - u * u - v * v, 0))


def _lit(u: np.ndarray, v: np.ndarray, w: np.ndarray) -> np.ndarray:
    return (0.25 + 0.9 * np.maximum(-0.5 * u - 0.6 * v + 0.62 * w, 0))[..., None]


def peach(shape: tuple[int, ...], circle: Circle, grey: float) -> tuple[np.ndarray, np.ndarray]:
    u, v, w = _normals(shape, circle)
    red = 1 / (1 + np.exp(-4 * (0.7 * u + 0.4 * v)))[..., None]
    skin = (1 - red) * np.array([1.0, 0.62, 0.2]) + red * np.array([0.75, 0.18, 0.12])
    furrow = 1 - 0.35 * np.exp(-0.5 * ((u - 0.25 * v - 0.1) / 0.04) ** 2)[..., None]
    fuzz = np.exp(0.05 * blotches(shape, max(circle[2] / 25, 1), 4))
    return inside(shape, circle), grey * 1.8 * skin * _lit(u, v, w) * furrow * fuzz


def orange(shape: tuple[int, ...], circle: Circle, grey: float) -> tuple[np.ndarray, np.ndarray]:
    u, v, w = _normals(shape, circle)
    dimples = np.exp(0.10 * blotches(shape, max(circle[2] / 30, 1), 5))
    gleam = 0.8 * np.exp(-0.5 * (((u + 0.35) / 0.12) ** 2 + ((v + 0.4) / 0.1) ** 2))[..., None]
    return inside(shape, circle), grey * 1.7 * (np.array([1.0, 0.45, 0.05]) * _lit(u, v, w) * dimples + gleam)


def lamp(shape: tuple[int, ...], circle: Circle, grey: float) -> tuple[np.ndarray, np.ndarray]:
    _, _, w = _normals(shape, circle)
    glow = np.array([1.0, 0.9, 0.7]) * (6 + 4 * w[..., None])
    return inside(shape, circle), grey * glow


def plate(shape: tuple[int, ...], circle: Circle, grey: float) -> tuple[np.ndarray, np.ndarray]:
    u, v, _ = _normals(shape, circle)
    r = np.hypot(u, v)
    tone = 1.6 + 0.12 * u - 0.1 * v + 0.25 * np.exp(-0.5 * ((r - 0.68) / 0.03) ** 2) - 0.2 * (r < 0.62)
    tone = tone - 0.7 * np.exp(-0.5 * ((r - 0.93) / 0.015) ** 2)
    return inside(shape, circle), grey * tone[..., None] * np.array([1.0, 0.98, 0.94])


def grey_ball(shape: tuple[int, ...], circle: Circle, grey: float) -> tuple[np.ndarray, np.ndarray]:
    u, v, w = _normals(shape, circle)
    return inside(shape, circle), grey * 1.2 * _lit(u, v, w) * np.exp(0.02 * blotches(shape, 2, 7)) * np.ones(3)


def billiard_ball(shape: tuple[int, ...], circle: Circle, grey: float) -> tuple[np.ndarray, np.ndarray]:
    u, v, w = _normals(shape, circle)
    band = np.where((np.abs(v - 0.1) < 0.45)[..., None], np.array([0.9, 0.5, 0.02]), np.array([0.9, 0.88, 0.8]))
    window = ((np.abs(u + 0.4) < 0.1) & (np.abs(v + 0.45) < 0.12))[..., None] * 3.0
    return inside(shape, circle), grey * (band * _lit(u, v, w) * 1.4 + window)


def egg(shape: tuple[int, ...], circle: Circle, grey: float) -> tuple[np.ndarray, np.ndarray]:
    x, y, r = circle
    down, across = np.mgrid[: shape[0], : shape[1]] + 0.5
    u, v = (across - x) / r, (down - y) / (1.28 * r) * (1 + 0.12 * (down - y) / r)
    cover = np.clip((1 - np.hypot(u, v)) * r + 0.5, 0, 1)[..., None].astype(np.float32)
    w = np.sqrt(np.maximum(1 - u * u - v * v, 0))
    return cover, grey * 1.8 * np.array([1.0, 0.82, 0.66]) * _lit(u, v, w) * np.exp(0.02 * blotches(shape, 3, 8))


def clock(shape: tuple[int, ...], circle: Circle, grey: float) -> tuple[np.ndarray, np.ndarray]:
    u, v, _ = _normals(shape, circle)
    r, turn = np.hypot(u, v), np.arctan2(v, u)
    marks = (np.abs((turn * 6 / np.pi + 0.5) % 1 - 0.5) < 0.1) & (r > 0.72) & (r < 0.88)
    hands = (np.abs(u) < 0.03) & (v < 0) & (r < 0.75) | (np.abs(v - 0.3 * u) < 0.04) & (u > 0) & (r < 0.5)
    tone = np.where(marks | hands, 0.15, 1.7) - 1.3 * (r > 0.94)
    return inside(shape, circle), grey * tone[..., None] * np.array([1.0, 0.99, 0.95])


def globe(shape: tuple[int, ...], circle: Circle, grey: float) -> tuple[np.ndarray, np.ndarray]:
    """A ball with a map painted on: detail that is foreshortened towards its rim as paint is."""
    u, v, w = _normals(shape, circle)
    generator, total = np.random.default_rng(11), np.zeros_like(u)
    for _ in range(14):
        k, phase = generator.normal(0, 5, 3), generator.uniform(0, 6)
        total += np.sin(k[0] * u + k[1] * v + k[2] * w + phase)
    land = (total > 0.8)[..., None]
    colour = np.where(land, np.array([0.75, 0.6, 0.3]), np.array([0.25, 0.5, 0.85]))
    return inside(shape, circle), grey * 1.5 * colour * _lit(u, v, w)


THINGS: dict[str, Maker] = {
    maker.__name__: maker for maker in (peach, orange, lamp, plate, grey_ball, billiard_ball, egg, clock, globe)
}


def put(picture: np.ndarray, maker: Maker, circle: Circle, grey: float) -> np.ndarray:
    """The picture with a thing in it, and a soft shadow under the thing."""
    x, y, r = circle
    shade = np.exp(-((((np.arange(picture.shape[1]) + 0.5 - x) / r) ** 2)[None] + (
        ((np.arange(picture.shape[0]) + 0.5 - y - 0.9 * r) / (0.5 * r)) ** 2)[:, None]))[..., None]  # fmt: skip
    cover, light = maker(picture.shape, circle, grey)
    return (picture * (1 - 0.5 * shade) * (1 - cover) + np.maximum(light, 0) * cover).astype(np.float32)


# The kinds.


def frames() -> Iterator[Case]:
    """Every photograph of every set, by itself."""
    for path in REAL:
        yield base(f"data/ball/{path}")
    for view in ("ball_0", "ball_90"):
        for number in range(1, 10):
            yield base(f"shoots/room/{view}/IMG_000{number}.jpg")


def sizes() -> Iterator[Case]:
    for case in bases():
        longer = max(case.picture.shape)
        for side in (40, 64, 100, 160, 250, 400, 800, 1500, 3000, 6000):
            assert case.truth is not None
            if case.truth[2] * side / longer > 12:
                yield scaled(case, "sizes", f"{side} px", side / longer)


def crops() -> Iterator[Case]:
    for case in bases():
        assert case.truth is not None
        x, y, r = case.truth
        for margin in (1.0, 0.5, 0.25, 0.1, 0.03, 0.0, -0.02, -0.04):
            reach = (1 + margin) * r
            yield cropped(case, "crops", f"margin {margin:g}", x - reach, y - reach, 2 * reach, 2 * reach)
        # Off the middle, as frames are cut by hand.
        yield cropped(case, "crops", "right", x - 1.02 * r, y - 1.4 * r, 3.2 * r, 2.6 * r)
        yield cropped(case, "crops", "low", x - 1.8 * r, y - 0.97 * r, 3.0 * r, 2.6 * r)
        yield cropped(case, "crops", "side cut", x - 0.93 * r, y - 1.2 * r, 2.5 * r, 2.4 * r)


def rotations() -> Iterator[Case]:
    for case in bases():
        for degrees in (8, 30, 45, 90, 137, 180, -20):
            yield rotated(about_the_ball(case, 1.8), "rotations", degrees)


def blurs() -> Iterator[Case]:
    for case in bases():
        assert case.truth is not None
        for share in (0.005, 0.01, 0.02, 0.03, 0.04):
            picture = cv2.GaussianBlur(case.picture, (0, 0), share * case.truth[2])
            yield case.as_("blurs", f"blur {100 * share:g} %", picture, case.truth)
        for seed, noise in enumerate((0.03, 0.08)):
            picture = exposed_to_eight_bits(case.picture, float(np.median(case.picture)), seed, noise)
            yield case.as_("blurs", f"noise {noise:g}", picture, case.truth)


def stands() -> Iterator[Case]:
    for case in bases():
        for seed, (hidden, level) in enumerate(((40, 0.3), (70, 1.0), (100, 0.5), (130, 2.0), (70, 4.0))):
            yield with_stand(about_the_ball(case, 1.7), hidden, seed, level)


def surroundings() -> Iterator[Case]:
    for case in bases():
        around = about_the_ball(case, 2.2)
        assert around.truth is not None
        ball = inside(around.picture.shape, around.truth)
        for gain in (0.1, 3.0, 10.0, 40.0):
            lit = around.picture * (ball + gain * (1 - ball))
            grey = float(np.median(around.picture)) * (1 if gain < 20 else 0.5)
            yield around.as_("surroundings", f"outside ×{gain:g}", exposed_to_eight_bits(lit, grey), around.truth)


def exposures() -> Iterator[Case]:
    for case in bases():
        around = about_the_ball(case, 1.6)
        for grey in (0.005, 0.02, 0.5, 0.9):
            picture = exposed_to_eight_bits(around.picture, grey, noise=0.02)
            yield around.as_("exposures", f"median at {grey:g}", picture, around.truth)


def beside() -> Iterator[Case]:
    for case in bases():
        around = about_the_ball(case, 3.2)
        assert around.truth is not None
        x, y, r = around.truth
        grey = float(np.median(case.picture))
        for number, (name, maker) in enumerate(THINGS.items()):
            ratio = (0.7, 1.0, 1.15)[number % 3]
            side = -1 if number % 2 else 1
            place = (x + side * (1 + ratio) * r * 1.06, y + 0.1 * r, ratio * r)
            yield around.as_("beside", name, put(around.picture, maker, place, grey), around.truth)


def chromed_balls() -> Iterator[Case]:
    """The traced balls as they are bought: chromed, brighter towards the rim by Schlick's formula."""
    return traced_balls("chrome", CHROME_STEEL)


def traced_balls(
    kind: str = "traced", reflectance: BallReflectance = BallReflectance(), maps: Sequence[str] = MAPS, seed: int = 7,
) -> Iterator[Case]:  # fmt: skip
    """Balls of several sizes and places under photographed light, with and without their focal length."""
    generator = np.random.default_rng(seed)
    for path in maps:
        cube = path.endswith(".dds")
        found = read_environment(SHARED / path).remapped(LatLong()) if cube else read_radiance(SHARED / path)
        chart = np.ascontiguousarray(found.radiance.astype(np.float32))
        for number in range(7):
            size = ((480, 360), (640, 480), (800, 600))[number % 3]
            focal = size[0] * float((3.0, 1.4, 0.9)[number % 3])
            radius = float(generator.uniform(0.08, 0.3)) * size[1]
            x, y = (float(generator.uniform(radius * 1.15, side - radius * 1.15)) for side in size)
            axis, distance = towards(x, y, radius, size, focal)
            heading = float(generator.uniform(0, 6.28))
            light = traced(chart, size, focal, axis, distance, heading, reflectance=reflectance)
            grey = float(generator.choice([0.08, 0.18, 0.35]))
            case = Case(
                kind, f"{Path(path).stem} {number}", exposed_to_eight_bits(light, grey, number),
                ellipse_of(axis, distance, size, focal), focal,
            )  # fmt: skip
            yield case if number % 2 else replace(case, focal_length=None, name=case.name + " no EXIF")


def nothing() -> Iterator[Case]:
    """Pictures without a mirrored ball."""
    for path in WITHOUT:
        picture = photograph(path)
        yield Case("nothing", path.split("/", 1)[1], picture, None)
        half = picture[: picture.shape[0] // 2, picture.shape[1] // 3 :]
        yield Case("nothing", f"{path.split('/', 1)[1]} part", np.ascontiguousarray(half), None)
    for number, path in enumerate((WITHOUT[0], WITHOUT[6], WITHOUT[7])):
        ground = cv2.resize(photograph(path), (900, 600), interpolation=cv2.INTER_AREA)
        for name, maker in THINGS.items():
            radius = (70.0, 120.0, 180.0)[number]
            picture = put(ground, maker, (420.0 + 20 * number, 310.0, radius), float(np.median(ground)))
            yield Case("nothing", f"{name} in {Path(path).stem}", picture, None)


def two() -> Iterator[Case]:
    for case in bases():
        around = about_the_ball(case, 1.3)
        picture = np.concatenate([around.picture, around.picture[:, ::-1]], axis=1)
        yield around.as_("two", "and its twin", np.ascontiguousarray(picture), None)


KINDS: dict[str, Callable[[], Iterator[Case]]] = {
    "frames": frames, "sizes": sizes, "crops": crops, "rotations": rotations, "blurs": blurs, "stands": stands,
    "surroundings": surroundings, "exposures": exposures, "beside": beside, "traced": traced_balls,
    "chrome": chromed_balls,
    "nothing": nothing, "two": two,
}  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    case: Case
    verdict: str
    off: float
    seconds: float
    words: str


def tried(case: Case) -> Outcome:
    """What `relume probe` makes of one picture."""
    began = time.process_time()
    picture = RadianceMap(case.picture)
    words, off = "", float("nan")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            view = unwrap_ball(
                picture, camera=np.array([0.0, 0.0, 1.0]), centre=np.zeros(3), focal_length=case.focal_length,
                radius=0.05, name="it",
            )  # fmt: skip
        outline = view.outline
        words = "{:.1f},{:.1f},{:.1f}".format(*outline.centre, outline.radius)
        doubted = any(each.wrong for each in rim_doubts(view, "it"))
        words += f" coverage {outline.coverage:.2f}" + (" rivals" if outline.rivals else "")
        verdict = "doubt" if doubted else "wrong"
        if case.truth is not None:
            x, y, r = case.truth
            off = max(float(np.hypot(outline.centre[0] - x, outline.centre[1] - y)), abs(outline.radius - r)) / r
            verdict = "found" if off <= 0.01 else "off" if off <= 0.03 else "doubt" if doubted else "wrong"
    except BallNotFound as error:
        words, verdict = str(error), "refused"
        if case.truth is not None:
            x, y, r = case.truth
            for cx, cy, cr in getattr(error, "candidates", ()):
                if max(abs(cx - x), abs(cy - y), abs(cr - r)) < 0.05 * r:
                    verdict = "offered"
    return Outcome(case, verdict, off, time.process_time() - began, words)


def main(kinds: Mapping[str, Callable[[], Iterator[Case]]]) -> None:
    """Try the kinds that the command line names, and print what was found."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--kinds", default=",".join(kinds))
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    verdicts = ("found", "off", "doubt", "wrong", "refused", "offered")
    print(f"{'kind':14s}{'cases':>6s}" + "".join(f"{v:>9s}" for v in verdicts) + f"{'median %':>10s}{'longest s':>10s}")
    everything: list[Outcome] = []
    for kind in options.kinds.split(","):
        outcomes = []
        for case in islice(kinds[kind](), 0, None, options.every):
            outcome = tried(case)
            outcomes.append(replace(outcome, case=replace(case, picture=np.zeros((1, 1, 3), np.float32))))
            if options.verbose or outcome.verdict != ("found" if case.truth is not None else "refused"):
                print(f"  {kind}: {case.name}: {outcome.verdict} {100 * outcome.off:.1f} % {outcome.seconds:.1f} s "
                      f"{outcome.words} (truth {case.truth})", file=sys.stderr, flush=True)  # fmt: skip
        everything += outcomes
        counts = [sum(o.verdict == v for o in outcomes) for v in verdicts]
        off = [o.off for o in outcomes if np.isfinite(o.off)]
        print(f"{kind:14s}{len(outcomes):6d}" + "".join(f"{c:9d}" for c in counts)
              + f"{100 * float(np.median(off)) if off else float('nan'):10.2f}{max(o.seconds for o in outcomes):10.1f}",
              flush=True)  # fmt: skip
    balls = [o for o in everything if o.case.truth is not None]
    right = sum(o.verdict == "found" for o in balls)
    wrong = sum(o.verdict == "wrong" for o in everything)
    share = 100 * right / max(len(balls), 1)
    print(f"{len(everything)} pictures; of {len(balls)} balls {right} found within 1 % ({share:.1f} %), wrong {wrong}")


if __name__ == "__main__":
    main(KINDS)

"""Virtual films of a mirrored ball: light that moves, facets through densities, a camera, its noise, and a video file.

The ball's geometry and the camera are written down here by themselves, as in `synthetic`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from synthetic import backdrop, turned, unit

Light = Callable[[np.ndarray], np.ndarray]
UP = np.array([0.0, 1.0, 0.0])
LAMPS = (
    # towards, sharpness, colour: a window, a lamp, a small and very bright one, the sky, a warm wall
    ((0.5, 0.5, 0.6), 40.0, (2.0, 2.3, 3.0)),
    ((0.85, 0.45, 0.3), 150.0, (18.0, 14.0, 8.0)),
    ((-0.4, 0.5, 0.75), 700.0, (600.0, 540.0, 400.0)),
    ((-0.3, 0.95, 0.1), 3.0, (0.25, 0.3, 0.42)),
    ((-0.8, -0.1, 0.6), 12.0, (0.6, 0.35, 0.2)),
)
NORMALS = unit(np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], float))


def place_light(degrees: float = 0.0, lamps=LAMPS) -> Light:
    """A dim ground, a window, a wall and lamps over 14 stops, turned about +Y."""
    towards = [unit(turned(np.array(each[0], float), UP, degrees)) for each in lamps]

    def light(directions: np.ndarray) -> np.ndarray:
        stripes = 1 + 0.5 * np.sin(9 * turned_back(directions, degrees)[..., 0]) * np.cos(7 * directions[..., 1])
        total = 0.06 * stripes[..., None] * np.ones(3)
        for axis, (_, sharpness, colour) in zip(towards, lamps, strict=True):
            total = total + np.exp(sharpness * (directions @ axis - 1))[..., None] * np.array(colour)
        return total

    return light


def turned_back(directions: np.ndarray, degrees: float) -> np.ndarray:
    """Directions turned about +Y by so much less."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([c * x - s * z, y, s * x + c * z], axis=-1)


def truth(light: Light, size: int = 64, finer: int = 8) -> EnvironmentMap:
    """The light as a map, each pixel the mean of finer ones."""
    radiance = light(pixel_directions(LatLong(), size * finer))
    mean = radiance.reshape(size, finer, 2 * size, finer, 3).mean((1, 3))
    return EnvironmentMap(mean.astype(np.float32))


@dataclass(frozen=True)
class Facet:
    """A facet: where it shows the ball, (x, y) pixels, its density in stops, and how far aside it looks from."""

    x: float
    y: float
    stops: float
    aside: tuple[float, float] = (0.0, 0.0)


FIVE = (
    Facet(320.3, 240.2, 0.0),
    Facet(110.6, 110.4, 3.1, (-1.0, -1.0)),
    Facet(530.1, 109.8, 5.9, (1.0, -1.0)),
    Facet(530.7, 370.6, 9.8, (1.0, 1.0)),
    Facet(109.5, 370.3, 12.7, (-1.0, 1.0)),
)


class BallRig:
    """A camera that shows a ball in facets; directions are found once, for frame after frame.

    radius : of the ball, pixels
    distance : ball radii
    angle : radians that a facet one step aside sees the ball from
    """

    def __init__(
        self, facets: Sequence[Facet] = FIVE, size=(640, 480), radius=90.0, distance=20.0, angle=0.0, rays=2
    ) -> None:
        self.facets, self.size, self.radius = facets, size, radius
        self.parts = [self._mirrored(facet, distance, angle, rays) for facet in facets]

    def _mirrored(self, facet: Facet, distance: float, angle: float, rays: int):
        half = int(1.2 * self.radius)
        left, top = int(facet.x) - half, int(facet.y) - half
        steps = (np.arange(2 * half * rays) + 0.5) / rays
        x, y = np.meshgrid((steps + left - facet.x) / self.radius, -(steps + top - facet.y) / self.radius)
        # The camera: on +Z, or aside of it by the facet's angle, rays a radius wide at the ball's distance.
        away = np.sqrt(distance**2 - 1)
        backward = np.array([0.0, 0.0, 1.0])
        if angle:
            off = angle * np.array([facet.aside[0], -facet.aside[1], 0.0])
            length = np.linalg.norm(off)
            backward = np.cos(length) * backward + (np.sin(length) / length * off if length else 0)
        right = unit(np.cross(UP, backward))
        above = np.cross(backward, right)
        ray = unit(x[..., None] * right + y[..., None] * above - away * backward)
        eye = distance * backward
        b = ray @ eye
        discriminant = b * b - (distance**2 - 1)
        point = eye + (-b - np.sqrt(np.maximum(discriminant, 0)))[..., None] * ray
        mirrored = ray - 2 * (ray * point).sum(-1, keepdims=True) * point
        return left, top, 2 * half, rays, discriminant > 0, mirrored, ray

    def radiance(self, light: Light, densities: bool = True) -> np.ndarray:
        """What falls on the sensor (H, W, 3)."""
        width, height = self.size
        picture = np.full((height, width, 3), 0.02)
        for facet, (left, top, side, rays, hit, mirrored, ray) in zip(self.facets, self.parts, strict=True):
            seen = np.where(hit[..., None], light(mirrored), backdrop(ray))
            mean = seen.reshape(side, rays, side, rays, 3).mean((1, 3)) * 2.0 ** (-facet.stops * densities)
            x0, y0, x1, y1 = max(left, 0), max(top, 0), min(left + side, width), min(top + side, height)
            picture[y0:y1, x0:x1] = mean[y0 - top : y1 - top, x0 - left : x1 - left]
        return picture


def filmed(exposure: np.ndarray, noise: float = 0.7, seed: int = 0, curve=None) -> np.ndarray:
    """A frame (H, W, 3) uint8 of sensor exposures, 1 white: sRGB unless another curve is given, noise in values."""
    from relume.image.colour import encode_srgb

    encoded = 255 * (encode_srgb(np.clip(exposure, 0, 1)) if curve is None else np.clip(curve(exposure), 0, 1))
    encoded = encoded + noise * np.random.default_rng(seed).standard_normal(encoded.shape)
    return np.rint(np.clip(encoded, 0, 255)).astype(np.uint8)


def write_video(path: Path, frames: Sequence[np.ndarray], rate: float = 24, crf: int | None = None) -> Path:
    """Frames as FFV1, which loses nothing, or as H.264 of a quality (`crf`)."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("ffv1" if crf is None else "libx264", rate=Fraction(rate).limit_denominator(1001))
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "bgr0" if crf is None else "yuv420p"
        if crf is not None:
            stream.options = {"crf": str(crf)}
            codec = stream.codec_context
            codec.color_primaries = codec.color_trc = codec.colorspace = 1
        for frame in frames:
            picture = av.VideoFrame.from_ndarray(frame, format="rgb24")
            if crf is not None:
                picture = picture.reformat(format="yuv420p", dst_colorspace=1, dst_color_range=1)
            container.mux(stream.encode(picture))
        container.mux(stream.encode())
    return path


def irradiance_errors(found: EnvironmentMap, true: EnvironmentMap) -> np.ndarray:
    """Departures (26, 3) of irradiance, as shares of the true mean irradiance of the channel."""
    wanted = true.irradiance(NORMALS)
    return (found.irradiance(NORMALS) - wanted) / wanted.mean(0)

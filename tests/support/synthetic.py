"""A virtual 8-bit camera whose response is known, scenes to point it at, and a ray-traced mirrored ball.

Neither is relume's: the camera's curve and the ball's geometry are written down here by themselves, so that what is
recovered from their photographs can be compared with what made them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import RadianceMap

STOPS = tuple(0.5 * 2.0**-k for k in range(9))
"""Shutter times of nine photographs, one stop apart; with scenes of `wide_scene` all of it is well exposed in two."""


@dataclass(frozen=True)
class VirtualCamera:
    """A camera with a toe, a power and a knee in each channel, and the noise of its sensor.

    toe : linear exposure below which the curve bends to zero
    power : of the encoding above the toe
    knee : how hard highlights are pressed together; larger is straighter
    electrons : of a pixel at white, for photon noise; None for a camera without noise
    read_noise : standard deviation, electrons
    """

    toe: tuple[float, float, float] = (0.002, 0.003, 0.004)
    power: tuple[float, float, float] = (2.2, 2.1, 2.3)
    knee: tuple[float, float, float] = (1.2, 1.5, 1.0)
    electrons: float | None = None
    read_noise: float = 0.0

    def curve(self, exposure: np.ndarray) -> np.ndarray:
        """Encoded values (…, 3), 0 at no light and 1 at white, not clipped, of linear exposures (…, 3)."""
        x, toe, knee = np.maximum(exposure, 0.0), np.array(self.toe), np.array(self.knee)
        bent = (x * x / (x + toe)) * (1 + toe)
        encoded = bent ** (1 / np.array(self.power))
        return encoded * (1 + knee) / (encoded + knee)

    def log_exposure(self) -> np.ndarray:
        """The true g(z) of eq. 2, (3, 256): ln of the exposure whose value is exactly z; −inf at 0."""
        steps = np.concatenate([[0.0], np.geomspace(1e-7, 1.0, 200_001)])
        curves = self.curve(np.repeat(steps[:, None], 3, axis=1))
        with np.errstate(divide="ignore"):
            return np.stack([np.log(np.interp(np.arange(256) / 255, curves[:, c], steps)) for c in range(3)])

    def photograph(self, radiance: np.ndarray, exposure: Exposure, *, name: str = "frame", seed: int = 0) -> Photograph:
        """Radiance (H, W, 3) photographed; 1 is white at one second, f/1, ISO 100."""
        x = np.asarray(radiance, np.float64) * exposure.factor
        if self.electrons is not None:
            generator = np.random.default_rng(seed)
            # At ISO 200 half the electrons make the same value: noise belongs to the light, not to the gain.
            per_white = self.electrons * 100.0 / (exposure.iso or 100.0)
            caught = generator.poisson(np.minimum(x, 4.0) * per_white) + generator.normal(0, self.read_noise, x.shape)
            x = caught / per_white
        pixels = np.rint(255 * np.clip(self.curve(x), 0, 1)).astype(np.uint8)
        return Photograph(pixels, name, exposure)

    def bracket(self, radiance: np.ndarray, seconds: Sequence[float] = STOPS, *, seed: int = 0) -> Bracket:
        """The scene photographed with each shutter time."""
        return Bracket(
            tuple(
                self.photograph(radiance, Exposure(t), name=f"frame_{i}.jpg", seed=1000 * seed + i)
                for i, t in enumerate(seconds)
            )
        )


NOISELESS = VirtualCamera()
NOISY = VirtualCamera(electrons=12_000.0, read_noise=6.0)


def wide_scene(width: int = 192, height: int = 128, *, stops: float = 9.0, brightest: float = 60.0) -> np.ndarray:
    """A smooth coloured scene (H, W, 3) whose channels run over `stops` factors of two, up to `brightest`.

    Lightness climbs from left to right and sways up and down, the colours sway against each other: every value of
    every channel occurs in many places, and neighbouring pixels are alike.
    """
    y, x = np.mgrid[:height, :width]
    u, v = (x + 0.5) / width, (y + 0.5) / height
    channels = []
    for phase in (0.0, 0.9, 2.1):
        sway = 0.06 * np.sin(2 * np.pi * (1.3 * v + 0.6 * u) + phase) + 0.04 * np.cos(2 * np.pi * 2.1 * v - phase)
        height_of = 0.1 + 0.8 * u + sway
        channels.append(brightest * 2.0 ** (stops * (height_of - 1.0)))
    return np.stack(channels, axis=-1).astype(np.float32)


Light = Callable[[np.ndarray], np.ndarray]
"""Radiance (…, 3) from unit directions (…, 3)."""
CENTRE, RADIUS = np.array([0.0, 0.05, 0.0]), 0.05


def unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def turned(vector: np.ndarray, axis: np.ndarray, degrees: float) -> np.ndarray:
    """Rodrigues' formula, right-handed."""
    k, a = unit(np.asarray(axis, float)), np.radians(degrees)
    return vector * np.cos(a) + np.cross(k, vector) * np.sin(a) + k * (vector @ k)[..., None] * (1 - np.cos(a))


LOBES = (
    # towards, sharpness, colour: a window, a lamp, the sky and a warm wall
    ((0.2, 0.5, -0.84), 60.0, (6.0, 7.0, 9.0)),
    ((0.85, 0.45, 0.3), 150.0, (20.0, 15.0, 8.0)),
    ((-0.3, 0.95, 0.1), 3.0, (0.8, 1.0, 1.4)),
    ((-0.8, -0.1, 0.6), 12.0, (1.2, 0.7, 0.4)),
    ((-0.7, 0.6, -0.4), 200.0, (12.0, 14.0, 12.0)),
    ((0.3, 0.7, 0.65), 90.0, (3.0, 9.0, 5.0)),
)

LAMPS = tuple(towards for towards, sharpness, _ in LOBES if sharpness > 50)
"""The directions of the lobes that are narrow enough to have a place."""


def lobes(directions: np.ndarray) -> np.ndarray:
    """A dim ground and six soft lamps, each exp(k (cos − 1)) about its own direction; no direction is dark."""
    total = np.full((*directions.shape[:-1], 3), 0.25)
    for towards, sharpness, colour in LOBES:
        cosine = directions @ unit(np.array(towards))
        total = total + np.exp(sharpness * (cosine - 1))[..., None] * np.array(colour)
    return total


def backdrop(directions: np.ndarray) -> np.ndarray:
    """What the camera sees beside the ball: duller than what the ball mirrors, and nowhere like it."""
    x, y = directions[..., 0], directions[..., 1]
    return (0.06 + 0.03 * np.sin(90 * x + 40 * y) * np.cos(70 * y))[..., None] * np.array([1.0, 0.9, 0.8])


def photograph_ball(
    light: Light,
    camera: np.ndarray,
    *,
    width: int = 360,
    height: int = 360,
    focal_length: float = 3400.0,
    target: np.ndarray = CENTRE,
    wall: float | None = None,
    camera_blob: float = 0.0,
    blob_light: float = 0.002,
) -> RadianceMap:
    """The mirrored ball, `RADIUS` round `CENTRE`, in the picture of a camera at `camera`; four rays a pixel.

    light : what it mirrors; the world is +Y up
    target : where the camera looks, horizon level
    wall : radius of the sphere, round the ball's centre, that carries `light`; None for light at infinity
    camera_blob : radius, metres, of the black photographer at the camera; 0 for none
    """
    backward = unit(camera - target)
    right = unit(np.cross([0.0, 1.0, 0.0], backward))
    up = np.cross(backward, right)
    total = np.zeros((height, width, 3))
    for dx, dy in ((0.25, 0.25), (0.75, 0.25), (0.25, 0.75), (0.75, 0.75)):
        x = np.arange(width) + dx - width / 2
        y = height / 2 - (np.arange(height) + dy)
        ray = unit(x[None, :, None] * right + y[:, None, None] * up - focal_length * backward)
        # |camera + t ray − centre| = radius
        offset = camera - CENTRE
        b = ray @ offset
        discriminant = b * b - (offset @ offset - RADIUS**2)
        hit = discriminant > 0
        point = camera + (-b - np.sqrt(np.maximum(discriminant, 0)))[..., None] * ray
        normal = unit(point - CENTRE)
        mirrored = ray - 2 * (ray * normal).sum(-1, keepdims=True) * normal
        seen = mirrored
        if wall is not None:
            start = point - CENTRE
            c = (start * mirrored).sum(-1)
            length = -c + np.sqrt(c * c + wall**2 - (start * start).sum(-1))
            seen = unit(start + length[..., None] * mirrored)
        radiance = light(seen)
        if camera_blob:
            towards = camera - point
            along = (towards * mirrored).sum(-1)
            miss = np.linalg.norm(towards - along[..., None] * mirrored, axis=-1)
            radiance = np.where(((along > 0) & (miss < camera_blob))[..., None], blob_light, radiance)
        total += np.where(hit[..., None], radiance, backdrop(ray))
    return RadianceMap((total / 4).astype(np.float32))

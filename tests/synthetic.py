"""A virtual 8-bit camera whose response is known, and scenes to point it at.

The camera is none of relume's: its curve is written down here by itself, so that what is recovered from its
photographs can be compared with what made them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.capture.bracket import Bracket
from relume.image.photograph import Exposure, Photograph

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

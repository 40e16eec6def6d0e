"""More than two hundred response curves that cameras and films have, and cameras and a scene to try them with.

None comes from relume: powers, broadcast encodings, film's toe and shoulder and the knees of digital cameras are
written down here, each bent a little at random, as the curves in the database of response functions (Grossberg &
Nayar 2003) scatter about a few shapes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.image.photograph import Exposure, Photograph
from synthetic import STOPS

EXPOSURE = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 4001)])
"""Where the curves are tabulated: relative exposure, 1 at white."""

Curve = Callable[[np.ndarray], np.ndarray]


def _power(exponent: float) -> Curve:
    return lambda x: x ** (1 / exponent)


def _broadcast(offset: float, exponent: float) -> Curve:
    """A line from black that goes over into a power without a kink: sRGB is 0.055, 2.4; BT.709 0.099, 1/0.45."""
    scale, value = 1 + offset, offset / (exponent - 1)
    edge = ((value + offset) / scale) ** exponent
    return lambda x: np.where(x <= edge, x * (value / edge), scale * np.maximum(x, 1e-12) ** (1 / exponent) - offset)


def _logarithm(strength: float) -> Curve:
    return lambda x: np.log1p(strength * x) / np.log1p(strength)


def _film(contrast: float, middle: float) -> Curve:
    """Toe and shoulder: x^c / (x^c + m^c)."""
    return lambda x: x**contrast / (x**contrast + middle**contrast)


def _knee(exponent: float, toe: float, knee: float) -> Curve:
    """A digital camera's: a toe below which the curve bends to zero, a power, and highlights pressed together."""

    def curve(x: np.ndarray) -> np.ndarray:
        encoded = (x * x / (x + toe) * (1 + toe)) ** (1 / exponent)
        return encoded * (1 + knee) / (encoded + knee)

    return curve


def _families(generator: np.random.Generator) -> list[Curve]:
    uniform = generator.uniform
    return [
        _power(uniform(1.0, 2.8)),
        _broadcast(uniform(0.04, 0.11), uniform(2.0, 2.5)),
        _logarithm(np.exp(uniform(np.log(5.0), np.log(150.0)))),
        _film(uniform(0.7, 1.8), uniform(0.08, 0.4)),
        _knee(uniform(1.6, 2.6), np.exp(uniform(np.log(1e-4), np.log(0.01))), uniform(0.6, 6.0)),
    ]


def camera_curves(count: int = 201, seed: int = 0) -> np.ndarray:
    """(count, 4002) encoded values at `EXPOSURE`, 0 at black and 1 at white, rising.

    The families take turns; each draw is bent by a smooth random warp of its values whose slope stays within about
    0.7 and 1.4, so that no curve is a formula that a method could know.
    """
    generator = np.random.default_rng(seed)
    curves = []
    while len(curves) < count:
        for family in _families(generator):
            value = family(EXPOSURE)
            value = (value - value[0]) / (value[-1] - value[0])
            waves = np.arange(1, 5)
            slopes = generator.normal(0.0, 0.1, 4) / waves
            # ∫ exp(Σ a cos πkv) dv rises whatever the a are.
            grid = np.linspace(0, 1, 2001)
            density = np.exp(np.cos(np.pi * grid[:, None] * waves) @ (slopes * waves**0.5))
            warp = np.concatenate([[0.0], np.cumsum((density[1:] + density[:-1]) / 2)])
            curves.append(np.interp(value, grid, warp / warp[-1]))
    return np.stack(curves[:count])


@dataclass(frozen=True, eq=False)
class CurveCamera:
    """A camera with a tabulated curve in each channel and the noise of its sensor.

    curves : (3, 4002) encoded values at `EXPOSURE`
    electrons : of a pixel at white; None for a camera without noise
    read_noise : standard deviation, electrons
    levels : 256 or 65536 pixel values
    """

    curves: np.ndarray
    electrons: float | None = 20_000.0
    read_noise: float = 6.0
    levels: int = 256

    def true_exposure(self, levels: int = 256) -> np.ndarray:
        """(3, levels) f⁻¹ of every pixel value, 1 at white."""
        return np.stack([np.interp(np.linspace(0, 1, levels), c, EXPOSURE) for c in self.curves])

    def photograph(self, radiance: np.ndarray, exposure: Exposure, *, name: str, seed: int = 0) -> Photograph:
        """Radiance (H, W, 3) photographed; 1 is white at one second, f/1, ISO 100."""
        x = np.asarray(radiance, np.float64) * exposure.factor
        if self.electrons is not None:
            generator = np.random.default_rng(seed)
            caught = generator.poisson(np.minimum(x, 4.0) * self.electrons)
            x = (caught + generator.normal(0.0, self.read_noise, x.shape)) / self.electrons
        value = np.stack([np.interp(x[..., c], EXPOSURE, self.curves[c]) for c in range(3)], axis=-1)
        kind = np.uint8 if self.levels == 256 else np.uint16
        return Photograph(np.rint(value * (self.levels - 1)).astype(kind), name, exposure)

    def bracket(self, radiance: np.ndarray, seconds: tuple[float, ...] = STOPS, *, seed: int = 0) -> Bracket:
        return Bracket(
            tuple(
                self.photograph(radiance, Exposure(t), name=f"frame_{i}.jpg", seed=1000 * seed + i)
                for i, t in enumerate(seconds)
            )
        )


def mixed_scene(width: int = 300, height: int = 200, *, stops: float = 11.0, brightest: float = 60.0) -> np.ndarray:
    """A scene (H, W, 3) as photographs show them: coloured surfaces with edges, texture, shading and a few lamps."""
    generator = np.random.default_rng(7)
    y, x = np.mgrid[:height, :width]
    # Surfaces: cells about random centres, each of one reflectance and under its own light.
    centres = generator.uniform(0, 1, (60, 2)) * [height, width]
    cell = np.argmin((y[..., None] - centres[:, 0]) ** 2 + (x[..., None] - centres[:, 1]) ** 2, axis=-1)
    level = generator.uniform(-0.85 * stops, -1.0, 60)[cell][..., None] + generator.normal(0, 0.4, (60, 3))[cell]
    # Shading goes smoothly over all; half of the surfaces are rough.
    shading = 0.9 * np.sin(2.2 * x / width + 0.7) + 0.8 * np.cos(2.9 * y / height)
    noise = np.fft.rfft2(generator.normal(size=(height, width)))
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.rfftfreq(width))
    texture = np.fft.irfft2(noise / np.maximum(frequency, 1 / width), (height, width))
    rough = generator.random(60)[cell] < 0.5
    level = level + (shading + np.where(rough, 0.35, 0.02) * texture / texture.std())[..., None]
    for row, column, radius in generator.uniform([0, 0, 3], [height, width, 9], (6, 3)):
        distance = np.hypot(y - row, x - column)[..., None] / radius
        level = np.where(distance < 1, -0.3 * distance, np.maximum(level, -1.5 * distance))
    return (brightest * 2.0 ** np.minimum(level, 0.0)).astype(np.float32)


def exposure_error(log_exposure: np.ndarray, true: np.ndarray) -> float:
    """Root mean square error of normalised exposure over all pixel values, after the best single scale.

    log_exposure, true : (levels,) recovered ln f⁻¹ and true f⁻¹ with 1 at white
    Mitsunaga & Nayar 1999 compare curves so: both lie between 0 and 1, whatever the unit of exposure.
    """
    found = np.exp(log_exposure - log_exposure.max())
    found = found * (found @ true) / (found @ found)
    return float(np.sqrt(np.mean((found - true) ** 2)))

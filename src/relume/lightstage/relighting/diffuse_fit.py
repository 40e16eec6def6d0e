"""What a few lights, or lights on one side alone, do not show: a Lambertian fit of each pixel, put right by the lights.

R(ω) ≈ M(ω) + Σ_i w_i(ω) (R_i − M_i), M(ω) = colour · (max(b · ω, 0) + a): a Lambertian surface, and light that reaches
it over others from wherever the lamp stands. b and a are fitted to the pixel's values under all lights, shadows and
highlights left out. What the fit leaves over is interpolated by kriging with a mean of 0 (`Remainder`): the picture of
a light in its own direction comes back as it was, between the lights the fit bends the interpolation to a cosine, and
beyond them the fit is left, without a seam, for w fades with the distance from the lights. The fit is a control
variate, as the direct light of a mesh is (`direct_light`), and this is kriging about a drift.

A pixel's fit depends on the field alone, so that a picture stays linear in its light:
Σ_m E_m R(ω_m) = Σ_i e_i R_i + [Σ_m E_m M(ω_m) − Σ_i e_i M_i] with e_i = Σ_m E_m w_i(ω_m), a sum of the field's pictures
and a picture of the fit. Directions are of the world, towards the light.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import lights_width, reached
from relume.lightstage.relighting.relighting import Progress, cut
from relume.lightstage.relighting.stage_lighting import StageLighting
from relume.lightstage.relighting.voronoi_cells import even_directions

SPARSE = 0.3
"""Radians across the lights' median cell from which on the fit is made for lights all around too: fewer than 140.
Denser ones show a cosine as it is."""
LEAVES = 400
"""Directions that stand for a map where the fit is lit by it: a cosine is wider than any of them."""
_ROUNDS = 10
"""Of reweighting; the last ones change nothing that can be seen."""
_WIDTH = 0.1
"""Departures from the fit, as parts of its brightest, beyond which a value soon stops counting: shadows, highlights."""
_HELD = 0.005
"""What the square of a costs, beside the squared errors' mean: among lights on one side a and b are nearly alike, and
what b can explain is b's."""
_LOOSE = 1e-3
"""Weight of values that do not count, so that every pixel has a fit; and, a tenth of it, what the square of b costs."""
_PIXELS = 4096
"""Fitted or lit at once."""
_BYTES = 8 * 8
"""Of a value while it is fitted."""


@dataclass(frozen=True, eq=False)
class DiffuseFit:
    """The fit of each pixel of a field: M(ω) = colour · (max(b · ω, 0) + a).

    lobes : (H, W, 3) float32, b, of the mean of the channels
    constants : (H, W) float32, a, not below 0
    colours : (H, W, 3) float32, whose mean is 1
    """

    lobes: np.ndarray
    constants: np.ndarray
    colours: np.ndarray

    def lit(self, directions: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
        """The picture (H, W, 3) float32 of the fit in light from M directions (M, 3) of irradiances (M, 3).

        Irradiances may be below 0.
        """
        picture = np.zeros((self.constants.size, 3), np.float32)
        lobes, towards, light = self.lobes.reshape(-1, 3), directions.T, np.asarray(irradiances, np.float64)
        constants, total = self.constants.reshape(-1).astype(np.float64), light.sum(axis=0)
        shown = np.flatnonzero(lobes.any(axis=1) | (constants > 0))
        for part in cut(len(shown), _PIXELS):
            pixels = shown[part]
            shading = np.maximum(lobes[pixels].astype(np.float64) @ towards, 0)
            picture[pixels] = shading @ light + constants[pixels, None] * total
        return picture.reshape(*self.constants.shape, 3) * self.colours

    def added(self, light: StageLighting, lights: StageLights, given: np.ndarray) -> np.ndarray:
        """What the fit adds (H, W, 3) to the sum of the field's pictures: the bracket of the module's equation.

        given : (N, 3), e_i, the light gathered by `Remainder`
        """
        directed = light.directed(LEAVES)
        directions = np.concatenate([directed.directions, lights.directions])
        return self.lit(directions, np.concatenate([directed.irradiances, -given]))


def needs_fit(lights: StageLights) -> bool:
    """Whether lights leave so much open that a fit helps: they stand far apart, or not on all sides."""
    return lights_width(lights) > SPARSE or float(reached(lights, even_directions(4096)).min()) < 1


def fit_diffuse(field: ReflectanceField, memory: int, progress: Progress | None = None) -> DiffuseFit:
    """The fit of each of a field's pixels; the field is read once, in bands of rows of so many bytes, one at least."""
    (height, width), count = field.shape, len(field.lights)
    rows = max(1, memory // 2 // (count * width * 3 * 4))
    found = []
    for band in cut(height, rows):
        values = field.block(slice(0, count), band).reshape(count, -1, 3)
        step = max(1, min(_PIXELS, memory // 2 // (count * _BYTES)))
        found += [fitted(values[:, part], field.lights.directions) for part in cut(values.shape[1], step)]
        if progress:
            progress(band.stop / height)
    lobes, constants, colours = (np.concatenate(each) for each in zip(*found, strict=True))
    return DiffuseFit(
        lobes.reshape(height, width, 3), constants.reshape(height, width), colours.reshape(height, width, 3)
    )


def fitted(values: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """b (P, 3), a (P,) and colours (P, 3), float32, of values (N, P, 3) under lights from directions (N, 3).

    Least squares, reweighted: values off the fit count ever less (Geman and McClure's weights, 1/(1 + d²)²). Lights
    that the lobe does not see speak of a alone, which is never below 0.
    """
    bright = values.mean(axis=-1, dtype=np.float64)
    terms = np.concatenate([directions, np.ones((len(directions), 1))], axis=1)
    weights, seen = np.where(bright > 0, 1.0, _LOOSE), np.ones(bright.shape, bool)
    found = np.zeros((bright.shape[1], 4))
    for _ in range(_ROUNDS):
        found = _solved(terms, bright, weights, seen)
        lobe = directions @ found[:, :3].T
        brightest = np.maximum(np.linalg.norm(found[:, :3], axis=1) + found[:, 3], 1e-30)
        departure = np.abs(bright - np.maximum(lobe, 0) - found[:, 3]) / (_WIDTH * brightest)
        weights, seen = 1 / (1 + np.minimum(departure, 1e4) ** 2) ** 2 + _LOOSE, lobe > 0
    total = np.maximum(values.sum(axis=0, dtype=np.float64), 0)
    level = total.mean(axis=-1, keepdims=True)
    colours = np.where(level > 0, total / np.where(level > 0, level, 1), 1.0)
    return tuple(np.asarray(each, np.float32) for each in (found[:, :3], found[:, 3], colours))  # type: ignore[return-value]


def _solved(terms: np.ndarray, bright: np.ndarray, weights: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """b and a, (P, 4), of the least weighted squares for values (N, P); with a = 0 where it would be below.

    seen : bool (N, P), the lights that the lobe sees; of the others only a is seen
    """
    count, size = terms.shape
    pairs = (terms[:, :, None] * terms[:, None, :]).reshape(count, -1)
    lit, dark = weights * seen, weights * ~seen
    matrices = (lit.T @ pairs).reshape(-1, size, size) + count * np.diag([_LOOSE / 10] * 3 + [_HELD])
    matrices[:, -1, -1] += dark.sum(axis=0)
    sides = (lit * bright).T @ terms
    sides[:, -1] += (dark * bright).sum(axis=0)
    found = np.linalg.solve(matrices, sides[..., None])[..., 0]
    below = found[:, 3] < 0
    found[below, :3] = np.linalg.solve(matrices[below, :3, :3], sides[below, :3, None])[..., 0]
    found[below, 3] = 0
    return found

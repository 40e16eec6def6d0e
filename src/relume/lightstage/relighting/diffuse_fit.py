"""What a few lights, or lights on one side alone, do not show: a Lambertian fit of each pixel, put right by the lights.

R(ω) ≈ M(ω) + Σ_i w_i(ω) (R_i − M_i), M(ω) = colour · (max(b · ω, 0) + a): a Lambertian surface, and light that reaches
it over others from wherever the lamp stands. b and a are fitted to the pixel's values under all lights, shadows and
highlights left out. What the fit leaves over is interpolated by kriging with a mean of 0 (`Remainder`): the picture of
a light in its own direction comes back as it was, between the lights the fit bends the interpolation to a cosine, and
beyond them the fit is left, without a seam, for w fades with the distance from the lights. The fit is a control
variate, as the direct light of a mesh is (`direct_light`), and this is kriging about a drift.

How strongly and how evenly a lamp shone, g_i times as strongly as the others as a whole, is its own affair: what its
neighbours are given of it is R_i − g_i M_i, and the rest, (g_i − 1) M_i, goes with weights a_i that end half way to
the next light. g_i is a plane over the picture: a lamp that is near, or aimed to one side, lights that side more.

A pixel's fit depends on the field alone, so that a picture stays linear in its light:
Σ_m E_m R(ω_m) = Σ_i e_i R_i + [Σ_m E_m M(ω_m) − Σ_i (g_i e_i − (g_i − 1) o_i) M_i] with e_i = Σ_m E_m w_i(ω_m) and
o_i = Σ_m E_m a_i(ω_m), a sum of the field's pictures and a picture of the fit. In its own direction a light has
e_i = o_i = 1, and R_i comes back. Directions are of the world, towards the light.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Remainder, lights_width, reached
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
_LOOSE = 1e-3
"""Weight of values that do not count, so that every pixel has a fit; and, a tenth of it, what the square of b costs."""
_PIXELS = 4096
"""Fitted or lit at once."""
_BYTES = 8 * 8
"""Of a value while it is fitted."""
_SAMPLE = 4096
"""Pixels of a field in which the lights' strengths are measured, about."""
_LIT = 0.2
"""Of the fit's brightest hundredth, above which a pixel shows how strongly a light shone."""
_OWN = 3.0
"""How much of the variance of strengths is each lamp's own, over what neighbours share; 1 … 10 are alike."""
_FEWEST = 20
"""Lit pixels that a strength needs."""
_EVEN = np.array([[[1.0], [0.0], [0.0]]]) * np.ones(3)
"""The strength of a light that is as strong as its neighbours, and even: (1, 3, 3)."""
_NARROW = 0.01
"""Lit pixels whose places vary by less than this, over half the picture squared, do not show a slope."""


@dataclass(frozen=True, eq=False)
class DiffuseFit:
    """The fit of each pixel of a field: M(ω) = colour · (max(b · ω, 0) + a).

    lobes : (H, W, 3) float32, b, of the mean of the channels
    constants : (H, W) float32, a, not below 0
    colours : (H, W, 3) float32, whose mean is 1
    strengths : (N, 3, 3), g by light, term and channel, how many times stronger each of the field's lights was than
        its neighbours: at the picture's middle (1 where unknown), and what is added to that from there to the right
        and downwards, over half the picture's longer side
    first_row : of the whole picture's, where these are some of its rows
    whole : rows and columns of that picture; the shape of these unless given
    """

    lobes: np.ndarray
    constants: np.ndarray
    colours: np.ndarray
    strengths: np.ndarray
    first_row: int = 0
    whole: tuple[int, int] | None = None

    def lit(self, directions: np.ndarray, irradiances: np.ndarray) -> np.ndarray:
        """The picture (H, W, 3) float32 of the fit in light from M directions (M, 3) of irradiances (M, 3).

        irradiances : or (M, 3, 3), that are planes over the picture as `strengths` are; they may be below 0
        """
        shape = self.constants.shape
        picture = np.zeros((self.constants.size, 3), np.float32)
        lobes, towards = self.lobes.reshape(-1, 3), directions.T
        light = np.asarray(irradiances, np.float64).reshape(len(directions), -1)
        constants, total = self.constants.reshape(-1).astype(np.float64), light.sum(axis=0)
        shown = np.flatnonzero(lobes.any(axis=1) | (constants > 0))
        for part in cut(len(shown), _PIXELS):
            pixels = shown[part]
            shading = np.maximum(lobes[pixels].astype(np.float64) @ towards, 0)
            terms = (shading @ light + constants[pixels, None] * total).reshape(len(pixels), -1, 3)
            places = _plane(pixels + self.first_row * shape[1], self.whole or shape)
            picture[pixels] = np.einsum("pt,ptc->pc", places[:, : terms.shape[1]], terms)
        return picture.reshape(*shape, 3) * self.colours

    def added(self, light: StageLighting, lights: StageLights, given: np.ndarray) -> np.ndarray:
        """What the fit adds (H, W, 3) to the sum of the field's pictures: the bracket of the module's equation.

        given : (N, 3), e_i, the light gathered by `Remainder`
        """
        return self.lit(*terms(self.strengths, light, lights, given))


def terms(
    strengths: np.ndarray, light: StageLighting, lights: StageLights, given: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Directions (M, 3) and irradiances (M, 3, 3) by which a fit of these strengths is lit in `DiffuseFit.added`."""
    directed = light.directed(LEAVES)
    directions = np.concatenate([directed.directions, lights.directions])
    own = light.irradiances(lights, Remainder().of_each_alone(lights))
    irradiances = np.zeros((len(directions), 3, 3))
    irradiances[: len(directed.directions), 0] = directed.irradiances
    # g e − (g − 1) o, with g a plane: o stands at the middle alone.
    irradiances[len(directed.directions) :] = -strengths * (given - own)[:, None]
    irradiances[len(directed.directions) :, 0] -= own
    return directions, irradiances


def needs_fit(lights: StageLights) -> bool:
    """Whether lights leave so much open that a fit helps: they stand far apart, or not on all sides."""
    return lights_width(lights) > SPARSE or float(reached(lights, even_directions(4096)).min()) < 1


def fit_diffuse(field: ReflectanceField, memory: int, progress: Progress | None = None) -> DiffuseFit:
    """The fit of each of a field's pixels; the field is read once, in bands of rows of so many bytes, one at least."""
    (height, width), count = field.shape, len(field.lights)
    rows, found = max(1, memory // 2 // (count * width * 3 * 4)), []
    for band in cut(height, rows):
        found.append(fitted_rows(field, band, memory))
        if progress:
            progress(band.stop / height)
    lobes, constants, colours = (np.concatenate([each[name] for each in found]) for name in FIT_MAPS)
    return DiffuseFit(lobes, constants, colours, strengths_in([each["sample"] for each in found], field))


FIT_MAPS = ("lobes", "constants", "colours")


def fitted_rows(field: ReflectanceField, band: slice, memory: int) -> dict[str, np.ndarray]:
    """The fit's maps in a band of rows, and "sample" (N + 3, P, 3): values of some of its pixels, and their fit.

    The fit's rows are b, a three times and the colours.
    """
    (height, width), count = field.shape, len(field.lights)
    apart = -(-height * width // _SAMPLE)
    values = field.block(slice(0, count), band).reshape(count, -1, 3)
    step = max(1, min(_PIXELS, memory // 2 // (count * _BYTES)))
    found = [fitted(values[:, part], field.lights.directions) for part in cut(values.shape[1], step)]
    lobes, constants, colours = (np.concatenate(each) for each in zip(*found, strict=True))
    chosen = slice(-(band.start * width) % apart, None, apart)
    fit = np.stack([lobes[chosen], np.repeat(constants[chosen, None], 3, axis=1), colours[chosen]])
    sample = np.concatenate([values[:, chosen], fit]).astype(np.float32)
    shape = (band.stop - band.start, width)
    return {
        "lobes": lobes.reshape(*shape, 3),
        "constants": constants.reshape(shape),
        "colours": colours.reshape(*shape, 3),
        "sample": sample,
    }


def strengths_in(samples: Sequence[np.ndarray], field: ReflectanceField) -> np.ndarray:
    """The lights' strengths (N, 3, 3) as of `DiffuseFit`, from the samples of a field's bands in their order."""
    (height, width), count = field.shape, len(field.lights)
    apart = -(-height * width // _SAMPLE)
    sample = np.concatenate(samples, axis=1)
    values, (lobes, constants, colours) = sample[:count], sample[count:]
    places = _plane(np.arange(0, height * width, apart), (height, width))
    strengths = strengths_of(values, field.lights.directions, lobes, constants[:, 0], colours, places)
    # What neighbours share is no lamp's own, as where a fit is too bright on one side.
    own = Remainder().own_part((strengths - _EVEN).reshape(count, -1), field.lights, _OWN)
    return _EVEN + own.reshape(strengths.shape)


def _plane(pixels: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """1, and how far pixels (P,), row by row, stand to the right of the picture's middle and below it: (P, 3)."""
    height, width = shape
    half = max(height, width) / 2
    right, below = (pixels % width + 0.5 - width / 2) / half, (pixels // width + 0.5 - height / 2) / half
    return np.stack([np.ones(len(pixels)), right, below], axis=-1)


def strengths_of(
    values: np.ndarray,
    directions: np.ndarray,
    lobes: np.ndarray,
    constants: np.ndarray,
    colours: np.ndarray,
    places: np.ndarray,
) -> np.ndarray:
    """How much stronger each light was than the fit says, (N, 3, 3) as `DiffuseFit.strengths`.

    values, lobes, constants, colours : (N, P, 3) and their fit (`fitted`)
    places : (P, 3), 1 and where the pixels are (`_plane`)
    A plane through value / fit over the pixels that the fit shows well lit, values off it counting ever less. It is a
    strength as far as these agree: with a middle half as wide as the median itself a quarter of the difference from 1
    is believed, and with a wider one nothing, for that is a shape which the fit does not have, as where a light from
    behind is shadowed.
    """
    found = np.repeat(_EVEN, len(values), axis=0)
    for strength, picture, towards in zip(found, values, directions, strict=True):
        fit = (np.maximum(lobes.astype(np.float64) @ towards, 0) + constants)[:, None] * colours
        bright = fit.mean(axis=-1)
        lit = bright > _LIT * np.quantile(bright, 0.99) if len(bright) else np.zeros(0, bool)
        if lit.sum() < _FEWEST:
            continue
        ratios = picture[lit] / np.maximum(fit[lit], 1e-3 * bright[lit, None])
        middle = np.median(ratios, axis=0)
        plane = _plane_through(places[lit], ratios, middle)
        low, high = np.quantile(ratios - places[lit] @ plane, [0.25, 0.75], axis=0)
        width = (high - low) / np.maximum(middle, 1e-30)
        strength += (plane - _EVEN[0]) / (1 + np.minimum(width, 1e4) ** 2) ** 2
    return found


def _plane_through(places: np.ndarray, ratios: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Planes (3, 3) over places (P, 3) by least squares to ratios (P, 3), reweighted from their medians (3,) on."""
    plane = np.stack([middle, np.zeros(3), np.zeros(3)])
    level = len(ratios) * _NARROW * np.diag([0.0, 1.0, 1.0])
    for _ in range(_ROUNDS):
        departure = np.minimum(np.abs(ratios - places @ plane) / _WIDTH, 1e4)
        weights = 1 / (1 + departure**2) ** 2 + _LOOSE
        weighted = (places[:, :, None] * weights[:, None, :]).transpose(2, 1, 0)
        sides = (weighted @ ratios.T[:, :, None])[..., 0]
        plane = np.linalg.solve(weighted @ places + level, sides[..., None])[..., 0].T
    return plane


def fitted(values: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """b (P, 3), a (P,) and colours (P, 3), float32, of values (N, P, 3) under lights from directions (N, 3).

    b by least squares over the lights that it sees, reweighted: values off the fit count ever less (Geman and McClure's
    weights, 1/(1 + d²)²). a is the median under the lights that b does not see, where they are as many as in a full
    stage, and fades to 0 where b sees all: among lights on one side a and b are alike, and what b can explain is b's.
    """
    bright = values.mean(axis=-1, dtype=np.float64)
    weights, constants = np.where(bright > 0, 1.0, _LOOSE), np.zeros(bright.shape[1])
    lobes = np.zeros((bright.shape[1], 3))
    for _ in range(_ROUNDS):
        lobes = _solved(directions, bright - constants, weights)
        seen = directions @ lobes.T
        constants = _median_of_the_rest(bright, seen > 0)
        brightest = np.maximum(np.linalg.norm(lobes, axis=1) + constants, 1e-30)
        departure = np.abs(bright - np.maximum(seen, 0) - constants) / (_WIDTH * brightest)
        weights = (seen > 0) / (1 + np.minimum(departure, 1e4) ** 2) ** 2 + _LOOSE
    total = np.maximum(values.sum(axis=0, dtype=np.float64), 0)
    level = total.mean(axis=-1, keepdims=True)
    colours = np.where(level > 0, total / np.where(level > 0, level, 1), 1.0)
    return lobes.astype(np.float32), constants.astype(np.float32), colours.astype(np.float32)


def _solved(directions: np.ndarray, bright: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Lobes (P, 3) of the least weighted squares for values (N, P)."""
    pairs = (directions[:, :, None] * directions[:, None, :]).reshape(-1, 9)
    matrices = (weights.T @ pairs).reshape(-1, 3, 3) + len(directions) * _LOOSE / 10 * np.eye(3)
    return np.asarray(np.linalg.solve(matrices, ((weights * bright).T @ directions)[..., None])[..., 0])


def _median_of_the_rest(bright: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """The lower median (P,) of values (N, P) that are not seen, not below 0, times (2 · their share)² up to 1.

    Half of a full stage's lights are not seen. Of few, one light more or less would change a by all of it, and pixels
    beside each other would differ.
    """
    rest = np.sort(np.where(seen, np.inf, bright), axis=0)
    count = (~seen).sum(axis=0)
    middle = np.take_along_axis(rest, np.maximum(count - 1, 0)[None] // 2, axis=0)[0]
    return np.where(count > 0, np.maximum(middle, 0), 0.0) * np.minimum(2 * count / len(bright), 1) ** 2

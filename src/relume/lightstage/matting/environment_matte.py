"""Environment mattes: how a subject lets the backdrop behind it be seen, by reflection and refraction, pixel by pixel.

A pixel is C = F + (1 − α) · M(straight) + Σ R_j · M(area j), j = 1, 2: F the light that is there before black, M the
mean of the backdrop over an area, α the part of the pixel that is covered, so that 1 − α is seen straight through, and
R the colour that transmission or reflection gives to the rest (Zongker et al. 1999; Debevec et al. 2000, appendix).
Areas are boxes (middle u, width, middle v, width) in parts of the backdrop: u from its left edge to the right, v from
its upper edge down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.errors import warn
from relume.lightstage.matting import fitting
from relume.lightstage.matting.gray_code import Patterns, disorder

_DARK = 0.02
"""Of the median pixel's light from a white backdrop: below it readings are noise."""
_SECOND_AREA_ABOVE = 0.03
"""The rms misfit of readings, 0 to 1, from which a second area is sought; at 0.02 half as many pixels again get one,
mostly of noise, and composites are no better by a tenth of a decibel."""
_SECOND_AREA_GAIN = 0.75
"""A second area is kept where it leaves at most this part of the misfit: its five more numbers always fit a little
better."""
_STRAIGHT_WITHIN = 1.0
"""Texels, the readings' own step: how far from where nothing in the way would show it an area counts as seen straight
through."""


@dataclass(frozen=True, eq=False)
class EnvironmentMatte:
    """What every pixel shows of the backdrop.

    foreground : (H, W, 3) float32, radiance before a black backdrop
    coverage : (H, W) float32, α, 0 where the backdrop is seen straight and whole, 1 where nothing is
    straight : (H, W, 4) float32, the area seen where nothing is in the way; widths are 0 where it is unknown
    areas : (2, H, W, 4) float32, of what is reflected or refracted; widths are 0 where there is none
    colours : (2, H, W, 3) float32, R; 0 where there is none
    residual : (H, W) float32, how sure: the rms by which pixels before the patterns differed from what the matte
        makes of them, for stripes of brightness 1; 0 is perfectly explained
    texels : of the backdrop it was taken with, across and down
    """

    foreground: np.ndarray
    coverage: np.ndarray
    straight: np.ndarray
    areas: np.ndarray
    colours: np.ndarray
    residual: np.ndarray
    texels: tuple[int, int]

    def __post_init__(self) -> None:
        shape = self.foreground.shape[:2]
        expected = {
            "foreground": (*shape, 3),
            "coverage": shape,
            "straight": (*shape, 4),
            "areas": (2, *shape, 4),
            "colours": (2, *shape, 3),
            "residual": shape,
        }
        for name, wanted in expected.items():
            array = getattr(self, name)
            if array.shape != wanted or array.dtype != np.float32:
                raise ValueError(f"{name} is {array.shape} {array.dtype}; expected {wanted} float32")

    @property
    def shape(self) -> tuple[int, int]:
        """The rows and columns of the matte."""
        return self.coverage.shape[0], self.coverage.shape[1]


_SEEN = 0.05
"""Of the pixels, how many have to see the backdrop straight before they are believed: fewer agree by chance."""


def environment_matte(patterns: Patterns) -> EnvironmentMatte:
    """The matte that explains pictures of a subject before striped backdrops.

    patterns : pictures of the subject before stripes, black and white, as `read_patterns` gives them

    The brightness of the backdrop's white is what the camera sees of it straight through, a quadratic over the picture,
    so that a screen or lens darker at its edges does no harm. It is the 1 of every backdrop that the subject is
    composited over. Where nothing is seen straight through it is the brightest percent of pixels, with a warning, and
    coverage is 1.

    Raises ValueError for patterns out of order. Source: Zongker et al. 1999; Debevec et al. 2000, appendix.
    """
    if wrong := disorder(patterns):
        raise ValueError(wrong)
    shape = patterns.black.shape[:2]
    # One box per pixel, along x and along y.
    searches = fitting.search_along(patterns, "x"), fitting.search_along(patterns, "y")
    order = np.concatenate([search.pictures for search in searches])
    light = (patterns.white - patterns.black).reshape(-1, 3)
    readings = _readings(patterns, order)
    along = [
        fitting.fitted_near(own, search, fitting.fitted_alone(own, search), shape)
        for own, search in zip(np.split(readings, [len(searches[0].pictures)], axis=1), searches, strict=True)
    ]
    single = np.concatenate([along[0][:, :2], along[1][:, :2]], axis=1)
    misfit = (along[0][:, 2] + along[1][:, 2]) / readings.shape[1]

    # Pixels that see the backdrop straight, and its white.
    dark = light.sum(axis=1) < _DARK * np.median(light.sum(axis=1))
    plain, seen = _seen_straight(single, np.where(dark, np.inf, misfit), shape)
    level = _level(light, seen, shape)

    # Two boxes where one does not explain the readings.
    areas = np.stack([single, np.zeros_like(single)])
    shares = np.stack([np.ones_like(light), np.zeros_like(light)])
    hard = np.flatnonzero((misfit > _SECOND_AREA_ABOVE**2) & ~dark)
    if len(hard):
        start = np.full((len(hard), 4), np.nan, np.float32) if plain is None else plain[hard]
        coarse = fitting.search_along(patterns, "x", 2), fitting.search_along(patterns, "y", 2)
        both, share, left = fitting.fitted_together(readings[hard], coarse, hard, single, start, shape)
        better = left / readings.shape[1] < _SECOND_AREA_GAIN**2 * misfit[hard]
        chosen = hard[better]
        areas[:, chosen] = both[:, better]
        stripes = patterns.pictures.reshape(len(order), -1, 3)[order][:, chosen]
        first = _first_shares(patterns, stripes, chosen, fitting.readings_of(both[:, better], searches), share[better])
        shares[:, chosen] = first, 1 - first
    colours = (shares * np.maximum(light, 0) / level).astype(np.float32)
    # Where stripes cannot be read there is nothing to place: what little light there is comes from all around.
    whole = np.array([0.5, 1, 0.5, 1], np.float32) * np.repeat(patterns.texels, 2).astype(np.float32)
    areas[0, dark] = whole
    residual = _residual(patterns, order, fitting.readings_of(areas, searches), colours * level, level)

    # What is seen straight is no part of the subject.
    coverage = np.ones(len(light), np.float32)
    if plain is not None:
        coverage, colours = _uncovered(areas, colours, plain, shape)
    areas[colours.max(axis=2) <= 0] = 0
    parts = np.repeat(np.array(patterns.texels, np.float32), 2)
    straight = np.zeros((len(light), 4), np.float32) if plain is None else plain / parts
    return EnvironmentMatte(
        patterns.black.astype(np.float32),
        coverage.reshape(shape),
        straight.reshape(*shape, 4).astype(np.float32),
        (areas / parts).reshape(2, *shape, 4).astype(np.float32),
        colours.reshape(2, *shape, 3),
        residual.reshape(shape),
        patterns.texels,
    )


def _readings(patterns: Patterns, order: np.ndarray) -> np.ndarray:
    """(P, K) float32, 0 to 1, of all channels together, pictures in an order (K,); ½ where there is no light."""
    light = (patterns.white - patterns.black).sum(axis=2).ravel()
    lit = light > 1e-3 * np.median(light)
    readings = np.full((len(light), len(order)), 0.5, np.float32)
    for place, index in enumerate(order):
        stripes = (patterns.pictures[index] - patterns.black).sum(axis=2).ravel()
        readings[lit, place] = np.clip(stripes[lit] / light[lit], 0, 1)
    return readings


def _seen_straight(
    single: np.ndarray, misfit: np.ndarray, shape: tuple[int, ...]
) -> tuple[np.ndarray | None, np.ndarray]:
    """What each pixel would see with nothing in the way (P, 4), texels, and which pixels (P,) do see that.

    The backdrop is a plane: pixels that see it straight agree on one homography, found by random sampling. Warns and
    gives None where too few do.
    """
    import cv2

    height, width = shape
    middles, nothing = single[:, ::2].astype(np.float64), np.zeros(len(single), bool)
    pixels = np.stack([np.arange(len(single)) % width + 0.5, np.arange(len(single)) // width + 0.5], axis=1)
    good = np.flatnonzero(misfit < _SHARP**2)
    if len(good) < _FEWEST:
        warn("hardly any pixel's stripes could be read; is the subject sharp, and still?")
        return None, nothing
    sample = good[:: max(1, len(good) // 20000)]
    homography, _ = cv2.findHomography(
        pixels[sample], middles[sample], cv2.RANSAC, 1.0, maxIters=5000, confidence=0.9999
    )
    near, plain = nothing.copy(), middles
    if homography is not None:
        projected = np.column_stack([pixels, np.ones(len(pixels))]) @ homography.T
        if projected[:, 2].min() > 0:  # else its horizon runs through the picture, which no backdrop's does
            plain = projected[:, :2] / projected[:, 2:]
            near[good] = np.abs(plain[good] - middles[good]).max(axis=1) < 1
    if np.count_nonzero(near) < max(_FEWEST, _SEEN * len(single)):
        warn(
            "no part of the backdrop is seen straight through, so its white is not known; the brightest pixels are "
            "taken for it"
        )
        return None, nothing
    if homography is not None and np.linalg.det(homography[:2, :2]) < 0:
        warn("the backdrop is seen mirrored; were the pictures or the patterns flipped?")
    # A pixel's footprint is that of the map times what lens and filter add, which the narrow boxes show.
    columns = plain.reshape(height, width, 2)
    down, right = (np.asarray(np.gradient(columns, axis=axis)) for axis in range(2))
    steps = np.hypot(down, right).reshape(-1, 2).T
    wide = [step * np.median(single[near, 2 * axis + 1] / step[near]) for axis, step in enumerate(steps)]
    return np.stack([plain[:, 0], wide[0], plain[:, 1], wide[1]], axis=1).astype(np.float32), near


_SHARP, _FEWEST = 0.05, 64
"""The rms misfit above which a box gives no sharp place, and how many places any map of the backdrop needs."""


def _level(light: np.ndarray, seen: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """The radiance (P, 3) of a white backdrop seen straight through: a quadratic through the pixels that see it so."""
    if not seen.any():
        brightest = np.percentile(light, 99, axis=0)
        return np.broadcast_to(np.maximum(brightest, 1e-9), light.shape)
    height, width = shape
    y, x = (np.stack(np.divmod(np.arange(len(light)), width)) + 0.5) / np.array([[height], [width]]) - 0.5
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
    # A thin rim of the subject may be seen straight through and darker: left out by the second fit.
    middle = np.median(light[seen], axis=0)
    near = seen & (np.abs(light - middle).max(axis=1) < 0.3 * middle.max())
    found = np.linalg.lstsq(terms[near], light[near], rcond=None)[0]
    bounds = light[seen].min(axis=0), light[seen].max(axis=0)
    return np.maximum(np.clip(terms @ found, *bounds), 1e-3 * middle.max())


def _first_shares(
    patterns: Patterns, stripes: np.ndarray, chosen: np.ndarray, reads: np.ndarray, share: np.ndarray
) -> np.ndarray:
    """The share (P, 3) of each channel's light that the first of two areas gave, near the one of all channels (P,).

    stripes : (K, P, 3), the chosen pixels before the patterns, of which the two areas read (2, P, K)
    """
    apart = reads[0] - reads[1]
    black = patterns.black.reshape(-1, 3)[chosen]
    light = np.maximum(patterns.white.reshape(-1, 3)[chosen] - black, 1e-6)
    readings = np.clip((stripes - black) / light, 0, 1)
    first = np.einsum("pk,kpc->pc", apart, readings - reads[1].T[..., None]) + _HELD * share[:, None]
    return np.clip(first / (np.sum(apart**2, axis=1) + _HELD)[:, None], 0, 1)


_HELD = 0.5
"""How many readings' worth the share of all channels counts in that of one: where areas read alike it decides."""


def _residual(
    patterns: Patterns, order: np.ndarray, reads: np.ndarray, light: np.ndarray, level: np.ndarray
) -> np.ndarray:
    """The rms (P,) by which pictures differ from what areas that read so much make of them, in units of the level."""
    black, squares = patterns.black.reshape(-1, 3), np.zeros(len(level))
    for place, index in enumerate(order):
        made = black + reads[0, :, place, None] * light[0] + reads[1, :, place, None] * light[1]
        squares += np.mean(((patterns.pictures[index].reshape(-1, 3) - made) / level) ** 2, axis=1)
    return np.sqrt(squares / len(order)).astype(np.float32)


def _uncovered(
    areas: np.ndarray, colours: np.ndarray, plain: np.ndarray, shape: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Coverage (P,) and colours (2, P, 3) once what is seen straight through is taken out of the areas.

    The colourless part of an area that lies where it would without the subject was not covered, where pixels that see
    it whole are near; elsewhere, as amid a lens, the subject shows by chance what is behind it.
    """
    from scipy import ndimage

    reach = np.maximum(_STRAIGHT_WITHIN, 0.5 * plain[:, 1::2])
    there = np.all(np.abs(areas[..., ::2] - plain[:, ::2]) <= reach, axis=2)
    there &= np.all(areas[..., 1::2] <= 2 * plain[:, 1::2] + 1, axis=2)
    full = there & (np.abs(colours - 1).max(axis=2) < _FULL)
    open_field = ndimage.binary_opening(full.any(axis=0).reshape(shape), np.ones((3, 3)))
    near = ndimage.binary_dilation(open_field, iterations=2).ravel()
    there, full = there & near, full & near
    left, through = colours.copy(), np.zeros(len(plain), np.float32)
    for which, colour in enumerate(colours):
        grey = np.where(there[which], np.minimum(colour.min(axis=1), 1 - through), 0)
        left[which] = np.where(full[which][:, None], 0, colour - grey[:, None])
        through += np.where(full[which], 1 - through, grey)
    return 1 - through, left


_FULL = 0.03
"""A pixel whose backdrop is within this part of its white shows all of it: noise is no veil."""

"""The chromaticity of what is reflected: the light's own at the surface, the body's from below it.

Chromaticities are unit RGB vectors. The body's moves with the angles of light and view along a ramp between two
saturations (Debevec et al. 2000, eq. 6, 7). Pixels are (P,), lights (N, P).
"""

from __future__ import annotations

import numpy as np

LOWEST, HIGHEST = -0.6, 1.0
"""Bounds of α0 and α1: at −1 the body would have the light's own colour and nothing could be separated, at 1 its
distance from that is doubled."""
COARSE, HALVINGS = 9, 5
"""Candidates along each parameter at first, and times that the search closes in about the best by half."""
BINS = 12
"""In which the products cos θi cos θr are gathered, since the ramp knows nothing else of a light."""


def unit_chromaticity(colour: np.ndarray) -> np.ndarray:
    """Colours (…, 3) scaled to unit length; black stays black."""
    length = np.sqrt(np.einsum("...c,...c->...", colour, colour))[..., None]
    return np.asarray(np.divide(colour, length, out=np.zeros_like(colour), where=length > 0))


def median_chromaticity(values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """The chromaticity (P, 3) whose ratios red to green and green to blue are the medians over the chosen lights.

    values : (N, P, 3); chosen : bool (N, P). Black where nothing is chosen.
    Source: Debevec et al. 2000, §4.2.
    """
    red, green, blue = np.maximum(np.moveaxis(values, -1, 0), 0)
    red_green, green_blue = _median(_ratio(red, green), chosen), _median(_ratio(green, blue), chosen)
    colour = np.stack([red_green * green_blue, green_blue, np.ones_like(green_blue)], axis=-1)
    known = np.asarray(chosen.any(axis=0))[:, None]
    return np.where(known, unit_chromaticity(colour), 0).astype(values.dtype)


def _ratio(upper: np.ndarray, lower: np.ndarray) -> np.ndarray:
    """A ratio that stays finite for colours of one primary; 0 to 0 is 1."""
    least = 1e-6 * (upper + lower) + 1e-30
    return (upper + least) / (lower + least)


def _median(values: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    ordered = np.sort(np.where(chosen, values, np.inf), axis=0)
    count = chosen.sum(axis=0)
    middle = [np.take_along_axis(ordered, np.maximum(at, 0)[None], axis=0)[0] for at in ((count - 1) // 2, count // 2)]
    return np.where(count > 0, (middle[0] + middle[1]) / 2, 1)


def ramp(alpha: np.ndarray, cosines: np.ndarray) -> np.ndarray:
    """f(θi, θr) of parameters (…, 2) and cos θi · cos θr (…): α0 cc + α1 (1 − cc) (Debevec et al. 2000, eq. 7)."""
    return np.asarray(alpha[..., 0] * cosines + alpha[..., 1] * (1 - cosines))


def ramped(body: np.ndarray, light: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """normalize(d0 + f (d0 − s)) for body chromaticity d0 (…, 3), light s (3,), shift f (…) (eq. 6)."""
    return unit_chromaticity(body + shift[..., None] * (body - light))


def amounts(values: np.ndarray, body: np.ndarray, light: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """μd, μs and μe with values = μd d + μs s + μe (d × s), and so the inverse of the matrix of these three columns.

    values : (…, 3); body d (…, 3) and light s (3,) are unit vectors
    Where d and s are parallel there is no answer: NaN.
    Source: Debevec et al. 2000, §4.2; written with the dual basis, since d × s is perpendicular to both.
    """
    cosine = body @ light
    along_body, along_light = np.einsum("...c,...c->...", values, body), values @ light
    error = np.cross(body, light)
    square = np.einsum("...c,...c->...", error, error)
    square = np.where(square > 0, square, np.nan)
    of_body = (along_body - cosine * along_light) / square
    of_light = (along_light - cosine * along_body) / square
    return of_body, of_light, np.einsum("...c,...c->...", values, error) / square


def fitted_ramp(
    values: np.ndarray, weights: np.ndarray, cosines: np.ndarray, body: np.ndarray, light: np.ndarray
) -> np.ndarray:
    """α0 and α1 (P, 2) whose chromaticities lie nearest those of the values, by least squares, coarse to fine.

    values : (N, P, 3); weights, cosines (cos θi · cos θr, from 0 to 1) : (N, P); body : (P, 3); light : (3,)
    Values count as they are bright. 0, 0 where no weight is.
    Source: Debevec et al. 2000, §4.2.
    """
    sums, centres = _gathered(values, weights, cosines)
    # Σ w |r/|r| − d|² is least where Σ w r/|r| · d is greatest, for unit d.
    step = (HIGHEST - LOWEST) / (COARSE - 1)
    best = _best(np.zeros((len(body), 2)), np.linspace(LOWEST, HIGHEST, COARSE), sums, centres, body, light)
    for _ in range(HALVINGS):
        step /= 2
        best = _best(best, np.array([-step, 0, step]), sums, centres, body, light)
    known = np.asarray(weights.any(axis=0))[:, None]
    return np.where(known, best, 0).astype(np.float32)


def _gathered(values: np.ndarray, weights: np.ndarray, cosines: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums of weighted values (BINS, P, 3) and mean cosines (BINS, P)."""
    place = np.clip((cosines * BINS).astype(int), 0, BINS - 1)
    sums, centres = [], []
    for index in range(BINS):
        within = np.where(place == index, weights, 0)
        sums.append(np.einsum("np,npc->pc", within, values))
        total = within.sum(axis=0)
        mean = np.einsum("np,np->p", within, cosines) / np.maximum(total, 1e-30)
        centres.append(np.where(total > 0, mean, (index + 0.5) / BINS))
    return np.stack(sums), np.stack(centres)


def _best(
    about: np.ndarray, offsets: np.ndarray, sums: np.ndarray, centres: np.ndarray, body: np.ndarray, light: np.ndarray
) -> np.ndarray:
    """The best of the candidates at these offsets (K,) about each pixel's parameters (P, 2)."""
    best, likeness = about, np.full(len(about), -np.inf)
    for first in offsets:
        for second in offsets:
            alpha = np.clip(about + np.array([first, second]), LOWEST, HIGHEST)
            found = np.einsum("bpc,bpc->p", sums, ramped(body, light, ramp(alpha, centres)))
            better = found > likeness
            best, likeness = np.where(better[:, None], alpha, best), np.where(better, found, likeness)
    return best

"""The weights by which a blur gathers pixels: of a Gaussian, and of light that moves along a straight line."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

REACH = 8.0
"""Deviations to which a Gaussian is followed: light a million times brighter than its surroundings ends unseen."""


def gaussian_taps(sigma: float) -> np.ndarray:
    """Weights of the middle pixel and of its neighbours to one side: the Gaussian's share of each pixel's width.

    sigma : standard deviation, pixels
    None is negative, and on both sides together they sum to 1.
    """
    from scipy.special import erf

    if sigma == 0:
        return np.ones(1)
    edges = (np.arange(int(np.ceil(REACH * sigma)) + 2) - 0.5) / (sigma * np.sqrt(2))
    taps = np.diff(erf(edges)) / 2
    return taps / (taps[0] + 2 * taps[1:].sum())


def mirrored_transfer(taps: np.ndarray, size: int) -> np.ndarray:
    """By what symmetric taps scale each cosine wave (size,) of a line of pixels that goes on as its mirror image.

    taps : of the middle pixel and of its neighbours to one side
    """
    from scipy.fft import rfft

    # Far taps fall on the same pixels again, mirrored and mirrored back.
    folded = np.zeros(2 * size)
    places = np.arange(len(taps))
    np.add.at(folded, places % (2 * size), taps)
    np.add.at(folded, -places[1:] % (2 * size), taps[1:])
    return np.real(np.asarray(rfft(folded)))[:size]


def line_weights(
    dx: float,
    dy: float,
    light: Callable[[np.ndarray], np.ndarray] = np.ones_like,
    bends: Sequence[float] = (-0.5, 0.5),
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows and columns (N,) int64 relative to a pixel, and the weights (N,) float64, sum 1, that it gathers from there
    while it moves evenly by `dx` pixels right and `dy` down and the picture is bilinear between its pixels.

    light : let through at times from −½ to ½, all the same unless given
    bends : the times between which `light` is straight, first and last included

    They are exact: between crossings of the pixel lattice and bends of the light the bilinear weight times the light is
    a cubic of the time, which two Gauss–Legendre nodes integrate (Abramowitz & Stegun 1964, 25.4.29).
    """
    bounds = [np.array(bends)]
    for extent in (abs(dx), abs(dy)):
        if extent > 0:
            lattice = np.arange(-np.floor(extent / 2), np.floor(extent / 2) + 1)
            bounds.append(np.clip(lattice / extent, -0.5, 0.5))
    times = np.unique(np.concatenate(bounds))
    middle, radius = (times[1:] + times[:-1]) / 2, np.diff(times) / 2
    moments = (middle[:, None] + radius[:, None] * np.array([-1, 1]) / np.sqrt(3)).ravel()
    spent = np.repeat(radius, 2) * light(moments)
    x, y = moments * dx, moments * dy
    left, above = np.floor(x), np.floor(y)
    rows, columns, weights = [], [], []
    for down in (0, 1):
        for right in (0, 1):
            rows.append(above + down)
            columns.append(left + right)
            weights.append(spent * np.abs(1 - right - (x - left)) * np.abs(1 - down - (y - above)))
    places, index = np.unique(np.stack([np.concatenate(rows), np.concatenate(columns)]), axis=1, return_inverse=True)
    summed = np.bincount(index.ravel(), np.concatenate(weights), places.shape[1])
    kept = summed > 1e-12
    taps = places[:, kept].astype(np.int64)
    return taps[0], taps[1], summed[kept] / summed[kept].sum()

"""The star that an iris draws about a light: Fraunhofer diffraction, near the light exactly, far from it by edges.

The light at x, in pixels, is |F(2π x / q)|² / (q² A) with the transform F of an opening of area A and diameter 1, and
q = λ N / pitch, the width of an order of diffraction in pixels (Goodman 2005). Far from the light an opening
is its edges: a straight one of length L gives (k·ν)² L² sinc²(k·τ L / 2) / |k|⁴ along its normal ν (Keller 1962; the
transform of a polygon is a sum over edges: Lee & Mittra 1983). There the fringes between edges are finer than
the band of wavelengths that a colour holds, so their lights add. A curved edge is a fan of short straight ones.
"""

from __future__ import annotations

import numpy as np

from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.lens.glare.point_spread import waves_of

FRINGES = 12.0
"""Orders of diffraction from the light at which those of a colour's wavelengths no longer agree: 500 nm over the
60 nm that a primary spans, with some more."""
MOST = 96
"""Pixels round the light that are computed exactly at the most."""
LEAST = 0.12
"""Pixels per order below which a star is drawn by its law far away."""
CELLS = 320
"""Across the drawn iris: fine enough for 80 orders, three times what is drawn."""
PER_ORDER = 8.0
"""Samples; fringes are as fine as an order, which a cubic then follows within a thousandth."""


def far_radial(blades: Blades, order: np.ndarray, distances: np.ndarray) -> np.ndarray:
    """(N, distances) mean light per pixel on a circle about the point, for orders of `order` (N,) pixels.

    2 P / (k³ q² A) with k = 2π r / q and the opening's perimeter P: what a circle's Airy pattern has in the mean too.
    """
    perimeter, area = blades.edges * blades.edge, np.pi / 4
    return perimeter * order[:, None] / (4 * np.pi**3 * area * np.maximum(distances, 1e-3) ** 3)


def star(blades: Blades, order: np.ndarray, shares: np.ndarray, distances: np.ndarray, angles: int) -> np.ndarray:
    """(distances, angles) light over that mean, over half a turn, of light in which orders of `order` (N,) pixels have
    `shares` (N,).

    As a series in the angle every step is a product: sinc² is a triangle, a pixel and a fan are sincs. All factors
    are transforms of positive functions, and so is the result.
    """
    waves = waves_of(angles)
    # Patterns count angles from the right downwards.
    rays = np.exp(1j * waves * blades.normals[:, None]).mean(0)
    rays *= np.sinc(waves * blades.half_arc / np.pi)
    # The table's own step, twice: no ray is finer than what linear interpolation can draw.
    rays *= np.sinc(waves / (2 * angles)) ** 2 * (1 - waves / waves[-1])
    away = np.maximum(distances, 1e-3)[:, None]
    pixel = np.sinc(waves / (2 * np.pi * away))
    # A ray is as wide as the transform of its edge: L / q waves per pixel across, r pixels per radian. Each order's
    # triangle ends where 1 / q is reached; their sum is linear between these ends. Long waves have more light far away.
    ends = np.concatenate([[0.0], np.sort(1 / order)])
    weights = shares * order / (shares @ order)
    sums = np.maximum(1 - ends[:, None] * order, 0) @ weights
    # Along a curved edge light adds over the first zone of Fresnel alone, where it strays by a quarter of a wave.
    length = np.minimum(blades.edge, np.sqrt(2 * blades.edge_radius * (shares @ order) / away))
    width = np.interp(waves / (2 * np.pi * length * away), ends, sums, right=0.0)
    return np.maximum(np.fft.irfft(width * pixel * rays, angles, axis=1) * angles, 0)


def near_light(blades: Blades, order: np.ndarray, reach: int) -> np.ndarray:
    """(N, 2 reach + 1, 2 reach + 1) light per pixel about the point, for orders of `order` (N,) pixels.

    One pattern in orders serves all: pixels are means over it, each order's of another size. Orders below LEAST leave
    all fringes within the middle pixel; about it their light is in proportion to the order, as far away.
    """
    drawn = np.maximum(order, LEAST)
    most = int(np.ceil((reach + 0.5) / drawn.min() * PER_ORDER)) + 2
    pattern = _pattern(blades, most)
    lights = np.empty((len(order), 2 * reach + 1, 2 * reach + 1))
    for light, one in zip(lights, drawn, strict=True):
        means = _pixel_means(one / PER_ORDER, reach, most)
        light[:] = means @ pattern @ means.T / one**2
    middle = lights[:, reach, reach].copy()
    lights *= (order / drawn)[:, None, None]
    lights[:, reach, reach] = 1 - (1 - middle) * order / drawn
    return lights


def _pattern(blades: Blades, most: int) -> np.ndarray:
    """(2 most + 1, 2 most + 1) |F|² / A at every 1 / PER_ORDER of an order."""
    opening = blades.draw(CELLS)
    cell = 2 * blades.corner / CELLS
    across = (np.arange(CELLS) + 0.5) * cell - blades.corner
    places = np.arange(-most, most + 1) / PER_ORDER
    # A cell is a square and not a point: its own transform weighs the far orders.
    waves = np.exp(-2j * np.pi * np.outer(places, across)) * (np.sinc(places * cell)[:, None] * cell)
    below = waves[most:]
    spectrum = (below.real @ opening + 1j * (below.imag @ opening)) @ waves.T
    half = (spectrum.real**2 + spectrum.imag**2) / (opening.sum() * cell**2)
    # An opening that only dims has the same light at x and −x.
    return np.concatenate([half[:0:-1, ::-1], half])


def _pixel_means(step: float, reach: int, most: int) -> np.ndarray:
    """(2 reach + 1, 2 most + 1) means over pixels of what is given every `step` pixels, by Catmull and Rom's cubic."""
    fine = max(4, int(np.ceil(2 / step)))
    size = 2 * reach + 1
    place = ((np.arange(size * fine) + 0.5) / fine - reach - 0.5) / step + most
    cell = np.floor(place).astype(np.intp)
    t = place - cell
    cubic = (
        t * (-0.5 + t * (1 - 0.5 * t)),
        1 + t * t * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2 - 1.5 * t)),
        t * t * (-0.5 + 0.5 * t),
    )
    means = np.zeros((size, 2 * most + 1))
    pixel = np.repeat(np.arange(size), fine)
    for offset, weight in enumerate(cubic, start=-1):
        np.add.at(means, (pixel, np.minimum(cell + offset, 2 * most)), weight / fine)
    return means


def near_reach(order: float) -> int:
    """Pixels round the light within which fringes are seen."""
    return int(np.clip(np.ceil(FRINGES * order), 4, MOST))

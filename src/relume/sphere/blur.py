"""Soft blur of light on the sphere itself: as wide at the poles as at the horizon, and across the seam.

The kernel is von Mises and Fisher's, exp((cos γ − 1)/σ²), the sphere's Gaussian: positive everywhere, a function of
the angle γ alone. Between pixel centres of a lat-long map it is a circular convolution along the longitude for every
pair of rows. Its sums over pixels are not quite 1; they are balanced row by row (Sinkhorn & Knopp 1967, the symmetric
case), so that constant light stays constant and the total is kept, both to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from scipy.fft import irfft, rfft

from relume.image.blurring import streak_kernel
from relume.image.filtering import Spread, spread_clipped
from relume.sphere.illumination import IlluminationMap
from relume.sphere.mappings import LatLong

_FAINT = 37.0
"""−ln of the share of the peak beyond which the kernel is left out: double precision's own."""
_ROUNDS = 200


def blurred(light: IlluminationMap, sigma: float, *, share: float = 1.0) -> IlluminationMap:
    """The light out of focus by `sigma` in all directions; with a share below 1 sharp light with a glow.

    light : in any mapping; one that is no lat-long map is blurred as such and laid out again, energy kept
    sigma : radians, of the Gaussian that the kernel is for small angles; 0 to π
    share : of the light that is blurred; 1 is all of it

    The total is kept to rounding, per channel. Raises ValueError for another sigma or share.
    """
    if not 0 <= sigma <= np.pi:
        raise ValueError(f"sigma is {np.degrees(sigma):g}°; expected 0 to 180°")
    if not 0 <= share <= 1:
        raise ValueError(f"the share is {share:g}; expected 0 to 1")
    if sigma == 0 or share == 0:
        return light

    def glow(rows: int) -> Spread:
        blur = _spherical(rows, sigma)
        return lambda field: (1 - share) * field + share * blur(field)

    return _spread_as_latlong(light, glow)


def spun(light: IlluminationMap, angle: float) -> IlluminationMap:
    """The light as a shutter sees it while it turns about the vertical at an even speed: motion blur of a light map.

    light : in any mapping; one that is no lat-long map is blurred as such and laid out again, energy kept
    angle : radians, of the whole turn, half of it before the light's own place and half after; 0 to 2π

    The light of every row is kept to rounding. Raises ValueError for another angle.
    """
    if not 0 <= angle <= 2 * np.pi:
        raise ValueError(f"the angle is {np.degrees(angle):g}°; expected 0 to 360°")
    return light if angle == 0 else _spread_as_latlong(light, lambda rows: _turning(rows, angle))


def _spread_as_latlong(light: IlluminationMap, spread_of: Callable[[int], Spread]) -> IlluminationMap:
    source = light if isinstance(light.mapping, LatLong) else light.remapped(LatLong())
    spread = spread_of(source.size)
    # Transforms round; weights that are not negative make no negative light.
    radiance = np.maximum(spread(source.radiance.astype(np.float64)), 0).astype(np.float32)
    clipped = None if source.clipped is None else spread_clipped(source.radiance, source.clipped, spread)
    result = replace(source, radiance=radiance, clipped=clipped)
    return result if source is light else result.remapped(light.mapping, light.size)


def _turning(rows: int, angle: float) -> Spread:
    """The circular streak of fields (rows, 2·rows, C) along the longitude."""
    columns = 2 * rows
    streak = streak_kernel(angle / (2 * np.pi) * columns, 0.0).sum(0)
    turn = np.zeros(columns)
    np.add.at(turn, (np.arange(len(streak)) - len(streak) // 2) % columns, streak)
    waves = np.real(np.asarray(rfft(turn)))
    return lambda field: np.asarray(irfft(np.asarray(rfft(field, axis=1)) * waves[:, None], n=columns, axis=1))


def _spherical(rows: int, sigma: float) -> Spread:
    """The balanced convolution of fields (rows, 2·rows, C) on pixel centres."""
    columns = 2 * rows
    angles = np.pi * (np.arange(rows) + 0.5) / rows
    areas = LatLong().solid_angles(rows)[:, 0]
    # Waves along the longitude that the kernel holds: e^(−m²σ²/2) at the horizon, fewer elsewhere.
    highest = int(np.ceil(np.sqrt(2 * _FAINT) / sigma))
    samples = min(columns, 2 * highest + 2)
    sines = 1 - np.cos(2 * np.pi * np.arange(samples) / samples)
    reach = 2 * np.arcsin(min(1.0, sigma * np.sqrt(_FAINT / 2)))

    def near(row: int) -> slice:
        inside = np.flatnonzero(np.abs(angles - angles[row]) <= reach)
        return slice(int(inside[0]), int(inside[-1]) + 1)

    def kernel(row: int) -> np.ndarray:
        """(near rows, samples) between a row and those near it, by their difference in longitude."""
        others = angles[near(row)]
        apart = 2 * np.sin((others - angles[row]) / 2) ** 2
        return np.exp(-(apart[:, None] + np.sin(angles[row]) * np.sin(others)[:, None] * sines) / sigma**2)

    with ThreadPoolExecutor() as pool:
        sums = list(pool.map(lambda row: kernel(row).sum(1) * (columns / samples), range(rows)))
    balance = _balanced([near(row) for row in range(rows)], sums, areas)

    def spread(field: np.ndarray) -> np.ndarray:
        given = np.asarray(rfft(field * (areas * balance)[:, None, None], axis=1, workers=-1))
        received = np.zeros_like(given)

        def receive(row: int) -> None:
            waves = np.real(np.asarray(rfft(kernel(row), axis=1))) * (columns / samples)
            held = waves.shape[1]
            received[row, :held] = np.einsum("rm,rmc->mc", waves, given[near(row), :held])

        with ThreadPoolExecutor() as pool:
            list(pool.map(receive, range(rows)))
        return np.asarray(irfft(received, n=columns, axis=1, workers=-1)) * balance[:, None, None]

    return spread


def _balanced(near: list[slice], sums: list[np.ndarray], areas: np.ndarray) -> np.ndarray:
    """The factor d of each row for which d·K·(d·area) is 1 in every row; K is symmetric, so both balances are one.

    sums : of the kernel along the longitude, for every row and those near it
    """
    balance = np.ones(len(areas))

    def received() -> np.ndarray:
        weighted = areas * balance
        return np.array([row @ weighted[rows] for row, rows in zip(sums, near, strict=True)])

    balance /= np.sqrt(areas @ received() / areas.sum())
    for _ in range(_ROUNDS):
        excess = balance * received()
        if np.abs(excess - 1).max() < 1e-13:
            break
        balance /= np.sqrt(excess)
    return balance

"""Soft blur of light on the sphere itself: as wide at the poles as at the horizon, and across the seam.

The kernel is von Mises and Fisher's, exp((cos γ − 1)/σ²), the sphere's Gaussian: positive everywhere, a function of
the angle γ alone. Between pixel centres of a lat-long map it is a circular convolution along the longitude for every
pair of rows. Its sums over pixels are not quite 1; they are balanced row by row (Sinkhorn & Knopp 1967, the symmetric
case), so that constant light stays constant and the total is kept, both to rounding.

A map in another mapping is blurred in a lat-long map with as many pixels, there and back, which blurs by about a pixel
besides: only the light that is blurred takes that way. Where it shows a part of the sphere only, what comes back is
divided by the share of it that came from what is shown, since of what lies beyond the rim nothing is known.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from relume.image.blurring import streak_kernel
from relume.image.filtering import Spread, spread_clipped
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong

_FAINT = 37.0
"""−ln of the share of the peak beyond which the kernel is left out: double precision's own."""
_ROUNDS = 200
_WHOLE = 0.999
"""Share of the sphere from which on a map shows all of it."""


def blurred(light: EnvironmentMap, sigma: float, *, share: float = 1.0) -> EnvironmentMap:
    """The light out of focus by `sigma` in all directions; with a share below 1 sharp light with a glow.

    light : in any mapping
    sigma : radians, of the Gaussian that the kernel is for small angles; 0 to π
    share : of the light that is blurred; 1 is all of it. What stays sharp stays in its pixel, in any mapping

    Constant light stays constant, and the total of each channel is kept: both to rounding in a lat-long map, in any
    other of the whole sphere as resampling keeps them. A map of a part of the sphere, a fisheye's, keeps constant
    light, but not its total: light near the rim goes out of it and what would come in is not known.
    Raises ValueError for another sigma or share.
    """
    if not 0 <= sigma <= np.pi:
        raise ValueError(f"sigma is {np.degrees(sigma):g}°; expected 0 to 180°")
    if not 0 <= share <= 1:
        raise ValueError(f"the share is {share:g}; expected 0 to 1")
    if sigma == 0 or share == 0:
        return light

    blur = _on(light, lambda rows: _spherical(rows, sigma))
    return _spread(light, lambda field: (1 - share) * field + share * blur(field))


def spun(light: EnvironmentMap, angle: float) -> EnvironmentMap:
    """The light as a shutter sees it while it turns about the vertical at an even speed: motion blur of a light map.

    light : in any mapping
    angle : radians, of the whole turn, half of it before the light's own place and half after; 0 to 2π

    The light of every row of a lat-long map is kept to rounding; other mappings as by `blurred`. Raises
    ValueError for another angle.
    """
    if not 0 <= angle <= 2 * np.pi:
        raise ValueError(f"the angle is {np.degrees(angle):g}°; expected 0 to 360°")
    return light if angle == 0 else _spread(light, _on(light, lambda rows: _turning(rows, angle)))


def _spread(light: EnvironmentMap, spread: Spread) -> EnvironmentMap:
    # Transforms round; weights that are not negative make no negative light.
    radiance = np.maximum(spread(light.radiance.astype(np.float64)), 0).astype(np.float32)
    clipped = None if light.clipped is None else spread_clipped(light.radiance, light.clipped, spread)
    return replace(light, radiance=radiance, clipped=clipped)


def _on(light: EnvironmentMap, of_latlong: Callable[[int], Spread]) -> Spread:
    """A spread of lat-long fields by their rows, as one of fields in the light's own mapping."""
    if isinstance(light.mapping, LatLong):
        return of_latlong(light.size)
    rows = light.matching_size(LatLong())
    blur = of_latlong(rows)

    def there_and_back(field: np.ndarray) -> np.ndarray:
        """Of three channels."""
        source = EnvironmentMap(field.astype(np.float32), light.mapping).remapped(LatLong(), rows)
        radiance = np.maximum(blur(source.radiance.astype(np.float64)), 0).astype(np.float32)
        return EnvironmentMap(radiance).remapped(light.mapping, light.size).radiance.astype(np.float64)

    areas = light.mapping.solid_angles(light.size)
    shown = np.repeat((areas > 0)[..., None], 3, axis=-1).astype(np.float64)
    part = areas.sum() < _WHOLE * 4 * np.pi
    known = np.maximum(there_and_back(shown)[..., :1], 1e-6) if part else np.ones(())

    def spread(field: np.ndarray) -> np.ndarray:
        channels = field.shape[-1]
        padded = np.concatenate([field, np.zeros((*field.shape[:2], -channels % 3))], axis=-1)
        parts = [there_and_back(padded[..., k : k + 3]) for k in range(0, channels, 3)]
        return np.concatenate(parts, axis=-1)[..., :channels] / known * (areas > 0)[..., None]

    return spread


def _turning(rows: int, angle: float) -> Spread:
    """The circular streak of fields (rows, 2·rows, C) along the longitude."""
    from scipy.fft import irfft, rfft

    columns = 2 * rows
    streak = streak_kernel(angle / (2 * np.pi) * columns, 0.0).sum(0)
    turn = np.zeros(columns)
    np.add.at(turn, (np.arange(len(streak)) - len(streak) // 2) % columns, streak)
    waves = np.real(np.asarray(rfft(turn)))
    return lambda field: np.asarray(irfft(np.asarray(rfft(field, axis=1)) * waves[:, None], n=columns, axis=1))


def _spherical(rows: int, sigma: float) -> Spread:
    """The balanced convolution of fields (rows, 2·rows, C) on pixel centres."""
    from scipy.fft import irfft, rfft

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

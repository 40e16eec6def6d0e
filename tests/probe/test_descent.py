"""The compiled descents that place a rim, against SciPy's simplex on the same sums in NumPy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.optimize import minimize

from relume.probe.descent import down_across, least_along

TURNS = 2 * np.pi * np.arange(90) / 90
RING = np.stack([np.cos(TURNS), np.sin(TURNS)], axis=1)


def scipy_descent(cost, simplex, near, alike, most):
    options = {"initial_simplex": simplex, "xatol": near, "fatol": alike, "maxiter": most}
    return minimize(cost, simplex[0], method="Nelder-Mead", options=options)


@pytest.mark.parametrize("limits", [None, (0.25, -2.0, 0.3)])
def test_an_ellipse_is_moved_to_the_least_sum_as_by_scipy(limits):
    steps = np.arange(-5, 5.1, 0.25)
    true = 0.4 + RING @ np.array([1.1, -0.7])
    costs = (steps - true[:, None]) ** 2 + 0.3 * np.random.default_rng(3).random((90, len(steps)))
    starts = np.array([[3.0, 3, 2], [0, 0, 0], [1, 0, 0.5], [-2, 1, -1]])

    def along(by):
        place = np.clip(by[2] + RING @ by[:2], -5, steps[-1])
        total = sum(np.interp(at, steps, row) for at, row in zip(place, costs, strict=True))
        if limits is None:
            return total
        return total + 1e3 * (
            max(0, np.hypot(by[0], by[1]) - limits[0]) + max(0, limits[1] - by[2]) + max(0, by[2] - limits[2])
        )

    best = min(starts, key=along)
    twin = scipy_descent(along, best + 0.5 * np.vstack([np.zeros(3), np.eye(3)]), 1e-3, 1e-3, 600)
    found, value = least_along(
        starts, costs, steps, RING, 0.5, (1e-3, 1e-3), **({} if limits is None else {"limits": limits})
    )
    assert value == pytest.approx(twin.fun, rel=1e-9) and np.allclose(found, twin.x, atol=1e-6)
    if limits is None:
        assert np.allclose(found, [1.1, -0.7, 0.4], atol=0.1)
    else:
        assert np.hypot(found[0], found[1]) < 0.251 and found[2] < 0.301
    # With all four followed down nothing is worse.
    assert limits or least_along(starts, costs, steps, RING, 0.5, (1e-3, 1e-3), tried=4)[1] <= value


def test_a_circle_creeps_to_where_the_picture_changes_across_it_as_by_scipy():
    y, x = np.mgrid[:90, :120] + 0.5
    picture = gaussian_filter((np.hypot(x - 63.3, y - 41.8) < 30.4).astype(float), 2.0)
    picture += 0.02 * np.random.default_rng(5).random(picture.shape)
    down, right = (each.astype(np.float32) for each in np.gradient(picture))
    right, down, focal, principal = 200 * right, 200 * down, 150.0, (60.0, 45.0)

    def unseen(circle):
        aside = circle[:2] - np.array(principal)
        longer, way = np.hypot(1, np.hypot(*aside) / focal) - 1, aside / np.hypot(*aside)
        rim = circle[:2] + circle[2] * (RING + longer * (RING @ way)[:, None] * way)
        at = np.rint(32 * (rim.T[::-1] - 0.5)) / 32
        change = np.sum([map_coordinates(each, at, np.float64, 1, mode="nearest") * n for each, n in zip(
            (right, down), RING.T, strict=True)], axis=0)  # fmt: skip
        within = np.all((rim > 0) & (rim < (120, 90)), axis=1)
        return -np.log1p(change[within] ** 2).sum() / max(within.sum(), 0.6 * 90)

    for guess in ([61.0, 43.0, 31.5], [100.0, 20.0, 28.0]):
        simplex = np.array(guess) + np.vstack([np.zeros(3), 2 * np.eye(3)])
        twin = scipy_descent(unseen, simplex, 0.05, 1e-3, 51)
        found, value = down_across(right, down, RING, focal, principal, 0.6, simplex, 0.05, 1e-3, 50)
        assert value == pytest.approx(twin.fun, rel=1e-5) and np.allclose(found, twin.x, atol=1e-3)
    simplex = np.array([61.0, 43.0, 31.5]) + np.vstack([np.zeros(3), 2 * np.eye(3)])
    found, _ = down_across(right, down, RING, 1e6, principal, 0.6, simplex, 0.01, 1e-6, 200)
    assert np.allclose(found, [63.3, 41.8, 30.4], atol=0.15)

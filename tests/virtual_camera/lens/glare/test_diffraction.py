"""Stars: Airy's disc where the opening is round, as many rays as blades ask for, and one law near and far."""

import numpy as np
import pytest

from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.lens.glare.diffraction import far_radial, near_light, near_reach, star

ONE = np.array([1.0])


@pytest.mark.parametrize("iris", [Blades(), Blades(8, 1.0)])
def test_a_round_opening_draws_airys_disc(iris):
    light = near_light(iris, np.array([12.0]), 40)[0]
    # |F|² / (q² A) in the middle is A / q².
    assert light[40, 40] == pytest.approx(np.pi / 4 / 144, rel=0.01)
    row = light[40, 40:]
    # Dark rings at 1.2197 and 2.2331 orders, the first bright one at 1.6347 with 1.75 % of the middle.
    assert np.argmin(row[:18]) == 15 and np.argmin(row[22:32]) + 22 == 27
    assert row[18:22].max() / row[0] == pytest.approx(0.0175, rel=0.03)
    y, x = np.mgrid[-40:41, -40:41]
    # 83.8 % within the first dark ring, Rayleigh's number.
    assert light[np.hypot(x, y) < 14.64].sum() == pytest.approx(0.838, abs=0.004)


def test_the_slow_sum_over_the_opening_agrees():
    iris, order, size = Blades(5, 0.3, 0.2), 6.0, 96
    opening = iris.draw(size)
    cell = 2 * iris.corner / size
    across = (np.arange(size) + 0.5) * cell - iris.corner
    u, v = np.meshgrid(across, across)
    light = near_light(iris, np.array([order]), 8)[0]
    nodes = (np.arange(6) + 0.5) / 6 - 0.5
    for y, x in ((0, 0), (3, 1), (-2, 5), (4, -4)):
        seen = [
            abs((opening * np.exp(-2j * np.pi / order * (u * (x + dx) + v * (y + dy)))).sum() * cell**2) ** 2
            for dx in nodes
            for dy in nodes
        ]
        expected = np.mean(seen) / (order**2 * opening.sum() * cell**2)
        assert light[8 + y, 8 + x] == pytest.approx(expected, rel=0.02, abs=2e-6)


@pytest.mark.parametrize(("blades", "rays"), [(5, 10), (6, 6), (7, 14), (8, 8)])
def test_even_blades_draw_as_many_rays_and_odd_ones_twice_as_many(blades, rays):
    drawn = star(Blades(blades, rotation=0.1), ONE, ONE, np.array([200.0]), 4096)[0]
    above = drawn > 5
    # Over half a turn there is half of them.
    assert np.count_nonzero(above & ~np.roll(above, 1)) == rays // 2
    # One is where the first blade looks; the pattern counts its half turn from the right downwards.
    looks = -(0.1 + np.pi / blades) % np.pi
    assert drawn[round(looks / np.pi * 4096)] > 0.9 * drawn.max()


def test_rays_are_as_wide_as_pixels_far_away_and_hold_the_mean():
    distances = np.array([30.0, 300.0, 3000.0])
    for curvature in (0.0, 0.5, 1.0):
        drawn = star(Blades(6, curvature), np.array([0.5, 1.0]), np.array([0.3, 0.7]), distances, 8192)
        assert drawn.mean(1) == pytest.approx(np.ones(3), abs=1e-6) and drawn.min() >= 0
        widths = (drawn > drawn.max(1, keepdims=True) / 2).sum(1) * np.pi / 8192 / 3 * distances
        if curvature == 0:
            assert widths == pytest.approx([2, 2, 2.8], abs=0.5)
    assert np.ptp(drawn) < 0.2  # a circle has no rays
    round_ = star(Blades(), np.array([0.5, 1.0]), np.array([0.3, 0.7]), distances, 8192)
    assert np.ptp(round_) < 1e-9 and round_.mean() == pytest.approx(1)


def test_rays_point_the_same_way_near_and_far():
    iris = Blades(5, rotation=0.15)
    near = near_light(iris, np.array([2.0]), 40)[0]
    far = star(iris, np.array([2.0]), ONE, np.array([30.0]), 4096)[0]
    turns = -iris.normals
    x, y = (np.rint(40 + 30 * way(turns)).astype(int) for way in (np.cos, np.sin))
    beside_x, beside_y = (np.rint(40 + 30 * way(turns + 0.3)).astype(int) for way in (np.cos, np.sin))
    assert near[y, x].min() > 3 * near[beside_y, beside_x].max()
    places = (np.rint(turns % np.pi / np.pi * 4096).astype(int)) % 4096
    assert far[places].min() > 0.9 * far.max()


def test_far_light_falls_on_from_the_near_light():
    # P = π and A = π / 4, so P q / (4 π³ A r³) is q / (π³ r³): 6.05e-6.
    assert far_radial(Blades(6, 1.0), np.array([1.5]), np.array([20.0]))[0, 0] == pytest.approx(6.0472e-6, rel=1e-4)
    y, x = np.mgrid[-30:31, -30:31]
    distance = np.hypot(x, y)
    for iris in (Blades(), Blades(6, 1.0), Blades(6), Blades(5, 0.3, 0.4)):
        order = np.linspace(1.3, 1.7, 9)
        light = near_light(iris, order, 30).mean(0)
        ring = (distance > 18) & (distance < 28)
        far = far_radial(iris, order, distance[ring]).mean()
        assert light[ring].mean() == pytest.approx(far, rel=0.04)


def test_fringes_are_computed_as_far_as_they_are_seen():
    assert (near_reach(0.1), near_reach(1.0), near_reach(50.0)) == (4, 12, 96)

"""Discs of confusion pixel by pixel: shares of area, sizes, and which way up they are."""

import numpy as np
import pytest

from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.lens.disc_table import DiscTable, disc_table, radius_of, size_of


def drawn(table: DiscTable, size: int) -> np.ndarray:
    """The disc of one size, (2n + 1, 2n + 1)."""
    i = size - table.lowest
    n = int(table.reach[i])
    part = slice(table.first[i], table.first[i + 1])
    changes = np.zeros((2 * n + 1, 2 * n + 3))
    np.add.at(changes, (table.down[part] + n, table.right[part] + n), table.change[part])
    disc = np.cumsum(changes, axis=1)
    assert np.abs(disc[:, -2:]).max() < 1e-14  # every row ends
    return disc[:, : 2 * n + 1]


def supersampled(blades: Blades, radius: float, n: int, side: int = 100) -> np.ndarray:
    """The share of each pixel by points: inside is what is nearer to the middle than the outline that way."""
    outline = blades.outline() * radius
    place = (np.arange((2 * n + 1) * side) + 0.5) / side - n - 0.5
    x, y = np.meshgrid(place, place)
    corner = np.arctan2(outline[:, 1], outline[:, 0])
    order = np.argsort(corner)
    reach = np.interp(np.arctan2(y, x), corner[order], np.linalg.norm(outline, axis=1)[order], period=2 * np.pi)
    return (np.hypot(x, y) < reach).reshape(2 * n + 1, side, 2 * n + 1, side).mean((1, 3))


def test_a_small_disc_has_known_shares():
    # Radius 1 about a pixel's middle: corners ∫∫ and sides of the circle's area outside the square |x| ≤ ½.
    disc = drawn(disc_table(Blades(), 8, 8), 8) * np.pi
    side = 2 * (0.25 * np.sqrt(3) / 2 + np.arcsin(0.5) / 2) - 0.5  # ∫ from −½ to ½ of √(1 − y²) − ½
    corner = (np.pi - 1 - 4 * side) / 4
    np.testing.assert_allclose(disc, [[corner, side, corner], [side, 1, side], [corner, side, corner]], atol=2e-5)
    assert side == pytest.approx(0.456611, abs=1e-6)


@pytest.mark.parametrize("blades", [Blades(), Blades(5, 0.3, 0.4), Blades(3)])
def test_shares_are_those_of_area(blades):
    for size in (13, 43):
        radius = float(radius_of(np.array(size)))
        disc = drawn(disc_table(blades, size, size), size)
        expected = supersampled(blades, radius, disc.shape[0] // 2) / (np.pi * radius**2)
        np.testing.assert_allclose(disc, expected, atol=5e-3 / (np.pi * radius**2))


def test_every_disc_is_even_light_that_sums_to_one():
    table = disc_table(Blades(6, 0.2, 0.1), -200, 200)
    for size in range(-200, 201, 8):
        disc = drawn(table, size)
        assert disc.sum() == pytest.approx(1, abs=1e-12) and disc.min() > -1e-14


def test_below_a_pixel_a_round_disc_is_a_point():
    table = disc_table(Blades(), -3, 3)
    assert table.widest == 0
    for size in range(-3, 4):
        assert drawn(table, size).tolist() == [[1.0]]


def test_before_the_focus_the_opening_is_upside_down():
    table = disc_table(Blades(3, 0.0, 0.3), -40, 40)
    before, behind = drawn(table, -40), drawn(table, 40)
    np.testing.assert_allclose(before, behind[::-1, ::-1], atol=1e-12)
    assert np.abs(before - behind).max() > 0.01
    # Behind it, it is the right way up: rotation 0 has its corner to the right.
    right = drawn(disc_table(Blades(3), 40, 40), 40)
    n = right.shape[0] // 2
    assert right[n, -1] > 0 and right[n, 0] == 0


def test_sizes_are_fine_and_go_on():
    radius = np.linspace(-300, 300, 60001)
    nearest = radius_of(size_of(radius))
    small = np.abs(radius) <= 16
    assert np.abs(nearest - radius)[small].max() <= 1 / 16 + 1e-9
    assert (np.abs(nearest - radius) / np.maximum(np.abs(radius), 1))[~small].max() < 0.0045
    assert size_of(np.array([0.0, 1.0, -2.5, 16.0, 32.0])).tolist() == [0, 8, -20, 128, 217]
    assert radius_of(np.array([8, 128, -256])).tolist() == pytest.approx([1.0, 16.0, -16 * np.e])

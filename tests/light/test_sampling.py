"""Importance sampling: what is drawn is what the density says, in every mapping, and sums over it are unbiased."""

import numpy as np
import pytest
from scipy import stats

from lights import WHOLE, fitting, spread
from relume.light.sampling import EnvironmentSampler, _pixels, pixel_boxes
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import CubeCross
from relume.sphere.mappings.discs import Angular, Fisheye, MirrorBall
from relume.sphere.mappings.mapping import LatLong, pixel_points
from relume.sphere.mappings.squares import Octahedral

EVERY = (*WHOLE, Fisheye(np.pi), Fisheye(1.0))
MAPPINGS = pytest.mark.parametrize("mapping", EVERY, ids=[f"{m.name} {k}" for k, m in enumerate(EVERY)])
LEVEL = 0.01
"""Chance that a correct sampler fails one χ² test by its seed; the seeds are fixed."""


def spiky(mapping, size, seed=3):
    """Dark and bright pixels side by side, some black."""
    random = np.random.default_rng(seed).random((*mapping.shape(size), 3))
    return EnvironmentMap(np.where(random < 0.2, 0, random**3).astype(np.float32), mapping)


def numbers(count, seed=7):
    return np.random.default_rng(seed).random((count, 2))


def chi_squared(counts, expected):
    """The p-value of counts, cells of few expected ones pooled (Pearson)."""
    order = np.argsort(expected)
    counts, expected = counts[order], expected[order]
    assert counts[expected == 0].sum() == 0, "a direction was drawn where the density is 0"
    few = np.searchsorted(np.cumsum(expected), 5) + 1
    few = max(few, np.searchsorted(expected, 5))
    counts = np.append(counts[few:], counts[:few].sum())
    expected = np.append(expected[few:], expected[:few].sum())
    return stats.chi2.sf(((counts - expected) ** 2 / expected).sum(), len(counts) - 1)


def p_value(sampler, u, cells=2):
    """χ² over cells² cells of every pixel, whose solid angles are exact."""
    mapping, size = sampler.light.mapping, sampler.light.size * cells
    directions, density = sampler.sample(u)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(density, sampler.pdf(directions))
    rows, columns = mapping.shape(size)
    j, i = _pixels(mapping, directions, rows, columns)
    counts = np.bincount(j * columns + i, minlength=rows * columns)
    in_pixels = np.repeat(np.repeat(sampler._density, cells, 0), cells, 1)
    return chi_squared(counts, len(u) * (in_pixels * mapping.solid_angles(size)).ravel())


@MAPPINGS
def test_what_is_drawn_is_what_the_density_says(mapping):
    sampler = EnvironmentSampler(spiky(mapping, fitting(mapping, 12)))
    assert p_value(sampler, numbers(40_000)) > LEVEL


@pytest.mark.slow
@MAPPINGS
def test_a_million_drawn_are_what_the_density_says(mapping):
    sampler = EnvironmentSampler(spiky(mapping, fitting(mapping, 40)))
    assert p_value(sampler, numbers(1_000_000), 3) > 1 - (1 - LEVEL) ** (1 / len(EVERY))


@pytest.mark.parametrize("mapping", [LatLong(), Octahedral(), Angular(), MirrorBall()], ids=lambda m: m.name)
@pytest.mark.parametrize("rows", [1, 2])
def test_the_fewest_pixels_are_drawn_evenly_too(mapping, rows):
    size = fitting(mapping, rows)
    light = EnvironmentMap(np.ones((*mapping.shape(size), 3), np.float32), mapping)
    assert p_value(EnvironmentSampler(light), numbers(20_000), 8) > LEVEL


def test_chi_squared_finds_directions_that_bunch_within_pixels():
    # Uniform in the image's rows is not uniform in solid angle: too many near the poles.
    light = EnvironmentMap(np.ones((4, 8, 3), np.float32))
    directions = LatLong().directions(numbers(50_000))
    j, i = _pixels(LatLong(), directions, 8, 16)
    counts, areas = np.bincount(j * 16 + i, minlength=128), LatLong().solid_angles(8).ravel()
    assert chi_squared(counts, 50_000 * areas / (4 * np.pi)) < 1e-9
    assert p_value(EnvironmentSampler(light), numbers(50_000)) > LEVEL


@MAPPINGS
def test_the_box_of_a_pixel_holds_all_of_it(mapping):
    # Many directions near the axes, where discs and squares have their rims, corners and folds.
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    random = np.random.default_rng(1)
    near = axes[:, None] + random.normal(size=(6, 5000, 3)) * 10 ** random.uniform(-4, -0.5, (6, 5000, 1))
    directions = np.concatenate([spread(30_000), normalised(near.reshape(-1, 3))])
    for size in (1, 2, 9, 33):
        size = fitting(mapping, size)
        shape = mapping.shape(size)
        j, i = _pixels(mapping, directions, *shape)
        seen = j >= 0
        pixels, inverse = np.unique(j[seen] * shape[1] + i[seen], return_inverse=True)
        frames, low, high = (part[inverse] for part in pixel_boxes(mapping, size, *np.divmod(pixels, shape[1])))
        local = np.einsum("nij,nj->ni", frames, directions[seen])
        place = np.stack([np.arctan2(local[:, 1], local[:, 0]), local[:, 2]], axis=-1)
        assert np.all((place >= low) & (place <= high)), size


@MAPPINGS
def test_the_density_integrates_to_one(mapping):
    light = spiky(mapping, fitting(mapping, 12))
    middles = mapping.directions(pixel_points(mapping, light.size))
    seen = ~np.isnan(middles[..., 0])
    density, areas = EnvironmentSampler(light).pdf(middles[seen]), mapping.solid_angles(light.size)[seen]
    cut = float((mapping.solid_angles(light.size)[~seen] * EnvironmentSampler(light)._density[~seen]).sum())
    assert density @ areas + cut == pytest.approx(1, abs=1e-12)
    # By directions from everywhere, which know nothing of pixels.
    values = EnvironmentSampler(light).pdf(spread(20_000)) * 4 * np.pi
    assert abs(values.mean() - 1) < 4 * values.std() / np.sqrt(20_000)


def test_beside_what_a_map_shows_there_is_no_density():
    light = EnvironmentMap(np.ones((8, 8, 3), np.float32), Fisheye(np.pi))
    assert EnvironmentSampler(light).pdf(np.array([[0, 0, 1.0], [0, 0, -1.0]])) == pytest.approx(
        [0, 1 / (2 * np.pi)], rel=1e-2
    )


def test_one_bright_pixel_gets_all():
    radiance = np.zeros((16, 32, 3), np.float32)
    radiance[5, 20] = 3
    directions, density = EnvironmentSampler(EnvironmentMap(radiance)).sample(numbers(1000))
    points = LatLong().image_points(directions)
    assert np.all((points * (32, 16)).astype(int) == (20, 5))
    assert density == pytest.approx(np.full(1000, 1 / LatLong().solid_angles(16)[5, 20]))
    assert EnvironmentSampler(EnvironmentMap(radiance)).pdf(-directions) == pytest.approx(0)


def test_the_ends_of_the_numbers_fall_into_bright_pixels():
    radiance = np.zeros((4, 8, 3), np.float32)
    radiance[1:3, 2:5] = np.random.default_rng(0).random((2, 3, 3)) + 0.1
    last = np.nextafter(1, 0)
    ends = np.array([[0, 0], [last, last], [0, last], [last, 0], [0.5, 0.5]])
    _, density = EnvironmentSampler(EnvironmentMap(radiance)).sample(ends)
    assert np.all(density > 0)


def test_density_is_in_proportion_to_luminance():
    radiance = np.zeros((2, 4, 3), np.float32)
    radiance[0, 0], radiance[1, 2] = (1, 0, 0), (0, 1, 0)
    sampler = EnvironmentSampler(EnvironmentMap(radiance))
    red, green = sampler.pdf(LatLong().directions(np.array([[1 / 8, 1 / 4], [5 / 8, 3 / 4]])))
    assert green / red == pytest.approx(0.7152 / 0.2126, rel=1e-6)
    brightest = EnvironmentSampler(EnvironmentMap(radiance), lambda radiance: radiance.max(-1))
    assert brightest.pdf(LatLong().directions(np.array([1 / 8, 1 / 4]))) == pytest.approx(1 / np.pi, rel=1e-6)


@pytest.mark.parametrize("mapping", [LatLong(), MirrorBall(), CubeCross()], ids=lambda m: m.name)
def test_irradiance_summed_over_what_is_drawn_is_unbiased_and_far_less_noisy(mapping):
    size = fitting(mapping, 48)
    light = spiky(mapping, size)
    radiance = light.radiance.copy()
    row, column = np.unravel_index(np.argmax(mapping.solid_angles(size)), mapping.shape(size))
    radiance[row, column] = 3000
    light = EnvironmentMap(radiance, mapping)
    towards = mapping.directions(np.array([column + 0.5, row + 0.5]) / mapping.shape(size)[::-1])
    normal, count = normalised(towards + np.array([0.3, 0.2, 0.4])), 40_000
    directions, density = EnvironmentSampler(light).sample(numbers(count))

    def values(directions, density):
        j, i = _pixels(mapping, directions, *mapping.shape(size))
        return light.radiance[j, i, 1] * np.maximum(directions @ normal, 0) / density

    drawn = values(directions, density)
    evenly = values(spread(count), 1 / (4 * np.pi))
    # The truth over 4 × 4 cells of every pixel.
    fine = np.repeat(np.repeat(light.radiance, 4, 0), 4, 1)
    truth = EnvironmentMap(fine, mapping).irradiance(normal)[1]
    assert abs(drawn.mean() - truth) < 4 * drawn.std() / np.sqrt(count) + 1e-5 * truth
    assert drawn.std() < 0.1 * evenly.std()


def test_the_same_numbers_give_the_same_directions_also_one_by_one():
    for mapping in (LatLong(), Angular()):
        sampler = EnvironmentSampler(spiky(mapping, 12))
        u = numbers(50)
        together, _ = sampler.sample(u)
        for k in range(50):
            np.testing.assert_array_equal(sampler.sample(u[k : k + 1])[0][0], together[k])


def test_no_number_gives_no_direction():
    directions, density = EnvironmentSampler(spiky(Angular(), 8)).sample(np.empty((0, 2)))
    assert directions.shape == (0, 3) and density.shape == (0,)


def test_a_wrong_call_is_reported():
    light = EnvironmentMap(np.ones((2, 4, 3), np.float32))
    with pytest.raises(ValueError, match="black all over"):
        EnvironmentSampler(EnvironmentMap(np.zeros((2, 4, 3), np.float32)))
    with pytest.raises(ValueError, match="brightness is negative"):
        EnvironmentSampler(light, lambda radiance: radiance[..., 0] - 2)
    with pytest.raises(ValueError, match=r"expected \(N, 2\)"):
        EnvironmentSampler(light).sample(np.zeros(2))
    for outside in (1.0, -1e-9):
        with pytest.raises(ValueError, match=r"expected \[0, 1\)"):
            EnvironmentSampler(light).sample(np.array([[0.5, outside]]))

"""Grain: measured back on the film through the standard's aperture, it is what the film's data sheet says."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import fftconvolve
from scipy.special import j1

from relume.virtual_camera.film.characteristic_curve import CharacteristicCurve
from relume.virtual_camera.film.darkroom import Darkroom
from relume.virtual_camera.film.density_grain import DensityGrain
from relume.virtual_camera.film.printing_kernel import noise_row
from relume.virtual_camera.film.stocks import black_and_white_negative
from relume.virtual_camera.view import View

PIXEL = 4.0
SIDES = 1000, 800


def film(grain: DensityGrain | None):
    return replace(black_and_white_negative(), grain=grain, halation=None)


def densities(grain: DensityGrain | None, mean: float, *, seed: int = 0, sides=SIDES) -> np.ndarray:
    """Density of an evenly exposed film whose pixels are 4 µm wide, read off against the light."""
    stock = film(grain)
    width, height = sides
    # Exposure 1 is at the meter's reading, so a factor on the light is one on the exposure.
    factor = 10 ** float(stock.curves[0].log_exposure(mean)) / stock.grey_exposure
    light = np.full((height, width, 3), factor, np.float32)
    darkroom = Darkroom(stock, frame=PIXEL * width)
    metered = darkroom.adapt(np.ones((1, 1, 3), np.float32), View(1.0))
    seen = darkroom.display_values(light, View(1.0, seed=seed), metered)[..., 0]
    return stock.curves[0].minimum - np.log10(seen.astype(np.float64))


def through_discs(density: np.ndarray) -> np.ndarray:
    """Mean densities of touching round apertures of 48 µm."""
    finer = np.arange(13 * 8) / 8 + 1 / 16 - 6.5
    disc = (finer[:, None] ** 2 + finer**2 <= (24 / PIXEL) ** 2).reshape(13, 8, 13, 8).mean((1, 3))
    return fftconvolve(density, disc / disc.sum(), mode="valid")[::13, ::13]


@pytest.mark.parametrize("clump", [0.5, 2.5, 6.0])
def test_rms_granularity_measured_through_48_micrometres_is_what_was_asked(clump):
    grain = DensityGrain(16.0, clump=clump)
    seen = through_discs(densities(grain, film(None).curves[0].minimum + 1))
    # 4,600 discs: their deviation is asked to 1 %; pixels of 4 µm and the taps' own shape take as much again.
    assert seen.size > 4500 and seen.std() == pytest.approx(0.016, rel=0.035)


def test_selwyns_law_holds_for_apertures_larger_than_the_clumps():
    density = densities(DensityGrain(16.0, clump=2.0), 1.25)
    products = []
    for side in (8, 16, 32):
        rows, columns = (n // side * side for n in density.shape)
        block = density[:rows, :columns].reshape(rows // side, side, columns // side, side).mean((1, 3))
        products.append(block.std() * side * PIXEL)
    np.testing.assert_allclose(products, products[1], rtol=0.05)


def test_grain_is_strongest_in_the_middle_and_does_not_move_the_mean():
    grain, curve = DensityGrain(16.0, clump=2.0), film(None).curves[0]
    sizes = []
    for mean in (curve.minimum + 0.02, 0.8, curve.minimum + curve.span / 2, 1.8, curve.maximum - 0.03):
        density = densities(grain, mean, sides=(400, 300))
        sizes.append(density.std())
        assert density.mean() == pytest.approx(mean, abs=5 * 0.2 / np.sqrt(400 * 300) + 2e-5)
        wanted = grain.deviation(np.array(mean), curve, PIXEL**2) * (grain.taps(PIXEL) ** 2).sum()
        assert density.std() == pytest.approx(float(wanted), rel=0.02)
    assert np.argmax(sizes) == 2 and sizes[0] < 0.6 * sizes[2] and sizes[4] < 0.3 * sizes[2]


def test_the_seed_alone_decides_the_grain():
    first = densities(DensityGrain(16.0), 1.2, sides=(120, 90))
    np.testing.assert_array_equal(first, densities(DensityGrain(16.0), 1.2, sides=(120, 90)))
    other = densities(DensityGrain(16.0), 1.2, seed=1, sides=(120, 90))
    assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 0.05
    assert densities(None, 1.2, sides=(120, 90)).std() < 1e-6


def test_white_noise_before_the_clumps_is_white_and_of_variance_one():
    rows = np.empty((400, 500), np.float32)
    for y in range(400):
        noise_row(np.uint64(3), 0, y, np.ones(1, np.float32), rows[y])
    assert rows.mean() == pytest.approx(0, abs=4 / np.sqrt(rows.size))
    assert rows.var() == pytest.approx(1, abs=5 * np.sqrt(2 / rows.size))
    assert np.abs(rows).max() < 3.47
    for down, right in ((0, 1), (1, 0), (1, 1), (2, 0)):
        there = rows[down:, right:]
        assert abs((rows[: len(there), : there.shape[1]] * there).mean()) < 5 / np.sqrt(rows.size)


def test_the_clumps_share_of_an_aperture_is_its_airy_patterns():
    grain = DensityGrain(10.0, clump=5.0)
    # ∫ of Airy's pattern under the Gaussian spectrum: 2 J₁(x)² / x · e^(−x² (clump / a)²)
    kept = quad(lambda x: 2 * j1(x) ** 2 / x * np.exp(-((x * 5 / 24) ** 2)), 0, 60, limit=200)[0]
    assert grain.selwyn() == pytest.approx(0.01 * np.sqrt(np.pi * 24**2 / kept), rel=1e-6)
    assert DensityGrain(10.0, clump=1e-3).selwyn() == pytest.approx(0.01 * 42.539, rel=1e-3)


def test_a_thin_layer_is_measured_at_half_its_density():
    thin = CharacteristicCurve(gamma=0.5, minimum=0.1, maximum=1.1)
    grain = DensityGrain(10.0, clump=1e-3, fog=0.0)
    at = grain.deviation(np.array(0.6), thin, np.pi * 24**2)
    assert float(at) == pytest.approx(0.01, rel=1e-3)

"""The sensor's noise comes back from its photographs, and the variance of a merge is as large as its errors."""

from functools import cache

import numpy as np
import pytest

from camera_curves import CurveCamera, camera_curves, mixed_scene
from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.capture.noise import BINS, DARKEST, Noise, _scatter
from relume.capture.response.calibration import Calibration, recover_response
from relume.capture.response.sampling import Observations
from synthetic import NOISELESS, NOISY, VirtualCamera, wide_scene

CURVED = CurveCamera(camera_curves(9)[6:], 5_000.0, 10.0)
CAMERAS = {
    "12 000 electrons": (NOISY, wide_scene()),
    "4 000 electrons": (VirtualCamera(electrons=4_000.0, read_noise=4.0), wide_scene()),
    "40 000 electrons": (VirtualCamera(electrons=40_000.0, read_noise=10.0), wide_scene()),
    "textured": (CURVED, mixed_scene()),
}


@cache
def measured(name: str) -> tuple[Bracket, Calibration]:
    """A bracket of the camera's, and what is recovered of it; no test may write to either."""
    camera, scene = CAMERAS[name]
    bracket = camera.bracket(scene, seed=3)
    return bracket, recover_response(bracket)


@pytest.mark.parametrize("name", CAMERAS)
def test_the_normalised_residuals_of_a_merge_have_variance_one(name):
    (bracket, calibration), (_, scene) = measured(name), CAMERAS[name]
    merged = merge(bracket, calibration.response)
    assert merged.variance is not None
    known = (merged.clipped == 0) & np.isfinite(merged.variance).all(-1)
    found, true = merged.radiance[known].astype(float), scene[known].astype(float)
    scale = np.exp(np.median(np.log(true / found), axis=0))
    normalised = (found * scale - true) / (np.sqrt(merged.variance[known]) * scale)
    assert normalised.var(axis=0) == pytest.approx([1, 1, 1], abs=0.1)


@pytest.mark.parametrize("name", CAMERAS)
def test_photon_and_read_noise_are_the_sensor_s(name):
    camera, noise = CAMERAS[name][0], measured(name)[1].noise
    assert noise is not None and camera.electrons is not None
    # Exposure 1 is the curve's own white, which extrapolation misses by a per cent or two.
    assert 1 / noise.shot == pytest.approx([camera.electrons] * 3, rel=0.15)
    electrons = noise.read / noise.shot
    assert np.median(electrons) == pytest.approx(camera.read_noise, rel=0.35)


def test_without_noise_rounding_is_what_is_left():
    calibration = recover_response(NOISELESS.bracket(wide_scene()))
    middle = calibration.response.noise[:, 40:230]
    assert middle == pytest.approx(12**-0.5, rel=0.15)


def test_noise_of_exposure_goes_through_the_curve_s_slope():
    # A straight camera: a value is 255 X, its noise 255 √(X / 10000 + 0.001²) and rounding.
    straight = np.log(np.maximum(np.arange(256), 0.5) / 255) * np.ones((3, 1))
    deviation = Noise(np.full(3, 1e-4), np.full(3, 1e-3)).deviation(straight)
    exposure = np.arange(256) / 255
    expected = np.sqrt(255**2 * (exposure * 1e-4 + 1e-6) + 1 / 12)
    np.testing.assert_allclose(deviation[0, 20:250], expected[20:250], rtol=2e-3)
    assert deviation[1, 128] == pytest.approx(1.8475, abs=2e-3)


def test_every_range_of_values_is_measured_and_each_value_counts_once():
    generator = np.random.default_rng(1)
    light = generator.uniform(15, 241, 20_000)
    values = np.rint(light[:, None] + generator.normal(0, 0.8, (20_000, 3))).astype(np.uint8)
    curve = np.log(np.linspace(1, 256, 256))
    value, variance, count = _scatter(curve, np.ones(256), [Observations(values, np.zeros(3))]).T
    assert len(value) == BINS and count.sum() == values.size
    width = (256 - 2 * DARKEST) / BINS
    np.testing.assert_array_equal((value - DARKEST) // width, np.arange(BINS))
    # Noise and rounding; less what is cut off beyond four deviations.
    np.testing.assert_allclose(variance[1:-1], 0.8**2 + 1 / 12, rtol=0.15)

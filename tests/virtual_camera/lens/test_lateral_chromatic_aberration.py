"""Red and blue drawn larger or smaller than green."""

import numpy as np
import pytest

from relume.virtual_camera.lens.geometry import RadialScale


def test_a_radius_is_scaled_by_the_polynomial():
    scale = RadialScale(0.01, 0.002, -0.0005)
    # r = 0.5: 0.5 · (1 + 0.01 + 0.002 · 0.25 − 0.0005 · 0.0625) = 0.505234375.
    np.testing.assert_allclose(scale.scaled(np.array([0.3, 0.4])), [0.6 * 0.505234375, 0.8 * 0.505234375], rtol=1e-12)
    np.testing.assert_allclose(scale.scaled(np.array([0.0, 0.0])), 0)


def test_unscaled_is_the_inverse():
    points = np.random.default_rng(1).uniform(-0.7, 0.7, (50, 2))
    for scale in (RadialScale(0.002), RadialScale(-0.003, 0.002, 0.001)):
        np.testing.assert_allclose(scale.unscaled(scale.scaled(points)), points, atol=1e-12)


def test_what_is_no_scale_is_refused():
    for fields, message in (((-1.0,), "above −1"), ((np.nan,), "above −1"), ((0.0, np.inf), "finite")):
        with pytest.raises(ValueError, match=message):
            RadialScale(*fields)

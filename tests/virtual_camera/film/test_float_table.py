"""A function as a table over float bits: as exact as it says over the whole range of light."""

import numpy as np

from relume.virtual_camera.film.float_table import mapped, tabulated


def test_the_table_follows_the_function_over_eighty_octaves():
    light = np.exp2(np.random.default_rng(0).uniform(-39, 39, (200, 90, 3))).astype(np.float32)
    tables = np.stack([tabulated(f) for f in (np.log2, np.sqrt, lambda x: np.tanh(x))])
    out = mapped(light, 1.0, tables)
    exact = light.astype(np.float64)
    np.testing.assert_allclose(out[..., 0], np.log2(exact[..., 0]), atol=4e-6)
    np.testing.assert_allclose(out[..., 1], np.sqrt(exact[..., 1]), rtol=1e-6)
    np.testing.assert_allclose(out[..., 2], np.tanh(exact[..., 2]), atol=2e-6)


def test_the_factor_is_on_the_light_and_beyond_the_ends_the_ends_count():
    table = np.stack([tabulated(lambda x: x)] * 3)
    light = np.array([[[0.0, 1e-30, 1.5], [1e30, np.inf, 3e-12]]], np.float32)
    out = mapped(light, 2.0, table)
    np.testing.assert_allclose(out[0, :, 2], [3.0, 6e-12], rtol=1e-6)
    np.testing.assert_allclose(out[0, 0, :2], 2.0**-40, rtol=1e-6)
    np.testing.assert_allclose(out[0, 1, :2], 2.0**40, rtol=1e-6)


def test_the_light_stays_as_it_was_and_may_be_a_view():
    light = np.random.default_rng(1).random((8, 10, 3), np.float32)
    before = light.copy()
    table = np.stack([tabulated(np.sqrt)] * 3)
    turned = mapped(light[:, ::-1], 1.0, table)
    np.testing.assert_array_equal(turned[:, ::-1], mapped(light, 1.0, table))
    np.testing.assert_array_equal(light, before)

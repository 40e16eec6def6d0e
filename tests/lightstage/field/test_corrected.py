"""Uneven, coloured and partly hidden lights come out as even ones of irradiance 1, block by block, noise with them."""

from __future__ import annotations

import numpy as np
import pytest

from relume.lightstage.field.corrected import Corrected, _bands, estimate_noise
from relume.lightstage.field.fall_off import FlatField, NearLights, flat_field_of_board, points_on_plane
from relume.lightstage.field.field import Noise, Pictures, whole
from relume.lightstage.field.invalid_samples import PackedMask
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised

COUNT, HEIGHT, WIDTH = 40, 10, 12
LIGHTS = StageLights.towards(even_directions(COUNT))
EVERYTHING = slice(0, COUNT), slice(0, HEIGHT)


def smooth_values() -> np.ndarray:
    """A matte, smooth subject (40, 10, 12, 3)."""
    normals = even_directions(HEIGHT * WIDTH)
    shade = 1.3 + LIGHTS.directions @ normals.T
    return (shade.reshape(COUNT, HEIGHT, WIDTH, 1) * [0.3, 0.2, 0.1]).astype(np.float32)


def some_gains() -> np.ndarray:
    return np.random.default_rng(1).uniform(0.5, 2.0, (COUNT, 3))


def leaning() -> FlatField:
    coefficients = np.zeros((COUNT, 6))
    coefficients[:, 1:] = np.random.default_rng(2).uniform(-0.2, 0.2, (COUNT, 5))
    return FlatField(coefficients, (HEIGHT, WIDTH))


def some_mask() -> np.ndarray:
    return np.random.default_rng(3).random((COUNT, HEIGHT, WIDTH)) < 0.2


def test_gains_patterns_and_masks_together_give_back_the_even_field() -> None:
    even, gains, flat = smooth_values(), some_gains(), leaning()
    taken = even / gains[:, None, None].astype(np.float32) * flat.pattern(*EVERYTHING)[..., None]
    masked = some_mask()
    taken[masked] = 77
    # Either of two masks may call a value empty.
    parts = masked & (np.arange(WIDTH) < 7), masked & (np.arange(WIDTH) > 4)
    field = Corrected(Pictures(taken, LIGHTS), gains, flat, [PackedMask.of(part) for part in parts])
    np.testing.assert_allclose(whole(field)[~masked], even[~masked], rtol=2e-6)
    error = np.abs(whole(field) - even)[masked].sum() / even[masked].sum()
    assert error < 0.05


def test_blocks_are_the_same_bytes_as_the_whole() -> None:
    field = Corrected(Pictures(smooth_values(), LIGHTS), some_gains(), leaning(), [PackedMask.of(some_mask())])
    everything = whole(field)
    for lights, rows in ((slice(0, 40), slice(5, 6)), (slice(7, 9), slice(0, 10)), (slice(39, 40), slice(8, 10))):
        assert np.array_equal(field.block(lights, rows), everything[lights, rows])


def test_bands_of_rows_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    field = Corrected(Pictures(smooth_values(), LIGHTS), masks=[PackedMask.of(some_mask())])
    everything = whole(field)
    monkeypatch.setattr("relume.lightstage.field.corrected._WORKING_MEMORY", 3 * COUNT * WIDTH * 12)
    assert np.array_equal(whole(field), everything)


def test_nothing_to_correct_is_the_field_itself() -> None:
    field = Pictures(smooth_values(), LIGHTS, noise=Noise(1e-4, 1e-3))
    corrected = Corrected(field)
    assert np.array_equal(whole(corrected), whole(field)) and corrected.noise == field.noise
    assert corrected.shape == field.shape and corrected.lights is LIGHTS and corrected.camera is None


def test_twice_the_gain_is_four_times_the_constant_and_twice_the_slope() -> None:
    field = Corrected(Pictures(smooth_values(), LIGHTS, noise=Noise(1e-4, 1e-3)), np.full((COUNT, 3), 2.0))
    assert field.noise is not None
    assert (field.noise.constant, field.noise.slope) == pytest.approx((4e-4, 2e-3))


def test_noise_that_was_measured_goes_before_the_field_s_own() -> None:
    gains = np.full((COUNT, 3), 2.0)
    unknown = Corrected(Pictures(smooth_values(), LIGHTS), gains, measured_noise=Noise(1e-4, 1e-3))
    assert unknown.noise is not None
    assert (unknown.noise.constant, unknown.noise.slope) == pytest.approx((4e-4, 2e-3))
    known = Corrected(Pictures(smooth_values(), LIGHTS, noise=Noise(9.0)), measured_noise=Noise(1e-4))
    assert known.noise == Noise(1e-4)


def test_noise_through_gains_and_patterns_is_that_of_noisy_pictures() -> None:
    rng = np.random.default_rng(4)
    noise = rng.normal(0, 0.02, (COUNT, HEIGHT, WIDTH, 3)).astype(np.float32)
    taken = Pictures(np.full_like(noise, 0.5), LIGHTS, noise=Noise(0.02**2))
    gains, flat = some_gains(), leaning()
    noisy = Corrected(Pictures(taken.values + noise, LIGHTS), gains, flat)
    clean = Corrected(taken, gains, flat)
    assert clean.noise is not None
    assert clean.noise.constant == pytest.approx(float(np.var(whole(noisy) - whole(clean))), rel=0.03)


def noisy(constant: float, slope: float) -> Pictures:
    """A smooth subject of levels from 0.05 to 1 with noise of that variance, positive."""
    ramp = np.linspace(0.05, 1, 128)[None, None, :, None] * np.linspace(0.6, 1, 6)[:, None, None, None]
    values = ramp * np.ones((96, 128, 3))
    values = values + np.sqrt(constant + slope * values) * np.random.default_rng(0).standard_normal(values.shape)
    return Pictures(np.maximum(values, 0).astype(np.float32), StageLights.towards(even_directions(6)))


@pytest.mark.parametrize(("constant", "slope"), [(1e-4, 0.0), (1e-5, 4e-4), (0.0, 1e-3)])
def test_noise_is_read_off_smooth_pictures(constant: float, slope: float) -> None:
    found = estimate_noise(noisy(constant, slope))
    for level in (0.1, 0.5, 0.9):
        assert found.constant + found.slope * level == pytest.approx(constant + slope * level, rel=0.2)


def test_black_cloth_around_the_subject_does_not_hide_its_noise() -> None:
    taken = noisy(1e-5, 4e-4)
    framed = np.full((6, 240, 320, 3), 0.01, np.float32)
    framed[:, 70:166, 90:218] = taken.values
    found = estimate_noise(Pictures(framed, taken.lights))
    assert found.constant + found.slope * 0.5 == pytest.approx(1e-5 + 2e-4, rel=0.2)


def test_noise_of_large_pictures_is_read_off_bands_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("relume.lightstage.field.corrected._NOISE_MEMORY", 70 * 6 * 8 * 6 * 128 * 3)
    bands = _bands(96, 70)
    np.testing.assert_array_equal(bands[:, 0], [8, 56])
    found = estimate_noise(noisy(1e-5, 4e-4))
    assert found != estimate_noise(Pictures(noisy(1e-5, 4e-4).values[:, :70], noisy(1e-5, 4e-4).lights))
    assert found.constant + found.slope * 0.5 == pytest.approx(1e-5 + 2e-4, rel=0.2)
    assert _bands(40, 70).shape == (1, 40) and _bands(5000, 3).shape == (1, 32)
    assert _bands(4000, 93).max() < 4000


def test_pictures_without_noise_have_that_of_their_rounding() -> None:
    clean = noisy(0.0, 0.0)
    assert estimate_noise(clean).constant < 1e-12
    assert estimate_noise(clean, step=1 / 255).constant == pytest.approx((1 / 255) ** 2 / 12)


def test_dark_pictures_say_no_noise() -> None:
    dark = Pictures(np.zeros((6, 20, 20, 3), np.float32), StageLights.towards(even_directions(6)))
    with pytest.raises(ValueError, match="the pictures are dark"):
        estimate_noise(dark)


BOARD = (72, 96)
THREE = StageLights.towards(even_directions(3))
CAMERA = Camera.looking_at(np.array([0, 0, 3.0]), np.zeros(3), width=96, height=72, focal_length=144.0)
"""Two metres across at the subject."""


def near() -> np.ndarray:
    """Patterns (3, 72, 96) of lamps in front, twice as far as the picture is wide."""
    positions = 4.0 * normalised([[0, 0, 1], [1, 0, 1], [0.5, 1, 0.5]])
    points = points_on_plane(CAMERA, np.zeros(3), np.array([0, 0, 1.0]))
    return NearLights(positions, points, np.zeros(3)).pattern(slice(0, 3), slice(0, 72))


def test_pixels_of_a_plane_lie_on_it_and_are_seen_where_they_are() -> None:
    camera = Camera(8, 6, 10.0, np.array([0.0, 1.0, 0.0]), np.eye(3))
    floor = points_on_plane(camera, np.zeros(3), np.array([0.0, 2.0, 0.0]))
    assert np.isnan(floor[:3]).all()
    np.testing.assert_allclose(floor[3:, :, 1], 0, atol=1e-12)
    assert camera.project(floor[4, 2]) == pytest.approx((2.5, 4.5))


def test_a_lamp_at_half_the_distance_is_four_times_as_bright() -> None:
    points = np.array([[[0.0, 0, 0], [0, 0, -2.0]], [[2.0, 0, 2.0], [0, 0, 1.0]]])
    pattern = NearLights(np.array([[0, 0, 2.0]]), points, np.zeros(3)).pattern(slice(0, 1), slice(0, 2))
    np.testing.assert_allclose(pattern, [[[1, 0.25], [1, 4]]])
    with pytest.raises(ValueError, match="stands in the subject"):
        NearLights(np.zeros((1, 3)), points, np.ones(3)).pattern(slice(0, 1), slice(0, 1))


def test_a_board_shows_the_pattern_of_near_lamps_with_dust_and_noise_on_it() -> None:
    pattern = near()
    board = 0.8 * pattern[..., None] * (1 + 0.01 * np.random.default_rng(6).standard_normal((3, *BOARD, 3)))
    board[:, ::7, ::5] *= 0.5
    flat = flat_field_of_board(Pictures(board.astype(np.float32), THREE)).pattern(slice(0, 3), slice(0, 72))
    expected = pattern / pattern.mean(axis=(1, 2), keepdims=True)
    assert pattern[1].max() / pattern[1].min() > 1.5
    assert np.abs(flat / expected - 1).max() < 0.03
    np.testing.assert_allclose(flat.mean(axis=(1, 2)), 1, rtol=1e-5)


def test_a_light_that_the_board_does_not_show_stays_even_and_is_reported() -> None:
    board = np.full((3, *BOARD, 3), 0.5, np.float32)
    board[1] = 0
    with pytest.warns(UserWarning, match="1 of 3 lights do not show on the board"):
        flat = flat_field_of_board(Pictures(board, THREE))
    np.testing.assert_allclose(flat.pattern(slice(0, 3), slice(10, 20)), 1, rtol=1e-6)


def test_a_dark_board_is_refused() -> None:
    with pytest.raises(ValueError, match="the board is dark under every light"):
        flat_field_of_board(Pictures(np.zeros((3, *BOARD, 3), np.float32), THREE))

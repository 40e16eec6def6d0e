"""Differential rendering: what the objects change is added to the plate, and nothing else happens to it; layers."""

import numpy as np
import pytest

from relume.composite.differential import differential, over


def plate_of(height: int = 6, width: int = 9) -> np.ndarray:
    """A plate whose every value says where it is, over many stops."""
    y, x, c = np.indices((height, width, 3))
    return (2.0 ** (x - 4) * (1 + 0.37 * y) + c / 7).astype(np.float32)


def pixel(*values: float) -> np.ndarray:
    return np.array(values, np.float32).reshape(1, 1, 3)


def test_adding_nothing_returns_the_plate_to_the_byte():
    plate = plate_of()
    plate[0, 0] = [0.0, 1e-38, 1e-45]
    plate[0, 1] = [3e38, np.float32(1) / 3, 7e-12]
    plate[0, 2] = [-0.0, -0.25, -1e-40]  # a filtered plate may fall below zero; that is not ours to mend
    # The renders are of another scale and may be anything, as long as they are the same.
    for render in (np.zeros_like(plate), plate, plate_of() * np.float32(1e6), plate_of()[::-1].copy()):
        result = differential(plate, render, render.copy(), np.zeros(plate.shape[:2], np.float32))
        assert result.tobytes() == plate.tobytes() and result.dtype == np.float32


def test_pixels_beside_a_change_keep_every_bit():
    plate = plate_of()
    without = plate * np.float32(1.1)
    with_ = without.copy()
    with_[2, 3] *= np.float32(0.5)
    matte = np.zeros(plate.shape[:2], np.float32)
    matte[4, 4:6] = [0.25, 1.0]
    result = differential(plate, with_, without, matte)
    touched = np.zeros(plate.shape[:2], bool)
    touched[2, 3] = touched[4, 4] = touched[4, 5] = True
    assert result[~touched].tobytes() == plate[~touched].tobytes()
    assert np.all(result[touched] != plate[touched])


@pytest.mark.parametrize(
    "matte, expected",
    [
        # with 2, 0.5, 8; without 4, 0.25, 8; plate 3, 1, 5: plate + with − without = 1, 1.25, 5
        (0.0, (1.0, 1.25, 5.0)),
        (0.25, (0.25 * 2 + 0.75 * 1, 0.25 * 0.5 + 0.75 * 1.25, 0.25 * 8 + 0.75 * 5)),
        (0.5, (1.5, 0.875, 6.5)),
        (1.0, (2.0, 0.5, 8.0)),
    ],
)
def test_matte_with_plus_the_rest_of_plate_with_without(matte, expected):
    result = differential(pixel(3, 1, 5), pixel(2, 0.5, 8), pixel(4, 0.25, 8), np.array([[matte]], np.float32))
    np.testing.assert_array_equal(result[0, 0], np.array(expected, np.float32))


def test_the_matte_may_be_of_any_float():
    arguments = pixel(3, 1, 5), pixel(2, 0.5, 8), pixel(4, 0.25, 8)
    for kind in (np.float16, np.float32, np.float64):
        np.testing.assert_array_equal(differential(*arguments, np.array([[0.5]], kind))[0, 0], [1.5, 0.875, 6.5])


def test_no_radiance_falls_below_zero():
    # A shadow rendered deeper than the plate is bright: the paper's negative LS_final.
    result = differential(pixel(1, 1, 1), pixel(0, 1, 2), pixel(5, 2.5, 4), np.zeros((1, 1)))
    np.testing.assert_array_equal(result[0, 0], [0, 0, 0])
    result = differential(pixel(1, 1, 1), pixel(0, 1, 2), pixel(5, 2.5, 4), np.array([[0.75]]))
    np.testing.assert_array_equal(result[0, 0], [0, 0.625, 1.25])
    generator = np.random.default_rng(0)
    plate, with_, without = generator.random((3, 20, 30, 3), np.float32)
    assert differential(plate, with_, 4 * without, generator.random((20, 30))).min() == 0


@pytest.mark.parametrize("scale", [0.25, 3.0, 1e5])
def test_scaling_all_light_scales_the_picture(scale):
    generator = np.random.default_rng(1)
    plate, with_, without = generator.random((3, 20, 30, 3), np.float32)
    matte = generator.random((20, 30))
    k = np.float32(scale)
    np.testing.assert_allclose(
        differential(k * plate, k * with_, k * without, matte),
        k * differential(plate, with_, without, matte),
        # What a subtraction of float32 values leaves, against the size of what was subtracted.
        rtol=1e-5,
        atol=2e-6 * scale,
    )


def test_an_object_that_covers_a_pixel_hides_the_plate():
    with_ = plate_of()
    bright = differential(1000 * plate_of(), with_, 0.3 * with_, np.ones((6, 9)))
    np.testing.assert_array_equal(bright, with_)


@pytest.mark.parametrize("which", range(4))
def test_pictures_of_different_sizes_are_refused(which):
    arguments = [plate_of(), plate_of(), plate_of(), np.zeros((6, 9), np.float32)]
    arguments[which] = arguments[which][:, :-1]
    with pytest.raises(ValueError, match=r"differ in size; render with a camera of the plate's size"):
        differential(*arguments)


def test_no_argument_is_changed():
    plate, with_, without, matte = plate_of(), 2 * plate_of(), plate_of() / 2, np.full((6, 9), 0.5, np.float32)
    copies = [a.copy() for a in (plate, with_, without, matte)]
    differential(plate, with_, without, matte)
    for array, copy in zip((plate, with_, without, matte), copies, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_the_foreground_covers_by_its_matte_and_the_rest_keeps_its_bits():
    plate = np.random.default_rng(0).random((2, 3, 3), dtype=np.float32)
    foreground, matte = np.zeros((2, 3, 3), np.float32), np.zeros((2, 3), np.float32)
    foreground[0, 1], matte[0, 1] = (3, 2, 1), 1
    foreground[1, 2], matte[1, 2] = (0.5, 0.5, 0.5), 0.25
    picture = over(foreground, matte, plate)
    np.testing.assert_array_equal(picture[0, 1], [3, 2, 1])
    np.testing.assert_allclose(picture[1, 2], 0.5 + 0.75 * plate[1, 2], rtol=1e-6)
    np.testing.assert_array_equal(picture[matte == 0], plate[matte == 0])


def test_layers_of_other_sizes_are_refused():
    with pytest.raises(ValueError, match="differ in size; render with a camera of the plate's size"):
        over(np.zeros((2, 3, 3)), np.zeros((2, 3)), np.zeros((3, 2, 3)))

"""LEDs as a camera sees them: primaries, their confusion, and what a mix does to other colours than white."""

import numpy as np
import pytest

from relume.image import files
from relume.image.radiance import RadianceMap
from relume.light.spectra.spectrum import Spectrum, illuminant, visible
from relume.lightstage.driving.driving import drive
from relume.lightstage.driving.led_calibration import (
    PrimaryPatches,
    calibrate_primaries,
    camera_to_rec709,
    match_patches,
    patches_from_photographs,
    patches_from_spectra,
)
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.sphere.environment_map import EnvironmentMap


def band(middle: float, width: float, height: float = 1.0) -> Spectrum:
    lengths = visible()
    values = height * np.exp(-0.5 * ((lengths - middle) / width) ** 2)
    return Spectrum(tuple(lengths.tolist()), tuple(values.tolist()))


WHITE = Spectrum((380.0, 780.0), (1.0, 1.0))
SURFACES = [WHITE, *(band(middle, 45, 0.8) for middle in (450, 500, 550, 600, 650))]
CAMERA = [band(600, 35), band(540, 40), band(460, 30)]
LEDS = {"red": band(630, 10), "green": band(525, 15), "blue": band(460, 10)}


def test_primaries_are_the_white_s_radiance_times_pi_over_its_reflectance():
    values = np.array([[[0.5, 0.1, 0.0]], [[0.1, 0.6, 0.1]], [[0.0, 0.1, 0.4]]])
    found = calibrate_primaries(PrimaryPatches(("r", "g", "b"), values, reflectance=0.5), maximum=3.0)
    np.testing.assert_allclose(found.primaries.irradiance, 2 * np.pi * values[:, 0])
    assert found.primaries.maximum == 3
    # A wish goes through the matrix to intensities that make it.
    wish = np.array([1.0, 2.0, 0.7])
    np.testing.assert_allclose((found.mixing @ wish) @ found.primaries.irradiance, wish)
    np.testing.assert_allclose(found.crosstalk, [1 / 6, 2 / 8, 1 / 5])


def test_confusion_is_1_for_pure_primaries_and_grows_as_two_become_alike():
    pure = calibrate_primaries(PrimaryPatches(("r", "g", "b"), np.eye(3)[:, None]))
    assert pure.condition == 1 and pure.twins is not None and pure.twins[2] == pytest.approx(np.pi / 2)
    # Two unit vectors at angle a beside a third at right angles: √((1 + cos a) / (1 − cos a)).
    angle = 0.2
    mixed = np.array([[1, 0, 0], [np.cos(angle), np.sin(angle), 0], [0, 0, 1]])[:, None]
    close = calibrate_primaries(PrimaryPatches(("a", "b", "c"), mixed))
    assert close.condition == pytest.approx(1 / np.tan(0.1), rel=1e-9)
    assert close.twins == ("a", "b", pytest.approx(0.2))
    with pytest.warns(UserWarning, match=r"hardly distinguishes a, b, c \(condition inf\); a and c are 0\.0 degrees"):
        calibrate_primaries(PrimaryPatches(("a", "b", "c"), np.eye(3)[[0, 1, 0]][:, None]))


def test_spectra_and_photographs_of_the_same_chart_give_the_same_primaries(tmp_path):
    seen = patches_from_spectra(LEDS, SURFACES, CAMERA)
    assert seen.reflectance == 1
    # The red LED's light on white, by the integral of two Gaussians.
    expected = 10 * 35 * np.sqrt(2 * np.pi / (10**2 + 35**2)) * np.exp(-0.5 * 30**2 / (10**2 + 35**2))
    assert seen.values[0, 0, 0] == pytest.approx(expected, rel=1e-4)
    rectangles = [(10 * number, 2, 8, 6) for number in range(6)]
    for name, patches in zip(LEDS, seen.values, strict=True):
        picture = np.zeros((10, 60, 3), np.float32)
        for (left, top, width, height), colour in zip(rectangles, patches, strict=True):
            picture[top : top + height, left : left + width] = colour
        files.write(tmp_path / f"{name}.exr", RadianceMap(picture))
    paths = {name: tmp_path / f"{name}.exr" for name in LEDS}
    photographed = patches_from_photographs(paths, rectangles, reflectance=1.0)
    one, other = calibrate_primaries(seen), calibrate_primaries(photographed)
    np.testing.assert_allclose(other.primaries.irradiance, one.primaries.irradiance, rtol=1e-6, atol=1e-6)
    assert 1.2 < one.condition < 2
    with pytest.raises(ValueError, match="no patch at 55,2,8,6 in 60×10 pixels"):
        patches_from_photographs(paths, [(55, 2, 8, 6)])


def test_a_mix_that_matches_white_misses_other_colours_and_more_leds_miss_less():
    tungsten = illuminant("A").at(visible())
    light = Spectrum(tuple(visible().tolist()), tuple((tungsten / tungsten.max()).tolist()))
    wanted = patches_from_spectra({"A": light}, SURFACES, CAMERA).values[0]
    three = match_patches(patches_from_spectra(LEDS, SURFACES, CAMERA), wanted)
    # White itself is matched; a surface that reflects between the LEDs is not.
    assert three.errors[0] < 1e-9 and 0.1 < three.errors[1:].max() < 0.5
    more = {**LEDS, "amber": band(595, 10), "white": band(560, 60)}
    five = patches_from_spectra(more, SURFACES, CAMERA)
    whole_chart = match_patches(five, wanted, others=1.0)
    assert whole_chart.errors.mean() < 0.35 * three.errors.mean()
    with pytest.raises(ValueError, match="a colour a surface"):
        match_patches(five, wanted[:3])


def test_a_camera_that_sees_as_the_eye_needs_only_its_own_matrix_and_drives_a_stage():
    found = camera_to_rec709(CAMERA, SURFACES)
    seen = patches_from_spectra({"D65": illuminant("D65")}, [WHITE], CAMERA).values[0, 0]
    # White of D65 is white within what a camera unlike the eye leaves.
    np.testing.assert_allclose(found @ seen, [1, 1, 1], atol=0.05)
    lamps = calibrate_primaries(patches_from_spectra(LEDS, SURFACES, CAMERA), found).primaries
    stage = StageLights.towards(even_directions(20))
    result = drive(stage, EnvironmentMap(np.ones((16, 32, 3), np.float32)), lamps)
    np.testing.assert_allclose(result.irradiances.sum(axis=0), 4 * np.pi, rtol=0.02)


def test_an_led_that_was_off_is_refused():
    with pytest.raises(ValueError, match="dark under g"):
        PrimaryPatches(("r", "g"), np.array([[[1.0, 0, 0]], [[0, 0, 0]]]))
    with pytest.raises(ValueError, match="2 sensitivities"):
        patches_from_spectra(LEDS, SURFACES, CAMERA[:2])

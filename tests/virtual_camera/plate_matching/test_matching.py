"""Matching: rendered planes drawn as the plate's lens draws, and set into its photograph with its grain."""

from dataclasses import replace

import numpy as np
import pytest

from relume.capture.lens.vignetting import Vignetting
from relume.composite.differential import Ratio, composed
from relume.image import bands
from relume.image.photograph import Photograph
from relume.renderers.results import Change
from relume.virtual_camera.film.grain import Grain
from relume.virtual_camera.plate_matching import matching
from relume.virtual_camera.plate_matching.matching import (
    Match,
    add_grain,
    apply_vignetting,
    composite_into_photograph,
    grain_share,
    match_to_plate,
)
from relume.virtual_camera.plate_matching.sharpness import Sharpness

SIZE = (60, 80)


def grain_of(*deviations: float) -> Grain:
    """White noise whose deviation is `deviations` at values evenly over 0 to 255."""
    correlation = np.zeros((3, 3, 7, 7))
    correlation[np.arange(3), np.arange(3), 3, 3] = 1
    return Grain(
        np.tile(np.linspace(0, 255, len(deviations)), (3, 1)), np.tile(np.array(deviations), (3, 1)), correlation
    )


def change() -> Change:
    generator = np.random.default_rng(0)
    objects, difference = generator.random((2, *SIZE, 3), np.float32)
    matte = np.zeros(SIZE, np.float32)
    matte[20:40, 20:40] = 1
    objects[matte == 0] = 0
    difference -= 0.5
    difference[:, 50:] = difference[matte == 1] = 0
    none = np.zeros((*SIZE, 3), np.float32)
    return Change(objects, difference, matte, none[..., 0], none, none, objects**2, none + 1)


def test_with_nothing_measured_nothing_is_done():
    one, picture = change(), np.random.default_rng(1).random((*SIZE, 3), np.float32)
    assert match_to_plate(one, Match()) is one
    assert add_grain(picture, one.matte, Match()) is picture and apply_vignetting(picture, Match()) is picture


def test_the_fall_off_dims_all_that_was_rendered_and_its_variance_by_the_square():
    vignetting = Vignetting((-0.4, 0.1))
    one, falloff = change(), vignetting.falloff((80, 60))[..., None]
    dim = match_to_plate(one, Match(vignetting=vignetting))
    np.testing.assert_allclose(dim.objects, one.objects * falloff, rtol=1e-6)
    np.testing.assert_allclose(dim.difference, one.difference * falloff, rtol=1e-6)
    np.testing.assert_allclose(dim.objects_variance, one.objects_variance * falloff**2, rtol=1e-6)
    np.testing.assert_allclose(dim.difference_variance, falloff**2 * np.ones(3), rtol=1e-6)
    np.testing.assert_array_equal(dim.matte, one.matte)
    assert falloff.min() < 0.75 and dim.objects.dtype == np.float32


def test_compositing_into_a_vignetted_plate_is_vignetting_the_composite():
    # The truth: the place with its objects, photographed through the lens. By sum and by ratio alike.
    one, match = change(), Match(vignetting=Vignetting((-0.4,)))
    place = np.full((*SIZE, 3), 2, np.float32)
    expected = apply_vignetting(composed(place, one), match)
    plate = apply_vignetting(place, match)
    np.testing.assert_allclose(composed(plate, match_to_plate(one, match)), expected, rtol=1e-5)
    without = apply_vignetting(0.5 * place, match)
    picture = composed(
        plate, match_to_plate(replace(one, difference=one.difference / 2), match), mode=Ratio(without, floor=1e-4)
    )
    np.testing.assert_allclose(picture, expected, rtol=1e-4)


def test_the_fall_off_comes_before_the_blur():
    one, vignetting, sharpness = change(), Vignetting((-0.9,)), Sharpness(1.0)
    both = match_to_plate(one, Match(vignetting, sharpness))
    np.testing.assert_array_equal(both.objects, sharpness.apply(match_to_plate(one, Match(vignetting))).objects)
    np.testing.assert_array_equal(both.matte, sharpness.blurred(one.matte))


def test_a_plate_in_strips_is_matched_as_in_one_and_each_plane_is_put_away(monkeypatch: pytest.MonkeyPatch):
    one, match = change(), Match(Vignetting((-0.4,)), Sharpness(1.3))
    plate = np.random.default_rng(3).random((*SIZE, 3), np.float32) + 0.1
    whole, away = match_to_plate(one, match, plate), []

    def put_away(plane: np.ndarray) -> np.ndarray:
        away.append(plane.copy())
        return away[-1]

    monkeypatch.setattr(matching, "ROWS", 7)
    strips = match_to_plate(one, match, plate, put_away=put_away)
    for name in ("objects", "difference", "matte", "objects_variance", "difference_variance"):
        np.testing.assert_array_equal(getattr(strips, name), getattr(whole, name), err_msg=name)
        assert any(getattr(strips, name) is each for each in away), name


def test_grain_fills_up_what_the_covered_share_of_the_plates_grain_lacks():
    np.testing.assert_allclose(grain_share(np.array([[0, 0.5, 1]])), [[0, np.sqrt(0.75), 1]])
    matte = np.full((200, 200), 0.5)
    generator = np.random.default_rng(2)
    plate = np.full((200, 200, 3), 100.0) + 4 * generator.standard_normal((200, 200, 3))
    match = Match(radiance_grain=grain_of(4, 4))
    picture = add_grain((0.5 * plate + 50).astype(np.float32), matte, match)
    assert picture.std() == pytest.approx(4, rel=0.02)


def test_grain_of_the_radiance_stays_on_the_objects():
    one = change()
    picture = np.full((*SIZE, 3), 3, np.float32)
    noisy = add_grain(picture, one.matte, Match(radiance_grain=grain_of(1, 1), seed=4))
    assert noisy[one.matte == 0].tobytes() == picture[one.matte == 0].tobytes()
    assert noisy[one.matte == 1].std() == pytest.approx(1, rel=0.1) and noisy.dtype == np.float32
    assert np.all(add_grain(picture * 0, one.matte, Match(radiance_grain=grain_of(9, 9))) >= 0)
    np.testing.assert_array_equal(noisy, add_grain(picture, one.matte, Match(radiance_grain=grain_of(1, 1), seed=4)))
    assert np.any(noisy != add_grain(picture, one.matte, Match(radiance_grain=grain_of(1, 1), seed=5)))


def photographed(before: np.ndarray, deviation: float, kind: type = np.uint8) -> Photograph:
    scale = np.iinfo(kind).max / 255
    noise = deviation * np.random.default_rng(6).standard_normal(before.shape)
    return Photograph(np.rint(np.clip((before + noise) * scale, 0, np.iinfo(kind).max)).astype(kind))


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_where_nothing_changed_the_photographs_bytes_stay(kind):
    before = np.full((*SIZE, 3), 120.3)
    picture, matte = before.copy(), np.zeros(SIZE)
    picture[30:, :20], picture[10:20, 40:60], matte[10:20, 40:60] = 60, 200, 1
    photograph = photographed(before, 3, kind)
    result = composite_into_photograph(photograph, picture, before, matte, Match(photograph_grain=grain_of(3, 3)))
    same = np.all(picture == before, axis=-1) & (matte == 0)
    assert result.pixels.dtype == kind
    assert result.pixels[same].tobytes() == photograph.pixels[same].tobytes()
    values = result.pixels / (np.iinfo(kind).max / 255)
    # The values are whole numbers less 120.3, plus 60: 0.3 is what rounding makes of them all.
    assert values[30:, :20].mean() == pytest.approx(60, abs=0.31)
    assert values[10:20, 40:60].mean() == pytest.approx(200, abs=0.5)


def test_the_objects_have_the_grain_of_the_surroundings():
    before, matte = np.full((100, 200, 3), 120.0), np.zeros((100, 200))
    matte[:, 100:], matte[:, 80:100] = 1, 0.5
    photograph = photographed(before, 3)
    result = composite_into_photograph(
        photograph, before.copy(), before, matte, Match(photograph_grain=grain_of(3, 3))
    ).pixels
    for part in (result[:, :80], result[:, 80:100], result[:, 100:]):
        assert part.std() == pytest.approx(3, rel=0.03)
    # Without any grain measured the objects are smooth.
    assert composite_into_photograph(photograph, before.copy(), before, matte, Match()).pixels[:, 100:].std() == 0


def test_rows_of_a_photograph_get_the_grain_that_they_get_in_the_whole():
    before, matte = np.full((100, 200, 3), 120.0), np.zeros((100, 200))
    matte[20:80, 100:] = 1
    photograph, match = photographed(before, 3), Match(photograph_grain=grain_of(3, 3), seed=2)
    whole = composite_into_photograph(photograph, before + 9, before, matte, match).pixels
    noise = grain_of(3, 3).draw((200, 100), seed=2)
    for rows in (slice(0, 37), slice(37, 100)):
        part = replace(photograph, pixels=photograph.pixels[rows])
        own = composite_into_photograph(part, before[rows] + 9, before[rows], matte[rows], match, noise[rows])
        assert own.pixels.tobytes() == whole[rows].tobytes()


def test_rows_at_a_time_softens_and_grains_as_at_once(monkeypatch):
    one, picture = change(), np.random.default_rng(1).random((*SIZE, 3), np.float32)
    whole = Sharpness(0.8).apply(one), add_grain(picture, one.matte, Match(radiance_grain=grain_of(1, 1)))
    monkeypatch.setattr(bands, "BAND", 500)
    parts = Sharpness(0.8).apply(one), add_grain(picture, one.matte, Match(radiance_grain=grain_of(1, 1)))
    assert parts[1].tobytes() == whole[1].tobytes()
    for name in ("objects", "difference", "matte", "objects_variance"):
        assert getattr(parts[0], name).tobytes() == getattr(whole[0], name).tobytes(), name


def test_in_a_shadow_the_photographs_own_grain_becomes_that_of_the_darker_value():
    before, matte = np.full((100, 200, 3), 204.0), np.zeros((100, 200))
    picture = before.copy()
    picture[:, 100:] = 90.3
    photograph = photographed(before, 8)
    result = composite_into_photograph(
        photograph, picture, before, matte, Match(photograph_grain=grain_of(0, 2, 4, 6, 8, 10))
    )
    # A deviation of 90.3 · 8 / 204, rounded twice.
    assert result.pixels[:, 100:].std() == pytest.approx(np.sqrt((90.3 * 8 / 204) ** 2 + 2 / 12), rel=0.03)
    assert result.pixels[:, :100].std() == pytest.approx(8, rel=0.03)
    own = photograph.pixels[:, 100:] - 204.0
    assert np.corrcoef(own.ravel(), result.pixels[:, 100:].ravel())[0, 1] > 0.9


def test_where_the_photograph_was_white_a_shadow_gets_grain_of_its_own():
    before, matte = np.full((100, 100, 3), 255.0), np.zeros((100, 100))
    white = Photograph(np.full((100, 100, 3), 255, np.uint8))
    result = composite_into_photograph(white, before - 100, before, matte, Match(photograph_grain=grain_of(3, 3)))
    assert result.pixels.std() == pytest.approx(3, rel=0.05) and result.pixels.mean() == pytest.approx(155, abs=0.1)


def test_what_is_white_or_black_is_so_without_grain():
    before, matte = np.full((20, 40, 3), 100.0), np.ones((20, 40))
    picture = before.copy()
    picture[:, :20], picture[:, 20:30] = 255, 0
    result = composite_into_photograph(
        photographed(before, 3), picture, before, matte, Match(photograph_grain=grain_of(3, 3))
    ).pixels
    assert np.all(result[:, :20] == 255) and np.all(result[:, 20:30] == 0) and result[:, 30:].std() > 2


def test_pictures_of_another_size_are_refused():
    values = np.zeros((10, 12, 3))
    photograph = Photograph(np.zeros((10, 12, 3), np.uint8))
    with pytest.raises(ValueError, match="differ in size; develop them at the photograph's size"):
        composite_into_photograph(photograph, values[:9], values, np.zeros((10, 12)), Match())
    with pytest.raises(ValueError, match="differ in size"):
        composite_into_photograph(photograph, values, values, np.zeros((10, 11)), Match())

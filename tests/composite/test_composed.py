"""Compositing a rendered change: by sum and by ratio, behind real things, and what of the plate stays."""

import numpy as np
import pytest

from relume.composite.differential import Additive, Ratio, composed, differential
from relume.image import bands
from relume.renderers.results import Change


def change_of(objects: np.ndarray, difference: np.ndarray, matte: np.ndarray) -> Change:
    none = np.zeros_like(objects)
    return Change(objects, difference, matte, none[..., 0], none, none, none, none)


def plate_of(height: int = 5, width: int = 7) -> np.ndarray:
    """A plate whose every value says where it is."""
    y, x, c = np.indices((height, width, 3))
    return (0.5 + x + 0.37 * y + c / 7).astype(np.float32)


def nothing(height: int = 5, width: int = 7) -> Change:
    return change_of(np.zeros((height, width, 3), np.float32), np.zeros((height, width, 3), np.float32),
                     np.zeros((height, width), np.float32))  # fmt: skip


def test_what_is_neither_covered_nor_changed_keeps_every_bit():
    plate = plate_of()
    plate[0, 0] = [np.nan, -1e-40, 3e38]
    change = nothing()
    change.difference[2, 3], change.matte[4, 1], change.objects[4, 1] = -0.25, 0.5, 0.75
    touched = np.zeros((5, 7), bool)
    touched[2, 3] = touched[4, 1] = True
    for mode in (Additive(), Ratio(np.full_like(plate, 2.0)), Ratio(np.zeros_like(plate))):
        for occluder in (None, np.zeros((5, 7)), np.full((5, 7), 0.3)):
            picture = composed(plate, change, mode=mode, occluder=occluder)
            assert picture.dtype == np.float32
            assert picture[~touched].tobytes() == plate[~touched].tobytes()
            assert np.all(picture[touched] != plate[touched])


@pytest.mark.parametrize("mode", [Additive(), Ratio(plate_of(40, 30) / 2)])
def test_rows_at_a_time_give_the_picture_of_all_at_once(monkeypatch, mode):
    generator, plate = np.random.default_rng(5), plate_of(40, 30)
    objects, difference = generator.random((2, 40, 30, 3), np.float32)
    change = change_of(objects, difference - 9, generator.random((40, 30), np.float32))
    with pytest.warns(UserWarning, match="came out below 0") as whole_said:
        whole = composed(plate, change, mode=mode, occluder=np.eye(40, 30))
    monkeypatch.setattr(bands, "BAND", 100)
    with pytest.warns(UserWarning, match="came out below 0") as said:
        assert composed(plate, change, mode=mode, occluder=np.eye(40, 30)).tobytes() == whole.tobytes()
    assert str(said[0].message) == str(whole_said[0].message)


def test_the_sum_is_plate_less_its_covered_share_plus_both_planes():
    plate, change = plate_of(1, 1), nothing(1, 1)
    plate[0, 0] = [4, 2, 8]
    change.objects[0, 0], change.difference[0, 0], change.matte[0, 0] = [1, 0.5, 3], [-0.5, 0.25, 0], 0.25
    np.testing.assert_array_equal(composed(plate, change)[0, 0], [3 - 0.5 + 1, 1.5 + 0.25 + 0.5, 6 + 3])


def test_the_sum_is_what_differential_rendering_makes_of_two_pictures():
    generator = np.random.default_rng(0)
    plate, with_, without = generator.random((3, 20, 30, 3), np.float32)
    plate += 1  # so that nothing has to be held at 0
    matte = generator.random((20, 30), np.float32)
    cover = matte[..., None]
    change = change_of(cover * with_, (1 - cover) * (with_ - without), matte)
    np.testing.assert_allclose(composed(plate, change), differential(plate, with_, without, matte), rtol=1e-6)


def test_by_ratio_the_plate_keeps_its_texture_in_a_shadow():
    # The model is half as bright as the plate and even; the shadow takes 60 % of the light.
    plate, change = plate_of(), nothing()
    without = np.full_like(plate, 0.5)
    change.difference[:] = -0.6 * without
    change.matte[2, 2], change.difference[2, 2], change.objects[2, 2] = 0.5, -0.6 * 0.5 * 0.5, 7.0
    expected = 0.4 * plate
    expected[2, 2] = 0.5 * 0.4 * plate[2, 2] + 7
    # The floor draws the gain towards 1 by 1 % of what it differs from it.
    picture = composed(plate, change, mode=Ratio(without))
    np.testing.assert_allclose(picture, expected, rtol=0.02)
    exact = composed(plate, change, mode=Ratio(without, floor=1e-4))
    np.testing.assert_allclose(exact, expected, rtol=1e-6)


def test_the_gain_goes_smoothly_from_the_ratio_to_the_sum_where_the_model_is_dark():
    without = np.ones((1, 401, 3), np.float32)
    without[0, :200] = np.geomspace(1e-12, 0.99, 200)[:, None]
    gain = Ratio(without, floor=0.1).gain(np.full_like(without, 3.0))
    # Far below the floor 1, at the median the quotient 3 drawn to 1 by 1/101; no step between neighbours.
    np.testing.assert_allclose(gain[0, 0], 1, atol=1e-9)
    np.testing.assert_allclose(gain[0, -1], (3 + 0.01) / 1.01, rtol=1e-6)
    assert np.all(np.isfinite(gain)) and np.abs(np.diff(gain[0, :, 0])).max() < 1.5
    # A hole of the model adds as it was rendered, however dark.
    plate, change = plate_of(), nothing()
    change.difference[:] = 0.125
    np.testing.assert_array_equal(composed(plate, change, mode=Ratio(np.zeros_like(plate))), plate + 0.125)


def test_the_gain_minimizes_its_own_misfit():
    generator = np.random.default_rng(1)
    plate, without = generator.random((2, 4, 5, 3), np.float32)
    gain = Ratio(without, floor=0.3).gain(plate)
    floor = 0.3 * np.median(without)

    def misfit(g: np.ndarray) -> np.ndarray:
        return (plate - g * without) ** 2 + floor**2 * (g - 1) ** 2

    for step in (-1e-3, 1e-3):
        assert np.all(misfit(gain) < misfit(gain + step))


def test_what_would_be_negative_is_held_at_0_and_counted():
    plate, change = plate_of(), nothing()
    change.difference[1, 2], change.difference[3, 4, 0], change.difference[0, 0] = -100, -100, -0.25
    with pytest.warns(UserWarning, match=r"^2 pixels \(5\.7 %\) came out below 0"):
        picture = composed(plate, change)
    assert picture.min() == 0 and np.all(picture[1, 2] == 0) and picture[3, 4, 1] == plate[3, 4, 1]


def test_a_real_thing_in_front_hides_the_objects():
    plate, change = plate_of(), nothing()
    change.matte[:, 2:5], change.objects[:, 2:5] = 1, 20
    occluder = np.zeros((5, 7), np.float32)
    occluder[:2] = 1
    picture = composed(plate, change, occluder=occluder)
    assert picture[:2].tobytes() == plate[:2].tobytes()
    np.testing.assert_array_equal(picture[2:, 2:5], 20)


def test_a_soft_edge_shows_the_thing_in_front_over_the_object_and_nothing_of_what_was_behind():
    # A black pole before a white wall; the object covers the wall behind it.
    pole, wall, covered = 0.25, 100.0, 3.0
    share = np.array([1, 1, 0.75, 0.5, 0.25, 0, 0], np.float32)
    occluder = np.repeat(share[None], 5, axis=0)
    plate = np.repeat((share * pole + (1 - share) * wall)[None, :, None], 5, axis=0) * np.ones(3, np.float32)
    change = nothing()
    change.matte[:], change.objects[:] = 1, covered
    picture = composed(plate.astype(np.float32), change, occluder=occluder)
    np.testing.assert_allclose(picture[0, :, 0], share * pole + (1 - share) * covered, rtol=1e-5)


def test_shadow_and_light_fall_only_on_what_is_behind():
    plate, change = np.full((5, 7, 3), 4, np.float32), nothing()
    change.difference[:] = -2
    occluder = np.full((5, 7), 0.25, np.float32)
    np.testing.assert_array_equal(composed(plate, change, occluder=occluder), np.full((5, 7, 3), 4 - 0.75 * 2))


def test_planes_of_other_sizes_are_refused():
    with pytest.raises(ValueError, match="differ in size; render with a camera of the plate's size"):
        composed(plate_of(5, 6), nothing())
    with pytest.raises(ValueError, match=r"occluder is \(5, 6\), the plate \(5, 7\)"):
        composed(plate_of(), nothing(), occluder=np.zeros((5, 6)))
    with pytest.raises(ValueError, match="expected the plate's"):
        composed(plate_of(), nothing(), mode=Ratio(plate_of(5, 6)))
    with pytest.raises(ValueError, match="floor is 0; expected a positive share"):
        Ratio(plate_of(), floor=0)

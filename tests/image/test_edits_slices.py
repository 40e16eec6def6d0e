"""The round trip through a painter: what was not painted comes back byte for byte, what was painted as it was meant."""

from __future__ import annotations

import numpy as np
import pytest

from relume.image.ldr_slices import Replaced, Scaled, Slice, fingerprint, fitting_stops, painted
from relume.image.photograph import Photograph
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap


def scene(seed: int = 1) -> RadianceMap:
    """Radiance over nine orders of magnitude, with a variance, marks and a unit."""
    rng = np.random.default_rng(seed)
    field = np.exp(rng.normal(0, 5, (20, 30, 3))).astype(np.float32)
    return RadianceMap(field, field**2, rng.integers(0, 4, (20, 30)).astype(np.uint8), "cd/m²", {"mapping": "latlong"})


def of_pixels(*pixels: tuple[float, float, float]) -> RadianceMap:
    field = np.array([pixels], np.float32)
    return RadianceMap(field, np.ones_like(field), np.zeros((1, len(pixels)), np.uint8))


def repainted(photograph: Photograph, column: int, colour: tuple[int, int, int]) -> Photograph:
    pixels = photograph.pixels.copy()
    pixels[0, column] = colour
    return Photograph(pixels)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("stops", [-6.0, 0.0, 3.5])
def test_nothing_painted_is_the_same_map(bits: int, stops: float) -> None:
    picture, cut = scene(), Slice(stops, bits)
    result = painted(picture, cut.photograph(picture), cut)
    assert result.picture is picture and not result.changed.any() and result.share == 0


def test_only_painted_pixels_change_and_all_planes_of_the_others_stay() -> None:
    picture, cut = scene(), Slice(0.0)
    edited = cut.photograph(picture).pixels.copy()
    edited[3:6, 7:9] = (10, 200, 90)
    result = painted(picture, Photograph(edited), cut)
    assert result.changed.sum() == 6 and result.changed[3:6, 7:9].all()
    assert result.share == pytest.approx(6 / 600)
    made, here = result.picture, ~result.changed
    assert made.variance is not None and picture.variance is not None
    assert made.clipped is not None and picture.clipped is not None
    assert made.radiance[here].tobytes() == picture.radiance[here].tobytes()
    assert made.variance[here].tobytes() == picture.variance[here].tobytes()
    assert made.clipped[here].tobytes() == picture.clipped[here].tobytes()
    assert (made.unit, made.attributes) == (picture.unit, picture.attributes)
    assert np.isinf(made.variance[3:6, 7:9]).all() and not made.clipped[3:6, 7:9].any()


def test_a_slice_is_the_srgb_curve_at_its_exposure() -> None:
    picture = of_pixels((0.25, 0.125, 0.0), (1.0, np.nan, -1.0), (0.0001, np.inf, 0.25 * 0.18))
    # Codes of 0.5, 0.18 and 0.0004 by IEC 61966-2-1: 187.5, 117.6 and 12.92 · 0.0004 · 255.
    codes = Slice(2.0).photograph(picture).pixels[0].tolist()
    assert codes == [[255, 188, 0], [255, 0, 0], [1, 255, 118]]
    assert Slice(1.0).photograph(picture).pixels[0, 0].tolist() == [188, 137, 0]
    assert Slice(2.0, 16).photograph(picture).pixels.dtype == np.uint16
    assert Slice(2.0).white == 0.25


def test_painting_is_what_the_painter_saw() -> None:
    """HDR Shop: a changed pixel becomes the painted value; 188 is 0.5029 of white."""
    picture = of_pixels((0.1, 0.2, 0.3), (0.1, 0.2, 0.3))
    cut = Slice(2.0)
    made = painted(picture, repainted(cut.photograph(picture), 1, (188, 0, 255)), cut).picture.radiance[0]
    assert made[0].tolist() == picture.radiance[0, 0].tolist()
    assert made[1] == pytest.approx([0.25 * 0.5028865, 0.0, 0.25], rel=1e-5)


def test_a_light_painted_over_is_gone_when_replaced_and_stays_a_light_when_scaled() -> None:
    """A sun of 40,000 shown at 255, dodged to 188: half of white, or half of the sun."""
    picture = of_pixels((4e4, 4e4, 2e4), (0.1, 0.1, 0.1))
    cut = Slice(0.0)
    edited = repainted(cut.photograph(picture), 0, (188, 188, 255))
    replaced, scaled = (painted(picture, edited, cut, method=method) for method in (Replaced(), Scaled()))
    assert replaced.picture.radiance[0, 0] == pytest.approx([0.5028865, 0.5028865, 1.0], rel=1e-5)
    assert scaled.picture.radiance[0, 0] == pytest.approx([4e4 * 0.5028865, 4e4 * 0.5028865, 2e4], rel=1e-5)
    assert replaced.above_white == scaled.above_white == 1
    # 0.2126 R + 0.7152 G + 0.0722 B of what is gone.
    assert replaced.lost == pytest.approx(0.9278 * 4e4 + 0.0722 * 2e4, rel=1e-4)
    assert scaled.lost == pytest.approx(0.9278 * 4e4 * (1 - 0.5028865), rel=1e-5)


def test_scaling_keeps_what_the_slice_rounded_away_and_replaces_black() -> None:
    picture = of_pixels((0.5, 1e-6, 0.5))
    cut = Slice(0.0)
    before = cut.photograph(picture).pixels[0, 0].tolist()
    assert before == [188, 0, 188]
    result = painted(picture, repainted(cut.photograph(picture), 0, (94, 94, 188)), cut, method=Scaled())
    # decode(94) is 0.1119324 and decode(188) 0.5028865.
    assert result.picture.radiance[0, 0] == pytest.approx([0.5 * 0.1119324 / 0.5028865, 0.1119324, 0.5], rel=1e-5)
    assert result.picture.variance is not None
    assert result.picture.variance[0, 0] == pytest.approx([(0.1119324 / 0.5028865) ** 2, np.inf, 1.0], rel=1e-5)


def test_marks_go_with_what_was_replaced_and_stay_with_what_was_scaled() -> None:
    picture = of_pixels((9.0, 9.0, 9.0), (1e-9, 1e-9, 1e-9), (0.0, 0.0, 0.0))
    picture = RadianceMap(picture.radiance, picture.variance, np.array([[SATURATED, BLACK, OUTSIDE]], np.uint8))
    cut = Slice(0.0)
    edited = Photograph(np.full((1, 3, 3), 100, np.uint8))
    replaced, scaled = (painted(picture, edited, cut, method=m).picture.clipped for m in (Replaced(), Scaled()))
    assert replaced is not None and replaced.tolist() == [[0, 0, 0]]
    assert scaled is not None and scaled.tolist() == [[SATURATED, 0, 0]]


def test_painting_white_is_counted() -> None:
    picture = of_pixels((0.5, 0.5, 0.5), (9.0, 9.0, 9.0))
    cut = Slice(0.0)
    result = painted(picture, repainted(cut.photograph(picture), 0, (255, 200, 188)), cut)
    assert result.painted_white == 1 and result.above_white == 0


def test_an_eight_bit_painter_of_a_sixteen_bit_slice_changes_nothing_by_rounding() -> None:
    picture, fine, coarse = scene(2), Slice(-2.0, 16), Slice(-2.0, 8)
    rounded = np.rint(fine.photograph(picture).pixels / 257).astype(np.uint8)
    assert not painted(picture, Photograph(rounded), fine).changed.any()
    widened = coarse.photograph(picture).pixels.astype(np.uint16) * 257
    assert not painted(picture, Photograph(widened), coarse).changed.any()


def test_a_tolerance_takes_small_changes_for_none_in_every_channel() -> None:
    picture = scene(3)
    cut = Slice(-4.0)
    codes = cut.photograph(picture).pixels
    noisy = np.clip(codes + np.random.default_rng(1).integers(-3, 4, codes.shape), 0, 255).astype(np.uint8)
    noisy[5, 5] = codes[5, 5]
    noisy[5, 5, 1] = 255 if codes[5, 5, 1] < 128 else 0
    noisy[5, 5, 0] = np.clip(int(codes[5, 5, 0]) + 2, 0, 255)
    assert painted(picture, Photograph(noisy), cut).share > 0.9
    result = painted(picture, Photograph(noisy), cut, method=Scaled(), tolerance=3)
    assert result.changed.sum() == 1 and result.changed[5, 5]
    assert result.picture.radiance[5, 5, 0] == picture.radiance[5, 5, 0]


def test_an_original_that_the_same_program_saved_is_what_is_compared_with() -> None:
    picture, cut = scene(4), Slice(-4.0)
    shifted = np.clip(cut.photograph(picture).pixels.astype(int) + 9, 0, 255).astype(np.uint8)
    edited = shifted.copy()
    edited[2, 2] = (1, 2, 3)
    result = painted(picture, Photograph(edited), cut, original=Photograph(shifted))
    assert result.changed.sum() == 1 and result.changed[2, 2]


def test_a_description_comes_back_and_others_are_refused() -> None:
    cut = Slice(-2.5, 16, fingerprint(scene()))
    assert Slice.from_json(cut.to_json()) == cut
    assert '"curve": "sRGB"' in cut.to_json() and len(cut.of) == 32
    assert fingerprint(scene(1)) == cut.of != fingerprint(scene(2))
    for text in ("", "[]", "{}", cut.to_json().replace("sRGB", "gamma"), cut.to_json().replace("-2.5", '"x"')):
        with pytest.raises(ValueError, match="not the description of a slice"):
            Slice.from_json(text)


def test_the_fitting_exposure_leaves_a_hundredth_at_white() -> None:
    field = np.linspace(0, 64, 400, dtype=np.float32).reshape(20, 20, 1).repeat(3, axis=2)
    assert fitting_stops(RadianceMap(field)) == -6.0
    assert fitting_stops(RadianceMap(field / 4096)) == 6.0
    assert fitting_stops(RadianceMap(field * 0)) == 0.0


def test_slices_and_paintings_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValueError, match="12 bits"):
        Slice(0.0, 12)
    with pytest.raises(ValueError, match="stops"):
        Slice(float("nan"))
    picture, cut = scene(), Slice(0.0)
    good = cut.photograph(picture)
    with pytest.raises(ValueError, match="30×19 pixels and the map 30×20"):
        painted(picture, Photograph(good.pixels[:-1]), cut)
    hole = np.zeros((20, 30), bool)
    hole[0, 0] = True
    with pytest.raises(ValueError, match="transparent"):
        painted(picture, Photograph(good.pixels, outside=hole), cut)
    with pytest.raises(ValueError, match="differ in bits"):
        painted(picture, good, cut, original=Slice(0.0, 16).photograph(picture))
    with pytest.raises(ValueError, match="tolerance"):
        painted(picture, good, cut, tolerance=-1)

"""Vignetting: the falloff of a flat field is recovered with its error, and taken out of other pictures."""

import json
from dataclasses import replace

import numpy as np
import pytest

from relume.capture.lens.vignetting import Vignetting, corrected, recover_vignetting
from relume.errors import NotABracket
from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap

TRUE = Vignetting((-0.35, 0.12, -0.06), (0.51, 0.48))
SIZE = (180, 120)


def flat_field(
    slope: tuple[float, float], *, lens: Vignetting = TRUE, noise: float = 0.003, seed: int = 1, level: float = 3.0
) -> RadianceMap:
    """A wall lit from one side, seen through `lens`; `slope` is its relative change over width and height."""
    width, height = SIZE
    x, y = (np.arange(width) + 0.5) / width - 0.5, (np.arange(height)[:, None] + 0.5) / height - 0.5
    even = level * (1 + slope[0] * x + slope[1] * y) * lens.falloff(SIZE)
    colour = even[..., None] * np.array([1.0, 0.9, 0.7])
    colour *= 1 + noise * np.random.default_rng(seed).standard_normal(colour.shape)
    return RadianceMap(
        colour.astype(np.float32), np.full(colour.shape, 1e-4, np.float32), np.zeros((120, 180), np.uint8)
    )


def turned_fields(seed: int = 1, noise: float = 0.003) -> list[RadianceMap]:
    slopes = ((0.1, 0.05), (-0.1, 0.08), (0.02, -0.12), (-0.05, -0.04))
    return [flat_field(s, seed=10 * seed + i, noise=noise) for i, s in enumerate(slopes)]


def test_the_falloff_is_the_even_polynomial_of_the_radius_that_is_1_at_the_corner():
    lens = Vignetting((-0.5, 0.25))
    falloff = lens.falloff((4, 3))
    assert falloff.shape == (3, 4)
    # The pixel in column 0 and row 0 lies 1.5 and 1 from the middle, and half the diagonal is 2.5.
    square = (1.5**2 + 1.0**2) / 2.5**2
    assert falloff[0, 0] == pytest.approx(1 - 0.5 * square + 0.25 * square**2, rel=1e-12)
    assert lens.falloff((1001, 667))[333, 500] == 1.0
    # Off the middle, towards the right and the top.
    beside = Vignetting((-0.5,), (0.75, 0.25)).falloff((400, 200))
    assert np.unravel_index(beside.argmax(), beside.shape) in {(49, 299), (49, 300), (50, 299), (50, 300)}
    np.testing.assert_array_equal(Vignetting().falloff((5, 4)), np.ones((4, 5)))


def test_a_flat_field_s_falloff_is_recovered():
    found = recover_vignetting(turned_fields(), f_number=2.8)
    assert found.f_number == 2.8
    assert np.abs(found.falloff(SIZE) - TRUE.falloff(SIZE)).max() < 0.002
    assert found.centre == pytest.approx(TRUE.centre, abs=0.003)


def test_one_flat_field_that_slopes_is_enough_for_a_centred_lens():
    lens = Vignetting((-0.4, 0.1, -0.05))
    found = recover_vignetting(flat_field((0.15, -0.1), lens=lens))
    assert np.abs(found.falloff(SIZE) - lens.falloff(SIZE)).max() < 0.004


def test_the_error_bars_are_what_the_coefficients_scatter_by():
    lens = Vignetting((-0.4, 0.1, -0.05))
    found = [recover_vignetting(flat_field((0.1, 0.05), lens=lens, noise=0.02, seed=s)) for s in range(20)]
    apart = (np.array([f.coefficients for f in found]) - lens.coefficients) / [f.deviation for f in found]
    # The mean square of 20 draws of three closely tied coefficients is 1 within 0.6, at two deviations.
    assert 0.4 < (apart**2).mean() < 1.6


def test_dust_and_a_mark_on_the_wall_do_not_count():
    dirty = flat_field((0.05, 0.02))
    radiance = dirty.radiance.copy()
    radiance[20:32, 30:55] *= 0.6
    radiance[::7, ::5] *= 0.2
    clipped = np.zeros((120, 180), np.uint8)
    clipped[60:75, 80:110] = SATURATED
    radiance[60:75, 80:110] = 50.0
    found = recover_vignetting(replace(dirty, radiance=radiance, clipped=clipped))
    clean = recover_vignetting(flat_field((0.05, 0.02)))
    assert np.abs(found.falloff(SIZE) / clean.falloff(SIZE) - 1).max() < 0.006


def test_a_corrected_flat_field_is_flat():
    found = recover_vignetting(turned_fields())
    even = corrected(flat_field((0.0, 0.0), seed=77, noise=0.0), found)
    assert np.ptp(even.radiance[..., 1]) / even.radiance[..., 1].mean() < 0.003


def test_correcting_divides_radiance_and_the_variance_by_the_square():
    lens = Vignetting((-0.5,))
    picture = RadianceMap(
        np.full((60, 80, 3), 2.0, np.float32), np.full((60, 80, 3), 0.5, np.float32), np.zeros((60, 80), np.uint8)
    )
    result = corrected(picture, lens)
    falloff = lens.falloff((80, 60))[..., None]
    np.testing.assert_allclose(result.radiance, np.broadcast_to(2 / falloff, (60, 80, 3)), rtol=1e-6)
    assert result.variance is not None
    np.testing.assert_allclose(result.variance, np.broadcast_to(0.5 / falloff**2, (60, 80, 3)), rtol=1e-6)
    assert result.clipped is picture.clipped and picture.radiance.max() == 2.0
    assert corrected(RadianceMap(picture.radiance), lens).variance is None


def test_what_is_unknown_stays_unknown():
    clipped = np.zeros((60, 80), np.uint8)
    clipped[0, 0], clipped[5, 5] = OUTSIDE, SATURATED
    radiance, variance = np.ones((60, 80, 3), np.float32), np.ones((60, 80, 3), np.float32)
    radiance[0, 0], variance[0, 0], variance[5, 5] = 0, np.inf, np.inf
    # A circular fisheye's polynomial may say anything of the corner that it does not show.
    result = corrected(RadianceMap(radiance, variance, clipped), Vignetting((-1.008,)))
    assert (
        result.variance is not None and np.isinf(result.variance[0, 0]).all() and np.isinf(result.variance[5, 5]).all()
    )
    assert result.radiance[0, 0].max() == 0 and np.isfinite(result.radiance).all()
    clipped[0, 0] = 0
    with pytest.raises(ValueError, match=r"falloff reaches 0 in|falloff reaches -?[\d.e-]+ in the picture"):
        corrected(RadianceMap(radiance, variance, clipped), Vignetting((-1.1,)))


def test_natural_falloff_is_the_fourth_power_of_the_cosine():
    for focal_length in (60.0, 108.0, 500.0):
        lens = Vignetting.cos4(focal_length, SIZE)
        x, y = np.arange(180) + 0.5 - 90, np.arange(120)[:, None] + 0.5 - 60
        cosine = focal_length / np.sqrt(x**2 + y**2 + focal_length**2)
        np.testing.assert_allclose(lens.falloff(SIZE), cosine**4, atol=2e-5)
    # At 45° the picture's corner gets a quarter of the light: cos⁴ 45°.
    corner = np.hypot(90, 60)
    assert 1 + sum(Vignetting.cos4(corner, SIZE).coefficients) == pytest.approx(0.25, abs=2e-5)


def test_another_aperture_s_vignetting_is_not_used_silently():
    wide, stopped = Vignetting((-0.5,), f_number=2.0), Vignetting((-0.1,), f_number=8.0)
    picture = RadianceMap(np.ones((40, 60, 3), np.float32))
    np.testing.assert_array_equal(
        corrected(picture, [wide, stopped], f_number=8.02).radiance, corrected(picture, stopped).radiance
    )
    np.testing.assert_array_equal(
        corrected(picture, [stopped, wide], f_number=2.0).radiance, corrected(picture, wide).radiance
    )
    with pytest.warns(UserWarning, match="measured at f/8, the photographs are at f/5.6"):
        corrected(picture, [wide, stopped], f_number=5.6)
    corrected(picture, Vignetting((-0.1,)), f_number=5.6)
    with pytest.raises(ValueError, match="2 vignettings were given and no f_number"):
        corrected(picture, [wide, stopped])


def test_a_vignetting_survives_its_file():
    lens = Vignetting((-0.31, 0.1 / 3), (0.502, 0.497), (0.001, 0.002), 2.8)
    assert Vignetting.from_dict(json.loads(json.dumps(lens.to_dict()))) == lens
    assert Vignetting.from_dict(json.loads(json.dumps(Vignetting().to_dict()))) == Vignetting()
    for wrong in ({}, {**lens.to_dict(), "centre": [0.5]}, {**lens.to_dict(), "coefficients": "none"}):
        with pytest.raises(ValueError, match="not a vignetting of relume"):
            Vignetting.from_dict(wrong)


def test_pictures_that_are_no_flat_field_are_refused():
    generator = np.random.default_rng(5)
    lumpy = np.repeat(np.repeat(generator.uniform(0.5, 2, (12, 18, 1)), 10, 0), 10, 1) * np.ones(3)
    with pytest.raises(NotABracket, match="beyond any vignetting; photograph an evenly lit"):
        recover_vignetting(RadianceMap(lumpy.astype(np.float32)))
    clipped = np.full((120, 180), SATURATED, np.uint8)
    clipped[:40] = 0
    with pytest.raises(NotABracket, match="flat field 1: 33 % of it is well exposed"):
        recover_vignetting(replace(flat_field((0, 0)), clipped=clipped))
    small = RadianceMap(np.ones((30, 40, 3), np.float32))
    with pytest.raises(NotABracket, match="flat field 2 is 40×30, the first 180×120"):
        recover_vignetting([flat_field((0, 0)), small])
    with pytest.raises(ValueError, match="no radiance maps"):
        recover_vignetting([])


def test_an_uneven_wall_is_doubted():
    wave = 1 + 0.04 * np.sin(np.arange(180) / 7)[None, :, None] * np.cos(np.arange(120) / 9)[:, None, None]
    field = flat_field((0, 0))
    with pytest.warns(UserWarning, match="flat field varies by"):
        recover_vignetting(replace(field, radiance=(field.radiance * wave).astype(np.float32)))

"""Clothes of any colour from a white and a black take (Fig. 7)."""

from pathlib import Path

import numpy as np
import pytest

from relume.image import files
from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import Noise, Pictures, whole
from relume.lightstage.field.lights import StageLights
from relume.lightstage.garment_recolouring import (
    MOVED,
    ClothAlbedos,
    RecolouredField,
    displacement,
    recolour_clothing,
    recolour_field,
)
from relume.lightstage.relighting.voronoi_cells import even_directions

TRUTH = Path(__file__).resolve().parents[3] / "shared" / "stages" / "head" / "truth"
GREEN = (0.05, 0.5, 0.1)
LIGHTS = StageLights.towards(even_directions(5))


def textured(seed: int = 3, size: int = 96) -> np.ndarray:
    """A smooth picture with edges, (H, W, 3)."""
    from scipy.ndimage import gaussian_filter

    noise = np.random.default_rng(seed).normal(size=(size, size))
    return (0.4 + gaussian_filter(np.sign(gaussian_filter(noise, 4)), 0.8)[..., None] * [0.2, 0.15, 0.1]).astype(
        np.float32
    )


def takes() -> tuple[np.ndarray, np.ndarray]:
    """A subject whose lower third is cloth, of albedo 0.03 and 0.8, which throws light on the rest."""
    subject = textured()
    thrown = np.linspace(0, 1, len(subject), dtype=np.float32)[:, None, None] ** 2

    def worn(albedo: float) -> np.ndarray:
        picture = subject * (1 + 0.3 * albedo * thrown)
        picture[64:] = albedo * (0.5 + subject[64:])
        return picture.astype(np.float32)

    return worn(0.03), worn(0.8)


def test_the_tint_is_where_the_cloth_stands_between_black_and_white():
    np.testing.assert_allclose(ClothAlbedos(0.8, 0.02).tint(GREEN), [0.03 / 0.78, 0.48 / 0.78, 0.08 / 0.78])
    assert ClothAlbedos().tint(0.8).tolist() == [1, 1, 1] and ClothAlbedos().tint(0.03).tolist() == [0, 0, 0]


def test_a_cloth_outside_the_two_is_extrapolated_and_reported():
    with pytest.warns(UserWarning, match="extrapolated"):
        assert ClothAlbedos(0.8, 0.2).tint(0.05)[0] == pytest.approx(-0.25)


def test_black_and_white_come_back_and_grey_lies_between():
    black, white = (RadianceMap(take) for take in takes())
    np.testing.assert_array_equal(recolour_clothing(black, white, np.zeros(3)).radiance, black.radiance)
    np.testing.assert_allclose(recolour_clothing(black, white, np.ones(3)).radiance, white.radiance, rtol=1e-6)
    green = recolour_clothing(black, white, ClothAlbedos().tint((0.03, 0.415, 0.8))).radiance
    np.testing.assert_allclose(green[..., 0], black.radiance[..., 0])
    np.testing.assert_allclose(green[..., 1], (black.radiance[..., 1] + white.radiance[..., 1]) / 2, rtol=1e-6)


def test_variance_and_marks_travel():
    black, white = takes()
    mark = np.zeros(black.shape[:2], np.uint8)
    mark[3, 4], mark[5, 6] = 1, 2
    first = RadianceMap(black, np.full_like(black, 0.04), mark)
    second = RadianceMap(white, np.full_like(white, 0.16))
    result = recolour_clothing(first, second, np.array([0.0, 0.5, 1.0]))
    assert result.variance is not None and result.clipped is not None
    np.testing.assert_allclose(result.variance[0, 0], [0.04, 0.25 * 0.04 + 0.25 * 0.16, 0.16], rtol=1e-6)
    assert (result.clipped[3, 4], result.clipped[5, 6], result.clipped.sum()) == (1, 2, 3)


def test_a_field_is_reclothed_block_by_block():
    random = np.random.default_rng(1)
    black = random.uniform(0, 1, (5, 32, 32, 3)).astype(np.float32)
    white = black + random.uniform(0, 1, black.shape).astype(np.float32) * np.float32(0.01)
    tint = np.array([0.2, 0.5, 0.9])
    field = recolour_field(Pictures(black, LIGHTS), Pictures(white, LIGHTS), tint)
    assert field.shape == (32, 32) and len(field.lights) == 5 and field.camera is None and field.noise is None
    np.testing.assert_allclose(whole(field), black + tint.astype(np.float32) * (white - black), rtol=1e-6)
    np.testing.assert_array_equal(field.block(slice(1, 3), slice(4, 9)), whole(field)[1:3, 4:9])


def test_the_noise_reported_of_a_field_is_at_least_that_of_the_mix():
    black, white, tint = np.full((5, 1, 1, 3), 0.2, np.float32), np.full((5, 1, 1, 3), 0.9, np.float32), 0.3
    field = RecolouredField(
        Pictures(black, LIGHTS, noise=Noise(1e-4, 2e-3)),
        Pictures(white, LIGHTS, noise=Noise(2e-4, 3e-3)),
        np.full(3, tint),
    )
    true = (1 - tint) ** 2 * (1e-4 + 2e-3 * 0.2) + tint**2 * (2e-4 + 3e-3 * 0.9)
    assert field.noise is not None
    said = field.noise.constant + field.noise.slope * float(whole(field)[0, 0, 0, 0])
    assert true <= said < 3 * true


@pytest.mark.parametrize("shift", [(0, 1), (2, -1), (-4, 3)])
def test_a_subject_that_moved_is_reported(shift):
    black, white = takes()
    moved = np.roll(white, shift, (0, 1))
    assert displacement(black, white) < 0.1
    assert displacement(black, moved) == pytest.approx(np.hypot(*shift), abs=0.2)
    with pytest.warns(UserWarning, match="the subject moved by about"):
        recolour_clothing(RadianceMap(black), RadianceMap(moved), np.ones(3))


def test_a_picture_without_edges_gives_no_displacement():
    flat = np.ones((40, 40, 3), np.float32)
    assert displacement(flat, 2 * flat) == 0


def test_takes_of_two_sizes_and_of_other_lights_are_refused():
    with pytest.raises(ValueError, match="expected two of one camera"):
        recolour_clothing(
            RadianceMap(np.ones((4, 4, 3), np.float32)), RadianceMap(np.ones((4, 5, 3), np.float32)), np.ones(3)
        )
    values = np.ones((5, 4, 4, 3), np.float32)
    elsewhere = StageLights.towards(even_directions(5)[::-1])
    with pytest.raises(ValueError, match="same in the same order"):
        recolour_field(Pictures(values, LIGHTS), Pictures(values, elsewhere), np.ones(3))
    with pytest.raises(ValueError, match=r"ClothAlbedos\.tint gives it"):
        RecolouredField(Pictures(values, LIGHTS), Pictures(values, LIGHTS), np.ones(2))


def test_cloths_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="expected 0 ≤ black < white"):
        ClothAlbedos(0.02, 0.8)
    with pytest.raises(ValueError, match="from 0 to 1"):
        ClothAlbedos().tint(1.5)


@pytest.mark.skipif(not TRUTH.is_dir(), reason="the virtual stage is not here")
def test_a_green_shirt_from_the_white_and_the_black_one():
    black, white, green = (
        RadianceMap(np.ascontiguousarray(files.read_radiance(TRUTH / f"point_0_front{shirt}.exr").radiance))
        for shirt in ("", "_white_shirt", "_green_shirt")
    )
    mask = files.read_radiance(TRUTH / "mask_head.exr").radiance[..., 0] > 0.5
    # The black shirt's albedo, 0.02, is that of its material in subject.glb.
    made = recolour_clothing(black, white, ClothAlbedos(0.8, 0.02).tint(GREEN)).radiance
    shirt = (white.radiance.mean(-1) > 3 * black.radiance.mean(-1)) & ~mask & (np.arange(256)[:, None] > 190)

    def error(picture: np.ndarray, where: np.ndarray) -> float:
        return float(np.abs(picture - green.radiance)[where].mean() / green.radiance[where].mean())

    assert shirt.sum() > 3000
    assert error(made, mask) < 0.005 and error(black.radiance, mask) > 0.007
    assert error(made, shirt) < 0.02 and error(black.radiance, shirt) > 0.5
    assert displacement(black.radiance, white.radiance) < MOVED
    assert displacement(black.radiance, np.roll(white.radiance, 1, 1)) > MOVED

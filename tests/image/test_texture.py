"""A shadow on a textured surface is as dark as it is on the texture's every pixel, whatever filtered its light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.image.texture import as_rendered, texture
from relume.renderers.mitsuba.denoise import denoised
from relume.renderers.results import Change
from relume.virtual_camera.plate_matching.matching import Match, match_to_plate
from relume.virtual_camera.plate_matching.sharpness import Sharpness

HEIGHT, WIDTH = 64, 96
PLATE = np.random.default_rng(4).uniform(0.3, 1.0, (HEIGHT, WIDTH, 3)).astype(np.float32)
LEFT = 0.1
"""Of the light, in the shadow."""
SHADE = np.zeros((HEIGHT, WIDTH, 1), np.float32)
SHADE[16:48, 24:72] = 1 - LEFT
DEEP = (slice(26, 38), slice(36, 60))


def in_shadow(rendered: np.ndarray) -> Change:
    """A shadow on surfaces that were rendered so; nothing else."""
    flat, colour = np.zeros((HEIGHT, WIDTH), np.float32), np.zeros((HEIGHT, WIDTH, 3), np.float32)
    up = np.broadcast_to(np.array([0, 1, 0], np.float32), colour.shape)
    taken = (SHADE * rendered).astype(np.float32)
    return Change(colour, -taken, flat, flat, up, rendered, colour, colour, taken=taken)


def over_plate(change: Change) -> np.ndarray:
    """The composite; nothing is held at 0."""
    return PLATE + change.difference


def contrast(picture: np.ndarray) -> float:
    """Of the texture in the shadow, as a share of what it is on the plate."""
    seen, plain = (each[DEEP] / each[DEEP].mean() - 1 for each in (picture, PLATE))
    return float((seen * plain).sum() / (plain**2).sum())


def test_a_texture_keeps_its_contrast_in_a_denoised_shadow():
    change = in_shadow(as_rendered(PLATE))
    assert contrast(over_plate(change)) > 1.5  # as surfaces are rendered they are softer than the plate
    before, after = (contrast(over_plate(denoised(change, plate))) for plate in (None, PLATE))
    assert before > 1.5
    assert after == pytest.approx(1, abs=0.25)
    assert over_plate(denoised(change, PLATE))[DEEP].mean() == pytest.approx(LEFT * PLATE[DEEP].mean(), rel=0.05)


def test_a_lens_softens_the_edge_of_a_shadow_and_not_the_texture_in_it():
    match, change = Match(sharpness=Sharpness(0.8)), in_shadow(PLATE)
    soft, kept = (match_to_plate(change, match, plate) for plate in (None, PLATE))
    assert contrast(over_plate(soft)) > 3
    assert contrast(over_plate(kept)) == pytest.approx(1, abs=0.1)
    # Half of the shadow at its edge, as a blurred step has it.
    share = -kept.difference / PLATE
    assert share[32, [23, 24]].sum(0) == pytest.approx((1 - LEFT) * np.ones(3), abs=0.05)
    assert np.array_equal(kept.difference[:8], 0 * kept.difference[:8])


def grouted() -> np.ndarray:
    """A plate of tiles with joints 25 times as dark, and on its left half the texture of PLATE."""
    tiles = np.full_like(PLATE, 0.5)
    tiles[::12], tiles[:, ::12] = 0.02, 0.02
    tiles[:, : WIDTH // 2] = PLATE[:, : WIDTH // 2]
    return tiles


def test_a_shadow_on_an_even_colour_knows_nothing_of_the_plate_below_it():
    """What is taken has none of the plate in it, and none of it may be divided out: its mean and evenness stay."""
    even = np.full_like(PLATE, 0.4)
    change, nowhere = in_shadow(even), np.zeros((HEIGHT, WIDTH), bool)
    match = Match(sharpness=Sharpness(0.8))
    for plate in (PLATE, grouted()):
        for made in (denoised(change, plate, nowhere), match_to_plate(change, match, plate, nowhere)):
            assert -made.difference[DEEP].mean() == pytest.approx((1 - LEFT) * 0.4, rel=0.01)
            assert np.ptp(made.difference[DEEP]) < 0.02
    plain = denoised(change)
    np.testing.assert_allclose(denoised(change, PLATE, nowhere).difference, plain.difference, rtol=0, atol=1e-6)


def test_a_textured_and_an_even_surface_in_one_picture_each_keep_their_shadow():
    plate, textured = grouted(), np.zeros((HEIGHT, WIDTH), bool)
    textured[:, : WIDTH // 2] = True
    left, right = (slice(26, 38), slice(30, 44)), (slice(26, 38), slice(52, 66))
    match = Match(sharpness=Sharpness(0.8))
    rendered = np.where(textured[..., None], as_rendered(plate), 0.4).astype(np.float32)
    exact = np.where(textured[..., None], plate, 0.4).astype(np.float32)
    pairs = (denoised(in_shadow(rendered), plate, textured), match_to_plate(in_shadow(exact), match, plate, textured))
    for made in pairs:
        shown = -made.difference
        assert shown[right] == pytest.approx((1 - LEFT) * 0.4, rel=0.06)
        assert shown[right].mean() == pytest.approx((1 - LEFT) * 0.4, rel=0.02)
        assert shown[left].mean() == pytest.approx((1 - LEFT) * plate[left].mean(), rel=0.03)
        assert (shown[left] / plate[left]).std() < 0.05


def test_nothing_is_divided_by_black():
    black = np.zeros((20, 30, 3), np.float32)
    assert (texture(black) > 0).all() and np.isfinite(texture(black)).all()
    spot = black.copy()
    spot[10, 15] = 1.0
    assert texture(spot)[10, 15] == pytest.approx(1.0, rel=1e-3)
    assert texture(spot, rendered=True)[10, 15] == pytest.approx(0.75**2, rel=2e-3)
    change = replace(in_shadow(PLATE), difference=0 * PLATE, taken=0 * PLATE)
    assert not denoised(change, PLATE).difference.any()


def test_a_large_picture_is_looked_at_by_rows_alike():
    tall = np.random.default_rng(5).random((1100, 9, 3)).astype(np.float32)
    whole = texture(tall)
    assert whole[600:620] == pytest.approx(texture(tall[500:720])[100:120], abs=1e-6)

"""Glare: what a lens scattered is put back, no light is lost, and what the picture does not say is said."""

from dataclasses import replace

import numpy as np
import pytest

from relume.capture.lens.glare import Glare, diminish_glare, scatter, without_glare
from relume.capture.lens.glare_recovery import largest_glare, recover_glare_from_dark, recover_glare_from_lamp
from relume.capture.scale.regions import disc, rectangle
from relume.errors import DoubtWarning, NotABracket
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap

LENS = Glare(veil=0.02, halo=0.03, core=0.01, power=1.1)
SIZE = (150, 100)
TRAP = rectangle(SIZE, 100, 60, 20, 15)


def veiled(picture: RadianceMap, glare: Glare) -> RadianceMap:
    """The map as a lens with that glare shows it; all the light is kept. Its variance is not known."""
    radiance = (1 - glare.share) * picture.radiance + scatter(picture.radiance, glare)
    return replace(picture, radiance=radiance.astype(np.float32), variance=None)


def backlit() -> np.ndarray:
    """A dim room (H, W, 3) with a bright window left of the middle, a lamp near a corner, and a black trap."""
    y, x = np.mgrid[:100, :150]
    room = 0.05 + 0.04 * np.sin(x / 11.0) * np.cos(y / 8.0)
    room[10:45, 30:60] = 40.0
    room[92:95, 140:144] = 900.0
    scene = room[..., None] * np.array([1.0, 0.8, 0.6])
    scene[TRAP] = 0.0
    return scene


def through_the_lens(noise: float = 0.0, glare: Glare = LENS, seed: int = 3) -> RadianceMap:
    seen = veiled(RadianceMap(backlit().astype(np.float32)), glare).radiance.astype(np.float64)
    deviation = noise * np.sqrt(seen * 0.05 + 1e-6)
    seen = seen + deviation * np.random.default_rng(seed).standard_normal(seen.shape)
    return RadianceMap(seen.astype(np.float32), (deviation**2).astype(np.float32), np.zeros((100, 150), np.uint8))


def scattered_by_hand(light: np.ndarray, glare: Glare) -> np.ndarray:
    """The slow twin: each pixel's light sent to all others, one by one."""
    height, width = light.shape[:2]
    y, x = np.mgrid[:height, :width]
    core = glare.core * np.hypot(width, height)
    total = np.zeros_like(light)
    for row in range(height):
        for column in range(width):
            kernel = ((x - column) ** 2 + (y - row) ** 2 + core**2) ** -glare.power
            share = glare.veil / (width * height) + glare.halo * kernel / kernel.sum()
            total += share[..., None] * light[row, column]
    return total


def test_scattering_sends_each_pixel_s_light_over_the_picture():
    # Neither square nor symmetric: a shift by one pixel, a mirrored kernel or swapped axes would show.
    light = np.random.default_rng(2).uniform(0, 1, (13, 22, 3)) ** 6
    for glare in (Glare(veil=0.1), Glare(halo=0.2, core=0.05), Glare(0.05, 0.1, 0.08, 1.7)):
        np.testing.assert_allclose(scatter(light, glare), scattered_by_hand(light, glare), rtol=1e-10)


def test_a_coarser_grid_scatters_the_same():
    scene = backlit()[37:, 60:]
    wide = Glare(halo=0.2, core=0.22, power=1.3)
    # The core spans 24 pixels, so the halo is reckoned on cells of four, which neither side is a multiple of.
    exact = scattered_by_hand(scene, wide)
    # Even where the lamp's rows and columns fall on two cells, near the edge, it is right within two thousandths.
    assert np.abs(scatter(scene, wide) / exact - 1).max() < 0.002


def test_all_light_is_kept():
    scene = backlit()
    for glare in (LENS, Glare(veil=0.1), Glare(halo=0.2, core=0.06)):
        assert scatter(scene, glare).sum() == pytest.approx(glare.share * scene.sum(), rel=1e-12)
        seen = veiled(RadianceMap(scene.astype(np.float32)), glare)
        assert seen.radiance.sum(dtype=np.float64) == pytest.approx(scene.sum(), rel=1e-6)
        result = diminish_glare(seen, glare)
        assert result.picture.radiance.sum(dtype=np.float64) == pytest.approx(scene.sum(), rel=1e-6)


def test_without_its_glare_the_scene_is_back():
    scene = backlit()
    seen = through_the_lens()
    # The trap is as bright as the room, and beside the window and the lamp the room is far brighter than it is.
    lit = ~TRAP
    assert seen.radiance[TRAP].mean() > 0.05 and (seen.radiance[lit] / scene[lit]).max() > 5
    result = diminish_glare(seen, LENS).picture.radiance
    assert np.abs(result[lit] / scene[lit] - 1).max() < 1e-3
    assert result[TRAP].max() < 1e-5
    np.testing.assert_allclose(
        without_glare(veiled(RadianceMap(scene.astype(np.float32)), LENS).radiance, LENS), scene, atol=2e-4
    )


def test_what_comes_back_is_the_scene_within_its_stated_noise():
    scene = backlit()
    seen = through_the_lens(noise=0.05)
    result = diminish_glare(seen, LENS)
    assert result.picture.variance is not None and not result.bounded.any()
    deviation = np.sqrt(result.picture.variance)
    lit = ~TRAP
    apart = ((result.picture.radiance - scene) / deviation)[lit]
    assert 0.95 < apart.std() < 1.05 and abs(apart.mean()) < 0.02
    # The trap is 0 within three deviations of its mean.
    assert result.picture.radiance[TRAP].mean() < 3 * deviation[TRAP].mean()
    # Relative to what is left, the room is noisier than it looked.
    dim = (scene > 0.02) & (scene < 0.1)
    assert seen.variance is not None
    before = np.sqrt(seen.variance[dim]) / seen.radiance[dim]
    assert np.median(deviation[dim] / scene[dim] / before) > 1.5


def test_what_is_not_known_of_the_shares_makes_dark_places_uncertain():
    seen = through_the_lens()
    sure, unsure = (diminish_glare(seen, replace(LENS, deviation=d)).picture.variance for d in (0.0, 0.1))
    assert sure is not None and unsure is not None
    # The trap's whole light was glare, a tenth of which is doubtful.
    expected = 0.1 * seen.radiance[TRAP] / (1 - LENS.share)
    np.testing.assert_allclose(np.sqrt(unsure[TRAP]), expected, rtol=1e-3)
    # A lens of shares 10 % larger leaves a scene that differs by just that.
    off = without_glare(seen.radiance, LENS.scaled(1.1 * LENS.share)) - without_glare(seen.radiance, LENS)
    np.testing.assert_allclose(np.abs(off[TRAP]), np.sqrt(unsure[TRAP]), rtol=0.1)
    np.testing.assert_allclose(np.abs(off[20:40, 40:50]), np.sqrt(unsure[20:40, 40:50]), rtol=0.1)


def test_no_glare_leaves_the_map_as_it_is():
    seen = through_the_lens(noise=0.02)
    result = diminish_glare(seen, Glare())
    assert result.picture is seen and not result.bounded.any() and result.scattered.max() == 0


def test_the_scattered_light_is_reported():
    seen = through_the_lens()
    result = diminish_glare(seen, LENS)
    np.testing.assert_allclose(result.scattered, scatter(backlit(), LENS), rtol=2e-3)


def test_too_large_a_share_is_bounded_and_said():
    seen = through_the_lens(noise=0.01)
    with pytest.warns(DoubtWarning, match=r"more glare was reckoned .*really black \(--glare\)") as said:
        result = diminish_glare(seen, LENS.scaled(0.07))
    assert getattr(said[0].message, "effect", None) == pytest.approx(result.bounded.mean())
    assert result.bounded[TRAP].all() and not result.bounded[10:45, 30:60].any()
    assert result.picture.radiance.min() == 0.0


def test_what_no_photograph_measured_keeps_its_mark():
    seen = through_the_lens(noise=0.01)
    assert seen.clipped is not None and seen.variance is not None
    clipped, variance, radiance = seen.clipped.copy(), seen.variance.copy(), seen.radiance.copy()
    clipped[:, :6], clipped[93, 141], clipped[70, 105] = OUTSIDE, SATURATED, BLACK
    variance[clipped != 0], radiance[:, :6] = np.inf, 0.0
    with pytest.warns(UserWarning, match="1 pixels are saturated in every photograph: they scatter more"):
        result = diminish_glare(RadianceMap(radiance, variance, clipped), LENS)
    picture = result.picture
    assert picture.variance is not None
    np.testing.assert_array_equal(picture.clipped, clipped)
    assert np.isinf(picture.variance[clipped != 0]).all() and not np.isnan(picture.radiance).any()
    assert picture.radiance[:, :6].max() == 0 and not result.bounded[:, :6].any() and result.scattered[:, :6].max() == 0


def test_a_border_that_is_no_part_of_the_picture_scatters_nothing():
    scene = backlit()
    scene[:, :20] = 0.0
    seen = veiled(RadianceMap(scene.astype(np.float32)), LENS)
    radiance, clipped = seen.radiance.copy(), np.zeros((100, 150), np.uint8)
    radiance[:, :20], clipped[:, :20] = 0.0, OUTSIDE
    result = diminish_glare(RadianceMap(radiance, None, clipped), LENS).picture.radiance
    lit = np.broadcast_to(scene > 0, scene.shape)
    assert np.abs(result[lit] / scene[lit] - 1).max() < 1e-3 and result[:, :20].max() == 0


def test_the_darkest_places_bound_the_share():
    seen = through_the_lens(noise=0.02)
    bound = largest_glare(seen, shape=LENS)
    # The trap lets no more pass than there was, and its noise a little.
    assert LENS.share < bound.share < 1.05 * LENS.share
    assert bound.veil / bound.halo == pytest.approx(LENS.veil / LENS.halo)
    assert not diminish_glare(seen, bound.scaled(0.98 * LENS.share)).bounded.any()
    # Without a black place the bound is wide, and a grey wall alone says nothing.
    grey = RadianceMap(np.full((40, 60, 3), 0.5, np.float32))
    assert largest_glare(grey).share == pytest.approx(0.4)
    # What is black in every photograph is no evidence: without the trap the room's darkest blue bounds the veil.
    even = through_the_lens(glare=Glare(veil=0.04))
    assert largest_glare(even).share == pytest.approx(0.04, rel=1e-3)
    dark = replace(even, clipped=np.where(TRAP, BLACK, 0).astype(np.uint8))
    assert 0.042 < largest_glare(dark).share < 0.06


def test_a_light_trap_shows_the_share():
    found = recover_glare_from_dark(through_the_lens(noise=0.02), TRAP, shape=LENS.scaled(0.2))
    assert found.share == pytest.approx(LENS.share, rel=0.003)
    assert found.veil / found.halo == pytest.approx(LENS.veil / LENS.halo)
    # One place alone says an even veil, which makes the trap black.
    seen = through_the_lens(noise=0.02, glare=Glare(veil=0.04))
    veil = recover_glare_from_dark(seen, TRAP)
    assert (veil.veil, veil.halo) == (pytest.approx(0.04, rel=0.003), 0.0) and 0 < veil.deviation < 0.05


def test_a_black_card_is_not_quite_black():
    scene = backlit()
    scene[TRAP] = 0.03
    seen = veiled(RadianceMap(scene.astype(np.float32)), Glare(veil=0.04))
    assert recover_glare_from_dark(seen, TRAP, black=0.03).veil == pytest.approx(0.04, rel=1e-4)
    assert recover_glare_from_dark(seen, TRAP).veil > 0.042
    # A lens that scatters nothing leaves the card as it is.
    clean = RadianceMap(scene.astype(np.float32))
    assert recover_glare_from_dark(clean, TRAP, black=0.0301).share == 0
    assert diminish_glare(clean, recover_glare_from_dark(clean, TRAP, black=0.0301)).picture is clean


def test_a_place_that_is_not_black_is_refused():
    seen = through_the_lens()
    with pytest.raises(NotABracket, match="it is not black, so choose a darker one"):
        recover_glare_from_dark(seen, rectangle(SIZE, 35, 15, 10, 10))
    dark = np.where(TRAP, BLACK, 0).astype(np.uint8)
    with pytest.raises(ValueError, match="300 of the region's 300 pixels are clipped"):
        recover_glare_from_dark(replace(seen, clipped=dark), TRAP)
    with pytest.raises(ValueError, match="scatters nothing"):
        recover_glare_from_dark(seen, TRAP, shape=Glare())


def lamp_in_the_dark(glare: Glare, noise: float = 0.0) -> tuple[RadianceMap, np.ndarray]:
    lamp = disc((300, 220), 90, 130, 2.5)
    scene = np.zeros((220, 300, 3))
    scene[lamp] = (5e4, 4e4, 2e4)
    seen = veiled(RadianceMap(scene.astype(np.float32)), glare).radiance.astype(np.float64)
    seen *= 1 + noise * np.random.default_rng(8).standard_normal(seen.shape)
    return RadianceMap(seen.astype(np.float32)), lamp


@pytest.mark.parametrize("glare", [Glare(0.015, 0.03, 0.02, 1.2), Glare(0.005, 0.05, 0.03, 0.8), Glare(veil=0.03)])
def test_a_lamp_in_the_dark_shows_veil_and_halo(glare):
    seen, lamp = lamp_in_the_dark(glare, noise=0.01)
    found = recover_glare_from_lamp(seen, lamp)
    assert found.share == pytest.approx(glare.share, rel=0.1)
    assert abs(found.share - glare.share) < 3 * found.deviation * found.share + 0.002
    # What matters is how much is taken away where: beyond the lamp it is right within 3 %.
    y, x = np.mgrid[:220, :300]
    beyond = np.hypot(x - 90, y - 130) > 15
    light = without_glare(seen.radiance, glare)
    ours, theirs = scatter(light, found)[beyond], scatter(light, glare)[beyond]
    assert np.abs(ours / theirs - 1).max() < 0.03


def test_a_lamp_that_shows_too_little_is_refused():
    seen, lamp = lamp_in_the_dark(LENS)
    saturated = np.where(lamp, SATURATED, 0).astype(np.uint8)
    with pytest.raises(ValueError, match="pixels are clipped or outside"):
        recover_glare_from_lamp(replace(seen, clipped=saturated), lamp)
    with pytest.raises(NotABracket, match="too little of the picture lies about the lamp"):
        recover_glare_from_lamp(seen, disc((300, 220), 90, 130, 60))
    lit = replace(seen, radiance=seen.radiance + np.float32(50.0))
    with pytest.raises(NotABracket, match="the room is lit"):
        recover_glare_from_lamp(lit, lamp)


@pytest.mark.parametrize(
    "wrong", [{"veil": -0.1}, {"veil": 0.3, "halo": 0.2}, {"core": 0.0}, {"power": -1.0}, {"deviation": np.nan}]
)
def test_a_spread_function_that_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match="expected"):
        Glare(**wrong)

"""Denoising a change: less noise, and what the objects do not change stays 0 to the bit."""

import numpy as np
import pytest

from relume.composite.differential import composed
from relume.renderers.mitsuba.denoise import _as_bright, _clean, denoised, exposure
from relume.renderers.mitsuba.path_tracer import _mitsuba
from relume.renderers.results import Change

HEIGHT, WIDTH = 32, 40
OBJECT = np.s_[10:20, 10:20]
PLATE = np.ones((HEIGHT, WIDTH, 3), np.float32)


def flat_change(*, level=0.1, object_noise=0.02, shadow=-0.25, noise=0.1, covered=OBJECT):
    """An object on a noisy shadow that lies on most of the picture.

    The plate has no noise to take out: a photograph is never denoised by the renderer. What was noisy here when the
    floor was rendered is now the difference, so the shadow is as broad and as noisy as that floor was.
    """
    generator = np.random.default_rng(9)
    matte = np.zeros((HEIGHT, WIDTH), np.float32)
    matte[covered] = 1
    objects, difference = np.zeros_like(PLATE), np.zeros_like(PLATE)
    objects[covered] = (level + object_noise * generator.standard_normal(objects[covered].shape)).clip(0)
    difference[:, :32] = shadow + noise * generator.standard_normal((HEIGHT, 32, 3))
    difference[matte > 0] = 0
    normal = np.broadcast_to(np.array([0, 1, 0], np.float32), PLATE.shape).copy()
    variance = np.full_like(PLATE, noise**2)
    return Change(objects, difference, matte, matte, normal, np.full_like(PLATE, 0.5), variance, variance)


def test_what_nothing_changes_stays_the_plate_to_the_bit():
    change = flat_change()
    smooth = denoised(change)
    same = np.all(change.difference == 0, axis=-1)
    assert same.any() and not same.all()
    assert not smooth.difference[same].any()
    untouched = same & (change.matte == 0)
    assert untouched.any() and np.array_equal(composed(PLATE, smooth)[untouched], PLATE[untouched])


def gets_closer_to_flat(change, where, level):
    before, after = (composed(PLATE, each)[where] for each in (change, denoised(change)))
    assert np.abs(after - level).mean() < 0.3 * np.abs(before - level).mean()
    # Nor is its light lost: the mean of 2772 values with noise 0.1 is known to 0.0019.
    assert abs(after.mean() - before.mean()) < 0.005


@pytest.mark.parametrize("shadow", [-0.25, 0.25], ids=["shadow", "added light"])
def test_a_composite_in_a_noisy_shadow_or_in_noisy_light_gets_closer_to_flat(shadow):
    change = flat_change(shadow=shadow)
    gets_closer_to_flat(change, np.any(change.difference != 0, axis=-1), 1 + shadow)


def test_a_broad_noisy_object_gets_closer_to_flat():
    broad = np.s_[2:30, 2:38]
    gets_closer_to_flat(flat_change(level=0.5, object_noise=0.1, covered=broad), broad, 0.5)


def test_the_object_keeps_its_own_brightness():
    picture = composed(PLATE, denoised(flat_change()))
    assert abs(picture[12:18, 12:18].mean() - 0.1) < 0.01


def test_everything_but_the_two_planes_is_handed_on():
    change = flat_change()
    smooth = denoised(change)
    assert smooth.matte is change.matte and smooth.depth is change.depth
    assert smooth.objects.dtype == smooth.difference.dtype == np.float32


@pytest.mark.parametrize("traced", [True, False], ids=["as traced", "difference alone"])
def test_the_mean_of_noise_about_no_change_is_kept(traced):
    """Light added and light taken are as strong as each other, and noisy: their difference is noise about 0.

    Its two signs are halves of that noise, whose means are no light's, but their difference is.
    """
    generator = np.random.default_rng(4)
    shape = (128, 128, 3)
    # As a path tracer's pixels are: few bright paths where light is added, many where it is taken.
    added = 0.2 * generator.gamma(0.5, 1 / 0.5, shape).astype(np.float32)
    taken = 0.2 * generator.gamma(16.0, 1 / 16.0, shape).astype(np.float32)
    change = light_alone(added, taken, known=traced)
    smooth = denoised(change)
    # The mean of so many values is known to 0.0013; split by sign and left as cleaned it moved by 0.009 of 0.2.
    assert abs(float(smooth.difference.mean()) - float(change.difference.mean())) < 0.001
    assert smooth.taken is None and smooth.guide_albedo is None


def light_alone(added, taken, *, known=True):
    """A change without objects, of which the layers are known or only their difference."""
    flat, matte = np.full_like(added, 0.5), np.zeros(added.shape[:2], np.float32)
    normal = np.broadcast_to(np.array([0, 1, 0], np.float32), added.shape)
    return Change(
        np.zeros_like(added), added - taken, matte, matte, normal, flat, flat, flat, taken=taken if known else None
    )  # fmt: skip


@pytest.mark.parametrize("plate", [None, np.ones((128, 128, 3), np.float32)], ids=["no plate", "plate"])
@pytest.mark.parametrize("rare", [16, 64])
def test_light_of_rare_bright_paths_is_not_taken_for_noise(rare, plate):
    """What a rough metal throws beside it in the sun: one pixel of many has met it, and that blindingly."""
    generator = np.random.default_rng(rare)
    met = generator.random((128, 128, 1)) < 1 / rare
    added = np.where(met, 0.1 * rare, 0).astype(np.float32) * np.ones(3, np.float32)
    # A patch of it, in light that every pixel sees.
    added[:, :40] = 0
    added += 0.01
    smooth = denoised(light_alone(added, np.zeros_like(added)), plate)
    # As cleaned, it is 8 % too bright where one pixel of 16 has met it, and 25 % too dark where one of 64 has.
    assert smooth.difference.mean() == pytest.approx(float(added.mean()), rel=0.01)
    # It is where it was, and still clean.
    inside, traced = (each[24:-24, 64:-24] for each in (smooth.difference, added))
    assert inside.mean() == pytest.approx(float(traced.mean()), rel=0.08)
    assert inside.std() < 0.2 * traced.std()
    assert smooth.difference[24:-24, :8].mean() == pytest.approx(0.01, rel=0.1)


def test_a_shadow_keeps_the_light_it_takes_beside_an_edge():
    generator = np.random.default_rng(5)
    taken = 0.25 * generator.gamma(4.0, 1 / 4.0, (96, 96, 3)).astype(np.float32)
    taken[:, 48:] = 0
    smooth = denoised(light_alone(np.zeros_like(taken), taken), np.ones_like(taken))
    assert not smooth.difference[:, 48:].any()
    assert smooth.difference[:, :48].mean() == pytest.approx(-float(taken[:, :48].mean()), rel=0.01)


def test_what_is_left_of_the_light_in_a_deep_shadow_is_clean():
    """Sunlit stone: a small shadow that takes nine tenths, in a shade of thousandths that the objects cast around."""
    generator = np.random.default_rng(6)
    shadow = np.s_[50:80, 40:90]
    taken = (0.003 * generator.gamma(1.0, 1.0, (128, 128, 3))).astype(np.float32)
    taken[shadow] = 0.9 * (1 + 0.05 * generator.standard_normal((30, 50, 3)))
    plate = np.ones_like(taken)
    smooth = denoised(light_alone(np.zeros_like(taken), taken), plate)
    inside = 1 + smooth.difference[55:75, 45:85]
    assert inside.mean() == pytest.approx(0.1, rel=0.1)
    # Cleaned as a share of the light alone, what is left was mottled by 0.18 of itself; as traced, by 0.45.
    assert inside.std() < 0.1 * inside.mean()


def test_the_number_of_threads_changes_no_bit():
    random = np.random.default_rng(4)
    picture, albedo, normal = (random.random((128, 128, 3)).astype(np.float32) for _ in range(3))
    cleaned = []
    for threads in (1, 2, 3, 16):  # with other sums of other threads three and sixteen differ from two
        with _mitsuba(None, threads):
            cleaned.append(_clean(picture, albedo, normal))
    assert all(np.array_equal(cleaned[0], other) for other in cleaned[1:])


@pytest.mark.parametrize("quick", [False, True])
def test_what_shows_has_the_bits_it_has_in_the_whole_picture(quick):
    random = np.random.default_rng(4)
    picture, albedo, normal = (random.random((400, 420, 3)).astype(np.float32) for _ in range(3))
    shown = np.zeros((400, 420), bool)
    shown[203:221, 150:187] = True
    whole, part = (_clean(picture, albedo, normal, quick, where) for where in (None, shown))
    assert np.array_equal(part[shown], whole[shown])
    assert not part[:90].any() and not part[:, :40].any()
    assert not _clean(picture, albedo, normal, quick, np.zeros_like(shown))[200:].any()


def test_a_picture_is_as_bright_to_the_filter_as_it_is_by_itself():
    import mitsuba_oidn

    assert exposure(np.full((33, 50, 3), 0.36, np.float32)) == pytest.approx(0.5)
    assert exposure(np.zeros((20, 20, 3), np.float32)) == 1
    random = np.random.default_rng(4)
    picture = (40 * random.random((70, 57, 3)) ** 4).astype(np.float32)
    picture[:20] = 0
    itself = mitsuba_oidn.denoise(picture, hdr=True)
    near = mitsuba_oidn.denoise(picture, hdr=True, input_scale=exposure(picture))
    np.testing.assert_allclose(itself, near, atol=1e-5 * itself.max())


def test_colours_of_pure_wavelengths_are_not_clipped():
    # 520 nm is outside of Rec. 709, and OIDN takes what is below 0 for 0.
    noise = np.random.default_rng(4).normal(1, 0.05, (64, 64, 1))
    pure = (noise * [-0.5, 0.9, -0.1]).astype(np.float32)
    flat = np.zeros((64, 64, 3), np.float32)
    with _mitsuba(None, None):
        clean = _clean(pure, flat, flat)
    np.testing.assert_allclose(clean.mean(axis=(0, 1)), (-0.5, 0.9, -0.1), atol=0.03)


def field(side: int = 96) -> np.ndarray:
    return np.ones((side, side, 3), np.float32)


SHOWS = np.ones((96, 96, 1), np.float32)


def test_a_highlight_keeps_its_own_light_without_a_halo():
    traced, clean = field(), field()
    traced[40:43, 50:53], clean[40:43, 50:53] = 1000.0, 600.0
    found = _as_bright(clean, traced, SHOWS, True)
    beside = np.ones((96, 96), bool)
    beside[40:43, 50:53] = False
    # Given to all about it, the light that was taken would be 1.6 times theirs.
    np.testing.assert_allclose(found[beside], 1, atol=1e-3)
    np.testing.assert_allclose(found[~beside], 1000, rtol=1e-4)


def test_a_rare_bright_path_is_given_to_what_is_about_it():
    traced, clean = field(), field()
    traced[40, 50], clean[40, 50] = 500.0, 5.0
    found = _as_bright(clean, traced, SHOWS, True)
    assert found[40, 50, 0] <= 20.001
    # And nothing of it is lost but at the edge of the place.
    assert found.sum() == pytest.approx(traced.sum(), rel=0.01)
    assert 1.01 < found[44, 54, 0] < 2


def test_a_small_bright_disc_stays_clean():
    rows, columns = np.mgrid[:96, :96]
    disc = np.hypot(rows - 48, columns - 48) < 6
    clean = np.where(disc[..., None], 20.0, 0.1).astype(np.float32) * field()
    noise = np.random.default_rng(3).normal(1, 0.5, (96, 96, 1)).clip(0)
    found = _as_bright(clean, clean * noise.astype(np.float32), SHOWS, True)
    assert (found[disc] / 20).std() < 0.1
    assert found.sum() == pytest.approx((clean * noise).sum(), rel=0.02)

"""Depth of field: edges that do not bleed, light that stays, and a slow twin."""

import numpy as np
import pytest

from relume.image.photograph import Exposure, Photograph, Settings
from relume.virtual_camera.lens import defocus_blur
from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.lens.defocus_blur import (
    Defocus,
    aperture_from,
    aperture_of,
    depth_of_field,
    disc_of_confusion,
)
from relume.virtual_camera.lens.defocus_kernels import LAYER
from relume.virtual_camera.lens.disc_table import disc_table, size_of
from relume.virtual_camera.lens.disocclusion import hidden_background, unmixed
from relume.virtual_camera.view import View

FOCAL = 300.0
LENS = Defocus(aperture=0.05, focus=1.0)
"""Draws what is 3 m away with a radius of 0.05 · 300 · (1 − 1/3) / 2 = 5 pixels."""


def through(lens, radiance, depth):
    return lens.apply(radiance, View(FOCAL, depth=np.broadcast_to(np.float32(depth), radiance.shape[:2])))


def lit(height=60, width=80, *, seed=1, suns=3):
    random = np.random.default_rng(seed)
    radiance = random.random((height, width, 3)).astype(np.float32)
    for _ in range(suns):
        radiance[random.integers(20, height - 20), random.integers(20, width - 20)] = 1e6, 5e5, 1e5
    return radiance


def test_a_lamp_is_drawn_as_an_even_disc_with_all_its_light():
    radiance = np.zeros((41, 41, 3), np.float32)
    radiance[20, 20] = 1000, 500, 0
    blurred = through(LENS, radiance, 3.0)
    y, x = np.mgrid[:41, :41] - 20
    # π 5² pixels share the light: 1000 / 78.54 = 12.732.
    assert blurred[20, 20, 0] == pytest.approx(12.732, rel=1e-4)
    np.testing.assert_allclose(blurred[np.hypot(x, y) < 4.2, 0], 12.732, rtol=1e-4)
    assert blurred[np.hypot(x, y) > 5.8].max() < 1e-12
    np.testing.assert_allclose(blurred.sum((0, 1), dtype=float), [1000, 500, 0], rtol=1e-7)


@pytest.mark.parametrize("blades", [Blades(), Blades(5, 0.2, 0.1)])
def test_a_plane_at_one_depth_keeps_its_light(blades):
    radiance = lit()
    radiance[:12] = radiance[-12:] = radiance[:, :12] = radiance[:, -12:] = 0.5
    for depth in (3.0, np.inf, 0.7):
        blurred = through(Defocus(0.05, 1.0, blades), radiance, depth)
        assert np.abs(blurred - radiance).max() > 1e5
        np.testing.assert_allclose(blurred.sum((0, 1), dtype=float), radiance.sum((0, 1), dtype=float), rtol=1e-6)


def test_even_light_stays_whatever_the_depths():
    depth = np.random.default_rng(2).choice([0.6, 1.0, 2.0, 5.0, np.inf], (50, 70)).astype(np.float32)
    depth[:, 40:] = np.linspace(0.5, 20, 50, dtype=np.float32)[:, None]
    blurred = through(LENS, np.full((50, 70, 3), 0.7, np.float32), depth)
    np.testing.assert_allclose(blurred, 0.7, rtol=1e-6)


def test_what_is_sharp_does_not_leak_into_the_blurred_background():
    radiance, depth = np.full((40, 60, 3), 0.1, np.float32), np.full((40, 60), 3.0, np.float32)
    radiance[:, :30], depth[:, :30] = 100.0, 1.0
    blurred = through(LENS, radiance, depth)
    np.testing.assert_allclose(blurred[:, :30], 100.0, rtol=1e-6)
    np.testing.assert_allclose(blurred[:, 30:], 0.1, rtol=1e-5)


def test_a_blurred_foreground_covers_the_background_by_the_area_of_its_discs():
    radiance, depth = np.full((40, 60, 3), 0.1, np.float32), np.full((40, 60), 3.0, np.float32)
    radiance[:, :30], depth[:, :30] = 1.0, 1.0
    blurred = through(Defocus(0.05, 3.0), radiance, depth)  # −5 pixels at 1 m
    t = (np.arange(60) + 0.5 - 30) / 5
    side = np.clip(t, -1, 1)
    share = 0.5 - (side * np.sqrt(1 - side**2) + np.arcsin(side)) / np.pi
    np.testing.assert_allclose(blurred[20, :, 1], 0.1 + 0.9 * share, atol=2e-3)


def test_nothing_behind_shows_through_a_curved_thing():
    # A ball, its front nearly in focus and its limb 1.5 pixels out of it, before a bright blurred wall.
    y, x = np.mgrid[:80, :100] + 0.5 - [[[40]], [[50]]]
    ball = np.hypot(x, y) < 30
    away = 1 - np.sqrt(np.maximum(1 - (x**2 + y**2) / 900, 0))
    depth = np.where(ball, 1 / (1 - 0.2 * away), 4.0).astype(np.float32)
    radiance = np.where(ball, 1.0, 100.0)[..., None].repeat(3, 2).astype(np.float32)
    radius = LENS.radius(depth, FOCAL)
    assert 1.2 < radius[ball].max() < 1.6 and radius[0, 0] == pytest.approx(5.625)
    blurred = through(LENS, radiance, depth)
    np.testing.assert_allclose(blurred[np.hypot(x, y) < 27], 1.0, rtol=1e-6)
    np.testing.assert_allclose(blurred[np.hypot(x, y) > 33], 100.0, rtol=1e-6)


def test_pixels_that_a_sharp_edge_crosses_stay_as_they_are():
    # The edge's own column holds the mean of both sides, in light and in depth.
    radiance, depth = np.full((40, 60, 3), 1.0, np.float32), np.full((40, 60), 3.0, np.float32)
    radiance[:, :30], depth[:, :30] = 0.2, 1.0
    radiance[:, 30], depth[:, 30] = 0.6, 2.0
    blurred = through(LENS, radiance, depth)
    np.testing.assert_allclose(blurred[:, :31], radiance[:, :31], rtol=1e-6)


def test_the_background_behind_a_blurred_edge_stays_sharp():
    # Stripes across the edge: they go on behind it, instead of being smeared or cut.
    radiance, depth = np.zeros((40, 60, 3), np.float32), np.full((40, 60), 3.0, np.float32)
    radiance[::8] = radiance[1::8] = radiance[2::8] = radiance[3::8] = 1.0
    radiance[:, :30], depth[:, :30] = 0.0, 1.0
    blurred = through(Defocus(0.05, 3.0), radiance, depth)[..., 1]
    white = np.where(depth[..., None] > 2, np.float32(1), np.float32(0)).repeat(3, axis=2)
    seen = through(Defocus(0.05, 3.0), white, depth)[20, :, 1]
    assert seen[26] == pytest.approx(0.09406, abs=1e-4)  # 3.5 of 5 pixels inside: ½ − (0.7 √0.51 + asin 0.7) / π
    np.testing.assert_allclose(blurred[17:20], [seen] * 3, atol=1e-6)
    assert blurred[20:24].max() < 1e-6


def test_at_the_focus_nothing_changes():
    radiance = lit()
    assert np.array_equal(through(Defocus(0.05, 2.0), radiance, 2.0), radiance)
    assert np.array_equal(through(Defocus(0.05, np.inf), radiance, np.inf), radiance)
    assert through(LENS, np.zeros((18, 19, 3), np.float32), 3.0).max() == 0


def test_before_the_focus_the_radius_is_below_zero():
    radius = LENS.radius(np.array([0.5, 1.0, 3.0, np.inf]), FOCAL)
    np.testing.assert_allclose(radius, [-7.5, 0, 5, 7.5], rtol=1e-6)
    np.testing.assert_allclose(Defocus(0.05, np.inf).radius(np.array([2.0, np.inf]), FOCAL), [-3.75, 0], rtol=1e-6)


def naive(radiance, depth, lens):
    """The same sums, disc by disc into the whole mirrored picture, layer by layer, without tables of changes."""
    height, width = depth.shape
    radius = unmixed(lens.radius(depth, FOCAL))
    size, (behind, opening) = size_of(radius), hidden_background(radiance, radius)
    table = disc_table(lens.blades, int(size.min()), int(size.max()))
    n = table.widest
    layers = {}
    for y in range(-n, height + n):
        for x in range(-n, width + n):
            v, u = (p if 0 <= p < s else (-1 - p if p < 0 else 2 * s - 1 - p) for p, s in ((y, height), (x, width)))
            for source in (v * width + u, behind[v, u]):
                if source < 0:
                    continue
                i = size.ravel()[source] - table.lowest
                part, reach = slice(table.first[i], table.first[i + 1]), table.reach[i]
                changes = np.zeros((2 * reach + 1, 2 * reach + 3))
                np.add.at(changes, (table.down[part] + reach, table.right[part] + reach), table.change[part])
                disc = np.cumsum(changes, axis=1)[:, : 2 * reach + 1, None]
                layer = layers.setdefault(i // LAYER, np.zeros((height + 4 * n, width + 4 * n, 4)))
                top, left = y + 2 * n - reach, x + 2 * n - reach
                colour = np.append(radiance.reshape(-1, 3)[source], 1.0)
                layer[top : top + 2 * reach + 1, left : left + 2 * reach + 1] += disc * colour
    light, covered = np.zeros((height, width, 3)), np.zeros((height, width, 1))
    deepest = table.deepest[size - table.lowest] // LAYER
    for key in sorted(layers):
        layer = layers[key][2 * n : 2 * n + height, 2 * n : 2 * n + width] * (opening | (key <= deepest))[..., None]
        share = np.minimum(1, (1 - covered) / np.maximum(layer[..., 3:], 1e-12))
        light, covered = light + share * layer[..., :3], covered + share * layer[..., 3:]
    return light / covered


def test_the_slow_twin_agrees():
    random = np.random.default_rng(5)
    radiance = lit(24, 32, suns=0)
    depth = np.full((24, 32), 4.0, np.float32)
    depth[:, 20:] = np.linspace(0.8, 5, 24, dtype=np.float32)[:, None]
    depth[6:18, 4:14] = 0.7
    depth[random.random((24, 32)) < 0.05] = 1.3
    lens = Defocus(0.04, 1.2, Blades(5, 0.3))
    np.testing.assert_allclose(through(lens, radiance, depth), naive(radiance, depth, lens), rtol=1e-5, atol=1e-6)


def test_tiles_and_threads_leave_no_trace(monkeypatch):
    radiance = lit(70, 90)
    depth = np.random.default_rng(3).choice([0.8, 1.0, 4.0], (7, 9)).repeat(10, 0).repeat(10, 1)
    whole = through(LENS, radiance, depth)
    monkeypatch.setattr(defocus_blur, "TILE", 32)
    tiled = through(LENS, radiance, depth)
    np.testing.assert_allclose(tiled, whole, rtol=1e-5, atol=1e-6)
    monkeypatch.setattr("relume.image.kernel.os.cpu_count", lambda: 1)
    assert np.array_equal(through(LENS, radiance, depth), tiled)


def test_what_cannot_be_done_is_refused():
    radiance = np.ones((20, 30, 3), np.float32)
    with pytest.raises(ValueError, match=r"a depth map of the picture is needed; give one, or .* soft focus"):
        LENS.apply(radiance, View(FOCAL))
    with pytest.raises(ValueError, match="30×21 pixels and the picture 30×20"):
        LENS.apply(radiance, View(FOCAL, depth=np.ones((21, 30), np.float32)))
    with pytest.raises(ValueError, match=r"x 7, y 4, 0\.01 m away, is 1485 pixels wide.* focus nearer"):
        depth = np.ones((20, 30), np.float32)
        depth[4, 7] = 0.01
        LENS.apply(radiance, View(FOCAL, depth=depth))
    with pytest.raises(ValueError, match=r"infinitely far away, is .* stop the aperture .* use a shorter lens$"):
        # Nobody can focus nearer to what is infinitely far.
        Defocus(1.0, 0.5).apply(radiance, View(FOCAL, depth=np.full((20, 30), np.inf, np.float32)))


def test_the_aperture_is_the_focal_length_over_the_f_number():
    assert aperture_of(2.0, 50.0) == pytest.approx(0.025)
    assert aperture_of(8.0, 46.8916) == pytest.approx(0.00586145)
    for wrong in ((0, 50), (2, -1), (2, np.nan)):
        with pytest.raises(ValueError, match="expected a positive number"):
            aperture_of(*wrong)


def test_a_photograph_says_its_aperture_where_it_says_both():
    pixels = np.zeros((2, 2, 3), np.uint8)
    said = Photograph(pixels, exposure=Exposure(1, 2.0), settings=Settings(focal_length=50.0))
    assert aperture_from(said) == pytest.approx(0.025)
    assert aperture_from(Photograph(pixels, settings=Settings(focal_length=50.0))) is None
    assert aperture_from(Photograph(pixels, exposure=Exposure(1, 2.0))) is None
    assert aperture_from(Photograph(pixels, exposure=Exposure(1), settings=Settings(focal_length=50.0))) is None


def test_the_disc_is_what_rays_through_the_rim_of_the_lens_draw():
    # Rays from a point through the rim of a thin lens, followed to the image plane; pixels of 1/1000 of its distance.
    aperture, focus, distance, v = 0.02, 1.5, 0.9, 1000.0
    plane_of_focus = [h * (1 - focus / distance) for h in (-aperture / 2, aperture / 2)]  # of a point on the axis
    expected = v * abs(plane_of_focus[1] - plane_of_focus[0]) / focus
    assert disc_of_confusion(distance, aperture, focus, v) == pytest.approx(expected)
    assert disc_of_confusion(focus, aperture, focus, v) == 0
    assert disc_of_confusion(np.inf, aperture, focus, v) == pytest.approx(aperture * v / focus)
    assert disc_of_confusion(2.0, aperture, np.inf, v) == pytest.approx(aperture * v / 2)
    np.testing.assert_allclose(disc_of_confusion(np.array([1.0, 3.0]), 0.02, 1.5, 1000), [20 / 3, 20 / 3])
    with pytest.raises(ValueError, match="before the camera"):
        disc_of_confusion(-1.0, aperture, focus, v)


def test_at_the_ends_of_the_depth_of_field_the_disc_is_as_wide_as_accepted():
    near, far = depth_of_field(0.01, 1.2, 1000.0, acceptable=2.0)
    assert near < 1.2 < far < np.inf
    for end in (near, far):
        assert disc_of_confusion(end, 0.01, 1.2, 1000.0) == pytest.approx(2.0)
    # From the hyperfocal distance, 0.01 · 1000 / 2 m, all is sharp from its half to infinity.
    near, far = depth_of_field(0.01, 5.0, 1000.0, acceptable=2.0)
    assert far == np.inf and near == pytest.approx(2.5)
    with pytest.raises(ValueError, match="all must be positive"):
        depth_of_field(0, 1, 1000)

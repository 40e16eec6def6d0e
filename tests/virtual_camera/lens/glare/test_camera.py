"""A camera's glare: star, halo and veil, and all of the light."""

import numpy as np
import pytest

from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.lens.glare.camera import CameraGlare
from relume.virtual_camera.lens.glare.diffraction import near_light
from relume.virtual_camera.view import View

VIEW = View(100.0)


def within(picture: np.ndarray, radius: int) -> np.ndarray:
    """(3,) light within a circle about the middle."""
    fine = (np.arange((2 * radius + 1) * 8) + 0.5) / 8 - radius - 0.5
    inside = np.hypot(fine, fine[:, None]) < radius
    return np.einsum("ij,ijc->c", inside.reshape(2 * radius + 1, 8, 2 * radius + 1, 8).mean((1, 3)), picture)


@pytest.mark.parametrize("curvature", [0.3, 1.0])
@pytest.mark.parametrize("f_number", [2.8, 16.0])
def test_a_stars_light_is_all_there(curvature, f_number):
    radius = 200
    spread = CameraGlare(Blades(7, curvature), f_number, 24.0, veil=0).point_spread(2160, 3840)
    picture = spread.draw(radius, radius).astype(np.float64)
    # What lies outside of the circle by r⁻³ is 2 π r² times the mean on it: taken from the picture itself.
    y, x = np.mgrid[-radius : radius + 1, -radius : radius + 1]
    ring = np.abs(np.hypot(x, y) - 160) < 20
    mean = (picture[ring] * np.hypot(x, y)[ring][:, None] ** 3).mean(0)
    assert within(picture, radius) + 2 * np.pi * mean / radius == pytest.approx(np.ones(3), abs=2e-5)


def test_the_middle_keeps_what_diffraction_leaves_there():
    # What is left after all other pixels is what the transform of the opening says itself.
    glare = CameraGlare(Blades(6), 8.0, veil=0)
    kept = glare.point_spread(2160, 3840).kept[1]
    orders = np.array([0.52, 0.55]) * 1e-3 * 8 * 3840 / 36
    low, high = near_light(glare.blades, orders, 2)[:, 2, 2]
    assert high < kept < low and low - high < 0.03


def test_a_halo_is_as_large_as_its_share():
    radius = 300
    glare = CameraGlare(f_number=1.0, veil=0, halo=0.2, halo_core=0.01, halo_power=1.5)
    picture = glare.point_spread(600, 800).draw(radius, radius).astype(np.float64)
    # Within r the halo holds 1 − (1 + (r / core)²)^(1 − power), with a core of 10 pixels.
    expected = 0.8 + 0.2 * (1 - 901**-0.5)
    assert within(picture, radius) == pytest.approx(np.full(3, expected), abs=1e-4)
    # Between two rays of the star, at 100 pixels.
    assert picture[radius, radius + 100].mean() == pytest.approx(0.2 * 0.5 / np.pi * 10 / (10100**1.5), rel=0.03)


def test_the_veil_is_even_and_keeps_all_light():
    radiance = np.zeros((101, 121, 3), np.float32)
    radiance[50, 60] = 1000, 2000, 3000
    bare, veiled = (CameraGlare(f_number=1.0, veil=veil).apply(radiance, VIEW) for veil in (0.0, 0.05))
    assert veiled[0, 0] / (0.05 * radiance.mean((0, 1))) == pytest.approx(np.ones(3), rel=0.05)
    held, light = (picture.sum((0, 1), dtype=np.float64) for picture in (bare, radiance))
    assert veiled.sum((0, 1), dtype=np.float64) == pytest.approx(0.95 * held + 0.05 * light, rel=1e-5)
    assert bare.sum((0, 1)) / radiance.sum((0, 1)) == pytest.approx(np.ones(3), abs=1e-3)


def test_stars_grow_with_the_f_number_and_redden_outwards():
    lamp = np.zeros((161, 161, 3), np.float32)
    lamp[80, 80] = 1e4
    open_, closed = (CameraGlare(f_number=f, veil=0).apply(lamp, VIEW) for f in (4.0, 8.0))
    far = (slice(None), slice(130, 160))
    assert closed[far].sum() / open_[far].sum() == pytest.approx(2, rel=0.03)
    red, green, blue = closed[far].sum((0, 1))
    assert red > green > blue and red / blue == pytest.approx(607 / 463, rel=0.05)


def test_a_star_is_as_large_however_the_camera_is_held():
    # An even number of straight blades with a corner to the right, turned by a quarter.
    lamp = np.zeros((81, 161, 3), np.float32)
    lamp[40, 80] = 1e4
    lying = CameraGlare(Blades(8), 11.0, veil=0.02, halo=0.05)
    landscape, portrait = (lying.apply(np.ascontiguousarray(scene), VIEW) for scene in (lamp, lamp.swapaxes(0, 1)))
    np.testing.assert_allclose(portrait.swapaxes(0, 1), landscape, rtol=2e-3, atol=1e-6)


def test_spikes_count_as_blades_in_the_picture():
    lamp = np.zeros((201, 201, 3), np.float32)
    lamp[100, 100] = 1e5
    angle = np.linspace(0, 2 * np.pi, 720, endpoint=False) + 0.002
    place = (np.rint(100 + 70 * np.sin(angle)).astype(int), np.rint(100 + 70 * np.cos(angle)).astype(int))
    for blades, rays in ((6, 6), (5, 10)):
        ring = CameraGlare(Blades(blades, rotation=-0.2 - np.pi / blades), veil=0).apply(lamp, VIEW)[..., 1][place]
        above = ring > 4 * ring.mean()
        smooth = np.convolve(np.concatenate([above[-6:], above, above[:6]]), np.ones(13), "valid") > 0
        assert np.count_nonzero(smooth & ~np.roll(smooth, 1)) == rays


def test_frames_of_one_size_share_a_point_spread_and_others_do_not(monkeypatch):
    made = []
    drawn = CameraGlare.point_spread

    def counted(self, height, width):
        made.append((height, width))
        return drawn(self, height, width)

    monkeypatch.setattr(CameraGlare, "point_spread", counted)
    frame = np.ones((21, 33, 3), np.float32)
    glare = CameraGlare(f_number=5.1)
    first = glare.apply(frame, VIEW)
    np.testing.assert_array_equal(CameraGlare(f_number=5.1).apply(frame, VIEW), first)
    assert made == [(21, 33)]
    for other, light in ((glare, frame[:20]), (CameraGlare(f_number=5.2), frame), (CameraGlare(Blades(5)), frame)):
        other.apply(light, VIEW)
    assert made == [(21, 33), (20, 33), (21, 33), (21, 33)]

"""The eye's glare: the paper's point spreads, all of their light, white in sum, and needles about small lights only."""

from dataclasses import replace

import numpy as np
import pytest

from relume.virtual_camera.lens.glare.ciliary_corona import corona
from relume.virtual_camera.lens.glare.eye import (
    EyeGlare,
    halo_of_channels,
    lenticular_halo,
    norms_of_scatter,
    steep_scatter,
    unscattered,
    wide_scatter,
)
from relume.virtual_camera.lens.glare.point_spread import PolarSpread
from relume.virtual_camera.lens.glare.wavelengths import channel_shares, colour_matching
from relume.virtual_camera.view import View

EYE = EyeGlare()


def within(spread: PolarSpread, radius: int) -> np.ndarray:
    """(3,) light within a circle about the point."""
    picture = spread.draw(radius, radius).astype(np.float64)
    fine = (np.arange((2 * radius + 1) * 8) + 0.5) / 8 - radius - 0.5
    inside = np.hypot(fine, fine[:, None]) < radius
    covered = inside.reshape(2 * radius + 1, 8, 2 * radius + 1, 8).mean((1, 3))
    return np.einsum("ij,ijc->c", covered, picture)


def expected_within(shares: np.ndarray, degrees: float) -> float:
    """Light within an angle of the point, the printed functions integrated, each over its own hemisphere."""

    def integral(function, end: float) -> float:
        angle = np.concatenate([[0], np.geomspace(1e-5, end, 40001)])
        return float(np.trapezoid(function(angle) * np.sin(np.radians(angle)), angle))

    functions = (unscattered, steep_scatter, wide_scatter)
    return sum(share * integral(f, degrees) / integral(f, 90.0) for share, f in zip(shares[:3], functions, strict=True))


def test_the_point_spreads_are_those_of_the_paper():
    assert unscattered(np.array([0.0, 0.02])) == pytest.approx([2.61e6, 960165.3], rel=1e-6)
    assert steep_scatter(np.array([0.0, 0.98])) == pytest.approx([2613750.0, 20.91])
    assert wide_scatter(np.array([0.0, 0.98])) == pytest.approx([180925.0, 72.37])
    assert lenticular_halo(np.array([3.0, 3.2])) == pytest.approx([436.9, 198.28], rel=1e-4)
    assert lenticular_halo(np.array([2.21831]), 420.0) == pytest.approx([590.855], rel=1e-4)
    # As printed they sum to 1; so the constants are read rightly.
    assert norms_of_scatter() == pytest.approx((1, 1, 1), abs=2e-3)


@pytest.mark.parametrize(
    ("adaptation", "shares"),
    [
        (100, [0.384, 0.478, 0.138, 0]),
        (3, [0.384, 0.478, 0.138, 0]),
        (0.173, [0.368, 0.478, 0.138, 0.016]),
        (0.01, [0.282, 0.478, 0.207, 0.033]),
        (1e-5, [0.282, 0.478, 0.207, 0.033]),
        (0.0416, [0.325, 0.478, 0.1725, 0.0245]),
    ],
)
def test_shares_go_with_the_adaptation(adaptation, shares):
    assert EYE.shares(adaptation) == pytest.approx(shares, abs=1e-4)


def test_a_narrow_pupil_hides_the_halo():
    assert EyeGlare(pupil=2.9).shares(0.001) == pytest.approx([0.315, 0.478, 0.207, 0])
    assert EyeGlare(pupil=3.5).shares(0.001)[3] == pytest.approx(0.0165)
    assert EyeGlare(pupil=7.0).shares(0.001)[3] == pytest.approx(0.033)


@pytest.mark.parametrize("focal_length", [115.0, 3800.0, 20000.0])
@pytest.mark.parametrize("sharp", [True, False])
def test_all_light_is_where_the_point_spread_says(focal_length, sharp):
    # Pixels of 0.5°, 0.015° and 0.003°; the circle's edge goes through the middles of smooth glare.
    radius = 150
    spread = EyeGlare(sharp=sharp).point_spread(100.0, View(focal_length), 2.0 * radius)
    expected = expected_within(EYE.shares(100.0), float(np.degrees(np.arctan(radius / focal_length))))
    if sharp and focal_length == 20000.0:
        expected += 0.384 * np.exp(-((radius / focal_length / np.radians(0.02)) ** 2))
    assert within(spread, radius) == pytest.approx(np.full(3, expected), abs=1e-5)


def test_a_blur_that_a_pixel_holds_stays_in_it_and_a_wide_one_does_not():
    kept = [EyeGlare(sharp=False).point_spread(100.0, View(f), 300.0).kept[1] for f in (115.0, 3800.0, 20000.0)]
    # At 0.015° f₀ and the core of f₁ reach the neighbours; at 0.003° all is wider than a pixel.
    assert kept[0] > 0.8 and 0.1 < kept[1] < 0.3 and kept[2] < 0.02
    sharp = [EYE.point_spread(100.0, View(f), 300.0).kept[1] for f in (3800.0, 20000.0)]
    assert sharp[0] > 0.384 and 0.384 < sharp[1] < 0.4


def test_the_halo_lies_at_three_degrees_times_the_wavelength():
    focal_length, amounts = 3000.0, channel_shares(np.arange(400.0, 701.0, 10.0))
    with_, without = (
        EyeGlare(pupil=pupil).point_spread(0.001, View(focal_length), 500.0).draw(0, 330)[0, 330:].astype(float)
        for pupil in (7.0, 2.0)
    )
    ring = (with_ - without)[60:]
    degrees = np.degrees(np.arctan(np.arange(60, 331) / focal_length))[:, None]
    middle = (ring * degrees**1.0).sum(0) / ring.sum(0)
    wavelengths = amounts @ np.arange(400.0, 701.0, 10.0)
    assert middle == pytest.approx(3 * wavelengths / 568, abs=0.03)
    assert degrees[ring.argmax(0)[1]] == pytest.approx(2.87, abs=0.12)
    assert halo_of_channels(amounts).shape == (3, 2001)


def test_white_light_stays_white_in_sum():
    # 6° hold the whole halo, whatever its colours.
    light = within(EyeGlare(adaptation=0.001).point_spread(0.001, View(1500.0), 400.0), 160)
    assert light == pytest.approx(np.full(3, light[1]), abs=2e-5)


def test_needles_are_random_coloured_and_take_no_light():
    degrees, distances = np.array([0.0, 0.05, 1.0, 60.0]), np.array([0.0, 3.0, 60.0, 4000.0])
    amounts = channel_shares(np.arange(400.0, 701.0, 10.0))
    drawn, again, other = (
        corona(degrees, distances, 1024, np.arange(400.0, 701.0, 10.0), amounts, seed) for seed in (1, 1, 2)
    )
    assert np.array_equal(drawn, again) and not np.allclose(drawn, other)
    assert drawn.mean(2) == pytest.approx(np.ones((3, 4)), abs=1e-5) and drawn.min() >= 0
    assert np.ptp(drawn[:, 0]) == pytest.approx(0, abs=1e-5)
    assert drawn[1, 2].std() > 0.3 > drawn[1, 3].std()
    assert np.abs(drawn[0, 2] - drawn[2, 2]).max() > 0.3


def test_needles_vanish_about_large_lights():
    # 4 and 60 minutes of arc: the paper's limit is 20.
    height, focal_length = 240, 400 / np.radians(10.0)
    y, x = np.mgrid[:height, :height] - height // 2
    angle = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    ring = (np.rint(100 * np.sin(angle)).astype(int) + 120, np.rint(100 * np.cos(angle)).astype(int) + 120)
    contrast = []
    for radius in (1.4, 20.0):
        lamp = np.where((np.hypot(x, y) < radius)[..., None], np.float32(1e4), np.float32(0)) * np.ones(3, np.float32)
        seen = EyeGlare(adaptation=100.0).apply(lamp, View(focal_length))[..., 1][ring]
        contrast.append(seen.std() / seen.mean())
    assert contrast[0] > 0.25 and contrast[1] < 0.4 * contrast[0]


def test_the_picture_says_what_the_eye_is_used_to():
    radiance = np.full((60, 80, 3), 0.5, np.float32)
    for scale, adaptation in ((200.0, 100.0), (0.002, 0.001)):
        seen = EYE.apply(radiance, View(100.0, scale))
        assert np.array_equal(seen, EyeGlare(adaptation=adaptation).apply(radiance, View(100.0, scale)))
    day, night = (EYE.apply(radiance, View(100.0, scale)) for scale in (200.0, 0.002))
    assert night[0, 0, 1] < day[0, 0, 1]
    assert not EYE.apply(np.zeros((9, 30, 3), np.float32), View(50.0)).any()


def test_frames_of_one_light_share_a_point_spread_and_others_do_not(monkeypatch):
    made = []
    drawn = EyeGlare.point_spread

    def counted(self, adaptation, view, reach):
        made.append(adaptation)
        return drawn(self, adaptation, view, reach)

    monkeypatch.setattr(EyeGlare, "point_spread", counted)
    frame, view = np.full((20, 30, 3), 0.5, np.float32), View(123.0)
    frame[10, 15] = 50
    first = EyeGlare().apply(frame, view)
    # The same light but for a flicker, another frame of the sequence, and the same again.
    EyeGlare().apply(frame * np.float32(1.0001), replace(view, frame=1))
    np.testing.assert_array_equal(EyeGlare().apply(frame, view), first)
    assert len(made) == 1
    mean = float(np.exp(np.log(frame.astype(np.float64) @ [0.2126, 0.7152, 0.0722]).mean()))
    assert made[0] == pytest.approx(mean, rel=0.006) and made[0] != pytest.approx(mean, rel=1e-6)
    # Whatever the point spread depends on makes another one.
    others = [
        (EyeGlare(), frame * np.float32(1.05), view),
        (EyeGlare(), frame, replace(view, focal_length=124.0)),
        (EyeGlare(), frame, replace(view, seed=1)),
        (EyeGlare(), frame[:18], view),
        (EyeGlare(sharp=False), frame, view),
        (EyeGlare(adaptation=0.7), frame, view),
    ]
    for count, (glare, light, seen) in enumerate(others, start=2):
        glare.apply(light, seen)
        assert len(made) == count
    assert made[-1] == 0.7


def test_the_fit_is_near_the_standard_observer():
    # CIE 1931, x̄, ȳ, z̄ at 450, 555 and 600 nm.
    table = [[0.3362, 0.0380, 1.7721], [0.5121, 1.0000, 0.0057], [1.0622, 0.6310, 0.0008]]
    assert np.abs(colour_matching(np.array([450.0, 555.0, 600.0])) - table).max() < 0.025


def test_colours_hold_their_own_wavelengths_and_all_of_their_light():
    wavelengths = np.arange(400.0, 701.0, 10.0)
    shares = channel_shares(wavelengths)
    assert shares.shape == (3, 31) and shares.min() >= 0
    assert shares.sum(1) == pytest.approx([1, 1, 1], abs=1e-12)
    red, green, blue = shares @ wavelengths
    assert 590 < red < 620 and 530 < green < 555 and 445 < blue < 470

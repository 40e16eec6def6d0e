"""Falloff towards the corners, put in and taken out."""

import numpy as np
import pytest

from relume.capture.lens.vignetting import Vignetting
from relume.virtual_camera.lens.vignetting import (
    CosineFourth,
    MeasuredVignetting,
    PolynomialVignetting,
    image_illuminance,
)
from relume.virtual_camera.protocols import Undoable
from relume.virtual_camera.view import View

KINDS = [
    CosineFourth(),
    PolynomialVignetting((-0.3, 0.1, -0.05)),
    MeasuredVignetting(Vignetting((-0.4, 0.08), (0.52, 0.47), f_number=2.8)),
]
EVEN = np.ones((90, 120, 3), np.float32)
VIEW = View(60.0)


def test_cos4_at_45_degrees_is_a_quarter():
    # Column 119.5 of a picture 119 wide about 59.5 is no pixel; 60 pixels from the axis at focal length 60 is 45°.
    seen = CosineFourth().apply(np.ones((121, 121, 3), np.float32), VIEW)
    assert seen[60, 60] == pytest.approx([1, 1, 1])
    assert seen[60, 120] == pytest.approx([0.25] * 3) and seen[0, 60] == pytest.approx([0.25] * 3)
    # √2 · 60 from the axis: cos² = 1 / 3.
    assert seen[0, 0] == pytest.approx([1 / 9] * 3)


def test_the_polynomial_is_1_at_half_the_diagonal():
    seen = PolynomialVignetting((-0.3, 0.1, -0.05)).apply(np.ones((3, 5, 3), np.float32), VIEW)
    # The corner pixel's middle is √(2² + 1²) from the centre, half the diagonal √34 / 2: r² = 5 / 8.5.
    square = 5 / 8.5
    assert seen[0, 0, 0] == pytest.approx(1 - 0.3 * square + 0.1 * square**2 - 0.05 * square**3)
    assert seen[0, 0, 0] == pytest.approx(0.847954, abs=1e-6) and seen[1, 2, 0] == 1


def test_what_was_measured_is_applied_as_capture_takes_it_out():
    for kind in KINDS[1:]:
        measured = kind.vignetting if isinstance(kind, MeasuredVignetting) else Vignetting(kind.coefficients)
        np.testing.assert_allclose(kind.apply(EVEN, VIEW)[..., 1], measured.falloff((120, 90)), rtol=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_undone_is_the_inverse(kind):
    radiance = np.random.default_rng(1).lognormal(0, 3, (90, 120, 3)).astype(np.float32)
    before = radiance.copy()
    step: Undoable = kind
    assert isinstance(step, Undoable)
    np.testing.assert_allclose(kind.undo(kind.apply(radiance, VIEW), VIEW), radiance, rtol=1e-6)
    assert kind.apply(EVEN, VIEW).min() < 0.8 and kind.undo(EVEN, VIEW).max() > 1.25
    assert np.array_equal(radiance, before)


def test_a_lens_leaves_some_light_everywhere():
    with pytest.raises(ValueError, match=r"leaves -0\.\d+ of the light in row 0"):
        PolynomialVignetting((-1.2,)).apply(EVEN, VIEW)
    with pytest.raises(ValueError, match="must be finite"):
        PolynomialVignetting((np.nan,))


def test_known_illuminances():
    # 1000 cd/m² at f/8 through a lens of 0.9: π/4 · 0.9 · 1000 / 64.
    assert image_illuminance(1000.0, 8.0, transmittance=0.9) == pytest.approx(11.0446617, abs=1e-6)
    assert image_illuminance(4000.0, 1.0) == pytest.approx(1000 * np.pi)
    assert image_illuminance(1.0, 1.0, angle=np.pi / 4) == pytest.approx(np.pi / 16)
    # ISO 12232's 0.65 is this with its lens: 0.9 of the light at 10° off the axis, 0.98 unvignetted.
    assert image_illuminance(0.98, 1.0, transmittance=0.9, angle=np.radians(10)) == pytest.approx(0.65, abs=0.003)


def test_a_stop_is_a_factor_of_exactly_two():
    stops = [float(image_illuminance(123.0, np.sqrt(2.0) ** n)) for n in range(8)]
    assert np.divide(stops[:-1], stops[1:]) == pytest.approx([2] * 7, rel=1e-15)


def test_it_goes_with_cos4_and_keeps_shapes():
    angle = np.radians([[0.0, 30.0, 60.0]])
    np.testing.assert_allclose(image_illuminance(16 / np.pi, 1.0, angle=angle), [[4, 4 * 0.5625, 0.25]])

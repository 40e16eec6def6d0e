"""The illuminance behind a lens (A35)."""

import numpy as np
import pytest

from relume.virtual_camera.lens.vignetting import image_illuminance


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


@pytest.mark.parametrize(
    ("fields", "message"),
    [({"f_number": 0}, "f-number is 0"), ({"f_number": 2, "transmittance": 1.1}, "transmittance is 1.1")],
)
def test_what_is_no_lens_is_refused(fields, message):
    with pytest.raises(ValueError, match=message):
        image_illuminance(1.0, **fields)

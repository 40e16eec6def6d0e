"""What was clipped in every photograph is told with its solid angle and its lower bound, and nothing is added to it."""

import numpy as np
import pytest

from relume.capture.brackets.result import clipping_report, solid_angles
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap


def picture(height: int = 6, width: int = 8) -> RadianceMap:
    clipped = np.zeros((height, width), np.uint8)
    clipped[1, 2], clipped[3, 4], clipped[4, 4:6], clipped[0] = SATURATED, SATURATED, BLACK, OUTSIDE
    radiance = np.full((height, width, 3), 2.0, np.float32)
    radiance[1, 2] = (50, 40, 30)
    radiance[3, 4] = 100
    radiance[0] = 0
    return RadianceMap(radiance, None, clipped)


def test_a_picture_s_pixels_fill_its_pyramid():
    # A right pyramid over w × h at distance f: 4 asin(w h / √((4f² + w²)(4f² + h²))).
    width, height, focal = 300, 200, 240.0
    whole = 4 * np.arcsin(width * height / np.sqrt((4 * focal**2 + width**2) * (4 * focal**2 + height**2)))
    cells = solid_angles(width, height, focal)
    assert cells.sum() == pytest.approx(whole, rel=1e-5)
    assert cells.argmax() in (99 * 300 + 149, 99 * 300 + 150, 100 * 300 + 149, 100 * 300 + 150)
    assert solid_angles(1, 1, 10.0) == pytest.approx(0.01)


def test_clipped_light_is_counted_with_its_bound():
    found = clipping_report(picture(), focal_length=100.0)
    cells = solid_angles(8, 6, 100.0)
    assert (found.saturated, found.black, found.outside, found.pixels) == (2, 2, 8, 48)
    assert found.solid_angle == pytest.approx(cells[1, 2] + cells[3, 4])
    assert found.brightest == pytest.approx(100.0)
    assert found.irradiance == pytest.approx(
        [cells[1, 2] * bound + cells[3, 4] * 100 for bound in (50, 40, 30)], rel=1e-6
    )


def test_without_a_focal_length_there_is_a_share_and_no_solid_angle():
    found = clipping_report(picture())
    assert found.solid_angle is None and found.irradiance is None
    clipped = (0.2126 * 50 + 0.7152 * 40 + 0.0722 * 30) + 100
    # 48 pixels: 8 outside without light, 2 saturated, 38 of luminance 2 (two of them black: their bound counts).
    assert found.share == pytest.approx(clipped / (clipped + 38 * 2), rel=1e-6)


def test_the_range_is_that_of_what_was_measured():
    radiance = np.repeat(np.geomspace(1e-2, 1e3, 10_000, dtype=np.float32).reshape(100, 100, 1), 3, axis=2)
    clipped = np.zeros((100, 100), np.uint8)
    assert clipping_report(RadianceMap(radiance, None, clipped)).orders == pytest.approx(5 * 0.9989, abs=1e-3)
    clipped[50:] = BLACK
    assert clipping_report(RadianceMap(radiance, None, clipped)).orders == pytest.approx(2.5, abs=0.01)


def test_a_map_that_does_not_know_what_was_clipped_is_refused():
    with pytest.raises(ValueError, match="no clipped mask"):
        clipping_report(RadianceMap(np.ones((2, 2, 3), np.float32)))

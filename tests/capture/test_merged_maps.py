"""A merged map: what was clipped, with solid angle and lower bound; and which photographs it was measured from."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from relume.capture.brackets.lens_steps import provenance
from relume.capture.brackets.result import clipping_report, solid_angles
from relume.image.files import read_photograph, write
from relume.image.files.metadata.exif import tags
from relume.image.files.metadata.exif_attributes import attributes_of
from relume.image.photograph import Exposure, Photograph, Settings
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


def test_what_all_photographs_share_is_kept_and_what_differs_is_not() -> None:
    settings = Settings(taken=datetime(2026, 3, 1, 12, 0, 5), lens="50 mm", serial="7", focal_length=50.0)
    pixels = np.zeros((2, 2, 3), np.uint8)
    first = Photograph(pixels, "a", Exposure(1 / 250, 8.0, 100.0), "A B", settings=settings)
    second = replace(first, exposure=Exposure(1 / 60, 8.0, 100.0))
    earlier = replace(settings, taken=datetime(2026, 3, 1, 12, 0, 4), lens="35 mm")
    third = replace(first, exposure=Exposure(2.0, 8.0, 200.0), settings=earlier)
    said = {"camera": "A B", "lens": "50 mm", "serial": "7", "focal_length": "50", "iso": "100"}
    said |= {"taken": "2026:03:01 12:00:05", "exposure_times": "0.004 0.0166667"}
    assert provenance([first, second]) == said
    assert provenance([first, third]) == {
        "camera": "A B",
        "serial": "7",
        "focal_length": "50",
        "taken": "2026:03:01 12:00:04",
        "exposure_times": "0.004 2",
    }
    assert provenance([Photograph(pixels)]) == {}


def test_a_make_that_is_known_is_separated_from_the_model() -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    place = {"latitude": 37.896408, "longitude": -122.0, "owner": "A", "copyright": "B", "comments": "C"}
    settings = Settings(make="NIKON CORPORATION", model="NIKON D700", **place)
    first = Photograph(pixels, "a", camera="NIKON CORPORATION NIKON D700", settings=settings)
    said = {"camera": "NIKON D700", "camera_make": "NIKON CORPORATION", "latitude": "37.896408", "longitude": "-122"}
    assert provenance([first, first]) == {**said, "owner": "A", "copyright": "B", "comments": "C"}
    elsewhere = replace(first, settings=replace(settings, latitude=37.896409, owner="D"))
    assert provenance([first, elsewhere]).keys() == {"camera", "camera_make", "longitude", "copyright", "comments"}
    stripped = replace(first, settings=Settings())
    assert provenance([first, stripped]) == {"camera": "NIKON CORPORATION NIKON D700"}
    assert provenance([first, replace(stripped, camera="another")]) == {}


def test_a_merged_map_names_its_camera_as_a_file_of_radiance_does(tmp_path) -> None:
    settings = Settings(make="Google", model="Pixel 6 Pro")
    write(tmp_path / "a.jpg", Photograph(np.zeros((8, 8, 3), np.uint8), camera="Google Pixel 6 Pro", settings=settings))
    merged = provenance([read_photograph(tmp_path / "a.jpg")])
    assert (
        merged == attributes_of(tags(tmp_path / "a.jpg", "JPEG")) == {"camera": "Pixel 6 Pro", "camera_make": "Google"}
    )


def test_estimated_exposures_are_reported_as_ratios() -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    guessed = [Photograph(pixels, exposure=Exposure(seconds, source="estimated")) for seconds in (0.002, 0.04)]
    assert provenance(guessed) == {"exposure_ratios": "1 20"}

"""A radiance map remembers which photographs it was measured from."""

from dataclasses import replace
from datetime import datetime

import numpy as np

from relume.capture.brackets.lens_steps import provenance
from relume.image.files import read_photograph, write
from relume.image.files.metadata.exif import tags
from relume.image.files.metadata.exif_attributes import attributes_of
from relume.image.photograph import Exposure, Photograph, Settings


def test_what_all_photographs_share_is_kept_and_what_differs_is_not() -> None:
    settings = Settings(taken=datetime(2026, 3, 1, 12, 0, 5), lens="50 mm", serial="7", focal_length=50.0)
    pixels = np.zeros((2, 2, 3), np.uint8)
    first = Photograph(pixels, "a", Exposure(1 / 250, 8.0, 100.0), "A B", settings=settings)
    second = replace(first, exposure=Exposure(1 / 60, 8.0, 100.0))
    earlier = replace(settings, taken=datetime(2026, 3, 1, 12, 0, 4), lens="35 mm")
    third = replace(first, exposure=Exposure(2.0, 8.0, 200.0), settings=earlier)
    told = {"camera": "A B", "lens": "50 mm", "serial": "7", "focal_length": "50", "iso": "100"}
    told |= {"taken": "2026:03:01 12:00:05", "exposure_times": "0.004 0.0166667"}
    assert provenance([first, second]) == told
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
    told = {"camera": "NIKON D700", "camera_make": "NIKON CORPORATION", "latitude": "37.896408", "longitude": "-122"}
    assert provenance([first, first]) == {**told, "owner": "A", "copyright": "B", "comments": "C"}
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

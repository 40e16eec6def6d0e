"""Positions: the GPS folder of EXIF as programs write it, and degrees."""

from __future__ import annotations

import pytest
from PIL.TiffImagePlugin import IFDRational

from relume.image.files.metadata.gps import of_texts, position_of, tags_of, text_of
from relume.image.photograph import Settings


def test_a_position_is_written_in_whole_degrees_and_minutes_of_a_hemisphere():
    assert tags_of(37.896408, -122.259972) == {
        0: (1, [2, 3, 0, 0]),
        1: (2, b"N\0"),
        2: (5, [37, 1, 53, 1, 47_068_800, 1_000_000]),
        3: (2, b"W\0"),
        4: (5, [122, 1, 15, 1, 35_899_200, 1_000_000]),
    }
    # No second is 60, however near.
    assert tags_of(latitude=-1 + 1e-13)[2] == (5, [1, 1, 0, 1, 0, 1_000_000])
    assert tags_of() == {}


@pytest.mark.parametrize(
    ("latitude", "parts", "degrees"),
    [
        ("N", (IFDRational(48, 1), IFDRational(51, 1), IFDRational(30, 1)), 48.858333333),
        ("S", (IFDRational(48, 1), IFDRational(5150, 100), IFDRational(0, 1)), -48.858333333),
        ("s\0", (48.5,), -48.5),
        (b"N\0", (90.0, 0.0, 0.0), 90.0),
        ("", (48.0, 0.0, 0.0), None),
        ("X", (48.0, 0.0, 0.0), None),
        ("N", (90.0, 0.0, 1.0), None),
        ("N", (IFDRational(0, 0), IFDRational(0, 0), IFDRational(0, 0)), None),
        ("N", ("48", "x"), None),
        ("N", 48.0, None),
        ("N", (), None),
    ],
)
def test_a_folder_tells_degrees_or_nothing(latitude, parts, degrees):
    found = position_of({1: latitude, 2: parts, 3: "E", 4: (1.0, 30.0, 0.0)})
    assert found == {"longitude": 1.5} | ({} if degrees is None else {"latitude": pytest.approx(degrees, abs=1e-9)})


def test_degrees_are_texts_without_needless_zeros():
    assert [text_of(value) for value in (-122.259972, 10.0, 0.0, 1e-9)] == ["-122.259972", "10", "0", "0.000000001"]
    assert of_texts({"latitude": "47.5", "longitude": "-180"}) == {"latitude": 47.5, "longitude": -180.0}
    assert of_texts({"latitude": "90.1", "longitude": "nan"}) == {}


@pytest.mark.parametrize("place", [{"latitude": 90.5}, {"longitude": -181.0}, {"latitude": float("nan")}])
def test_a_place_that_is_none_on_earth_is_refused(place):
    with pytest.raises(ValueError, match=r"expected degrees from −(90 to 90|180 to 180)"):
        Settings(**place)

"""Attributes as EXIF values and back: what a tag can hold, and what it means; positions as programs write them."""

from __future__ import annotations

import pytest
from PIL.TiffImagePlugin import IFDRational

from relume.image.files.metadata import gps
from relume.image.files.metadata.exif_attributes import attributes_of, text_of, value_of
from relume.image.photograph import Settings


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("exposure_time", "0.004", (5, [1, 250])),
        ("f_number", "5.6", (5, [28, 5])),
        ("iso", "100", (3, [100])),
        ("iso", "100.5", None),
        ("iso", "65536", None),
        ("iso", "0", None),
        ("exposure_time", "1/60", None),
        ("exposure_time", "-1", None),
        ("focal_length", "inf", None),
        ("focal_length", "nan", None),
        ("owner", "Ü", (2, b"\xc3\x9c\0")),
        ("owner", "", None),
    ],
)
def test_a_tag_holds_what_it_can(name, text, value):
    assert value_of(name, text) == value


@pytest.mark.parametrize(
    ("name", "values", "text"),
    [
        ("exposure_time", (1 / 60,), "0.016666668"),
        ("exposure_time", [1, 60], "0.016666668"),
        ("focal_length", (50.0,), "50"),
        ("iso", (1e39,), ""),
        ("iso", (0,), ""),
        ("iso", b"100", ""),
        ("lens", b" EF 50mm \0rest", "EF 50mm"),
        ("lens", (1.0,), ""),
        ("lens", b"J\xfcrgen", "Jürgen"),
        ("copyright", b"\xc2\xa9 A \0B\0", "© A; B"),
        ("copyright", b" \0B\0", "B"),
        ("lens", (), ""),
    ],
)
def test_values_mean_a_text_or_nothing(name, values, text):
    assert text_of(name, values) == text


def test_senseless_values_of_others_are_left_out():
    tags = {0x829A: IFDRational(1, 0), 0x829D: "wide", 0x8827: (200, 1), 0x0110: b"M", 0x010E: "words\0 ", 0xA434: " "}
    assert attributes_of(tags) == {"iso": "200", "comments": "words"}


def test_a_position_is_written_in_whole_degrees_and_minutes_of_a_hemisphere():
    assert gps.tags_of(37.896408, -122.259972) == {
        0: (1, [2, 3, 0, 0]),
        1: (2, b"N\0"),
        2: (5, [37, 1, 53, 1, 47_068_800, 1_000_000]),
        3: (2, b"W\0"),
        4: (5, [122, 1, 15, 1, 35_899_200, 1_000_000]),
    }
    # No second is 60, however near.
    assert gps.tags_of(latitude=-1 + 1e-13)[2] == (5, [1, 1, 0, 1, 0, 1_000_000])
    assert gps.tags_of() == {}


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
def test_a_folder_says_degrees_or_nothing(latitude, parts, degrees):
    found = gps.position_of({1: latitude, 2: parts, 3: "E", 4: (1.0, 30.0, 0.0)})
    assert found == {"longitude": 1.5} | ({} if degrees is None else {"latitude": pytest.approx(degrees, abs=1e-9)})


def test_degrees_are_texts_without_needless_zeros():
    assert [gps.text_of(value) for value in (-122.259972, 10.0, 0.0, 1e-9)] == ["-122.259972", "10", "0", "0.000000001"]
    assert gps.of_texts({"latitude": "47.5", "longitude": "-180"}) == {"latitude": 47.5, "longitude": -180.0}
    assert gps.of_texts({"latitude": "90.1", "longitude": "nan"}) == {}


@pytest.mark.parametrize("place", [{"latitude": 90.5}, {"longitude": -181.0}, {"latitude": float("nan")}])
def test_a_place_that_is_none_on_earth_is_refused(place):
    with pytest.raises(ValueError, match=r"expected degrees from −(90 to 90|180 to 180)"):
        Settings(**place)

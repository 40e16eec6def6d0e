"""Attributes as EXIF values and back: what a tag can hold, and what it means."""

from __future__ import annotations

import pytest
from PIL.TiffImagePlugin import IFDRational

from relume.image.files.metadata.exif_attributes import attributes_of, text_of, value_of


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

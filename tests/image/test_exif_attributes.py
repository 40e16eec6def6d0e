"""Attributes as EXIF values and back: what a tag can hold, and what it means."""

from __future__ import annotations

import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from relume.image.files.metadata.exif import tags
from relume.image.files.metadata.exif_attributes import attributes_of, encoded, told, typed


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
    assert typed(name, text) == value


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
    assert told(name, values) == text


def test_exif_of_a_jpeg_comes_back_and_leaves_out_what_it_cannot_hold(tmp_path):
    attributes = {"exposure_time": "0.25", "iso": "100", "camera": "M", "lens": "L", "view": "x", "owner": "Ü"}
    attributes |= {"copyright": "© B", "latitude": "47.5", "longitude": "-0.000000001"}
    left_out = {"comments": "a\0b", "software": "x" * 5000, "f_number": "many"}
    exif = Image.Exif()
    exif.load(encoded({**attributes, **left_out}))
    folder = exif.get_ifd(0x8769)
    assert (dict(exif)[0x0110], sorted(folder), folder[0x829A]) == ("M", [0x829A, 0x8827, 0xA434], 0.25)
    assert exif[0x013B].encode("latin-1") == b"\xc3\x9c"  # UTF-8, which Pillow takes for Latin-1
    Image.new("RGB", (8, 8)).save(tmp_path / "a.jpg", exif=encoded({**attributes, **left_out}))
    told = attributes_of(tags(tmp_path / "a.jpg", "JPEG"))
    assert told == {name: attributes[name] for name in attributes if name != "view"}
    assert encoded({**left_out, "latitude": "91", "longitude": "east"}) == b""


def test_senseless_values_of_others_are_left_out():
    tags = {0x829A: IFDRational(1, 0), 0x829D: "wide", 0x8827: (200, 1), 0x0110: b"M", 0x010E: "words\0 ", 0xA434: " "}
    assert attributes_of(tags) == {"iso": "200", "comments": "words"}

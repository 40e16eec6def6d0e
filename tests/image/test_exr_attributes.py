"""What an EXR says beside its pixels, typed where other programs look for it."""

import struct

import numpy as np
import OpenEXR
import pytest

from exr_files import attribute, scan_lines
from other_programs import attributes_by_openimageio
from relume.image.files import read_radiance, write
from relume.image.files.exr.attributes import attributes_of, header_of
from relume.image.radiance import RadianceMap

# Our name → that of OpenEXR, and a value.
STANDARD = {
    "exposure_time": ("expTime", 0.008),
    "f_number": ("aperture", 5.6),
    "iso": ("isoSpeed", 100.0),
    "focal_length": ("nominalFocalLength", 50.0),
    "pixel_aspect": ("pixelAspectRatio", 1.5),
    "latitude": ("latitude", 48.85),
    "longitude": ("longitude", -122.4),
    "camera": ("cameraModel", "Canon EOS-1D"),
    "camera_make": ("cameraMake", "Canon"),
    "serial": ("cameraSerialNumber", "0042"),
    "lens": ("lensModel", "EF 50mm"),
    "taken": ("capDate", "1997:06:23 12:00:00"),
    "owner": ("owner", "somebody ©"),
    "comments": ("comments", "Grace Cathedral"),
}
SHOT = {name: value if isinstance(value, str) else f"{value:g}" for name, (_, value) in STANDARD.items()}


def header(path):
    return OpenEXR.File(str(path), header_only=True).header()


def by_hand(path, *attributes):
    path.write_bytes(scan_lines(2, 2, [("Y", np.ones((2, 2), np.float32), 1)], *attributes))
    return path


def test_standard_attributes_are_written_typed_and_come_back_as_texts(tmp_path, numbered):
    write(tmp_path / "a.exr", RadianceMap(numbered, attributes={**SHOT, "mapping": "latlong"}))
    stored = header(tmp_path / "a.exr")
    for name, value in STANDARD.values():
        assert stored[name] == (pytest.approx(value, rel=1e-7) if isinstance(value, float) else value), name
    assert [name for name in stored if name.startswith("relume:")] == ["relume:mapping"]
    assert read_radiance(tmp_path / "a.exr").attributes == {**SHOT, "mapping": "latlong"}


def test_another_program_finds_them(tmp_path, numbered):
    write(tmp_path / "a.exr", RadianceMap(numbered, attributes=SHOT))
    names = "ExposureTime", "FNumber", "Copyright", "DateTime", "PixelAspectRatio"
    said = attributes_by_openimageio(tmp_path / "a.exr", *names)
    assert said == [pytest.approx(0.008), pytest.approx(5.6), "somebody ©", "1997:06:23 12:00:00", 1.5]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("exposure_time", "1/125 s"),
        ("exposure_time", "nan"),
        ("exposure_time", "1e39"),
        ("latitude", "48.858370123456"),
        ("iso", "0100"),
    ],
)
def test_what_a_type_cannot_hold_to_the_last_digit_comes_back_as_it_was(tmp_path, numbered, name, text):
    write(tmp_path / "a.exr", RadianceMap(numbered, attributes={name: text}))
    assert read_radiance(tmp_path / "a.exr").attributes == {name: text}
    stored = header(tmp_path / "a.exr")
    assert stored[f"relume:{name}"] == text


@pytest.mark.parametrize(("kind", "typed"), [("latlong", OpenEXR.ENVMAP_LATLONG), ("cube", OpenEXR.ENVMAP_CUBE)])
def test_a_map_of_surroundings_is_handed_to_other_programs(tmp_path, numbered, kind, typed):
    foreign = {"type": OpenEXR.scanlineimage, "envmap": typed}
    OpenEXR.File([OpenEXR.Part(foreign, {"RGB": numbered}, "")]).write(str(tmp_path / "a.exr"))
    image = read_radiance(tmp_path / "a.exr")
    assert image.attributes == {"envmap": kind}
    write(tmp_path / "b.exr", image)
    stored = header(tmp_path / "b.exr")
    assert stored["envmap"] == typed and "relume:envmap" not in stored
    assert read_radiance(tmp_path / "b.exr").attributes == {"envmap": kind}
    write(tmp_path / "c.exr", RadianceMap(numbered, attributes={"envmap": "sphere"}))
    assert read_radiance(tmp_path / "c.exr").attributes == {"envmap": "sphere"}


@pytest.mark.parametrize("text", ["0", "-1", "1e-7", "1e30"])
def test_an_aspect_that_no_pixel_has_is_kept_as_a_text(tmp_path, numbered, text):
    write(tmp_path / "a.exr", RadianceMap(numbered, attributes={"pixel_aspect": text}))
    stored = header(tmp_path / "a.exr")
    assert (stored["pixelAspectRatio"], stored["relume:pixel_aspect"]) == (1, text)
    assert read_radiance(tmp_path / "a.exr").attributes == {"pixel_aspect": text}


def test_a_text_that_utf_8_does_not_hold_gets_question_marks_and_a_warning(tmp_path, numbered):
    attributes = {"owner": "B\udce4r", "\udc80": "x", "a\0b": "y", "name": "Bär"}
    with pytest.warns(UserWarning, match=r"attributes a\\x00b, owner, \\udc80 hold characters .*; each becomes \?"):
        write(tmp_path / "a.exr", RadianceMap(numbered, attributes=attributes))
    expected = {"owner": "B?r", "?": "x", "a?b": "y", "name": "Bär"}
    assert read_radiance(tmp_path / "a.exr").attributes == expected


def test_numbers_are_reported_with_the_digits_that_they_have():
    assert header_of({"exposure_time": "0.008"}) == {"expTime": 0.008}
    assert attributes_of({"expTime": 0.00800000037997961, "isoSpeed": 200, "aperture": np.array([2.8])}) == {
        "exposure_time": "0.008",
        "iso": "200",
        "f_number": "2.8",
    }


def test_square_pixels_are_not_reported_and_views_and_matrices_not_kept():
    header = {"pixelAspectRatio": 1.0, "view": "left", "type": "scanlineimage", "a": np.eye(3), "b": (1, 2), "c": "d"}
    assert attributes_of(header) == {"c": "d"}


def test_a_text_that_is_not_utf_8_is_read_as_latin_1(tmp_path):
    path = by_hand(tmp_path / "a.exr", attribute("owner", "string", "© me".encode("latin-1")))
    image = read_radiance(path)
    assert image.attributes == {"owner": "© me"}
    assert image.radiance.tolist() == [[[1, 1, 1]] * 2] * 2


def test_strings_of_others_come_by_their_own_names_and_stay(tmp_path):
    path = by_hand(tmp_path / "a.exr", attribute("FILE_NAME", "string", b"a.hdr"), attribute("owner", "string", b"me"))
    image = read_radiance(path)
    assert image.attributes == {"FILE_NAME": "a.hdr", "owner": "me"}
    write(tmp_path / "b.exr", image)
    stored = header(tmp_path / "b.exr")
    assert (stored["owner"], stored["relume:FILE_NAME"]) == ("me", "a.hdr")
    assert read_radiance(tmp_path / "b.exr").attributes == image.attributes


def test_latitude_and_comments_of_a_real_file_are_kept(shared):
    with pytest.warns(UserWarning, match="holds the views left, right; left is read"):
        image = read_radiance(shared / "data/formats/openexr/multiview/Fog.exr")
    assert image.attributes["comments"] == "Fog in the Presidio of San Francisco"
    assert float(image.attributes["latitude"]) == pytest.approx(37.797344, abs=1e-6)


def test_numbers_that_are_none_are_left_out(tmp_path):
    path = by_hand(tmp_path / "a.exr", attribute("expTime", "float", struct.pack("<f", np.nan)))
    assert read_radiance(path).attributes == {}

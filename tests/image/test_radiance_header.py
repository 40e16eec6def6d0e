"""What a Radiance header keeps of a picture, and how."""

import io

import numpy as np
import pytest

from other_programs import by_opencv
from relume.image.files import read_radiance, write
from relume.image.files.encodings import RadianceHDR
from relume.image.files.hdr.header import read_header
from relume.image.files.hdr.radiance_hdr import subtype
from relume.image.radiance import RadianceMap

PIXEL = bytes([128, 128, 128, 129])


def attributes_of(*lines: str) -> dict[str, str]:
    header = "\n".join(["#?RADIANCE", *lines, "FORMAT=32-bit_rle_rgbe", "", "-Y 1 +X 1", ""])
    return read_header("a.hdr", io.BytesIO(header.encode() + PIXEL)).attributes


def test_a_map_comes_back_with_unit_attributes_and_place(tmp_path, numbered):
    write(tmp_path / "a.hdr", RadianceMap(numbered, unit="cd/m²", attributes={"mapping": "latlong"}))
    again = read_radiance(tmp_path / "a.hdr")
    assert (again.unit, again.attributes) == ("cd/m²", {"mapping": "latlong"})
    assert again.radiance == pytest.approx(numbered, rel=1 / 256, abs=1)
    assert (
        (tmp_path / "a.hdr")
        .read_bytes()
        .startswith(
            b"#?RADIANCE\nrelume:mapping=latlong\nrelume:unit=cd/m2\n"
            b"PRIMARIES= 0.6400 0.3300 0.3000 0.6000 0.1500 0.0600 0.3127 0.3290\n"
            b"FORMAT=32-bit_rle_rgbe\n\n-Y 5 +X 7\n"
        )
    )


def test_what_radiance_has_names_for_is_kept_under_them(tmp_path):
    attributes = {
        "camera": "Nikon D700",
        "taken": "2018:11:06 17:03:12",
        "software": "hdrgen 2",
        "owner": "G. Ward",
        "view": "-vta -vh 180 -vv 180",
        "pixel_aspect": "2",
        "exposure_time": "0.01",
        "latitude": "37.896408",
        "longitude": "-122.259972",
    }
    write(tmp_path / "a.hdr", RadianceMap(np.ones((1, 1, 3), np.float32), attributes=attributes))
    assert read_radiance(tmp_path / "a.hdr").attributes == attributes
    lines = (tmp_path / "a.hdr").read_text("latin-1").split("\n")
    assert lines[1:9] == [
        "CAMERA= Nikon D700",
        "CAPDATE= 2018:11:06 17:03:12",
        "SOFTWARE= hdrgen 2",
        "OWNER= G. Ward",
        "VIEW= -vta -vh 180 -vv 180",
        "PIXASPECT= 0.5",
        "relume:exposure_time=0.01",
        "LATLONG= 37.896408 -122.259972",
    ]


def test_an_attribute_never_passes_for_what_a_header_says_of_the_pixels(tmp_path):
    attributes = {"EXPOSURE": "2", "FORMAT": "x", "PRIMARIES": "1 2", "CAMERA": "a", "primaries": "b", "relume:c": "d"}
    attributes |= {"pixel_aspect": "wide", "COLORCORR": "2 2 2", "PIXASPECT": "3"}
    write(tmp_path / "a.hdr", RadianceMap(np.ones((1, 1, 3), np.float32), attributes=attributes))
    again = read_radiance(tmp_path / "a.hdr")
    assert again.attributes == attributes
    assert again.radiance.tolist() == [[[1, 1, 1]]]


def test_no_attribute_can_end_the_header_or_begin_a_line(tmp_path):
    attributes = {"comments": "two\n\n-Y 9 +X 9\n\x85\u2028EXPOSURE=2", "odd": "a\rb\0c", "half": "\ud800"}
    write(tmp_path / "a.hdr", RadianceMap(np.ones((1, 1, 3), np.float32), attributes=attributes))
    again = read_radiance(tmp_path / "a.hdr")
    assert again.attributes == {"comments": "two -Y 9 +X 9 EXPOSURE=2", "odd": "a b c", "half": "?"}
    assert again.radiance.tolist() == [[[1, 1, 1]]]


def test_names_that_no_line_can_begin_with_are_reported(tmp_path):
    attributes = {"a=b": "1", "c\nd": "2", "unit": "3", "kept": "4"}
    image = RadianceMap(np.ones((1, 1, 3), np.float32), attributes=attributes)
    with pytest.warns(UserWarning, match=r"a\.hdr: does not keep the attributes a=b, c d, unit") as raised:
        write(tmp_path / "a.hdr", image)
    assert raised[0].filename == __file__
    assert read_radiance(tmp_path / "a.hdr").attributes == {"kept": "4"}


def test_aspects_multiply_views_add_up_and_other_lines_are_listed():
    assert attributes_of("PIXASPECT=0.5", "PIXASPECT= 0.5") == {"pixel_aspect": "4"}
    assert attributes_of("VIEW= -vtv -vh 90", "VIEW= -vh 60") == {"view": "-vtv -vh 90 -vh 60"}
    assert attributes_of("SOFTWARE= a", "SOFTWARE= b", "SOFTWARE= a") == {"software": "a; b"}


def test_commands_comments_and_the_headers_of_parts_are_no_variables():
    # pcomb and pcompos keep the headers of the pictures they joined, after a tab.
    assert attributes_of("pcomb -e lo=(6*x/yres)+.1", "# EXPOSURE=2", "\tEXPOSURE=3", "\tVIEW= -vth") == {}


def test_a_gamma_other_than_one_is_reported(tmp_path):
    def with_gamma(value):
        header = f"#?RGBE\nGAMMA={value}\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n"
        (tmp_path / "a.hdr").write_bytes(header.encode() + PIXEL)
        return tmp_path / "a.hdr"

    assert read_radiance(with_gamma("1.0")).attributes == {"GAMMA": "1.0"}
    with pytest.warns(UserWarning, match=r"a GAMMA of 2\.2; its pixels are taken to be linear all the same"):
        read_radiance(with_gamma("2.2"))


@pytest.mark.parametrize("length", [126, 127, 128, 254, 255, 1023, 3000])
def test_long_lines_do_not_end_the_header_for_opencv(tmp_path, length):
    text = "x" * (length - len("relume:comments="))
    write(tmp_path / "a.hdr", RadianceMap(np.ones((1, 1, 3), np.float32), attributes={"comments": text}))
    assert read_radiance(tmp_path / "a.hdr").attributes == {"comments": text}
    assert by_opencv(tmp_path / "a.hdr").tolist() == [[[1, 1, 1]]]


def test_a_subtype_names_xyze(tmp_path):
    write(tmp_path / "a.hdr", RadianceMap(np.ones((2, 9, 3), np.float32)), RadianceHDR(xyz=True))
    assert subtype(tmp_path / "a.hdr") == "XYZE, new runs"

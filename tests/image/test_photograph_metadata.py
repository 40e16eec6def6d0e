"""What a photograph's file says beside its pixels, written and looked at by other programs: camera, owner, place,
profile, and what is outside."""

from __future__ import annotations

import io
import warnings
from dataclasses import replace
from functools import cache

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image, ImageCms

from other_programs import attributes_by_openimageio
from relume.errors import UnreadableFile
from relume.image.files import ReadOptions, read_facts, read_photograph, read_radiance, write
from relume.image.photograph import Exposure, Photograph, Settings
from relume.image.radiance import RadianceMap

SUFFIXES = pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
GREY = np.full((16, 24, 3), 90, np.uint8)
SETTINGS = Settings(
    make="NIKON CORPORATION",
    model="NIKON D700",
    owner="Jörg 李",
    copyright="© 2026 Jörg; all rights",
    comments="A hall, “lit” by lamps",
    latitude=-33.856784,
    longitude=151.215297,
)


def tags_by_pillow(path):
    with Image.open(path) as image:
        exif = image.getexif()
        said = {tag: v.encode("latin-1").decode() if isinstance(v, str) else v for tag, v in exif.items()}
        return said, exif.get_ifd(0x8825), image.info.get("icc_profile")


@cache
def profile():
    """The same each time: a profile holds the second it was made in."""
    return ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


def lab_profile():
    return ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()


@SUFFIXES
def test_make_and_model_are_written_as_they_were(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write(path, Photograph(GREY, camera="NIKON CORPORATION NIKON D700", settings=SETTINGS))
    said, *_ = tags_by_pillow(path)
    assert (said[0x010F], said[0x0110]) == ("NIKON CORPORATION", "NIKON D700")
    assert attributes_by_openimageio(path, "Make", "Model") == ["NIKON CORPORATION", "NIKON D700"]
    again = read_photograph(path)
    assert (again.camera, again.settings) == ("NIKON CORPORATION NIKON D700", SETTINGS)
    assert read_facts(path).settings == SETTINGS


@pytest.mark.parametrize(
    ("camera", "make", "model", "written"),
    [
        ("Canon EOS 5D", "Canon", "Canon EOS 5D", ("Canon", "Canon EOS 5D")),  # the make once
        ("Virtual curve_a", "Virtual", None, ("Virtual", "curve_a")),
        ("Apple", "Apple", None, ("Apple", "")),
        ("Böhm X 1", None, None, ("", "Böhm X 1")),  # nobody knows where the make ends
        ("another", "Canon", "EOS", ("", "another")),
        ("", "Canon", "EOS", ("Canon", "EOS")),
        ("", None, None, ("", "")),
    ],
)
@SUFFIXES
def test_a_camera_reads_back_the_same_by_whatever_is_known_of_it(tmp_path, suffix, camera, make, model, written):
    photograph = Photograph(GREY, camera=camera, settings=Settings(make=make, model=model))
    assert photograph.make_and_model == written
    write(tmp_path / f"a{suffix}", photograph)
    said, *_ = tags_by_pillow(tmp_path / f"a{suffix}")
    assert (said.get(0x010F, ""), said.get(0x0110, "")) == written
    assert read_photograph(tmp_path / f"a{suffix}").camera == (camera or " ".join(filter(None, (make, model))))


@SUFFIXES
def test_a_camera_written_in_latin_1_is_read_as_that(tmp_path, suffix):
    exif = Image.Exif()
    exif[0x0110] = b"B\xf6hm X"  # Pillow writes bytes as they are
    Image.fromarray(GREY).save(tmp_path / f"a{suffix}", exif=exif)
    assert read_photograph(tmp_path / f"a{suffix}").camera == "Böhm X"


@SUFFIXES
def test_owner_rights_words_and_place_are_seen_by_other_programs(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write(path, Photograph(GREY, exposure=Exposure(0.5), settings=SETTINGS))
    said, place, _ = tags_by_pillow(path)
    assert (said[0x013B], said[0x8298], said[0x010E]) == (SETTINGS.owner, SETTINGS.copyright, SETTINGS.comments)
    assert (place[1], place[2], place[3]) == ("S", (33, 51, 24.4224), "E")
    assert place[4] == pytest.approx((151, 12, 55.0692), abs=1e-9)
    assert attributes_by_openimageio(path, "Artist", "Copyright", "ImageDescription", "GPS:LatitudeRef") == [
        SETTINGS.owner, SETTINGS.copyright, SETTINGS.comments, "S"
    ]  # fmt: skip
    assert read_photograph(path).settings == SETTINGS


def test_a_copyright_of_photographer_and_editor_is_one_text(tmp_path):
    exif = Image.Exif()
    exif[0x8298] = b"A. Body \0B. Else"
    Image.fromarray(GREY).save(tmp_path / "a.jpg", exif=exif)
    assert read_photograph(tmp_path / "a.jpg").settings.copyright == "A. Body; B. Else"


def test_a_damaged_position_costs_no_other_tag(tmp_path):
    write(tmp_path / "a.jpg", Photograph(GREY, exposure=Exposure(0.5), settings=SETTINGS))
    data = bytearray((tmp_path / "a.jpg").read_bytes())
    entry = data.index(b"\x25\x88\x04\x00")  # tag, type; then a count and the place
    data[entry + 8 : entry + 12] = b"\xf0\xff\xff\x0f"
    (tmp_path / "a.jpg").write_bytes(data)
    with pytest.warns(UserWarning, match=r"a\.jpg: its EXIF is damaged \(") as said:
        again = read_photograph(tmp_path / "a.jpg")
    assert len(said) == 1
    assert (again.exposure, again.settings.owner, again.settings.latitude) == (Exposure(0.5), "Jörg 李", None)


@SUFFIXES
@pytest.mark.parametrize("pieces", [1, 3])
def test_a_profile_is_written_as_it_was_embedded(tmp_path, suffix, pieces):
    embedded = profile() + bytes(65520 * (pieces - 1))  # long ones are cut into numbered pieces in a JPEG
    embedded = len(embedded).to_bytes(4) + embedded[4:]
    write(tmp_path / f"a{suffix}", Photograph(GREY, profile=embedded))
    assert tags_by_pillow(tmp_path / f"a{suffix}")[2] == embedded
    assert bytes(attributes_by_openimageio(tmp_path / f"a{suffix}", "ICCProfile")[0]) == embedded
    again = read_photograph(tmp_path / f"a{suffix}")
    assert again.profile == embedded
    write(tmp_path / f"b{suffix}", replace(again, profile=None))
    assert read_photograph(tmp_path / f"b{suffix}").profile is None


def test_a_jpeg_has_the_bytes_that_pillow_writes(tmp_path):
    pixels, embedded = np.random.default_rng(1).integers(0, 256, (37, 51, 3), np.uint8), profile() + bytes(65520)
    photograph = Photograph(pixels[:, 3:], profile=embedded, settings=SETTINGS)
    write(tmp_path / "a.jpg", photograph)
    with Image.open(tmp_path / "a.jpg") as image:
        said = image.info["exif"]
    by_pillow = io.BytesIO()
    Image.fromarray(pixels[:, 3:]).save(by_pillow, "JPEG", quality=95, subsampling=0, exif=said, icc_profile=embedded)
    assert (tmp_path / "a.jpg").read_bytes() == by_pillow.getvalue()


@SUFFIXES
def test_a_profile_that_cannot_be_of_three_channels_is_reported_and_left_out(tmp_path, suffix):
    with pytest.warns(UserWarning, match="does not keep its profile, which is not an ICC profile of RGB"):
        write(tmp_path / f"a{suffix}", Photograph(GREY, profile=lab_profile()))
    assert tags_by_pillow(tmp_path / f"a{suffix}")[2] is None
    Image.fromarray(GREY).save(tmp_path / f"b{suffix}", icc_profile=lab_profile())
    with pytest.warns(UserWarning, match="colour profile"):
        assert read_photograph(tmp_path / f"b{suffix}").profile is None


@SUFFIXES
def test_a_file_that_ends_early_keeps_its_profile(tmp_path, suffix):
    noisy = np.random.default_rng(1).integers(0, 255, (300, 200, 3), np.uint8)
    path = tmp_path / f"a{suffix}"
    # A TIFF whose tags stand ahead of its pixels.
    options = {"compression": None} if suffix == ".tif" else {}
    Image.fromarray(noisy).save(path, icc_profile=profile(), **options)
    path.write_bytes(path.read_bytes()[: int(path.stat().st_size * 0.7)])
    with pytest.warns(UserWarning, match="ends early"):
        assert read_photograph(path, ReadOptions(salvage=True)).profile == profile()


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_what_is_outside_is_an_alpha_of_0_in_other_programs(tmp_path, suffix, kind):
    rng = np.random.default_rng(3)
    pixels = rng.integers(0, np.iinfo(kind).max, (40, 30, 3), kind, endpoint=True)
    outside = rng.random((40, 30)) < 0.3
    write(tmp_path / f"a{suffix}", Photograph(pixels, outside=outside))
    wanted = oiio.ImageSpec()
    wanted.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(str(tmp_path / f"a{suffix}"), wanted)
    assert source is not None
    assert (source.spec().nchannels, source.spec().alpha_channel) == (4, 3)
    stored = source.read_image(0, 0, 0, 4, source.spec().format)
    source.close()
    assert stored is not None and stored.dtype == kind
    np.testing.assert_array_equal(stored[..., :3], pixels)
    np.testing.assert_array_equal(stored[..., 3], np.where(outside, 0, np.iinfo(kind).max))
    again = read_photograph(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(again.pixels, pixels)
    np.testing.assert_array_equal(again.outside, outside)
    write(tmp_path / f"b{suffix}", Photograph(pixels, outside=np.zeros((40, 30), bool)))
    assert attributes_by_openimageio(tmp_path / f"b{suffix}", "oiio:UnassociatedAlpha") == [None]
    assert read_photograph(tmp_path / f"b{suffix}").outside is None


def test_a_jpeg_says_how_many_pixels_it_cannot_mark_as_outside(tmp_path):
    outside = np.zeros((16, 24), bool)
    outside[2, :7] = True
    said = r"a\.jpg: does not keep which 7 of its pixels are outside the picture; \.png keeps everything"
    with pytest.warns(UserWarning, match=said) as raised:
        write(tmp_path / "a.jpg", Photograph(GREY, outside=outside))
    assert raised[0].filename == __file__
    write(tmp_path / "a.jpg", Photograph(GREY, outside=np.zeros((16, 24), bool)))


def test_words_too_many_for_the_exif_of_a_jpeg_are_reported_and_the_rest_is_kept(tmp_path):
    photograph = Photograph(GREY, settings=replace(SETTINGS, comments="ü" * 40_000))
    with pytest.warns(UserWarning, match=r"a\.jpg: does not keep its comments of 40000 letters; \.png"):
        write(tmp_path / "a.jpg", photograph)
    assert read_photograph(tmp_path / "a.jpg").settings == replace(SETTINGS, comments=None)
    write(tmp_path / "a.png", photograph)
    assert read_photograph(tmp_path / "a.png").settings == photograph.settings


@pytest.mark.parametrize(("suffix", "mode"), [(".png", "RGBA"), (".tif", "RGBA"), (".jpg", "RGB")])
def test_a_limit_of_channels_is_heeded(tmp_path, suffix, mode):
    path = tmp_path / f"a{suffix}"
    Image.new(mode, (8, 8), "white").save(path)
    with pytest.raises(UnreadableFile, match=rf"claims {len(mode)} channels; relume reads 2"):
        read_photograph(path, ReadOptions(channels=2))
    assert read_photograph(path, ReadOptions(channels=4)).size == (8, 8)


@pytest.mark.parametrize("suffix", [".exr", ".tif", ".hdr"])
def test_a_radiance_map_keeps_the_same_facts_by_the_same_names(tmp_path, suffix):
    attributes = {
        "camera": "NIKON D700",
        "camera_make": "NIKON CORPORATION",
        "owner": "Jörg",
        "copyright": "© 2026",
        "comments": "words",
        "latitude": "-33.856784",
        "longitude": "151.2153",
    }
    path = tmp_path / f"a{suffix}"
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*luminance")
        write(path, RadianceMap(np.ones((16, 16, 3), np.float32), attributes=attributes))
    assert read_radiance(path).attributes == attributes
    if suffix == ".tif":
        exif = Image.Exif()
        exif.load(path.read_bytes())
        place = exif.get_ifd(0x8825)
        assert (place[1], place[3], exif[0x8298].encode("latin-1").decode()) == ("S", "E", "© 2026")
    elif suffix == ".hdr":
        assert b"\nLATLONG= -33.856784 151.2153\n" in path.read_bytes()
    else:
        said = attributes_by_openimageio(path, "latitude", "longitude", "cameraMake", "relume:copyright")
        assert [said[0], said[1]] == pytest.approx([-33.856784, 151.2153], rel=1e-6)
        assert said[2:] == ["NIKON CORPORATION", "© 2026"]


def test_a_radiance_header_without_a_sensible_place_keeps_its_line(tmp_path):
    def attributes_of(lines):
        header = b"#?RADIANCE\n" + lines + b"FORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n"
        (tmp_path / "a.hdr").write_bytes(header + bytes([128, 128, 128, 129]))
        return read_radiance(tmp_path / "a.hdr").attributes

    assert attributes_of(b"LATLONG= 1 2\nLATLONG= 37.5 -122\n") == {"latitude": "37.5", "longitude": "-122"}
    assert attributes_of(b"LATLONG= 91 0\n") == {"LATLONG": "91 0"}
    assert attributes_of(b"LATLONG= 37.5\n") == {"LATLONG": "37.5"}
    half = RadianceMap(np.ones((1, 1, 3), np.float32), attributes={"latitude": "1", "LATLONG": "3 4"})
    write(tmp_path / "b.hdr", half)
    assert read_radiance(tmp_path / "b.hdr").attributes == half.attributes


def test_a_tiff_of_radiance_by_others_says_its_copyright(tmp_path):
    pixels = oiio.ImageBuf(np.ones((4, 4, 3), np.float32))
    pixels.specmod().attribute("Copyright", "© Ü")
    assert pixels.write(str(tmp_path / "a.tif")), pixels.geterror()
    assert read_radiance(tmp_path / "a.tif").attributes["copyright"] == "© Ü"


def test_a_base_of_a_gain_map_keeps_its_profile(shared):
    path = sorted((shared / "data/formats/gainmap_jpeg").glob("*.jp*g"))[0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = read_photograph(path).profile
    with Image.open(io.BytesIO(path.read_bytes())) as image:
        assert found == image.info.get("icc_profile")


def test_the_focal_length_of_the_lens_stays_its_own(tmp_path):
    taken = Photograph(np.zeros((30, 40, 3), np.uint8), focal_length=24 / 36 * 40, settings=Settings(focal_length=6.81))
    write(tmp_path / "a.jpg", taken)
    with Image.open(tmp_path / "a.jpg") as image:
        folder = image.getexif().get_ifd(0x8769)
        assert (float(folder[0x920A]), folder[0xA405]) == (6.81, 24)
    back = read_photograph(tmp_path / "a.jpg")
    assert (back.settings.focal_length, back.focal_length) == (6.81, taken.focal_length)

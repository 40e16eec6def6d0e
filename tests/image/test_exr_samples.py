"""EXR files of other programs, with the values that their siblings, their notes or another reader give."""

from pathlib import Path

import numpy as np
import pytest

from other_programs import by_openimageio
from relume.errors import UnreadableFile
from relume.image.files import read_layers, read_radiance
from relume.image.radiance import OUTSIDE, RadianceMap

pytestmark = pytest.mark.filterwarnings("ignore:.*alpha is left out", "ignore:.*(overscan)")
of_padding = pytest.mark.filterwarnings("ignore:.*outside its data window")

F32 = "openexr/exrs_f32"


@pytest.fixture(scope="module")
def formats(shared: Path) -> Path:
    return shared / "data/formats"


@pytest.mark.parametrize("codec", ["rle", "zips", "zip", "piz", "b44", "b44a"])
def test_codecs_without_loss_hold_the_reference(formats, codec):
    """B44 leaves floats as they are."""
    reference = read_radiance(formats / F32 / "uncompressed.exr").radiance
    np.testing.assert_array_equal(read_radiance(formats / F32 / f"{codec}.exr").radiance, reference)


@pytest.mark.parametrize(("codec", "differing", "bound"), [("pxr24", 0, 0), ("dwaa", 72, 0.003), ("dwab", 330, 0.019)])
def test_codecs_with_loss_hold_what_their_reference_says(formats, codec, differing, bound):
    """The references of DWA are of an older decoder, which rounds some of the 21,255 values to other halves."""
    reference = read_radiance(formats / F32 / f"decompressed_{codec}.exr").radiance
    found = read_radiance(formats / F32 / f"{codec}.exr").radiance
    np.testing.assert_allclose(found, reference, rtol=bound)
    assert np.count_nonzero(found != reference) <= differing


def test_the_memorial_church_is_the_one_in_radiance_rounded_to_half(formats, shared):
    """All but 275 of 1,179,648 values, which its program has up to 0.3 % off, or 4e-5 where RGBE holds 0."""
    found = read_radiance(formats / "memorial_exr/memorial.exr")
    expected = read_radiance(shared / "data/brackets/memorial/memorial.hdr").radiance
    assert found.size == (512, 768)
    # Half a step of a half, which below 2⁻¹⁴ is 2⁻²⁵.
    off = np.abs(found.radiance - expected) > np.maximum(expected * 2**-11, 2**-25)
    assert np.count_nonzero(off) <= 275
    np.testing.assert_allclose(found.radiance, expected, rtol=0.003, atol=5e-5)


def test_a_gradient_is_the_same_in_exr_and_in_radiance(formats):
    folder = formats / "exr_hdr_pair"
    found = read_radiance(folder / "overexposed gradient - data window equals display window.exr").radiance
    expected = read_radiance(next(folder.glob("overexposed gradient*.hdr"))).radiance
    step = expected.max(axis=2, keepdims=True) / 128  # of an RGBE picture written by cutting off
    assert np.all(np.abs(found - expected) <= step)


@of_padding
@pytest.mark.parametrize(
    ("name", "size", "corner"),
    [
        ("t01", (400, 300), (0, 0)),
        ("t02", (400, 300), (-1, -1)),
        ("t03", (370, 280), (-30, -20)),
        ("t04", (370, 280), (0, 0)),
        ("t05", (340, 260), (-30, -20)),
        ("t06", (402, 302), (1, 1)),
        ("t07", (481, 371), (40, 40)),
        ("t08", (501, 401), (30, 40)),
    ],
)
def test_one_picture_lies_where_its_windows_say(formats, name, size, corner):
    """`corner` is where the picture begins in the display window; what it does not cover is 0 and marked."""
    whole = read_radiance(formats / "openexr/display_window/t01.exr").radiance
    image = read_radiance(formats / f"openexr/display_window/{name}.exr")
    assert image.size == size
    canvas = np.zeros((1000, 1000, 3), np.float32)
    x, y = corner[0] + 100, corner[1] + 100
    canvas[y : y + 300, x : x + 400] = whole
    np.testing.assert_array_equal(image.radiance, canvas[100 : 100 + size[1], 100 : 100 + size[0]])
    marks = np.full((1000, 1000), OUTSIDE, np.uint8)
    marks[y : y + 300, x : x + 400] = 0
    found = np.zeros(size[::-1], np.uint8) if image.clipped is None else image.clipped
    np.testing.assert_array_equal(found, marks[100 : 100 + size[1], 100 : 100 + size[0]])
    assert (image.clipped is None) == (name in ("t01", "t03", "t04", "t05"))


def test_the_order_of_lines_does_not_matter(formats):
    folder = formats / "openexr/compression"
    up, down = (read_radiance(folder / f"lineOrder_{order}.exr").radiance for order in ("increasing", "decreasing"))
    np.testing.assert_array_equal(up, down)
    assert up.max() == 10_000


SAME = {
    "memorial_exr/memorial.exr": (512, 768),
    "openexr/compression/comp_dwaa_v2.exr": (587, 675),
    "openexr/compression/test_native1.exr": (256, 256),
    "openexr/envmaps/OrientationCube.exr": (512, 3072),
    "openexr/envmaps/OrientationLatLong.exr": (1024, 512),
    "openexr/envmaps/StageEnvCube.exr": (256, 1536),
    "openexr/envmaps/StageEnvLatLong.exr": (1000, 500),
    "openexr/envmaps/WavyLinesCube.exr": (256, 1536),
    "openexr/envmaps/WavyLinesLatLong.exr": (1024, 512),
    "openexr/envmaps/WavyLinesSphere.exr": (480, 480),
    "openexr/luminance_chroma/Garden.exr": (874, 493),
    "openexr/test_images/AllHalfValues.exr": (256, 256),
    "openexr/test_images/BrightRingsNanInf.exr": (800, 800),
    "openexr/test_images/GrayRampsHorizontal.exr": (800, 800),
    "openexr/test_images/stripes.exr": (100, 50),
    f"{F32}/uncompressed.exr": (109, 65),
    f"{F32}/dwab.exr": (109, 65),
    f"{F32}/b44a.exr": (109, 65),
}


@pytest.mark.parametrize("file", SAME)
def test_every_value_is_what_another_reader_finds(formats, file):
    """Also tiles, the largest of several levels, infinities and what is no number."""
    image = read_radiance(formats / file)
    assert isinstance(image, RadianceMap) and image.size == SAME[file]
    pixels = by_openimageio(formats / file)
    np.testing.assert_array_equal(image.radiance, pixels[..., :3] if pixels.shape[2] > 1 else pixels.repeat(3, axis=2))


def test_all_halves_there_are_come_through(formats):
    pixels = read_radiance(formats / "openexr/test_images/AllHalfValues.exr").radiance
    every = np.arange(2**16, dtype=np.uint16).view(np.float16).astype(np.float32)
    found, wanted = (np.unique(values[np.isfinite(values)]) for values in (pixels, every))
    np.testing.assert_array_equal(found, wanted)
    assert wanted.size == 63_487  # 2 × 31 × 1024, of which 0 and −0 are one
    assert np.isposinf(pixels).any() and np.isneginf(pixels).any() and np.isnan(pixels).any()


@pytest.mark.parametrize(
    ("file", "kind"), [("StageEnvCube", "cube"), ("StageEnvLatLong", "latlong"), ("WavyLinesSphere", None)]
)
def test_maps_of_surroundings_say_how_they_are_laid_out(formats, file, kind):
    image = read_radiance(formats / f"openexr/envmaps/{file}.exr")
    assert image.attributes.get("envmap") == kind
    if kind:
        assert image.radiance.max() == 4096


def test_both_eyes_of_the_fog_are_there(formats):
    path = formats / "openexr/multiview/Fog.exr"
    with pytest.warns(UserWarning, match="holds the views left, right; left is read"):
        left = read_radiance(path).radiance
    both = by_openimageio(path)
    np.testing.assert_array_equal(left[..., 1], both[..., 0])
    assert not np.array_equal(both[..., 0], both[..., 1])


@of_padding
def test_a_part_without_colours_is_named(formats):
    with pytest.raises(UnreadableFile, match=r'its part "forward_left" has no channel Y; save it as R, G, B or Y'):
        read_layers(formats / "openexr/multipart/multipart.0006.exr")

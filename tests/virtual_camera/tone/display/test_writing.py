"""Developed pictures as files: what a stranger's reader finds in them, and what is said of what they cannot hold."""

import io
import warnings

import av
import numpy as np
import pytest
from PIL import Image, ImageCms

from relume.image import files
from relume.image.colour import decode_srgb, luminance
from relume.image.colour_space import decoded, name_of
from relume.image.files.gain_map import gain_map
from relume.virtual_camera.tone.display.encoding import HLG, PQ, DisplayP3, HdrGainMap, Srgb, encoded
from relume.virtual_camera.tone.display.writing import profile_of, write_display
from screens import decode_hlg, decode_pq, hlg_displayed


def values(height: int = 96, width: int = 128, brightest: float = 1.0) -> np.ndarray:
    """A smooth coloured picture whose left is dark and whose right is `brightest`."""
    y, x = np.mgrid[:height, :width] / np.array([[[height]], [[width]]])
    light = 0.01 * (brightest / 0.01) ** (x / x.max())
    return (light[..., None] * np.stack([np.ones_like(y), 1 - 0.3 * y, 1 - 0.5 * y], -1)).astype(np.float32)


def pillow_s_srgb(path) -> np.ndarray:
    """Codes as a colour-managed program shows them on an sRGB screen."""
    with Image.open(path) as image:
        profile = ImageCms.ImageCmsProfile(io.BytesIO(image.info["icc_profile"]))
        shown = ImageCms.profileToProfile(image, profile, ImageCms.createProfile("sRGB"))
    assert shown is not None
    return np.asarray(shown).astype(int)


@pytest.mark.parametrize("suffix, error", [(".png", 0), (".tif", 0), (".jpg", 4)])
def test_an_srgb_picture_is_its_codes_with_their_profile(tmp_path, suffix, error):
    path = tmp_path / f"a{suffix}"
    clipping = write_display(path, values())
    assert clipping.above == (0, 0, 0) and clipping.below == (0, 0, 0)
    photograph = files.read_photograph(path)  # a warning of another profile would be an error here
    assert photograph.profile == profile_of(Srgb())
    assert np.abs(photograph.pixels.astype(int) - encoded(values())).max() <= error


@pytest.mark.parametrize("suffix, error", [(".png", 1), (".jpg", 5)])
def test_a_p3_picture_looks_as_the_srgb_one_to_a_program_that_heeds_profiles(tmp_path, suffix, error):
    path = tmp_path / f"a{suffix}"
    write_display(path, values(), DisplayP3())
    assert np.abs(pillow_s_srgb(path) - encoded(values())).max() <= error
    photograph = files.read_photograph(path)
    assert name_of(photograph) == "Display P3"
    assert np.abs(photograph.pixels.astype(int) - encoded(values())).max() > 5
    # Its light is the picture's own: half a code is 0.0043 at white, and the matrix adds 1.45 of it at most.
    assert np.abs(decoded(photograph) - values()).max() < 0.007 * error


def test_16_bits_are_kept(tmp_path):
    write_display(tmp_path / "a.png", values(), Srgb(16))
    assert np.array_equal(files.read_photograph(tmp_path / "a.png").pixels, encoded(values(), Srgb(16)))


@pytest.mark.parametrize("display", [PQ(), HLG()])
def test_an_avif_has_white_at_203_and_highlights_above_it(tmp_path, display):
    """Decoded by PyAV and by the standards' own formulas: what a screen of 1000 cd/m² shows."""
    picture = np.repeat(values(brightest=6.0)[..., :1], 3, axis=2)
    picture[:32] = 1.0
    clipping = write_display(tmp_path / "a.avif", picture, display)
    with av.open(str(tmp_path / "a.avif")) as container:
        frame = next(container.decode(video=0))
    assert isinstance(frame, av.VideoFrame)
    assert int(frame.color_trc) == (16 if display == PQ() else 18)
    luma = np.frombuffer(bytes(frame.planes[0]), np.uint16).reshape(96, -1)[:, :128] / 1023
    grey = np.repeat(luma[..., None], 3, axis=2)
    shown = decode_pq(grey) if display == PQ() else hlg_displayed(decode_hlg(grey))
    assert shown[:28].mean() == pytest.approx(203, rel=0.01)
    # A code is 2.3 % of the luminance of PQ's darkest here, and less above it.
    assert np.median(np.abs(shown[40:, :, 0] / np.minimum(203 * picture[40:, :, 0], 1000) - 1)) < 0.02
    beyond = (picture[..., 0] > 1000 / 203).mean()
    assert clipping.above == pytest.approx((beyond,) * 3) and 0 < beyond < 0.1


def test_a_gain_map_shows_the_plain_picture_and_restores_its_highlights(tmp_path):
    picture, path = values(brightest=12.0), tmp_path / "a.jpg"
    clipping = write_display(path, picture, HdrGainMap(headroom=3))
    beyond = (picture > 8).mean((0, 1))
    assert clipping.above == pytest.approx(tuple(beyond)) and beyond[0] > 0
    with pytest.warns(UserWarning, match="only its base picture"):
        base = files.read(path)
    assert np.abs(base.pixels.astype(int) - encoded(picture)).max() <= 6  # pyright: ignore[reportAttributeAccessIssue]
    with pytest.warns(UserWarning, match="made for displays"):
        bright = gain_map.read(path)
    assert bright.attributes["rendition"] == "display"
    wanted = luminance(np.minimum(picture, 8))
    error = np.abs(luminance(bright.radiance) / wanted - 1)
    assert np.percentile(error, 99) < 0.05 and luminance(bright.radiance).max() == pytest.approx(wanted.max(), rel=0.03)
    assert "gain map of" in gain_map.subtype(path)


def test_a_gain_map_of_a_picture_without_highlights_is_the_picture(tmp_path):
    for picture in (values(), np.zeros((64, 64, 3), np.float32)):
        write_display(tmp_path / "a.jpg", picture, HdrGainMap())
        with pytest.warns(UserWarning, match="made for displays"):
            bright = gain_map.read(tmp_path / "a.jpg").radiance
        assert np.abs(bright - picture).max() < 0.02


def test_what_a_gain_map_loses_is_said_where_it_is_much(tmp_path):
    bright = np.exp2(np.random.default_rng(1).uniform(-30, 20, (64, 64, 3))).astype(np.float32)
    base = np.zeros((64, 64, 3), np.uint8)
    with pytest.warns(UserWarning, match="a gain map keeps luminance to"):
        gain_map.write_rendition(tmp_path / "a.jpg", bright, base)


def test_negative_values_are_black_and_counted(tmp_path):
    picture = values()
    picture[:48, :, 2] = -0.1
    for display, name in ((Srgb(), "a.png"), (HdrGainMap(), "a.jpg")):
        assert write_display(tmp_path / name, picture, display).below == (0, 0, 0.5)
    linear = decode_srgb(files.read_photograph(tmp_path / "a.png").pixels / 255)
    assert linear[:48, :, 2].max() == 0 and linear[48:, :, 2].min() > 0


@pytest.mark.parametrize(
    "name, display, said",
    [
        ("a.avif", Srgb(), "a picture for Srgb is written to .png"),
        ("a.png", PQ(), "a picture for PQ is written to .avif"),
        ("a.png", HdrGainMap(), "a picture for HdrGainMap is written to .jpg"),
        ("a.jpg", DisplayP3(16), "a JPEG holds 8 bits"),
    ],
)
def test_a_file_that_cannot_hold_it_is_refused(tmp_path, name, display, said):
    with pytest.raises(ValueError, match=said):
        write_display(tmp_path / name, values(), display)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name, display", [("a.png", Srgb()), ("a.avif", PQ()), ("a.jpg", HdrGainMap())])
def test_nan_leaves_the_old_file(tmp_path, name, display):
    (tmp_path / name).write_bytes(b"old")
    picture = values()
    picture[3, 4, 0] = np.nan
    with pytest.raises(ValueError, match="NaN, the first at x 4, y 3"):
        write_display(tmp_path / name, picture, display)
    assert (tmp_path / name).read_bytes() == b"old"


def test_the_same_picture_is_the_same_file_and_says_nothing(tmp_path):
    for name, display in (("png", DisplayP3()), ("jpg", HdrGainMap()), ("avif", HLG())):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for copy in "ab":
                write_display(tmp_path / f"{copy}.{name}", values(), display)
        assert (tmp_path / f"a.{name}").read_bytes() == (tmp_path / f"b.{name}").read_bytes()


def test_a_gain_map_of_a_picture_that_is_partly_below_black_is_that_of_black(tmp_path):
    picture = values(brightest=4.0)
    picture[:, :64] = -0.0101
    clipping = write_display(tmp_path / "a.jpg", picture, HdrGainMap())
    assert clipping.below == (0.5, 0.5, 0.5)
    write_display(tmp_path / "b.jpg", np.maximum(picture, 0), HdrGainMap())
    assert (tmp_path / "a.jpg").read_bytes() == (tmp_path / "b.jpg").read_bytes()

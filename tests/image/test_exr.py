"""Radiance maps and layers as OpenEXR, against the OpenEXR library used directly and real files."""

import os
import re
import subprocess
import sys
import threading
import time
import warnings

import numpy as np
import OpenEXR
import pytest

from relume.errors import FormatError, UnreadableFile
from relume.image.files import read_layers, read_radiance, write, write_layers
from relume.image.primaries import REC709, Primaries
from relume.image.radiance import OUTSIDE, RadianceMap

BT2020 = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290)


def foreign(path, channels, name="", **header):
    """Write one part as another program would; contiguous, since the library ignores strides."""
    channels = {key: np.ascontiguousarray(plane) for key, plane in channels.items()}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **header}
    OpenEXR.File([OpenEXR.Part(header, channels, name)]).write(str(path))
    return path


def foreign_parts(path, planes, **header):
    """Write parts of R, G, B (H, W, 3) or Y (H, W), by name, as another program would."""
    header = {"type": OpenEXR.scanlineimage, **header}
    parts = [OpenEXR.Part(dict(header), {"RGB" if p.ndim == 3 else "Y": p}, name) for name, p in planes.items()]
    OpenEXR.File(parts).write(str(path))
    return path


def window(left, top, right, bottom):
    return np.array([left, top], np.int32), np.array([right, bottom], np.int32)


def test_a_radiance_map_comes_back_with_all_that_it_knows(tmp_path, numbered):
    clipped = np.zeros((5, 7), np.uint8)
    clipped[1, 2], clipped[3, 4] = 1, 2
    attributes = {"mapping": "latlong", "origin": "ball at 0°"}
    write(tmp_path / "a.exr", RadianceMap(numbered, numbered * 2, clipped, "cd/m²", attributes))
    again = read_radiance(tmp_path / "a.exr")
    assert again.variance is not None and again.clipped is not None
    np.testing.assert_array_equal(again.radiance, numbered)
    np.testing.assert_array_equal(again.variance, numbered * 2)
    np.testing.assert_array_equal(again.clipped, clipped)
    assert (again.unit, again.attributes, again.clipped.dtype) == ("cd/m²", attributes, np.uint8)


def test_a_bare_radiance_map_comes_back_bare(tmp_path, numbered):
    write(tmp_path / "a.exr", RadianceMap(numbered))
    again = read_radiance(tmp_path / "a.exr")
    assert (again.variance, again.clipped, again.unit, again.attributes) == (None, None, "relative", {})


def test_another_program_finds_float_rgb_in_the_first_part(tmp_path, numbered):
    write(tmp_path / "a.exr", RadianceMap(numbered, numbered, None, "cd/m²", {"mapping": "latlong"}))
    file = OpenEXR.File(str(tmp_path / "a.exr"))
    pixels = file.channels()["RGB"].pixels
    assert pixels.dtype == np.float32
    assert pixels[3, 2].tolist() == [3002.0, 3002.25, 3002.5]
    header = file.header()
    assert (header["name"], header["whiteLuminance"], header["relume:mapping"]) == ("radiance", 1.0, "latlong")
    assert header["compression"] == OpenEXR.ZIP_COMPRESSION
    assert header["chromaticities"] == pytest.approx((0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290))


def test_extreme_values_and_nan_are_stored_bit_for_bit(tmp_path):
    values = np.array([np.nan, np.inf, -np.inf, -0.0, 1e-45, 3.4e38, 65504.5, 1e-8, 1 / 3], np.float32).reshape(1, 3, 3)
    write(tmp_path / "a.exr", RadianceMap(values))
    assert read_radiance(tmp_path / "a.exr").radiance.tobytes() == values.tobytes()


def test_white_luminance_scales_to_candela(tmp_path, numbered):
    foreign(tmp_path / "a.exr", {"RGB": numbered}, whiteLuminance=100.0)
    image = read_radiance(tmp_path / "a.exr")
    assert image.unit == "cd/m²"
    assert image.radiance[1, 2].tolist() == [100200.0, 100225.0, 100250.0]


@pytest.mark.parametrize(("scale", "pixel", "variance"), [(2e38, 10, None), (1e20, 1, 1)])
def test_white_luminance_never_makes_infinities(tmp_path, scale, pixel, variance):
    planes = {"radiance": np.full((2, 2, 3), pixel, np.float32)}
    planes["radiance"][0, 0, 0] = np.inf
    planes |= {} if variance is None else {"variance": np.full((2, 2, 3), variance, np.float32)}
    path = foreign_parts(tmp_path / "a.exr", planes, whiteLuminance=scale)
    beyond = 11 if variance is None else 12
    with pytest.raises(
        UnreadableFile, match=rf"times its whiteLuminance of {re.escape(f'{scale:g}')}, {beyond} values .*; correct it"
    ):
        read_radiance(path)


def test_a_variance_within_float32_is_scaled_though_the_square_of_the_scale_is_not(tmp_path):
    planes = {"radiance": np.ones((1, 1, 3), np.float32), "variance": np.full((1, 1, 3), 2.0**-100, np.float32)}
    image = read_radiance(foreign_parts(tmp_path / "a.exr", planes, whiteLuminance=2.0**70))
    assert image.variance is not None
    assert (image.radiance[0, 0, 0], image.variance[0, 0, 0]) == (2.0**70, 2.0**40)


def test_half_rgba_is_read_as_float_rgb(tmp_path, numbered):
    rgba = np.concatenate([numbered[:2], np.ones((2, 7, 1))], axis=2).astype(np.float16)
    image = read_radiance(foreign(tmp_path / "a.exr", {"RGBA": rgba}))
    assert image.radiance.dtype == np.float32
    assert image.radiance[1, 6].tolist() == [1006.0, 1006.0, 1006.5]  # half has steps of ½ there


def test_alpha_that_is_left_out_is_reported_unless_opaque(tmp_path, numbered):
    alpha = np.ones((5, 7, 1), np.float32)
    alpha[0, :2] = 0.5
    path = foreign(tmp_path / "a.exr", {"RGBA": np.concatenate([numbered, alpha], axis=2)})
    with pytest.warns(UserWarning, match="alpha is left out, though 2 pixels"):
        np.testing.assert_array_equal(read_radiance(path).radiance, numbered)


def test_separate_channels_of_different_depth_are_read_in_the_order_red_green_blue(tmp_path):
    planes = {
        "B": np.full((2, 2), 3, np.float32),
        "G": np.full((2, 2), 2, np.float16),
        "R": np.ones((2, 2), np.float16),
    }
    assert read_radiance(foreign(tmp_path / "a.exr", planes)).radiance[0, 0].tolist() == [1, 2, 3]


def test_a_lone_y_becomes_grey(tmp_path, numbered):
    image = read_radiance(foreign(tmp_path / "a.exr", {"Y": numbered[..., 0]}))
    assert image.radiance[4, 6].tolist() == [4006, 4006, 4006]


def test_a_data_window_inside_the_display_window_is_placed_there(tmp_path, numbered):
    small = numbered[1:3, 2:5]
    path = foreign(
        tmp_path / "a.exr", {"RGB": small}, dataWindow=window(12, 21, 14, 22), displayWindow=window(10, 20, 16, 24)
    )
    expected = np.zeros_like(numbered)
    expected[1:3, 2:5] = small
    with pytest.warns(UserWarning, match="29 of its 35 pixels lie outside its data window; they are 0 and marked"):
        image = read_radiance(path)
    np.testing.assert_array_equal(image.radiance, expected)
    assert image.clipped is not None
    np.testing.assert_array_equal(image.clipped, np.where(expected.any(2), 0, OUTSIDE))
    with pytest.warns(UserWarning, match="29 of its 35 pixels lie outside its data window; they are 0$"):
        np.testing.assert_array_equal(read_layers(path)["part 0"], expected)


def test_marks_of_a_file_stay_beside_those_of_its_padding(tmp_path):
    windows = {"dataWindow": window(1, 0, 2, 0), "displayWindow": window(0, 0, 3, 0)}
    planes = {"radiance": np.ones((1, 2, 3), np.float32), "clipped": np.array([[0, 1]], np.float32)}
    path = foreign_parts(tmp_path / "a.exr", planes, **windows)
    with pytest.warns(UserWarning, match="2 of its 4 pixels lie outside"):
        image = read_radiance(path)
    assert image.clipped is not None
    assert image.clipped.tolist() == [[OUTSIDE, 0, 1, OUTSIDE]]


def test_windows_that_do_not_meet_are_no_picture(tmp_path, numbered):
    path = foreign(
        tmp_path / "a.exr", {"RGB": numbered}, dataWindow=window(7, 0, 13, 4), displayWindow=window(0, 0, 6, 4)
    )
    with pytest.warns(UserWarning, match="35 of its 35 pixels"):
        with pytest.raises(UnreadableFile, match="no pixel of its data window lies in its display window; correct"):
            read_radiance(path)


def windowed(name, data, value):
    """A part of that data window in the display window (0, 0) to (7, 3)."""
    left, top, right, bottom = data
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    header |= {"dataWindow": window(*data), "displayWindow": window(0, 0, 7, 3)}
    plane = np.full((bottom - top + 1, right - left + 1), value, np.float32)
    return OpenEXR.Part(header, dict.fromkeys("RGB", plane), name)


@pytest.mark.filterwarnings("ignore:.*(outside its data window|left out)")
def test_parts_whose_windows_do_not_meet_are_each_placed(tmp_path):
    OpenEXR.File([windowed("away", (90, 90, 93, 91), 9), windowed("seen", (2, 1, 3, 2), 5)]).write(
        str(tmp_path / "a.exr")
    )
    image = read_radiance(tmp_path / "a.exr")
    assert image.radiance.sum() == 3 * 4 * 5 and image.radiance[1, 2, 0] == 5
    parts = [windowed("radiance", (0, 0, 3, 3), 1), windowed("variance", (6, 0, 7, 3), 2)]
    OpenEXR.File(parts).write(str(tmp_path / "b.exr"))
    image = read_radiance(tmp_path / "b.exr")
    # Of the light's own pixels no variance is known: 0 would say that they are certain.
    assert image.variance is not None and np.all(np.isinf(image.variance[:, :6])) and np.all(image.variance[:, 6:] == 2)
    layers = read_layers(tmp_path / "b.exr")
    assert [float(layers[name].sum()) for name in ("radiance", "variance")] == [48, 48]


def test_a_data_window_as_large_as_the_display_window_but_beside_it_is_moved(tmp_path, numbered):
    path = foreign(
        tmp_path / "a.exr", {"RGB": numbered}, dataWindow=window(2, 1, 8, 5), displayWindow=window(0, 0, 6, 4)
    )
    with pytest.warns(UserWarning, match="15 pixels around the display window"):
        with pytest.warns(UserWarning, match="15 of its 35 pixels lie outside"):
            image = read_radiance(path)
    expected = np.zeros_like(numbered)
    expected[1:, 2:] = numbered[:-1, :-2]
    np.testing.assert_array_equal(image.radiance, expected)


def test_overscan_is_left_out_and_reported(tmp_path, numbered):
    path = foreign(
        tmp_path / "a.exr", {"RGB": numbered}, dataWindow=window(-1, -2, 5, 2), displayWindow=window(0, 0, 3, 1)
    )
    with pytest.warns(UserWarning, match="27 pixels around the display window"):
        image = read_radiance(path)
    np.testing.assert_array_equal(image.radiance, numbered[2:4, 1:5])


def test_primaries_other_than_rec_709_are_named_and_converted(tmp_path):
    """The colours of Rec. 2020 in Rec. 709, from ITU-R BT.2087: their channels are negative, and are not clipped."""
    colours = np.eye(4, 3, dtype=np.float32).reshape(1, 4, 3)
    colours[0, 3] = 2
    path = foreign(tmp_path / "a.exr", {"RGB": colours}, chromaticities=BT2020)
    with pytest.warns(UserWarning, match=r"its primaries are 0\.708, 0\.292.* \(x, y of R, G, B, white\); converted"):
        image = read_radiance(path)
    expected = [[1.6605, -0.1246, -0.0182], [-0.5876, 1.1329, -0.1006], [-0.0728, -0.0083, 1.1187], [2, 2, 2]]
    np.testing.assert_allclose(image.radiance[0], expected, atol=1e-4)
    assert image.attributes["primaries"] == "0.708 0.292 0.17 0.797 0.131 0.046 0.3127 0.329"
    # Written again they are Rec. 709, and where they came from is kept as a text.
    write(tmp_path / "b.exr", image)
    again = read_radiance(tmp_path / "b.exr")
    np.testing.assert_array_equal(again.radiance, image.radiance)
    assert again.attributes == image.attributes


def test_the_variance_is_converted_as_of_independent_channels(tmp_path):
    pixels = {"radiance": (1, 2, 3), "variance": (0.1, 0.2, 0.4)}
    planes = {name: np.array([[pixel]], np.float32) for name, pixel in pixels.items()}
    path = foreign_parts(tmp_path / "a.exr", planes, chromaticities=BT2020)
    with pytest.warns(UserWarning, match="converted to Rec. 709"):
        image = read_radiance(path)
    assert image.variance is not None
    expected = [
        1.6605**2 * 0.1 + 0.5876**2 * 0.2 + 0.0728**2 * 0.4,
        0.1246**2 * 0.1 + 1.1329**2 * 0.2 + 0.0083**2 * 0.4,
    ]
    np.testing.assert_allclose(image.variance[0, 0, :2], expected, rtol=1e-3)


ACES = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
XYZ = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)


@pytest.mark.parametrize(
    ("primaries", "neutral", "pixel", "expected"),
    [
        (ACES, None, [1, 1, 1], [1, 1, 1]),
        (XYZ, None, [0.95047, 1, 1.08883], [1, 1, 1]),  # XYZ has no white: D65 is what it is
        (XYZ, (1 / 3, 1 / 3), [1, 1, 1], [1, 1, 1]),  # unless the file says what it takes for neutral
        (ACES, (0.3127, 0.329), [0.9, 1, 1.05], None),
    ],
)
def test_what_is_neutral_in_a_file_stays_neutral(tmp_path, primaries, neutral, pixel, expected):
    pixels = np.array(pixel, np.float32).reshape(1, 1, 3)
    said = {} if neutral is None else {"adoptedNeutral": np.array(neutral, np.float32)}
    path = foreign(tmp_path / "a.exr", {"RGB": pixels}, "", chromaticities=primaries, **said)
    with pytest.warns(UserWarning, match="converted to Rec. 709"):
        found = read_radiance(path).radiance[0, 0]
    if expected is None:  # the neutral is D65 already: colours are the same light in both, not adapted
        to_xyz = Primaries.of(primaries).to_xyz()
        expected = np.linalg.solve(REC709.to_xyz(), to_xyz @ pixel)
    np.testing.assert_allclose(found, expected, atol=2e-3)


@pytest.mark.parametrize("values", [(0.64, 0.33, 0.64, 0.33, 0.15, 0.06, 0.3127, 0.329), (0.0,) * 8])
def test_primaries_that_are_none_are_reported_and_not_applied(tmp_path, numbered, values):
    path = foreign(tmp_path / "a.exr", {"RGB": numbered}, chromaticities=values)
    with pytest.warns(UserWarning, match="its chromaticities are of no use and not applied"):
        np.testing.assert_array_equal(read_radiance(path).radiance, numbered)


def test_layers_without_plain_colours_are_listed(tmp_path, numbered):
    planes = {f"{layer}.{letter}": numbered[..., i] for layer in ("diffuse", "gloss") for i, letter in enumerate("RGB")}
    with pytest.raises(
        UnreadableFile, match=r"holds the channels diffuse\.B, diffuse\.G, .*gloss\.R; relume needs R, G"
    ):
        read_radiance(foreign(tmp_path / "a.exr", planes))
    many = {f"c{i:02}": numbered[..., 0] for i in range(40)}
    with pytest.raises(UnreadableFile, match=r"c14, c15 and 24 more; relume needs"):
        read_radiance(foreign(tmp_path / "b.exr", many))


@pytest.mark.parametrize("plain", [False, True])
def test_of_several_views_in_a_part_the_first_is_read(tmp_path, numbered, plain):
    first = "" if plain else "left."
    planes = {f"{first}{letter}": numbered[..., i] for i, letter in enumerate("RGB")}
    planes |= {f"right.{letter}": -numbered[..., i] for i, letter in enumerate("RGB")}
    path = foreign(tmp_path / "a.exr", planes, multiView=["left", "right"])
    with pytest.warns(UserWarning, match="holds the views left, right; left is read"):
        np.testing.assert_array_equal(read_radiance(path).radiance, numbered)


def test_channels_beside_the_picture_are_named(tmp_path, numbered):
    planes = {name: numbered[..., i % 3] for i, name in enumerate(("R", "G", "B", "diffuse.R", "diffuse.G", "Z"))}
    planes["A"] = np.ones((5, 7), np.float32)
    path = foreign(tmp_path / "a.exr", planes)
    for reader in (read_radiance, read_layers):
        with pytest.warns(UserWarning) as reports:
            reader(path)
        (warning,) = reports
        left = "left out: the channels Z, diffuse.G, diffuse.R; save each on its own to read it"
        assert str(warning.message) == f"{path}: {left}"


def test_parts_beside_the_picture_are_named_but_not_our_own(tmp_path, numbered):
    write_layers(tmp_path / "a.exr", {"beauty": numbered, "diffuse": numbered, "variance": numbered})
    with pytest.warns(UserWarning, match=r"a\.exr: left out: the parts diffuse, variance; save each on its own"):
        assert read_radiance(tmp_path / "a.exr").variance is None
    layers = {"radiance": numbered, "variance": numbered, "clipped": numbered[..., 0] * 0, "line\nbreak": numbered}
    write_layers(tmp_path / "b.exr", layers)
    with pytest.warns(UserWarning, match=r"b\.exr: left out: the part 'line\\nbreak'; save"):
        assert read_radiance(tmp_path / "b.exr").variance is not None


def test_layers_of_the_view_that_is_read_are_named_and_those_of_others_are_not(tmp_path, numbered):
    names = ["R", "G", "B", "right.R", "right.G", "right.B", "shadow.right.R", "shadow.left.R", "right.A"]
    path = foreign(tmp_path / "a.exr", {name: numbered[..., 0] for name in names}, multiView=["left", "right"])
    with pytest.warns(UserWarning, match="holds the views left, right; left is read"):
        with pytest.warns(UserWarning, match="left out: the channel shadow.left.R; save"):
            read_radiance(path)


def test_integers_are_refused(tmp_path):
    path = foreign(tmp_path / "a.exr", {letter: np.zeros((2, 2), np.uint32) for letter in "RGB"})
    with pytest.raises(UnreadableFile, match="its colours are integers"):
        read_radiance(path)


def test_layers_come_back_by_name_shape_and_value(tmp_path, numbered):
    layers = {"with": numbered, "depth": numbered[..., 1], "matte": numbered[..., 0] > 2000}
    write_layers(tmp_path / "layers.exr", layers, unit="cd/m²", attributes={"seed": "7"})
    again = read_layers(tmp_path / "layers.exr")
    assert list(again) == ["with", "depth", "matte"]
    for name, layer in layers.items():
        np.testing.assert_array_equal(again[name], layer)
        assert again[name].dtype == np.float32
    headers = {part.name(): part.header for part in OpenEXR.File(str(tmp_path / "layers.exr")).parts}
    assert {name: header.get("whiteLuminance") for name, header in headers.items()} == {
        "with": 1.0,
        "depth": None,
        "matte": None,
    }
    with pytest.warns(UserWarning, match="left out: the parts depth, matte"):
        image = read_radiance(tmp_path / "layers.exr")
    assert (image.unit, image.attributes, image.variance) == ("cd/m²", {"seed": "7"}, None)


@pytest.mark.parametrize(
    ("layers", "complaint"),
    [
        ({}, "one size"),
        ({"a": np.zeros((2, 2)), "b": np.zeros((2, 3))}, r"\(2, 2\), \(2, 3\)"),
        ({"a": np.zeros((2, 2, 4))}, r'"a" is \(2, 2, 4\); expected \(H, W, 3\)'),
        ({"a": np.full((2, 2), 1e300)}, "4 values beyond float32"),
    ],
)
def test_layers_that_do_not_fit_are_refused(tmp_path, layers, complaint):
    with pytest.raises(ValueError, match=complaint):
        write_layers(tmp_path / "a.exr", layers)
    with pytest.raises(ValueError, match="unit"):
        write_layers(tmp_path / "a.exr", {"a": np.zeros((2, 2))}, unit="nits")
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("share", [0.5, 0.9, 0.999])
def test_a_truncated_exr_is_refused_in_one_line_and_silently(tmp_path, share, capfd):
    rng = np.random.default_rng(1)
    write(tmp_path / "a.exr", RadianceMap(rng.random((64, 64, 3), np.float32), rng.random((64, 64, 3), np.float32)))
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(data[: int(len(data) * share)])
    with pytest.raises(UnreadableFile, match=r"a\.exr: damaged EXR, part [01], row ") as raised:
        read_radiance(tmp_path / "a.exr")
    assert "\n" not in str(raised.value)
    assert capfd.readouterr() == ("", "")


def test_an_exr_that_claims_an_absurd_size_is_refused_from_its_header(tmp_path):
    path = foreign(tmp_path / "a.exr", {"Y": np.zeros((1, 1), np.float32)}, displayWindow=window(0, 0, 99_999, 0))
    with pytest.raises(UnreadableFile, match="claims 100000 x 1 pixels"):
        read_radiance(path)


@pytest.mark.filterwarnings("ignore:.*alpha is left out")
def test_every_real_damaged_exr_is_refused_in_one_line_or_read_whole(shared, capfd):
    files = sorted((shared / "data/malformed").glob("*/*.exr"))
    assert len(files) >= 100
    read_well, reports, placed = set(), set(), 0
    for file in files:
        start = time.process_time()
        try:
            with warnings.catch_warnings(record=True) as heard:
                warnings.simplefilter("always")
                read_radiance(file)
            read_well.add(file.name)
            if any("save it again" in str(warning.message) for warning in heard):
                reports.add(file.name)
        except UnreadableFile as error:
            assert re.fullmatch(re.escape(str(file)) + ": .+", str(error)), file
            if file.parent.name == "openexr_damaged":  # all but those that are no EXR at all name a place
                where = error.where if isinstance(error, FormatError) else ""
                placed += bool(where)
                assert not where or re.match(r"(byte \d|bytes \d|part \d|row -?\d|tile \d)", where), error
                assert where or re.search("no picture relume reads|relume reads sides", str(error)), error
        assert time.process_time() - start < 2, file
    # bad.exr is sound and holds NaN; in the others only the type attribute contradicts the file, which reads as it is.
    mistyped = {f"{kind}_with_{type}_type.exr" for kind, type in [
        ("scanline", "deepscanline"), ("scanline", "deeptiled"), ("scanline", "tiledimage"),
        ("tiled", "deepscanline"), ("tiled", "deeptile"), ("tiled", "scanlineimage")]}  # fmt: skip
    assert read_well == {"bad.exr"} | mistyped
    assert placed >= 75
    assert reports == mistyped
    assert capfd.readouterr() == ("", "")


@pytest.mark.filterwarnings("ignore:.*alpha is left out")
def test_a_cropped_file_holds_its_part_of_the_uncropped_picture(shared):
    folder = shared / "data/formats/exr_hdr_pair"
    path = folder / "cropping - data window differs display window.exr"
    whole = read_layers(folder / "cropping - uncropped original.exr")["part 0"]
    expected, inside = np.zeros_like(whole), (slice(1097, 1197), slice(1012, 1327))
    expected[inside] = whole[inside]
    count = whole.shape[0] * whole.shape[1] - 100 * 315
    with pytest.warns(UserWarning, match=f"{count} of its {count + 100 * 315} pixels lie outside its data window"):
        part, image = read_layers(path)["part 0"], read_radiance(path)
    np.testing.assert_array_equal(part, expected)
    np.testing.assert_array_equal(image.radiance, expected)
    assert image.clipped is not None
    assert not image.clipped[inside].any() and np.count_nonzero(image.clipped == OUTSIDE) == count


def test_deep_files_and_those_without_colours_are_refused_by_name(shared):
    folder = shared / "data/formats/openexr"
    with pytest.raises(UnreadableFile, match="deep EXR"):
        read_radiance(folder / "deep/Trunks.exr")
    with pytest.raises(UnreadableFile, match="holds the channels R, Z; relume needs"):
        read_radiance(folder / "compression/v1.7.test.interleaved.exr")


@pytest.mark.filterwarnings("ignore:.*outside its data window", "ignore:.*left out")
def test_the_first_colour_part_of_a_stereo_file_is_read(shared):
    with pytest.warns(UserWarning, match="holds the views right, left; right is read"):
        image = read_radiance(shared / "data/formats/openexr/multipart/multipart.0006.exr")
    assert image.size == (2048, 1556)
    assert not image.radiance[:224].any() and image.radiance[224:1086, 1176:2048].any()


def test_many_threads_may_read_at_once(tmp_path, numbered):
    write(tmp_path / "a.exr", RadianceMap(numbered))
    (tmp_path / "b.exr").write_bytes((tmp_path / "a.exr").read_bytes()[:-20])
    results = []

    def attempt(name):
        try:
            results.append(read_radiance(tmp_path / name).radiance.sum() == numbered.sum())
        except UnreadableFile:
            results.append(name == "b.exr")

    threads = [threading.Thread(target=attempt, args=("ab"[i % 2] + ".exr",)) for i in range(16)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert results == [True] * 16


THREADS = """
import sys, os, numpy as np, OpenEXR
from relume.image.files import read_radiance, write
from relume.image.radiance import RadianceMap
if sys.argv[2] != "ours":
    OpenEXR.set_global_thread_count(int(sys.argv[2]))
pixels = np.random.default_rng(1).random((300, 200, 3), np.float32)
write(sys.argv[1], RadianceMap(pixels))
assert np.array_equal(read_radiance(sys.argv[1]).radiance, pixels)
print(OpenEXR.global_thread_count())
"""


def test_the_library_works_on_all_cores_unless_the_program_chose_and_writes_the_same_bytes(tmp_path):
    def threads(name, chosen):
        made = subprocess.run([sys.executable, "-c", THREADS, tmp_path / name, chosen], capture_output=True, text=True)
        return int(made.stdout), (tmp_path / name).read_bytes()

    ours, on_all = threads("all.exr", "ours")
    assert ours == min(os.cpu_count() or 1, 16)
    assert threads("one.exr", "1") == (1, on_all)

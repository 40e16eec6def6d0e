"""Luminance and chroma: files written by hand, an interpolation in plain Python, and pictures of others."""

import struct

import numpy as np
import pytest

from exr_files import attribute, scan_lines
from relume.errors import UnreadableFile
from relume.image.files import read_layers, read_radiance
from relume.image.files.exr.picture import to_rgb
from relume.image.primaries import REC709, Primaries

TAPS = {1: 0.627123, 3: -0.186077, 5: 0.087929, 7: -0.043159, 9: 0.019597, 11: -0.007540, 13: 0.002128}
YC = ("Y", "RY", "BY")


def slowly_doubled(samples: list[float], length: int) -> list[float]:
    """Even places as they are, odd ones from the seven samples to either side; beyond the ends the last one goes on."""
    doubled = []
    for x in range(length):
        if x % 2 == 0:
            doubled.append(samples[x // 2])
            continue
        value = 0.0
        for away, weight in TAPS.items():
            for place in (x - away, x + away):
                value += weight * samples[min(max(place // 2, 0), len(samples) - 1)]
        doubled.append(value)
    return doubled


def slowly_decoded(light, red, blue, weights):
    height, width = light.shape

    def upsampled(chroma):
        tall = [slowly_doubled(column, height) for column in chroma.astype(float).T.tolist()]
        return np.array([slowly_doubled(row, width) for row in np.array(tall).T.tolist()])

    r = (upsampled(red) + 1) * light
    b = (upsampled(blue) + 1) * light
    return np.stack([r, (light - weights[0] * r - weights[2] * b) / weights[1], b], axis=-1)


@pytest.mark.parametrize("size", [(1, 1), (2, 2), (3, 5), (40, 33), (31, 64)])
def test_chroma_is_interpolated_as_in_plain_python(size):
    rng = np.random.default_rng(3)
    light = rng.random(size)
    half = tuple(-(-length // 2) for length in size)
    red, blue = rng.normal(0, 0.4, (2, *half))
    decoded = np.stack(to_rgb(light.astype(np.float32), red, blue, REC709), axis=-1)
    expected = slowly_decoded(light, red, blue, (0.212639, 0.715169, 0.072192))  # of Rec. 709 with D65 .3127, .3290
    np.testing.assert_allclose(decoded, expected, rtol=0, atol=2e-5)


def test_grey_stays_grey_to_the_last_bit():
    light = np.random.default_rng(4).random((20, 30), np.float32)
    for plane in to_rgb(light, np.zeros((10, 15), np.float16), np.zeros((10, 15), np.float16), REC709):
        np.testing.assert_array_equal(plane, light)


def test_a_pixel_by_hand():
    """Y = ½, RY = 1 and BY = −1 are R = 1 and B = 0; XYZ has its luminance in G alone, which is then ½."""
    xyz = Primaries((1, 0), (0, 1), (0, 0), (1 / 3, 1 / 3))
    one = np.ones((1, 1), np.float32)
    assert [float(plane[0, 0]) for plane in to_rgb(one / 2, one, -one, xyz)] == pytest.approx([1, 0.5, 0], abs=1e-7)
    r, g, b = to_rgb(one / 2, one, -one, REC709)
    assert (r[0, 0], b[0, 0]) == (1, 0)
    assert float(g[0, 0]) == pytest.approx((0.5 - 0.212639) / 0.715169, abs=1e-6)


def test_a_file_of_luminance_and_chroma_is_read(tmp_path):
    rng = np.random.default_rng(5)
    light = rng.random((6, 8)).astype(np.float16)
    red, blue = rng.normal(0, 0.2, (2, 3, 4)).astype(np.float16)
    path = tmp_path / "a.exr"
    path.write_bytes(scan_lines(8, 6, [("Y", light, 1), ("RY", red, 2), ("BY", blue, 2)]))
    expected = slowly_decoded(light.astype(float), red, blue, (0.212639, 0.715169, 0.072192))
    np.testing.assert_allclose(read_radiance(path).radiance, expected, atol=2e-5)


def test_chroma_of_full_size_is_taken_as_it_is(tmp_path):
    light, chroma = np.full((2, 2), 2, np.float32), np.full((2, 2), 0.5, np.float32)
    path = tmp_path / "a.exr"
    path.write_bytes(scan_lines(2, 2, [("Y", light, 1), ("RY", chroma, 1), ("BY", chroma, 1)]))
    assert read_radiance(path).radiance[..., 0].tolist() == [[3, 3], [3, 3]]


@pytest.mark.parametrize(
    ("names", "complaint"),
    [
        ({"Y": 1, "RY": 4, "BY": 4}, r"chroma is \(1, 1\); expected \(4, 4\), or half of that; save it as R, G, B"),
        ({"R": 1, "G": 2, "B": 1}, "channels R, G, B are subsampled"),
        ({"R": 2, "G": 2, "B": 2}, "channels R, G, B are subsampled"),
        ({"Y": 2}, "channels Y are subsampled"),
    ],
)
def test_other_subsampling_is_refused(tmp_path, names, complaint):
    channels = [(name, np.zeros((4 // step, 4 // step), np.float32), step) for name, step in names.items()]
    path = tmp_path / "a.exr"
    path.write_bytes(scan_lines(4, 4, channels))
    with pytest.raises(UnreadableFile, match=complaint):
        read_radiance(path)


def test_two_files_of_one_picture_in_other_primaries_agree(shared):
    """Of the pair only the XYZ file says what its colours are; subsampled apart, their chroma differs at edges."""
    folder = shared / "data/formats/openexr/chromaticities"
    plain = read_radiance(folder / "Rec709_YC.exr")
    with pytest.warns(
        UserWarning, match="its primaries are 1, 0, 0, 1, 0, 0, 0.3333, 0.3333 .*; converted to Rec. 709"
    ):
        converted = read_radiance(folder / "XYZ_YC.exr")
    assert converted.attributes["primaries"] == "1 0 0 1 0 0 0.333333 0.333333"
    assert "primaries" not in plain.attributes
    light = np.array([0.212639, 0.715169, 0.072192])
    difference = np.abs(plain.radiance @ light - converted.radiance @ light)
    assert np.median(difference / (plain.radiance @ light)) < 1e-6  # luminance has no subsampling
    assert difference.max() < 0.003
    errors = plain.radiance - converted.radiance
    assert np.sqrt(np.mean(errors**2)) < 0.01 * plain.radiance.mean()  # measured: 0.86 %
    np.testing.assert_allclose(plain.radiance.mean((0, 1)), converted.radiance.mean((0, 1)), rtol=3e-4)


def test_luminance_and_chroma_show_what_the_file_in_colours_shows(shared):
    """Both are lossy, DWAA in every pixel and the other in chroma; shifted by one pixel they differ five times more."""
    folder = shared / "data/formats/openexr/compression"
    colours = read_radiance(folder / "comp_dwaa_v2.exr").radiance[:674, :586]
    chroma = read_radiance(folder / "comp_b44.exr").radiance
    errors = np.abs(chroma - colours) / (np.abs(colours) + 0.05)
    assert errors.mean() < 0.0125  # measured: 1.21 %
    shifted = np.abs(chroma[1:] - colours[:-1]) / (np.abs(colours[:-1]) + 0.05)
    assert shifted.mean() > 5 * errors.mean()


def test_layers_keep_the_primaries_of_their_file(tmp_path):
    """R and B of XYZ have no luminance."""
    light = np.full((2, 2), 2, np.float32)
    chroma = np.full((1, 1), 0.5, np.float32)
    xyz = attribute("chromaticities", "chromaticities", struct.pack("<8f", 1, 0, 0, 1, 0, 0, 1 / 3, 1 / 3))
    path = tmp_path / "a.exr"
    path.write_bytes(scan_lines(2, 2, list(zip(YC, (light, chroma, chroma), (1, 2, 2), strict=True)), xyz))
    np.testing.assert_allclose(read_layers(path)["part 0"][1, 1], [3, 2, 3], rtol=1e-5)

"""The two look-ups a pixel, held against decoding all of it and a power law."""

import warnings

import numpy as np
import pytest

from relume.image.files import read_radiance, write
from relume.image.files.encodings import LogLuv
from relume.image.files.logluv.preview import preview
from relume.image.primaries import REC709
from relume.image.radiance import RadianceMap


def developed(path, exposure, gamma):
    bright = np.maximum(read_radiance(path).radiance.astype(np.float64) * 2.0**exposure, 0) ** (1 / gamma)
    return np.clip(np.floor(255 * bright + 0.5), 0, 255)


@pytest.mark.parametrize("bits", [16, 24, 32])
@pytest.mark.parametrize(("exposure", "gamma"), [(0, 2.2), (-4, 2.2), (6, 1.8), (-60, 1.0), (900, 2.2)])
def test_two_look_ups_give_what_decoding_and_a_power_law_give(tmp_path, bits, exposure, gamma):
    generator = np.random.default_rng(4)
    pixels = generator.uniform(-0.1, 1, (50, 60, 3)) * 2.0 ** generator.uniform(-9, 3, (50, 60, 1))
    pixels[pixels @ REC709.to_xyz()[1] <= 0] = 0  # negative luminance is another test
    pixels[0, 0] = 0
    image = RadianceMap(pixels.astype(np.float32), unit="cd/m²")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write(tmp_path / "a.tif", image, LogLuv(bits))
    shown = preview(tmp_path / "a.tif", exposure, gamma)
    assert shown.pixels.dtype == np.uint8
    assert np.abs(shown.pixels - developed(tmp_path / "a.tif", exposure, gamma)).max() <= 1
    assert shown.pixels[0, 0].tolist() == [0, 0, 0]


def test_negative_luminance_shows_as_black(tmp_path):
    write(tmp_path / "a.tif", RadianceMap(np.full((1, 1, 3), -3, np.float32)), LogLuv(32))
    assert preview(tmp_path / "a.tif").pixels.tolist() == [[[0, 0, 0]]]


def test_exposures_and_gammas_without_meaning_are_refused(tmp_path):
    for exposure, gamma in ((float("nan"), 2.2), (1e6, 2.2), (0, 0), (0, -1)):
        with pytest.raises(ValueError, match="give a gamma above 0"):
            preview(tmp_path / "a.tif", exposure, gamma)


def test_a_real_picture_shows_within_one_code(shared):
    for name in ("off_luv24.tif", "off_luv32.tif"):
        path = shared / "data" / "formats" / "logluv_tiff" / name
        assert np.abs(preview(path, -7).pixels - developed(path, -7, 2.2)).max() <= 1

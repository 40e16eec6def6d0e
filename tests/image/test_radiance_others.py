"""Radiance pictures as OpenCV and OpenImageIO read and write them.

Both take mantissas as they are when they read, and cut off digits when they write, so that what they write is read here
half a step low, unless mantissas are asked to mean the middle of their step.
"""

from pathlib import Path

import cv2
import numpy as np
import OpenImageIO as oiio
import pytest

from other_programs import by_opencv, by_openimageio
from relume.image.files import ReadOptions, read_radiance, write
from relume.image.files.encodings import RadianceHDR
from relume.image.radiance import RadianceMap


def write_opencv(path: Path, pixels: np.ndarray) -> None:
    assert cv2.imwrite(str(path), np.ascontiguousarray(pixels[..., ::-1]))


def write_openimageio(path: Path, pixels: np.ndarray) -> None:
    height, width, channels = pixels.shape
    output = oiio.ImageOutput.create(str(path))
    assert output is not None
    assert output.open(str(path), oiio.ImageSpec(width, height, channels, "float"))
    assert output.write_image(pixels)
    output.close()


@pytest.fixture(scope="module")
def scene() -> np.ndarray:
    """(60, 200, 3) float32 over ten decades: noise, an even part, noise, black."""
    random = np.random.default_rng(2)
    pixels = 10 ** random.uniform(-5, 5, (60, 200, 1)) * random.uniform(0, 1, (60, 200, 3))
    pixels[20:40] = (0.25, 3, 1)
    pixels[50:] = 0
    return pixels.astype(np.float32)


@pytest.mark.parametrize("reader", [by_opencv, by_openimageio])
@pytest.mark.parametrize("width", [200, 7])
@pytest.mark.parametrize("compressed", [True, False])
def test_others_read_the_values_that_are_read_here(tmp_path, scene, reader, width, compressed):
    attributes = {"camera": "Canon", "mapping": "latlong", "pixel_aspect": "1.5", "view": "-vth"}
    image = RadianceMap(scene[:, :width].copy(), unit="cd/m²", attributes=attributes)
    write(tmp_path / "a.hdr", image, RadianceHDR(compressed=compressed))
    np.testing.assert_array_equal(reader(tmp_path / "a.hdr"), read_radiance(tmp_path / "a.hdr").radiance)


@pytest.mark.parametrize("writer", [write_opencv, write_openimageio])
def test_what_others_write_is_read_within_a_step_and_without_bias_by_the_middle(tmp_path, scene, writer):
    noise = scene[:20]
    writer(tmp_path / "a.hdr", noise)
    plain, middle = (
        (read_radiance(tmp_path / "a.hdr", ReadOptions(mantissa_middle=choice)).radiance - noise)
        / noise.max(axis=-1, keepdims=True)
        for choice in (False, True)
    )
    assert plain.mean() < -2.5e-3  # half a step of 1/128 to 1/256
    assert abs(middle.mean()) < 1e-4
    assert np.abs(middle).max() <= 1 / 256 * (1 + 1e-6)

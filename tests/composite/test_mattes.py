"""Mattes of real things in front: read from a painting, split off the plate."""

import numpy as np
import pytest

from relume.composite.mattes import read_matte, solid_foreground
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.files.photographs import png
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap


def soft(height: int = 4, width: int = 6) -> np.ndarray:
    return np.linspace(0, 255, height * width).reshape(height, width).astype(np.uint8)


def grey(values: np.ndarray) -> np.ndarray:
    return np.repeat(values[..., None], 3, axis=2)


def test_a_grey_painting_is_the_share_itself(tmp_path):
    values = soft()
    files.write(tmp_path / "front.png", Photograph(grey(values)))
    matte = read_matte(tmp_path / "front.png", (6, 4))
    assert matte.dtype == np.float32
    np.testing.assert_array_equal(matte, (values / 255).astype(np.float32))
    files.write(tmp_path / "deep.png", Photograph(grey(values.astype(np.uint16) * 257)))
    np.testing.assert_array_equal(read_matte(tmp_path / "deep.png", (6, 4)), matte)
    files.write(tmp_path / "front.exr", RadianceMap(grey(matte)))
    np.testing.assert_array_equal(read_matte(tmp_path / "front.exr", (6, 4)), matte)


def test_alpha_is_the_matte_where_a_painting_has_it_soft_edges_kept(tmp_path):
    values = soft()
    coloured = np.concatenate([np.full((4, 6, 3), (200, 30, 90), np.uint8), values[..., None]], axis=2)
    (tmp_path / "front.png").write_bytes(png.encode(coloured))
    np.testing.assert_array_equal(read_matte(tmp_path / "front.png", (6, 4)), (values / 255).astype(np.float32))


@pytest.mark.parametrize(
    "name, picture, said",
    [
        ("large.png", Photograph(np.zeros((8, 9, 3), np.uint8)), "the matte is 9×8, the plate 6×4"),
        ("red.png", Photograph(np.full((4, 6, 3), (255, 0, 0), np.uint8)), "a matte in colours"),
        ("light.exr", RadianceMap(np.full((4, 6, 3), 1.5, np.float32)), "values beyond 0 to 1"),
    ],
)
def test_a_painting_that_is_no_matte_of_the_plate_is_refused_in_one_line(tmp_path, name, picture, said):
    files.write(tmp_path / name, picture)
    with pytest.raises(UnreadableFile, match=said) as refusal:
        read_matte(tmp_path / name, (6, 4))
    assert "\n" not in str(refusal.value) and name in str(refusal.value)


def test_the_light_of_a_soft_edge_is_that_of_the_nearest_solid_pixel():
    plate = np.full((3, 5, 3), 10, np.float32)
    plate[:, 0], plate[:, 1] = 2, 6
    occluder = np.repeat(np.array([[1, 0.5, 0.25, 0, 0]]), 3, axis=0)
    np.testing.assert_array_equal(solid_foreground(plate, occluder)[1, :, 0], [2, 1, 0.5, 0, 0])
    # Nowhere solid: the plate's own value is all there is.
    np.testing.assert_array_equal(solid_foreground(plate, occluder / 2)[1, :, 0], [1, 1.5, 1.25, 0, 0])
    # What is in front cannot send more light than the whole pixel does.
    plate[:, 0] = 100
    np.testing.assert_array_equal(solid_foreground(plate, occluder)[1, :3, 0], [100, 6, 10])

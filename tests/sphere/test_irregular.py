"""Environment maps a pixel off 2:1, and the cubes of OpenEXR."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from relume.image.files import read_radiance, write
from relume.image.radiance import SATURATED, RadianceMap
from relume.sphere.directions import normalised
from relume.sphere.environment_files import as_environment, read_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.irregular import evened, strip_of_openexr
from relume.sphere.mappings.mapping import LatLong, pixel_directions


def smooth(directions: np.ndarray) -> np.ndarray:
    """Light (…, 3) of a few broad lobes."""
    x, y, z = np.moveaxis(directions, -1, 0)
    return np.stack([2 + x + 0.5 * y * z, 2 + y - 0.5 * x, 3 - z + x * y], axis=-1).astype(np.float32)


def at_nodes(rows: int, columns: int) -> np.ndarray:
    """A map whose first and last columns are one meridian, and its first and last rows the poles."""
    v, u = np.linspace(0, 1, rows), np.linspace(0, 1, columns)
    return smooth(LatLong().directions(np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)))


def test_half_degrees_with_both_ends_are_taken_and_noted():
    with pytest.warns(
        UserWarning, match="721×361 pixels, one off 2:1: taken for a lat-long map, and resampled to 720×360"
    ):
        light = as_environment(RadianceMap(at_nodes(361, 721)))
    wanted = smooth(pixel_directions(LatLong(), 360))
    assert light.size == 360 and np.abs(light.radiance - wanted).max() < 2e-4


@pytest.mark.parametrize(
    "rows, columns, size", [(64, 127, 64), (64, 129, 64), (65, 128, 65), (63, 128, 63), (64, 130, 64)]
)
def test_a_row_or_a_column_more_or_less_keeps_the_light(rows, columns, size):
    v, u = (np.arange(rows) + 0.5) / rows, (np.arange(columns) + 0.5) / columns
    radiance = smooth(LatLong().directions(np.stack(np.broadcast_arrays(u[None, :], v[:, None]), axis=-1)))
    clipped = np.zeros((rows, columns), np.uint8)
    clipped[5, columns - 1] = SATURATED
    with pytest.warns(UserWarning, match="one off 2:1"):
        light = as_environment(RadianceMap(radiance, None, clipped))
    assert light.size == size and np.abs(light.radiance - smooth(pixel_directions(LatLong(), size))).max() < 0.01
    assert light.clipped is not None and light.clipped[5, -1] == SATURATED and (light.clipped > 0).sum() <= 3
    # By its own name too, and by that of the command line.
    with pytest.warns(UserWarning, match="one off 2:1"):
        as_environment(RadianceMap(radiance, attributes={"mapping": "latlong"}))


@pytest.mark.parametrize("nodes", [True, False])
def test_the_variance_of_what_is_averaged_goes_with_it(nodes):
    radiance = at_nodes(65, 129) if nodes else smooth(pixel_directions(LatLong(), 64))[:, 1:]
    given = RadianceMap(radiance, np.full(radiance.shape, 4.0, np.float32))
    with pytest.warns(UserWarning, match="one off 2:1"):
        made = evened(given)
    assert made.variance is not None and made.variance.shape == made.radiance.shape
    # Of the mean of two by two a quarter; of two samples in shares that differ from pixel to pixel a half to all.
    low, high = (1.0, 1.0) if nodes else (2.0, 4.0)
    assert low == pytest.approx(made.variance.min(), abs=0.01) and high == pytest.approx(made.variance.max(), abs=0.1)


def test_files_say_it_once_and_other_shapes_are_not_taken(tmp_path):
    write(tmp_path / "a.exr", RadianceMap(at_nodes(65, 129)))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assert read_environment(tmp_path / "a.exr").size == 64
        assert read_environment(tmp_path / "a.exr", LatLong()).size == 64
    assert len(caught) == 2
    for shape in ((64, 131), (20, 41), (64, 125)):
        with pytest.raises(ValueError, match="twice as"):
            as_environment(RadianceMap(np.ones((*shape, 3), np.float32)))
    picture = RadianceMap(np.ones((64, 128, 3), np.float32))
    assert evened(picture) is picture


# The cubes of OpenEXR


def test_the_corners_that_openexr_s_drawing_numbers():
    """ImfEnvmap.h: corner 7 is (1, 1, 1) and stands at the top right of +X, and so on."""
    corners = {
        0: (-1, -1, -1), 1: (1, -1, -1), 2: (-1, 1, -1), 3: (1, 1, -1),
        4: (-1, -1, 1), 5: (1, -1, 1), 6: (-1, 1, 1), 7: (1, 1, 1),
    }  # fmt: skip
    # Top left, top right, bottom left, bottom right of each face, from the drawing; what it leaves out from its cube.
    faces = [(3, 7, 1, 5), (6, 2, 4, 0), (6, 7, 2, 3), (0, 1, 4, 5), (7, 6, 5, 4), (2, 3, 0, 1)]
    side = 9
    pixels = np.zeros((6 * side, side, 3), np.float32)
    for face, (upper_left, upper_right, lower_left, lower_right) in enumerate(faces):
        for row, column, corner in (
            (0, 0, upper_left),
            (0, -1, upper_right),
            (-1, 0, lower_left),
            (-1, -1, lower_right),
        ):
            pixels[face * side : (face + 1) * side][row, column] = 1 + corner
    light = as_environment(RadianceMap(pixels, attributes={"envmap": "cube"}))
    assert light.mapping.name == "strip" and "envmap" not in light.attributes
    for number, corner in corners.items():
        # A hair within each of the three faces that meet there: the number alone, less what is black beside it.
        for axis in range(3):
            inside = np.array(corner, np.float64) * np.where(np.arange(3) == axis, 1, 1 - 0.5 / side)
            found = light.lookup(normalised(inside))[0]
            assert found == pytest.approx((1 + number) * (1 - 0.5 * (side - 1) / side) ** 2, rel=0.01), (number, axis)


def test_a_cube_of_openexr_shows_what_its_directions_show():
    side, t = 33, np.linspace(-1, 1, 33)
    s, down = np.meshgrid(t, -t)
    one = np.ones_like(s)
    # ImfEnvmap.cpp, CubeMap::direction behind CubeMap::pixelPosition.
    faces = [
        (one, down, s), (-one, down, -s), (s, one, down), (s, -one, -down), (-s, down, one), (s, down, -one),
    ]  # fmt: skip
    pixels = np.concatenate([smooth(normalised(np.stack(face, axis=-1))) for face in faces])
    strip = strip_of_openexr(RadianceMap(pixels, attributes={"envmap": "cube", "owner": "a"}))
    assert strip.size == (6 * side, side) and strip.attributes == {"mapping": "strip", "owner": "a"}
    light = as_environment(strip)
    directions = pixel_directions(LatLong(), 40)
    assert np.abs(light.lookup(directions) - smooth(directions)).max() < 0.02


def test_openexr_s_own_pair_agrees(shared):
    """The same place as a cube and as lat-long, whose middle is +Z in OpenEXR and −Z here: half a turn apart."""
    folder = shared / "data/formats/openexr/envmaps"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        cube = as_environment(read_radiance(folder / "StageEnvCube.exr"))
        plain = as_environment(read_radiance(folder / "StageEnvLatLong.exr"))
    assert isinstance(cube, EnvironmentMap) and cube.mapping.name == "strip"
    directions = pixel_directions(LatLong(), 64)
    turned = directions * [-1, 1, -1]
    first, second = (np.log(np.maximum(each, 0.01)) for each in (cube.lookup(directions), plain.lookup(turned)))
    assert np.corrcoef(first.ravel(), second.ravel())[0, 1] > 0.95
    # Any other turn or mirror image agrees less.
    for wrong in ([1, 1, 1], [-1, 1, 1], [1, 1, -1], [-1, -1, -1]):
        other = np.log(np.maximum(plain.lookup(directions * wrong), 0.01))
        assert np.corrcoef(first.ravel(), other.ravel())[0, 1] < 0.8

"""Two environment maps joined: by a horizon, by a mask, where one shows nothing; units, marks and energy."""

from pathlib import Path

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.image.files import write
from relume.image.photograph import Photograph
from relume.image.radiance import OUTSIDE, SATURATED
from relume.light.editing.edits import edit
from relume.light.editing.joining import Horizon, Join, Mask, join_maps
from relume.sphere.directions import rotation_about
from relume.sphere.environment_files import as_environment, as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.discs import Angular, Fisheye
from relume.sphere.mappings.mapping import LatLong, Mapping, pixel_directions


def even(value: float, rows: int = 32, mapping: Mapping = LatLong(), **more: object) -> EnvironmentMap:
    return EnvironmentMap(np.full((*mapping.shape(rows), 3), value, np.float32), mapping, **more)  # type: ignore[arg-type]


def test_a_hard_horizon_gives_the_upper_half_of_one_and_the_lower_of_the_other():
    whole = join_maps(even(3), even(1), Horizon(softness=0))
    np.testing.assert_array_equal(whole.radiance[:16], 3)
    np.testing.assert_array_equal(whole.radiance[16:], 1)
    assert whole.clipped is None


def test_a_soft_edge_is_in_the_middle_half_of_each_and_ends_where_it_should():
    rows = 512
    found = join_maps(even(1, rows), even(0, rows), Horizon(np.radians(20), np.radians(10))).radiance[:, 0, 0]
    heights = 90 - (np.arange(rows) + 0.5) * 180 / rows
    np.testing.assert_array_equal(found[heights > 25], 1)
    np.testing.assert_array_equal(found[heights < 15], 0)
    np.testing.assert_allclose(np.interp(20, heights[::-1], found[::-1]), 0.5, atol=1e-3)
    assert np.all(np.diff(found) <= 0)


def test_a_map_joined_with_itself_is_itself():
    random = np.random.default_rng(2)
    light = EnvironmentMap(random.random((32, 64, 3), np.float32))
    mask = Mask(random.random((32, 64)), softness=0.1)
    for where in (Horizon(0.2, 0.5), mask):
        np.testing.assert_allclose(join_maps(light, light, where).radiance, light.radiance, rtol=1e-6)


def test_a_mask_is_a_share_in_linear_light():
    share = np.zeros((32, 64))
    share[:, 20:40] = 0.25
    found = join_maps(even(8), even(4), Mask(share)).radiance[..., 0]
    np.testing.assert_allclose(found[:, 22:38], 5, rtol=1e-5)
    np.testing.assert_allclose(found[:, :18], 4, rtol=1e-5)


def test_a_soft_mask_keeps_its_area():
    share = np.zeros((64, 128))
    share[20:40, 30:90] = 1
    hard, soft = (join_maps(even(1, 64), even(0, 64), Mask(share, softness=s)) for s in (0.0, 0.1))
    np.testing.assert_allclose(soft.total(), hard.total(), rtol=1e-4)
    assert np.count_nonzero(soft.radiance) > 1.2 * np.count_nonzero(hard.radiance)


def test_a_fisheye_sky_gets_its_ground_and_keeps_its_own_light():
    lens = Fisheye(np.radians(180))
    upwards = even(5, 128, lens).remapped(LatLong(), 64, rotation_about(np.array([1.0, 0.0, 0.0]), np.pi / 2))
    assert upwards.clipped is not None
    found = join_maps(upwards, even(1, 64), Horizon(np.radians(-90), 0))
    up = pixel_directions(LatLong(), 64)[..., 1]
    np.testing.assert_allclose(found.radiance[up > 0.06], 5, rtol=1e-4)
    np.testing.assert_allclose(found.radiance[up < -0.06], 1, rtol=1e-4)
    assert found.clipped is None or not np.any(found.clipped == OUTSIDE)


def test_a_part_of_the_sphere_as_it_is_becomes_lat_long():
    found = join_maps(even(5, 64, Fisheye(np.radians(180))), even(1, 64), Horizon(np.radians(-90), 0))
    assert isinstance(found.mapping, LatLong)
    ahead = -pixel_directions(LatLong(), found.size)[..., 2]
    np.testing.assert_allclose(found.radiance[ahead > 0.1], 5, rtol=1e-4)
    np.testing.assert_allclose(found.radiance[ahead < -0.1], 1, rtol=1e-4)


def test_what_was_only_filled_in_comes_from_the_other_map():
    clipped = np.zeros((32, 64), np.uint8)
    clipped[4:8, 10:20] = OUTSIDE
    clipped[10, 40] = SATURATED
    found = join_maps(even(3, clipped=clipped), even(1), Horizon(-0.3, 0))
    np.testing.assert_allclose(found.radiance[4:8, 10:20], 1)
    np.testing.assert_allclose(found.radiance[2, 12], 3)
    assert found.clipped is not None
    assert found.clipped[10, 40] == SATURATED
    assert not np.any(found.clipped == OUTSIDE)


def test_other_mappings_and_sizes_meet_at_the_finer():
    found = join_maps(even(2, 16, Angular()), even(2, 128))
    assert isinstance(found.mapping, Angular)
    assert found.size > 100
    np.testing.assert_allclose(found.irradiance(np.array([0.0, 1, 0])), 2 * np.pi, rtol=1e-2)


def test_units_do_not_mix():
    with pytest.raises(ValueError, match=r"one map is in cd/m² and the other in relative"):
        join_maps(even(1, unit="cd/m²"), even(1))
    assert join_maps(even(1, unit="cd/m²"), even(1, unit="cd/m²")).unit == "cd/m²"


def test_what_neither_shows_is_refused():
    lens = Fisheye(np.radians(120))
    with pytest.raises(ValueError, match="pixels are in neither map"):
        join_maps(even(1, 32, lens), even(1, 32, lens))


def test_wrong_edges_and_masks_are_refused(tmp_path: Path):
    with pytest.raises(ValueError, match="the edge is at 100°"):
        Horizon(np.radians(100))
    with pytest.raises(ValueError, match="no latlong map"):
        Mask(np.zeros((32, 63)))
    with pytest.raises(ValueError, match="beyond 0 to 1"):
        Mask(np.full((2, 4), 1.5))
    coloured = np.zeros((4, 8, 3), np.uint8)
    coloured[..., 0] = 255
    write(tmp_path / "mask.png", Photograph(coloured))
    with pytest.raises(UnreadableFile, match="a mask in colours"):
        Mask.read(tmp_path / "mask.png")


def test_as_an_edit_a_file_lies_below_and_a_mask_beside(tmp_path: Path):
    write(tmp_path / "ground.exr", as_radiance_map(even(1)))
    mask = np.zeros((32, 64, 3), np.uint8)
    mask[:8] = 255
    write(tmp_path / "mask.png", Photograph(mask))
    join = Join(tmp_path / "ground.exr", tmp_path / "mask.png")
    edited = edit(as_radiance_map(even(3)), [join])
    assert edited.edits == ("over ground.exr, by mask.png",)
    found = as_environment(edited.picture).radiance
    np.testing.assert_allclose(found[:8], 3)
    np.testing.assert_allclose(found[8:], 1)

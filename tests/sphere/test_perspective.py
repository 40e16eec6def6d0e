"""Perspective views out of a map and back into it."""

import numpy as np
import pytest

from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap
from relume.sphere.directions import look_at, normalised, rotation_about
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import Strip
from relume.sphere.mappings.discs import Angular
from relume.sphere.mappings.mapping import LatLong, Mapping, pixel_points
from relume.sphere.mappings.perspective import insert_view, perspective_view

AHEAD = np.eye(3)
ASIDE = look_at([0, 0, 0], [1, 0.4, -0.3])


def smooth(mapping: Mapping = LatLong(), size=128, unit="relative"):
    towards = np.nan_to_num(mapping.directions(mapping.shown(pixel_points(mapping, size))))
    values = 2 + towards @ np.array([[0.5, 0.1, -0.3], [0.7, -0.2, 0.1], [-0.3, 0.9, 0.2]])
    return EnvironmentMap(values.astype(np.float32), mapping, unit)


def rays(rotation, field, width, height):
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, (np.arange(height) + 0.5) / width * 2 - height / width)
    tangent = np.tan(field / 2)
    return normalised(np.stack([x * tangent, -y * tangent, -np.ones_like(x)], -1)) @ rotation.T


@pytest.mark.parametrize("mapping", [LatLong(), Angular()], ids=lambda m: m.name)
@pytest.mark.parametrize("rotation", [AHEAD, ASIDE], ids=["ahead", "aside"])
def test_a_view_shows_the_light_of_its_rays(mapping, rotation):
    view = perspective_view(smooth(mapping), rotation, np.radians(70), (60, 40))
    towards = rays(rotation, np.radians(70), 60, 40)
    expected = 2 + towards @ np.array([[0.5, 0.1, -0.3], [0.7, -0.2, 0.1], [-0.3, 0.9, 0.2]])
    np.testing.assert_allclose(view.radiance, expected, atol=3e-3)


def test_the_front_face_of_a_cube_is_the_view_ahead():
    light = smooth(Strip(), 64)
    view = perspective_view(light, AHEAD, np.pi / 2, (64, 64))
    # The −Z face shows its view mirrored, as OpenGL reads it.
    np.testing.assert_allclose(view.radiance, light.radiance[:, 320:384][:, ::-1], rtol=1e-3)
    assert view.attributes["view-field"] == "90"
    assert view.attributes["view-rotation"].split() == ["1", "0", "0", "0", "1", "0", "0", "0", "1"]


def test_a_view_averages_what_is_finer_than_its_pixels():
    stripes = np.broadcast_to((np.arange(1024) % 2.0)[None, :, None], (512, 1024, 3)).astype(np.float32)
    view = perspective_view(EnvironmentMap(stripes), AHEAD, np.radians(90), (30, 20))
    # A pixel at the edge is 5.4 columns wide, so a mean over its area is off by up to half a column of them.
    assert np.abs(view.radiance - 0.5).max() < 0.5 / 5.4


def test_a_lamp_in_view_keeps_its_light():
    radiance = np.full((128, 256, 3), 1e-3, np.float32)
    radiance[60, 130] = 1e4
    view = perspective_view(EnvironmentMap(radiance), AHEAD, np.radians(60), (48, 32))
    x, y = np.meshgrid((np.arange(48) + 0.5) / 24 - 1, (np.arange(32) + 0.5) / 24 - 32 / 48)
    tangent = np.tan(np.radians(30))
    angles = (tangent / 24) ** 2 / (1 + tangent**2 * (x**2 + y**2)) ** 1.5
    expected = 1e4 * LatLong().solid_angles(128)[60, 130]
    assert (view.radiance[..., 0] * angles).sum() == pytest.approx(expected, rel=2e-3)
    # 3.5° to the right and 4.9° up, by hand: 24 + 24 · tan 3.5° / tan 30° = 26.5, 16 − 24 · tan 4.9° / tan 30° = 12.4.
    assert np.unravel_index(view.radiance[..., 0].argmax(), (32, 48)) == (12, 26)


@pytest.mark.parametrize("mapping", [LatLong(), Angular()], ids=lambda m: m.name)
def test_a_view_put_back_changes_little_inside_and_nothing_outside(mapping):
    light = smooth(mapping)
    field, size = np.radians(60), (300, 200)
    view = perspective_view(light, ASIDE, field, size)
    back = insert_view(light, view, ASIDE, field)
    np.testing.assert_allclose(back.radiance, light.radiance, rtol=3e-3)
    marked = RadianceMap(view.radiance + np.float32(10), unit=view.unit)
    changed = np.any(insert_view(light, marked, ASIDE, field).radiance != light.radiance, axis=-1)
    towards = np.nan_to_num(mapping.directions(pixel_points(mapping, 128))) @ ASIDE
    ahead = towards[..., 2] < 0
    x, y = (towards[..., k] / np.where(ahead, -towards[..., 2], 1) / np.tan(field / 2) for k in (0, 1))
    assert not np.any(changed & ~(ahead & (abs(x) < 1) & (abs(y) < 2 / 3)))
    assert np.all(changed[ahead & (abs(x) < 0.9) & (abs(y) < 0.56)])
    assert np.array_equal(back.radiance[~changed], light.radiance[~changed])


def test_a_feathered_picture_goes_over_softly():
    light = smooth()
    picture = RadianceMap(np.full((100, 100, 3), 50, np.float32))
    hard, soft = (insert_view(light, picture, AHEAD, np.radians(80), f).radiance[64, :, 0] for f in (0, 0.4))
    assert hard[128] == soft[128] == 50
    assert np.abs(np.diff(hard)).max() > 40
    assert np.abs(np.diff(soft)).max() < 10


def test_marks_follow_the_picture():
    light = smooth()
    marks = np.full((50, 50), SATURATED, np.uint8)
    picture = RadianceMap(np.ones((50, 50, 3), np.float32), clipped=marks)
    back = insert_view(light, picture, AHEAD, np.radians(40))
    assert back.clipped is not None
    assert back.clipped[64, 128] == SATURATED
    assert back.clipped[64, 20] == 0
    covered = EnvironmentMap(light.radiance, clipped=np.full((128, 256), OUTSIDE, np.uint8))
    seen = insert_view(covered, RadianceMap(picture.radiance), AHEAD, np.radians(40)).clipped
    assert seen is not None
    assert (seen[64, 128], seen[64, 20]) == (0, OUTSIDE)
    view = perspective_view(covered, AHEAD, 1.0, (8, 8))
    assert view.clipped is not None
    assert np.all(view.clipped == OUTSIDE)


def test_wrong_calls_are_reported():
    light, picture = smooth(size=8), RadianceMap(np.ones((4, 4, 3), np.float32), unit="cd/m²")
    with pytest.raises(ValueError, match='picture is in "cd/m²" and the light in "relative"'):
        insert_view(light, picture, AHEAD, 1.0)
    with pytest.raises(ValueError, match="feather"):
        insert_view(light, RadianceMap(picture.radiance), AHEAD, 1.0, 0.6)
    with pytest.raises(ValueError, match="180°"):
        perspective_view(light, AHEAD, np.pi, (4, 4))
    with pytest.raises(ValueError, match="0×4"):
        perspective_view(light, AHEAD, 1.0, (0, 4))
    with pytest.raises(ValueError, match="orthonormal"):
        perspective_view(light, rotation_about([0, 1, 0], 1) * 2, 1.0, (4, 4))

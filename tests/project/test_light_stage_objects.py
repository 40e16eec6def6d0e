"""Objects from a light stage: their own pixels in the light of the place, over their meshes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from relume.errors import InvalidShot
from relume.image.radiance import RadianceMap
from relume.lightstage.novel_view.source_views import NewView
from relume.project.insertion.light_stage_objects import laid_over, with_stages
from relume.renderers.results import Change
from relume.scene.scene import Scene
from relume.sphere.environment_map import EnvironmentMap
from small_stages import ALBEDO, camera, normals, write_stage
from toml_files import shot_of

SHOT = """
[plate]
photographs = ["plate.exr"]
[camera]
pose = {{ position = [0, 0, 4], look_at = [0, 0, 0] }}
[light]
map = "light.exr"
[[objects]]
mesh = "ball.ply"
{object}
"""


def change_of(distance: np.ndarray) -> Change:
    """A grey ball that was rendered, as far away as reported."""
    matte = np.isfinite(distance).astype(np.float32)
    grey = np.float32(0.2) * matte[..., None].repeat(3, -1)
    depth = np.where(matte > 0, distance, 0).astype(np.float32)
    zeros = np.zeros_like(grey)
    return Change(grey, zeros, matte, depth, zeros, zeros, zeros + 1e-4, zeros)


def away() -> np.ndarray:
    """How far the ball is from the camera, with a little to spare; infinite beside it."""
    points = normals()
    return np.where(points.any(axis=-1), np.linalg.norm(points - camera().position, axis=-1) + 0.1, np.inf)


def seen_in(colour: tuple[float, float, float], alpha: np.ndarray) -> NewView:
    radiance = (np.zeros((*alpha.shape, 3)) + colour).astype(np.float32)
    return NewView(RadianceMap(radiance), alpha.astype(np.float32), (1 - alpha).astype(np.float32))


def test_what_the_stage_saw_takes_the_place_of_what_was_rendered():
    distance = np.full((4, 5), 3.0)
    distance[0] = np.inf
    alpha = np.isfinite(distance).astype(float)
    alpha[1] = 0.5
    found = laid_over(change_of(distance), seen_in((1.0, 0.5, 0.25), alpha), distance)
    np.testing.assert_allclose(found.objects[2, 0], [1.0, 0.5, 0.25])
    np.testing.assert_allclose(found.objects[1, 0], [0.6, 0.35, 0.225], rtol=1e-6)
    np.testing.assert_array_equal(found.objects[0], 0)
    np.testing.assert_allclose(found.objects_variance[2, 0], 0, atol=1e-9)


def test_what_another_object_hides_stays_hidden():
    distance = np.full((4, 5), 3.0)
    change = change_of(distance)
    change = replace(change, depth=np.where(np.arange(5) < 2, np.float32(2.0), change.depth))
    found = laid_over(change, seen_in((1.0, 1.0, 1.0), np.ones((4, 5))), distance)
    np.testing.assert_array_equal(found.objects[:, :2], change.objects[:, :2])
    np.testing.assert_array_equal(found.objects[:, 2:], 1)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("shot")
    trimesh.creation.icosphere(5).export(place / "ball.ply")
    write_stage(place / "stage", 60)
    return place


# slow: the ball that is not moved; the moved one, test_a_real_ball_in_even_light_shows_its_albedo_however_it_is_placed
# with rotate, goes red for the same break
@pytest.mark.parametrize(
    "placed",
    [pytest.param("", marks=pytest.mark.slow), "rotate = [0, 25, 0]\ntranslate = [0.05, 0, 0]\nscale = 1.02"],
)
def test_a_real_ball_in_even_light_shows_its_albedo_however_it_is_placed(placed, folder):
    shot = shot_of(folder, SHOT.format(object=f'stage = "stage"\n{placed}'))
    light = EnvironmentMap(np.full((32, 64, 3), 2.0, np.float32))
    ball = normals().any(axis=-1)
    found = with_stages(shot, Scene(light), camera(), change_of(away()))
    shown = np.abs(found.objects[ball] - 0.2).max(axis=-1) > 0.01
    assert shown.mean() > 0.8
    np.testing.assert_allclose(np.median(found.objects[ball][shown], axis=0), 2 * ALBEDO, rtol=0.04)


def test_the_light_of_the_place_comes_from_where_it_is(folder):
    shot = shot_of(folder, SHOT.format(object='stage = "stage"\nrotate = [0, 25, 0]'))
    radiance = np.full((32, 64, 3), 0.01, np.float32)
    radiance[10:22, 44:52] = 20  # to the right of the camera, +X
    ball = np.linalg.norm(normals(), axis=-1) > 0
    change = change_of(away())
    found = with_stages(shot, Scene(EnvironmentMap(radiance)), camera(), change).objects
    half = ball.shape[1] // 2
    assert found[:, half:][ball[:, half:]].mean() > 2 * found[:, :half][ball[:, :half]].mean()


@pytest.mark.parametrize(
    ("object", "said"),
    [
        ('stage_cameras = ["left"]', "give stage too"),
        ('stage = "stage"\ntime = 1.0', "leave time out"),
    ],
)
def test_a_table_that_contradicts_itself_is_refused(object, said, folder):
    with pytest.raises(InvalidShot, match=said):
        shot_of(folder, SHOT.format(object=object))

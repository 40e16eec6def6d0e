"""A subject from a new place, with direct light computed there: a matte ball, whose picture is known from anywhere."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from relume.lightstage.direct_light.light_directions import DirectedLight
from relume.lightstage.direct_light.model import DirectLightSettings
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.novel_view.new_views import direct_light_view
from relume.lightstage.novel_view.source_views import SourceView
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh
from small_stages import ALBEDO, camera, lit, normals

LIGHTS = even_directions(40)
SETTINGS = DirectLightSettings(alpha=0.3)


@pytest.fixture(scope="module")
def field() -> Pictures:
    values = np.stack([lit(direction) for direction in LIGHTS]).astype(np.float32)
    return Pictures(values, StageLights.towards(LIGHTS), camera())


@pytest.fixture(scope="module")
def ball() -> Mesh:
    sphere = trimesh.creation.icosphere(5)
    return Mesh(np.asarray(sphere.vertices, np.float32), np.asarray(sphere.faces, np.int32), Diffuse((0.5, 0.5, 0.5)),
                normals=np.asarray(sphere.vertices, np.float32))  # fmt: skip


def from_the_side(degrees: float, turned: float = 0.0) -> Camera:
    angle = np.radians(degrees)
    place = 4 * np.array([np.sin(angle), 0.0, np.cos(angle)])
    own = camera()
    return Camera.looking_at(place, np.zeros(3), width=32, height=24, focal_length=own.focal_length)


def parallel(*direction: float) -> DirectedLight:
    unit = np.array(direction) / np.linalg.norm(direction)
    return DirectedLight(unit[None], np.ones((1, 3)), np.zeros(1))


def test_light_between_the_lights_shades_the_ball_as_it_would_there(field, ball):
    new, light = from_the_side(30), parallel(0.3, 0.5, 0.8)
    found = direct_light_view(SourceView(field), light, new, ball, settings=SETTINGS)
    shown = normals(new, least=0.2)
    inner = shown.any(axis=-1) & (found.alpha == 1)
    assert inner.sum() > 60
    expected = np.maximum(shown @ light.directions[0], 0)[..., None] * ALBEDO / np.pi
    difference = np.abs(found.picture.radiance - expected)[inner]
    assert np.median(difference) < 0.01 * expected[inner].mean()
    # Rims of a ball 20 pixels across: their pixels in the source see other than what their middles show.
    assert difference.mean() < 0.05 * expected[inner].mean()


def test_what_the_cameras_did_not_see_is_a_hole(field, ball):
    with pytest.warns(UserWarning, match="no camera saw"):
        found = direct_light_view(SourceView(field), parallel(0, 0, 1), from_the_side(120), ball, settings=SETTINGS)
    assert found.unseen.sum() > found.alpha.sum() > 0
    np.testing.assert_array_equal(found.picture.radiance[found.alpha == 0], 0)


def test_lights_add(field, ball):
    new, one, other = from_the_side(20), parallel(1, 1, 1), parallel(-1, 0, 1)
    pictures = [
        direct_light_view(SourceView(field), light, new, ball, settings=SETTINGS).picture.radiance
        for light in (one, other, DirectedLight.of([one, other]))
    ]
    np.testing.assert_allclose(pictures[2], pictures[0] + pictures[1], atol=1e-6)


def test_two_sources_that_agree_give_what_one_gives(field, ball):
    new, light = from_the_side(15), parallel(0.2, 1, 1)
    alone = direct_light_view(SourceView(field), light, new, ball, settings=SETTINGS)
    both = direct_light_view([SourceView(field), SourceView(field)], light, new, ball, settings=SETTINGS)
    np.testing.assert_allclose(both.picture.radiance, alone.picture.radiance, atol=1e-6)


def test_no_source_is_refused(ball):
    with pytest.raises(ValueError, match="no source is given"):
        direct_light_view([], parallel(0, 0, 1), camera(), ball)

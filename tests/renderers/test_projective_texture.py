"""Photographs of a room projected onto its meshes: their own views, new ones, what hides, what nobody saw."""

from dataclasses import replace

import numpy as np
import pytest

import relume as rl
import virtual_place as place
from relume.renderers.projective.blending import blended
from relume.renderers.projective.photographs import hiding_edges, projectors
from relume.renderers.raytrace.raycast import RayCaster

DARK = rl.EnvironmentMap(np.zeros((4, 8, 3), np.float32))


@pytest.fixture(scope="module")
def taken():
    return place.photographs()


@pytest.fixture(scope="module")
def scene():
    return rl.Scene(DARK, local=place.meshes())


def test_a_photographs_own_camera_gives_it_back(taken, scene):
    for photograph in (taken[0], taken[2]):
        shown = rl.render(scene, photograph.camera, rl.renderers.ProjectiveTexture(taken))
        assert np.all(shown.matte == 1)
        assert place.decibels(shown.radiance, photograph.radiance.radiance) > 90


def test_views_between_are_the_room_where_it_was_seen(taken, scene):
    for eye, target in [((0.0, 1.6, 2.0), (0, 0.8, 0)), ((1.9, 1.2, 0.2), (-0.5, 0.7, 0))]:
        camera = place.camera(eye, target)
        shown = rl.render(scene, camera, rl.renderers.ProjectiveTexture(taken, samples=2))
        seen = shown.matte > 0.999
        assert seen.mean() > 0.9
        assert place.decibels(shown.radiance, place.seen_by(camera), seen) > 40


def test_what_stands_before_a_wall_does_not_bleed_onto_it(taken):
    # A red block before a wall, photographed once: none of the wall takes its colour, though it lies on the same rays.
    meshes = place.meshes()
    caster = RayCaster.of(meshes)
    camera = taken[0].camera
    of = caster.nearest(camera.position, camera.rays().reshape(-1, 3)).shape.reshape(120, 160)
    painted = np.where((of == 1)[..., None], [1.0, 0, 0], [0.0, 1.0, 0]).astype(np.float32)
    photograph = replace(taken[0], radiance=rl.RadianceMap(painted))
    scene = rl.Scene(DARK, local=meshes)
    view = place.camera((1.5, 1.4, 1.8), (-1, 0.5, 0))
    shown = rl.render(scene, view, rl.renderers.ProjectiveTexture((photograph,)))
    seen = shown.matte > 0
    on = caster.nearest(view.position, view.rays().reshape(-1, 3)).shape.reshape(120, 160)
    assert 0.3 < seen.mean() < 0.9  # the block's shadow is a hole
    wall = shown.radiance[seen & (on == 0)]
    assert np.mean(wall[:, 0] > 0.5) < 0.01
    assert wall[:, 0].mean() < 0.01
    # Holes continue the mesh that they lie in: the wall behind the block is green, and not the block's red.
    assert shown.radiance[(~seen) & (on == 0)][:, 0].mean() < 0.1


def test_photographs_blend_without_seams(taken):
    # Photographs of other exposures meet on walls: no two neighbouring pixels differ by much of that.
    flat = [
        replace(each, radiance=rl.RadianceMap(np.full((120, 160, 3), value, np.float32)))
        for each, value in zip(taken, (1.0, 2.0, 1.0, 2.0, 1.0), strict=True)
    ]
    view = place.camera((0, 1.5, 1.9), (0, 1.3, -2))
    scene = rl.Scene(DARK, local=place.meshes()[:1])
    shown = rl.render(scene, view, rl.renderers.ProjectiveTexture(tuple(flat)))
    step = np.abs(np.diff(shown.radiance[..., 0], axis=1))
    assert np.ptp(shown.radiance[..., 0]) > 0.3
    assert np.quantile(step, 0.995) < 0.15  # within a wall; from wall to wall nothing is promised


def test_nothing_leaps_as_another_photograph_comes_in(taken):
    # Along a line on a wall the say of each photograph goes by; the blend has no step where the set of three changes.
    flat = [
        replace(each, radiance=rl.RadianceMap(np.full((120, 160, 3), float(index), np.float32)))
        for index, each in enumerate(taken)
    ]
    among = projectors(flat, RayCaster.of(place.meshes()[:1]))
    x = np.linspace(-2.9, 2.9, 4000)
    points = np.stack([x, np.full_like(x, 1.2), np.full_like(x, -2.5)], axis=-1)
    normals = np.broadcast_to([0.0, 0, 1], points.shape)
    shown = blended(among, points, normals, place.camera((0, 1.5, 1.5)), 2)
    assert len(np.unique(shown.best)) > 1
    assert np.abs(np.diff(shown.radiance[shown.seen][:, 0])).max() < 0.05


def test_edges_that_hide_are_found_and_corners_of_a_room_are_none():
    camera = place.camera((0.3, 1.2, 2.0), (0, 0.6, -2.5))
    rays = camera.rays().reshape(-1, 3)

    def marked(meshes):
        hits = RayCaster.of(meshes).nearest(camera.position, rays)
        return hiding_edges(hits.distance.reshape(120, 160)) == 0, hits.shape.reshape(120, 160)

    assert not marked(place.meshes()[:1])[0].any()
    edges, shape = marked(place.meshes())
    # Where the block's side ends before the far wall, on both sides of its outline.
    row = shape[55] == 1
    left, right = np.flatnonzero(row)[[0, -1]]
    assert edges[55, [left - 1, left, right, right + 1]].all()
    assert edges[55].sum() <= 8


def test_saturated_pixels_speak_where_nobody_else_does_and_unknown_ones_never(taken):
    clipped = np.zeros((120, 160), np.uint8)
    clipped[:, :80] = 1
    black = replace(taken[0], radiance=rl.RadianceMap(np.zeros((120, 160, 3), np.float32), clipped=clipped))
    scene = rl.Scene(DARK, local=place.meshes())
    shown = rl.render(scene, taken[0].camera, rl.renderers.ProjectiveTexture((black, *taken[1:])))
    left = shown.radiance[20:100, 5:70]
    assert np.mean(left.mean(axis=-1) > 0.05) > 0.6  # others' colours, though this camera's own say black
    alone = rl.render(scene, taken[0].camera, rl.renderers.ProjectiveTexture((black,)))
    assert alone.matte.min() == 1
    outside = replace(black, radiance=replace(black.radiance, clipped=3 * clipped))
    assert rl.render(scene, taken[0].camera, rl.renderers.ProjectiveTexture((outside,))).matte[:, :70].max() == 0


def test_a_small_saturated_lamp_of_a_large_photograph_has_no_say():
    view = place.camera((1.5, 1.4, 1.8), width=2000, height=1500, focal_length=1000.0)
    clipped = np.zeros((1500, 2000), np.uint8)
    clipped[700:702, 901:903] = 1
    radiance = rl.RadianceMap(np.ones((1500, 2000, 3), np.float32), clipped=clipped)
    caster = RayCaster.of(place.meshes())
    (projector,) = projectors([rl.renderers.ProjectedPhotograph(view, radiance)], caster)
    pixels = np.array([[902.0, 701.0], [900.8, 700.5], [920.0, 701.0]])
    rays = view.rays_through(pixels)
    points = view.position + caster.nearest(view.position, rays).distance[:, None] * rays
    at, say = projector.sees(points)
    np.testing.assert_allclose(at, pixels, atol=1e-3)
    assert say[0] <= 1e-9 and say[1] <= 1e-9 and say[2] > 0.01


def test_beyond_the_meshes_the_light_is_seen(taken):
    sky = rl.EnvironmentMap(np.full((4, 8, 3), 7.0, np.float32))
    scene = rl.Scene(sky, local=place.meshes()[1:])
    shown = rl.render(scene, taken[0].camera, rl.renderers.ProjectiveTexture(taken))
    assert np.all(shown.radiance[0, 0] == 7) and shown.depth[0, 0] == 0 and shown.matte[0, 0] == 0


def test_what_cannot_be_shown_is_refused(taken, scene):
    renderer = rl.renderers.ProjectiveTexture(taken)
    with pytest.raises(rl.errors.UnsupportedScene, match="bake the place"):
        rl.render(scene.adding(place.meshes()[1]), taken[0].camera, renderer)
    with pytest.raises(rl.errors.UnsupportedScene, match="meshes"):
        rl.render(scene.with_local([rl.Plane(place.GREY)]), taken[0].camera, renderer)
    with pytest.raises(rl.errors.UnsupportedScene, match="aperture"):
        rl.render(scene, replace(taken[0].camera, aperture=0.1), renderer)
    with pytest.raises(ValueError, match="no photographs"):
        rl.render(scene, taken[0].camera, rl.renderers.ProjectiveTexture(()))
    with pytest.raises(ValueError, match="160×120 pixels, of a camera of 80×60"):
        rl.renderers.ProjectedPhotograph(taken[0].camera.resized(80, 60), taken[0].radiance, "hall.exr")
    with pytest.raises(ValueError, match="views 0"):
        rl.renderers.ProjectiveTexture(taken, views=0)

"""The tree of a pixel (Whitted 1980, Fig. 2 and 3) and the breakdown of §4."""

from __future__ import annotations

import numpy as np
import pytest

import relume as rl
from relume.renderers.whitted.kernel_data import EYE, REFLECTED, REFRACTED, SHADOW
from relume.renderers.whitted.ray_tree import breakdown, ray_tree
from relume.report.ray_tree_plot import tree_plot
from relume.scene.lights import AmbientLight, PointLight, Unattenuated
from relume.scene.materials.whitted import WhittedMaterial
from relume.virtual_camera.film.film import Film

SKY = rl.EnvironmentMap(np.full((4, 8, 3), [0.2, 0.4, 0.8], np.float32))
LAMP = PointLight((0, 10, 0), (np.pi, np.pi, np.pi), Unattenuated())


def two_mirrors() -> tuple[rl.Scene, rl.Camera]:
    """A grey floor that mirrors a half, and a mirror above it in which it is seen."""
    floor = rl.Plane(WhittedMaterial(diffuse=(0.4, 0.4, 0.4), specular=(0.5, 0.5, 0.5), highlight=(0, 0, 0)), (4, 4))
    wall = rl.scene.Polygon(
        np.array([[-2.0, 0, -1], [2, 0, -1], [2, 3, -1], [-2, 3, -1]]),
        WhittedMaterial(specular=(0.8, 0.8, 0.8), highlight=(0, 0, 0)),
        "wall",
    )
    camera = rl.Camera.looking_at(np.array([0, 1, 3.0]), np.array([0, 1, -1.0]), width=40, height=40, focal_length=40)
    return rl.Scene(SKY, (floor,), (wall,), (LAMP, AmbientLight((0.1, 0.1, 0.1)))), camera


def test_the_tree_of_a_mirrored_floor_is_what_eq_2_says_by_hand():
    scene, camera = two_mirrors()
    prepared = rl.Whitted(constellation=0).prepared(scene)
    # Towards the wall at (0, 0.5, −1): reflected to the floor at (0, 0, 3), outside its square; so down to the sky.
    y = 20 + 40 * 0.6 / 4
    tree = ray_tree(prepared, camera, (20, y))
    kinds = tree.kind.tolist()
    assert kinds[0] == EYE and tree.parent[0] == -1 and tree.shape[0] == 1
    np.testing.assert_allclose(tree.start[0], [0, 1, 3])
    np.testing.assert_allclose(tree.end[0], [0, 0.4, -1], atol=1e-12)
    # The wall stands at 90° to the lamp's right; its S ray meets the floor at z = −1 + 0.4/0.15.
    child = tree.children(0)
    s = child[tree.kind[child] == REFLECTED][0]
    np.testing.assert_allclose(tree.end[s], [0, 0, -1 + 0.4 / 0.15], atol=1e-12)
    assert tree.shape[s] == 0
    shadow = tree.children(s)[tree.kind[tree.children(s)] == SHADOW][0]
    place = tree.end[s]
    lambert = 0.4 * 10 / np.linalg.norm([0, 10, place[2]])
    np.testing.assert_allclose(tree.intensity[shadow], lambert, rtol=1e-12)
    on = tree.children(s)[tree.kind[tree.children(s)] == REFLECTED][0]
    np.testing.assert_allclose(tree.intensity[on], [0.2, 0.4, 0.8], rtol=1e-6)
    floor = 0.4 * 0.1 + lambert + 0.5 * np.array([0.2, 0.4, 0.8])
    np.testing.assert_allclose(tree.intensity[s], floor, rtol=1e-6)
    np.testing.assert_allclose(tree.intensity[0], 0.8 * floor, rtol=1e-6)
    np.testing.assert_allclose(tree.weight[s], 0.8, rtol=1e-12)
    assert len(kinds) == 4


def test_the_tree_adds_up_to_the_picture():
    scene, camera = two_mirrors()
    glass = rl.Sphere((0.2, 1, 0), 0.6, rl.Material(transmission=1.0, roughness=0.0), "glass")
    prepared = rl.Whitted(antialiasing=None).prepared(scene.adding(glass))
    picture = prepared.render(camera).radiance
    for column, row in ((20, 20), (24, 22), (10, 35)):
        tree = ray_tree(prepared, camera, (column + 0.5, row + 0.5))
        np.testing.assert_allclose(tree.intensity[0], picture[row, column], rtol=1e-6)
        np.testing.assert_allclose(tree.sent.sum(axis=0), picture[row, column], rtol=1e-6)
    assert REFRACTED in tree.kind or REFRACTED in ray_tree(prepared, camera, (24.5, 22.5)).kind


def test_a_light_behind_glass_is_dimmed_at_each_crossing():
    pane = rl.Sphere((0, 2, 0), 0.5, WhittedMaterial(transmission=(0.5, 0.25, 1.0)), "pane")
    floor = rl.Plane(WhittedMaterial(diffuse=(1.0, 1.0, 1.0)), (4, 4))
    camera = rl.Camera.looking_at(np.array([0, 1.0, 3.0]), np.zeros(3), width=20, height=20, focal_length=40)
    scene = rl.Scene(rl.EnvironmentMap(np.zeros((4, 8, 3), np.float32)), (floor,), (pane,), (LAMP,))
    tree = ray_tree(rl.Whitted(constellation=0).prepared(scene), camera, (10, 10))
    np.testing.assert_allclose(tree.intensity[0], [0.25, 0.0625, 1.0], rtol=1e-9)
    assert tree.kind.tolist() == [EYE, SHADOW, SHADOW, SHADOW]
    assert tree.parent.tolist() == [-1, 0, 1, 2]
    solid = rl.Whitted(constellation=0, clear_shadows=False).prepared(scene)
    np.testing.assert_array_equal(ray_tree(solid, camera, (10, 10)).intensity[0], 0)


def test_a_pixel_outside_the_picture_is_refused():
    scene, camera = two_mirrors()
    with pytest.raises(ValueError, match="pixel 50,3 lies outside the picture of 40×40"):
        ray_tree(rl.Whitted().prepared(scene), camera, (50, 3))


def test_the_breakdown_adds_up_and_most_of_a_mesh_is_intersection():
    random = np.random.default_rng(0)
    corners = random.normal(size=(3000, 1, 3)) * 0.7 + random.normal(size=(3000, 3, 3)) * 0.2
    faces = np.arange(9000).reshape(-1, 3).astype(np.int32)
    thorns = rl.Mesh(corners.reshape(-1, 3).astype(np.float32), faces, rl.Diffuse((0.5, 0.5, 0.5)))
    camera = rl.Camera.looking_at(np.array([0, 0.5, 4.0]), np.zeros(3), width=40, height=30, focal_length=40)
    shares = breakdown(rl.Whitted().prepared(rl.Scene(SKY, objects=(thorns,))), camera)
    assert shares.overhead + shares.intersection + shares.shading == pytest.approx(1)
    assert min(shares.overhead, shares.intersection, shares.shading) >= 0
    assert shares.intersection > 0.5
    assert shares.rays > 40 * 30
    assert shares.seconds > 0


@pytest.mark.parametrize(("format", "begin"), [("png", b"\x89PNG"), ("svg", b"<?xml")])
def test_the_drawing_is_a_picture_and_the_same_each_time(format, begin):
    scene, camera = two_mirrors()
    tree = ray_tree(rl.Whitted(constellation=0).prepared(scene), camera, (20, 26))
    drawn = tree_plot(tree, scene, Film(), "pixel 20,26", format=format)
    assert drawn.startswith(begin)
    if format == "svg":
        text = drawn.decode()
        for word in ("S: plane", "eye: wall", "S: sky", "L1"):
            assert word in text

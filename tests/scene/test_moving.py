"""Objects that turn: where they go, seen from above, and that what is painted on them goes with them."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import lights
from relume.renderers.prefiltered.filters import Plain
from relume.renderers.prefiltered.prefiltered import Prefiltered
from relume.renderers.turntable import Turntable, traced_frames
from relume.renderers.whitted.whitted import Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.lights import DistantLight
from relume.scene.materials.bumps import BumpMap, Wrinkles
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.materials.reflective import glossy
from relume.scene.materials.whitted import Checks, WhittedMaterial
from relume.scene.motion.moving_objects import ObjectOrbit, columns_turned, left_in_space, turned, turned_scene
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Patches, Polygon, Solid, Sphere, bounding_sphere, bounds
from relume.sphere.directions import UP, rotation_about

GREY = Diffuse((0.5, 0.5, 0.5))
QUARTER = rotation_about(UP, np.pi / 2)  # +X to −Z, as a clock does not
POINTS = np.array([[1, 0, 0], [1, 2, 0], [1, 0, 3]], np.float64)
AFTER = np.array([[1, 0, 0], [1, 2, 0], [4, 0, 0]], np.float64)
ABOUT = (1.0, 0.0, 0.0)
CAMERA = Camera(40, 40, 50.0, np.array([0, 0, 4.0]), np.eye(3))


def picture() -> np.ndarray:
    """A smooth image, other in every direction."""
    v, u = np.mgrid[0:32, 0:64] * (np.pi / 32)
    planes = [0.5 + 0.3 * np.cos(u), 0.5 + 0.3 * np.sin(u + 1), 0.5 + 0.3 * np.cos(v)]
    return np.stack(planes, axis=-1).astype(np.float32)


def middle(solid: Solid) -> tuple[float, float, float]:
    assert isinstance(solid, Sphere)
    return solid.centre


def test_a_mesh_turns_with_its_normals():
    mesh = Mesh(
        POINTS.astype("f4"), np.array([[0, 1, 2]], "i4"), GREY, np.array([[1, 0, 0], [0, 0, 1], [0, 1, 0]], "f4")
    )
    after = turned(mesh, QUARTER, ABOUT)
    assert isinstance(after, Mesh) and after.normals is not None
    assert after.vertices.dtype == after.normals.dtype == np.float32
    np.testing.assert_allclose(after.vertices, AFTER, atol=1e-6)
    np.testing.assert_allclose(after.normals, [[0, 0, -1], [1, 0, 0], [0, 1, 0]], atol=1e-6)
    assert mesh.vertices[2].tolist() == [1, 0, 3]  # the first stays as it was


def test_a_polygon_patches_and_a_sphere_turn():
    polygon = turned(Polygon(POINTS, GREY), QUARTER, ABOUT)
    assert isinstance(polygon, Polygon)
    np.testing.assert_allclose(polygon.vertices, AFTER, atol=1e-12)
    control = np.resize(POINTS, (1, 4, 4, 3))
    patches = turned(Patches(control, GREY), QUARTER, ABOUT)
    assert isinstance(patches, Patches) and patches.control.shape == (1, 4, 4, 3)
    np.testing.assert_allclose(patches.control, np.resize(AFTER, (1, 4, 4, 3)), atol=1e-12)
    ball = turned(Sphere((1, 0, 3), 0.5, GREY, "moon"), QUARTER, ABOUT)
    assert isinstance(ball, Sphere) and ball.material is GREY and (ball.radius, ball.name) == (0.5, "moon")
    assert ball.centre == pytest.approx((4, 0, 0))


def test_an_orbit_goes_counter_clockwise_seen_from_above_and_negative_turns_do_not():
    moon = Sphere((3, 1, 0), 0.5, GREY)
    places = [ObjectOrbit((1, 0, 0), 1).at(moon, share) for share in (0, 0.25, 0.5)]
    np.testing.assert_allclose([middle(p) for p in places], [[3, 1, 0], [1, 1, -2], [-1, 1, 0]], atol=1e-12)
    np.testing.assert_allclose(middle(ObjectOrbit((1, 0, 0), -2).at(moon, 0.125)), [1, 1, 2], atol=1e-12)


def test_columns_of_an_image_move_to_smaller_ones_and_share_what_falls_between():
    image = np.array([[0.0, 1.0, 2.0, 4.0]])
    assert columns_turned(image, np.pi / 2).tolist() == [[1, 2, 4, 0]]
    assert columns_turned(image, -np.pi / 2).tolist() == [[4, 0, 1, 2]]
    assert columns_turned(image, 2 * np.pi).tolist() == [[0, 1, 2, 4]]
    np.testing.assert_allclose(columns_turned(image, np.pi / 8), [[0.25, 1.25, 2.5, 3]])


@pytest.mark.parametrize(("angle", "allowed"), [(np.pi / 2, 2e-6), (1.234, 2e-3)])
@pytest.mark.parametrize(
    "material", [glossy(picture()), Material(picture(), roughness=1.0)], ids=["reflective", "metallic-roughness"]
)
def test_an_image_on_a_sphere_turns_with_it(material, angle: float, allowed: float):
    """`Prefiltered` turns what the camera sees; that has to be what it sees of what is turned."""
    ball, rotation, about = Sphere((0.5, 0, 0), 1.0, material), rotation_about(UP, angle), (0.2, 0.0, 0.0)
    light = lights.constant(16, 0.5)
    first = Prefiltered(Plain()).prepared(Scene(light, objects=(ball,))).render(CAMERA, turn=rotation, about=about)
    moved = turned(ball, rotation, about)
    second = Prefiltered(Plain()).prepared(Scene(light, objects=(moved,))).render(CAMERA)
    np.testing.assert_allclose(second.radiance, first.radiance, atol=allowed)
    still = Prefiltered(Plain()).prepared(Scene(light, objects=(ball,))).render(CAMERA)
    assert np.abs(still.radiance - first.radiance).max() > 0.1


def test_all_that_lies_on_a_sphere_turns_once():
    heights = np.arange(32.0).reshape(4, 8)
    with pytest.warns(UserWarning, match="creates energy"):
        paint = WhittedMaterial(np.repeat(heights[..., None], 3, -1), bumps=BumpMap(heights))
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # what was said is not said again
        ball = turned(Sphere((0, 0, 0), 1.0, paint), QUARTER)
    assert isinstance(ball.material, WhittedMaterial) and isinstance(ball.material.bumps, BumpMap)
    np.testing.assert_array_equal(ball.material.bumps.heights, np.roll(heights, -2, axis=1))
    np.testing.assert_array_equal(np.asarray(ball.material.diffuse)[..., 0], np.roll(heights, -2, axis=1))


def test_a_sphere_with_an_image_turns_about_the_vertical_only():
    tilt = rotation_about([1, 0, 0], 0.1)
    with pytest.raises(ValueError, match="'globe' is a sphere with an image, whose poles stand up"):
        turned(Sphere((0, 0, 0), 1.0, glossy(picture()), "globe"), tilt)
    assert middle(turned(Sphere((0, 0, 1), 1.0, glossy()), tilt)) == pytest.approx((0, -np.sin(0.1), np.cos(0.1)))


def test_what_lies_in_space_is_named():
    solids: list[Solid] = [
        Sphere((0, 0, 0), 1.0, WhittedMaterial(Checks()), "chequered"),
        Sphere((0, 0, 0), 1.0, WhittedMaterial(bumps=Wrinkles()), "wavy"),
        Sphere((0, 0, 0), 1.0, glossy(bumps=Wrinkles()), "satin"),
        Sphere((0, 0, 0), 1.0, WhittedMaterial(bumps=BumpMap(np.zeros((2, 2)))), "embossed"),
        Sphere((0, 0, 0), 1.0, GREY, "plain"),
    ]
    assert left_in_space(solids) == ["chequered", "wavy", "satin"]


def test_a_scene_that_does_not_turn_is_the_same_one():
    scene = Scene(lights.constant(4), objects=(Sphere((1, 0, 0), 1.0, GREY),))
    assert turned_scene(scene, np.eye(3), ABOUT) is scene
    assert middle(turned_scene(scene, QUARTER, (0, 0, 0)).objects[0]) == pytest.approx((0, 0, -1))


def test_the_box_and_the_sphere_round_solids():
    solids = [Sphere((1, 2, 3), 0.5, GREY), Polygon(POINTS, GREY), Patches(np.resize(POINTS - 1, (1, 4, 4, 3)), GREY)]
    assert bounds(solids).tolist() == [[0, -1, -1], [1.5, 2.5, 3.5]]
    assert bounds([]).tolist() == [[0, 0, 0], [0, 0, 0]]
    centre, radius = bounding_sphere(solids[1])
    assert centre.tolist() == [1, 1, 1.5] and radius == pytest.approx(np.sqrt(1 + 2.25))
    assert bounding_sphere(solids[0])[1] == 0.5
    # A mesh keeps what it found, and one that is moved has its own.
    mesh = Mesh(POINTS.astype(np.float32), np.array([[0, 1, 2]], np.int32), GREY)
    for moved in (0.0, 2.0):
        there = replace(mesh, vertices=mesh.vertices + np.float32(moved))
        for _ in range(2):
            centre, radius = bounding_sphere(there)
            assert (centre - moved).tolist() == [1, 1, 1.5] and radius == pytest.approx(np.sqrt(1 + 2.25))
            centre += 1  # of the caller's own
        assert (bounds([there]) - moved).tolist() == bounds([Polygon(POINTS, GREY)]).tolist()


def test_traced_frames_show_each_moment_of_a_scene_and_prepare_only_what_changed(monkeypatch):
    ball = Sphere((1, 0, 0), 0.5, Diffuse((1, 1, 1)))
    scene = Scene(lights.constant(4, 0.0), objects=(ball,), lights=(DistantLight((0, 0, 1), (3, 3, 3)),))
    made, prepare = [], Whitted.prepared
    monkeypatch.setattr(Whitted, "prepared", lambda self, scene: made.append(scene) or prepare(self, scene))
    method = Whitted(antialiasing=None, threads=1)
    still = list(traced_frames(method, lambda share: scene, CAMERA, None, 3))
    assert len(made) == 1 and np.array_equal(still[0].radiance, still[2].radiance)
    said: list[float] = []
    turning = list(traced_frames(method, lambda s: scene, CAMERA, Turntable(), 4, progress=said.append))
    assert len(made) == 1 + 4
    assert said == [0.25, 0.5, 0.75, 1]
    # The ball begins at the right, goes behind, to the left, and comes before the camera.
    across = [float(np.average(np.arange(40), weights=f.matte.sum(axis=0))) for f in turning]
    assert across[0] > 25 and across[2] < 14 and across[1] == pytest.approx(across[3], abs=0.5)
    assert turning[1].matte.sum() < turning[0].matte.sum() < turning[3].matte.sum()
    part = next(traced_frames(method, lambda s: scene, CAMERA, None, 1, region=(10, 5, 40, 25)))
    np.testing.assert_array_equal(part.radiance, still[0].radiance[5:25, 10:40])
    with pytest.raises(ValueError, match="0 frames; expected 1 or more"):
        next(traced_frames(method, lambda s: scene, CAMERA, None, 0))

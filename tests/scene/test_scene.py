"""Shapes and scenes: how far the walls of a distant scene are, and one line for what cannot be."""

import numpy as np
import pytest

from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Box, Dome, Enclosure, Scene
from relume.scene.shapes.shapes import Mesh, Plane
from relume.sphere.environment_map import EnvironmentMap

TRIANGLE = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), Diffuse((0.5, 0.5, 0.5)))


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((0, 3)), np.zeros((1, 3), int), r"vertices of 'thing' are \(0, 3\); expected \(N, 3\)"),
        (np.zeros((4, 2)), np.zeros((1, 3), int), r"vertices of 'thing' are \(4, 2\); expected \(N, 3\)"),
        (np.zeros((4, 3)), np.zeros((0, 3), int), r"faces of 'thing' are \(0, 3\); expected \(M, 3\)"),
        (np.zeros((4, 3)), np.zeros((2, 4), int), r"faces of 'thing' are \(2, 4\); expected \(M, 3\)"),
    ],
)
def test_a_mesh_of_the_wrong_shape_is_refused(vertices, faces, message):
    with pytest.raises(ValueError, match=message):
        Mesh(vertices, faces, Material(), name="thing")


def test_a_plane_without_size_reaches_the_horizon():
    assert Plane(Diffuse((0.5, 0.5, 0.5))).extent == (1000.0, 1000.0)
    assert Plane(Diffuse((0.5, 0.5, 0.5)), size=(2.0, 3.0)).extent == (2.0, 3.0)


def test_a_plane_of_no_size_is_refused():
    with pytest.raises(ValueError, match="expected two positive lengths in metres"):
        Plane(Diffuse((0.5, 0.5, 0.5)), size=(2.0, 0.0))


def test_a_scene_is_changed_by_making_another():
    light = EnvironmentMap(np.ones((2, 4, 3), np.float32))
    plane = Plane(Diffuse((0.5, 0.5, 0.5)))
    scene = Scene(light, local=(plane,))
    fuller = scene.adding(TRIANGLE).adding(TRIANGLE)
    assert (len(scene.objects), len(fuller.objects)) == (0, 2)
    assert fuller.without_objects().objects == ()
    assert fuller.without_objects().local == (plane,)
    assert scene.with_local([plane, TRIANGLE]).local == (plane, TRIANGLE)


def test_a_dome_is_as_far_as_its_radius_from_its_centre_and_nearer_beside_it():
    dome = Dome(2.0, (0.0, 1.0, 0.0))
    way = np.array([[1.0, 0, 0], [0, 1, 0], [0, -1, 0]])
    assert dome.distances(np.array([0.0, 1.0, 0.0]), way).tolist() == [2, 2, 2]
    assert dome.distances(np.array([0.0, 2.0, 0.0]), way) == pytest.approx([np.sqrt(3), 1, 3])


def test_a_boxs_walls_are_where_its_corners_are():
    box = Box((-1, 0, -2), (3, 2, 4))
    way = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1], [0.6, 0.8, 0]])
    found = box.distances(np.array([0.0, 0.5, 0.0]), way)
    assert found == pytest.approx([3, 1, 1.5, 0.5, 4, 2, 1.875])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Dome(0.0), "dome of radius 0.0"),
        (lambda: Dome(1.0, (0, np.nan, 0)), "expected metres"),
        (lambda: Box((0, 0, 0), (1, 0, 1)), "each of low below that of high"),
        (lambda: Enclosure(np.zeros((3, 2), np.float32), np.zeros((1, 3), np.int32)), r"expected \(N, 3\)"),
        (lambda: Enclosure(np.full((3, 3), np.inf, np.float32), np.zeros((1, 3), np.int32)), "NaN or infinity"),
    ],
)
def test_what_is_no_shape_is_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()

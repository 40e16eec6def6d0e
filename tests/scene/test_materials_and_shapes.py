"""Materials, shapes and scenes refuse what cannot be, and say what they expected."""

import numpy as np
import pytest

from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Plane
from relume.sphere.environment_map import EnvironmentMap

TRIANGLE = Mesh(np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], np.int32), Diffuse((0.5, 0.5, 0.5)))


def test_a_materials_defaults_are_those_of_gltf_for_a_dielectric():
    material = Material()
    assert (material.base_color, material.roughness, material.transmission, material.ior) == ((1, 1, 1), 1, 0, 1.5)


@pytest.mark.parametrize(
    ("field", "value"),
    [("base_color", (0.2, 1.5, 0)), ("metallic", -0.1), ("roughness", np.full((2, 2), 1.2)), ("transmission", 2.0)],
)
def test_a_material_outside_0_to_1_is_refused_by_field_and_name(field, value):
    with pytest.raises(ValueError, match=f"{field} of material 'tin' is .*expected 0 to 1"):
        Material(**{field: value}, name="tin")


def test_a_material_that_is_not_a_number_is_refused():
    with pytest.raises(ValueError, match="roughness of material 'tin' is nan"):
        Material(roughness=float("nan"), name="tin")


def test_a_texture_out_of_range_is_refused_in_one_line():
    with pytest.raises(ValueError, match="is an image from 0 to 3; expected") as caught:
        Material(np.arange(4 * 3, dtype=np.float32).reshape(2, 2, 3) % 4)
    assert "\n" not in str(caught.value)


def test_an_index_of_refraction_below_one_is_refused():
    with pytest.raises(ValueError, match=r"ior of material 'air' is 0\.9; expected 1 or more"):
        Material(ior=0.9, name="air")


@pytest.mark.parametrize("reflectance", [(0.5, 0.5), (0.5, 0.5, 1.01), (-0.1, 0, 0)])
def test_a_reflectance_that_would_make_light_is_refused(reflectance):
    with pytest.raises(ValueError, match="expected three numbers from 0 to 1"):
        Diffuse(reflectance)


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

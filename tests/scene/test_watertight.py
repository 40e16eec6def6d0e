"""Whether a mesh bounds a body, and whether a point lies in it."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
import trimesh

from relume.scene.materials.materials import Diffuse, Material
from relume.scene.shapes.shapes import Mesh
from relume.scene.shapes.watertight import facing_outwards, inside, watertightness

GLASS = Material(roughness=0.0, transmission=1.0)


def box(material=GLASS, split=False):
    body = trimesh.creation.box((2, 2, 2))
    vertices, faces = body.vertices, body.faces
    if split:
        # As exporters write it: each triangle with its own corners.
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(36).reshape(-1, 3)
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32), material, name="box")


@pytest.mark.parametrize("split", [False, True])
def test_a_box_is_closed_however_its_corners_are_stored(split):
    found = watertightness(box(split=split))
    assert (found.open_edges, found.crowded_edges, found.turned_edges, found.closed) == (0, 0, 0, True)
    assert found.volume == pytest.approx(8)


def test_a_box_without_a_triangle_has_three_open_edges():
    whole = box()
    mesh = replace(whole, faces=whole.faces[1:])
    assert watertightness(mesh).open_edges == 3
    with pytest.warns(UserWarning, match=r"mesh 'box' lets light in but does not bound a body \(3 open edges\).*thin"):
        assert facing_outwards(mesh) is mesh


def test_a_turned_triangle_has_three_turned_edges():
    mesh = box()
    mesh.faces[0] = mesh.faces[0][::-1]
    assert watertightness(mesh).turned_edges == 3
    with pytest.warns(UserWarning, match="3 edges wound both ways"):
        facing_outwards(mesh)


def test_a_fin_makes_an_edge_crowded():
    mesh = box()
    fin = np.array([[*mesh.faces[0][:2], len(mesh.vertices)]], np.int32)
    vertices = np.concatenate([mesh.vertices, [[3, 3, 3]]]).astype(np.float32)
    found = watertightness(replace(mesh, vertices=vertices, faces=np.concatenate([mesh.faces, fin])))
    assert (found.crowded_edges, found.open_edges) == (1, 2)


def test_two_bodies_that_touch_along_an_edge_are_closed():
    one = box()
    other = one.vertices + np.array([2, 2, 0], np.float32)
    both = replace(
        one, vertices=np.concatenate([one.vertices, other]), faces=np.concatenate([one.faces, one.faces + 8])
    )
    assert watertightness(both).closed


def test_triangles_without_area_open_nothing():
    mesh = box()
    sliver = np.array([[0, 0, 1]], np.int32)
    assert watertightness(replace(mesh, faces=np.concatenate([mesh.faces, sliver]))).closed


def test_glass_that_is_inside_out_is_turned_and_said():
    outside = box()
    inside_out = replace(outside, faces=outside.faces[:, ::-1].copy(), normals=-outside.vertices)
    assert watertightness(inside_out).volume == pytest.approx(-8)
    with pytest.warns(UserWarning, match="mesh 'box' lets light in and was inside out; it was turned"):
        turned = facing_outwards(inside_out)
    np.testing.assert_array_equal(turned.faces, outside.faces)
    np.testing.assert_array_equal(turned.normals, outside.vertices)


@pytest.mark.parametrize("material", [Material(), Diffuse((0.5, 0.5, 0.5)), replace(GLASS, thin=True)])
def test_what_lets_no_light_in_bent_may_be_open(material):
    mesh = replace(box(material), faces=box().faces[1:])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert facing_outwards(mesh) is mesh


def test_closed_glass_that_faces_outwards_stays_as_it_is():
    mesh = box()
    assert facing_outwards(mesh) is mesh


@pytest.mark.parametrize(
    ("point", "expected"),
    [((0, 0, 0), True), ((0.99, -0.99, 0.99), True), ((1.01, 0, 0), False), ((5, 5, 5), False)],
)
def test_a_point_is_inside_of_a_box_or_not(point, expected):
    assert inside(box(), np.array(point)) is expected


def test_the_middle_of_a_ring_is_outside_of_it():
    ring = trimesh.creation.torus(1.0, 0.25)
    mesh = Mesh(ring.vertices.astype(np.float32), ring.faces.astype(np.int32), GLASS)
    assert not inside(mesh, np.zeros(3))
    assert inside(mesh, np.array([1.0, 0.0, 0.0]))

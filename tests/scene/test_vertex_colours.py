"""Colours at vertices become textures that every renderer interpolates as straight as the colours themselves."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.visual import ColorVisuals

import gltf_files
from relume.image.colour import decode_srgb
from relume.scene.materials.materials import Material
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import Mesh
from relume.scene.shapes.vertex_colours import with_corner_colours, with_face_colours, with_vertex_colours

PLAIN = Material((0.5, 1.0, 1.0), roughness=0.5, name="tin")


def sphere(subdivisions: int = 2) -> Mesh:
    ball = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Mesh(ball.vertices.astype(np.float32), ball.faces.astype(np.int32), PLAIN, ball.vertices.astype(np.float32))


def looked_up(mesh: Mesh, weights: np.ndarray) -> np.ndarray:
    """(M, 3) bilinear look-ups in the base colour at barycentric weights (M, 3) of every face, v upwards."""
    assert mesh.uv is not None and isinstance(mesh.material, Material)
    image = np.asarray(mesh.material.base_color)
    rows, columns = image.shape[:2]
    u, v = np.einsum("mc,mcd->dm", weights, mesh.uv[mesh.faces].astype(np.float64))
    x, y = u * columns - 0.5, (1 - v) * rows - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    dx, dy = (x - left)[:, None], (y - top)[:, None]

    def at(row: np.ndarray, column: np.ndarray) -> np.ndarray:
        return image[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]

    upper = at(top, left) * (1 - dx) + at(top, left + 1) * dx
    return upper * (1 - dy) + (at(top + 1, left) * (1 - dx) + at(top + 1, left + 1) * dx) * dy


def test_a_look_up_is_the_straight_interpolation_of_three_colours():
    given, generator = sphere(), np.random.default_rng(7)
    colours = 0.5 + 0.4 * given.vertices  # smooth, as a scan's are
    mesh = with_vertex_colours(given, colours)
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], given.vertices[given.faces])
    for _ in range(5):
        weights = generator.dirichlet((1, 1, 1), len(given.faces))
        wanted = np.einsum("mc,mcd->md", weights, colours[given.faces]) * [0.5, 1, 1]
        assert np.abs(looked_up(mesh, weights) - wanted).max() < 1e-4
    assert mesh.normals is not None and np.allclose(mesh.normals, mesh.vertices, atol=1e-6)


def test_colours_as_far_apart_as_they_can_be_are_off_by_a_twelfth_at_most():
    given, generator = sphere(1), np.random.default_rng(8)
    colours = generator.integers(0, 2, (len(given.vertices), 3)).astype(np.float32)
    mesh = with_vertex_colours(given, colours)
    worst = 0.0
    for _ in range(20):
        weights = generator.dirichlet((1, 1, 1), len(given.faces))
        wanted = np.einsum("mc,mcd->md", weights, colours[given.faces]) * [0.5, 1, 1]
        worst = max(worst, float(np.abs(looked_up(mesh, weights) - wanted).max()))
    assert worst < 1 / 12 + 1e-3
    # The corners themselves are exact.
    for corner in range(3):
        np.testing.assert_allclose(
            looked_up(mesh, np.tile(np.eye(3)[corner], (len(given.faces), 1))),
            colours[given.faces[:, corner]] * [0.5, 1, 1], atol=1e-4,
        )  # fmt: skip


def test_faces_and_corners_have_colours_too_and_one_colour_needs_no_texture():
    given = sphere(0)
    colours = np.linspace(0, 1, 60).reshape(20, 3)
    weights = np.random.default_rng(9).dirichlet((1, 1, 1), 20)
    mesh = with_face_colours(given, colours)
    np.testing.assert_allclose(looked_up(mesh, weights), colours * [0.5, 1, 1], atol=1e-6)
    again = with_corner_colours(given, np.repeat(colours[:, None], 3, axis=1))
    assert isinstance(again.material, Material) and isinstance(mesh.material, Material)
    np.testing.assert_array_equal(again.material.base_color, mesh.material.base_color)
    even = with_vertex_colours(given, np.full((12, 3), 0.25))
    assert even.uv is None and even.faces is given.faces
    assert isinstance(even.material, Material) and even.material.base_color == (0.125, 0.25, 0.25)


# Files


def corners_of(mesh: Mesh) -> dict[tuple[float, ...], tuple[float, ...]]:
    """The base colour at each corner's place."""
    found = {}
    for corner in range(3):
        shown = looked_up(mesh, np.tile(np.eye(3)[corner], (len(mesh.faces), 1)))
        for place, colour in zip(mesh.vertices[mesh.faces[:, corner]], shown, strict=True):
            found[tuple(np.round(place, 3).tolist())] = tuple(np.round(colour, 3).tolist())
    return found


@pytest.mark.parametrize("kind", ["ply", "obj"])
def test_scans_are_codes_of_srgb(tmp_path: Path, kind: str):
    box = trimesh.creation.box((2, 2, 2))
    codes = np.rint(127.5 * (box.vertices + 1)).astype(np.uint8) // 2 + 40
    box.visual = ColorVisuals(box, vertex_colors=codes)
    box.export(tmp_path / f"box.{kind}")
    (mesh,) = read_meshes(tmp_path / f"box.{kind}")
    assert isinstance(mesh.material, Material) and mesh.material.metallic == 0
    found = corners_of(mesh)
    assert len(found) == 8
    light = {code: round(float(decode_srgb(np.array(code / 255))), 3) for code in (40, 167)}
    assert light == {40: 0.021, 167: 0.386}
    for place, colour in found.items():
        assert colour == pytest.approx([light[40 if each < 0 else 167] for each in place], abs=2e-3)


def test_a_ply_s_faces_may_have_them(tmp_path: Path):
    text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    text += "element face 2\nproperty list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\n"
    text += "property uchar blue\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n"
    (tmp_path / "a.ply").write_text(text)
    (mesh,) = read_meshes(tmp_path / "a.ply")
    shown = looked_up(mesh, np.full((2, 3), 1 / 3))
    np.testing.assert_allclose(shown, [[1, 0, 0], [0, 0, 1]], atol=1e-6)


@pytest.mark.parametrize("kind", [np.float32, np.uint8, np.uint16])
def test_those_of_gltf_are_linear_and_multiply_the_material(tmp_path: Path, kind: type):
    top = 1 if kind is np.float32 else np.iinfo(kind).max
    colours = (np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.2, 0.2, 0.2]]) * top).astype(kind)
    material = {"name": "tin", "pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1], "metallicFactor": 0}}
    (tmp_path / "a.glb").write_bytes(gltf_files.square_glb(material=material, colours=colours))
    (mesh,) = read_meshes(tmp_path / "a.glb")
    assert isinstance(mesh.material, Material) and mesh.material.name == "tin"
    found = sorted(corners_of(mesh).values())
    wanted = sorted([(0.5, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.1, 0.2, 0.2)])
    np.testing.assert_allclose(found, wanted, atol=3e-3)


def test_beside_textures_they_are_named_as_lost(tmp_path: Path):
    colours = np.eye(4, 3, dtype=np.float32)
    image = np.random.default_rng(0).integers(0, 255, (4, 4, 3), np.uint8)
    material = {"name": "tin", "pbrMetallicRoughness": {}}
    (tmp_path / "a.glb").write_bytes(gltf_files.square_glb(image=image, material=material, colours=colours))
    with pytest.warns(UserWarning, match='not rendered of material "tin": COLOR_0 beside textures'):
        read_meshes(tmp_path / "a.glb")


def test_a_million_triangles_take_four_texels_each():
    count = 2**18 + 1
    vertices = np.random.default_rng(0).normal(size=(1000, 3)).astype(np.float32)
    faces = np.random.default_rng(1).integers(0, 1000, (count, 3)).astype(np.int32)
    mesh = with_vertex_colours(Mesh(vertices, faces, replace(PLAIN)), np.abs(vertices) / 4)
    assert isinstance(mesh.material, Material)
    assert np.asarray(mesh.material.base_color).shape[:2] == (2 * 512, 2 * 513)


def test_colours_that_no_surface_has_are_cut_with_a_warning():
    given = replace(sphere(1), name="scan")
    bright = np.full((len(given.vertices), 3), 0.5)
    bright[3] = 4.0
    with pytest.warns(UserWarning, match=r"scan: vertex colours such as 4 are cut to 0 … 1"):
        with_vertex_colours(given, bright)
    with pytest.warns(UserWarning, match=r"such as -0\.5 are cut"):
        with_corner_colours(given, np.full((len(given.faces), 3, 3), -0.5))
    bright[3] = np.nan
    with pytest.warns(UserWarning, match="no numbers, and count as black"):
        mesh = with_vertex_colours(given, bright)
    assert isinstance(mesh.material, Material) and np.isfinite(mesh.material.base_color).all()

"""Normals of meshes that have none: curved surfaces are shaded smooth, edges stay edges."""

import numpy as np
import pytest
import trimesh

from relume.errors import InvalidShot
from relume.project.shot_file.objects import placed_meshes
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh
from relume.scene.shapes.smoothing import smoothed as smoothed_together
from toml_files import FAR_CAMERA, SCENE_BALL, SHOT_HEAD, refusal, scene_of, shot_of


def smoothed(mesh, degrees):
    (found,) = smoothed_together([mesh], degrees)
    return found


def mesh_of(shape, *, apart=False):
    """A shape of trimesh, each of its triangles by itself as an .stl has them or sharing their corners."""
    vertices, faces = np.asarray(shape.vertices), np.asarray(shape.faces)
    if apart:
        vertices, faces = vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    return Mesh(vertices.astype(np.float32), faces.astype(np.int32), Material())


def normals_of(mesh):
    assert mesh.normals is not None
    return mesh.normals


def face_normals(mesh):
    a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    across = np.cross(b - a, c - a)
    return across / np.linalg.norm(across, axis=1, keepdims=True)


@pytest.mark.parametrize("apart", [False, True])
def test_a_ball_of_facets_has_the_normals_of_a_ball(apart):
    ball = smoothed(mesh_of(trimesh.creation.icosphere(2, 0.3), apart=apart), 30)
    radial = ball.vertices / np.linalg.norm(ball.vertices, axis=1, keepdims=True)
    # Its faces lean away from the ball by up to 9°.
    assert np.degrees(np.arccos(np.clip((face_normals(ball)[:, None] * radial[ball.faces]).sum(-1), -1, 1))).max() > 8
    assert np.degrees(np.arccos(np.clip((normals_of(ball) * radial).sum(1), -1, 1))).max() < 1.0
    np.testing.assert_allclose(np.linalg.norm(normals_of(ball), axis=1), 1, atol=1e-6)


def test_each_face_stays_where_it_was_and_so_do_its_texture_coordinates():
    plain = mesh_of(trimesh.creation.icosphere(1))
    uv = np.random.default_rng(3).random((len(plain.vertices), 2)).astype(np.float32)
    plain = Mesh(plain.vertices, plain.faces, plain.material, None, uv, "ball")
    ball = smoothed(plain, 180)
    assert np.array_equal(ball.vertices[ball.faces], plain.vertices[plain.faces])
    assert ball.uv is not None and np.array_equal(ball.uv[ball.faces], uv[plain.faces])
    assert (ball.material, ball.name) == (plain.material, "ball")


def test_the_edges_of_a_cube_stay_sharp_until_they_are_asked_to_be_round():
    cube = mesh_of(trimesh.creation.box((1, 1, 1)))
    sharp = smoothed(cube, 30)
    np.testing.assert_allclose(normals_of(sharp)[sharp.faces], np.repeat(face_normals(cube)[:, None], 3, 1), atol=1e-7)
    # Three faces meet at a corner, by a right angle each, into however many triangles they are cut.
    round_ = smoothed(cube, 180)
    np.testing.assert_allclose(normals_of(round_), np.sign(round_.vertices) / np.sqrt(3), atol=1e-6)


def test_a_can_is_round_about_and_flat_above():
    can = smoothed(mesh_of(trimesh.creation.cylinder(1, 2, sections=32)), 30)  # its axis is z
    across = np.repeat(np.abs(face_normals(can)[:, 2]) > 0.5, 3)
    np.testing.assert_allclose(np.abs(normals_of(can)[across]), np.tile([0, 0, 1], (across.sum(), 1)), atol=1e-7)
    radial = can.vertices[~across] * [1, 1, 0]
    np.testing.assert_allclose(
        normals_of(can)[~across], radial / np.linalg.norm(radial, axis=1, keepdims=True), atol=1e-5
    )


def test_an_angle_is_that_of_the_normals_and_corners_count_by_their_angles():
    # Two triangles that meet along the x axis, one level, the other risen by 20°, which is as much as 60° wide there.
    rise, far = np.radians(20.0), np.sqrt(3.0)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 0, 1], [1, far * np.sin(rise), -far * np.cos(rise)]])
    roof = Mesh(corners.astype(np.float32), np.array([[0, 2, 1], [0, 1, 3]], np.int32), Material())
    one, other = face_normals(roof)
    assert one @ other == pytest.approx(np.cos(rise))
    flat = smoothed(roof, 19.9)
    np.testing.assert_allclose(normals_of(flat), np.repeat([one, other], 3, 0), atol=1e-6)
    bent = smoothed(roof, 20.1)
    mean = 90 * one + 60 * other
    for corner in (0, 3):  # both stand at the origin
        np.testing.assert_allclose(normals_of(bent)[corner], mean / np.linalg.norm(mean), atol=1e-6)
    np.testing.assert_allclose(normals_of(bent)[1], one, atol=1e-6)


@pytest.mark.parametrize("shape", [trimesh.creation.icosphere(1), trimesh.creation.cone(1, 2, sections=32)])
def test_no_jump_is_left_on_an_edge_that_is_less_sharp(shape):
    # Coarse ones, about whose corners faces turn by more than 30° though none of their own edges does.
    mesh = mesh_of(shape)
    found, sharp = smoothed(mesh, 30), 0
    normals = normals_of(found)[found.faces]
    for (one, other), angle in zip(shape.face_adjacency, shape.face_adjacency_angles, strict=True):
        for place in set(mesh.faces[one]) & set(mesh.faces[other]):
            jump = normals[one][mesh.faces[one] == place] - normals[other][mesh.faces[other] == place]
            assert (np.abs(jump).max() < 1e-6) == (np.degrees(angle) < 30)
            sharp += np.degrees(angle) >= 30
    assert sharp == (0 if len(mesh.faces) == 80 else 64)  # about the cone's foot


def test_a_ball_that_its_file_splits_by_materials_is_one():
    ball = mesh_of(trimesh.creation.icosphere(2))
    left = ball.vertices[ball.faces].mean(1)[:, 0] < 0
    halves = [Mesh(ball.vertices, ball.faces[each], Material()) for each in (left, ~left)]
    whole = normals_of(smoothed(ball, 30)).reshape(-1, 3, 3)
    for half, mine in zip(smoothed_together(halves, 30), (left, ~left), strict=True):
        np.testing.assert_allclose(normals_of(half).reshape(-1, 3, 3), whole[mine], atol=1e-6)


def test_the_two_sides_of_a_sheet_keep_their_own():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    sheet = smoothed(Mesh(corners, np.array([[0, 1, 2], [0, 2, 1]], np.int32), Material()), 180)
    assert np.array_equal(normals_of(sheet), np.repeat([[0, 0, 1], [0, 0, -1]], 3, 0))


def test_a_triangle_without_area_spoils_no_normal():
    ball = mesh_of(trimesh.creation.icosphere(1))
    faces = np.concatenate([ball.faces, [[0, 0, 1], [2, 2, 2]]]).astype(np.int32)
    found = smoothed(Mesh(ball.vertices, faces, Material()), 60)
    np.testing.assert_allclose(normals_of(found)[:-6], normals_of(smoothed(ball, 60)), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(normals_of(found), axis=1), 1, atol=1e-6)


# --- the files' key ---------------------------------------------------------------------------------------------------


@pytest.fixture
def facets(tmp_path):
    """A folder that holds a ball without normals."""
    trimesh.creation.icosphere(2, 0.05).export(tmp_path / "ball.stl")
    return tmp_path


def test_a_shot_smooths_what_it_says(facets):
    shot = SHOT_HEAD + '[[objects]]\nmesh = "ball.stl"\n'
    (flat,) = placed_meshes(shot_of(facets, shot))
    assert flat.normals is None
    (ball,) = placed_meshes(shot_of(facets, shot + "smooth = 30\nrotate = [0, 40, 0]\nsize = 0.2\n"))
    middle = (ball.vertices.min(0) + ball.vertices.max(0)) / 2
    assert ((ball.vertices - middle) * normals_of(ball)).sum(1).min() > 0.0995
    with pytest.raises(InvalidShot, match="smooth"):
        shot_of(facets, shot + "smooth = 0\n")
    with pytest.raises(InvalidShot, match="light stage shows its own pixels; leave smooth out"):
        shot_of(facets, shot + 'smooth = 30\nstage = "stage"\n')


LAMP = '[[lights]]\nkind = "point"\nposition = [0, 3, 0]\nintensity = 5\n'


def test_a_scene_does_and_only_of_meshes(facets):
    scene = FAR_CAMERA + LAMP + '[[objects]]\nmesh = "ball.stl"\n'
    (flat,), (ball,) = (scene_of(facets, scene + key).scene.objects for key in ("", "smooth = 30\n"))
    assert isinstance(flat, Mesh) and isinstance(ball, Mesh)
    assert flat.normals is None
    assert (ball.vertices * normals_of(ball)).sum(1).min() > 0.0499
    ball_of_its_own = f'{FAR_CAMERA}{LAMP}[materials.ball]\nkind = "mirror"\n{SCENE_BALL}smooth = 30\n'
    assert refusal(facets, ball_of_its_own) == "objects.0: has smooth, which is of a mesh; remove smooth"

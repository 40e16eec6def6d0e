"""Laying the photograph on real surfaces: nothing is lost, and the texture is right to a tenth of a pixel."""

import numpy as np
import pytest

from relume.composite.surface.projection import box_mesh, projected, triangles_of_shape
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh, Plane, Polygon, Shape, Sphere

GREY = Diffuse((0.5, 0.5, 0.5))
CAMERA = Camera.looking_at(np.array([0.1, 0.6, 1.2]), np.zeros(3), width=192, height=128, focal_length=175.0)
BOX = box_mesh((-0.1, 0.0, -0.1), (0.1, 0.2, 0.1), GREY)
TABLE = Plane(GREY, (1.7, 1.0))


def area(mesh: Mesh | None) -> float:
    if mesh is None:
        return 0.0
    a, b, c = np.moveaxis(np.asarray(mesh.vertices, np.float64)[mesh.faces], 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=-1).sum() / 2)


def random_points(mesh: Mesh, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points on triangles and their texture coordinates."""
    random = np.random.default_rng(1)
    face = random.integers(0, len(mesh.faces), count)
    weights = random.dirichlet(np.ones(3), count)
    corners = np.asarray(mesh.vertices, np.float64)[mesh.faces[face]]
    assert mesh.uv is not None
    return np.einsum("nk,nkc->nc", weights, corners), np.einsum("nk,nkc->nc", weights, mesh.uv[mesh.faces[face]])


@pytest.mark.parametrize(
    ("shape", "others"),
    [
        (TABLE, ()),
        (Plane(GREY), ()),
        (TABLE, (BOX,)),
        (BOX, (TABLE,)),
        (Sphere((0.1, 0.1, 0.0), 0.1, GREY), ()),
        (Polygon(np.array([[0, 0, 0], [0.3, 0, 0], [0.3, 0.3, 0], [0.1, 0.1, 0]], float), GREY), ()),
    ],
    ids=["table", "horizon", "table-under-box", "box", "sphere", "polygon"],
)
def test_the_parts_make_the_whole_and_the_texture_is_the_projection(shape: Shape, others: tuple[Shape, ...]):
    parts = projected(shape, CAMERA, others)
    assert parts.seen is not None
    assert area(parts.seen) + area(parts.unseen) == pytest.approx(area(triangles_of_shape(shape)), rel=1e-5)
    points, uv = random_points(parts.seen, 5000)
    at = CAMERA.project(points)
    shown = uv * [192, -128] + [0, 128]
    assert np.linalg.norm(at - shown, axis=-1).max() < 0.2  # a tenth along edges, a little more within
    assert np.all((at > -0.2) & (at < [192.2, 128.2]))


def test_nothing_that_the_frame_shows_is_left_out():
    """Every pixel's ray that meets the table meets the seen part, but for a pixel along the outline of the box."""
    from scipy.ndimage import binary_dilation

    from relume.renderers.raytrace.raycast import RayCaster

    parts = projected(TABLE, CAMERA, (BOX,))
    assert parts.seen is not None and parts.unseen is not None
    rays, eye = CAMERA.rays().reshape(-1, 3), np.array(CAMERA.position)
    truth = RayCaster.of([TABLE, BOX]).nearest(eye, rays).shape.reshape(128, 192)
    split = RayCaster.of([parts.seen, parts.unseen, BOX]).nearest(eye, rays).shape.reshape(128, 192)
    on_table, on_box = truth == 0, truth == 2 - 1
    beside = np.asarray(binary_dilation(on_box, np.ones((3, 3), bool), 2), bool)
    assert np.all(split[on_table & ~beside] == 0)
    assert np.array_equal(split == 2, on_box)
    hidden = CAMERA.project(np.array([[0.0, 0.0, -0.12]]))[0].astype(int)
    behind = projected(TABLE, CAMERA, (BOX,)).unseen
    assert behind is not None and truth[hidden[1], hidden[0]] == 1
    assert np.any(np.linalg.norm(behind.vertices - np.array([0.0, 0.0, -0.12]), axis=-1) < 0.05)


def test_what_the_camera_does_not_see_stays_whole():
    away = Camera.looking_at(
        np.array([0.0, 0.6, 0.0]), np.array([0.0, 5.0, 1.0]), width=64, height=48, focal_length=60.0
    )
    parts = projected(TABLE, away)
    assert parts.seen is None and parts.unseen is not None
    assert area(parts.unseen) == pytest.approx(1.7)


def test_too_few_triangles_are_reported(monkeypatch):
    monkeypatch.setattr("relume.composite.surface.projection.MOST", 100)
    with pytest.warns(UserWarning, match="triangles do not follow the photograph"):
        projected(Plane(GREY), CAMERA)


def test_a_box_is_closed_and_faces_outwards():
    a, b, c = np.moveaxis(np.asarray(BOX.vertices, np.float64)[BOX.faces], 1, 0)
    normal = np.cross(b - a, c - a)
    assert np.all((normal * (a - np.array([0.0, 0.1, 0.0]))).sum(-1) > 0)
    assert area(BOX) == pytest.approx(6 * 0.04)
    assert np.einsum("nc,nc->", a, normal) / 6 == pytest.approx(0.008)
    with pytest.raises(ValueError, match="expected each of low below that of high"):
        box_mesh((0, 0, 0), (1, 0, 1), GREY)

"""The Cornell box (Goral et al. 1984; the data measured in 1998 at Cornell's Program of Computer Graphics), in metres.

Vertices are the published ones, in millimetres, over a thousand. Reflectances and the lamp's radiance are those of the
published spectra in linear Rec. 709 as McGuire's Computer Graphics Archive gives them. The ceiling has a hole where
the lamp is, for two surfaces in one plane are no scene; the lamp shines downward alone.
"""

from __future__ import annotations

import numpy as np

from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh
from relume.sphere.environment_map import EnvironmentMap

WHITE, RED, GREEN = (0.725, 0.71, 0.68), (0.63, 0.065, 0.05), (0.14, 0.45, 0.091)
LAMP = (17.0, 12.0, 4.0)
"""Radiance of the lamp; it reflects as the walls do."""
WALLS = ("floor", "ceiling", "back", "right", "left", "short block", "tall block")

_FLOOR = [[552.8, 0, 0], [0, 0, 0], [0, 0, 559.2], [549.6, 0, 559.2]]
_BACK = [[549.6, 0, 559.2], [0, 0, 559.2], [0, 548.8, 559.2], [556, 548.8, 559.2]]
_RIGHT = [[0, 0, 559.2], [0, 0, 0], [0, 548.8, 0], [0, 548.8, 559.2]]
_LEFT = [[552.8, 0, 0], [549.6, 0, 559.2], [556, 548.8, 559.2], [556, 548.8, 0]]
_LAMP = [[343, 548.8, 227], [343, 548.8, 332], [213, 548.8, 332], [213, 548.8, 227]]
_SHORT = (165, [[130.0, 65.0], [82.0, 225.0], [240.0, 272.0], [290.0, 114.0]])
_TALL = (330, [[423.0, 247.0], [265.0, 296.0], [314.0, 456.0], [472.0, 406.0]])


def cornell_box(*, blocks: bool = True, lamp: tuple[float, float, float] = LAMP) -> Scene:
    """The room as the local scene and the two blocks as objects, lit by nothing but the lamp in its ceiling.

    blocks : whether they are there
    lamp : its radiance
    """
    white = Diffuse(WHITE)
    shining = Material(WHITE, specular=0.0, emission=lamp, name="lamp")
    room = (
        _quad(_FLOOR, white, "floor"),
        _ceiling(white),
        _quad(_BACK, white, "back"),
        _quad(_RIGHT, Diffuse(GREEN), "right"),
        _quad(_LEFT, Diffuse(RED), "left"),
        _quad(_LAMP, shining, "lamp"),
    )
    both = (_block(*_SHORT, white, "short block"), _block(*_TALL, white, "tall block"))
    return Scene(EnvironmentMap(np.zeros((2, 4, 3), np.float32)), room, both if blocks else ())


def cornell_camera(size: int = 64) -> Camera:
    """The published camera, which looks into the open side; `size` pixels each way."""
    eye = np.array([0.278, 0.273, -0.8])
    return Camera.looking_at(eye, np.add(eye, [0, 0, 1]), width=size, height=size, focal_length=size * 35 / 25)


def _quad(corners: list[list[float]], material: Diffuse | Material, name: str) -> Mesh:
    """Two triangles between four corners, counter-clockwise from inside the box."""
    vertices = (np.array(corners, np.float64) / 1000).astype(np.float32)
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), material, name=name)


def _ceiling(material: Diffuse) -> Mesh:
    """The ceiling round the lamp: eight rectangles between three strips each way."""
    x, z = np.meshgrid([0, 213, 343, 556], [0, 227, 332, 559.2], indexing="ij")
    vertices = np.stack([x, np.full(x.shape, 548.8), z], axis=-1).reshape(-1, 3) / 1000
    faces = []
    for i in range(3):
        for j in range(3):
            if (i, j) != (1, 1):
                a, b, c, d = 4 * i + j, 4 * (i + 1) + j, 4 * (i + 1) + j + 1, 4 * i + j + 1
                faces += [[a, b, c], [a, c, d]]
    return Mesh(vertices.astype(np.float32), np.array(faces, np.int32), material, name="ceiling")


def _block(height: float, base: list[list[float]], material: Diffuse, name: str) -> Mesh:
    """A block on the floor without a bottom, which nothing sees; base in x and z, counter-clockwise from above."""
    low = np.array([[x, 0, z] for x, z in base])
    vertices = np.concatenate([low, np.add(low, [0, height, 0])]) / 1000
    sides = [[i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i] for i in range(4)] + [[4, 5, 6, 7]]
    faces = [part for a, b, c, d in sides for part in ([a, b, c], [a, c, d])]
    return Mesh(vertices.astype(np.float32), np.array(faces, np.int32), material, name=name)

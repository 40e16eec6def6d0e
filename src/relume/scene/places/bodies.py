"""The bodies that places are built of, each in a unit cube with names for its corners and edges.

A block is its body stretched to the block's width, height and depth, so that its points are linear in what is sought.
In the cube x runs from left to right, y from the bottom to the top and z from the back to the front.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

ROUND = 96
"""Straight pieces of a whole circle: they lie within 0.0005 of its radius."""
Ring = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Body:
    """A body in the unit cube.

    vertices : (N, 3)
    faces : rings of vertices, counter-clockwise from outside; flat and convex
    edges : vertices along each named edge; two of a straight one
    corners : a vertex each
    flat : the axis along which it has no extent, 0 to 2; None for a solid
    """

    vertices: np.ndarray
    faces: tuple[Ring, ...]
    edges: dict[str, Ring]
    corners: dict[str, int]
    flat: int | None = None

    @property
    def triangles(self) -> np.ndarray:
        """The triangles (M, 3) int32, each face as a fan."""
        return np.array([(ring[0], b, c) for ring in self.faces for b, c in pairwise(ring[1:])],
                        np.int32)  # fmt: skip


_BOTTOM = {
    "back_left_bottom": (0, 0, 0), "back_right_bottom": (1, 0, 0),
    "front_right_bottom": (1, 0, 1), "front_left_bottom": (0, 0, 1),
}  # fmt: skip
_BOTTOM_EDGES = {
    "back_bottom": ("back_left_bottom", "back_right_bottom"),
    "right_bottom": ("back_right_bottom", "front_right_bottom"),
    "front_bottom": ("front_left_bottom", "front_right_bottom"),
    "left_bottom": ("back_left_bottom", "front_left_bottom"),
}
_FLOOR = ("back_left_bottom", "back_right_bottom", "front_right_bottom", "front_left_bottom")


def _named(
    corners: Mapping[str, Sequence[float]],
    edges: dict[str, tuple[str, str]],
    faces: Sequence[tuple[str, ...]],
    flat: int | None = None,
) -> Body:
    """A body from its corners' names."""
    index = {name: i for i, name in enumerate(corners)}
    return Body(
        np.array(list(corners.values()), np.float64),
        tuple(tuple(index[name] for name in face) for face in faces),
        {name: (index[a], index[b]) for name, (a, b) in edges.items()},
        index,
        flat,
    )


def _box() -> Body:
    top = {name.replace("bottom", "top"): (x, 1, z) for name, (x, _, z) in _BOTTOM.items()}
    edges = _BOTTOM_EDGES | {
        name.replace("bottom", "top"): (a.replace("bottom", "top"), b.replace("bottom", "top"))
        for name, (a, b) in _BOTTOM_EDGES.items()
    }
    edges |= {name.removesuffix("_bottom"): (name, name.replace("bottom", "top")) for name in _BOTTOM}
    ring = list(_BOTTOM)
    sides = [(b, a, a.replace("bottom", "top"), b.replace("bottom", "top"))
             for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]  # fmt: skip
    lid = tuple(name.replace("bottom", "top") for name in reversed(_FLOOR))
    return _named(_BOTTOM | top, edges, [_FLOOR, lid, *sides])


def _roof() -> Body:
    """Its ridge runs from left to right."""
    corners = _BOTTOM | {"left_ridge": (0, 1, 0.5), "right_ridge": (1, 1, 0.5)}
    edges = _BOTTOM_EDGES | {
        "ridge": ("left_ridge", "right_ridge"),
        "front_left": ("front_left_bottom", "left_ridge"), "front_right": ("front_right_bottom", "right_ridge"),
        "back_left": ("back_left_bottom", "left_ridge"), "back_right": ("back_right_bottom", "right_ridge"),
    }  # fmt: skip
    faces = [
        _FLOOR,
        ("front_left_bottom", "front_right_bottom", "right_ridge", "left_ridge"),
        ("back_right_bottom", "back_left_bottom", "left_ridge", "right_ridge"),
        ("back_left_bottom", "front_left_bottom", "left_ridge"),
        ("front_right_bottom", "back_right_bottom", "right_ridge"),
    ]
    return _named(corners, edges, faces)


def _gable() -> Body:
    """A roof whose ridge runs from the back to the front."""
    corners = _BOTTOM | {"back_ridge": (0.5, 1, 0), "front_ridge": (0.5, 1, 1)}
    edges = _BOTTOM_EDGES | {
        "ridge": ("back_ridge", "front_ridge"),
        "front_left": ("front_left_bottom", "front_ridge"), "front_right": ("front_right_bottom", "front_ridge"),
        "back_left": ("back_left_bottom", "back_ridge"), "back_right": ("back_right_bottom", "back_ridge"),
    }  # fmt: skip
    faces = [
        _FLOOR,
        ("front_left_bottom", "front_right_bottom", "front_ridge"),
        ("back_right_bottom", "back_left_bottom", "back_ridge"),
        ("back_left_bottom", "front_left_bottom", "front_ridge", "back_ridge"),
        ("front_right_bottom", "back_right_bottom", "back_ridge", "front_ridge"),
    ]
    return _named(corners, edges, faces)


def _wedge() -> Body:
    """It rises from the front to the back."""
    corners = _BOTTOM | {"back_left_top": (0, 1, 0), "back_right_top": (1, 1, 0)}
    edges = _BOTTOM_EDGES | {
        "back_top": ("back_left_top", "back_right_top"),
        "back_left": ("back_left_bottom", "back_left_top"), "back_right": ("back_right_bottom", "back_right_top"),
        "left_slope": ("front_left_bottom", "back_left_top"),
        "right_slope": ("front_right_bottom", "back_right_top"),
    }  # fmt: skip
    faces = [
        _FLOOR,
        ("front_left_bottom", "front_right_bottom", "back_right_top", "back_left_top"),
        ("back_right_bottom", "back_left_bottom", "back_left_top", "back_right_top"),
        ("back_left_bottom", "front_left_bottom", "back_left_top"),
        ("front_right_bottom", "back_right_bottom", "back_right_top"),
    ]
    return _named(corners, edges, faces)


def _pyramid() -> Body:
    edges = _BOTTOM_EDGES | {name.removesuffix("_bottom"): (name, "top") for name in _BOTTOM}
    ring = list(_BOTTOM)
    sides = [(b, a, "top") for a, b in zip(ring, ring[1:] + ring[:1], strict=True)]
    return _named(_BOTTOM | {"top": (0.5, 1, 0.5)}, edges, [_FLOOR, *sides])


def _rectangle(corners: Mapping[str, Sequence[float]], edges: dict[str, tuple[str, str]], flat: int) -> Body:
    return _named(corners, edges, [tuple(corners)], flat)


def _wall() -> Body:
    """An upright rectangle that faces the front."""
    corners = {"left_bottom": (0, 0, 0), "right_bottom": (1, 0, 0), "right_top": (1, 1, 0), "left_top": (0, 1, 0)}
    edges = {"bottom": ("left_bottom", "right_bottom"), "top": ("left_top", "right_top"),
             "left": ("left_bottom", "left_top"), "right": ("right_bottom", "right_top")}  # fmt: skip
    return _rectangle(corners, edges, 2)


def _floor() -> Body:
    """A level rectangle that faces up."""
    corners = {"front_left": (0, 0, 1), "front_right": (1, 0, 1), "back_right": (1, 0, 0), "back_left": (0, 0, 0)}
    edges = {"front": ("front_left", "front_right"), "back": ("back_left", "back_right"),
             "left": ("back_left", "front_left"), "right": ("back_right", "front_right")}  # fmt: skip
    return _rectangle(corners, edges, 1)


def _arch() -> Body:
    """Half a round cylinder, or half an ellipse, that lies from the back to the front."""
    count = ROUND // 2
    turn = np.linspace(0, np.pi, count + 1)
    profile = np.stack([0.5 - 0.5 * np.cos(turn), np.sin(turn)], axis=-1)
    profile[-1, 1] = 0.0
    back, front = (np.insert(profile, 2, z, axis=1) for z in (0.0, 1.0))
    n = count + 1
    shell = [(i, n + i, n + i + 1, i + 1) for i in range(count)]
    faces = [*shell, tuple(range(n)), tuple(reversed(range(n, 2 * n))), (0, n - 1, 2 * n - 1, n)]
    corners = {
        "back_left_bottom": 0,
        "back_right_bottom": n - 1,
        "front_left_bottom": n,
        "front_right_bottom": 2 * n - 1,
    }
    edges: dict[str, Ring] = {name: (corners[a], corners[b]) for name, (a, b) in _BOTTOM_EDGES.items()}
    edges |= {"back_arc": tuple(range(n)), "front_arc": tuple(range(n, 2 * n))}
    return Body(np.concatenate([back, front]), tuple(faces), edges, corners)


BODIES = {
    "box": _box(), "roof": _roof(), "gable": _gable(), "wedge": _wedge(), "pyramid": _pyramid(),
    "wall": _wall(), "floor": _floor(), "arch": _arch(),
}  # fmt: skip

BLOCK_KINDS = (*BODIES, "revolution")
"""What a block may be."""


def revolved(profile: Sequence[tuple[float, float]]) -> Body:
    """A surface of revolution about the upright axis.

    profile : (radius, height) from the bottom to the top as shares of the largest radius and the whole height
    Its edges are `ring_0`, `ring_1` and so on, a circle for each point of the profile whose radius is not 0; `bottom`
    and `top` are the first and the last of them. Raises ValueError for a profile that does not fill the unit cube.
    """
    given = np.asarray(profile, np.float64)
    fills = len(given) > 1 and given[:, 0].min() >= 0 and given[:, 0].max() == 1
    if not fills or given[0, 1] != 0 or given[-1, 1] != 1 or np.any(np.diff(given[:, 1]) < 0):
        raise ValueError(
            "profile goes from height 0 up to height 1, radii from 0 to 1 with 1 among them: [[1, 0], [1, 1]]"
        )
    turn = 2 * np.pi * np.arange(ROUND) / ROUND
    circle = np.stack([np.cos(turn), -np.sin(turn)], axis=-1)  # counter-clockwise from above
    vertices = np.concatenate([
        np.stack([0.5 + 0.5 * r * circle[:, 0], np.full(ROUND, h), 0.5 + 0.5 * r * circle[:, 1]], axis=-1)
        for r, h in given
    ])  # fmt: skip
    rings = [tuple(range(i * ROUND, (i + 1) * ROUND)) for i in range(len(given))]
    faces: list[Ring] = []
    for low, high in pairwise(rings):
        faces += [(low[i - 1], low[i], high[i], high[i - 1]) for i in range(ROUND)]
    if given[0, 0] > 0:
        faces.append(tuple(reversed(rings[0])))
    if given[-1, 0] > 0:
        faces.append(rings[-1])
    edges = {f"ring_{i}": (*ring, ring[0]) for i, ring in enumerate(rings) if given[i, 0] > 0}
    edges |= {"bottom": edges[next(iter(edges))], "top": edges[list(edges)[-1]]}
    return Body(vertices, tuple(faces), edges, {})

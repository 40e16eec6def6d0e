"""Blocks in the world from what was found of them."""

from __future__ import annotations

import numpy as np

from relume.scene.materials.materials import Diffuse
from relume.scene.places.place import PlaceBlock
from relume.scene.places.place_tables import FoundBlock
from relume.scene.places.quantities import SoughtBlock
from relume.scene.shapes.shapes import Mesh
from relume.sphere.directions import rotation_about

GREY = Diffuse((0.5, 0.5, 0.5))
"""What blocks are made of until somebody knows better."""


def built(block: SoughtBlock, found: FoundBlock) -> PlaceBlock:
    """The block in the world; raises ValueError for one of negative size."""
    size, body = np.array(found.size), block.body
    if np.any(size < 0):
        sizes = " × ".join(f"{each:.3g}" for each in size)
        raise ValueError(
            f"block {block.name!r} came out inside out, {sizes} m: are left and right, or front and back, swapped in "
            "its marks?"
        )
    upright = rotation_about([0.0, 1.0, 0.0], float(np.radians(found.turn)))
    points = (np.array(found.low) + body.vertices * size) @ upright.T
    faces = body.triangles
    a, b, c = (body.vertices[faces[:, i]] for i in range(3))
    whole = np.any(np.cross(b - a, c - a), axis=-1)  # a cone's tip has triangles without area
    mesh = Mesh(points.astype(np.float32), faces[whole], GREY, name=block.name)
    return PlaceBlock(
        block.name, block.kind, mesh, size, np.array(found.deviation),
        {name: points[i] for name, i in body.corners.items()},
        {name: points[list(ring)] for name, ring in body.edges.items()},
    )  # fmt: skip

"""The inside of line 9 (Miller & Hoffman 1984, §3): which direction a table is looked up by, and its weight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from relume._kernel import inlined
from relume.light.weights import tabulated
from relume.scene.reflective import Layer, Towards

KINDS = {Towards.NORMAL: 0, Towards.REFLECTED: 1, Towards.VIEWER: 2, Towards.REFRACTED: 3}


class Term(NamedTuple):
    """One layer, ready for kernels: (weight · colour + grazing · rim) · table[direction].

    kind : of KINDS
    ratio : the index of refraction of the viewer's side over that behind, for refraction
    weight, grazing : (ENTRIES, 3) float32, by the cosine E·N from 0 to 1
    colour, rim : (1, 3) float32 for all samples, or (P, 3) for each; a rim of (0, 3) for no grazing part
    """

    kind: int
    ratio: np.float32
    weight: np.ndarray
    grazing: np.ndarray
    colour: np.ndarray
    rim: np.ndarray


def term(layer: Layer, colour: np.ndarray, rim: np.ndarray) -> Term:
    """A layer with its colours at the samples, (1, 3) or (P, 3)."""
    tables = tabulated(layer.weight), tabulated(layer.grazing)
    return Term(
        KINDS[layer.towards], np.float32(1 / layer.ior), *tables,
        np.ascontiguousarray(colour, np.float32), np.ascontiguousarray(rim, np.float32),
    )  # fmt: skip


@inlined
def key(kind, ratio, nx, ny, nz, ex, ey, ez):
    """The direction by which the table is looked up."""
    if kind == 0:
        return nx, ny, nz
    if kind == 2:
        return ex, ey, ez
    facing = nx * ex + ny * ey + nz * ez
    inside = np.float32(1) - ratio * ratio * (np.float32(1) - facing * facing)
    if kind == 1 or inside < 0:
        twice = np.float32(2) * facing
        return twice * nx - ex, twice * ny - ey, twice * nz - ez
    along = ratio * facing - np.sqrt(inside)
    return along * nx - ratio * ex, along * ny - ratio * ey, along * nz - ratio * ez


@inlined
def weighed(weight, grazing, colour, rim, index, facing):
    """What the three channels of a sample are multiplied by, at the cosine E·N."""
    place = min(max(facing, np.float32(0)), np.float32(1)) * np.float32(weight.shape[0] - 1)
    first = np.uint32(min(int(place), weight.shape[0] - 2))
    after = first + np.uint32(1)
    share = place - np.float32(first)
    rest = np.float32(1) - share
    tint = np.uint32(index if colour.shape[0] > 1 else 0)
    red = (weight[first, 0] * rest + weight[after, 0] * share) * colour[tint, 0]
    green = (weight[first, 1] * rest + weight[after, 1] * share) * colour[tint, 1]
    blue = (weight[first, 2] * rest + weight[after, 2] * share) * colour[tint, 2]
    if rim.shape[0] > 0:
        edge = np.uint32(index if rim.shape[0] > 1 else 0)
        red += (grazing[first, 0] * rest + grazing[after, 0] * share) * rim[edge, 0]
        green += (grazing[first, 1] * rest + grazing[after, 1] * share) * rim[edge, 1]
        blue += (grazing[first, 2] * rest + grazing[after, 2] * share) * rim[edge, 2]
    return red, green, blue

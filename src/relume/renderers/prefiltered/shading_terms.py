"""The inside of line 9 (Miller & Hoffman 1984, §3): which direction a table is looked up by, and its weight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from relume._kernel import inlined
from relume.light.reflection.weights import tabulated
from relume.scene.materials.reflective import Layer, Towards
from relume.sphere.bilinear_kernels import in_fours

KINDS = {Towards.NORMAL: 0, Towards.REFLECTED: 1, Towards.VIEWER: 2, Towards.REFRACTED: 3}


class Term(NamedTuple):
    """One layer, ready for kernels: (weight · colour + grazing · rim) · table[direction].

    kind : of KINDS
    ratio : the index of refraction of the viewer's side over that behind, for refraction
    weight, grazing : (ENTRIES, 4) float32, by the cosine E·N from 0 to 1, the fourth channel 0
    colour, rim : (P, 4) float32, of each sample; (0, 4) where they are everywhere the same and held in `weight`
    """

    kind: int
    ratio: np.float32
    weight: np.ndarray
    grazing: np.ndarray
    colour: np.ndarray
    rim: np.ndarray


def term(layer: Layer, colour: np.ndarray, rim: np.ndarray) -> Term:
    """A layer with its colours at the samples, (1, 3) or (P, 3)."""
    weight, grazing = tabulated(layer.weight), tabulated(layer.grazing)
    if len(colour) == len(rim) == 1:
        weight = weight * colour + grazing * rim
        colour = rim = np.zeros((0, 3))
    values = (in_fours(each) for each in (weight, grazing, *np.broadcast_arrays(colour, rim)))
    return Term(KINDS[layer.towards], np.float32(1 / layer.ior), *values)


def is_even(part: Term) -> bool:
    """Whether the term's colour is everywhere the same, and so held in its weight."""
    return len(part.colour) == 0


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
def by_cosine(weight, facing):
    """The four channels of a weight at the cosine E·N, by linear look-up."""
    place = min(max(facing, np.float32(0)), np.float32(1)) * np.float32(weight.shape[0] - 1)
    first = np.uint32(min(int(place), weight.shape[0] - 2))
    after = first + np.uint32(1)
    share = place - np.float32(first)
    rest = np.float32(1) - share
    return (
        weight[first, 0] * rest + weight[after, 0] * share,
        weight[first, 1] * rest + weight[after, 1] * share,
        weight[first, 2] * rest + weight[after, 2] * share,
        weight[first, 3] * rest + weight[after, 3] * share,
    )

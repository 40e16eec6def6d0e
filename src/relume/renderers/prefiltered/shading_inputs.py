"""What shading by reflection maps takes: samples, each with normal, view and surface in the middle and at the corners,
and terms, the inside of line 9 (Miller & Hoffman 1984, §3): which direction a table is looked up by, and its weight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from relume.image.kernel import inlined
from relume.light.reflection.weights import tabulated
from relume.scene.materials.reflective import Layer, Towards
from relume.sphere.bilinear_kernels import in_fours


class Samples(NamedTuple):
    """Points to shade, in whatever order; kernels read it.

    normal, to_eye : (P, 3) float32 unit vectors, world, at the middle
    surface : (P,) int32, which material; −1 where nothing is seen
    corners : (P, 4) int32, rows of the next three: upper left, upper right, lower right, lower left
    corner_normal, corner_to_eye : (M, 3) float32
    corner_surface : (M,) int32
    """

    normal: np.ndarray
    to_eye: np.ndarray
    surface: np.ndarray
    corners: np.ndarray
    corner_normal: np.ndarray
    corner_to_eye: np.ndarray
    corner_surface: np.ndarray


@dataclass(frozen=True, eq=False)
class GBuffer:
    """Normals and views of a picture, by this package's ray casting or from any other program (§3, lines 6 and 7).

    normal : (H, W, 3) unit vectors in world space
    view : (H, W, 3) unit vectors from the surface to the eye
    surface : (H, W) integers, the index of each pixel's material, −1 where there is none
    uv : (H, W, 2) texture coordinates, where a material has images

    Raises ValueError for sizes that differ and for vectors of a surface that are not of unit length.
    """

    normal: np.ndarray
    view: np.ndarray
    surface: np.ndarray
    uv: np.ndarray | None = None

    def __post_init__(self) -> None:
        shape = np.shape(self.surface)
        if len(shape) != 2 or not np.issubdtype(np.asarray(self.surface).dtype, np.integer):
            raise ValueError(f"surface is {shape} {np.asarray(self.surface).dtype}; expected integers (H, W)")
        wanted = {"normal": (self.normal, 3), "view": (self.view, 3)} | (
            {} if self.uv is None else {"uv": (self.uv, 2)}
        )
        for name, (plane, channels) in wanted.items():
            if np.shape(plane) != (*shape, channels):
                raise ValueError(
                    f"{name} is {np.shape(plane)} beside a surface of {shape}; expected {(*shape, channels)}: "
                    "render all planes at one size"
                )
        seen = np.asarray(self.surface) >= 0
        if self.uv is not None and not np.all(np.isfinite(np.asarray(self.uv)[seen])):
            raise ValueError("uv holds NaN or infinity where there is a surface; expected finite texture coordinates")
        for name, plane in (("normal", self.normal), ("view", self.view)):
            lengths = np.linalg.norm(np.asarray(plane, np.float64)[seen], axis=-1)
            wrong = ~(np.abs(lengths - 1) < 1e-2)
            if np.any(wrong):
                row, column = np.argwhere(seen)[np.flatnonzero(wrong)[0]]
                raise ValueError(
                    f"{np.count_nonzero(wrong)} vectors of {name} are not of unit length, the first at row {row}, "
                    f"column {column} ({lengths[wrong][0]:.3g}); normalise them, or give surface −1 there"
                )

    def samples(self) -> Samples:
        """The pixels in rows; their corners are the means of the pixels of the same surface round them."""
        height, width = self.surface.shape
        surface = np.ascontiguousarray(self.surface, np.int32)
        normal = np.ascontiguousarray(self.normal, np.float32)
        view = np.ascontiguousarray(self.view, np.float32)
        framed = np.full((height + 2, width + 2), -1, np.int32)
        framed[1:-1, 1:-1] = surface
        around = np.stack([framed[i : i + height + 1, j : j + width + 1] for i in (0, 1) for j in (0, 1)])
        corner_surface = around.max(0)
        same = (around == corner_surface) & (corner_surface >= 0)
        planes = []
        for plane in (normal, view):
            wide = np.pad(plane, ((1, 1), (1, 1), (0, 0)))
            near = (wide[i : i + height + 1, j : j + width + 1] for i in (0, 1) for j in (0, 1))
            total = sum(np.where(mine[..., None], part, 0) for mine, part in zip(same, near, strict=True))
            length = np.linalg.norm(total, axis=-1, keepdims=True)
            planes.append((total / np.maximum(length, 1e-12)).astype(np.float32).reshape(-1, 3))
        return Samples(
            normal.reshape(-1, 3), view.reshape(-1, 3), surface.reshape(-1),
            grid_corners(height, width), planes[0], planes[1], corner_surface.reshape(-1),
        )  # fmt: skip


def grid_corners(height: int, width: int) -> np.ndarray:
    """The corners of a picture's pixels among (height + 1)·(width + 1) points in rows: (height·width, 4) int32."""
    upper = (np.arange(height)[:, None] * (width + 1) + np.arange(width)).reshape(-1)
    return np.stack([upper, upper + 1, upper + width + 2, upper + width + 1], axis=1).astype(np.int32)


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

"""Patches split ahead of time into leaves that are nearly flat, each a primitive of the tree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.kernel import exact_kernel
from relume.renderers.raytrace.patch_point import BEYOND, TOUCH
from relume.scene.shapes.shapes import Patches

BENT = 0.3
"""Sine of the angle to a leaf's mean normal that none of its own may exceed: rays at less steep ones are subdivided."""
FINEST = 4
"""A patch is halved this often at most along u and along v."""
STEEPEST, NO_AREA = 2.0, -1.0
"""Stand for a sine where there is none: no slope is greater, and every one is."""


@dataclass(frozen=True, eq=False)
class Leaves:
    """Pieces of patches.

    patch : (L,) int32, the patch's number
    net : (L, 4, 4, 3) float64, the piece's own control points, metres
    span : (L, 4) float64, where it begins in the patch's u and v, and how long it is
    """

    patch: np.ndarray
    net: np.ndarray
    span: np.ndarray

    @property
    def boxes(self) -> np.ndarray:
        """(L, 6) low and high x, y, z of the control points, which enclose the piece."""
        return np.concatenate([self.net.min(axis=(1, 2)), self.net.max(axis=(1, 2))], axis=1)

    @property
    def measures(self) -> np.ndarray:
        """(L, 76) float64, what `meet_leaf` takes."""
        count = len(self.net)
        points = self.net.reshape(count, 16, 3)
        centre = (points.max(axis=1) + points.min(axis=1)) / 2
        radius = np.linalg.norm(points - centre[:, None], axis=-1).max(axis=1) * (1 + 2 * TOUCH)
        axis, bent = _cones(self.net)
        _, bent_around = _cones(_extended(self.net), axis)
        frame = _frames(self.net, axis)
        local = np.einsum("lij,lkj->lki", frame, points - centre[:, None])
        low, high = local.min(axis=1), local.max(axis=1)
        # Wider by what rounding may take from places a million times as far away.
        margin = 1e-6 * (high - low).max(axis=1, keepdims=True)
        limits = np.stack([low - margin, high + margin], axis=-1).reshape(count, 6)
        sphere, cone = (centre, radius[:, None]), (axis, bent[:, None], bent_around[:, None])
        return np.concatenate(
            [*sphere, *cone, frame.reshape(count, 9), limits, self.span, points.reshape(count, 48)], 1
        )


def split(patches: Patches) -> Leaves:
    """The leaves of these patches, so small that each is nearly flat; those without area are left out."""
    net = np.asarray(patches.control, np.float64)
    patch = np.arange(len(net), dtype=np.int32)
    span = np.tile([0.0, 0.0, 1.0, 1.0], (len(net), 1))
    done = []
    while len(net):
        _, bent = _cones(_extended(net))
        curved_u, curved_v = (np.linalg.norm(np.diff(net, 2, axis=axis), axis=-1).max(axis=(1, 2)) for axis in (1, 2))
        can_u, can_v = span[:, 2] > 2.0**-FINEST, span[:, 3] > 2.0**-FINEST
        by_u = (bent > BENT) & can_u & (~can_v | (curved_u >= curved_v))
        by_v = (bent > BENT) & can_v & ~by_u
        rest = ~by_u & ~by_v & (bent > NO_AREA)
        done.append((patch[rest], net[rest], span[rest]))
        halves = [_halves(net[by_u], span[by_u], 1), _halves(net[by_v], span[by_v], 2)]
        patch = np.concatenate([patch[by_u], patch[by_u], patch[by_v], patch[by_v]])
        net, span = (np.concatenate(part) for part in zip(*halves, strict=True))
    return Leaves(*(np.concatenate(part) for part in zip(*done, strict=True)))


def _cones(net: np.ndarray, axes: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The mean normal of each piece (L, 3), unless it is given, and the sine of the greatest angle of a normal to it:
    STEEPEST for a right angle or more, NO_AREA where there is no normal."""
    means = np.zeros((len(net), 3)) if axes is None else axes.copy()
    sines = np.empty(len(net))
    _write_cones(np.ascontiguousarray(net), axes is None, means, sines, np.empty((144, 3)))
    return means, sines


@exact_kernel
def _write_cones(net, find_means, means, sines, units):
    """`_cones`, into `means` and `sines`; `units` is scratch.

    Every normal ∂P/∂u × ∂P/∂v is a mean, with weights of 0 or more, of the products of control points' differences
    along u and along v. So is that of any two means of such differences, which is why a ray to which none of these
    products is at right angles meets the piece in one place at most.
    """
    for piece in range(len(net)):
        scale = 0.0
        for j in range(3):
            for k in range(4):
                for c in range(3):
                    along_u = net[piece, j + 1, k, c] - net[piece, j, k, c]
                    along_v = net[piece, k, j + 1, c] - net[piece, k, j, c]
                    scale += along_u * along_u + along_v * along_v
        count, mx, my, mz = 0, 0.0, 0.0, 0.0
        for a in range(12):
            j, k = a // 4, a % 4
            ux = net[piece, j + 1, k, 0] - net[piece, j, k, 0]
            uy = net[piece, j + 1, k, 1] - net[piece, j, k, 1]
            uz = net[piece, j + 1, k, 2] - net[piece, j, k, 2]
            for b in range(12):
                i, h = b // 3, b % 3
                vx = net[piece, i, h + 1, 0] - net[piece, i, h, 0]
                vy = net[piece, i, h + 1, 1] - net[piece, i, h, 1]
                vz = net[piece, i, h + 1, 2] - net[piece, i, h, 2]
                x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
                length = np.sqrt(x * x + y * y + z * z)
                # Where points coincide, as at a pole, or lie in line, what is left of a product points anywhere.
                if length > 1e-12 * scale:
                    x, y, z = x / length, y / length, z / length
                    units[count, 0], units[count, 1], units[count, 2] = x, y, z
                    mx, my, mz = mx + x, my + y, mz + z
                    count += 1
        if not find_means:
            mx, my, mz = means[piece, 0], means[piece, 1], means[piece, 2]
        length = max(np.sqrt(mx * mx + my * my + mz * mz), 1e-300)
        mx, my, mz = mx / length, my / length, mz / length
        cosine = 1.0
        for k in range(count):
            cosine = min(cosine, units[k, 0] * mx + units[k, 1] * my + units[k, 2] * mz)
        means[piece, 0], means[piece, 1], means[piece, 2] = mx, my, mz
        if count == 0:
            sines[piece] = NO_AREA
        else:
            sines[piece] = np.sqrt(max(1 - cosine * cosine, 0.0)) + 1e-9 if cosine > 0 else STEEPEST


def _frames(net: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """What turns a step in metres into one of a leaf's u, v and height, roughly: (L, 3, 3)."""
    along_u, along_v = (net[:, 3] - net[:, 0]).mean(axis=1), (net[:, :, 3] - net[:, :, 0]).mean(axis=1)
    size = np.maximum(np.linalg.norm(along_u, axis=-1), np.linalg.norm(along_v, axis=-1))
    sides = np.stack([along_u, along_v, axis * size[:, None]], axis=-1)
    flat = np.abs(np.linalg.det(sides)) <= 1e-6 * size**3
    sides[flat] = np.eye(3) * np.where(size > 0, size, 1)[flat, None, None]
    return np.linalg.inv(sides)


def _extended(net: np.ndarray) -> np.ndarray:
    """Control points of the same surfaces from −BEYOND to 1 + BEYOND."""
    ends = (-BEYOND, 1 + BEYOND)
    polar = np.array([_blossom([ends[n < k] for n in range(3)]) for k in range(4)])
    # One direction after the other, which is a fourth of the products.
    return np.einsum("bj,lajk->labk", polar, np.einsum("ai,lijk->lajk", polar, net))


def _blossom(at: list[float]) -> np.ndarray:
    """The weights of a cubic's four control points in its polar form at three parameters."""
    weights = np.eye(4)
    for t in at:
        weights = (1 - t) * weights[:-1] + t * weights[1:]
    return weights[0]


def _halves(net: np.ndarray, span: np.ndarray, axis: int) -> tuple[np.ndarray, np.ndarray]:
    """Both halves of each piece along u (axis 1) or v (2), all first halves first (de Casteljau)."""
    a, b, c, d = np.moveaxis(net, axis, 0)
    ab, bc, cd = (a + b) / 2, (b + c) / 2, (c + d) / 2
    abc, bcd = (ab + bc) / 2, (bc + cd) / 2
    middle = (abc + bcd) / 2
    halves = [np.stack(points, axis=axis) for points in ((a, ab, abc, middle), (middle, bcd, cd, d))]
    first = span.copy()
    first[:, axis + 1] /= 2
    second = first.copy()
    second[:, axis - 1] += second[:, axis + 1]
    return np.concatenate(halves), np.concatenate([first, second])

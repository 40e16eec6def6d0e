"""The loop that looks tables up at samples' middles and adds what it sees, in one go."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import kernel
from relume.renderers.prefiltered.shading_inputs import key
from relume.sphere.bilinear_kernels import polar_point
from relume.sphere.vector_steps import add_looked_up

_BLOCK = 256
"""Samples whose image points are found together, by vector instructions, before they are looked up one by one."""


@kernel
def choose(surface, index, begin, end, chosen):
    """Write which of the samples begin … end are of a material to `chosen`, in their order; how many."""
    count = 0
    for k in range(begin, end):
        # Written whether it counts or not, without a branch.
        chosen[count] = k
        count += surface[k] == index
    return count


@kernel
def plain(light, chosen, normal, to_eye, kind, ratio, weight, table):
    """Look `chosen` samples up at their middles and add to `light`: of all ways the one that has to be fastest.

    chosen : ascending, without repeats
    kind, ratio, weight : of a `Term` with its colour held in the weight
    table : padded
    """
    rows = table.shape[0] - 2
    entries, weights, sums = np.int64(table.ctypes.data), np.int64(weight.ctypes.data), np.int64(light.ctypes.data)
    # Flat, so that the distance from one to the next is known.
    normals, views, stride = normal.reshape(-1), to_eye.reshape(-1), 16 * (2 * rows + 2)
    columns, high, last = np.float32(2 * rows), np.float32(rows), np.float32(weight.shape[0] - 2)
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    vectors, shares = np.empty((6, _BLOCK), np.float32), np.empty((5, _BLOCK), np.float32)
    places = np.empty((2, _BLOCK), np.int32)
    nx, ny, nz, ex, ey, ez = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4], vectors[5]
    a, b, c, d, along = shares[0], shares[1], shares[2], shares[3], shares[4]
    corners, steps = places[0], places[1]
    for begin in range(0, len(chosen), _BLOCK):
        count = min(_BLOCK, len(chosen) - begin)
        first = np.uint64(chosen[begin])
        # Neighbours are read by whole registers; of others each has to be fetched.
        together = chosen[begin + count - 1] - chosen[begin] == count - 1
        if together:
            for k in range(count):
                x = np.uint64(3) * (first + np.uint64(k))
                y, z = x + np.uint64(1), x + np.uint64(2)
                nx[k], ny[k], nz[k] = normals[x], normals[y], normals[z]
                ex[k], ey[k], ez[k] = views[x], views[y], views[z]
        else:
            for k in range(count):
                x = np.uint64(3) * np.uint64(chosen[np.uint64(begin + k)])
                y, z = x + np.uint64(1), x + np.uint64(2)
                nx[k], ny[k], nz[k] = normals[x], normals[y], normals[z]
                ex[k], ey[k], ez[k] = views[x], views[y], views[z]
        # Where in the table and in the weight, by vector instructions: 32 bits wide throughout.
        for k in range(count):
            px, py, pz = key(kind, ratio, nx[k], ny[k], nz[k], ex[k], ey[k], ez[k])
            u, v = polar_point(px, py, pz)
            across, below = u * columns + half, v * high + half
            # What is no number becomes 0, so that nothing beyond the table is read, and is seen in the shares.
            column = np.int32(min(across if across > zero else zero, columns))
            row = np.int32(min(below if below > zero else zero, high))
            right, down = across - np.float32(column), below - np.float32(row)
            left, above = one - right, one - down
            a[k], b[k], c[k], d[k] = left * above, right * above, left * down, right * down
            corners[k] = row * np.int32(2 * rows + 2) + column
            facing = nx[k] * ex[k] + ny[k] * ey[k] + nz[k] * ez[k]
            place = min(facing if facing > zero else zero, one) * (last + one)
            steps[k] = np.int32(min(place, last))
            along[k] = place - np.float32(steps[k])
        # One by one, all channels at once.
        for k in range(count):
            index, upper = chosen[np.uint64(begin + k)], entries + 16 * np.int64(corners[k])
            add_looked_up(
                sums + 16 * np.int64(index), upper, upper + stride, (a[k], b[k], c[k], d[k]),
                weights + 16 * np.int64(steps[k]), along[k],
            )  # fmt: skip

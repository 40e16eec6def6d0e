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
def plain(light, chosen, samples, term, table):
    """Look `chosen` samples up at their middles and add to `light`: of all ways the one that has to be fastest.

    chosen : ascending, without repeats
    term : with its colour held in the weight
    table : padded
    """
    entries, weights, sums = np.int64(table.ctypes.data), np.int64(term.weight.ctypes.data), np.int64(light.ctypes.data)
    # Flat, so that the distance from one to the next is known.
    normals, views = samples.normal.reshape(-1), samples.to_eye.reshape(-1)
    vectors, shares = np.empty((6, _BLOCK), np.float32), np.empty((5, _BLOCK), np.float32)
    places = np.empty((2, _BLOCK), np.int32)
    for begin in range(0, len(chosen), _BLOCK):
        here = chosen[begin : min(begin + _BLOCK, len(chosen))]
        _fetch(here, normals, views, vectors)
        _add(
            sums, here, term.kind, term.ratio, weights, term.weight.shape[0], entries, table.shape[0] - 2,
            vectors, shares, places,
        )  # fmt: skip


@kernel
def plain_at_once(light, material, normal, to_eye, whose, kinds, ratios, weights, tables, heights, begin, end):
    """Write the light of samples begin … end, of T terms, those of a material one behind the other.

    All that a block of samples takes stays near the core: its light is cleared, a material's samples are found and
    fetched, and looked up term by term.

    light, material : (P, 4) float32, which may hold anything; (P,) int32
    normal, to_eye : of `Samples`
    whose, kinds, ratios, weights : (T,) the terms' materials and kinds, (T,) float32, (T, ENTRIES, 4) float32
    tables, heights : (T,) addresses of padded tables that the caller holds, and their rows without the padding
    """
    sums, first_weight, entries = np.int64(light.ctypes.data), np.int64(weights.ctypes.data), weights.shape[1]
    normals, views = normal.reshape(-1), to_eye.reshape(-1)
    vectors, shares = np.empty((6, _BLOCK), np.float32), np.empty((5, _BLOCK), np.float32)
    places, chosen = np.empty((2, _BLOCK), np.int32), np.empty(_BLOCK + 1, np.int32)
    for near in range(begin, end, _BLOCK):
        till, count = min(near + _BLOCK, end), 0
        light[near:till] = 0
        for k in range(len(whose)):
            if k == 0 or whose[k] != whose[k - 1]:
                count = _choose(material, whose[k], near, till, chosen)
                if count > 0:
                    _fetch(chosen[:count], normals, views, vectors)
            if count > 0:
                _add(
                    sums, chosen[:count], kinds[k], ratios[k], first_weight + 16 * entries * k, entries, tables[k],
                    heights[k], vectors, shares, places,
                )  # fmt: skip


@kernel
def _choose(material, index, begin, end, chosen):
    """Write which of the samples begin … end are of a material, in their order; how many."""
    others = 0
    for k in range(end - begin):
        chosen[k] = begin + k
        others += material[begin + k] != index
    # Few blocks hold two materials.
    if others == 0 or others == end - begin:
        return end - begin - others
    count = 0
    for sample in range(begin, end):
        # Written whether it counts or not, without a branch.
        chosen[count] = sample
        count += material[sample] == index
    return count


@kernel
def _fetch(chosen, normals, views, vectors):
    """Write the normals and views of a block's samples, coordinate by coordinate."""
    nx, ny, nz, ex, ey, ez = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4], vectors[5]
    count, first = len(chosen), np.uint64(chosen[0])
    # Neighbours are read by whole registers; of others each has to be fetched.
    if chosen[count - 1] - chosen[0] == count - 1:
        for k in range(count):
            x = np.uint64(3) * (first + np.uint64(k))
            y, z = x + np.uint64(1), x + np.uint64(2)
            nx[k], ny[k], nz[k] = normals[x], normals[y], normals[z]
            ex[k], ey[k], ez[k] = views[x], views[y], views[z]
    else:
        for k in range(count):
            x = np.uint64(3) * np.uint64(chosen[np.uint64(k)])
            y, z = x + np.uint64(1), x + np.uint64(2)
            nx[k], ny[k], nz[k] = normals[x], normals[y], normals[z]
            ex[k], ey[k], ez[k] = views[x], views[y], views[z]


@kernel
def _add(sums, chosen, kind, ratio, weights, cosines, entries, rows, vectors, shares, places):
    """Add what a block's samples see of one table, times a weight by their cosines, to the light at `sums`.

    weights, cosines, entries : address of the weight, its entries, address of the table
    shares, places : scratch
    """
    nx, ny, nz, ex, ey, ez = vectors[0], vectors[1], vectors[2], vectors[3], vectors[4], vectors[5]
    a, b, c, d, along = shares[0], shares[1], shares[2], shares[3], shares[4]
    corners, steps, stride = places[0], places[1], 16 * (2 * rows + 2)
    columns, high, last = np.float32(2 * rows), np.float32(rows), np.float32(cosines - 2)
    zero, half, one = np.float32(0), np.float32(0.5), np.float32(1)
    # Where in the table and in the weight, by vector instructions: 32 bits wide throughout.
    for k in range(len(chosen)):
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
    for k in range(len(chosen)):
        index, upper = chosen[np.uint64(k)], entries + 16 * np.int64(corners[k])
        add_looked_up(
            sums + 16 * np.int64(index), upper, upper + stride, (a[k], b[k], c[k], d[k]),
            weights + 16 * np.int64(steps[k]), along[k],
        )  # fmt: skip

"""A tree of boxes over primitives (bounding volume hierarchy), so that a ray meets only the few that are near it.

Each split is the cheapest of a few by the surface area heuristic (Wald 2007, "On fast construction of SAH-based
bounding volume hierarchies").
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads
from relume.image.kernel import exact_kernel, exact_small

BINS = 16
"""Candidate splits along each axis, and one."""
FEW, FEW_BINS = 12, 4
"""So many primitives or less get by with so few bins: most of a tree's nodes hold few."""
LARGEST_LEAF = 4
"""Primitives in a leaf; at most 7, for a leaf's reference has three bits for them."""
STEP_COST = 1.0
"""Time to test a node's two boxes, in primitives tested."""
PART, PARTS = 4096, 16
"""Primitives from which on a tree is built in parts, on every core, and how many parts about."""


@dataclass(frozen=True, eq=False)
class Tree:
    """Boxes within boxes.

    boxes : (M, 24) float32, four children's: their low x, their high x, low y, high y, low z, high z; those of a child
        that is none are ∞ and −∞
    children : (M, 4) int32, references to the four: a node's number, or of a leaf ~(8·first + count)
    order : (P,) int32, the primitives' numbers as the leaves hold them, first … first + count
    root : reference to the whole
    depth : nodes above the deepest leaf
    """

    boxes: np.ndarray
    children: np.ndarray
    order: np.ndarray
    root: int
    depth: int


def build_tree(boxes: np.ndarray) -> Tree:
    """The tree over primitives with these boxes.

    boxes : (P, 6) float32, low x, y, z and high x, y, z; finite. P may be 0
    """
    if boxes.ndim != 2 or boxes.shape[1] != 6 or boxes.dtype != np.float32:
        raise ValueError(f"boxes are {boxes.dtype} {boxes.shape}; expected float32 (P, 6)")
    if not len(boxes):
        none = np.zeros((0, 24), np.float32), np.zeros((0, 4), np.int32), np.zeros(0, np.int32)
        return Tree(*none, root=~0, depth=0)
    order = np.arange(len(boxes), dtype=np.int32)
    work = boxes.copy(), order, np.empty((len(boxes) - 1, 12), np.float32), np.empty((len(boxes) - 1, 2), np.int32)
    # The top of a large tree, down to parts that are built side by side: the same tree as in one go.
    smallest = len(boxes) // PARTS if len(boxes) >= PARTS * PART else 0
    parts = np.empty((len(boxes) if smallest else 0, 4), np.int64)
    root, count, depth, waiting = _build(*work, 0, len(boxes), -1, 0, smallest, parts)
    done = in_threads(lambda part, _: _build(*work, *parts[part], 0, parts[:0]), waiting, chunk=1)
    count, depth = count + sum(part[1] for part in done), max([depth, *(part[2] for part in done)])
    _, _, nodes, children = work
    if not count:
        return Tree(np.zeros((0, 24), np.float32), np.zeros((0, 4), np.int32), order, int(root), 0)
    wide_boxes, wide_children = np.empty((count, 24), np.float32), np.empty((count, 4), np.int32)
    count, depth = _fold(nodes, children, int(root), int(depth), wide_boxes, wide_children)
    return Tree(wide_boxes[:count].copy(), wide_children[:count].copy(), order, 0, int(depth))


@exact_kernel
def _build(boxes, order, nodes, children, begin, end, parent, depth, smallest, parts):
    """Sort boxes begin … end and order into leaves and write the nodes: the reference to the whole, how many nodes, the
    depth, and how many parts were put down.

    parent, depth : what refers to the whole, twice a node's number and which of its two, or −1; and nodes above it
    smallest, parts : a part of so many boxes or less is not divided but put down, (K, 4) begin, end, parent and depth
    """
    # The smaller half is always taken first, so the halves that wait number log₂ of the primitives at most.
    waiting = np.empty((64, 4), np.int64)
    bins = np.empty((3, BINS, 6), np.float32)
    counts = np.empty((3, BINS), np.int64)
    areas = np.empty(BINS)
    low, scale = np.empty(3, np.float32), np.empty(3)
    root, made, deepest, put_down, first_depth = 0, 0, 0, 0, depth
    _wait(waiting, 0, begin, end, parent, depth)
    top = 1
    while top > 0:
        top -= 1
        begin, end, parent, depth = waiting[top, 0], waiting[top, 1], waiting[top, 2], waiting[top, 3]
        if end - begin <= smallest:
            _wait(parts, put_down, begin, end, parent, depth)
            put_down += 1
            continue
        used = FEW_BINS if end - begin <= FEW else BINS
        box = _measure(boxes, begin, end, used, low, scale)
        axis, cut, cost = -1, 0, np.inf
        if end - begin > 1:
            _fill_bins(boxes, begin, end, used, low, scale, bins, counts)
            for candidate in range(3):
                cheapest, here = _cheapest_cut(bins[candidate], counts[candidate], used, areas)
                if cheapest < cost:
                    axis, cut, cost = candidate, here, cheapest
        size = end - begin
        if size == 1 or (size <= LARGEST_LEAF and cost + STEP_COST * _half_area(box) >= size * _half_area(box)):
            reference = ~(begin * 8 + size)
            deepest = max(deepest, depth)
        else:
            # Where all centres coincide no plane divides them: any half is as good as another.
            middle = begin + size // 2
            if axis >= 0:
                middle = _partition(boxes, order, begin, end, axis, cut, low[axis], scale[axis])
            # No other node is divided there, so that parts need not know of each other's numbers.
            reference = middle - 1
            made += 1
            larger_first = middle - begin > end - middle
            _wait(waiting, top if larger_first else top + 1, begin, middle, 2 * reference, depth + 1)
            _wait(waiting, top + 1 if larger_first else top, middle, end, 2 * reference + 1, depth + 1)
            top += 2
        if depth == first_depth:
            root = reference
        if parent >= 0:
            children[parent >> 1, parent & 1] = reference
            for i in range(6):
                nodes[parent >> 1, (parent & 1) * 6 + i] = box[i]
    return root, made, deepest, put_down


@exact_kernel
def _fold(nodes, children, root, depth, wide_boxes, wide_children):
    """Make nodes of four children from those of two, the largest opened first: their number, and the depth."""
    waiting = np.empty((3 * depth + 4, 3), np.int64)  # a node of two, where its node of four is noted, and the depth
    of, which = np.empty(4, np.int64), np.empty(4, np.int64)  # each child: the node of two that has it, as which
    waiting[0, 0], waiting[0, 1], waiting[0, 2] = root, -1, 1
    top, made, deepest = 1, 0, 0
    while top > 0:
        top -= 1
        node, parent, level = waiting[top, 0], waiting[top, 1], waiting[top, 2]
        if parent >= 0:
            wide_children[parent >> 2, parent & 3] = made
        deepest = max(deepest, level)
        of[0], which[0], of[1], which[1], count = node, 0, node, 1, 2
        while count < 4:
            opened, largest = -1, -1.0
            for k in range(count):
                if children[of[k], which[k]] >= 0:
                    b = 6 * which[k]
                    row = nodes[of[k]]
                    area = _half_area((row[b], row[b + 1], row[b + 2], row[b + 3], row[b + 4], row[b + 5]))
                    if area > largest:
                        opened, largest = k, area
            if opened < 0:
                break
            inner = children[of[opened], which[opened]]
            of[opened], which[opened], of[count], which[count] = inner, 0, inner, 1
            count += 1
        for k in range(4):
            child = children[of[k], which[k]] if k < count else 0
            for side in range(6):
                nothing = np.float32(-np.inf if side & 1 else np.inf)
                wide_boxes[made, 4 * side + k] = nodes[of[k], 6 * which[k] + side] if k < count else nothing
            wide_children[made, k] = child
            if k < count and child >= 0:
                waiting[top, 0], waiting[top, 1], waiting[top, 2] = child, 4 * made + k, level + 1
                top += 1
        made += 1
    return made, deepest


@exact_small
def _wait(waiting, place, begin, end, parent, depth):
    """Put down a part that is yet to be divided; assigning a row at once would take seconds to compile."""
    waiting[place, 0], waiting[place, 1], waiting[place, 2], waiting[place, 3] = begin, end, parent, depth


@exact_kernel
def _measure(boxes, begin, end, used, low, scale):
    """The box round all; writes where the bins of each axis begin and how many there are to a metre.

    Centres are stored as the sum of both ends. An axis along which all coincide has scale 0.
    """
    infinity = np.float32(np.inf)
    lx, ly, lz, hx, hy, hz = infinity, infinity, infinity, -infinity, -infinity, -infinity
    first_x, first_y, first_z, last_x, last_y, last_z = lx, ly, lz, hx, hy, hz
    for i in range(begin, end):
        x, y, z = boxes[i, 0] + boxes[i, 3], boxes[i, 1] + boxes[i, 4], boxes[i, 2] + boxes[i, 5]
        lx, ly, lz = min(lx, boxes[i, 0]), min(ly, boxes[i, 1]), min(lz, boxes[i, 2])
        hx, hy, hz = max(hx, boxes[i, 3]), max(hy, boxes[i, 4]), max(hz, boxes[i, 5])
        first_x, first_y, first_z = min(first_x, x), min(first_y, y), min(first_z, z)
        last_x, last_y, last_z = max(last_x, x), max(last_y, y), max(last_z, z)
    low[0], low[1], low[2] = first_x, first_y, first_z
    for axis, width in enumerate((last_x - first_x, last_y - first_y, last_z - first_z)):
        scale[axis] = 0.9999 * used / width if width > 0 else 0.0
    return lx, hx, ly, hy, lz, hz


@exact_kernel
def _fill_bins(boxes, begin, end, used, low, scale, bins, counts):
    """Count the primitives whose centre falls into each bin of each axis, and the box round them."""
    for axis in range(3):
        for here in range(used):
            counts[axis, here] = 0
            for j in range(3):
                bins[axis, here, j], bins[axis, here, j + 3] = np.inf, -np.inf
    for i in range(begin, end):
        for axis in range(3):
            here = int((boxes[i, axis] + boxes[i, axis + 3] - low[axis]) * scale[axis])
            counts[axis, here] += 1
            for j in range(3):
                bins[axis, here, j] = min(bins[axis, here, j], boxes[i, j])
                bins[axis, here, j + 3] = max(bins[axis, here, j + 3], boxes[i, j + 3])


@exact_kernel
def _cheapest_cut(bins, counts, used, areas):
    """The least cost of a cut after one of the bins (∞ where none divides), and that bin; areas is scratch."""
    infinity = np.float32(np.inf)
    lx, ly, lz, hx, hy, hz, above = infinity, infinity, infinity, -infinity, -infinity, -infinity, 0
    for i in range(used - 1, 0, -1):
        above += counts[i]
        lx, ly, lz = min(lx, bins[i, 0]), min(ly, bins[i, 1]), min(lz, bins[i, 2])
        hx, hy, hz = max(hx, bins[i, 3]), max(hy, bins[i, 4]), max(hz, bins[i, 5])
        areas[i] = above * _half_area((lx, hx, ly, hy, lz, hz)) if above > 0 else np.inf
    cost, cut = np.inf, 0
    lx, ly, lz, hx, hy, hz, below = infinity, infinity, infinity, -infinity, -infinity, -infinity, 0
    for i in range(used - 1):
        below += counts[i]
        lx, ly, lz = min(lx, bins[i, 0]), min(ly, bins[i, 1]), min(lz, bins[i, 2])
        hx, hy, hz = max(hx, bins[i, 3]), max(hy, bins[i, 4]), max(hz, bins[i, 5])
        if below > 0:
            here = below * _half_area((lx, hx, ly, hy, lz, hz)) + areas[i + 1]
            if here < cost:
                cost, cut = here, i
    return cost, cut


@exact_kernel
def _half_area(box):
    x, y, z = np.float64(box[1]) - box[0], np.float64(box[3]) - box[2], np.float64(box[5]) - box[4]
    return x * y + y * z + z * x


@exact_kernel
def _partition(boxes, order, begin, end, axis, cut, low, scale):
    """Swap the primitives whose bin is at most `cut` to the front; where the others begin."""
    i, j = begin, end - 1
    while i <= j:
        if int((boxes[i, axis] + boxes[i, axis + 3] - low) * scale) <= cut:
            i += 1
        else:
            for k in range(6):
                boxes[i, k], boxes[j, k] = boxes[j, k], boxes[i, k]
            order[i], order[j] = order[j], order[i]
            j -= 1
    return i

"""Kernels that carry pixels along their own vectors, tile by tile, the nearer before the farther."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import inlined, kernel

TILE = 64
"""Pixels along a side: what reaches a tile is then few times what it holds, and its planes fit a core's cache."""
SAME = np.float32(0.05)
"""Ratio, as a logarithm, of distances or speeds up to which two pixels belong to one surface."""
_STILL = 1e-3
_TRACE = 1e-4


@kernel
def reaches(motion, boxes, begin, end):
    """Fills `boxes` (rows, columns, 4) of rows of tiles begin…end: left, top, right and bottom their pixels come to."""
    height, width = motion.shape[:2]
    for row in range(begin, end):
        for column in range(boxes.shape[1]):
            box = boxes[row, column]
            box[0] = box[1] = np.inf
            box[2] = box[3] = -np.inf
            for y in range(row * TILE, min(height, row * TILE + TILE)):
                for x in range(column * TILE, min(width, column * TILE + TILE)):
                    across, down = abs(motion[y, x, 0]) / 2, abs(motion[y, x, 1]) / 2
                    box[0], box[1] = min(box[0], x - across), min(box[1], y - down)
                    box[2], box[3] = max(box[2], x + across), max(box[3], y + down)


@inlined
def _rising(x):
    """The integral of the tent of width 2 from −∞ to x."""
    x = min(max(x, -1.0), 1.0)
    return 0.5 * (1 + x) * (1 + x) if x < 0 else 1 - 0.5 * (1 - x) * (1 - x)


@inlined
def _share(distance, step):
    """The weight of a pixel at a distance from a tent that is spread evenly over a step."""
    if step < 1e-4:
        return max(0.0, 1 - abs(distance))
    return (_rising(distance + step / 2) - _rising(distance - step / 2)) / step


@inlined
def _touched(place, step, size):
    """The first and last of `size` pixels with more than a trace of a tent about `place` spread over a step."""
    reach = 1 + step / 2 - _TRACE
    return max(int(np.ceil(place - reach)), 0), min(int(np.floor(place + reach)), size - 1)


@inlined
def _listed(motion, boxes, row, column, places, filled):
    """How many pixels come to a tile, and by how much the fastest of them moves; `places` (N, 2) where filled."""
    height, width = motion.shape[:2]
    left, top = column * TILE - 1.5, row * TILE - 1.5
    right, bottom = column * TILE + TILE + 0.5, row * TILE + TILE + 0.5
    count, fastest = 0, 0.0
    for other_row in range(boxes.shape[0]):
        for other in range(boxes.shape[1]):
            box = boxes[other_row, other]
            if box[0] > right or box[2] < left or box[1] > bottom or box[3] < top:
                continue
            for y in range(other_row * TILE, min(height, other_row * TILE + TILE)):
                for x in range(other * TILE, min(width, other * TILE + TILE)):
                    across, down = abs(motion[y, x, 0]), abs(motion[y, x, 1])
                    if abs(x - (left + right) / 2) > (right - left + across) / 2:
                        continue
                    if abs(y - (top + bottom) / 2) > (bottom - top + down) / 2:
                        continue
                    if filled:
                        places[count, 0], places[count, 1] = y, x
                    fastest = max(fastest, across, down)
                    count += 1
    return count, fastest


@inlined
def _behind(motion, remoteness, y, x):
    """The nearest pixel along a pixel's way, either side, that is farther back than it; its own place for none."""
    height, width = remoteness.shape
    across, down = motion[y, x, 0], motion[y, x, 1]
    reach = max(abs(across), abs(down))
    if reach > _STILL:
        for i in range(1, int(reach) + 2):
            for side in range(-1, 2, 2):
                row, column = round(y + side * i * down / reach), round(x + side * i * across / reach)
                if 0 <= row < height and 0 <= column < width and remoteness[row, column] > remoteness[y, x] + SAME:
                    return row, column
    return y, x


@kernel
def carried_tile(light, motion, remoteness, boxes, opening, shown, known, tile):
    """Fills a tile of `shown` (H, W, 3) and of `coverage` (H, W): all that comes to it, carried and averaged.

    motion : (H, W, 2), pixels
    remoteness : (H, W), logarithms; the smaller is before the larger
    """
    height, width = remoteness.shape
    row, column = tile // boxes.shape[1], tile % boxes.shape[1]
    top, left = row * TILE, column * TILE
    rows, columns = min(TILE, height - top), min(TILE, width - left)
    count, fastest = _listed(motion, boxes, row, column, np.empty((0, 2), np.int32), False)
    if fastest < _STILL:
        shown[top : top + rows, left : left + columns] = light[top : top + rows, left : left + columns]
        known[top : top + rows, left : left + columns] = 1
        return
    places = np.empty((count, 2), np.int32)
    _listed(motion, boxes, row, column, places, True)
    near, far = np.float32(np.inf), np.float32(-np.inf)
    for i in range(count):
        remote = remoteness[places[i, 0], places[i, 1]]
        near, far = min(near, remote), max(far, remote)
    # One surface alone covers nothing.
    single = far <= near + SAME
    samples = max(int(np.ceil(2 * fastest)), 1 if opening == 0 else 8)
    nearest = np.empty((rows, columns), np.float32)
    layers = np.empty((rows, columns, 2, 4))
    whole = np.zeros((rows, columns, 3))
    known_share, hidden = np.zeros((rows, columns)), np.zeros((rows, columns))
    by_column = np.empty(4)
    lit = 0.0
    for sample in range(samples):
        time = (sample + 0.5) / samples - 0.5
        weight = 1 / samples
        if opening > 0:
            weight *= min(1.0, (0.5 - abs(time)) / opening) / (1 - opening)
        lit += weight
        nearest[:] = np.inf
        layers[:] = 0.0
        # What is nearest at each pixel, then the light of that surface and of those behind it.
        for layer in range(1 if single else 0, 2):
            for i in range(count):
                y, x = places[i, 0], places[i, 1]
                across, down = motion[y, x, 0], motion[y, x, 1]
                u, v = x + across * time - left, y + down * time - top
                wide, high = abs(across) / samples, abs(down) / samples
                first, last = _touched(u, wide, columns)
                upper, lower = _touched(v, high, rows)
                if first > last or upper > lower:
                    continue
                remote = remoteness[y, x]
                if layer == 0:
                    for b in range(upper, lower + 1):
                        for a in range(first, last + 1):
                            nearest[b, a] = min(nearest[b, a], remote)
                    continue
                for a in range(first, last + 1):
                    by_column[a - first] = _share(a - u, wide)
                red, green, blue = light[y, x, 0], light[y, x, 1], light[y, x, 2]
                for b in range(upper, lower + 1):
                    by_row = _share(b - v, high)
                    for a in range(first, last + 1):
                        share = by_row * by_column[a - first]
                        place = layers[b, a, 0 if single or remote <= nearest[b, a] + SAME else 1]
                        place[0] += share * red
                        place[1] += share * green
                        place[2] += share * blue
                        place[3] += share
        for b in range(rows):
            for a in range(columns):
                front, back = layers[b, a, 0], layers[b, a, 1]
                covered = min(front[3], 1.0)
                seen = min(back[3], 1 - covered)
                if covered + seen < 0.5:
                    hidden[b, a] += weight * (1 - covered - seen)
                    scale = weight
                else:
                    # Surfaces that grow leave no holes between their pixels.
                    scale = weight / (covered + seen)
                known_share[b, a] += scale * (covered + seen)
                for channel in range(3):
                    if covered > 0:
                        whole[b, a, channel] += scale * covered * front[channel] / front[3]
                    if seen > 0:
                        whole[b, a, channel] += scale * seen * back[channel] / back[3]
    for b in range(rows):
        for a in range(columns):
            y, x = top + b, left + a
            share = known_share[b, a]
            if hidden[b, a] > 0:
                source, place = _behind(motion, remoteness, y, x)
                if source != y or place != x:
                    share += hidden[b, a]
                    for channel in range(3):
                        whole[b, a, channel] += hidden[b, a] * light[source, place, channel]
            known[y, x] = known_share[b, a] / lit
            for channel in range(3):
                shown[y, x, channel] = whole[b, a, channel] / share if share > 0 else light[y, x, channel]

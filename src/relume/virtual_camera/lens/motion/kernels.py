"""Kernels that gather light along a path: straight by taps or running sums, or each pixel along its own."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import inlined, kernel

RUN = 16
"""Pixels along a row whose places are interpolated between the first, one in the middle and the last."""
_PIECE = 3 * 1024
_LONG = 16.0
"""Pixels of a way from which on two steps a pixel do; shorter ones have four, for their ends show."""
_UNSEEN = 4.0
"""Pixels that a way behind the camera, or all beyond one side of the picture, is taken to have at most: time passes
there too, but nothing is seen."""
_FLUSH = 32
"""Samples that are added up in 32 bits before they join the others in 64."""


@inlined
def _one_added(light, source, shift, weight, begin, end, sums):
    """Adds a weighted row of light, shifted, where there is light."""
    height, width = light.shape
    if 0 <= source < height:
        share, first, last = np.float32(weight), max(begin, -shift), min(end, width - shift)
        if first < last:
            shifted, target = light[source, first + shift : last + shift], sums[first:last]
            for i in range(len(target)):
                target[i] += share * shifted[i]


@inlined
def _four_added(light, row, rows, columns, weights, tap, begin, end, sums):
    """Adds four weighted rows of light, shifted, all of them within it."""
    # Slices are indexed from 0 on: an index that may be negative would be asked about at every step.
    one, two = (
        _shifted(light, row, rows, columns, tap, begin, end),
        _shifted(light, row, rows, columns, tap + 1, begin, end),
    )
    three, four = (
        _shifted(light, row, rows, columns, tap + 2, begin, end),
        _shifted(light, row, rows, columns, tap + 3, begin, end),
    )
    target = sums[begin:end]
    p, q = np.float32(weights[tap]), np.float32(weights[tap + 1])
    r, s = np.float32(weights[tap + 2]), np.float32(weights[tap + 3])
    for i in range(len(target)):
        target[i] += p * one[i] + q * two[i] + r * three[i] + s * four[i]


@inlined
def _shifted(light, row, rows, columns, tap, begin, end):
    return light[row + rows[tap], begin + 3 * columns[tap] : end + 3 * columns[tap]]


@kernel
def gathered(light, rows, columns, weights, out, begin, end):
    """Rows begin…end of `out` (H, 3·W): the weighted mean of `light` at the offsets that lie within it."""
    height, width = light.shape[0], light.shape[1] // 3
    totals = np.empty(width + 1)
    sums = np.empty(3 * width, np.float32)
    for row in range(begin, end):
        totals[:] = 0.0
        for tap in range(len(weights)):
            if 0 <= row + rows[tap] < height:
                first, last = max(0, -columns[tap]), min(width, width - columns[tap])
                if first < last:
                    totals[first] += weights[tap]
                    totals[last] -= weights[tap]
        sums[:] = 0
        for piece in range(0, 3 * width, _PIECE):
            stop = min(piece + _PIECE, 3 * width)
            tap = 0
            while tap < len(weights):
                together = 1
                if tap + 4 <= len(weights) and row + rows[tap] >= 0 and row + rows[tap + 3] < height:
                    together = 4
                first, last = piece, stop
                for i in range(tap, tap + together):
                    first, last = max(first, -3 * columns[i]), min(last, 3 * width - 3 * columns[i])
                if together == 4 and first == piece and last == stop:
                    # Four at a time read and write the sums once.
                    _four_added(light, row, rows, columns, weights, tap, piece, stop, sums)
                else:
                    for i in range(tap, tap + together):
                        _one_added(light, row + rows[i], 3 * columns[i], weights[i], piece, stop, sums)
                tap += together
        total = 0.0
        for column in range(width):
            total += totals[column]
            for i in range(3 * column, 3 * column + 3):
                out[row, i] = sums[i] / total


@kernel
def level_sums(light, half, weight, near, far, totals, out, begin, end):
    """Rows begin…end of `out` (H, 3·W): windows of 2·half + 1 pixels and two weaker ones beyond each end.

    A window is the end of one block and the beginning of the next, both of positive sums: nothing is taken away again,
    so that no rounding of a sun is left behind it (the block scheme of van Herk 1992 and Gil & Werman 1993, for sums).
    """
    width, size, pad = light.shape[1] // 3, 2 * half + 1, half + 2
    line = np.zeros(3 * (width + 2 * pad + size), np.float64)
    tail, head = np.zeros(3 * (size + 1), np.float64), np.zeros(3 * (size + 1), np.float64)
    shares = np.repeat(1 / totals, 3)
    for row in range(begin, end):
        line[3 * pad : 3 * (pad + width)] = light[row]
        for block in range(0, width, size):
            # The window of pixel `block` begins at line[2 + block].
            start, count = 3 * (2 + block), 3 * min(size, width - block)
            here, next_block = line[start:], line[start + 3 * size :]
            for i in range(3 * size - 1, -1, -1):
                tail[i] = tail[i + 3] + here[i]
            for i in range(count - 3):
                head[i + 3] = head[i] + next_block[i]
            before, first, last = line[start - 3 :], line[start - 6 :], next_block[3:]
            target, share = out[row, 3 * block : 3 * block + count], shares[3 * block : 3 * block + count]
            for i in range(count):
                ends = near * (before[i] + next_block[i]) + far * (first[i] + last[i])
                target[i] = share[i] * (weight * (tail[i] + head[i]) + ends)


@kernel
def upright_sums(light, half, weight, near, far, totals, out, begin, end):
    """Entries begin…end of every row of `out` (H, 3·W): as `level_sums`, along columns."""
    height, size, count = light.shape[0], 2 * half + 1, end - begin
    tail = np.empty((size + 1, count), np.float64)
    head = np.empty(count, np.float64)
    for block in range(0, height, size):
        first = block - half
        tail[size] = 0.0
        for j in range(size - 1, -1, -1):
            row = first + j
            if 0 <= row < height:
                tail[j] = tail[j + 1] + light[row, begin:end]
            else:
                tail[j] = tail[j + 1]
        head[:] = 0.0
        for j in range(min(size, height - block)):
            row, last = block + j, first + size + j - 1
            if j > 0 and last < height:
                head += light[last, begin:end]
            share, target, here = 1 / totals[row], out[row, begin:end], tail[j]
            for i in range(count):
                target[i] = share * weight * (here[i] + head[i])
            for side in range(4):
                source = row + (half + 1 + side // 2) * (1 - 2 * (side % 2))
                if 0 <= source < height:
                    end_share, beyond = np.float32(share * (near if side < 2 else far)), light[source, begin:end]
                    for i in range(count):
                        target[i] += end_share * beyond[i]


# Called, not inlined: in a loop of its own the compiler keeps to vectors (a sixth faster, measured).
@kernel
def _added_run(light, start, below, pixel_of, x, y, across, down, bend_x, bend_y, weight, sums):
    """Adds the bilinear radiance of a run of pixels whose upper left neighbours follow each other."""
    one, zero = np.float32(1), np.float32(0)
    upper, lower = light[start : start + 3 * RUN + 3], light[start + below : start + below + 3 * RUN + 3]
    for i in range(3 * RUN):
        pixel = pixel_of[i]
        right = min(max(x + pixel * (across + pixel * bend_x), zero), one)
        under = min(max(y + pixel * (down + pixel * bend_y), zero), one)
        above = (one - right) * upper[i] + right * upper[i + 3]
        beneath = (one - right) * lower[i] + right * lower[i + 3]
        sums[i] += weight * ((one - under) * above + under * beneath)


@inlined
def _added_pixel(light, height, width, x, y, weight, sums, place):
    """Adds one pixel's bilinear radiance at (x, y) from those neighbours that are there; what their weights sum to."""
    left, top = int(np.floor(x)), int(np.floor(y))
    known_share = 0.0
    for row in range(top, top + 2):
        for column in range(left, left + 2):
            if 0 <= row < height and 0 <= column < width:
                share = weight * (1 - abs(x - column)) * (1 - abs(y - row))
                known_share += share
                for channel in range(3):
                    sums[3 * place + channel] += share * light[3 * (row * width + column) + channel]
    return known_share


@kernel
def _added_inside(light, width, x, y, across, down, bend_x, bend_y, weight, sums):
    """Adds a run of pixels all of whose neighbours are there."""
    for i in range(RUN):
        u, v = x + i * (across + i * bend_x), y + i * (down + i * bend_y)
        left, top = int(u), int(v)
        right, under = np.float32(u - left), np.float32(v - top)
        upper = np.uint64(3 * (top * width + left))
        lower = upper + np.uint64(3 * width)
        a = weight * (np.float32(1) - under) * (np.float32(1) - right)
        b = weight * (np.float32(1) - under) * right
        c = weight * under * (np.float32(1) - right)
        d = weight * under * right
        for channel in range(3):
            j = np.uint64(channel)
            k = j + np.uint64(3)
            sums[3 * i + channel] += (
                a * light[upper + j] + b * light[upper + k] + c * light[lower + j] + d * light[lower + k]
            )


@kernel
def along_paths(light, height, width, matrices, times, opening, shown, known, begin, end):
    """Rows begin…end of `shown` (H·W·3,): the mean radiance along each pixel's path, and the share of it known.

    light : (H·W·3,)
    matrices : (K, 3, 3), the picture's pixel coordinates from the sensor's at the key times
    times : (K,), rising; between them a pixel goes straight and evenly
    opening : of the shutter
    known : (H, W), filled; or (0, 0)
    """
    keys = len(times)
    run = min(RUN, width)
    pixel_of = np.empty(3 * RUN, np.float32)
    for i in range(3 * RUN):
        pixel_of[i] = i // 3
    sums, whole = np.zeros(3 * RUN, np.float32), np.empty(3 * RUN)
    singles = np.empty(3 * RUN)
    known_share = np.empty(RUN)
    # Where a run's first pixel is at each key time (x, y), how far apart its pixels are, and how that changes.
    path = np.empty((keys, 6))
    ahead, lengths = np.empty(keys, np.bool_), np.empty(keys - 1)
    for row in range(begin, end):
        for part in range(-(-width // RUN)):
            column = min(part * RUN, width - run)
            for k in range(keys):
                ahead[k] = _placed(matrices[k], column, row, run, path[k])
            whole[:], singles[:], known_share[:] = 0.0, 0.0, 0.0
            all_known, lit, waiting = 0.0, 0.0, 0
            total = 0.0
            for k in range(keys - 1):
                lengths[k] = _UNSEEN
                if ahead[k] and ahead[k + 1]:
                    way = _way(path, k, run)
                    lengths[k] = min(way, _UNSEEN) if _beyond(path, k, run, height, width) else way
                total += lengths[k]
            samples = max(int(np.round(total * (2 if total > _LONG else 4))), 1 if opening == 0 else 8)
            # Each sample stands for an even part of the way and for the time that it takes.
            reached, passed, k, until = 0, 0.0, 0, times[0]
            for sample in range(samples):
                since, goal = until, (sample + 1) * total / samples
                while reached < keys - 2 and passed + lengths[reached] < goal:
                    passed += lengths[reached]
                    reached += 1
                until = times[keys - 1]
                if sample < samples - 1 and lengths[reached] > 0:
                    share = min(1.0, (goal - passed) / lengths[reached])
                    until = times[reached] + share * (times[reached + 1] - times[reached])
                time, weight = (since + until) / 2, until - since
                while k < keys - 2 and times[k + 1] < time:
                    k += 1
                part_way = (time - times[k]) / (times[k + 1] - times[k])
                if opening > 0:
                    weight *= min(1.0, (0.5 - abs(time)) / opening) / (1 - opening)
                lit += weight
                if not (ahead[k] and ahead[k + 1]):
                    continue
                x = path[k, 0] + part_way * (path[k + 1, 0] - path[k, 0])
                y = path[k, 1] + part_way * (path[k + 1, 1] - path[k, 1])
                across = path[k, 2] + part_way * (path[k + 1, 2] - path[k, 2])
                down = path[k, 3] + part_way * (path[k + 1, 3] - path[k, 3])
                bend_x = path[k, 4] + part_way * (path[k + 1, 4] - path[k, 4])
                bend_y = path[k, 5] + part_way * (path[k + 1, 5] - path[k, 5])
                last_x = x + (run - 1) * (across + (run - 1) * bend_x)
                last_y = y + (run - 1) * (down + (run - 1) * bend_y)
                left, top = int(np.floor(x)), int(np.floor(y))
                right_end, under_end = last_x - left - (run - 1), last_y - top
                follow = 0 <= right_end <= 1 and 0 <= under_end <= 1 and left + RUN < width and top + 1 < height
                # A pixel's margin: the way between the ends may bend.
                inside = min(x, last_x) >= 1 and min(y, last_y) >= 1
                inside = inside and max(x, last_x) < width - 2 and max(y, last_y) < height - 2
                if inside and run == RUN:
                    if follow:
                        _added_run(
                            light,
                            3 * (top * width + left),
                            3 * width,
                            pixel_of,
                            np.float32(x - left),
                            np.float32(y - top),
                            np.float32(across - 1),
                            np.float32(down),
                            np.float32(bend_x),
                            np.float32(bend_y),
                            np.float32(weight),
                            sums,
                        )
                    else:
                        _added_inside(light, width, x, y, across, down, bend_x, bend_y, np.float32(weight), sums)
                    all_known += weight
                    waiting += 1
                    if waiting == _FLUSH:
                        waiting = 0
                        for i in range(3 * RUN):
                            whole[i] += sums[i]
                            sums[i] = 0
                    continue
                for i in range(run):
                    u, v = x + i * (across + i * bend_x), y + i * (down + i * bend_y)
                    known_share[i] += _added_pixel(light, height, width, u, v, weight, singles, i)
            for i in range(run):
                share = all_known + known_share[i]
                place = row * width + column + i
                for channel in range(3):
                    j = 3 * i + channel
                    value = whole[j] + sums[j] + singles[j]
                    shown[3 * place + channel] = value / share if share > 0 else 0.0
                if known.size:
                    known[row, column + i] = min(share / lit, 1.0)
            sums[:] = 0


@inlined
def _way(path, k, run):
    """How far, along rows or columns, a run's first or last pixel goes from one key time to the next, pixels."""
    far = 0.0
    for i in range(0, run, max(run - 1, 1)):
        for axis in range(2):
            begun = path[k, axis] + i * (path[k, 2 + axis] + i * path[k, 4 + axis])
            done = path[k + 1, axis] + i * (path[k + 1, 2 + axis] + i * path[k + 1, 4 + axis])
            far = max(far, abs(done - begun))
    return far


@inlined
def _beyond(path, k, run, height, width):
    """Whether a run is beyond one and the same side of the picture from one key time to the next."""
    beyond = False
    for axis in range(2):
        least, most = np.inf, -np.inf
        for key in range(k, k + 2):
            for i in range(0, run, max(run - 1, 1)):
                place = path[key, axis] + i * (path[key, 2 + axis] + i * path[key, 4 + axis])
                least, most = min(least, place), max(most, place)
        # Two pixels' margin: the way between a run's ends may bend.
        beyond = beyond or most < -2 or least > (width if axis == 0 else height) + 1
    return beyond


@inlined
def _placed(matrix, column, row, run, place):
    """Fills `place` for the pixels column…column + run; whether all are before the camera.

    A parabola through the first, one in the middle and the last is what a homography does to so few pixels.
    """
    y, between, last = row + 0.5, run // 2, run - 1
    base = matrix[2, 0] * (column + 0.5) + matrix[2, 1] * y + matrix[2, 2]
    if base <= 1e-6 or base + last * matrix[2, 0] <= 1e-6:
        place[:] = 0.0
        return False
    for axis in range(2):
        above = matrix[axis, 0] * (column + 0.5) + matrix[axis, 1] * y + matrix[axis, 2]
        begun = above / base
        done = (above + last * matrix[axis, 0]) / (base + last * matrix[2, 0])
        place[axis] = begun - 0.5
        place[2 + axis], place[4 + axis] = 1.0 - axis, 0.0
        if run > 1:
            place[2 + axis] = (done - begun) / last
        if run > 2:
            passed = (above + between * matrix[axis, 0]) / (base + between * matrix[2, 0])
            bend = (done - begun - last * (passed - begun) / between) / (last * (last - between))
            place[2 + axis], place[4 + axis] = (passed - begun) / between - between * bend, bend
    return True

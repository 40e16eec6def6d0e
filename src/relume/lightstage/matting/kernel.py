"""The loops that find which area of a backdrop a pixel sees from its readings under striped backdrops.

Positions are texels along one axis of the backdrop, 0 … n. A reading is the share of the pixel's light that came from
white stripes; an area is a box, given by its middle and its width, and what it reads of picture k is the mean of the
stripes over it: differences of `cumulative[k]`, the stripes' running sum, (K, n + 1) (Zongker et al. 1999).
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import inlined, kernel

LEAST_WIDTH = 0.25
"""Texels; nothing narrower can be seen in readings of stripes."""


@inlined
def _read(cumulative, picture, middle, width):
    """What a box reads of one picture; only its part on the backdrop counts."""
    texels = cumulative.shape[1] - 1
    begin = min(max(middle - 0.5 * width, 0.0), texels - 0.01)
    end = max(min(middle + 0.5 * width, float(texels)), begin + 0.01)
    first, last = min(int(begin), texels - 1), min(int(end), texels - 1)
    low = cumulative[picture, first] + (begin - first) * (cumulative[picture, first + 1] - cumulative[picture, first])
    high = cumulative[picture, last] + (end - last) * (cumulative[picture, last + 1] - cumulative[picture, last])
    return (high - low) / (end - begin)


@inlined
def _misfit(cumulative, wanted, middle, width, expected, strength):
    """Summed squared distance of a box's readings from those wanted, and of its middle from the expected one."""
    total = strength * (middle - expected) ** 2
    for picture in range(len(wanted)):
        total += (_read(cumulative, picture, middle, width) - wanted[picture]) ** 2
    return total


@kernel
def _refined(cumulative, wanted, middle, width, expected, strength):
    """The box moved and widened in ever smaller steps to where it fits best: middle, width, misfit."""
    texels = cumulative.shape[1] - 1
    best = _misfit(cumulative, wanted, middle, width, expected, strength)
    move, growth = 0.25 * max(width, 1.0), 1.4
    for _ in range(7):
        for trial in range(6):
            # Each edge alone, the whole box, and its width alone.
            new_middle, new_width = middle, width
            sign = 1.0 if trial % 2 == 0 else -1.0
            if trial < 2:
                new_middle = middle + sign * move
            elif trial < 4:
                new_width = width * (growth if trial == 2 else 1.0 / growth)
            else:
                new_middle, new_width = middle + 0.5 * sign * move, width + move
            new_middle = min(max(new_middle, 0.0), float(texels))
            new_width = min(max(new_width, LEAST_WIDTH), float(texels))
            misfit = _misfit(cumulative, wanted, new_middle, new_width, expected, strength)
            if misfit < best:
                middle, width, best = new_middle, new_width, misfit
        move *= 0.6
        growth = 1.0 + 0.7 * (growth - 1.0)
    return middle, width, best


@kernel
def _nearest(table, wanted, cost):
    """The column of `table` (K, C) nearest to the wanted readings; `cost` (C,) is overwritten."""
    cost[:] = 0.0
    for picture in range(len(wanted)):
        value = wanted[picture]
        row = table[picture]
        for candidate in range(len(cost)):
            cost[candidate] += (row[candidate] - value) ** 2
    return np.argmin(cost)


@kernel
def fit_one(begin, end, readings, cumulative, table, middles, widths, fitted):
    """For each pixel of a range the one box along one axis that its readings (P, K) give.

    table, middles, widths : readings (K, C) of boxes to start from, and which these are
    fitted : (P, 3) float32, written: middle, width, misfit
    """
    cost = np.empty(len(middles), np.float32)
    for pixel in range(begin, end):
        wanted = readings[pixel]
        start = _nearest(table, wanted, cost)
        middle, width, misfit = _refined(cumulative, wanted, middles[start], widths[start], 0.0, 0.0)
        fitted[pixel, 0], fitted[pixel, 1], fitted[pixel, 2] = middle, width, misfit


@kernel
def fit_near(begin, end, readings, cumulative, expected, strength, fitted):
    """The boxes fitted again, drawn towards middles expected (P,) with a strength (P,), misfit a squared texel."""
    for pixel in range(begin, end):
        # As float64, as elsewhere: each kind of numbers would be compiled anew.
        middle, width = np.float64(fitted[pixel, 0]), np.float64(fitted[pixel, 1])
        middle, width, _ = _refined(cumulative, readings[pixel], middle, width, expected[pixel], strength[pixel])
        fitted[pixel, 0], fitted[pixel, 1] = middle, width
        fitted[pixel, 2] = _misfit(cumulative, readings[pixel], middle, width, 0.0, 0.0)


@kernel
def _shared(reads, readings):
    """The share of the first area's light that explains the readings best, and the misfit it leaves."""
    numerator, denominator = 0.0, 1e-9
    for picture in range(len(readings)):
        apart = reads[0, picture] - reads[1, picture]
        numerator += apart * (readings[picture] - reads[1, picture])
        denominator += apart * apart
    share = min(max(numerator / denominator, 0.02), 0.98)
    misfit = 0.0
    for picture in range(len(readings)):
        misfit += (share * reads[0, picture] + (1.0 - share) * reads[1, picture] - readings[picture]) ** 2
    return share, misfit


@kernel
def _read_area(cumulatives, counts, area, reads):
    """What an area (middle and width across, middle and width down) reads of all pictures, those across first."""
    across, down = cumulatives
    for picture in range(counts[0]):
        reads[picture] = _read(across, picture, area[0], area[1])
    for picture in range(counts[1]):
        reads[counts[0] + picture] = _read(down, picture, area[2], area[3])


@inlined
def _with_work_space(boxes):
    tables, middles, widths = boxes
    costs = (np.empty(len(middles[0]), np.float32), np.empty(len(middles[1]), np.float32))
    return tables, middles, widths, costs


@kernel
def _nearest_boxes(search, wanted, counts, area):
    """The area of the boxes in `search` (their tables, middles, widths and work space) nearest to the readings."""
    tables, middles, widths, costs = search
    start = _nearest(tables[0], wanted[: counts[0]], costs[0])
    area[0], area[1] = middles[0][start], widths[0][start]
    start = _nearest(tables[1], wanted[counts[0] :], costs[1])
    area[2], area[3] = middles[1][start], widths[1][start]


@kernel
def _alternated(cumulatives, search, readings, counts, areas, held, rounds, reads, wanted):
    """Two areas improved in turns, each fitted to what the other leaves; `held` areas stay. Share and misfit."""
    for which in range(2):
        _read_area(cumulatives, counts, areas[which], reads[which])
    share, misfit = _shared(reads, readings)
    for turn in range(rounds):  # given as np.int64: for each number written out the kernel would be compiled anew
        for which in range(2):
            if held[which]:
                continue
            part = share if which == 0 else 1.0 - share
            for picture in range(len(readings)):
                wanted[picture] = (readings[picture] - (1.0 - part) * reads[1 - which, picture]) / part
            area = areas[which]
            if turn < rounds - 1:  # the last round only moves them
                _nearest_boxes(search, wanted, counts, area)
            area[0], area[1], _ = _refined(cumulatives[0], wanted[: counts[0]], area[0], area[1], 0.0, 0.0)
            area[2], area[3], _ = _refined(cumulatives[1], wanted[counts[0] :], area[2], area[3], 0.0, 0.0)
            _read_area(cumulatives, counts, area, reads[which])
            share, misfit = _shared(reads, readings)
    return share, misfit


@kernel
def fit_two(begin, end, readings, cumulatives, boxes, counts, single, straight, fitted):
    """For each pixel of a range the two areas whose light in some shares explains its readings (P, K) best.

    readings : pictures striped across first, `counts` (2,) counts how many of each
    boxes : to start from, along both axes: what they read (K, C), their middles and widths
    single, straight : (P, 4) areas to start from: the one fitted alone, and what is seen where nothing is in the way
        (NaN where unknown); middle and width across, middle and width down
    fitted : (P, 10) float32, written: the two areas, the first one's share, the misfit
    """
    total = counts[0] + counts[1]
    areas, best = np.empty((2, 4)), np.empty((2, 4))
    reads, wanted = np.empty((2, total)), np.empty(total, np.float32)
    search = _with_work_space(boxes)
    held = np.zeros(2, np.bool_)
    bits = np.empty((2, total), np.float32)
    for pixel in range(begin, end):
        least, best_share = np.inf, 1.0
        for start in range(4):
            held[:] = False
            areas[0] = single[pixel]
            if start == 0:
                # What is seen straight through stays where it is; the rest is sought.
                if np.isnan(straight[pixel, 0]):
                    continue
                areas[1] = straight[pixel]
                held[1] = True
            elif start == 1:
                areas[1, 0], areas[1, 1] = 0.5 * (cumulatives[0].shape[1] - 1), cumulatives[0].shape[1] - 1.0
                areas[1, 2], areas[1, 3] = 0.5 * (cumulatives[1].shape[1] - 1), cumulatives[1].shape[1] - 1.0
            else:
                # Two narrow areas read 0, 1 − share, share or 1 of every picture: that names the stripes of both.
                share = 0.6 if start == 2 else 0.8
                for picture in range(total):
                    value = readings[pixel, picture]
                    first = 1.0 if value > 0.5 else 0.0
                    other = abs(value - 0.5) < 0.5 * share  # nearer to the shares than to 0 and 1
                    bits[0, picture] = first
                    bits[1, picture] = 1.0 - first if other else first
                for which in range(2):
                    _nearest_boxes(search, bits[which], counts, areas[which])
            share, misfit = _alternated(
                cumulatives, search, readings[pixel], counts, areas, held, np.int64(3), reads, wanted
            )
            if misfit < least:
                least, best_share = misfit, share
                best[:] = areas
        fitted[pixel, :4], fitted[pixel, 4:8] = best[0], best[1]
        fitted[pixel, 8], fitted[pixel, 9] = best_share, least


@inlined
def _apart(areas, which, others, share):
    """How far an area lies from the nearest of those that neighbours see (M, 4), 0 to 1, where its share counts."""
    least = 1.0
    for other in range(len(others)):
        across = abs(areas[which, 0] - others[other, 0]) / (3.0 + 0.5 * max(areas[which, 1], others[other, 1]))
        down = abs(areas[which, 2] - others[other, 2]) / (3.0 + 0.5 * max(areas[which, 3], others[other, 3]))
        least = min(least, max(across, down))
    return share * least


@kernel
def fit_among(begin, end, pixels, numbers, readings, cumulatives, boxes, counts, single, before, together, fitted):
    """Pairs of areas chosen anew, of those that a pixel and its neighbours had, to fit and to lie near neighbours'.

    pixels : (P,) places in the picture; numbers : (H, W), the other way round, −1 for pixels of one area
    readings : (P, K); single : (H · W, 4); before : (P, 10), as `fit_two` wrote them
    together : the misfit that an area far from all neighbours' costs
    fitted : (P, 10) float32, written alike
    """
    height, width = numbers.shape
    total = counts[0] + counts[1]
    areas, best = np.empty((2, 4)), np.empty((2, 4))
    reads, wanted = np.empty((2, total)), np.empty(total, np.float32)
    search, held = _with_work_space(boxes), np.zeros(2, np.bool_)
    around = np.empty((16, 4))
    for pixel in range(begin, end):
        row, column = pixels[pixel] // width, pixels[pixel] % width
        seen = 0
        for step in range(9):
            y, x = row + step // 3 - 1, column + step % 3 - 1
            if step == 4 or y < 0 or x < 0 or y >= height or x >= width:
                continue
            other = numbers[y, x]
            if other < 0:
                around[seen] = single[y * width + x]
                seen += 1
            else:
                around[seen], around[seen + 1] = before[other, :4], before[other, 4:8]
                seen += 2
        least, best_share, best_misfit = np.inf, 1.0, np.inf
        for start in range(1 + 2 * seen):
            areas[0], areas[1] = before[pixel, :4], before[pixel, 4:8]
            if start > 0:
                areas[start % 2] = around[(start - 1) // 2]
            share, misfit = _alternated(
                cumulatives, search, readings[pixel], counts, areas, held, np.int64(1), reads, wanted
            )
            cost = misfit + together * _apart(areas, 0, around[:seen], share)
            cost += together * _apart(areas, 1, around[:seen], 1.0 - share)
            if cost < least:
                least, best_share, best_misfit = cost, share, misfit
                best[:] = areas
        fitted[pixel, :4], fitted[pixel, 4:8] = best[0], best[1]
        fitted[pixel, 8], fitted[pixel, 9] = best_share, best_misfit


@kernel
def box_means(begin, end, table, areas, means):
    """The mean of a picture over boxes (P, 4) in parts of its sides, from its summed-area table (h + 1, w + 1, 3).

    Of a box that reaches beyond the picture only the part on it counts; none narrower than a thousandth of a pixel is.
    """
    height, width = table.shape[0] - 1, table.shape[1] - 1
    for pixel in range(begin, end):
        left, right = _within(areas[pixel, 0], areas[pixel, 1], width)
        upper, lower = _within(areas[pixel, 2], areas[pixel, 3], height)
        size = (right - left) * (lower - upper)
        for channel in range(3):
            total = _sum_to(table, lower, right, channel) - _sum_to(table, upper, right, channel)
            total -= _sum_to(table, lower, left, channel) - _sum_to(table, upper, left, channel)
            means[pixel, channel] = total / size


@inlined
def _within(middle, width, pixels):
    """Where a box begins and ends, pixels."""
    begin = min(max((middle - 0.5 * width) * pixels, 0.0), pixels - 0.001)
    return begin, max(min((middle + 0.5 * width) * pixels, float(pixels)), begin + 0.001)


@inlined
def _sum_to(table, y, x, channel):
    """The picture's sum from its corner to (x, y): bilinear in the table, as its pixels are squares."""
    row, column = min(int(y), table.shape[0] - 2), min(int(x), table.shape[1] - 2)
    down, across = y - row, x - column
    upper = table[row, column, channel] * (1.0 - across) + table[row, column + 1, channel] * across
    lower = table[row + 1, column, channel] * (1.0 - across) + table[row + 1, column + 1, channel] * across
    return upper * (1.0 - down) + lower * down

"""Loops over the pixels of histogram adjustment and of what the eye does to a picture before it."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import inlined, kernel


@kernel
def averaged(picture, tops, lefts, begin, end, samples):
    """Means (rows, columns, 3) of the pixels that lie within each sample."""
    columns = samples.shape[1]
    for i in range(begin, end):
        sums = np.zeros((columns, 3))
        for y in range(tops[i], tops[i + 1]):
            for j in range(columns):
                red = green = blue = np.float32(0)
                for x in range(lefts[j], lefts[j + 1]):
                    red += picture[y, x, 0]
                    green += picture[y, x, 1]
                    blue += picture[y, x, 2]
                sums[j, 0] += red
                sums[j, 1] += green
                sums[j, 2] += blue
        for j in range(columns):
            count = (tops[i + 1] - tops[i]) * (lefts[j + 1] - lefts[j])
            for c in range(3):
                samples[i, j, c] = sums[j, c] / count


@kernel
def scattered(rays, solid_angle, own, light, begin, end, veil):
    """The veil at every sample: light of the others, by angle and solid angle (Moon & Spencer 1945)."""
    channels = light.shape[1]
    total = np.empty(channels)
    for i in range(begin, end):
        weights = own[i]
        total[:] = weights * light[i]
        for j in range(len(rays)):
            cosine = rays[i, 0] * rays[j, 0] + rays[i, 1] * rays[j, 1] + rays[i, 2] * rays[j, 2]
            if j == i or cosine <= 0:
                continue
            weight = solid_angle[j] * cosine / (2 - 2 * cosine)
            weights += weight
            for c in range(channels):
                total[c] += weight * light[j, c]
        for c in range(channels):
            veil[i, c] = total[c] / weights


@inlined
def _row_between(grid, first, share):
    below = min(first + 1, len(grid) - 1)
    return grid[first] + share * (grid[below] - grid[first])


@kernel
def added(radiance, kept, veil, top, down, left, right, begin, end, seen):
    """The picture with its veil, which is interpolated between the samples."""
    last = veil.shape[1] - 1
    for y in range(begin, end):
        row = _row_between(veil, top[y], down[y])
        for x in range(radiance.shape[1]):
            near, far, share = left[x], min(left[x] + 1, last), right[x]
            for c in range(3):
                seen[y, x, c] = kept * radiance[y, x, c] + row[near, c] + share * (row[far, c] - row[near, c])


@kernel
def greyed(radiance, to_xyz, scale, cones, top, down, left, right, begin, end, seen):
    """The picture as rods see it where cones are out of work, interpolated between the samples."""
    last = cones.shape[1] - 1
    matrix = to_xyz.astype(np.float32)
    one, blend, ratio, offset = np.float32(1), np.float32(scale), np.float32(1.33), np.float32(1.68)
    for y in range(begin, end):
        row = _row_between(cones, top[y], down[y])
        for x in range(radiance.shape[1]):
            near, far = left[x], min(left[x] + 1, last)
            share = row[near] + right[x] * (row[far] - row[near])
            red, green, blue = radiance[y, x, 0], radiance[y, x, 1], radiance[y, x, 2]
            grey = np.float32(0)
            if share < one:
                big_x = matrix[0, 0] * red + matrix[0, 1] * green + matrix[0, 2] * blue
                big_y = matrix[1, 0] * red + matrix[1, 1] * green + matrix[1, 2] * blue
                big_z = matrix[2, 0] * red + matrix[2, 1] * green + matrix[2, 2] * blue
                if big_x > 0:
                    grey = max(big_y * (ratio * (one + (big_y + big_z) / big_x) - offset), np.float32(0))
                grey *= blend * (one - share)
            seen[y, x, 0] = share * red + grey
            seen[y, x, 1] = share * green + grey
            seen[y, x, 2] = share * blue + grey


@kernel
def halved(finer, begin, end, coarser):
    """Half the rows and columns by weights 1, 3, 3, 1 along each: a few times over, they come near a Gaussian."""
    height, width = finer.shape[:2]
    one, three = np.float32(1 / 8), np.float32(3 / 8)
    rows = np.empty((width, 3), np.float32)
    for y in range(begin, end):
        above, below = finer[max(2 * y - 1, 0)], finer[min(2 * y + 2, height - 1)]
        upper, lower = finer[2 * y], finer[min(2 * y + 1, height - 1)]
        for x in range(width):
            for c in range(3):
                rows[x, c] = one * (above[x, c] + below[x, c]) + three * (upper[x, c] + lower[x, c])
        for x in range(coarser.shape[1]):
            before, left, right, after = max(2 * x - 1, 0), 2 * x, min(2 * x + 1, width - 1), min(2 * x + 2, width - 1)
            for c in range(3):
                coarser[y, x, c] = one * (rows[before, c] + rows[after, c]) + three * (rows[left, c] + rows[right, c])


@inlined
def _spline(place):
    """Weights of a sample and its two neighbours, the place being that from the sample's middle, −½ to ½."""
    before, after = np.float32(0.5) - place, np.float32(0.5) + place
    half = np.float32(0.5)
    return half * before * before, np.float32(0.75) - place * place, half * after * after


@kernel
def blended(radiance, deeper, starts, sizes, width, top, down, left, right, begin, end, seen):
    """The picture blurred by a width that changes from pixel to pixel, between levels of a pyramid."""
    last, deepest = width.shape[1] - 1, len(sizes) - 1
    for y in range(begin, end):
        row = _row_between(width, top[y], down[y])
        for x in range(radiance.shape[1]):
            near, far = left[x], min(left[x] + 1, last)
            size = row[near] + right[x] * (row[far] - row[near])
            level = 0
            while level < deepest and size > np.float32(2 << level):
                level += 1
            if size <= 1:
                for c in range(3):
                    seen[y, x, c] = radiance[y, x, c]
                continue
            # Between the level below the width and the next one; the coarsest is not gone beyond.
            coarse = min(size / np.float32(1 << level) - np.float32(1), np.float32(1))
            if level == deepest:
                coarse = np.float32(0)
            red = green = blue = np.float32(0)
            for step in range(2):
                share = coarse if step else np.float32(1) - coarse
                if share == 0:
                    continue
                if level + step == 0:
                    red += share * radiance[y, x, 0]
                    green += share * radiance[y, x, 1]
                    blue += share * radiance[y, x, 2]
                    continue
                rows, columns = sizes[level + step]
                start, scale = starts[level + step - 1], np.float32(1.0 / (1 << (level + step)))
                py, px = (y + np.float32(0.5)) * scale, (x + np.float32(0.5)) * scale
                iy, ix = min(int(py), rows - 1), min(int(px), columns - 1)
                wy = _spline(np.float32(py - iy) - np.float32(0.5))
                wx = _spline(np.float32(px - ix) - np.float32(0.5))
                for a in range(3):
                    line = start + min(max(iy + a - 1, 0), rows - 1) * columns
                    for b in range(3):
                        place = line + min(max(ix + b - 1, 0), columns - 1)
                        weight = share * wy[a] * wx[b]
                        red += weight * deeper[place, 0]
                        green += weight * deeper[place, 1]
                        blue += weight * deeper[place, 2]
            seen[y, x, 0] = red
            seen[y, x, 1] = green
            seen[y, x, 2] = blue


@kernel
def counted(radiance, red, green, blue, begin, end):
    """How many luminances have each upper half of a float32, and the least and the greatest above 0."""
    counts = np.zeros(1 << 15, np.int64)
    luminance = np.empty(radiance.shape[1], np.float32)
    bits = luminance.view(np.uint32)
    least, most = np.float32(np.inf), np.float32(0)
    for y in range(begin, end):
        for x in range(radiance.shape[1]):
            luminance[x] = red * radiance[y, x, 0] + green * radiance[y, x, 1] + blue * radiance[y, x, 2]
        for x in range(radiance.shape[1]):
            counts[bits[x] >> 16] += 1
            most = max(most, luminance[x])
            if luminance[x] > 0:
                least = min(least, luminance[x])
    return counts, least, most


@kernel
def shown_by(radiance, red, green, blue, gains, begin, end, display):
    """Each pixel times the gain at its luminance, linear between the edges of the upper halves."""
    luminance = np.empty(radiance.shape[1], np.float32)
    bits = luminance.view(np.uint32)
    part = np.float32(1 / 65536)
    for y in range(begin, end):
        for x in range(radiance.shape[1]):
            luminance[x] = red * radiance[y, x, 0] + green * radiance[y, x, 1] + blue * radiance[y, x, 2]
        for x in range(radiance.shape[1]):
            half = bits[x] >> 16
            share = np.float32(bits[x] & 0xFFFF) * part
            gain = gains[half] + share * (gains[half + 1] - gains[half])
            for c in range(3):
                display[y, x, c] = gain * radiance[y, x, c]

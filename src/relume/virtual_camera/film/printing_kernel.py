"""One pass from radiance through negative, grain and paper, row by row."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_kernel
from relume.virtual_camera.film.float_table import looked_up
from relume.virtual_camera.film.grain_kernels import GOLDEN, mixed

MASK = np.uint64(0xFFFF)
S16, S32, S48 = (np.uint64(n) for n in (16, 32, 48))
MIDDLE, UNIT = np.float32(131070.0), np.float32(1 / np.sqrt((2.0**32 - 1) / 3))


@exact_kernel
def noise_row(seed, layer, row, taps, out):
    """Noise (W,) float32 along a row, smoothed by `taps` within it; before them, of variance 1 and independent.

    Four even numbers of 16 bits summed are nearly normal: no value beyond 3.5 deviations, and kurtosis 2.7 of 3.
    """
    reach = taps.shape[0] // 2
    width = out.shape[0]
    key = mixed(mixed(mixed(seed + GOLDEN) + np.uint64(layer) * GOLDEN) + np.uint64(row) * GOLDEN)
    white = np.empty(width + 2 * reach, np.float32)
    for x in range(width + 2 * reach):
        drawn = mixed(key + np.uint64(x + 1) * GOLDEN)
        total = np.int64(drawn & MASK) + np.int64((drawn >> S16) & MASK)
        total += np.int64((drawn >> S32) & MASK) + np.int64(drawn >> S48)
        white[x] = (np.float32(total) - MIDDLE) * UNIT
    for x in range(width):
        smooth = taps[0] * white[x]
        for k in range(1, taps.shape[0]):
            smooth += taps[k] * white[x + k]
        out[x] = smooth


@exact_kernel
def gather(radiance, sensitivity, step, begin, end, out):
    """Mean exposure of blocks of step × step pixels: rows begin…end of `out` (layers, rows, columns) float32."""
    height, width = radiance.shape[:2]
    for row in range(begin, end):
        top, bottom = row * step, min((row + 1) * step, height)
        for column in range(out.shape[2]):
            left, right = column * step, min((column + 1) * step, width)
            red = green = blue = 0.0
            for y in range(top, bottom):
                for x in range(left, right):
                    red += radiance[y, x, 0]
                    green += radiance[y, x, 1]
                    blue += radiance[y, x, 2]
            count = (bottom - top) * (right - left)
            for layer in range(out.shape[0]):
                weights = sensitivity[layer]
                out[layer, row, column] = (weights[0] * red + weights[1] * green + weights[2] * blue) / count


@exact_kernel
def add_halo(exposed, share, halo, step, row):
    """A row of exposures with the halo's share in place of so much of their own; between blocks it is bilinear."""
    rows, columns = halo.shape
    y = min(max((row + 0.5) / step - 0.5, 0.0), rows - 1.0)
    top = min(int(y), max(rows - 2, 0))
    bottom, down = min(top + 1, rows - 1), np.float32(y - top)
    for column in range(exposed.shape[0]):
        x = min(max((column + 0.5) / step - 0.5, 0.0), columns - 1.0)
        left = min(int(x), max(columns - 2, 0))
        right, across = min(left + 1, columns - 1), np.float32(x - left)
        above = halo[top, left] + across * (halo[top, right] - halo[top, left])
        below = halo[bottom, left] + across * (halo[bottom, right] - halo[bottom, left])
        exposed[column] += share * (above + down * (below - above) - exposed[column])


@exact_kernel
def print_rows(
    radiance, sensitivity, shares, halo, step, negative, strengths, lows, highs, taps, seed, minima, crosstalk,
    lowest, fineness, prints, begin, end, out,
):  # fmt: skip
    """Rows begin…end of a print (H, W, 3) float32.

    sensitivity : (layers, 3) float32, lx·s per unit of radiance
    shares, halo, step : of halation; (layers,), (layers, rows, columns) exposures, pixels to a block
    negative : (layers, N) tables of density over exposure
    strengths, lows, highs : (layers,) noise σ = strength √((D − low)(high − D)); strength 0 for none
    taps : of the clumps; seed : uint64
    minima, crosstalk : (layers,), (layers, layers)
    lowest, fineness, prints : (layers, M) display values at densities lowest + i / fineness
    """
    layers, width = sensitivity.shape[0], radiance.shape[1]
    reach = taps.shape[0] // 2
    last = prints.shape[1] - 2
    density = np.empty((layers, width), np.float32)
    exposed = np.empty(width, np.float32)
    bits = exposed.view(np.int32)
    noise = np.empty(width, np.float32)
    smoothed = np.empty((layers, taps.shape[0], width), np.float32)
    for row in range(begin, end):
        # The negative: light exposes each layer, its halo included, and the curve makes density.
        for layer in range(layers):
            red, green, blue = sensitivity[layer, 0], sensitivity[layer, 1], sensitivity[layer, 2]
            for x in range(width):
                exposed[x] = red * radiance[row, x, 0] + green * radiance[row, x, 1] + blue * radiance[row, x, 2]
            if shares[layer] > 0:
                add_halo(exposed, shares[layer], halo[layer], step, row)
            table, own = negative[layer], density[layer]
            for x in range(width):
                own[x] = looked_up(table, bits[x])
            if strengths[layer] > 0:
                # A ring of rows: row y has its place at y modulo their number, so each is drawn once.
                first = row + reach if row > begin else row - reach
                for y in range(first, row + reach + 1):
                    noise_row(seed, layer, y + reach, taps, smoothed[layer, (y + reach) % taps.shape[0]])
                noise[:] = np.float32(0)
                for k in range(taps.shape[0]):
                    weight, ring = taps[k], smoothed[layer, (row + k) % taps.shape[0]]
                    for x in range(width):
                        noise[x] += weight * ring[x]
                strength, low, high = strengths[layer], lows[layer], highs[layer]
                for x in range(width):
                    spread = max((own[x] - low) * (high - own[x]), np.float32(0))
                    own[x] += strength * np.sqrt(spread) * noise[x]
        # The print: what each of its layers is exposed to through the negative's dyes.
        for layer in range(layers):
            table = prints[layer]
            for x in range(width):
                seen = minima[layer]
                for other in range(layers):
                    seen += crosstalk[layer, other] * (density[other, x] - minima[other])
                place = min(max((seen - lowest) * fineness, np.float32(0)), np.float32(last + 1))
                entry = min(int(place), last)
                below = table[entry]
                out[row, x, layer] = below + (place - np.float32(entry)) * (table[entry + 1] - below)
        # One layer is grey.
        for layer in range(layers, 3):
            for x in range(width):
                out[row, x, layer] = out[row, x, 0]

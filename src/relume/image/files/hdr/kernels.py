"""The loops over the bytes of Radiance pictures: where scan lines begin, their pixels, and the way back.

Each takes flat arrays and a stretch of scan lines, so that stretches run side by side. `find_lines` holds every count
in the file against the line and the file's end; `decode_lines` walks the same bytes again without asking.
"""

from __future__ import annotations

import numpy as np

from relume.image.kernel import exact_inlined, exact_kernel

ENDS_EARLY, EMPTY_RUN, LONG_RUN, NOTHING_TO_REPEAT, OTHER_LENGTH = 1, 2, 3, 4, 5
"""Why `find_lines` stopped before the last line."""

_SHORTEST, _LONGEST = 8, 32767  # pixels of a line that new runs can hold: its length has 15 bits
_LONGEST_RUN, _LONGEST_LITERAL, _SHORTEST_RUN = 127, 128, 4  # bytes; a shorter run saves nothing between literals


@exact_inlined
def _is_marked(data, place, length):
    return (
        _SHORTEST <= length <= _LONGEST
        and place + 4 <= data.size
        and data[place] == 2
        and data[place + 1] == 2
        and data[place + 2] < 128
    )


@exact_kernel
def find_lines(data, lines, length, begins):
    """Fill `begins` ((lines + 1,) int64) with where each line's bytes begin, as far as lines are whole.

    Returns (whole lines, the byte where it stopped, why: 0 where all are whole).
    """
    place = 0
    for line in range(lines):
        begins[line] = place
        if _is_marked(data, place, length):
            if (data[place + 2] << 8 | data[place + 3]) != length:
                return line, place, OTHER_LENGTH
            place += 4
            for _ in range(4):
                left = length
                while left > 0:
                    if place >= data.size:
                        return line, data.size, ENDS_EARLY
                    code = np.int64(data[place])
                    is_run = code > 128
                    count = code - 128 if is_run else code
                    if count == 0:
                        return line, place, EMPTY_RUN
                    if count > left:
                        return line, place, LONG_RUN
                    left -= count
                    place += 2 if is_run else 1 + count
            if place > data.size:
                return line, data.size, ENDS_EARLY
        else:
            left = length
            shift = 0
            while left > 0:
                if place + 4 > data.size:
                    return line, data.size, ENDS_EARLY
                if data[place] == 1 and data[place + 1] == 1 and data[place + 2] == 1:
                    # Runs that follow each other are digits to base 256; no line is longer than four of them say.
                    count = np.int64(data[place + 3]) << min(shift, 32)
                    if left == length:
                        return line, place, NOTHING_TO_REPEAT
                    if count > left:
                        return line, place, LONG_RUN
                    left -= count
                    shift += 8
                else:
                    left -= 1
                    shift = 0
                place += 4
    begins[lines] = place
    return lines, place, 0


@exact_kernel
def decode_lines(data, begins, first, last, length, scale, middle, out, start, line_step, pixel_step):
    """Pixels of the lines first…last − 1 into the flat float32 `out`, which `find_lines` found whole.

    scale : (3, 256) float64, what a mantissa of each channel is worth at each exponent
    middle : added to mantissas, 0 or ½
    start, line_step, pixel_step : where in `out` the first pixel is, and how far it is to the next line and pixel
    """
    planes = np.empty(4 * length, np.uint8)
    for line in range(first, last):
        place = begins[line]
        to = start + line * line_step
        # New runs: four planes of bytes one after the other, put together to pixels.
        if _is_marked(data, place, length):
            place += 4
            filled = 0
            while filled < 4 * length:
                code = np.int64(data[place])
                if code > 128:
                    value = data[place + 1]
                    for i in range(filled, filled + code - 128):
                        planes[i] = value
                    filled += code - 128
                    place += 2
                else:
                    for i in range(code):
                        planes[filled + i] = data[place + 1 + i]
                    filled += code
                    place += 1 + code
            # The four planes as pixels.
            for i in range(length):
                exponent = planes[3 * length + i]
                out[to] = (planes[i] + middle) * scale[0, exponent]
                out[to + 1] = (planes[length + i] + middle) * scale[1, exponent]
                out[to + 2] = (planes[2 * length + i] + middle) * scale[2, exponent]
                to += pixel_step
        # Flat pixels, or old runs that repeat the last one.
        else:
            left = length
            shift = 0
            while left > 0:
                count = 1
                source = place
                if data[place] == 1 and data[place + 1] == 1 and data[place + 2] == 1:
                    count = np.int64(data[place + 3]) << min(shift, 32)
                    shift += 8
                    for _ in range(count):
                        for channel in range(3):
                            out[to + channel] = out[to - pixel_step + channel]
                        to += pixel_step
                else:
                    shift = 0
                    exponent = data[source + 3]
                    for channel in range(3):
                        out[to + channel] = (data[source + channel] + middle) * scale[channel, exponent]
                    to += pixel_step
                left -= count
                place += 4


@exact_inlined
def _exponent_of_tiny(value, steps):
    """Of the largest channel where a float has no leading 1, or is no positive number: 0, 1, 2 or 3."""
    if np.rint(np.float64(value) * steps[1]) < 128:
        return 0
    exponent = 1
    while np.rint(np.float64(value) * steps[exponent]) > 255:
        exponent += 1
    return exponent


@exact_inlined
def _write_runs(codes, begin, end, out, used):
    """Codes begin…end − 1 as runs and literals into out[used:]; returns how much of `out` is used then."""
    pending = begin
    at = begin
    while pending < end:
        first = end
        stop = end
        # No run of four begins at the next three bytes unless the third equals the fourth.
        while at + 3 < end:
            if codes[at + 3] != codes[at + 2]:
                at += 3
                continue
            first = at + 2
            while first > at and codes[first - 1] == codes[at + 2]:
                first -= 1
            stop = at + 4
            while stop < end and stop - first < _LONGEST_RUN and codes[stop] == codes[first]:
                stop += 1
            at = stop
            if stop - first >= _SHORTEST_RUN:
                break
            first = end
            stop = end
        while pending < first:
            count = min(first - pending, _LONGEST_LITERAL)
            out[used] = count
            for i in range(count):
                out[used + 1 + i] = codes[pending + i]
            used += 1 + count
            pending += count
        if first < end:
            out[used] = 128 + stop - first
            out[used + 1] = codes[first]
            used += 2
        pending = stop
    return used


@exact_kernel
def encode_lines(pixels, bits, lines, length, compressed, steps, slack, out):
    """RGBE bytes of lines of pixels into `out`; how many bytes, and how many pixels RGBE cannot hold or blackens.

    pixels, bits : the same flat float32, as numbers and as int32
    compressed : with new runs, where the length of a line allows them
    steps : (256,) float64, how many mantissas 1.0 is at each exponent
    slack : how negative a channel may be, as a share of the largest
    out : at least 4 + 4·(length + length / 128 + 1) bytes a line
    """
    runs = compressed and _SHORTEST <= length <= _LONGEST
    pixel_step, plane_step = (1, length) if runs else (4, 1)
    codes = np.empty(4 * length, np.uint8)
    used = 0
    unfit = 0
    dark = 0
    for line in range(lines):
        for i in range(length):
            at = 3 * (line * length + i)
            # Positive floats order as their bits do. Half a step more, and a mantissa that would round to 256 has
            # carried into the exponent, which counts from 126 in a float and from 128 here.
            largest = max(bits[at], bits[at + 1], bits[at + 2])
            exponent = ((np.int64(largest) + 0x8000) >> 23) + 2
            if largest < 0x00800000:
                exponent = _exponent_of_tiny(max(pixels[at], pixels[at + 1], pixels[at + 2]), steps)
            fits = exponent <= 255
            least = -slack * max(pixels[at], pixels[at + 1], pixels[at + 2])
            step = steps[exponent & 255]
            to = i * pixel_step
            for channel in range(3):
                fits = fits and pixels[at + channel] >= least  # False for NaN too
                code = np.uint8(np.rint(np.float64(pixels[at + channel]) * step)) if fits else np.uint8(0)
                codes[to + channel * plane_step] = code
            codes[to + 3 * plane_step] = exponent & 255
            unfit += 0 if fits else 1
            dark += 1 if fits and exponent == 0 and largest > 0 else 0
        if not runs:
            out[used : used + 4 * length] = codes
            used += 4 * length
            continue
        out[used], out[used + 1], out[used + 2], out[used + 3] = 2, 2, length >> 8, length & 255
        used += 4
        for plane in range(4):
            used = _write_runs(codes, plane * length, (plane + 1) * length, out, used)
    return used, unfit, dark

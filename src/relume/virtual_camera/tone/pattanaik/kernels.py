"""The loops of the multiscale model: what a base and a band of a scene become on a screen."""

from __future__ import annotations

import numpy as np

from relume.image.kernel import inlined, kernel
from relume.virtual_camera.tone.pattanaik.transducers import BEYOND, COMMON_RESPONSE, ROD_SHARE

_ONE, _ZERO = np.float32(1), np.float32(0)
_RESPONSE, _BEYOND, _SHARE = np.float32(COMMON_RESPONSE), np.float32(BEYOND), np.float32(ROD_SHARE)


@inlined
def _cone_gain(light):
    return _ONE / (np.float32(0.555) * (light + _ONE) ** np.float32(0.85))


@inlined
def _rod_gain(light):
    dark = np.float32(10) / (light * light + np.float32(10))
    return dark / (np.float32(0.908) * (light + np.float32(0.001)) ** np.float32(0.85))


@inlined
def _response(size, threshold, meeting, exponent):
    if size <= threshold:
        return size / threshold
    if size <= meeting:
        return (size / threshold) ** exponent
    return _RESPONSE * (size / meeting) ** _BEYOND


@inlined
def _contrast(response, threshold, meeting, exponent):
    """The inverse of `_response`."""
    if response <= _ONE:
        return response * threshold
    if response <= _RESPONSE:
        return threshold * response ** (_ONE / exponent)
    return meeting * (response / _RESPONSE) ** (_ONE / _BEYOND)


@kernel
def shown_base(base, seen, shown, target):
    """The scene's low-pass, adapted to itself, as luminances of the screen (h, w, 3).

    There are no transducers: a base has no contrast. What rods see of it is grey.
    """
    seen, shown = seen.astype(np.float32), shown.astype(np.float32)
    for y in range(base.shape[0]):
        for x in range(base.shape[1]):
            r, g, b = base[y, x, 0], base[y, x, 1], base[y, x, 2]
            long = seen[0, 0] * r + seen[0, 1] * g + seen[0, 2] * b
            middle = seen[1, 0] * r + seen[1, 1] * g + seen[1, 2] * b
            short = seen[2, 0] * r + seen[2, 1] * g + seen[2, 2] * b
            rods = max(seen[3, 0] * r + seen[3, 1] * g + seen[3, 2] * b, _ZERO)
            grey = _SHARE * rods * _rod_gain(rods)
            long = long * _cone_gain(long) + grey
            middle = middle * _cone_gain(middle) + grey
            short = short * _cone_gain(short) + grey
            for c in range(3):
                target[y, x, c] = shown[c, 0] * long + shown[c, 1] * middle + shown[c, 2] * short


@kernel
def add_band(fine, coarse, picture, ratio, first, seen, achromatic, shown, bends, rods_see, target):
    """What the screen shows up to a band, rows (n, W, 3), from what it shows up to the next coarser one.

    fine, coarse : the scene's two blurs whose difference the band is
    picture : shown up to `coarse`, of its size
    ratio, first : of their pixels' sizes; the row of `fine` that would be the first, were it as high as `coarse`
    bends : (2, 3), threshold, meeting and exponent of the transducers of cones and of rods

    Scene and screen share the transducers, so that those of red–green and yellow–blue undo each other, and the
    achromatic one does wherever rods add nothing: only what rods add is worked out.
    """
    seen, shown, achromatic = seen.astype(np.float32), shown.astype(np.float32), achromatic.astype(np.float32)
    bends = bends.astype(np.float32)
    height, width = coarse.shape[0], coarse.shape[1]
    part = _ONE / np.float32(ratio)
    low = np.empty(3, np.float32)
    result = np.empty(3, np.float32)
    for y in range(fine.shape[0]):
        # Linear interpolation between the middles of the coarse pixels, mirrored at the border.
        place = (np.float32(first + y) + np.float32(0.5)) * part - np.float32(0.5)
        above = int(np.floor(place))
        down = place - np.float32(above)
        top, bottom = max(above, 0), min(above + 1, height - 1)
        for x in range(fine.shape[1]):
            place = (np.float32(x) + np.float32(0.5)) * part - np.float32(0.5)
            before = int(np.floor(place))
            across = place - np.float32(before)
            left, right = max(before, 0), min(before + 1, width - 1)
            a, b = (_ONE - down) * (_ONE - across), (_ONE - down) * across
            c, d = down * (_ONE - across), down * across
            for k in range(3):
                low[k] = a * coarse[top, left, k] + b * coarse[top, right, k]
                low[k] += c * coarse[bottom, left, k] + d * coarse[bottom, right, k]
                result[k] = a * picture[top, left, k] + b * picture[top, right, k]
                result[k] += c * picture[bottom, left, k] + d * picture[bottom, right, k]
            red, green, blue = fine[y, x, 0], fine[y, x, 1], fine[y, x, 2]
            # Contrasts of the cones, in units of what each is adapted to.
            around = seen[0, 0] * low[0] + seen[0, 1] * low[1] + seen[0, 2] * low[2]
            long = (seen[0, 0] * red + seen[0, 1] * green + seen[0, 2] * blue - around) * _cone_gain(around)
            around = seen[1, 0] * low[0] + seen[1, 1] * low[1] + seen[1, 2] * low[2]
            middle = (seen[1, 0] * red + seen[1, 1] * green + seen[1, 2] * blue - around) * _cone_gain(around)
            around = seen[2, 0] * low[0] + seen[2, 1] * low[1] + seen[2, 2] * low[2]
            short = (seen[2, 0] * red + seen[2, 1] * green + seen[2, 2] * blue - around) * _cone_gain(around)
            # What the rods add to the achromatic contrast.
            if rods_see:
                around = max(seen[3, 0] * low[0] + seen[3, 1] * low[1] + seen[3, 2] * low[2], _ZERO)
                rods = max(seen[3, 0] * red + seen[3, 1] * green + seen[3, 2] * blue, _ZERO)
                rods = (rods - around) * _rod_gain(around)
                cones = achromatic[0] * long + achromatic[1] * middle + achromatic[2] * short
                both = _response(abs(rods), bends[1, 0], bends[1, 1], bends[1, 2]) * _SHARE
                if rods < _ZERO:
                    both = -both
                own = _response(abs(cones), bends[0, 0], bends[0, 1], bends[0, 2])
                both += own if cones >= _ZERO else -own
                grey = _contrast(abs(both), bends[0, 0], bends[0, 1], bends[0, 2])
                grey = (grey if both >= _ZERO else -grey) - cones
                long, middle, short = long + grey, middle + grey, short + grey
            # The contrasts on the screen, over what is shown up to the coarser band.
            for k in range(3):
                target[y, x, k] = result[k] + shown[k, 0] * long + shown[k, 1] * middle + shown[k, 2] * short

"""The loop over the pixels of a gain map's two pictures, compiled."""

from __future__ import annotations

import numpy as np

from relume._kernel import kernel


@kernel
def bright_rows(
    base: np.ndarray,
    curves: np.ndarray,
    mixing: np.ndarray,
    codes: np.ndarray,
    gains: np.ndarray,
    parameters: np.ndarray,
    begin: int,
    end: int,
    result: np.ndarray,
) -> None:
    """Rows begin to end of the bright picture into `result`, in the primaries that gains are for.

    base : (H, W, 1 or 3) uint8; curves : (256, 3) float32, linear values of its codes
    mixing : (3, 3) float32 from the base's primaries to those of the gains
    codes : (h, w, 1 or 3) uint8, the map; gains : (256, 3) float32, factors of its codes, for a map of the base's size
    parameters : (5, 3) float32; low, high − low, 1 / gamma, base offset, bright offset
    result : (end − begin, W, 3) float32
    """
    height, width, base_channels = base.shape
    map_height, map_width, map_channels = codes.shape
    same = map_height == height and map_width == width
    for row in range(begin, end):
        # Centres of pixels: the map's pixel y + ½ lies where the base's does, in shares of the height.
        y = min(max((row + 0.5) * map_height / height - 0.5, 0.0), map_height - 1.0)
        y0 = int(y)
        y1 = min(y0 + 1, map_height - 1)
        dy = np.float32(y - y0)
        for column in range(width):
            x = min(max((column + 0.5) * map_width / width - 0.5, 0.0), map_width - 1.0)
            x0 = int(x)
            x1 = min(x0 + 1, map_width - 1)
            dx = np.float32(x - x0)
            # The base, linear.
            first = curves[base[row, column, 0], 0]
            second = curves[base[row, column, min(1, base_channels - 1)], 1]
            third = curves[base[row, column, base_channels - 1], 2]
            for channel in range(3):
                # The gain of this channel, interpolated where the map is smaller.
                source = min(channel, map_channels - 1)
                if same:
                    factor = gains[codes[row, column, source], channel]
                else:
                    upper = codes[y0, x0, source] * (1 - dx) + codes[y0, x1, source] * dx
                    lower = codes[y1, x0, source] * (1 - dx) + codes[y1, x1, source] * dx
                    code = (upper * (1 - dy) + lower * dy) * np.float32(1 / 255)
                    if parameters[2, channel] != 1:
                        code = code ** parameters[2, channel]
                    factor = np.exp2(parameters[0, channel] + parameters[1, channel] * code)
                # The bright picture, in the primaries of the gains.
                value = mixing[channel, 0] * first + mixing[channel, 1] * second + mixing[channel, 2] * third
                value = (value + parameters[3, channel]) * factor - parameters[4, channel]
                # The offsets may leave a little below black; there is no such light.
                result[row - begin, column, channel] = max(value, np.float32(0))

"""The loop from R′G′B′ to luma and shared chroma, compiled."""

from __future__ import annotations

import numpy as np

from relume._kernel import exact_kernel

# BT.2100-2, table 6: luma of non-constant luminance, and what makes the differences from it reach ±½
_RED, _GREEN, _BLUE = 0.2627, 0.6780, 0.0593
_BLUE_SPAN, _RED_SPAN = 1.8814, 1.4746
_TOP, _MIDDLE = 1023, 512


@exact_kernel
def luma_and_chroma(
    signal: np.ndarray, begin: int, end: int, luma: np.ndarray, blue: np.ndarray, red: np.ndarray
) -> None:
    """Pairs of rows begin to end of `luma` (H, W), and rows begin to end of chroma `blue` and `red` (⌈H/2⌉, ⌈W/2⌉).

    signal : (H, W, 3) uint16, R′, G′, B′, 65535 = 1; beyond an odd side its last row and column count for two
    """
    height, width, _ = signal.shape
    scale = _TOP / 65535.0
    for pair in range(begin, end):
        for column in range(red.shape[1]):
            total_luma, total_blue, total_red = 0.0, 0.0, 0.0
            for part in range(4):
                y, x = 2 * pair + part // 2, 2 * column + part % 2
                row, place = min(y, height - 1), min(x, width - 1)
                r, g, b = signal[row, place, 0], signal[row, place, 1], signal[row, place, 2]
                light = _RED * r + _GREEN * g + _BLUE * b
                total_luma, total_blue, total_red = total_luma + light, total_blue + b, total_red + r
                if y < height and x < width:
                    luma[y, x] = int(light * scale + 0.5)
            blue_difference = (total_blue - total_luma) * (scale / (4 * _BLUE_SPAN))
            red_difference = (total_red - total_luma) * (scale / (4 * _RED_SPAN))
            # ½ of 1023, and the middle is 512: the very ends do not fit.
            blue[pair, column] = min(max(int(np.floor(blue_difference + _MIDDLE + 0.5)), 0), _TOP)
            red[pair, column] = min(max(int(np.floor(red_difference + _MIDDLE + 0.5)), 0), _TOP)

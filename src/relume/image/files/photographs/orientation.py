"""How a stored picture is turned upright: the eight orientations of TIFF 6.0 and EXIF 2.32, tag 0x0112."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

ORIENTATION = 0x0112

# Rows, columns and axes as stored → as seen.
UPRIGHT: Mapping[int, Callable[[np.ndarray], np.ndarray]] = {
    1: lambda p: p,
    2: lambda p: p[:, ::-1],
    3: lambda p: p[::-1, ::-1],
    4: lambda p: p[::-1],
    5: lambda p: p.swapaxes(0, 1),
    6: lambda p: p.swapaxes(0, 1)[:, ::-1],
    7: lambda p: p[::-1, ::-1].swapaxes(0, 1),
    8: lambda p: p.swapaxes(0, 1)[::-1],
}

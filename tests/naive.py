"""Slow twins: the same definitions written out one element at a time, to hold the fast code against."""

from __future__ import annotations

import math

import numpy as np


def look_up(radiance: np.ndarray, mapping: str, direction: np.ndarray) -> np.ndarray:
    """Radiance (3,) of a map from one direction, bilinear; over a lat-long's pole one meets the other side."""
    height, width = radiance.shape[:2]
    x, y, z = (float(c) for c in direction)
    if mapping == "latlong":
        u, v = 0.5 + math.atan2(x, -z) / math.tau, math.acos(max(-1.0, min(1.0, y))) / math.pi
    else:
        towards = -z if mapping == "angular" else z
        angle = math.acos(max(-1.0, min(1.0, towards)))
        radius = angle / math.pi if mapping == "angular" else math.sin(angle / 2)
        azimuth = math.atan2(y, x) if x or y else 0.0  # every azimuth is right there; the first is taken
        u, v = 0.5 + radius * math.cos(azimuth) / 2, 0.5 - radius * math.sin(azimuth) / 2
    column, row = u * width - 0.5, v * height - 0.5
    left, top = math.floor(column), math.floor(row)
    total = np.zeros(3)
    for j, vertical in ((top, 1 - (row - top)), (top + 1, row - top)):
        for i, horizontal in ((left, 1 - (column - left)), (left + 1, column - left)):
            if mapping == "latlong":
                across = i + width // 2 if j < 0 or j >= height else i
                pixel = radiance[min(max(j, 0), height - 1), across % width]
            else:
                pixel = radiance[min(max(j, 0), height - 1), min(max(i, 0), width - 1)]
            total += vertical * horizontal * pixel
    return total

"""The slow twins of motion blur: plain averages of many pictures, each moved a little."""

from __future__ import annotations

import numpy as np


def looked_up(picture: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bilinear sums (H, W, 3) at pixel coordinates x, y of the neighbours that are there, and their weights (H, W)."""
    height, width = picture.shape[:2]
    u, v = x - 0.5, y - 0.5
    total, weights = np.zeros((*x.shape, 3)), np.zeros(x.shape)
    for row in (np.floor(v), np.floor(v) + 1):
        for column in (np.floor(u), np.floor(u) + 1):
            inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
            share = np.where(inside, (1 - np.abs(u - column)) * (1 - np.abs(v - row)), 0)
            places = np.clip(row, 0, height - 1).astype(int), np.clip(column, 0, width - 1).astype(int)
            total += share[..., None] * picture[places]
            weights += share
    return total, weights


def averaged(picture, place_at, light_at=lambda time: 1.0, *, samples: int = 2000) -> tuple[np.ndarray, np.ndarray]:
    """The mean of the picture looked up at `place_at(x, y, time)`, where known, and the share known.

    light_at : of a time, −½ to ½
    """
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]] + 0.5
    total, known, lit = np.zeros(picture.shape), np.zeros(x.shape), 0.0
    for time in (np.arange(samples) + 0.5) / samples - 0.5:
        light, weights = looked_up(picture, *place_at(x, y, time))
        total += light_at(time) * light
        known += light_at(time) * weights
        lit += light_at(time)
    with np.errstate(invalid="ignore"):
        return np.where(known[..., None] > 0, total / known[..., None], 0), known / lit


def through(matrix: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixel coordinates through a homography."""
    a, b, c = (row[0] * x + row[1] * y + row[2] for row in matrix)
    return a / c, b / c


def spread_tent(distance: np.ndarray, step: float) -> np.ndarray:
    """The mean of the tent over a step about each distance, by a fine sum."""
    offsets = (np.arange(400) + 0.5) / 400 - 0.5
    return np.maximum(0, 1 - np.abs(distance[:, None] - step * offsets)).mean(1)


def carried(picture, motion, remoteness, same: float, samples: int) -> np.ndarray:
    """Every pixel carried along its vector, nearer ones before farther ones; nothing behind them guessed."""
    height, width = picture.shape[:2]
    total, said = np.zeros(picture.shape), np.zeros((height, width))
    columns, rows = np.arange(width), np.arange(height)
    for time in (np.arange(samples) + 0.5) / samples - 0.5:
        splats = []
        nearest = np.full((height, width), np.inf)
        for y in range(height):
            for x in range(width):
                across, down = motion[y, x]
                by_column = spread_tent(columns - x - across * time, abs(across) / samples)
                by_row = spread_tent(rows - y - down * time, abs(down) / samples)
                share = by_row[:, None] * by_column
                splats.append((share, picture[y, x], remoteness[y, x]))
                nearest[share > 1e-6] = np.minimum(nearest[share > 1e-6], remoteness[y, x])
        layers = np.zeros((2, height, width, 4))
        for share, light, remote in splats:
            behind = (remote > nearest + same).astype(int)
            for layer in range(2):
                kept = np.where(behind == layer, share, 0)
                layers[layer, ..., :3] += kept[..., None] * light
                layers[layer, ..., 3] += kept
        covered = np.minimum(layers[0, ..., 3], 1)
        seen = np.minimum(layers[1, ..., 3], 1 - covered)
        scale = np.where(covered + seen < 0.5, 1, 1 / np.maximum(covered + seen, 1e-9))
        for part, layer in ((covered, layers[0]), (seen, layers[1])):
            total += (scale * part / np.maximum(layer[..., 3], 1e-12))[..., None] * layer[..., :3]
            said += scale * part
    return total / said[..., None]

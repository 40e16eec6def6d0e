"""Turn the profile of the film's pedestal about its axis: `python pedestal.py` writes pedestal.obj beside this file."""

from itertools import pairwise
from pathlib import Path

import numpy as np

SIDES, FINER = 80, 3
# Radius and height from the foot up, metres; an edge is where a point stands twice.
PROFILE = [
    (0.0, 0.0), (0.17, 0.0), (0.17, 0.0), (0.17, 0.012), (0.17, 0.012), (0.155, 0.02), (0.135, 0.028), (0.12, 0.042),
    (0.113, 0.06), (0.113, 0.08), (0.118, 0.092), (0.13, 0.1), (0.15, 0.104), (0.17, 0.106), (0.178, 0.112),
    (0.178, 0.118), (0.174, 0.12), (0.174, 0.12), (0.0, 0.12),
]  # fmt: skip


def finer(points: np.ndarray) -> np.ndarray:
    """The profile with points between: a cubic from edge to edge (Catmull and Rom 1974)."""
    edges = [0, *(1 + np.flatnonzero(np.all(points[1:] == points[:-1], axis=1))), len(points)]
    runs = [points[first:last] for first, last in pairwise(edges)]
    return np.vstack([smooth(run) if len(run) > 2 else run for run in runs])


def smooth(run: np.ndarray) -> np.ndarray:
    """A run of points with FINER steps from each to the next."""
    ends = np.vstack([2 * run[0] - run[1], run, 2 * run[-1] - run[-2]])
    found = [run[:1]]
    for before, first, last, after in zip(ends, ends[1:], ends[2:], ends[3:], strict=False):
        for t in np.arange(1, FINER + 1) / FINER:
            slopes = (last - before) / 2, (after - first) / 2
            place = (2 * t**3 - 3 * t**2 + 1) * first + (t**3 - 2 * t**2 + t) * slopes[0]
            found.append((place + (3 * t**2 - 2 * t**3) * last + (t**3 - t**2) * slopes[1])[None])
    return np.vstack(found)


def main() -> None:
    """Write vertices, normals and faces, counter-clockwise from outside."""
    points = finer(np.array(PROFILE))
    # Outward across the profile: of the segments that meet in a point where it stands once, of its own where twice.
    segments = np.diff(points, axis=0)
    across = np.stack([segments[:, 1], -segments[:, 0]], axis=1)
    across = np.vstack([across[:1], across[:-1] + across[1:], across[-1:]])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    lines = ["# The pedestal of the film, by pedestal.py; metres, +Y up."]
    for (radius, height), (out, up) in zip(points, across, strict=True):
        for angle in angles:
            lines.append(f"v {radius * np.cos(angle):.5f} {height:.5f} {radius * np.sin(angle):.5f}")
            lines.append(f"vn {out * np.cos(angle):.4f} {up:.4f} {out * np.sin(angle):.4f}")
    for ring in range(len(points) - 1):
        if np.allclose(points[ring], points[ring + 1]):
            continue
        for side in range(SIDES):
            low, following = ring * SIDES + side + 1, ring * SIDES + (side + 1) % SIDES + 1
            high, beyond = low + SIDES, following + SIDES
            if points[ring, 0] > 0:
                lines.append("f " + " ".join(f"{k}//{k}" for k in (low, beyond, following)))
            if points[ring + 1, 0] > 0:
                lines.append("f " + " ".join(f"{k}//{k}" for k in (low, high, beyond)))
    Path(__file__).with_name("pedestal.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")


main()

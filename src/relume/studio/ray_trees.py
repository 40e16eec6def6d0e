"""Trees of rays behind the pixels of a picture that Whitted's method rendered from a scene file."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl

KINDS = ("eye", "S", "T", "L")
"""From the eye, reflected (the S term of Whitted's eq. 2), refracted (T), towards a light."""
MOST = 400
"""Rays that a page is given; the weakest are left out, and their sum is said."""


class SceneTrees:
    """The trees of one scene file.

    path : of the scene file
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @cached_property
    def read(self) -> rl.SceneFile:
        """The scene as it was when it was first asked for; UnreadableFile and ValueError as of `rl.read_scene`."""
        return rl.read_scene(self.path)

    def of(self, x: int, y: int) -> dict[str, Any]:
        """The tree behind a pixel, for JSON: its rays, parents first, and what they add up to; raises ValueError."""
        tree = rl.report.pixel_ray_tree(self.read, (x, y))
        shapes = (*self.read.scene.local, *self.read.scene.objects)
        # A node is as strong as all that comes through it: no parent is left out before its child.
        through = tree.sent.sum(axis=1)
        for node in range(len(through) - 1, 0, -1):
            through[tree.parent[node]] += through[node]
        through[0] = np.inf
        kept = np.sort(np.argsort(-through, kind="stable")[:MOST])
        kept = kept[_whole(kept, tree.parent)]
        place = {int(node): number for number, node in enumerate(kept)}
        nodes = [
            {
                "kind": KINDS[tree.kind[node]],
                "parent": place.get(int(tree.parent[node]), -1),
                "shape": None if tree.shape[node] < 0 else str(getattr(shapes[tree.shape[node]], "name", "plane")),
                "light": int(tree.light[node]),
                "weight": tree.weight[node].tolist(),
                "intensity": tree.intensity[node].tolist(),
                "sent": tree.sent[node].tolist(),
            }
            for node in kept
        ]
        left = np.ones(len(tree.kind), bool)
        left[kept] = False
        return {
            "x": x,
            "y": y,
            "nodes": nodes,
            "rays": len(tree.kind),
            "left_out": tree.sent[left].sum(axis=0).tolist(),
            "sum": tree.sent.sum(axis=0).tolist(),
        }


def _whole(kept: np.ndarray, parent: np.ndarray) -> np.ndarray:
    """Which of these nodes have all their ancestors among them."""
    there: set[int] = set()
    for node in kept.tolist():  # parents come first
        if parent[node] < 0 or int(parent[node]) in there:
            there.add(node)
    return np.array([node in there for node in kept.tolist()], bool)

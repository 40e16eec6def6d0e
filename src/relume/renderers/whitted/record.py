"""What goes into Whitted's kernel besides the scene, and the nodes of a tree that come out."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

EYE, REFLECTED, REFRACTED, SHADOW = 0, 1, 2, 3
"""Kinds of rays."""


class Settings(NamedTuple):
    """What the kernel follows a tree by."""

    depth: int
    contribution: float
    attenuation: int
    reach: float
    rays: int
    clear: bool
    background: bool
    first_object: int
    footprint: float
    seed: int


class Record(NamedTuple):
    """The nodes of one sample's tree, for who wants to see it; empty arrays where nobody does.

    ends : (N, 6) where each ray begins and ends, metres
    weight : (N, 3) share of the pixel that the node's intensity has
    sent : (N, 3) what the node itself adds to the pixel, without its children
    parent, kind, shape, light : (N,); a shape of −1 is none, a blocked light's ray ends at its blocker
    inside : (N,) whether the shape is met from within
    limits : (N, 2) the interval of distances in which each ray was traced
    count : (1,) nodes so far
    """

    ends: np.ndarray
    weight: np.ndarray
    sent: np.ndarray
    parent: np.ndarray
    kind: np.ndarray
    shape: np.ndarray
    light: np.ndarray
    inside: np.ndarray
    limits: np.ndarray
    count: np.ndarray


def empty_record(size: int = 0) -> Record:
    """Room for this many nodes of a tree."""
    return Record(
        np.empty((size, 6)), np.empty((size, 3)), np.empty((size, 3)), np.empty(size, np.int64),
        np.empty(size, np.int64), np.empty(size, np.int64), np.empty(size, np.int64), np.zeros(size, np.bool_),
        np.empty((size, 2)),
        np.zeros(1, np.int64),
    )  # fmt: skip

"""Motion between frames, so that what two of them show of the light can be merged."""

from __future__ import annotations

import cv2
import numpy as np

from relume.image.colour import LUMINANCE_WEIGHTS, luminance
from relume.probe.video.light_tables import LightTables
from relume.probe.video.merging import Collected

ROWS = 256
"""Rows of the maps in which motion is sought; finer ones cost four times as much and show the same."""
BESIDE = 1 / 8
"""Share of a map's width that goes on at each side of the seam."""
COMMON = 1.2
"""ln of exposure that both must show, of 4.7 that one shows: five stops apart they have that."""
DISAGREE = 0.2
"""ln of radiance from which on what is brought from another frame counts by half: it is something else that moved."""
TINY = np.float32(1e-9)
"""Light that is none, where a logarithm or a ratio is taken."""


def brought(
    other: Collected, onto: Collected, tables: LightTables, least: tuple[np.ndarray, np.ndarray], flow: np.ndarray
) -> Collected:
    """What another frame collected, moved to where one frame shows it.

    least : (3,) the exposure of a believed pixel in the other and in the one
    flow : (H, 2H, 2) pixels right and down from where the one shows something to where the other does
    Where the one frame shows light well and what is brought disagrees, that counts less.
    """
    rows, columns = onto.light.shape[:2]
    x = flow[..., 0] + np.arange(columns, dtype=np.float32)
    y = np.clip(flow[..., 1] + np.arange(rows, dtype=np.float32)[:, None], 0, rows - 1)
    x = x % np.float32(columns)
    # Seen from beyond the seam: the last column is followed by the first.
    moved = [
        cv2.remap(np.concatenate([each, each[:, :1]], axis=1), x, y, cv2.INTER_LINEAR)
        for each in (other.light, other.exposure)
    ]
    mine, exposure = _grey(onto.light), _grey(onto.exposure)
    theirs, their_exposure = _grey(moved[0]), _grey(moved[1])
    believed = float(luminance(least[1]))
    known = (exposure > 0.3 * believed) & (mine * believed > tables.black * exposure)
    ratio = (theirs * exposure + TINY) / (mine * their_exposure + TINY)
    off = np.square(np.log(ratio) / np.float32(DISAGREE))
    trust = cv2.merge([np.where(known, 1 / (1 + off * off), np.float32(1))] * 3)
    return Collected(cv2.multiply(moved[0], trust), cv2.multiply(moved[1], trust))


def _grey(picture: np.ndarray) -> np.ndarray:
    """(H, W) float32 luminance, which OpenCV finds in a fifth of the time."""
    return cv2.transform(picture, LUMINANCE_WEIGHTS[None].astype(np.float32))


def flow_between(
    other: Collected, onto: Collected, tables: LightTables, least: tuple[np.ndarray, np.ndarray]
) -> np.ndarray | None:
    """(H, 2H, 2) pixels right and down from where the one shows something to where the other does.

    Both are brought to one exposure and to the range that both show, and dense flow is sought (Kroeger et al. 2016).
    None where they show too little of the light in common.
    """
    gains = [float(each.mean()) for each in least]
    low, high = np.log(tables.black / min(gains)), np.log(tables.white / max(gains))
    rows, columns = onto.light.shape[:2]
    if high - low < COMMON:
        return None
    pictures = []
    for each, gain in zip((other, onto), gains, strict=True):
        light, exposure = _grey(_coarse(each.light)), _grey(_coarse(each.exposure))
        # What is white in it has no exposure left, and is as bright as can be.
        shown = exposure > 0.05 * gain
        tone = np.log(np.maximum(light, TINY) / np.maximum(exposure, 0.05 * gain))
        tone = np.where(shown, np.clip((tone - low) / (high - low), 0, 1), 1)
        picture = (255 * tone).astype(np.uint8)
        beside = int(picture.shape[1] * BESIDE)
        pictures.append(np.concatenate([picture[:, -beside:], picture, picture[:, :beside]], axis=1))
    beside = (pictures[0].shape[1] - min(2 * ROWS, columns)) // 2
    finder = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    start = np.zeros((*pictures[0].shape, 2), np.float32)
    flow = finder.calc(pictures[1], pictures[0], start)[:, beside : -beside or None]
    scale = columns / flow.shape[1]
    return scale * cv2.resize(flow, (columns, rows)) if scale != 1 else flow


def _coarse(picture: np.ndarray) -> np.ndarray:
    """A map in `ROWS` rows at most, each pixel the mean of finer ones."""
    if len(picture) <= ROWS:
        return picture
    return cv2.resize(picture, (2 * ROWS, ROWS), interpolation=cv2.INTER_AREA)

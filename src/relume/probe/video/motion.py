"""Motion between frames, so that what two of them show of the light can be merged."""

from __future__ import annotations

import cv2
import numpy as np

from relume.image.colour import luminance
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


def brought(
    other: Collected, onto: Collected, tables: LightTables, least: tuple[np.ndarray, np.ndarray], flow: np.ndarray
) -> Collected:
    """What another frame collected, moved to where one frame shows it.

    least : (3,) the exposure of a believed pixel in the other and in the one
    flow : (H, 2H, 2) pixels right and down from where the one shows something to where the other does
    Where the one frame shows light well and what is brought disagrees, that counts less.
    """
    rows, columns = onto.light.shape[:2]
    x, y = np.meshgrid(np.arange(columns, dtype=np.float32), np.arange(rows, dtype=np.float32))
    x, y = x + flow[..., 0] + 1, np.clip(y + flow[..., 1], 0, rows - 1)
    x = (x - 1) % columns + 1
    moved = [
        cv2.remap(np.concatenate([each[:, -1:], each, each[:, :1]], axis=1), x, y, cv2.INTER_LINEAR)
        for each in (other.light, other.exposure)
    ]
    mine = luminance(onto.light / np.maximum(onto.exposure, 1e-9))
    theirs = luminance(moved[0] / np.maximum(moved[1], 1e-9))
    known = (onto.exposure > 0.3 * least[1]).all(-1) & (mine * least[1].mean() > tables.black)
    off = np.log(np.maximum(theirs, 1e-9) / np.maximum(mine, 1e-9)) / DISAGREE
    trust = np.where(known, 1 / (1 + off**4), 1.0).astype(np.float32)[..., None]
    return Collected(moved[0] * trust, moved[1] * trust)


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
        light = luminance(each.light / np.maximum(each.exposure, 0.05 * gain))
        # What is white in it has no exposure left, and is as bright as can be.
        light = np.where(each.exposure.min(axis=-1) < 0.05 * gain, np.exp(high), light)
        tone = np.clip((np.log(np.maximum(light, 1e-9)) - low) / (high - low), 0, 1)
        picture = (255 * tone).astype(np.uint8)
        if rows > ROWS:
            picture = cv2.resize(picture, (2 * ROWS, ROWS), interpolation=cv2.INTER_AREA)
        beside = int(picture.shape[1] * BESIDE)
        pictures.append(np.concatenate([picture[:, -beside:], picture, picture[:, :beside]], axis=1))
    beside = (pictures[0].shape[1] - min(2 * ROWS, columns)) // 2
    finder = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_FAST)
    start = np.zeros((*pictures[0].shape, 2), np.float32)
    flow = finder.calc(pictures[1], pictures[0], start)[:, beside : -beside or None]
    scale = columns / flow.shape[1]
    return scale * cv2.resize(flow, (columns, rows)) if scale != 1 else flow

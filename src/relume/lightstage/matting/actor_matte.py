"""An actor in a stage that lights like the place: the matte of each frame, and the actor before the place.

Light Stage 3 films a backdrop in infrared beside the colour camera: it is lit there and the actor is not, so that the
actor is dark before bright whatever the lamps show. Without such a camera, a picture of the empty stage under the same
light takes its place, and what differs from it is the actor.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from relume.composite.differential import over

_WHITE = 99
"""Per cent of an empty stage's pixels that are darker than its white."""


@dataclass(frozen=True)
class MatteLevels:
    """The shares between which a matte goes from 0 to 1; below and above it is the one or the other.

    low, high : for an infrared matte, of the backdrop that is hidden: 0.05 and 0.95 unless given, as noise and stray
        light are a few hundredths. A difference matte takes its own, as shares of white
    """

    low: float = 0.05
    high: float = 0.95

    def __post_init__(self) -> None:
        if not 0 <= self.low < self.high < np.inf:
            raise ValueError(f"levels {self.low} to {self.high}; expected 0 ≤ low < high")

    def of(self, shares: np.ndarray) -> np.ndarray:
        """The matte of `shares` of any shape: float32 from 0 to 1."""
        return np.clip((shares - self.low) / (self.high - self.low), 0, 1).astype(np.float32)


DIFFERENCES = MatteLevels(0.03, 0.12)
"""Of a difference matte: what differs by less than 3 % of white is noise, by more than 12 % the actor."""


def infrared_matte(
    infrared: np.ndarray, empty: np.ndarray, actor: np.ndarray | float = 0.0, levels: MatteLevels = MatteLevels()
) -> np.ndarray:
    """The matte α (H, W) float32 from an infrared frame: 1 − (I − A)/(B − A), stretched by the levels.

    infrared : (H, W), linear
    empty : (H, W), the same without the actor, B
    actor : A, what the actor shows in infrared; black unless given
    Where the backdrop is not brighter than the actor nothing is known, and α is 1: what is there stays. Raises
    ValueError for other shapes, and where that is so of every pixel.
    """
    if infrared.ndim != 2 or infrared.shape != empty.shape:
        raise ValueError(f"infrared is {infrared.shape}, empty {empty.shape}; expected two grey pictures of one size")
    room = np.asarray(empty, np.float64) - actor
    lit = room > 0
    if not lit.any():
        raise ValueError("the empty stage is nowhere brighter than the actor in infrared; is its backdrop lit?")
    hidden = 1 - (np.asarray(infrared, np.float64) - actor) / np.where(lit, room, 1)
    return np.where(lit, levels.of(hidden), np.float32(1))


def difference_matte(frame: np.ndarray, empty: np.ndarray, levels: MatteLevels = DIFFERENCES) -> np.ndarray:
    """The matte α (H, W) float32 from what differs from the empty stage: |C − B| over B's white, by the levels.

    frame, empty : (H, W, 3) radiance, under the same light
    levels : shares of white; 0.03 to 0.12 unless given
    Single pixels are taken for noise (a median of 3 × 3). What of the actor has the backdrop's colour is lost, and an
    edge of α is sure to a pixel only: an infrared matte has neither fault. Raises ValueError for other shapes, and for
    an empty stage that is black.
    """
    if frame.ndim != 3 or frame.shape != empty.shape or frame.shape[2] != 3:
        raise ValueError(
            f"the frame is {frame.shape}, the empty stage {empty.shape}; expected two of (rows, columns, 3)"
        )
    white = float(np.percentile(empty.max(axis=-1), _WHITE))
    if not white > 0:
        raise ValueError("the empty stage is black, so nothing in it differs from the actor; give its picture in light")
    off = np.sqrt(np.mean(np.square(frame.astype(np.float64) - empty), axis=-1)) / white
    return levels.of(median_filter(off, 3))


def composite_actor(frame: np.ndarray, matte: np.ndarray, empty: np.ndarray, backdrop: np.ndarray) -> np.ndarray:
    """The actor before another backdrop: frame − (1 − α)·empty + (1 − α)·backdrop, (H, W, 3) float32.

    frame, empty : (H, W, 3) radiance of the actor in the stage, and of the stage alone under the same light
    matte : (H, W) α, from 0 to 1
    backdrop : (H, W, 3) radiance on the same scale, such as the place that the lamps showed
    What shines through hair and moving edges is so the backdrop's light, and no longer the stage's. Raises ValueError
    for other shapes. Source: Porter & Duff 1984.
    """
    if frame.shape != empty.shape:
        raise ValueError(f"the frame is {frame.shape}, the empty stage {empty.shape}; give two of one size")
    if matte.shape != frame.shape[:2]:
        raise ValueError(f"the matte is {matte.shape}; expected {frame.shape[:2]}, as the frame")
    behind = (1 - matte.astype(np.float64))[..., None]
    return over(frame - behind * empty, matte, backdrop)


def composite_actor_frames(
    frames: Iterable[np.ndarray],
    mattes: Iterable[np.ndarray],
    empty: Iterable[np.ndarray] | np.ndarray,
    backdrops: Iterable[np.ndarray] | np.ndarray,
) -> Iterator[np.ndarray]:
    """`composite_actor` of each frame in turn; nothing is kept, so films may be long.

    frames : the actor, radiance (H, W, 3) each
    mattes : (H, W) each, 0 to 1
    empty, backdrops : one a frame, as where the stage's light changes, or an array (H, W, 3) for all
    Raises ValueError, at the frame that lacks one, where there are fewer of one than of another.
    """
    sources = [iter(frames), iter(mattes), _each(empty), _each(backdrops)]
    names = ("frame", "matte", "picture of the empty stage", "backdrop")
    several = [True, True, not isinstance(empty, np.ndarray), not isinstance(backdrops, np.ndarray)]
    number = 0
    while True:
        number += 1
        found = [next(source, None) for source in sources]
        counted = [each for each, many in zip(found, several, strict=True) if many]
        if all(each is None for each in counted):
            return
        for each, name in zip(found, names, strict=True):
            if each is None:
                raise ValueError(f"there is no {name} {number}, where others go on; give as many of each")
        frame, matte, alone, backdrop = found
        assert frame is not None and matte is not None and alone is not None and backdrop is not None
        yield composite_actor(frame, matte, alone, backdrop)


def _each(pictures: Iterable[np.ndarray] | np.ndarray) -> Iterator[np.ndarray]:
    """A picture for each frame: the same for all, or one after another."""
    while isinstance(pictures, np.ndarray):
        yield pictures
    yield from pictures

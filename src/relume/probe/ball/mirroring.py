"""Whether what lies inside a round outline looks mirrored: how a mirrored ball differs from fruit, lamps and plates.

A mirrored ball shows all that is around it, squeezed into a disc: it is full of detail, while fruit, lamps and matte
balls are smooth but for their shading and a gleam. Towards the rim it squeezes all across the rim and stretches it
along the rim, so that edges run along the rim there.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np

from relume.probe.ball.edge_tracking import softened
from relume.probe.ball.silhouette import Outline, cone_through
from relume.probe.ball.windows import Window

TURNS = 256
"""Rays from the middle along which the disc is looked at."""
STEP = 1 / 64
"""Radii between the places that are looked at along a ray."""
DEGREE = 4
"""Of the polynomial of two places that shading follows."""
BRIGHTEST, WHITE, WHITES, LEAST_REST = 98, 0.96, 0.2, 0.15
"""The percentile of light in the window (enlarging overshoots), and the share of it from which on a place is white; the
share of the disc that must be white for the rest to be looked at by itself, since white hides what is mirrored; and the
share that this rest must have: white lamps leave up to a tenth along their rim."""
SMALL, MOST = 0.05, 0.5
"""Departures of ln luminance from the shading: beyond the first a place counts less in it; no place counts for more
than the second."""

USUAL_ALONG, MOST_ALONG = 0.6, 1.2
"""Share of change near the rim that runs across it, 0.55 to 0.76 in photographs of mirrored balls, and how many times
that still counts: of plates it is 1."""
LEAST_EVIDENCE, SURE_EVIDENCE = 0.095, 0.2
"""Evidence below which nothing is mirrored, and from which on it surely is: 0.03 to 0.09 of fruit, billiard balls,
globes, clocks and matte balls, 0.11 and more of mirrored balls unless most of the ball is white or black."""

WHITEST, COLOURED, LEAST_AROUND = 97, 0.75, 100
"""Percentile of a channel's share inside the ball, against the median around it, below which the ball is coloured, and
the fewest places around it: 0.33 to 0.66 of red, green and blue balls, 0.87 and more of neutral ones. Gold, 0.83 to
1.16, is not noticed."""
NEAREST_RIM = 0.96
"""Radii up to which the ball is looked at for colour: from 0.85 on it mirrors what stands behind it."""

LEAST_RANGE, MOST_RAISED = 1.5, 8.0
"""Range of ln luminance to which flatter surroundings are stretched, and how much at most."""


@dataclass(frozen=True)
class Mirroring:
    """What speaks for a mirror.

    detail : mean departure of ln luminance inside from a smooth shading, each at most `MOST`; where much is white, of
        the rest
    along : the share of change near the rim that runs across it, so that edges run along it; 0.5 in a flat picture
    white : whether much of the disc is
    """

    detail: float
    along: float
    white: bool = False

    @property
    def likelihood(self) -> float:
        """0 for what mirrors nothing, 1 for what surely does."""
        evidence = self.detail * min(self.along / USUAL_ALONG, MOST_ALONG) ** 2
        return 0.0 if evidence < LEAST_EVIDENCE else float(np.sqrt(min(evidence / SURE_EVIDENCE, 1)))

    @staticmethod
    def taken_for_granted() -> Mirroring:
        """Of what is known to mirror."""
        return Mirroring(MOST, 1.0)


def mirroring(window: Window, outline: Outline) -> Mirroring:
    """What speaks for a mirror inside an outline, in pixels of the window, best about 64 in radius."""
    polar, shown, white = _polar(window, outline)
    depth = _depth()
    change = np.gradient(polar, STEP, axis=1)
    round_it = _round(polar) / depth
    ring = shown & (depth > 0.72) & (depth < 0.93)
    across, along = (float(np.minimum(np.abs(g), 8.0)[ring].sum()) for g in (change, round_it))
    disc = shown & (depth > 0.1) & (depth < 0.92)
    detail = _detail(polar, disc)
    rest = float((depth * (disc & ~white)).sum() / max((depth * disc).sum(), 1e-9))
    if LEAST_REST < rest < 1 - WHITES:
        detail = max(detail, _detail(polar, disc & ~white))
    return Mirroring(detail, across / max(across + along, 1e-9), rest < 1 - WHITES)


def missing_colour(radiance: np.ndarray, outline: Outline) -> tuple[int, float] | None:
    """The channel that a coloured ball swallows, and how much of it is left against the surroundings; None without one.

    radiance : (H, W, 3)

    A neutral ball shows white things somewhere, whatever the place, and its backdrop along its rim; of a coloured one
    nothing is white. Before a coloured backdrop the ball need only be as white as white is.
    """
    height, width = radiance.shape[:2]
    turn = 2 * np.pi * np.arange(0, TURNS, 2)[:, None] / TURNS
    shares = []
    for depth in (np.arange(0.1, NEAREST_RIM, 0.05), np.arange(1.2, 2.0, 0.05)):
        x, y = (
            np.floor(at + outline.radius * depth * wave(turn)).astype(int)
            for at, wave in zip(outline.centre, (np.cos, np.sin), strict=True)
        )
        shown = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        light = np.maximum(np.nan_to_num(radiance[y[shown], x[shown]].astype(np.float64)), 0)
        # In the dark noise has every colour.
        light = light[light.sum(1) > 0.5 * np.median(light.sum(1))] if len(light) else light
        shares.append(light / np.maximum(light.sum(1, keepdims=True), 1e-12))
    inside, around = shares
    if len(around) < LEAST_AROUND or not len(inside):
        return None
    wanted = np.clip(np.median(around, axis=0), 1e-6, 1 / 3)
    left = np.percentile(inside, WHITEST, axis=0) / wanted
    channel = int(np.argmin(left))
    return (channel, float(left[channel])) if left[channel] < COLOURED else None


def _polar(window: Window, outline: Outline) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ln luminance (TURNS, K) along rays from the middle out to 1.25 radii, what is pictured of it, what is white."""
    light = window.light
    darkest, middle, brightest = (float(each) for each in np.percentile(light, (1, 50, BRIGHTEST)))
    floor = max(1e-3 * middle, darkest, 1e-12)
    logarithm = softened(np.log(np.maximum(light, floor)), outline.radius * STEP)
    # In haze and in flat light all differences are small, those inside the ball too.
    low, high = np.percentile(logarithm, (2, 98))
    logarithm = logarithm * np.clip(LEAST_RANGE / max(high - low, 1e-6), 1, MOST_RAISED)
    rim, _ = cone_through(outline.points, window.size, window.focal_length).silhouette(
        window.size, window.focal_length, TURNS
    )
    centre = (rim.max(0) + rim.min(0)) / 2
    depth = _depth()
    at = (centre + depth[None, :, None] * (rim - centre)[:, None, :] - 0.5).astype(np.float32)
    polar, bright = (
        cv2.remap(each.astype(np.float32), at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        for each in (logarithm, light)
    )
    height, width = light.shape
    shown = (at[..., 0] > 0) & (at[..., 1] > 0) & (at[..., 0] < width - 1) & (at[..., 1] < height - 1)
    return polar, shown, bright > WHITE * brightest


def _round(polar: np.ndarray) -> np.ndarray:
    """The derivative by the turn, radians."""
    return (np.roll(polar, -1, axis=0) - np.roll(polar, 1, axis=0)) / (4 * np.pi / TURNS)


def _detail(polar: np.ndarray, used: np.ndarray) -> float:
    """The mean departure from a smooth shading."""
    terms, area = _shadings()
    used = used[::2, ::2]
    # Plates and bowls are alike all round.
    turned = polar[::2, ::2] - np.median(polar[::2, ::2], axis=0)
    terms, area, level = terms[used], area[used], turned[used]
    if len(level) < 10 * terms.shape[1]:
        return 0.0
    weight, off = area, level
    # Gleams and stains are no shading: what is far off counts less, round by round.
    for _ in range(4):
        scaled = terms * weight[:, None]
        solution = np.linalg.lstsq(scaled.T @ terms, scaled.T @ level, rcond=None)[0]
        off = np.abs(level - terms @ solution)
        weight = area * np.minimum(1, SMALL / np.maximum(off, 1e-9))
    return float((area * np.minimum(off, MOST)).sum() / area.sum())


@cache
def _shadings() -> tuple[np.ndarray, np.ndarray]:
    """The polynomials (TURNS/2, K/2, T) that shading is made of, and the area (TURNS/2, K/2) of each place."""
    turn, depth = 2 * np.pi * np.arange(0, TURNS, 2)[:, None] / TURNS, _depth()[::2]
    x, y = depth * np.cos(turn), depth * np.sin(turn)
    terms = np.stack([x**i * y**j for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)], axis=-1)
    return terms.astype(np.float32), np.broadcast_to(depth, x.shape).astype(np.float32)


def _depth() -> np.ndarray:
    """Where along a ray it is looked at, radii."""
    return STEP * (np.arange(int(1.25 / STEP)) + 0.5)

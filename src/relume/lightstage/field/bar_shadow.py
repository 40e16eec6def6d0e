"""The bar that a stage's own axis draws across its pictures, found without a given place.

"Each function exhibits a thin black curve in its lower half where the phi axis bar occasionally obscures the view of
the face" (Debevec et al. 2000, Fig. 4): over the sphere it is thin and dark, and in a picture a strip of even width.
Places in a picture are pixels from its upper left corner, x right and y down.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import ndimage

from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.invalid_samples import PackedMask, grey_picture, level_of_pictures

_HELD_PICTURES = 96
# How the stage's own bar differs from the subject's shadows: thin over the sphere, dark, and a strip.
_DARKNESS = 0.4
"""A value below this share of the lesser of two on opposite sides is dark: bars are painted black."""
_REACH = 1.7
"""How far these two lights may be, times the typical spacing of lights √(4π/N): the next in each direction of a
grid."""
_FAINTEST = 0.2
"""A pixel shows nothing unless those two are this bright relative to the pictures' level: what is nearly black is full
of strips of its own, and a bar before it changes little."""
_LENGTH = 0.1
"""Of a dark strip, relative to the picture's longer side; shorter ones are the subject's own."""
_THICKNESS = 0.2
"""Of a strip, relative to its length, at most; rounder spots are shadows."""
_BEND = 0.06
"""How far its middle may be off the line between its ends, relative to its length."""
_CONTRAST = 0.9
"""Share of the pixels along both its sides that must be bright: a shadow has a side that fades."""
_MARGIN = 1.0
"""Pixels around the strip that it covers in part."""


def bar_shadow(field: ReflectanceField) -> PackedMask:
    """The mask of the thin dark bar that a stage's own axis draws over pictures and over reflectance functions.

    Under each light a pixel is dark where two lights on opposite sides are not. Dark pixels that form a long strip of
    even width, straight or gently bent, with bright sides, are the bar; it goes on along the strip as far as nothing
    bright speaks against it, and is looked for in the same place under the lights around. One bar is of one width: a
    strip of more than twice or less than half the usual one is not it. Reads each picture a few times.
    """
    height, width = field.shape
    directions, count = field.lights.directions, len(field.lights)
    faintest = _FAINTEST * level_of_pictures(field, np.arange(count))
    held = lru_cache(_HELD_PICTURES)(lambda light: grey_picture(field, light))

    @lru_cache(_HELD_PICTURES)
    def evidence(light: int) -> tuple[np.ndarray, np.ndarray]:
        """Where a picture is dark, and where that can be seen."""
        pairs = _opposite_pairs(directions, light)
        if not len(pairs):
            return np.zeros((height, width), bool), np.zeros((height, width), bool)
        beside = np.max([np.minimum(held(int(one)), held(int(other))) for one, other in pairs], axis=0)
        readable = beside > faintest
        return readable & (held(light) < _DARKNESS * beside), readable

    strips = {light: list(_strips(*evidence(light))) for light in range(count)}
    widths = [strip.width for found in strips.values() for strip in found]
    usual = float(np.median(widths)) if widths else 0.0
    strips = {i: [s for s in found if 0.5 * usual <= s.width <= 2 * usual] for i, found in strips.items()}
    near = np.cos(1.5 * _REACH * np.sqrt(4 * np.pi / count))
    bits = np.zeros((count, height, -(-width // 8)), np.uint8)
    for light in range(count):
        guesses = [s for other in np.flatnonzero(directions @ directions[light] > near) for s in strips[int(other)]]
        if guesses:
            dark, readable = evidence(light)
            parts = [s.covered(dark, readable) for s in guesses]
            bits[light] = np.packbits(np.logical_or.reduce(parts), axis=-1)
    return PackedMask(bits, width)


def _opposite_pairs(directions: np.ndarray, light: int) -> np.ndarray:
    """Pairs (P, 2) of lights that stand on opposite sides of a light, none farther than `_REACH` spacings."""
    spacing = np.sqrt(4 * np.pi / len(directions))
    own = directions[light]
    angles = np.arccos(np.clip(directions @ own, -1, 1))
    near = np.flatnonzero((angles < _REACH * spacing) & (angles > 0))
    across = directions[near] - (directions[near] @ own)[:, None] * own
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    opposed = across @ across.T < np.cos(np.radians(150))
    first, second = np.nonzero(np.triu(opposed))
    return np.stack([near[first], near[second]], axis=1)


@dataclass(frozen=True, eq=False)
class _Strip:
    """A band of even width about a parabola in the picture.

    origin, along : (2,) a point and the unit direction of its axis, x and y in pixels
    bend : coefficients (3,) of the offset across, the highest power first
    width : pixels
    """

    origin: np.ndarray
    along: np.ndarray
    bend: np.ndarray
    width: float

    @staticmethod
    def through(points: np.ndarray) -> _Strip:
        """The strip that pixels (P, 2) fill, x and y."""
        origin = points.mean(axis=0)
        along = np.linalg.svd(points - origin, full_matrices=False)[2][0]
        onward, across = _along_and_across(points - origin, along)
        return _Strip(origin, along, np.polyfit(onward, across, 2), len(points) / (np.ptp(onward) + 1))

    def places(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far along the strip and how far beside its middle points (…, 2) are, pixels."""
        onward, across = _along_and_across(points - self.origin, self.along)
        return onward, across - np.polyval(self.bend, onward)

    def covered(self, dark: np.ndarray, readable: np.ndarray) -> np.ndarray:
        """The part (H, W) bool of the strip that is dark, if it is: between its ends unreadable pixels are covered too.

        Cut into pieces as long as the strip is wide, a piece is dark where most of its readable pixels are.
        """
        onward, beside = self.places(_pixels(dark.shape))
        inside = np.abs(beside) < max(self.width / 2 - 1, 0.5)
        pieces = np.floor(onward / self.width).astype(int)
        pieces -= pieces.min()
        length = pieces.max() + 1
        counts = np.bincount(pieces[inside & readable], minlength=length)
        is_dark = np.bincount(pieces[inside & dark], minlength=length)
        shows, hides = (counts > 0) & (is_dark <= 0.5 * counts), (counts > 0) & (is_dark > 0.5 * counts)
        # Runs of pieces with nothing bright between them; of these the ones that are dark for long enough.
        runs = np.cumsum(shows)
        dark_length = np.bincount(runs[hides], minlength=runs[-1] + 1) * self.width
        keeps = ~shows & (dark_length[runs] >= 0.4 * _LENGTH * max(dark.shape))
        return keeps[pieces] & (np.abs(beside) <= self.width / 2 + _MARGIN)


def _strips(dark: np.ndarray, readable: np.ndarray) -> list[_Strip]:
    """The long strips of even width in what is dark (H, W), with sides that are not."""
    counts = ndimage.uniform_filter(readable.astype(np.float32), 3, mode="constant")
    share = ndimage.uniform_filter(dark.astype(np.float32), 3, mode="constant") / np.maximum(counts, 1e-6)
    labels = np.zeros(dark.shape, np.int32)
    ndimage.label(dark & (share > 0.4), np.ones((3, 3)), output=labels)
    found = []
    for index, part in enumerate(ndimage.find_objects(labels), start=1):
        inside = labels[part] == index
        if np.hypot(*inside.shape) < _LENGTH * max(dark.shape):
            continue
        rows, columns = np.nonzero(inside)
        strip = _Strip.through(np.stack([columns + part[1].start, rows + part[0].start], axis=-1) + 0.5)
        if _is_bar(strip, dark, readable, labels == index):
            found.append(strip)
    return found


def _is_bar(strip: _Strip, dark: np.ndarray, readable: np.ndarray, own: np.ndarray) -> bool:
    """Whether dark, connected pixels `own` (H, W) are long, thin and even, and bright on both sides."""
    onward, beside = strip.places(_pixels(dark.shape))
    first, last = onward[own].min(), onward[own].max()
    length = last - first
    if length < _LENGTH * max(dark.shape) or strip.width > _THICKNESS * length:
        return False
    even = np.mean(np.abs(beside[own]) <= strip.width / 2 + 1) > 0.9
    bent = abs(strip.bend[0]) * (length / 2) ** 2 > _BEND * length
    alongside = (onward >= first) & (onward <= last) & readable
    edge = strip.width / 2 + 1.5
    sides = [alongside & (s * beside > edge) & (s * beside < edge + max(3.0, strip.width / 2)) for s in (-1, 1)]
    bright = [np.mean(~dark[side]) if side.sum() >= length / 4 else 0.0 for side in sides]
    return bool(even and not bent and min(bright) >= _CONTRAST)


def _along_and_across(offsets: np.ndarray, along: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return offsets @ along, offsets @ np.array([-along[1], along[0]])


@lru_cache(2)
def _pixels(shape: tuple[int, int]) -> np.ndarray:
    """Pixel centres (H, W, 2), x and y."""
    x, y = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    return np.stack([x, y], axis=-1)

"""An exposure of a radiance map for any painter, and what was painted put back into the map (HDR Shop, 2001).

A slice is the map seen at one exposure, with 8 or 16 bits and the sRGB curve. Only the pixels whose values a painter
changed go back; all others keep the map's own radiance to the last digit.
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from typing import Protocol, cast

import numpy as np

from relume.image.colour import decode_srgb, encode_srgb, luminance
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap

DEPTHS = {8: np.uint8, 16: np.uint16}
DOUBTFUL_SHARE = 0.5
"""Share of changed pixels above which the painter's program, not the painter, may have changed them."""
DOUBTFUL_PLACES = 200
"""Patches of changed pixels above which the same holds: nobody makes as many strokes, a JPEG does."""


@dataclass(frozen=True)
class Slice:
    """How a slice was made, which the way back must know.

    stops : exposure; radiance 2^−stops is white
    bits : 8 or 16 a channel
    of : the fingerprint of the map it was cut from, "" where unknown
    box : the rectangle of that map which it shows: left, top, width and height in pixels; None for all of it
    """

    stops: float
    bits: int = 8
    of: str = ""
    box: tuple[int, int, int, int] | None = None

    def __post_init__(self) -> None:
        if not abs(self.stops) <= 100:
            raise ValueError(f"the exposure is {self.stops} stops; expected −100 to 100")
        if self.bits not in DEPTHS:
            raise ValueError(f"a slice of {self.bits} bits; expected 8 or 16")

    @property
    def white(self) -> float:
        """The radiance of the largest pixel value, in the map's unit."""
        return 2.0**-self.stops

    def photograph(self, picture: RadianceMap) -> Photograph:
        """What the painter gets: pixels of the map at this exposure; what is negative or NaN is black there."""
        seen = np.nan_to_num(picture.radiance.astype(np.float64), nan=0.0, posinf=np.inf) / self.white
        top = 2**self.bits - 1
        codes = np.rint(top * encode_srgb(np.clip(seen, 0, 1))).astype(DEPTHS[self.bits])
        return Photograph(codes, f"slice at {self.stops:+g} stops")

    def to_json(self) -> str:
        """The slice as text, for a file beside the picture that no painter touches."""
        return json.dumps({"kind": "relume slice", "curve": "sRGB", "white": self.white, **asdict(self)}, indent=1)

    @staticmethod
    def from_json(text: str) -> Slice:
        """The slice that `to_json` wrote; raises ValueError for any other text."""
        try:
            table = json.loads(text)
            if table["kind"] != "relume slice" or table["curve"] != "sRGB":
                raise ValueError("another kind or curve")
            box = table.get("box")
            if box is not None:
                left, top, width, height = (int(each) for each in box)
                box = left, top, width, height
            return Slice(float(table["stops"]), int(table["bits"]), str(table["of"]), box)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"not the description of a slice: {error}") from None


class Painting(Protocol):
    """How new radiance is made of what was painted."""

    def __call__(
        self, radiance: np.ndarray, before: np.ndarray, after: np.ndarray, top: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """New radiance (N, 3) and the factor on the old one's deviation (N, 3), infinite for what was never measured.

        radiance : (N, 3) float64, the changed pixels in the map
        before, after : (N, 3) linear values, 1 white, as the slice showed and as the painter left them
        top : the radiance of white
        """
        ...


@dataclass(frozen=True)
class Replaced:
    """Changed pixels become what the painter sees, as in HDR Shop: nothing painted is brighter than white.

    A channel that the painter left as it was keeps its finer radiance, unless the slice showed it clipped at white:
    of a painted pixel no light remains that the painter could not see.
    """

    def __call__(
        self, radiance: np.ndarray, before: np.ndarray, after: np.ndarray, top: float
    ) -> tuple[np.ndarray, np.ndarray]:
        kept = (before == after) & (before < 1)
        return np.where(kept, radiance, after * top), np.where(kept, 1.0, np.inf)


@dataclass(frozen=True)
class Scaled:
    """Changed pixels are multiplied by after ÷ before, channel by channel: a light that is dodged down stays a light.

    Black has no ratio, and is replaced. What was clipped at white counts as white before.
    """

    def __call__(
        self, radiance: np.ndarray, before: np.ndarray, after: np.ndarray, top: float
    ) -> tuple[np.ndarray, np.ndarray]:
        ratio = np.divide(after, before, out=np.ones_like(after), where=before > 0)
        black = (before <= 0) & (after > 0)
        return np.where(black, after * top, radiance * ratio), np.where(black, np.inf, ratio)


@dataclass(frozen=True, eq=False)
class Repainted:
    """A map with a painter's changes.

    picture : the map; pixels that were replaced bear no mark, for they are what was painted, and have infinite
        variance, for they were not measured
    changed : (H, W) bool
    above_white : changed pixels that the slice showed clipped, brighter in the map than a painter could see
    lost : the luminance that these had and no longer have, summed, in the map's unit × pixels
    painted_white : changed pixels with a channel painted up to white, beyond which a slice shows nothing
    """

    picture: RadianceMap
    changed: np.ndarray
    above_white: int
    lost: float
    painted_white: int

    @property
    def share(self) -> float:
        """Of the pixels that changed."""
        return float(self.changed.mean())

    @property
    def places(self) -> int:
        """How many patches of touching pixels changed: few by a brush, hundreds by a JPEG."""
        from scipy.ndimage import label

        return cast(tuple[np.ndarray, int], label(self.changed, np.ones((3, 3))))[1]


def fingerprint(picture: RadianceMap) -> str:
    """A digest of the radiance, by which a slice is known to be cut from this map."""
    return sha256(np.ascontiguousarray(picture.radiance).tobytes()).hexdigest()[:32]


def fitting_stops(picture: RadianceMap) -> float:
    """The whole number of stops that brings the 99th percentile of luminance nearest below white; 0 for a dark map."""
    light = luminance(picture.radiance)
    light = light[np.isfinite(light)]
    bright = float(np.percentile(light, 99)) if light.size else 0.0
    return float(math.floor(-math.log2(bright))) if bright > 0 else 0.0


def painted(
    picture: RadianceMap,
    edited: Photograph,
    cut: Slice,
    *,
    original: Photograph | None = None,
    method: Painting = Replaced(),
    tolerance: int = 0,
) -> Repainted:
    """Put what a painter changed in a slice into the map; unchanged pixels keep all their planes byte for byte.

    edited : the slice after painting, of the map's size, 8 or 16 bits
    cut : how the slice was made
    original : the slice before painting, to compare with; made anew from the map unless given. Give one that went
        through the same program, when that program changes pixels by itself
    method : `Replaced()`, as HDR Shop does, or `Scaled()`
    tolerance : difference of pixel values, in those of `edited`, up to which a channel counts as unchanged; 0 unless
        the file is a JPEG, which changes a little everywhere and saturated colours a lot

    Raises ValueError for another size, transparent pixels, an original of other bits, or a negative tolerance.
    """
    if tolerance < 0:
        raise ValueError(f"the tolerance is {tolerance}; expected 0 or more pixel values")
    # Both slices must be of the map's size, opaque and of the same bits.
    bits = 8 * edited.pixels.itemsize
    for image in (edited,) if original is None else (edited, original):
        if image.size != picture.size:
            sizes = [f"{width}×{height}" for width, height in (image.size, picture.size)]
            raise ValueError(f"{image.name} is {sizes[0]} pixels and the map {sizes[1]}; save it at the slice's size")
        if image.outside is not None:
            raise ValueError(f"{image.name} has transparent pixels; flatten it and save it without alpha")
        if image.pixels.dtype != edited.pixels.dtype:
            raise ValueError(f"{image.name} and {edited.name} differ in bits; save both alike")
    # Which pixels the painter changed.
    before = _codes(picture, cut, bits) if original is None else original.pixels.astype(np.int64)
    after = edited.pixels.astype(np.int64)
    # Within the tolerance a channel is as it was, in changed pixels too.
    after = np.where(np.abs(after - before) <= tolerance, before, after)
    changed = np.asarray((after != before).any(-1))
    if not changed.any():
        return Repainted(picture, changed, 0, 0.0, 0)
    # What their light becomes, and how much of what the slice clipped is lost.
    top = 2**bits - 1
    old, new = before[changed], after[changed]
    old_radiance = picture.radiance[changed].astype(np.float64)
    radiance, factor = method(old_radiance, decode_srgb(old / top), decode_srgb(new / top), cut.white)
    beyond = ((old == top) & (old_radiance > cut.white)).any(-1)
    lost = luminance(np.maximum(old_radiance - radiance, 0))[beyond].sum()
    result = picture.radiance.copy()
    result[changed] = radiance
    # The other planes follow.
    variance = clipped = None
    if picture.variance is not None:
        variance = picture.variance.copy()
        with np.errstate(invalid="ignore"):
            scaled = variance[changed] * factor**2
        variance[changed] = np.where(np.isinf(factor), np.inf, np.nan_to_num(scaled, nan=0.0, posinf=np.inf))
    if picture.clipped is not None:
        clipped = picture.clipped.copy()
        # What was painted bears no mark; a pixel that keeps something of the old radiance stays the bound that it was.
        clipped[changed] = np.where(np.isinf(factor).all(-1), 0, clipped[changed])
    return Repainted(
        replace(picture, radiance=result, variance=variance, clipped=clipped),
        changed,
        int(beyond.sum()),
        float(lost),
        int(((new == top) & (old < top)).any(-1).sum()),
    )


def _codes(picture: RadianceMap, cut: Slice, bits: int) -> np.ndarray:
    """The slice's own pixel values as a file of `bits` holds them when nobody paints."""
    codes = cut.photograph(picture).pixels.astype(np.int64)
    if cut.bits == bits:
        return codes
    # 255 × 257 is 65535: every program turns 8 bits into 16 so, and 16 into 8 by rounding back.
    return codes * 257 if bits > cut.bits else (codes + 128) // 257

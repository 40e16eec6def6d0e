"""Lateral chromatic aberration: red and blue are drawn a little larger or smaller than green, and how it is taken out.

A lens bends the colours differently, so that the picture has another scale in each channel; the difference grows
towards the corners. It is found in a picture's own edges and undone by moving red and blue along their radii.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from relume.image.radiance import OUTSIDE, RadianceMap

LARGEST = 0.02
"""The largest share by which a channel's scale may differ; lenses of phones have 0.002 at most."""
LIKELY = 0.005
"""The share up to which the border is left out where it comes from beyond the picture."""
TILE = 16
"""Pixels of the squares in which one factor ties two channels: what lies in one is mostly of one colour."""
SMOOTH = 1.0
"""Pixels of blur before edges are compared: differences of sharpness and noise then count less."""
ROUNDS, REWEIGHTED = 4, 5
"""Times that the channels are moved and compared again, and that what is far off is counted less in each."""
FEWEST = 200
"""Effective pixels at edges below which nothing is said."""
DARKEST = 1e-6
"""Of the brightest: below, noise is all there is."""


@dataclass(frozen=True)
class LateralColour:
    """Where red and blue lie of what green shows at the radius ρ, in half diagonals from the picture's middle.

    red, blue : (a, b): at ρ (1 + a + b ρ²)
    deviation : of a and b, of red and then of blue
    """

    red: tuple[float, float] = (0.0, 0.0)
    blue: tuple[float, float] = (0.0, 0.0)
    deviation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("red", "blue"):
            a, b = getattr(self, name)
            if not (abs(a) < LARGEST and abs(a + b) < LARGEST):
                raise ValueError(
                    f"lateral colour: {name} is {a:g},{b:g}; expected shares of the radius below {LARGEST}"
                )

    def at_corner(self, size: tuple[int, int]) -> tuple[float, float]:
        """Pixels by which red and blue lie outside of green in the corners of a picture of `size` (width, height)."""
        half = float(np.hypot(*size)) / 2
        return half * sum(self.red), half * sum(self.blue)

    def __str__(self) -> str:
        return f"red {self.red[0]:+.6f} {self.red[1]:+.6f} blue {self.blue[0]:+.6f} {self.blue[1]:+.6f}"


def without_lateral_colour(picture: RadianceMap, lateral: LateralColour) -> RadianceMap:
    """The map with red and blue moved onto green, which stays as it is; the attribute `lateral_colour` says by what.

    picture : a radiance map
    lateral : of its lens, as `recover_lateral_colour` finds it

    Cubic between pixels, and nowhere beyond the nine pixels about a place, so that lamps get no dark rings. What
    red or blue brings from a clipped place is marked as that is; what comes from beyond the picture is its edge.
    """
    radiance = picture.radiance.copy()
    variance = None if picture.variance is None else picture.variance.copy()
    clipped = None if picture.clipped is None else picture.clipped.copy()
    for channel, terms in ((0, lateral.red), (2, lateral.blue)):
        if not any(terms):
            continue
        x, y = _places(picture.size, terms)
        radiance[..., channel] = _moved(np.ascontiguousarray(picture.radiance[..., channel]), x, y)
        if variance is not None and picture.variance is not None:
            own = np.ascontiguousarray(picture.variance[..., channel])
            known = np.where(np.isfinite(own), own, 0).astype(np.float32)
            lost = _looked_up((~np.isfinite(own)).astype(np.float32), x, y, cv2.INTER_LINEAR) > 0
            variance[..., channel] = np.where(lost, np.inf, _looked_up(known, x, y, cv2.INTER_LINEAR))
        if clipped is not None and picture.clipped is not None:
            marks = _looked_up(picture.clipped, x, y, cv2.INTER_NEAREST)
            clipped = np.where((clipped == 0) & (marks != OUTSIDE), marks, clipped)
    attributes = {**picture.attributes, "lateral_colour": str(lateral)}
    return replace(picture, radiance=radiance, variance=variance, clipped=clipped, attributes=attributes)


def recover_lateral_colour(picture: RadianceMap) -> LateralColour:
    """The lateral colour that a picture's own edges show: to 0.15 pixels in one of 240×160 with 150 discs, of 1.

    picture : a radiance map with many edges in it

    In squares of 16 pixels red is taken for a factor times green and a constant, on a scale that is even below the
    median and logarithmic above. What is left is a shift along the radius: two numbers for the whole picture, by
    weighted least squares, with outliers counted less (Huber 1964). Coloured edges that lie all round the middle alike
    would be taken for it. Raises ValueError for a picture without enough edges, or one whose channels differ by more
    than lenses do.
    """
    light = picture.radiance.astype(np.float64)
    usable = np.all(light > DARKEST * float(light.max(initial=0)), axis=-1)
    if picture.clipped is not None:
        usable &= picture.clipped == 0
    if picture.variance is not None:
        usable &= np.isfinite(picture.variance).all(axis=-1)
    usable &= np.isfinite(light).all(axis=-1)
    # Smoothing draws from pixels that are not used, and near the border from beyond the picture.
    usable = cv2.erode(usable.astype(np.uint8), np.ones((7, 7), np.uint8)).astype(bool)
    border = 4 + int(np.ceil(LIKELY * np.hypot(*picture.size) / 2))
    usable[:border] = usable[-border:] = usable[:, :border] = usable[:, -border:] = False
    if not usable.any():
        raise ValueError("lateral colour: no pixel is measured in all channels; take a picture with edges")
    found = [_fitted(picture.radiance, channel, usable) for channel in (0, 2)]
    (red, of_red), (blue, of_blue) = found
    return LateralColour(red, blue, (*of_red, *of_blue))


def _fitted(
    radiance: np.ndarray, channel: int, usable: np.ndarray
) -> tuple[tuple[float, float], tuple[float, float]]:  # fmt: skip
    """a and b of a channel, and their deviations."""
    height, width = usable.shape
    green = _compressed(radiance[..., 1])
    down, across = np.gradient(green)
    x, y = np.arange(width) + 0.5 - width / 2, (np.arange(height) + 0.5 - height / 2)[:, None]
    radial = across * x + down * y
    square = (x**2 + y**2) / (np.hypot(width, height) / 2) ** 2
    tile = (np.arange(height) // TILE)[:, None] * (-(-width // TILE)) + np.arange(width) // TILE
    index, weight = tile[usable], radial[usable] ** 2
    if weight.sum() ** 2 < FEWEST * np.sum(weight**2) or not weight.any():
        raise ValueError("lateral colour: the picture shows too few edges; take one with more, towards its corners too")
    terms = np.zeros(2)
    deviation = np.zeros(2)
    source = np.ascontiguousarray(radiance[..., channel])
    for _ in range(ROUNDS):
        moved = _moved(source, *_places((width, height), (float(terms[0]), float(terms[1])))) if terms.any() else source
        factor, rest = _tied(_compressed(moved)[usable], green[usable], index)
        # A channel drawn larger by a shows at p what green shows at p (1 − a): red(p) = green(p) − a p · ∇green.
        slope = -factor * radial[usable]
        design = np.stack([slope, slope * square[usable]], axis=-1)
        counted = np.ones(len(rest))
        for _ in range(REWEIGHTED):
            normal = (design * counted[:, None]).T @ design
            step = np.linalg.solve(normal + 1e-12 * np.trace(normal) * np.eye(2), (design * counted[:, None]).T @ rest)
            off = np.abs(rest - design @ step)
            scale = 1.345 * 1.4826 * max(float(np.median(off)), 1e-9)
            counted = np.minimum(1, scale / np.maximum(off, 1e-12))
        terms = terms + step
        left = float(np.average((rest - design @ step) ** 2, weights=counted))
        deviation = np.sqrt(np.diag(np.linalg.inv(normal + 1e-12 * np.trace(normal) * np.eye(2))) * left)
        if abs(terms[0]) > LARGEST or abs(terms.sum()) > LARGEST:
            raise ValueError("lateral colour: the channels differ by more than lenses do; is it one picture?")
    return (float(terms[0]), float(terms[1])), (float(deviation[0]), float(deviation[1]))


def _tied(values: np.ndarray, green: np.ndarray, index: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """In each square the factor and the constant that tie a channel to green: the factor, and what is left."""
    count = np.maximum(np.bincount(index), 1)
    mean_green = (np.bincount(index, green) / count)[index]
    mean_values = (np.bincount(index, values) / count)[index]
    centred, own = green - mean_green, values - mean_values
    spread = np.bincount(index, centred**2)
    factor = np.bincount(index, centred * own) / np.maximum(spread, 1e-12)
    # A channel that does not follow green there says nothing of a shift.
    factor = np.clip(np.where(factor > 0.2, factor, 0.0), 0.0, 5.0)[index]
    return factor, np.where(factor > 0, own - factor * centred, 0.0)


def _compressed(plane: np.ndarray) -> np.ndarray:
    """Even below the median and logarithmic above: lamps count as edges, and dark sides of edges not for more."""
    from scipy.ndimage import gaussian_filter

    plane = plane.astype(np.float64)
    middle = max(float(np.median(plane)), DARKEST * float(plane.max(initial=0)), 1e-30)
    return gaussian_filter(np.log1p(np.maximum(plane, 0) / middle), SMOOTH, mode="nearest")


def _places(size: tuple[int, int], terms: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Where a channel shows what green shows at each pixel: columns and rows (H, W) float32, 0 the first's middle."""
    width, height = size
    x, y = np.arange(width) + 0.5 - width / 2, (np.arange(height) + 0.5 - height / 2)[:, None]
    grown = 1 + terms[0] + terms[1] * (x**2 + y**2) / (np.hypot(width, height) / 2) ** 2
    return (x * grown + width / 2 - 0.5).astype(np.float32), (y * grown + height / 2 - 0.5).astype(np.float32)


def _moved(plane: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    plane = np.ascontiguousarray(plane, np.float32)
    near = np.ones((3, 3), np.uint8)
    low, high = (_looked_up(each(plane, near), x, y, cv2.INTER_NEAREST) for each in (cv2.erode, cv2.dilate))
    return np.clip(_looked_up(plane, x, y, cv2.INTER_CUBIC), low, high)


def _looked_up(plane: np.ndarray, x: np.ndarray, y: np.ndarray, between: int) -> np.ndarray:
    return cv2.remap(plane, x, y, between, borderMode=cv2.BORDER_REPLICATE)

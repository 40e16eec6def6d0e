"""What each view of a panorama shows on one coarse map of the sphere, side by side: for balance and seams."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.image.radiance import RadianceMap
from relume.probe.panorama.views import PanoramaView, fold, undistorted

CELLS = 3
"""Look-ups a coarse cell and side: the pictures are shrunk to its size first."""
DARKEST = 1e-6
"""Share of a view's median radiance below which nothing is compared: noise and black."""


@dataclass(frozen=True, eq=False)
class Coverage:
    """What views show in the cells of a lat-long map.

    logarithm : (views, rows, 2·rows, 3) float32, ln radiance; 0 where it is not measured
    measured : (views, rows, 2·rows) bool, cells that a view covers whole and sees neither saturated nor black
    covered : (views, rows, 2·rows) bool, cells that a view covers at least in part
    inwards : (views, rows, 2·rows) float32, distance from the rim, 1 at half the picture's shorter side
    """

    logarithm: np.ndarray
    measured: np.ndarray
    covered: np.ndarray
    inwards: np.ndarray

    @property
    def rows(self) -> int:
        """Of the map."""
        return self.measured.shape[1]


def coverage(views: Sequence[PanoramaView], rows: int, margin: float = 0.0) -> Coverage:
    """Look through all views.

    margin : share of a picture's shorter side that it is continued by beyond its rim, for views that only touch
    """
    shape = (len(views), rows, 2 * rows)
    logarithm, inwards = np.zeros((*shape, 3), np.float32), np.zeros(shape, np.float32)
    measured, covered = np.zeros(shape, bool), np.zeros(shape, bool)
    for index, view in enumerate(views):
        small = shrunk(view, rows / np.pi)
        side = min(small.picture.size)
        beyond = max(math.ceil(margin * side), 1) if margin else 0
        shown = view_in_map(continued(small, beyond), rows, 0, rows, CELLS)
        radiance, share = shown[..., :3], shown[..., 4]
        lit = view.picture.radiance[view.picture.radiance > 0]
        least = DARKEST * float(np.median(lit[:: max(1, lit.size // 100_000)])) if lit.size else np.inf
        covered[index] = share > 0
        measured[index] = (share > (0.3 if margin else 0.99)) & (shown[..., 3] <= 0) & (radiance.min(-1) > least)
        logarithm[index] = np.log(np.where(measured[index][..., None], radiance, 1))
        inwards[index] = np.clip(2 * (shown[..., 5] - beyond) / side, 0, 1)
    return Coverage(logarithm, measured, covered, inwards)


def continued(view: PanoramaView, pixels: int) -> PanoramaView:
    """The view with so many pixels more on every side, in which ln radiance goes on as steeply as inside.

    Were the rim only repeated, light that grows from one view to its neighbour would look like a gain between them.
    """
    if pixels < 1:
        return view
    radiance = view.picture.radiance
    lit = radiance[radiance > 0]
    least = DARKEST * float(np.median(lit)) if lit.size else 1.0
    around = ((pixels, pixels), (pixels, pixels))
    logarithm = np.log(np.maximum(radiance, least))
    with np.errstate(over="ignore"):
        wide = np.exp(np.pad(logarithm, (*around, (0, 0)), mode="reflect", reflect_type="odd"))
    # Two lamps in a corner multiply: what is beyond all light there is has no meaning.
    wide = np.minimum(wide, max(float(radiance.max()), least)).astype(np.float32)
    wide[pixels:-pixels, pixels:-pixels] = radiance
    marks = view.picture.clipped
    clipped = None if marks is None else np.pad(marks, around, mode="reflect")
    return replace(view, picture=RadianceMap(wide, None, clipped, view.picture.unit))


def shrunk(view: PanoramaView, focal_length: float) -> PanoramaView:
    """The view in fewer pixels, of about this focal length; itself where it has no more."""
    factor = int(view.focal_length / focal_length)
    width, height = view.picture.size
    if factor < 2 or min(width, height) < 2 * factor:
        return view
    import cv2

    size = (max(1, round(width / factor)), max(1, round(height / factor)))
    radiance = cv2.resize(np.ascontiguousarray(view.picture.radiance), size, interpolation=cv2.INTER_AREA)
    clipped = None
    if view.picture.clipped is not None:
        # A pixel is what the worst of those in it are: a bound stays a bound.
        worst = [
            cv2.resize((view.picture.clipped == code).astype(np.float32), size, interpolation=cv2.INTER_AREA) > 0
            for code in (2, 1, 3)
        ]
        clipped = np.select([worst[2], worst[1], worst[0]], [3, 1, 2], 0).astype(np.uint8)
    picture = RadianceMap(np.maximum(radiance, 0), None, clipped, view.picture.unit)
    # Both sides are rounded, by less than half a pixel of the shrunk picture; the width gives the scale.
    return replace(view, picture=picture, focal_length=view.focal_length * size[0] / width)


def reach(view: PanoramaView) -> float:
    """Radians from the axis within which all of a view lies."""
    width, height = view.picture.size
    corner = float(np.hypot(width / 2, height / 2)) / view.focal_length
    if view.distortion < 0:
        # The lens folds at a tangent; where the picture ends before it that is a bound all the same.
        square = fold(view.distortion)
        if corner >= np.sqrt(square) * (1 + view.distortion * square):
            return float(np.arctan(np.sqrt(square)))
    return float(np.arctan(np.linalg.norm(undistorted(np.array([corner, 0.0]), view.distortion))))


def view_in_map(view: PanoramaView, rows: int, begin: int, end: int, cells: int) -> np.ndarray:
    """(end − begin, 2·rows, 6) float32: see `view_in_rows`."""
    from relume.probe.panorama.kernel import view_in_rows

    turns = 2 * np.pi * ((np.arange(2 * rows * cells) + 0.5) / (2 * rows * cells) - 0.5)
    longitudes = np.stack([np.sin(turns), np.cos(turns)], axis=-1)
    polar = np.pi * (np.arange(rows * cells) + 0.5) / (rows * cells)
    latitudes = np.stack([np.sin(polar), np.cos(polar)], axis=-1)
    codes = view.picture.clipped
    if codes is None:
        codes = np.zeros(view.picture.radiance.shape[:2], np.uint8)
    far = np.cos(min(reach(view) + 2 * np.pi / rows, np.pi))
    lens = np.array([view.focal_length, view.distortion, fold(view.distortion), far])
    shown = np.zeros((end - begin, 2 * rows, 6), np.float32)
    picture = np.require(view.picture.radiance, np.float32, ["C", "A", "W"])
    codes = np.require(codes, np.uint8, ["C", "A", "W"])
    rotation = np.require(view.placed, np.float64, ["C", "A", "W"])
    view_in_rows(picture, codes, lens, rotation, latitudes, longitudes, begin, end, rows, cells, shown)
    return shown

"""From views of a mirrored ball to one environment map.

Every view is blind behind the ball, sees it squeezed near the silhouette and sees its own camera in the middle;
what one view lacks comes from another (Debevec 1998, §5.1: two views ninety degrees apart).
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np

from relume.errors import Doubt
from relume.image.bands import in_threads
from relume.image.colour import luminance
from relume.image.primaries import inside_gamut
from relume.image.radiance import OUTSIDE, SATURATED
from relume.probe.ball.registration import KnownPlaces, RegistrationMethod
from relume.probe.ball.unwrapping import BallView, Seen
from relume.probe.ball.weights import Agreement, agreement, clear_of_camera, finest
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.inpainting import continued
from relume.sphere.mappings.mapping import LatLong, pixel_points

AT_ONCE = 4
"""Strips of the map that are in memory together, on however many cores."""
SHARPNESS = 8
"""Power of the weights: high, so that a near lamp that two views show in two places is taken from one of them."""
UNSEEN = 0.05
"""Confidence below which a direction counts as seen by no view."""
PLACES = 96
"""Rows of the map of where on the ball a direction was mirrored, which changes slowly: 1.9° each."""
CLIPPED_SHARE = 0.05
"""Share of saturated light from which on a pixel is but a lower bound."""


@dataclass(frozen=True, eq=False)
class Probe:
    """An environment map with what it was blended from.

    light : lat-long environment map; its `clipped` marks what was saturated, and what no view saw and was filled in
    corrections : radians by which registration turned each view; the first view stays
    nearness : ball radius over the distance of what surrounds it, as registration found it; 0 for a lone view
    clipped_solid_angle : steradians whose light was saturated in every photograph of the view it came from
    confidence : (size, 2·size) float32, 0 where no view saw the direction well, 1 where one faced it squarely
    notes : doubts about the views, with their effect on the light
    turns : (N, 3, 3) rotations that carried each view's world into the first one's; None where that is not known
    gains : how many times as bright as the first each view was
    unseen_solid_angle : steradians that no view saw, so that they were filled in
    mirrored_at : (h, 2·h, 3) float32, a coarse lat-long map of where on the ball each direction was mirrored, in radii
        from its centre; the mean of the views as they were blended. The light of a direction d was seen from there,
        along d − nearness · mirrored_at. None for a map that no ball shows
    shares : (N, h, 2·h) float32, of each view the share that it has in a direction's light, as coarsely; they add up to
        1, and to 0 where no view saw. None for a map that no ball shows
    """

    light: EnvironmentMap
    corrections: tuple[float, ...]
    nearness: float
    clipped_solid_angle: float
    confidence: np.ndarray
    notes: tuple[Doubt, ...] = ()
    turns: np.ndarray | None = None
    gains: tuple[float, ...] = ()
    unseen_solid_angle: float = 0.0
    mirrored_at: np.ndarray | None = None
    shares: np.ndarray | None = None

    def _repr_html_(self) -> str:
        """What a notebook shows: the map, its energy, and what was clipped or not seen."""
        from relume.image.files.photographs.notebook_html import picture_html

        facts = self.light._facts()
        facts["saturated"] = f"{self.clipped_solid_angle:.3g} sr"
        facts["filled in"] = f"{self.unseen_solid_angle:.3g} sr"
        if len(self.corrections) > 1:
            facts["views"] = str(len(self.corrections))
        return picture_html(self.light.radiance, facts)

    def share(self, mark: int) -> float:
        """The share of all light (luminance) that comes from where the map has this `mark` in `clipped`.

        Of what is SATURATED it is a lower bound, and as much again is missing if the lamps are twice as bright.
        """
        if self.light.clipped is None:
            return 0.0
        energy = luminance(self.light.radiance) * self.light.mapping.solid_angles(self.light.size)
        return float(energy[self.light.clipped == mark].sum() / max(float(energy.sum()), 1e-30))


def blend_views(
    views: Sequence[BallView],
    *,
    size: int = 512,
    registration: RegistrationMethod = KnownPlaces(),
    balanced: bool = False,
) -> Probe:
    """Register the views of a ball to the first and blend them into a lat-long environment map.

    views : of one ball, each with its camera
    size : rows of the map; 512 is what a ball 600 pixels wide resolves
    registration : how the views are laid on one another; unless given the places of their cameras are taken as given,
        to a tape measure's uncertainty
    balanced : whether every view is brought to the brightness of the first; not unless asked for, since views that
        were exposed alike differ in brightness only where something is wrong

    A direction that no view sees is filled smoothly from round about it, marked OUTSIDE, and its confidence is 0.
    Raises BallNotFound where the registration finds that views do not overlap; ValueError for no views.
    """
    if not views:
        raise ValueError("no views of the ball were given; give one at least")
    # Lay the views on one another.
    found = registration(views)
    placed = found.views
    gains = found.gains if balanced else (1.0,) * len(views)
    agreed = agreement(placed, found.nearness, found.gains)
    near = found.nearness

    # Cells no wider than a pixel of the ball, or a lamp falls between them.
    ball_pixel = 2 / max(view.outline.radius for view in views)
    subdivision = max(2, int(np.ceil(np.pi / size / ball_pixel)))
    points = pixel_points(LatLong(), size, subdivision)
    cell = LatLong().solid_angles(size * subdivision)[:, 0]
    total, weight = np.zeros((size, 2 * size, 3)), np.zeros((size, 2 * size))
    sure, saturated = np.zeros_like(weight), np.zeros_like(weight)
    best = max(map(finest, placed))
    strips = np.array_split(np.arange(size), min(size, 8 * subdivision))

    def work(begin: int, end: int) -> list[float]:
        chosen, clipped = strips[begin], []
        rows = slice(chosen[0] * subdivision, (chosen[-1] + 1) * subdivision)
        directions = LatLong().directions(points[rows])
        cells = (len(chosen), subdivision, 2 * size, subdivision)
        shares, lights, marks = [], [], []
        for index, view in enumerate(placed):
            seen, share = _share(placed, index, directions, near, agreed)
            sure[chosen] += ((share / finest(view)) ** SHARPNESS).reshape(cells).sum((1, 3))
            shares.append((share / best) ** SHARPNESS)
            lights.append(seen.radiance / gains[index])
            marks.append(seen.saturated)
        whole = sum(shares, np.full(shares[0].shape, 1e-300))
        for share, light, over in zip(shares, lights, marks, strict=True):
            total[chosen] += (light * share[..., None]).reshape(*cells, 3).sum((1, 3))
            weight[chosen] += share.reshape(cells).sum((1, 3))
            lost = over * share / whole
            saturated[chosen] += lost.reshape(cells).mean((1, 3))
            clipped.append(float(((over > 0.5) * share / whole).sum(1) @ cell[rows]))
        return clipped

    clipped = sum(chain.from_iterable(in_threads(work, len(strips), min(os.cpu_count() or 1, AT_ONCE), chunk=1)), 0.0)
    # What no view saw is filled from its rim.
    confidence = np.minimum(sure / subdivision**2, 1) ** (1 / SHARPNESS)
    known = confidence > UNSEEN
    radiance = continued(total / np.maximum(weight, 1e-300)[..., None], known).astype(np.float32)
    # Photographs of wider primaries hold colours that light of Rec. 709 cannot be.
    radiance = inside_gamut(radiance)
    mask = np.where(saturated > CLIPPED_SHARE, SATURATED, 0).astype(np.uint8)
    mask[~known] = OUTSIDE
    light = EnvironmentMap(radiance, unit=views[0].picture.unit, clipped=mask if mask.any() else None)
    return Probe(
        light, found.corrections, near, clipped, np.where(known, confidence, 0).astype(np.float32), found.doubts,
        found.turns, found.gains, float((~known * LatLong().solid_angles(size)).sum()),
        *_coarsely(placed, near, agreed),
    )  # fmt: skip


def _share(
    views: Sequence[BallView], index: int, directions: np.ndarray, nearness: float, agreed: Agreement | None
) -> tuple[Seen, np.ndarray]:
    """What one of the views shows in directions (…, 3), and how far it is believed there (…), pixels per radian."""
    view = views[index]
    seen = view.see(directions, nearness)
    share = seen.sampling
    if len(views) > 1:
        # A lone view keeps its camera in the picture: nothing else could stand there.
        share = share * clear_of_camera(view, directions)
        share = share if agreed is None else share * agreed.of(index, directions)
    return seen, share


def _coarsely(views: Sequence[BallView], nearness: float, agreed: Agreement | None) -> tuple[np.ndarray, np.ndarray]:
    """`Probe.mirrored_at` and `Probe.shares` of views that were laid on one another."""
    directions = LatLong().directions(pixel_points(LatLong(), PLACES))
    total, weight = np.zeros(directions.shape), np.full(directions.shape[:2], 1e-300)
    best, sure, weights = max(map(finest, views)), np.zeros(directions.shape[:2]), []
    for index, view in enumerate(views):
        believed = _share(views, index, directions, nearness, agreed)[1]
        weights.append((believed / best) ** SHARPNESS)
        total += weights[-1][..., None] * view.mirrored_at(directions, nearness)
        weight += weights[-1]
        sure += (believed / finest(view)) ** SHARPNESS
    shares = np.where(sure ** (1 / SHARPNESS) > UNSEEN, np.array(weights) / weight, 0)
    return (total / weight[..., None]).astype(np.float32), shares.astype(np.float32)

"""All views of a ball adjusted together: their turns, their silhouettes, and how near the walls are.

The ball shows right inside its rim what lies behind it, so that a well polished one hardly differs there from its
ground, and the rim is found too far inside. Views that agree show it better: a ball that is taken a pixel too small
moves all that it mirrors outward, most near the rim, and no turn of the view does that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from relume.image.bands import in_threads
from relume.image.bilinear import bilinear
from relume.image.colour import luminance
from relume.probe.ball.silhouette import RAYS
from relume.probe.ball.unwrapping import BallView
from relume.sphere.directions import rotation_from_vector

NEAREST = 0.2
"""The greatest nearness registration may find: walls five ball radii away."""
EVEN_LIGHT = 0.05
"""Standard deviation of ln luminance below which there is nothing to correlate."""
RIM_LIMIT = 0.008
"""The most that a silhouette is moved or grown, in radii: beyond that it was not the rim that was found."""
RIM_HOLD = 0.25
"""How hard a silhouette is held of which half was seen, in misfit per pixel; light may show nothing of it."""
BLUR = 0.5
"""Pixels by which ln luminance is blurred before views are compared, so that both are smooth where they are probed."""
PARTS = 100
ROBUST = 0.1
"""Difference in ln luminance from which on a direction counts less: lamps a little out of place, people who moved."""
DOUBTED = 4.0
GATES = (0.8, 0.4, 0.2, 0.1)
"""Difference from the mean, in medians of it and at least in ln luminance, beyond which a direction is not believed:
wide at first, or where the search began would decide what is believed, then narrower round by round."""
STEP = 1e-3
"""Radians by which views are turned to see how the misfit changes: a third of a pixel of a ball of 600 pixels."""


@dataclass(frozen=True, eq=False)
class Adjustment:
    """vectors : (N, 3) rotation vectors, the first zero; rims : (N, 3) pixels right, down, outward; nearness."""

    vectors: np.ndarray
    rims: np.ndarray
    nearness: float


@dataclass(frozen=True, eq=False)
class Bundle:
    """The robust least squares problem of all views.

    views : turned roughly into the first one's world
    directions : (M, 3) at which they are compared
    shares : (N, M) how much each view has to say there; they sum to 1 over the views
    adjusting : whether silhouettes are adjusted
    hold : how hard the turns are held where they are, in misfit per radian
    """

    views: Sequence[BallView]
    directions: np.ndarray
    shares: np.ndarray
    adjusting: bool = True
    hold: float = 0.0

    @cached_property
    def levels(self) -> list[np.ndarray]:
        """Every picture's ln luminance.

        The logarithm comes before all looking up between pixels: after it, a lamp a thousand times as bright as the
        wall would reach the width of a pixel beyond itself, farther towards the rim than away from it, and so in other
        directions in every view.
        """
        pictures = (luminance(view.picture.radiance) for view in self.views)
        floors = ((picture, 1e-3 * float(np.median(picture)) + 1e-12) for picture in pictures)
        return [np.asarray(gaussian_filter(np.log(np.maximum(*each)), BLUR)) for each in floors]

    def placed(self, found: Adjustment, index: int) -> BallView:
        """A view as adjusted."""
        view = self.views[index].adjusted(*found.rims[index]) if self.adjusting else self.views[index]
        return view.turned(rotation_from_vector(found.vectors[index]))

    def logarithms(self, found: Adjustment) -> np.ndarray:
        """(N, M) ln luminance of every view."""
        return np.stack([self._logarithm(found, index) for index in range(len(self.views))])

    def offsets(self, seen: np.ndarray) -> np.ndarray:
        """(N,) ln of how much brighter each view is than the first, where both show the directions well."""
        both = np.minimum(self.shares, self.shares[0])
        offsets = [0.0]
        for index in range(1, len(seen)):
            usable = both[index] >= np.median(both[index])
            offsets.append(float(np.median((seen[index] - seen[0])[usable])))
        return np.array(offsets)

    def likeness(self, seen: np.ndarray, index: int) -> float:
        """The correlation of a view with the mean of all others; 1 in light that is the same all round."""
        others = np.delete(np.arange(len(seen)), index)
        shares = self.shares[others]
        total = shares.sum(0)
        mean = (shares * (seen - self.offsets(seen)[:, None])[others]).sum(0) / np.maximum(total, 1e-12)
        usable = np.minimum(self.shares[index], total) > 0.02
        if usable.sum() < 100:
            return 0.0
        ours, theirs = seen[index][usable], mean[usable]
        if min(np.std(ours), np.std(theirs)) < EVEN_LIGHT:
            return 1.0
        return float(np.corrcoef(ours, theirs)[0, 1])

    def solved(self, limit: float) -> Adjustment:
        """The adjustment that lays the views on one another; `limit` is the most a view is turned, radians."""
        from scipy.optimize import least_squares

        count, free = len(self.views), 3 * (len(self.views) - 1)
        rims = np.repeat([RIM_LIMIT * view.outline.radius for view in self.views], 3 if self.adjusting else 0)
        upper = np.array([*[limit] * free, *rims, NEAREST])
        lower = np.array([*[-limit] * free, *-rims, 0.0])
        scale = np.array([*[0.02] * free, *[1.0] * len(rims), 0.02])
        steps = np.array([*[STEP] * free, *[0.1] * len(rims), STEP / 4])
        # Each turn and each silhouette concerns one view alone, so that only this one is looked up again.
        owner = [1 + place // 3 for place in range(free)] + [place // 3 for place in range(len(rims))] + [-1]

        believed = np.ones(len(self.directions))

        def misfit(guess: np.ndarray) -> np.ndarray:
            found = self._parts(guess, count)
            return self._misfits(self.logarithms(found), found, believed)

        def slopes(guess: np.ndarray) -> np.ndarray:
            found = self._parts(guess, count)
            seen = self.logarithms(found)
            base = self._misfits(seen, found, believed)

            def column(place: int, _: int) -> np.ndarray:
                step = steps[place]
                forward = self._parts(guess + step * (np.arange(len(guess)) == place), count)
                if owner[place] < 0:
                    moved = self.logarithms(forward)
                else:
                    moved = seen.copy()
                    moved[owner[place]] = self._logarithm(forward, owner[place])
                return (self._misfits(moved, forward, believed) - base) / step

            return np.stack(in_threads(column, len(steps), chunk=1), axis=1)

        start = np.zeros(len(upper))
        start[-1] = 0.01
        slope: Any = slopes  # the stubs know three words for it and no function
        # Whoever walked between two views is in one of them: what departs far more than most is not believed.
        for gate in GATES if self.adjusting else GATES[:1]:
            off = self._disagreement(self.logarithms(self._parts(start, count)))
            believed = 1 / (1 + (off / max(DOUBTED * float(np.median(off)), gate)) ** 4)
            solution = least_squares(
                misfit, start, jac=slope, bounds=(lower, upper), loss="soft_l1", f_scale=ROBUST, x_scale=scale,
                xtol=1e-4, ftol=1e-4, max_nfev=20,
            )  # fmt: skip
            start = np.clip(solution.x, 0.999 * lower, 0.999 * upper)
            start[-1] = max(start[-1], 1e-4)
        return self._parts(start, count)

    def _disagreement(self, seen: np.ndarray) -> np.ndarray:
        """(M,) the most by which a view that has something to say departs from the others, ln luminance."""
        return (np.abs(self._departures(seen)) * (self.shares > 0.05)).max(0)

    def _departures(self, seen: np.ndarray) -> np.ndarray:
        """(N, M) ln luminance by which each view, on the first one's scale, departs from the mean of all."""
        level = seen - self.offsets(seen)[:, None]
        return level - (self.shares * level).sum(0)

    def _parts(self, guess: np.ndarray, count: int) -> Adjustment:
        free = 3 * (count - 1)
        vectors = np.concatenate([np.zeros((1, 3)), guess[:free].reshape(-1, 3)])
        rims = guess[free:-1].reshape(-1, 3) if self.adjusting else np.zeros((count, 3))
        return Adjustment(vectors, rims, float(guess[-1]))

    def _logarithm(self, found: Adjustment, index: int) -> np.ndarray:
        view = self.placed(found, index)
        x, y, incidence, _ = view.places(self.directions, found.nearness)
        return bilinear(self.levels[index], x, y) - np.log(view.reflectance.at(incidence).mean(-1))

    def _misfits(self, seen: np.ndarray, found: Adjustment, believed: np.ndarray) -> np.ndarray:
        off = np.sqrt(self.shares * believed) * self._departures(seen)
        return np.concatenate([off.ravel(), self._held(found)])

    def _held(self, found: Adjustment) -> np.ndarray:
        """What silhouettes and turns cost by themselves, in parts so small that the robust loss leaves them squares."""
        # A silhouette is held the harder, the more of it was seen where one ellipse has it.
        seen = np.array([min(len(view.outline.points) / RAYS, 1.0) for view in self.views])[:, None]
        rims, turns = RIM_HOLD * seen / (1.05 - seen) * found.rims, self.hold * found.vectors
        return np.repeat(np.concatenate([rims.ravel(), turns.ravel()]) / PARTS**0.5, PARTS)

"""The foot of what a ball stands on, where it stands on something: below it the plate shows another thing.

A cup or a glass is narrower than the ball and reaches straight down from it. A shadow is as wide as the ball where it
begins, and a ball that lies on the table has nothing below it but that.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from relume.image.colour import luminance
from relume.image.radiance import RadianceMap

CHANGED = 0.45
"""Difference of ln luminance from which on a pixel shows another thing; soft shadows stay below."""
NOISE = 6.0
"""Times the usual difference between the two pictures beside the ball, at least."""
STEM, BESIDE = 0.6, (0.85, 1.6)
"""Ball radii to both sides of its middle within which a stand is seen, and between which nothing may have changed."""
SHARE = 0.15
"""Of the pixels beside it that may have changed all the same: what a shadow falls on."""
GAP = 0.8
"""Radii along which a stand may look like what is behind it, as a glass's stem does."""
FEWEST = 0.04
"""Radii across which something must have changed in a row: less is a grain, or an edge that moved a little."""
LEAST = 0.6
"""Radii below the rim to which a stand reaches at least; a contact shadow ends before."""


def foot_of_stand(plate: RadianceMap, picture: RadianceMap, rim: np.ndarray) -> tuple[float, float] | None:
    """Where the stand of a ball meets the table, x and y in pixels; None for a ball without one.

    plate, picture : from one place, without and with the ball
    rim : (N, 2) pixels of the ball's rim
    """
    middle, radius = rim.mean(0), float(np.ptp(rim, axis=0).max()) / 2
    first, second = (np.log(np.maximum(luminance(each.radiance), 1e-9)) for each in (plate, picture))
    change = gaussian_filter(second - first, max(0.7, radius / 40))
    usual = float(np.median(change))
    limit = max(CHANGED, NOISE * float(np.median(np.abs(change - usual))))
    changed = np.abs(change - usual) > limit
    # Down from the rim, row by row, for as long as something narrow is there.
    aside = np.abs(np.arange(changed.shape[1]) + 0.5 - middle[0]) / radius
    within, beside = aside < STEM, (aside > BESIDE[0]) & (aside < BESIDE[1])
    start, last = int(middle[1] + 1.05 * radius), None
    for row in range(max(start, 0), changed.shape[0]):
        if (last is None and row > start + GAP * radius) or (last is not None and row > last + GAP * radius):
            break
        if changed[row, within].sum() >= FEWEST * radius and changed[row, beside].mean() < SHARE:
            last = row
    if last is None or last < middle[1] + (1 + LEAST) * radius:
        return None
    # A picture that ends before the stand does says nothing.
    if last >= changed.shape[0] - 2:
        return None
    return float(middle[0]), float(last + 1)

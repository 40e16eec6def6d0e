"""Sharpness: how far a plate's lens, sensor and processing spread a point, measured on its sharpest clean edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from relume.image.bands import in_bands
from relume.image.colour import luminance
from relume.image.radiance import RadianceMap
from relume.renderers.results import Change
from relume.virtual_camera.plate_matching.edges import Edges, clean_edges

FEWEST = 8
"""Clean edges below which nothing is said: of fewer, the sharpest may all be shadows or out of focus."""
SHARPEST = 0.25
"""Share of the edges that are taken to be as sharp as the lens draws them. Shadows, round corners and what is out of
focus make edges softer, never sharper."""
SCALES = (1, 2, 4)
"""Pixel widths at which edges are looked for, until enough are found: large photographs are soft and noisy close up."""
REACH = 5.0
"""Deviations to which the blur is followed: what lies beyond is 1e-6 of the light."""


PutAway = Callable[[np.ndarray], np.ndarray]


def as_it_is(plane: np.ndarray) -> np.ndarray:
    """The plane, which stays in memory."""
    return plane


@dataclass(frozen=True)
class Sharpness:
    """A round Gaussian point spread, over and above the width of the pixels.

    sigma : standard deviation in pixels; 0 for a plate as sharp as its pixels, or sharpened
    error : its standard error, pixels
    edges : how many clean edges it was measured on
    """

    sigma: float
    error: float = 0.0
    edges: int = 0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sigma) and self.sigma >= 0):
            raise ValueError(f"sigma is {self.sigma}; expected pixels, 0 or more")

    @property
    def reach(self) -> int:
        """Pixels to which light is spread; what lies farther off changes nothing."""
        return 0 if self.sigma == 0 else int(np.ceil(REACH * max(self.sigma, 0.5)))

    def blurred(self, plane: np.ndarray) -> np.ndarray:
        """A plane (H, W) or (H, W, C) softened; zeros further than REACH deviations from all else stay exactly 0.

        The border goes on as its mirror image.
        """
        if self.sigma == 0:
            return plane
        from scipy.ndimage import convolve1d

        taps = _taps(self.sigma)
        soft, reach = np.empty_like(plane), self.reach

        def work(rows: slice) -> None:
            # With the rows that reach into the band; the picture's own border is the only one.
            larger = slice(max(rows.start - reach, 0), rows.stop + reach)
            part = plane[larger].astype(np.float64)
            if not part.any():
                soft[rows] = 0
                return
            once = convolve1d(part, taps, axis=0, mode="reflect")[rows.start - larger.start :][: rows.stop - rows.start]
            soft[rows] = convolve1d(once, taps, axis=1, mode="reflect")

        in_bands(plane.shape[0], plane.shape[1], work)
        return soft

    def apply(self, change: Change, put_away: PutAway = as_it_is) -> Change:
        """The change as the plate's lens would have drawn it: objects, matte and difference softened alike.

        change : premultiplied, rendered with pixels as wide as they are (a box filter) and without a lens of its own
        put_away : what is done with each plane that is made, for large ones to go to a file
        The variances go with the light, which overstates what is left of the noise. Depth, normal and albedo are kept.
        """
        if self.sigma == 0:
            return change
        soft: dict[str, np.ndarray] = {}
        for name in ("objects", "difference", "matte", "objects_variance", "difference_variance"):
            plane = self.blurred(getattr(change, name))
            soft[name] = put_away(np.clip(plane, 0, 1) if name == "matte" else plane)
        return replace(change, **soft)


def measured_sharpness(plate: RadianceMap) -> Sharpness | None:
    """The point spread of a plate from its clean edges; None where it shows too few.

    plate : scene-linear, not denoised where there is a choice: denoising rounds weak edges
    Clipped pixels are left out: an edge of a lamp looks sharper than it is.
    """
    height, width = plate.radiance.shape[:2]
    light = np.empty((height, width))

    def work(rows: slice) -> None:
        light[rows] = luminance(plate.radiance[rows].astype(np.float64))

    in_bands(height, width, work)
    if plate.clipped is not None:
        light[plate.clipped != 0] = np.nan
    for scale in SCALES:
        if (found := sharpness_of(clean_edges(light, scale))) is not None:
            return found
    return None


def sharpness_of(edges: Edges) -> Sharpness | None:
    """The point spread that the sharpest of these edges show; None of fewer than FEWEST.

    The pixel's own width is no part of it: rendered pixels are as wide.
    """
    count = len(edges.spread)
    if count < FEWEST:
        return None
    # How far the result would differ with other edges of the same kind: the bootstrap.
    again = edges.spread[np.random.default_rng(0).integers(0, count, (200, count))]
    error = float(np.std(np.quantile(again, SHARPEST, axis=1)))
    return Sharpness(float(np.quantile(edges.spread, SHARPEST)), error, count)


def _taps(sigma: float) -> np.ndarray:
    """Weights (2R + 1,), symmetric and of sum 1, that make of pixels what pixels behind that Gaussian would be.

    Pixels are samples of light that a box has already spread, so no sampled Gaussian will do below a pixel. These come
    nearest, by least squares, to the profile of an edge at every place between the pixels.
    """
    from scipy.optimize import nnls
    from scipy.special import ndtr

    reach = Sharpness(sigma).reach
    place = (np.arange(-16 * (reach + 1), 16 * (reach + 1)) + 0.5) / 16

    def ramp(x: np.ndarray) -> np.ndarray:
        return np.clip(x + 0.5, 0, 1)

    def integral(x: np.ndarray) -> np.ndarray:
        return x * ndtr(x / sigma) + sigma * np.exp(-0.5 * (x / sigma) ** 2) / np.sqrt(2 * np.pi)

    wanted = integral(place + 0.5) - integral(place - 0.5)
    either = [ramp(place - k) + ramp(place + k) for k in range(1, reach + 1)]
    # The middle weight is what the others leave of 1.
    columns = np.stack(either, axis=1) - 2 * ramp(place)[:, None]
    half, _ = nnls(columns, wanted - ramp(place))
    return np.concatenate([half[::-1], [1 - 2 * half.sum()], half])

"""Veiling glare: light that lens and camera body scatter from bright places over the whole picture, and its removal.

The model is a glare spread function (Talvala et al. 2007, "Veiling Glare in High Dynamic Range Imaging"; McCann &
Rizzi 2007): each point keeps most of its light and loses a share, part of it evenly over the picture (the veil), part
in a halo about itself. All the scattered light lands in the picture; light that comes in from outside is not known.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from relume.errors import warn
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap

if TYPE_CHECKING:
    from scipy.sparse import csr_array

MOST = 0.4
"""Largest share that can be taken out: from a half on, what is scattered outweighs the picture."""
ROUNDS = 60
PRECISION = 1e-9
"""Of the brightest pixel's light at which the iteration ends: well below the darkest of seven orders of magnitude."""
CELLS = 6.0
"""Cells that the halo's core radius spans at least; cubic interpolation then follows it within two thousandths."""
MARGIN = 2
"""Cells round the picture that interpolation at its edges reaches."""
BOUND = 5.0
"""Standard deviations below 0 from which a pixel says that more was taken than was there; noise alone reaches it once
in three million values."""


@dataclass(frozen=True)
class Glare:
    """A glare spread function: shares of a point's light, and how its halo falls.

    veil : share spread evenly over the picture
    halo : share spread as (r² + core²)^(−power), r the distance from the point
    core : radius as a share of the picture's diagonal, within which the halo is flat
    power : half the exponent of the falloff; 1 falls as r⁻², what dust and coatings scatter; larger is narrower
    deviation : relative standard deviation of the shares, for the variance of what is left
    """

    veil: float = 0.0
    halo: float = 0.0
    core: float = 0.005
    power: float = 1.0
    deviation: float = 0.0

    def __post_init__(self) -> None:
        if not (self.veil >= 0 and self.halo >= 0 and self.share <= MOST):
            raise ValueError(
                f"veil is {self.veil}, halo {self.halo}; expected shares not below 0 and together at most {MOST}"
            )
        if not (np.isfinite(self.core) and self.core > 0 and np.isfinite(self.power) and self.power > 0):
            raise ValueError(f"core is {self.core}, power {self.power}; expected positive numbers")
        if not (np.isfinite(self.deviation) and self.deviation >= 0):
            raise ValueError(f"deviation is {self.deviation}; expected a finite number not below 0")

    @property
    def share(self) -> float:
        """The share of a point's light that does not reach its place."""
        return self.veil + self.halo

    def scaled(self, share: float, deviation: float = 0.0) -> Glare:
        """The same shape of glare with another share in all.

        share : of the light that is scattered, in all
        deviation : relative standard deviation of that share
        """
        part = share / self.share
        return replace(self, veil=self.veil * part, halo=self.halo * part, deviation=deviation)


@dataclass(frozen=True, eq=False)
class Diminished:
    """A radiance map whose glare was taken out.

    picture : the map
    scattered : (H, W, 3) float32, what was taken from each pixel, in the map's unit
    bounded : (H, W) bool, where more glare was reckoned than light was seen, beyond its noise: there the picture is 0
    """

    picture: RadianceMap
    scattered: np.ndarray
    bounded: np.ndarray


def scatter(radiance: np.ndarray, glare: Glare) -> np.ndarray:
    """The light (H, W, C) float64 that lands elsewhere than it should, of light (H, W, C) without glare.

    It holds `glare.share` of all the light.
    """
    spread = _Spread.of(radiance.shape, glare)
    return np.stack([spread(radiance[..., c].astype(np.float64)) for c in range(radiance.shape[2])], axis=-1)


def without_glare(radiance: np.ndarray, glare: Glare, *, outside: np.ndarray | None = None) -> np.ndarray:
    """Solve O = (1 − share) L + scatter(L) for the light L (H, W, C) float64, of observed O (H, W, C).

    outside : (H, W) bool, pixels that are no part of the picture and keep their value

    L = (O − scatter(L)) / (1 − share) is iterated from O itself: each round's error is at most share / (1 − share) of
    the last. L may fall below 0.
    """
    spread = _Spread.of(radiance.shape, glare)
    channels = (radiance[..., c].astype(np.float64) for c in range(radiance.shape[2]))
    return np.stack([_solved(channel, spread, glare, outside) for channel in channels], axis=-1)


def _solved(observed: np.ndarray, spread: _Spread, glare: Glare, outside: np.ndarray | None) -> np.ndarray:
    light = observed
    for _ in range(ROUNDS):
        before = light
        light = spread(light)
        np.subtract(observed, light, out=light)
        light /= 1 - glare.share
        if outside is not None:
            light[outside] = observed[outside]
        if np.abs(light - before).max() <= PRECISION * np.abs(light).max():
            break
    return light


def diminish_glare(picture: RadianceMap, glare: Glare) -> Diminished:
    """Put the scattered light back where it came from.

    picture : a radiance map
    glare : of its lens, at its aperture

    The variance grows by (1 − share)⁻² and by what is not known of the shares, so dark places near bright ones become
    relatively noisy: they were. No pixel falls below 0; where one would by more than its noise, it is marked.
    Unmeasured pixels keep their marks and bounds. A glare without shares leaves the map as it is.
    Warns where pixels are bounded, and where saturated ones scatter: what they scatter is a lower bound too.
    """
    height, width = picture.radiance.shape[:2]
    bounded = np.zeros((height, width), bool)
    if glare.share == 0:
        return Diminished(picture, np.zeros_like(picture.radiance), bounded)
    kept = 1 - glare.share
    outside = None if picture.clipped is None else picture.clipped == OUTSIDE
    spread = _Spread.of(picture.radiance.shape, glare)
    radiance, scattered = np.empty_like(picture.radiance), np.empty_like(picture.radiance)
    variance = None if picture.variance is None else np.empty((height, width, 3), np.float32)
    for channel in range(3):
        observed = picture.radiance[..., channel].astype(np.float64)
        light = _solved(observed, spread, glare, outside)
        lost = observed - kept * light
        # With the share s, dL/ds = (L − scatter(L)/s) / (1 − s) at first order: a place's own light against its glare.
        doubt = np.abs(glare.share * light - lost) * glare.deviation / kept
        if outside is not None:
            lost[outside] = doubt[outside] = 0.0
        square = doubt**2
        if picture.variance is not None and variance is not None:
            square += picture.variance[..., channel] / kept**2
            variance[..., channel] = square
        # No pixel is known better than float32 holds it.
        bounded |= light < -BOUND * np.sqrt(square) - 1e-6 * observed
        radiance[..., channel] = np.maximum(light, 0.0)
        scattered[..., channel] = lost
    if picture.clipped is not None:
        # A black pixel's value is an upper bound; that it goes to 0 says nothing against the glare.
        bounded &= picture.clipped != BLACK
    _report(picture, bounded)
    return Diminished(replace(picture, radiance=radiance, variance=variance), scattered, bounded)


def _report(picture: RadianceMap, bounded: np.ndarray) -> None:
    if bounded.any():
        warn(
            f"in {100 * bounded.mean():.2g} % of the picture more glare was reckoned than light was seen; they are "
            "black now; give a place that is really black (--glare), or a smaller share (in Python, Glare)",
            float(bounded.mean()),
        )
    if picture.clipped is not None and (picture.clipped == SATURATED).any():
        warn(
            f"{int((picture.clipped == SATURATED).sum())} pixels are saturated in every photograph: they scatter more "
            "than is known, so glare is left about them; add shorter exposures"
        )


@dataclass(frozen=True, eq=False)
class _Spread:
    """What scatters the light of a picture of one size: S = F K Fᵀ for the halo, beside the even veil.

    K convolves on a grid of square cells that may be coarser than the pixels; F interpolates from it, and Fᵀ shares a
    pixel's light out to the cells round it so that no light moves. S is symmetric: light divided by `landing` = S 1
    before it is spread loses nothing.

    cells : (rows, columns) of the grid
    down, across : F along columns and rows
    transform : of the kernel, on a grid so large that what leaves at one edge does not come in at the other
    landing : (H, W)
    """

    glare: Glare
    cells: tuple[int, int]
    down: csr_array
    across: csr_array
    transform: np.ndarray
    landing: np.ndarray

    @staticmethod
    def of(shape: tuple[int, ...], glare: Glare) -> _Spread:
        from scipy import fft

        height, width = shape[:2]
        core = glare.core * float(np.hypot(width, height))
        edge = max(1, int(core / CELLS))
        cells = -(-height // edge) + 2 * MARGIN, -(-width // edge) + 2 * MARGIN
        down, across = _finer(height, edge, cells[0]), _finer(width, edge, cells[1])
        if glare.halo == 0:
            return _Spread(glare, cells, down, across, np.zeros(0), np.zeros(0))
        full = _full(cells)
        # Offsets between cells, in pixels, in the order of the transform: 0, 1, …, −2, −1.
        rows, columns = edge * np.fft.fftfreq(full[0], 1 / full[0]), edge * np.fft.fftfreq(full[1], 1 / full[1])
        kernel = (columns**2 + rows[:, None] ** 2 + core**2) ** -glare.power
        spread = _Spread(glare, cells, down, across, np.asarray(fft.rfft2(kernel)), np.zeros(0))
        return replace(spread, landing=spread._halo(np.ones((height, width))))

    def __call__(self, light: np.ndarray) -> np.ndarray:
        """The light (H, W) float64 that lands, of light (H, W); it sums to `glare.share` of all the light."""
        veil = self.glare.veil * light.mean()
        if self.glare.halo == 0:
            return np.full(light.shape, veil)
        return self.glare.halo * self._halo(light / self.landing) + veil

    def _halo(self, light: np.ndarray) -> np.ndarray:
        from scipy import fft

        cells = (self.across.T @ (self.down.T @ light).T).T
        full = _full(self.cells)
        landed = np.asarray(fft.irfft2(np.asarray(fft.rfft2(cells, full)) * self.transform, full))
        return (self.across @ (self.down @ landed[: self.cells[0], : self.cells[1]]).T).T


def _full(cells: tuple[int, int]) -> tuple[int, int]:
    """The size of the transform: all offsets between cells, each way."""
    from scipy import fft

    rows, columns = (int(fft.next_fast_len(2 * n, real=True) or 0) for n in cells)
    return rows, columns


def _finer(pixels: int, edge: int, cells: int) -> csr_array:
    """The matrix (pixels, cells) that interpolates pixels from cells of `edge` pixels by Catmull and Rom's cubic.

    A cell's value belongs to its centre. The cubic is exact for parabolas, so its transpose keeps the middle and the
    width of what it shares out.
    """
    from scipy.sparse import csr_array

    place = (np.arange(pixels) + 0.5) / edge - 0.5 + MARGIN
    cell = np.floor(place).astype(np.intp)
    t = place - cell
    weights = np.stack(
        [
            t * (-0.5 + t * (1 - 0.5 * t)),
            1 + t * t * (-2.5 + 1.5 * t),
            t * (0.5 + t * (2 - 1.5 * t)),
            t * t * (-0.5 + 0.5 * t),
        ],
        axis=1,
    )
    columns = cell[:, None] + np.arange(-1, 3)
    rows = np.repeat(np.arange(pixels), 4)
    return csr_array((weights.ravel(), (rows, columns.ravel())), shape=(pixels, cells))

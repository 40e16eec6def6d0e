"""How much a lens scatters, from a place known to be black or from a lamp in a dark room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.capture.lens.glare import BOUND, MOST, Glare, scatter, without_glare
from relume.capture.lens.vignetting import robust_deviation
from relume.capture.scale.regions import measured_patch
from relume.errors import NotABracket
from relume.image.colour import LUMINANCE_WEIGHTS, luminance
from relume.image.radiance import BLACK, OUTSIDE, RadianceMap

LARGEST = 400
"""Cells along the longer side of the picture in which a bound is sought: glare is smooth, and means are less noisy."""
RINGS = 40
NEAREST = 3.0
"""Lamp radii from its middle at which the halo is first read; nearer, the lamp's own size bends the profile."""
MODEL = 0.02
"""Relative deviation of a ring from the model: ghosts and dirt make no circle."""


def recover_glare_from_dark(
    picture: RadianceMap, region: np.ndarray, *, black: float = 0.0, shape: Glare = Glare(veil=0.01)
) -> Glare:
    """The share that makes a place known to be black come out so.

    picture : of any scene with something bright and a light trap, or a black card, in it
    region : (H, W) bool, the black place's pixels
    black : the luminance it truly has, in the map's unit. 0 for a light trap, a hole in a box lined with velvet; for a
        black card, the white card's radiance times the ratio of their reflectances
    shape : of the glare, whose share in all is sought; an even veil unless given, since one place shows no shape
    Raises ValueError for a region that is clipped, NotABracket when it is too bright to be black.
    """
    _require_share(shape)
    patch = measured_patch(picture, region)
    beyond = patch.luminance - black
    noise = patch.uncertainty * patch.luminance
    share, apart = 0.0, np.zeros(3)
    outside = None if picture.clipped is None else picture.clipped == OUTSIDE
    # O = (1 − s) B + s U(L) in the black place, U the scatter of a share of 1; L depends on s a little.
    for _ in range(12 if beyond > 0 else 0):
        light = without_glare(picture.radiance, shape.scaled(share), outside=outside)
        landed = (scatter(light, shape) / shape.share)[region].mean(0)
        before, share = share, beyond / (float(luminance(landed)) - black)
        apart = (patch.radiance - black) / (landed - black)
        if not 0 <= share <= MOST:
            raise NotABracket(
                f"the place said to be black holds {patch.luminance:.3g} where all light spread evenly would be "
                f"{float(luminance(landed)):.3g}; it is not black, so choose a darker one"
            )
        if abs(share - before) < 1e-6 * share:
            break
    if share == 0:
        return shape.scaled(0.0)
    # The channels' own shares show how well one share describes the glare.
    return shape.scaled(share, float(np.hypot(noise / beyond, apart.std() / share)))


def recover_glare_from_lamp(picture: RadianceMap, lamp: np.ndarray) -> Glare:
    """Veil and halo from the light about a small bright lamp in a dark room.

    picture : nothing but the lamp may shine; what it lights is counted as glare
    lamp : (H, W) bool, the lamp's pixels; it should be small, since the halo is read from three of its radii on

    Rings' medians of luminance about the lamp's middle are fitted with all four numbers of `Glare`.
    Raises ValueError for a lamp that is clipped, NotABracket when too little of the picture lies about it.
    """
    from scipy.optimize import least_squares

    patch = measured_patch(picture, lamp)
    rings = _rings(picture, lamp)
    best = None
    for power in (0.7, 1.0, 1.5):
        start = [1e-3, 1e-2, float(np.log(rings.nearest)), power]
        lower = [0.0, 0.0, float(np.log(rings.nearest / 2)), 0.5]
        upper = [MOST, MOST, float(np.log(rings.diagonal / 2)), 3.0]
        fit = least_squares(rings.misfit, start, bounds=(lower, upper), x_scale=[1e-2, 1e-2, 1, 1])
        if best is None or fit.cost < best.cost:
            best = fit
    assert best is not None
    veil, halo, logarithm, power = (float(v) for v in best.x)
    # A halo of a thousandth of the veil is what the fit could not bring to 0.
    halo = halo if halo > 1e-3 * veil else 0.0
    share = veil + halo
    if share > MOST:
        raise NotABracket(f"{100 * share:.0f} % of the lamp's light lies about it; the room is lit, so darken it")
    covariance = np.linalg.pinv(best.jac.T @ best.jac) * max(2 * best.cost / max(len(best.fun) - 4, 1), 1.0)
    fitted = float(np.sqrt(covariance[:2, :2].sum())) / share if share > 0 else 0.0
    # The shares are shares of the lamp's light, whose own noise counts.
    flux = float(np.linalg.norm(LUMINANCE_WEIGHTS * patch.deviation)) / patch.luminance
    return Glare(veil, halo, float(np.exp(logarithm)) / rings.diagonal, power, float(np.hypot(fitted, flux)))


def largest_glare(picture: RadianceMap, *, shape: Glare = Glare(veil=0.01)) -> Glare:
    """The largest share that no place of the picture contradicts: a bound, not a measurement.

    picture : of any scene; the darker its darkest places, the closer the bound
    shape : of the glare, whose share in all is sought

    A share is contradicted where it would take more light than was seen, by more than five standard deviations.
    """
    _require_share(shape)
    seen = _reduced(picture)
    if not _contradicts(seen, shape.scaled(MOST)):
        return shape.scaled(MOST)
    low, high = 0.0, MOST
    # Fifteen halvings leave a hundred-thousandth.
    for _ in range(15):
        share = (low + high) / 2
        low, high = (low, share) if _contradicts(seen, shape.scaled(share)) else (share, high)
    return shape.scaled(low)


def _require_share(shape: Glare) -> None:
    if shape.share == 0:
        raise ValueError("the shape scatters nothing; give one with a veil or a halo")


def _contradicts(seen: RadianceMap, glare: Glare) -> bool:
    assert seen.variance is not None and seen.clipped is not None  # as _reduced left it
    light = without_glare(seen.radiance, glare, outside=seen.clipped == OUTSIDE) * (1 - glare.share)
    below = light < -BOUND * np.sqrt(seen.variance) - 1e-6 * seen.radiance
    return bool(below[seen.clipped == 0].any())


def _reduced(picture: RadianceMap) -> RadianceMap:
    """The picture in cells of at most LARGEST to a side, with less noise; a cell is measured if all its pixels are."""
    edge = -(-max(picture.size) // LARGEST)
    rows, columns = (n // edge for n in picture.radiance.shape[:2])
    clipped = np.zeros(picture.radiance.shape[:2], np.uint8) if picture.clipped is None else picture.clipped
    variance = np.zeros_like(picture.radiance) if picture.variance is None else picture.variance
    cells = [
        array[: rows * edge, : columns * edge].reshape(rows, edge, columns, edge, -1)
        for array in (picture.radiance, np.where(clipped[..., None] == 0, variance, 0), clipped)
    ]
    radiance, spread = cells[0].mean((1, 3)), cells[1].mean((1, 3)) / edge**2
    marks = cells[2].max((1, 3))[..., 0]
    # A cell that is outside only in part still holds light.
    marks[(marks == OUTSIDE) & (radiance.max(-1) > 0)] = BLACK
    return RadianceMap(radiance.astype(np.float32), spread.astype(np.float32), marks)


@dataclass(frozen=True, eq=False)
class _Rings:
    """Rings about a lamp.

    radius, light, error : (N,) of each ring, in pixels and the map's unit; `error` of its median
    total : luminance summed over the picture
    distances, counts : how many pixels lie how far from the lamp, for sums over the picture
    nearest, diagonal : pixels
    """

    radius: np.ndarray
    light: np.ndarray
    error: np.ndarray
    total: float
    distances: np.ndarray
    counts: np.ndarray
    nearest: float
    diagonal: float

    def misfit(self, unknown: np.ndarray) -> np.ndarray:
        veil, halo, logarithm, power = unknown
        square = np.exp(2 * logarithm)
        landing = float(self.counts @ (self.distances**2 + square) ** -power)
        spread = veil / self.counts.sum() + halo * (self.radius**2 + square) ** -power / landing
        return (self.total * spread - self.light) / self.error


def _rings(picture: RadianceMap, lamp: np.ndarray) -> _Rings:
    light = luminance(picture.radiance.astype(np.float64))
    width, height = picture.size
    y, x = np.nonzero(lamp)
    weight = light[lamp] / light[lamp].sum()
    distance = np.hypot(np.arange(width) - weight @ x, np.arange(height)[:, None] - weight @ y)
    nearest = NEAREST * max(float(distance[lamp].max()), 1.0)
    edges = np.geomspace(nearest, distance.max(), RINGS + 1)
    measured = distance >= nearest
    if picture.clipped is not None:
        measured &= picture.clipped == 0
    ring = np.digitize(distance[measured], edges) - 1
    radii, values = distance[measured], light[measured]
    rows = []
    for index in range(RINGS):
        inside = values[ring == index]
        if len(inside) >= 8:
            # The error of a median is 1.25 times that of a mean.
            error = 1.25 * robust_deviation(inside) / np.sqrt(len(inside))
            rows.append((radii[ring == index].mean(), np.median(inside), error))
    if len(rows) < RINGS / 4 or distance.max() < 4 * nearest:
        raise NotABracket(
            "too little of the picture lies about the lamp; photograph it smaller, or mark only the lamp itself"
        )
    radius, middle, error = np.array(rows).T
    counts = np.bincount(np.rint(2 * distance).astype(np.intp).ravel())
    return _Rings(
        radius,
        middle,
        np.hypot(error, MODEL * middle) + 1e-30,
        float(light.sum()),
        np.arange(len(counts)) / 2,
        counts.astype(np.float64),
        nearest,
        float(np.hypot(width, height)),
    )

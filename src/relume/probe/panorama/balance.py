"""Exposure and vignetting of a panorama's views, balanced where they overlap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.capture.lens.vignetting import Vignetting
from relume.capture.lens.vignetting import corrected as without_vignetting
from relume.probe.panorama.coverage import Coverage, coverage
from relume.probe.panorama.views import PanoramaView
from relume.sphere.mappings.mapping import LatLong, pixel_points

ROWS = 128
"""Of the map on which views are compared: cells of 1.4° are the same in both, however well they lie on one another."""
TOUCHING = 1e-3
"""Share of the sphere that two views or more must see for overlaps to count; below it views only touch, as six faces of
a cube do, and their rims are compared."""
RIM = 0.02
"""Share of its shorter side that a picture is continued by then."""
SURE = 3.0
"""Standard errors by which a gain between rims has to differ to be believed."""
SCENERY = 0.003
"""Least standard error of ln of such a gain, for scenery finer than a cell bends at the rim; three of them, 1 %, are a
third of what an eye sees as a step."""
PRIOR_COEFFICIENT = 0.5
"""Standard deviation of the vignetting's coefficients about none."""
CORRELATED = 4.0
"""Cells that err as one: what moved or was misplaced covers several."""
ITERATIONS = 20
MOST = 30_000
"""Cells that are compared, evenly taken from all."""


@dataclass(frozen=True)
class Balancing:
    """What of the views is balanced.

    terms : coefficients of the vignetting, of r², r⁴, …; 0 for a lens that has none, or is corrected
    colours : whether each channel has its own gain, for cameras that choose their white anew for each view
    """

    terms: int = 3
    colours: bool = False


@dataclass(frozen=True, eq=False)
class Balanced:
    """Views on one scale.

    views : the pictures times their gains, without their vignetting
    gains : (views, 3), that the pictures were multiplied by; their geometric mean is 1, but where views only touch the
        views that agree keep 1
    vignetting : of all views
    overlap : share of the sphere that two views or more measure
    disagreement : median of the absolute difference of ln luminance where views overlap, after balancing
    remarks : what was done that the caller should know, a line each
    """

    views: tuple[PanoramaView, ...]
    gains: np.ndarray
    vignetting: Vignetting
    overlap: float
    disagreement: float
    remarks: tuple[str, ...] = ()

    @property
    def touching(self) -> bool:
        """Whether views only touch, so that no more than their rims could be compared."""
        return self.overlap < TOUCHING

    @property
    def unchanged(self) -> bool:
        """Whether the pictures are as they were."""
        return bool(np.all(self.gains == 1)) and not self.vignetting.coefficients


def balance(views: Sequence[PanoramaView], method: Balancing = Balancing()) -> Balanced:
    """Find the gains and the vignetting that make views alike where they overlap, and apply them.

    ln L differs between two views of one direction by their gains and by the falloff at the two places in the pictures;
    least squares with Cauchy's weights, for what moved between the views is no falloff. Where views only touch, their
    rims show neighbouring things, not the same: all gains stay 1 unless one is sure, by SURE standard errors.
    """
    overlap, differences = _compared(views)
    if differences is None:
        return Balanced(tuple(views), np.ones((len(views), 3)), Vignetting(), overlap, 0.0)
    touching = overlap < TOUCHING
    terms = 0 if touching else method.terms
    grey, coefficients, left, errors = _solved(differences, differences.logarithm.mean(1), len(views), terms)
    logarithms = np.repeat(grey[:, None], 3, axis=1)
    if method.colours:
        falloff = differences.falloff(coefficients)
        for channel in range(3):
            alone = differences.logarithm[:, channel] - falloff
            logarithms[:, channel] = _solved(differences, alone, len(views), 0)[0]
    remarks: tuple[str, ...] = ()
    if touching:
        errors = np.maximum(np.maximum(errors, _closure_errors(differences, grey)), SCENERY)
        logarithms = np.stack([_sure(channel, errors) for channel in logarithms.T], axis=-1)
        moved = [view.name for view, row in zip(views, logarithms, strict=True) if np.any(row != 0)]
        if moved:
            remarks = (
                f"views only touch; their rims show other gains for {', '.join(moved)}, known to "
                f"{100 * np.median(errors):.1f} %",
            )
    gains = np.exp(-logarithms)
    vignetting = Vignetting(tuple(float(a) for a in coefficients))
    applied = []
    for view, gain in zip(views, gains, strict=True):
        picture = without_vignetting(view.picture, vignetting) if len(coefficients) else view.picture
        picture = replace(picture, radiance=(picture.radiance * gain).astype(np.float32), variance=None)
        applied.append(replace(view, picture=picture))
    return Balanced(tuple(applied), gains, vignetting, overlap, left, remarks)


def compare(views: Sequence[PanoramaView]) -> Balanced:
    """The views as they are, with what they overlap and differ by: for pictures that are on one scale already."""
    overlap, differences = _compared(views)
    left = 0.0 if differences is None else float(np.median(np.abs(differences.logarithm.mean(1))))
    return Balanced(tuple(views), np.ones((len(views), 3)), Vignetting(), overlap, left)


def _compared(views: Sequence[PanoramaView]) -> tuple[float, _Differences | None]:
    """Share of the sphere that two views or more measure, and what they differ by there, or else at their rims."""
    seen = coverage(views, ROWS)
    angles = LatLong().solid_angles(ROWS)
    overlap = float(angles[seen.measured.sum(0) > 1].sum() / (4 * np.pi))
    if overlap < TOUCHING:
        seen = coverage(views, ROWS, RIM)
    return overlap, _differences(views, seen, angles)


def _closure_errors(differences: _Differences, grey: np.ndarray) -> np.ndarray:
    """Standard errors (views,) of ln gains by what rims contradict each other: no gains explain that, but scenery does.

    Six faces have twelve edges for five ratios. 0 where there are no more edges than ratios.
    """
    pairs = differences.first * len(grey) + differences.second
    misfit = differences.logarithm.mean(1) - (grey[differences.first] - grey[differences.second])
    edges = np.unique(pairs)
    design = np.zeros((len(edges), len(grey)))
    design[np.arange(len(edges)), edges // len(grey)] = 1
    design[np.arange(len(edges)), edges % len(grey)] = -1
    more = len(edges) - int(np.linalg.matrix_rank(design))
    if more < 1:
        return np.zeros(len(grey))
    square = sum(float(np.median(misfit[pairs == edge])) ** 2 for edge in edges) / more
    return np.sqrt(square * np.diag(np.linalg.pinv(design.T @ design)))


def _sure(logarithms: np.ndarray, errors: np.ndarray) -> np.ndarray:
    """ln gains (views,) that are believed, 0 for the others.

    Only ratios of gains are known, so they count from the views that agree. Where none is sure the exposure was held,
    and all stay; where one is, it was not, and what lies beyond its own error is the best guess of each.
    """
    bound = SURE * errors
    agreeing = np.abs(logarithms[:, None] - logarithms) <= np.maximum(bound[:, None], bound)
    about = logarithms - logarithms[agreeing[agreeing.sum(1).argmax()]].mean()
    if np.all(np.abs(about) <= bound):
        return np.zeros(len(logarithms))
    return np.where(np.abs(about) <= errors, 0.0, about)


@dataclass(frozen=True, eq=False)
class _Differences:
    """Cells that two views see: which views, ln L of the first less that of the second (N, 3), powers of both radii."""

    first: np.ndarray
    second: np.ndarray
    logarithm: np.ndarray
    weight: np.ndarray
    squares: np.ndarray

    def falloff(self, coefficients: np.ndarray) -> np.ndarray:
        """ln falloff of the first less that of the second."""
        if not len(coefficients):
            return np.zeros(len(self.first))
        powers = self.squares[..., None] ** np.arange(1, len(coefficients) + 1)
        logarithm = np.log(np.maximum(1 + powers @ coefficients, 1e-3))
        return logarithm[:, 0] - logarithm[:, 1]


def _differences(views: Sequence[PanoramaView], seen: Coverage, angles: np.ndarray) -> _Differences | None:
    directions = LatLong().directions(pixel_points(LatLong(), seen.rows))
    squares = []
    for view in views:
        size = np.array(view.picture.size)
        offset = view.points(directions) - size / 2
        squares.append(np.minimum((offset**2).sum(-1) * 4 / (size**2).sum(), 1.0))
    parts = []
    for second in range(1, len(views)):
        for first in range(second):
            both = seen.measured[first] & seen.measured[second]
            if not both.any():
                continue
            logarithm = seen.logarithm[first][both] - seen.logarithm[second][both]
            radii = np.stack([squares[first][both], squares[second][both]], axis=-1)
            ends = [np.full(len(logarithm), first), np.full(len(logarithm), second)]
            parts.append((*ends, logarithm, angles[both], radii))
    if not parts:
        return None
    together = [np.concatenate(group) for group in zip(*parts, strict=True)]
    chosen = np.linspace(0, len(together[0]) - 1, min(len(together[0]), MOST)).astype(int)
    first, second, logarithm, weight, radii = (group[chosen] for group in together)
    return _Differences(first, second, logarithm.astype(np.float64), weight / weight.mean() / CORRELATED, radii)


def _solved(
    differences: _Differences, logarithm: np.ndarray, count: int, terms: int
) -> tuple[np.ndarray, np.ndarray, float, np.ndarray]:
    """ln gain of each view's picture, their mean 0, the vignetting's coefficients, the median misfit left, and the
    standard errors of the gains."""
    rows = np.arange(len(logarithm))
    design = np.zeros((len(logarithm), count + terms))
    design[rows, differences.first] += 1
    design[rows, differences.second] -= 1
    unknown = np.zeros(count + terms)
    unknown[:count] = _of_medians(differences, logarithm, count)
    normal = np.eye(count + terms)
    powers = differences.squares[..., None] ** np.arange(1, terms + 1)
    for _ in range(ITERATIONS):
        coefficients = unknown[count:]
        falloff = 1 + powers @ coefficients if terms else np.ones((len(logarithm), 2))
        falloff = np.maximum(falloff, 0.05)
        if terms:
            slopes = powers / falloff[..., None]
            design[:, count:] = slopes[:, 0] - slopes[:, 1]
        misfit = logarithm - (unknown[differences.first] - unknown[differences.second])
        misfit = misfit - np.log(falloff[:, 0] / falloff[:, 1])
        scatter = max(1.4826 * float(np.median(np.abs(misfit))), 1e-4)
        weight = differences.weight / (1 + (misfit / (2 * scatter)) ** 2) / scatter**2
        normal = (design * weight[:, None]).T @ design
        # The mean of the gains is 0, and so is the vignetting where nothing shows it.
        normal[:count, :count] += 1.0
        normal[count:, count:] += np.eye(terms) / PRIOR_COEFFICIENT**2
        right = design.T @ (weight * misfit)
        right[:count] -= unknown[:count].sum()
        right[count:] -= coefficients / PRIOR_COEFFICIENT**2
        # A view that overlaps with none keeps its exposure.
        step = np.linalg.lstsq(normal, right, rcond=1e-12)[0]
        unknown = unknown + step
        if np.abs(step).max() < 1e-7:
            break
    misfit = logarithm - (unknown[differences.first] - unknown[differences.second])
    if terms:
        falloff = np.maximum(1 + powers @ unknown[count:], 0.05)
        misfit = misfit - np.log(falloff[:, 0] / falloff[:, 1])
    gains = unknown[:count] - unknown[:count].mean()
    variance = np.diag(np.linalg.pinv(normal, rcond=1e-12, hermitian=True))[:count]
    # The mean is fixed, not measured: what its row holds is no uncertainty of the differences.
    errors = np.sqrt(np.maximum(variance - 1 / count**2, 0))
    return gains, unknown[count:], float(np.median(np.abs(misfit))), errors


def _of_medians(differences: _Differences, logarithm: np.ndarray, count: int) -> np.ndarray:
    """A first guess of the gains: the median difference of every pair, reconciled."""
    normal, right = np.full((count, count), 1e-6), np.zeros(count)
    pairs = differences.first * count + differences.second
    for pair in np.unique(pairs):
        here = pairs == pair
        i, j = divmod(int(pair), count)
        weight, middle = float(differences.weight[here].sum()), float(np.median(logarithm[here]))
        normal[[i, j], [i, j]] += weight
        normal[[i, j], [j, i]] -= weight
        right[i] += weight * middle
        right[j] -= weight * middle
    return np.linalg.lstsq(normal, right, rcond=1e-12)[0]

"""The gloss of a real surface, from two views of it: the photograph's and the light probe's (Debevec 1998, §7, step 4).

Below the horizon a probe's map shows the surface that it stood on, from the probe's place. A matte surface looks alike
from there and from the camera, whatever its pattern, so what differs is gloss: the albedo drops out. The reflectance
along the normal F₀ and the roughness that explain the difference are found by descent (Levenberg and Marquardt) on
sums of Mitsuba's own BSDF over fixed directions, and their errors from how far the differences scatter about them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from relume.composite.surface.two_views import Shared, ViewOfProbe, common_points, plate_points
from relume.image.radiance import RadianceMap
from relume.renderers.mitsuba.lobes import Arriving, Ready, arriving, ready
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Colour, Material
from relume.scene.scene import Scene

LOW, HIGH = np.array([0.0, 0.05]), np.array([0.3, 1.0])
"""Of F₀ and roughness: F₀ 0.3 is past every dielectric (diamond has 0.17); smoother than 0.05 is a mirror."""
USUAL, USUALLY = np.array([0.04, 0.5]), np.array([0.02, 0.3])
"""What F₀ and roughness are where nothing is measured, and how far off: most painted, wooden and plastic surfaces have
an index of refraction between 1.33 and 1.65, and any roughness."""
ANY = np.array([np.inf, np.inf])
"""How far off they may be where two views measure them."""
FEWEST = 60
"""Points that both views must share."""
DISAGREE = 0.3
"""Scatter, as a share of the radiance, from which on the two views do not show the same surface."""
PATTERN, LIGHT = 0.1, 0.03
"""Expected errors, as shares of what the photograph and of what the probe shows: patterns do not lie on one another to
the pixel, and two photographs of one light differ by a few per cent. They set the weights of dark and bright places."""
MIRRORED = tuple((0.04, r) for r in (0.12, 0.25, 0.45))
"""F₀ and roughness by which what a surface mirrors is foreseen, to be doubted: a lamp nearer than the distant scene is
mirrored elsewhere than the model has it. Believed, the softboxes of a product table made its F₀ 0.01."""
OUTLIER = 2.0
"""Expected errors from which on a difference counts for less: a thing on the table, its reflection or its shadow."""
STARTS = tuple(np.array([f0, r]) for f0 in (0.02, 0.06) for r in (0.12, 0.25, 0.45, 0.75))
"""The descent begins at the best of these: a highlight that is much too narrow knows no way down."""
DRAWS = 3
"""Sets of directions that the gloss is found with, each by itself; their scatter is part of the error."""
STEP = np.array([1e-3, 5e-3])
"""Differences for derivatives: a fortieth of the usual F₀, a hundredth of the roughness."""
KEPT = 16
"""Glosses whose light is kept: the starts, or a place, the four round it and the steps that failed from there."""


@dataclass(frozen=True)
class Gloss:
    """The dielectric gloss of a surface, over its diffuse base (glTF's model).

    f0 : reflectance along the normal; 0.04 is glass, paint, wood and most plastic
    roughness : perceptual; the microfacet width is α = roughness²
    """

    f0: float = 0.04
    roughness: float = 0.5

    def __post_init__(self) -> None:
        if not 0 <= self.f0 <= 1 or not 0 <= self.roughness <= 1:
            raise ValueError(f"F₀ {self.f0} and roughness {self.roughness}; expected 0 to 1")


@dataclass(frozen=True)
class FittedGloss:
    """A gloss that was measured.

    f0_error, roughness_error : one standard deviation each, from the scatter of the measurements, from a light that is
        off as a whole, and from what such surfaces usually are
    points : places that were compared
    scatter : median deviation of the model from them (1.48 × median absolute), as a share of the radiance
    views : 2 where the probe and the photograph were compared, 1 where only the photograph could be used
    notes : doubts, a line each
    """

    gloss: Gloss
    f0_error: float
    roughness_error: float
    points: int
    scatter: float
    views: int
    notes: tuple[str, ...] = ()


def glossy(reflectance: Colour | np.ndarray, gloss: Gloss) -> Material:
    """The material of a diffuse base under a gloss; at grazing angles all of it reflects, as of every dielectric."""
    share = gloss.f0 / 0.04  # an ior of 1.5 has F₀ = 0.04
    return Material(reflectance, roughness=gloss.roughness, specular_color=(share, share, share))


def fit_gloss(
    plate: RadianceMap,
    camera: Camera,
    scene: Scene,
    index: int,
    usable: np.ndarray,
    probe: ViewOfProbe | None,
    *,
    seed: int = 0,
) -> FittedGloss:
    """Find the gloss of the scene's local surface number `index`.

    usable : (H, W) bool, the pixels of the plate that show it and were measured
    probe : None for a light that does not show the surface; then the photograph alone says what it can, and the usual
        values with their spread stand in for the rest
    """
    notes, light = [], ready(scene)
    if probe is not None:
        shared = common_points(plate, camera, scene, index, usable, probe)
        if len(shared.points) >= FEWEST:
            draws = [_from_two(shared, camera, light, seed, STARTS)]
            near = (np.array([draws[0][0].gloss.f0, draws[0][0].gloss.roughness]),)
            draws += [_from_two(shared, camera, light, seed + draw, near) for draw in range(1, DRAWS)]
            found = _with_usual(draws)
            if found.scatter <= DISAGREE:
                return found
            notes.append(
                f"the probe and the photograph differ by {found.scatter:.0%} about the surface whatever its gloss; "
                "the photograph alone was used, and the gloss is uncertain"
            )
        else:
            notes.append(
                f"the probe and the photograph share only {len(shared.points)} places of the surface; "
                "the photograph alone was used, and the gloss is uncertain"
            )
    else:
        notes.append("the light does not show the surface itself; the photograph alone was used for its gloss")
    return _from_one(plate_points(plate, camera, scene, index, usable), camera, light, seed, tuple(notes))


def _with_usual(draws: list[tuple[FittedGloss, np.ndarray]]) -> FittedGloss:
    """The mean of several draws of directions, and what surfaces usually are, each by the weight of its errors.

    Two views of a table of little gloss differ by a few per cent, as two photographs of one light do: what they say is
    then worth no more than what is known of paint, wood and plastic beforehand (the product of two normal densities).
    """
    found = [fit for fit, _ in draws]
    values = np.array([[each.gloss.f0, each.gloss.roughness] for each in found])
    measured, covariance = values.mean(0), np.mean([each for _, each in draws], axis=0) + np.cov(values.T)
    usual = np.diag(USUALLY**2)
    gain = usual @ np.linalg.inv(usual + covariance)
    mean = np.clip(USUAL + gain @ (measured - USUAL), LOW, HIGH)
    error = np.sqrt(np.diag(usual - gain @ usual))
    notes = tuple(dict.fromkeys(note for each in found for note in each.notes))
    return replace(
        found[0], gloss=Gloss(*map(float, mean)), f0_error=float(error[0]), roughness_error=float(error[1]), notes=notes
    )


def _from_two(
    shared: Shared, camera: Camera, light: Ready, seed: int, starts: tuple[np.ndarray, ...]
) -> tuple[FittedGloss, np.ndarray]:  # fmt: skip
    to_camera = arriving(light, shared.points, shared.normals, camera.eyes_towards(shared.points), seed=seed)
    to_probe = arriving(light, shared.points, shared.normals, shared.seen_from, seed=seed)
    # Of groups, because weights that follow a place's own errors favour the places that err low.
    plate_error = PATTERN * _of_groups(shared.plate, shared.cells)
    at_camera, at_probe = _splits(to_camera), _splits(to_probe)
    # What the surface mirrors lies where the shape of the distant scene puts it, or it does not: half of it, ± a half.
    mirrored = np.mean([at_probe(*each)[0] for each in MIRRORED], axis=0)
    probe_error = np.hypot(LIGHT * _of_groups(shared.probe, shared.cells), mirrored / 2)

    def residuals(theta: np.ndarray, gain: float = 1.0) -> np.ndarray:
        gloss, base = at_camera(*map(float, theta))
        gloss_there, base_there = at_probe(*map(float, theta))
        ratio = base_there / np.maximum(base, 1e-30)
        predicted = gain * gloss_there + (shared.plate - gain * gloss) * ratio
        # The plate's error counts as it arrives in the prediction (total least squares): with any other weight the
        # descent would gain by shrinking the ratio, and F₀ come out low.
        return (gain * shared.probe - predicted) / np.hypot(plate_error * ratio, probe_error)

    scale = np.hypot(plate_error, probe_error)
    share = scale / (0.5 * (shared.plate + shared.probe))
    return _fitted(residuals, shared.cells, share, 2, ANY, (), starts)


def _of_groups(values: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(N, 3): each place's mean over its group."""
    sums = np.zeros((cells.max() + 1, 3))
    np.add.at(sums, cells, values)
    return (sums / np.bincount(cells)[:, None])[cells]


def _from_one(shared: Shared, camera: Camera, light: Ready, seed: int, notes: tuple[str, ...]) -> FittedGloss:
    to_camera = arriving(light, shared.points, shared.normals, camera.eyes_towards(shared.points), seed=seed)
    scale, at_camera = PATTERN * shared.plate, _splits(to_camera)

    def residuals(theta: np.ndarray, gain: float = 1.0) -> np.ndarray:
        gloss, base = at_camera(*map(float, theta))
        # An even albedo: what it leaves unexplained is pattern, and makes the errors as wide as it is strong.
        gloss = gain * gloss
        albedo = np.median((shared.plate - gloss) / np.maximum(base, 1e-30), axis=0)
        return (shared.plate - gloss - albedo * base) / scale

    return _fitted(residuals, shared.cells, np.full_like(scale, PATTERN), 1, USUALLY, notes, STARTS)[0]


def _splits(light: Arriving) -> Callable[[float, float], tuple[np.ndarray, np.ndarray]]:
    """The gloss, and the base per unit of albedo, that points send to a viewer, for F₀ and roughness.

    The last are kept: a descent asks again for the place it has come to, and for all round it where a step failed.
    """

    @lru_cache(KEPT)
    def split(f0: float, roughness: float) -> tuple[np.ndarray, np.ndarray]:
        return light.gloss_and_base(glossy((1.0, 1.0, 1.0), Gloss(f0, roughness)))

    return split


def _fitted(
    residuals: Callable[..., np.ndarray],
    cells: np.ndarray,
    share: np.ndarray,
    views: int,
    spread: np.ndarray,
    notes: tuple[str, ...],
    starts: tuple[np.ndarray, ...],
) -> tuple[FittedGloss, np.ndarray]:
    """Robust least squares (Cauchy's weights) of F₀ and roughness; errors by groups of neighbouring points.

    spread : (2,) how far they usually lie off `USUAL`
    Returns the fit and the covariance (2, 2) of its errors.

    Neighbouring points err alike (a wrong albedo, a thing on the table), so the scatter is taken between cells and not
    between points (the sandwich of White and Huber, clustered).
    """
    # Descend from the best start (Levenberg and Marquardt).
    costs = [_cost(residuals(start), start, spread) for start in starts]
    theta, cost, damping = starts[int(np.argmin(costs))], min(costs), 1e-3
    for _ in range(25):
        *_, normal, gradient = _normal(residuals, theta, spread)
        step = np.linalg.solve(normal + damping * np.diag(np.diag(normal)), -gradient)
        tried = np.clip(theta + step, LOW, HIGH)
        new = _cost(residuals(tried), tried, spread)
        if new < cost:
            moved = np.abs(tried - theta)
            theta, cost, damping = tried, new, damping / 5
            if np.all(moved < 0.02 * STEP):
                break
        else:
            damping *= 10
            if damping > 1e6:
                break
    # The error, from the scatter between cells.
    value, slope, weight, normal, _ = _normal(residuals, theta, spread)
    scores = np.zeros((cells.max() + 1, 2))
    np.add.at(scores, cells, np.einsum("nc,nck,nc->nk", weight, slope, value))
    inverse = np.linalg.inv(normal)
    scattered = scores.T @ scores + np.diag((_scatter(value) / spread) ** 2)
    # A map that is too bright as a whole moves the gloss and what the probe shows alike, which no scatter shows.
    off = (residuals(theta, 1 + LIGHT) - residuals(theta, 1 - LIGHT)) / 2
    moved = inverse @ np.einsum("nc,nck,nc->k", weight, slope, off)
    covariance = inverse @ scattered @ inverse + np.outer(moved, moved)
    error = np.sqrt(np.diag(covariance))
    at_end = (theta <= LOW + 1e-6) | (theta >= HIGH - 1e-6)
    more = tuple(
        f"the {name} came out at the end of its range, {value:.2f}; look at the surface's model and the camera's pose"
        for name, value, ends in zip(("reflectance F₀", "roughness"), theta, at_end, strict=True)
        if ends
    )
    gloss = Gloss(float(theta[0]), float(theta[1]))
    scatter = _scatter(value * share)
    fit = FittedGloss(gloss, float(error[0]), float(error[1]), len(value), scatter, views, notes + more)
    return fit, covariance


def _scatter(value: np.ndarray) -> float:
    return max(1.4826 * float(np.median(np.abs(value))), 1e-3)


def _cost(value: np.ndarray, theta: np.ndarray, spread: np.ndarray) -> float:
    cost = 0.5 * OUTLIER**2 * float(np.log1p((value / OUTLIER) ** 2).sum())
    return cost + 0.5 * float((((theta - USUAL) / spread) ** 2).sum()) * _scatter(value) ** 2


def _normal(residuals: Callable[..., np.ndarray], theta: np.ndarray, spread: np.ndarray) -> tuple[np.ndarray, ...]:
    """Residuals, their slopes and weights, and the matrix and gradient of the normal equations."""
    value, slopes = residuals(theta), []
    for axis in range(2):
        step = np.eye(2)[axis] * STEP[axis]
        above, below = np.clip(theta + step, LOW, HIGH), np.clip(theta - step, LOW, HIGH)
        slopes.append((residuals(above) - residuals(below)) / (above - below)[axis])
    slope, weight = np.stack(slopes, axis=-1), 1 / (1 + (value / OUTLIER) ** 2)
    strength = (_scatter(value) / spread) ** 2
    matrix = np.einsum("nc,nck,ncl->kl", weight, slope, slope) + np.diag(strength)
    gradient = np.einsum("nc,nck,nc->k", weight, slope, value) + strength * (theta - USUAL)
    return value, slope, weight, matrix, gradient

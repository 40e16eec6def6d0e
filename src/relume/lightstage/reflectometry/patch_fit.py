"""Diffuse and specular reflection of a patch: separated by colour, and fitted with a few numbers.

The diffuse part is Lambertian in brightness, its chromaticity moves with the angles (Debevec et al. 2000, eq. 6, 7).
The specular part is that of facets whose normals lie about the patch's own with a Gaussian of their angle, with the
shadowing and masking of grooves and Fresnel's reflection (Torrance & Sparrow 1967; Debevec et al. 2000, eq. 8).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import optimize

from relume.lightstage.reflectometry.patch_samples import NORMAL, PatchSamples
from relume.lightstage.surface.chromaticity import (
    HIGHEST,
    LOWEST,
    amounts,
    fitted_ramp,
    median_chromaticity,
    ramp,
    ramped,
    unit_chromaticity,
)
from relume.lightstage.surface.torrance_sparrow import grooved_reflection, half_vector

MIRROR = 0.6
"""Radians between normal and half vector within which samples count less for the ramp: highlights."""
LEAST_ANGLE = 0.05
"""Radians between the body's and the light's chromaticity below which colour separates nothing."""
ROUGHNESSES = np.geomspace(0.05, 0.7, 7)
"""Radians from which the fit starts; the best of all stays, for a wrong lobe can be a local minimum."""
LEAST_SHARE = 1e-3
"""Of the errors' mean square, that is taken to be each channel's own: rounding, where a lamp's flicker is all."""
_ANGLES = np.linspace(0, np.pi / 2, 401)


@dataclass(frozen=True, eq=False)
class PatchReflectance:
    """A patch in numbers.

    albedo : (3,), of the diffuse part where light and view are along the normal
    ramp : α1 of its chromaticity at grazing angles, 0 along the normal: below 0 it is paler there
    specular : share of the surface that are facets, 1 where all is
    roughness : radians, at which the density of the facets' normals is 1/e of that of the patch's own
    deviation : of albedo, ramp, specular and roughness, (6,), by what the fit leaves over
    residual : root mean square of what is left over, as a share of the samples' own
    light : (3,), the lamp's chromaticity, unit
    """

    albedo: np.ndarray
    ramp: float
    specular: float
    roughness: float
    deviation: np.ndarray
    residual: float
    light: np.ndarray

    def diffuse_part(self, incidence: np.ndarray, viewing: np.ndarray) -> np.ndarray:
        """What the patch reflects from below its surface (…, 3), f cos θi.

        incidence, viewing : (…) radians from the normal, signed
        """
        return _diffuse(self.albedo, self.ramp, self.light, np.cos(incidence), np.cos(viewing))

    def specular_part(self, light: np.ndarray, view: np.ndarray) -> np.ndarray:
        """What the patch reflects at its surface (…, 3), f cos θi.

        light, view : (…, 3) unit directions towards the lamp and the camera; the normal is +Z
        """
        lobe = self.specular * _lobe(light, view, self.roughness)
        return lobe[..., None] * self.light * np.sqrt(3)

    def facts(self) -> dict[str, object]:
        """The numbers and their deviations, as a terminal shows them."""
        rounded = [float(f"{value:.4g}") for value in (*self.albedo, self.ramp, self.specular, self.roughness)]
        errors = [float(f"{value:.2g}") for value in self.deviation]
        return {
            "albedo": rounded[:3],
            "albedo, deviation": errors[:3],
            "chromaticity ramp": [rounded[3], errors[3]],
            "specular share": [rounded[4], errors[4]],
            "roughness, degrees": [float(f"{np.degrees(value):.3g}") for value in (self.roughness, self.deviation[5])],
            "left over": float(f"{self.residual:.3g}"),
        }


@dataclass(frozen=True, eq=False)
class SeparatedPatch:
    """Samples of a patch in two parts, whose sum they are.

    diffuse, specular : (N, 3)
    separable : whether colour parted them; where the body has the light's own colour all is diffuse
    """

    diffuse: np.ndarray
    specular: np.ndarray
    separable: bool


def separate_patch(samples: PatchSamples, light: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> SeparatedPatch:
    """A patch's samples separated by colour: what is reflected at the surface has the light's own.

    samples : of the patch at many angles, as `read_patch` reads them
    light : colour of the lamp beside its irradiance, linear Rec. 709; white unless given
    Source: Debevec et al. 2000, §4.1, eq. 6, 7, and §4.2.
    """
    colour = unit_chromaticity(np.asarray(light, np.float64))
    values = samples.values[:, None]
    bright = values.mean(axis=-1)
    level = np.quantile(bright, 0.95)
    body = median_chromaticity(values, (bright > 0.1 * level) & (bright < 0.9 * level))
    if np.linalg.norm(np.cross(body[0], colour)) < np.sin(LEAST_ANGLE):
        return SeparatedPatch(samples.values, np.zeros_like(samples.values), False)
    cosines = (np.cos(samples.incidence) * np.cos(samples.viewing))[:, None]
    turn = np.arccos(np.clip(half_vector(samples.view, samples.light) @ NORMAL, -1, 1))
    weights = (1 - np.exp(-((turn / MIRROR) ** 2)))[:, None]
    alpha = fitted_ramp(values, weights, cosines, body, colour)
    chromaticity = ramped(body, colour, ramp(alpha, cosines))
    specular = np.maximum(amounts(values, chromaticity, colour)[1], 0)[..., None] * colour
    return SeparatedPatch(samples.values - specular[:, 0], specular[:, 0], True)


def fit_patch(samples: PatchSamples, light: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> PatchReflectance:
    """The numbers of a patch whose reflection is nearest to its samples, both parts at once, by least squares.

    samples : of the patch at many angles, as `read_patch` reads them
    light : colour of the lamp beside its irradiance, linear Rec. 709; white unless given
    Skin's index of refraction is taken as 1.4: only its share of facets depends on it. Raises ValueError where the
    samples show no lobe that ends, as where all are taken far from the mirror angle. Source: Debevec et al. 2000, §4.1,
    eq. 6, 7, and §4.3, eq. 8.
    """
    colour = unit_chromaticity(np.asarray(light, np.float64))
    # A start: the separated parts, one after the other.
    parts = separate_patch(samples, light)
    cosine = np.cos(samples.incidence)
    albedo = np.pi * np.median(parts.diffuse / np.maximum(cosine, 0.05)[:, None], axis=0)
    albedo = np.maximum(albedo, 1e-4)

    def left_over(numbers: np.ndarray) -> np.ndarray:
        found = _of(numbers, colour)
        predicted = found.diffuse_part(samples.incidence, samples.viewing)
        predicted = predicted + found.specular_part(samples.light, samples.view)
        return (predicted - samples.values) / samples.deviation

    # Both at once, from lobes of several widths.
    low = [*np.full(3, -12.0), LOWEST, -12.0, np.log(0.01)]
    high = [*np.full(3, 2.0), HIGHEST, 3.0, np.log(1.2)]
    minima = []
    for roughness in ROUGHNESSES:
        start = np.array([*np.log(albedo), -0.1, np.log(0.3), np.log(roughness)])
        minima.append(
            optimize.least_squares(lambda x: left_over(x).ravel(), np.clip(start, low, high), bounds=(low, high))
        )
    best = min(minima, key=lambda each: each.cost)
    # What the channels' errors have in common, as a lamp that flickers, says nothing of colour: weighed by the
    # correlation of what is left over, the samples' ratios count for what they are.
    apart = _uncorrelated(left_over(best.x))
    best = optimize.least_squares(lambda x: (left_over(x) @ apart).ravel(), best.x, bounds=(low, high))
    if best.x[5] > high[5] - 1e-3 or best.x[4] < low[4] + 1e-3:
        raise ValueError(
            "the samples show no highlight: its width or strength has no bound; take some near the mirror angle"
        )
    # Their covariance, scaled to what is left over.
    freedom = max(len(best.fun) - len(best.x), 1)
    covariance = np.linalg.pinv(best.jac.T @ best.jac) * 2 * best.cost / freedom
    found = _of(best.x, colour)
    scale = np.array([*found.albedo, 1.0, found.specular, found.roughness])
    left = left_over(best.x) * samples.deviation
    return PatchReflectance(
        found.albedo, found.ramp, found.specular, found.roughness, np.sqrt(np.diag(covariance)) * scale,
        float(np.sqrt((left**2).mean() / (samples.values**2).mean())), colour,
    )  # fmt: skip


def _uncorrelated(errors: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) that, from the right, makes errors (N, 3) uncorrelated, of the mean square they had."""
    square = errors.T @ errors / len(errors)
    # What the channels' correlation leaves is at least what rounding does.
    square += LEAST_SHARE * np.trace(square) / 3 * np.eye(3)
    return np.linalg.cholesky(np.linalg.inv(square)) * np.sqrt(np.trace(square) / 3)


def _of(numbers: np.ndarray, colour: np.ndarray) -> PatchReflectance:
    """The reflectance of log albedo, ramp, log share and log roughness (6,)."""
    albedo, specular, roughness = np.exp(numbers[:3]), float(np.exp(numbers[4])), float(np.exp(numbers[5]))
    return PatchReflectance(albedo, float(numbers[3]), specular, roughness, np.zeros(6), 0.0, colour)


def _diffuse(
    albedo: np.ndarray, end: float, light: np.ndarray, incident: np.ndarray, viewing: np.ndarray
) -> np.ndarray:
    """Lambert's law, with the chromaticity's ramp."""
    length = np.linalg.norm(albedo)
    along = ramp(np.array([[0.0, end]]), np.atleast_1d(incident * viewing)[:, None])
    chromaticity = ramped(albedo[None] / length, light, along)[:, 0]
    return length / np.pi * np.maximum(np.atleast_1d(incident), 0)[:, None] * chromaticity


def _lobe(light: np.ndarray, view: np.ndarray, roughness: float) -> np.ndarray:
    """P G F / (4 cos θr), eq. 8 for unit irradiance: P a Gaussian of the facets' angle, 1 over the patch."""
    turn = np.arccos(np.clip(half_vector(view, light) @ NORMAL, -1, 1))
    density = np.exp(-((_ANGLES / roughness) ** 2)) * np.cos(_ANGLES) * np.sin(_ANGLES)
    whole = 2 * np.pi * np.trapezoid(density, _ANGLES)
    return np.exp(-((turn / roughness) ** 2)) / whole * grooved_reflection(view, light, NORMAL) / 4

"""Direct light fitted to each pixel's reflectance function: how much of it cosine, gloss and shadow explain.

R_i ≈ ρ_d B_1i + ρ_s B_2i + a + b·l_i: B are the direct light of light i (`surface.direct_light`), the rest is light
that came over other surfaces, whose change with direction is slow.
"""

from __future__ import annotations

import numpy as np

from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.specular_spikes import spiky_and_mirror_pixels

_EXPLAINED = 0.5
_SPIKE_EXPLAINED = 0.8
"""Of a function that is a spike: a little off the model it would be turned into light below 0."""


def fit_direct_light(values: np.ndarray, basis: np.ndarray, lights: StageLights) -> np.ndarray:
    """The scales (K, 2, 3) float32 of the direct light, by least squares over the sphere, none below 0.

    0 where direct light explains less than half of what indirect light leaves over, or four fifths where the function
    is a spike, and where one light alone makes most of it, as on a mirror.

    values : (N, K, 3) of a reflectance field
    basis : (N, 2, K) of `direct_light`
    """
    indirect = np.concatenate([np.ones((len(lights), 1)), lights.directions], axis=1)
    root = np.sqrt(lights.solid_angles)[:, None]
    orthogonal = np.linalg.qr(indirect * root)[0].astype(np.float32)

    def remaining(array: np.ndarray) -> np.ndarray:
        """(K, N, …) weighted, without what the indirect terms can explain."""
        flat = (array * root.astype(np.float32).reshape(-1, 1, 1)).reshape(len(lights), -1)
        return (flat - orthogonal @ (orthogonal.T @ flat)).reshape(array.shape)

    causes, effects = remaining(basis).transpose(2, 0, 1), remaining(values).transpose(1, 0, 2)
    normal = np.einsum("knb,knc->kbc", causes, causes).astype(np.float64)
    right = np.einsum("knb,knc->kbc", causes, effects).astype(np.float64)
    scales = _not_negative(normal, right)
    total = np.einsum("knc,knc->k", effects, effects)
    explained = 2 * np.einsum("kbc,kbc->k", scales, right) - np.einsum("kbc,kbd,kdc->k", scales, normal, scales)
    spiky, mirrors = spiky_and_mirror_pixels(values, lights)
    modelled = (explained > np.where(spiky, _SPIKE_EXPLAINED, _EXPLAINED) * total) & ~mirrors
    return np.where(modelled[:, None, None], scales, 0).astype(np.float32)


def _not_negative(normal: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions (K, 2, 3) of the normal equations (K, 2, 2) x = (K, 2, 3) under x ≥ 0."""
    tiny = 1e-6 * np.einsum("kbb->k", normal)[:, None, None] * np.eye(2) + 1e-12 * np.eye(2)
    both = np.linalg.solve(normal + tiny, right)
    alone = np.maximum(right / np.einsum("kbb->kb", normal + tiny)[..., None], 0)
    gain = alone * np.maximum(right, 0)
    first = gain[:, 0] >= gain[:, 1]
    single = np.stack([np.where(first, alone[:, 0], 0), np.where(first, 0, alone[:, 1])], axis=1)
    return np.where((both >= 0).all(axis=1, keepdims=True), both, single)


def unexplained(values: np.ndarray, basis: np.ndarray, lights: StageLights) -> float:
    """The median over pixels of Σ |R − direct light| / Σ |R|, weighted by the lights' cells; mirrors do not count."""
    direct = np.einsum("nbk,kbc->nkc", basis, fit_direct_light(values, basis, lights))
    error = np.einsum("nkc,n->k", np.abs(values - direct), lights.solid_angles)
    total = np.einsum("nkc,n->k", np.abs(values), lights.solid_angles)
    shown = total > 0
    return float(np.median(error[shown] / total[shown])) if shown.any() else 1.0

"""The direct light of a subject's mesh, fitted to each pixel of a reflectance field, for relighting and new views.

M is irradiance and reflected gloss of each pixel (`surface.py`), times scales that are fitted to the pixel's values
under all lights, R_i ≈ ρ_d B_1i + ρ_s B_2i + a + b·l_i: B are the direct light of light i, the rest is light that came
over other surfaces, whose change with direction is slow. What M leaves over of the values is interpolated between the
lights. Metres, the stage's frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count as count_from
from threading import Lock

import numpy as np

from relume.image.bands import in_threads
from relume.lightstage.direct_light.light_directions import DirectedLight
from relume.lightstage.direct_light.surface import Geometry, Reached, Sample, direct_light, over_neighbours, samples_of
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Barycentric, Interpolation, Smooth
from relume.lightstage.relighting.relighting import Progress
from relume.lightstage.relighting.specular_spikes import spiky_and_mirror_pixels
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh

ALPHAS = (0.05, 0.08, 0.12, 0.18, 0.26, 0.38)
"""The widths of gloss that are tried where none is given."""
_TRIED_ROWS = 8
_EXPLAINED = 0.5
_SPIKE_EXPLAINED = 0.8
"""Of a function that is a spike: a little off the model it would be turned into light below 0."""
_TOGETHER = 16
"""Directions that a thread takes at once."""


@dataclass(frozen=True)
class DirectLightSettings:
    """How direct light is fitted to a field, and what it leaves over interpolated.

    remainder : interpolation of what direct light leaves over. It changes from pixel to pixel where the model is off,
        so that lights next to a direction count too and none is believed to the end: with the default's noise, light
        from a stage's light does not give back quite what was measured under it; without noise it does
    spike_interpolation : of pixels that are spikes and are not explained by direct light
    light_radius : radians, half the angle across the stage's lights, seen from the subject
    alpha : width of the microfacets' slopes, found from the pictures for None
    side : side² rays look through each pixel; 3 ones keep edges smooth
    filter_share : of each neighbour in a pixel along rows and columns. 0.08 and the pixel's square together are as
        wide as a Blackman–Harris filter of ±1.5 pixels, which fits renderers and lenses alike
    """

    remainder: Interpolation = Smooth(cells=1.15, noise=0.1)
    spike_interpolation: Interpolation = Barycentric()
    light_radius: float = float(np.radians(1))
    alpha: float | None = None
    side: int = 3
    filter_share: float = 0.08

    def __post_init__(self) -> None:
        if not 0 <= self.light_radius < np.pi / 2:
            raise ValueError(f"light_radius is {self.light_radius}; expected radians, 0 … π/2")
        if self.alpha is not None and not 0 < self.alpha <= 1:
            raise ValueError(f"alpha is {self.alpha}; expected a width above 0, at most 1")
        if self.side < 1 or not 0 <= self.filter_share <= 1 / 3:
            raise ValueError(f"side {self.side}, filter_share {self.filter_share}; expected ≥ 1 and 0 … 1/3")


@dataclass(frozen=True, eq=False)
class DirectModel:
    """The direct light of a field's pixels, and how it is fitted.

    source : what was measured
    geometry, camera : of its subject, and where its pictures were taken from
    alpha : width of the microfacets' slopes, as set or as found
    threads : every core for None
    """

    source: ReflectanceField
    geometry: Geometry
    camera: Camera
    settings: DirectLightSettings
    alpha: float
    threads: int | None = None

    def samples(self, rows: slice) -> tuple[slice, tuple[Sample, ...]]:
        """What pixels of these rows and of their neighbours see, and which rows these are."""
        wide = slice(max(rows.start - 1, 0), min(rows.stop + 1, self.camera.height))
        height = np.arange(wide.start, wide.stop)
        return wide, samples_of(self.geometry, self.camera, height, self.settings.side, self.threads)

    def gathered(self, light: np.ndarray, wide: slice, rows: slice) -> np.ndarray:
        """Direct light (…, wide rows · columns) as pixels gather it: (…, rows · columns)."""
        columns = self.camera.width
        kept = slice((rows.start - wide.start) * columns, (rows.stop - wide.start) * columns)
        return over_neighbours(light, columns, self.settings.filter_share)[..., kept]

    def basis(
        self, samples: Sequence[Sample], wide: slice, rows: slice, directions: np.ndarray, radii: np.ndarray
    ) -> np.ndarray:
        """(M, 2, rows · columns) float32 under each of these lights."""
        pixels = (wide.stop - wide.start) * self.camera.width

        def under(begin: int, end: int) -> list[np.ndarray]:
            return [
                self.gathered(
                    direct_light(self.geometry, samples, pixels, directions[i], radii[i], self.alpha), wide, rows
                )
                for i in range(begin, end)
            ]

        parts = in_threads(under, len(directions), self.threads, chunk=_TOGETHER)
        return np.stack([each for part in parts for each in part])

    def fitted(self, samples: Sequence[Sample], wide: slice, rows: slice) -> tuple[np.ndarray, np.ndarray]:
        """Scales (K, 2, 3) of direct light, and what it leaves over of the field (N, K, 3)."""
        lights = self.source.lights
        values = self.source.block(slice(0, len(lights)), rows).reshape(len(lights), -1, 3)
        radii = np.full(len(lights), self.settings.light_radius)
        basis = self.basis(samples, wide, rows, lights.directions, radii)
        scales = fit_direct_light(values, basis, lights)
        left = values.copy()
        for light in range(len(lights)):
            left[light] -= np.einsum("bk,kbc->kc", basis[light], scales)
        return scales, left


def direct_model(
    source: ReflectanceField,
    geometry: Sequence[Mesh],
    settings: DirectLightSettings = DirectLightSettings(),
    threads: int | None = None,
) -> DirectModel:
    """The model of direct light on a mesh; finds `alpha` where the settings leave it open.

    Raises ValueError for a field without a camera, and where the camera sees nothing of the mesh.
    """
    if source.camera is None:
        raise ValueError("the field has no camera, so that its pixels cannot be placed on the mesh; give it one")
    ready = Geometry.of(geometry)
    (seen,) = samples_of(ready, source.camera, np.arange(source.shape[0]), 1, threads)
    shown = np.unique(seen.pixels // source.camera.width)
    if len(shown) == 0:
        raise ValueError("the camera sees nothing of the mesh; check that both are in the stage's frame, in metres")
    alpha = settings.alpha or _found_alpha(source, ready, source.camera, shown, settings.light_radius)
    return DirectModel(source, ready, source.camera, settings, alpha, threads)


def _found_alpha(
    source: ReflectanceField, geometry: Geometry, camera: Camera, shown: np.ndarray, radius: float
) -> float:
    """The width of gloss with which direct light explains most, in some of the rows (R,) that show the mesh."""
    lights = source.lights
    rows = shown[np.unique(np.linspace(0, len(shown) - 1, _TRIED_ROWS + 2).astype(int)[1:-1])]
    (sample,) = samples_of(geometry, camera, rows, 1)
    values = np.concatenate([source.block(slice(0, len(lights)), slice(row, row + 1)) for row in rows], axis=1)
    values = values.reshape(len(lights), -1, 3)[:, sample.pixels]
    reached = [Reached.of(geometry, [sample], direction, radius) for direction in lights.directions]
    errors = []
    for alpha in ALPHAS:
        basis = [each.shone(len(rows) * camera.width, alpha) for each in reached]
        errors.append(unexplained(values, np.stack(basis)[..., sample.pixels], lights))
    return ALPHAS[int(np.argmin(errors))]


def left_over(
    model: DirectModel,
    samples: Sequence[Sample],
    wide: slice,
    rows: slice,
    irradiances: np.ndarray,
    spike_irradiances: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """What direct light leaves over in these rows under a light, (K, 3), and the scales of its two parts, (K, 2, 3).

    irradiances, spike_irradiances : (N, 3), by the remainder's interpolation and by that of pixels that are spikes
    """
    scales, left = model.fitted(samples, wide, rows)
    # Pixels are spikes that direct light does not explain where all is left over.
    spiky = np.asarray(~scales.any(axis=(1, 2)))
    spiky[spiky] = spiky_and_mirror_pixels(left[:, spiky], model.source.lights)[0]
    over = np.einsum("nkc,nc->kc", left, irradiances)
    over[spiky] = np.einsum("nkc,nc->kc", left[:, spiky], spike_irradiances)
    return over, scales


def direct_picture(
    model: DirectModel,
    samples: Sequence[Sample],
    wide: slice,
    rows: slice,
    light: DirectedLight,
    progress: Progress | None = None,
) -> np.ndarray:
    """Direct light (2, K, 3) of all directions together, each looked at through its `light.rays`.

    progress : called with the share of the directions that are done
    """
    done, one_at_a_time = count_from(1), Lock()
    pixels = (wide.stop - wide.start) * model.camera.width
    rays, count = light.looked_at(), len(samples)

    def some(begin: int, end: int) -> np.ndarray:
        each = np.empty((end - begin, 2 * pixels), np.float32)
        for i in range(begin, end):
            wanted, first = rays[i].tolist()
            chosen = [samples[(first + j) % count] for j in range(wanted)] if wanted < count else samples
            one = direct_light(model.geometry, chosen, pixels, light.directions[i], light.radii[i], model.alpha)
            each[i - begin] = one.reshape(-1)
        if progress:
            with one_at_a_time:
                progress(min(next(done) * _TOGETHER / len(rays), 1.0))
        return light.irradiances[begin:end].T.astype(np.float32) @ each

    parts = in_threads(some, len(light.directions), model.threads, chunk=_TOGETHER)
    total = sum(parts, np.zeros((3, 2 * pixels), np.float32)).reshape(3, 2, pixels)
    return np.moveaxis(model.gathered(total, wide, rows), 0, 2)


def fit_direct_light(values: np.ndarray, basis: np.ndarray, lights: StageLights) -> np.ndarray:
    """The scales (K, 2, 3) float32 of the direct light, by least squares over the sphere, none below 0.

    0 where direct light explains less than half of what indirect light leaves over, or four fifths where the function
    is a spike, and where one light alone makes most of it, as on a mirror.

    values : (N, K, 3) of a reflectance field
    basis : (N, 2, K) of `direct_light`
    """
    scales = np.zeros((values.shape[1], 2, 3), np.float32)
    # Beside the mesh there is nothing to fit, which is half of many pictures.
    shown = basis.any(axis=(0, 1))
    if shown.any():
        scales[shown] = _fit_shown(values[:, shown], basis[..., shown], lights)
    return scales


def _fit_shown(values: np.ndarray, basis: np.ndarray, lights: StageLights) -> np.ndarray:
    """`fit_direct_light` of pixels that direct light reaches."""
    indirect = np.concatenate([np.ones((len(lights), 1)), lights.directions], axis=1)
    root = np.sqrt(lights.solid_angles)[:, None]
    orthogonal = np.linalg.qr(indirect * root)[0].astype(np.float32)

    def remaining(array: np.ndarray) -> np.ndarray:
        """(K, N, …) weighted, without what the indirect terms can explain."""
        flat = (array * root.astype(np.float32).reshape(-1, 1, 1)).reshape(len(lights), -1)
        flat -= orthogonal @ (orthogonal.T @ flat)
        return flat.reshape(array.shape)

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

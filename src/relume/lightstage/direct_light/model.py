"""The direct light of a subject's mesh, fitted to each pixel of a reflectance field, for relighting and new views.

M is irradiance and reflected gloss of each pixel (`surface.py`), times scales that are fitted to the pixel's values
under all lights; what M leaves over of them is interpolated between the lights. Metres, the stage's frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.lightstage.direct_light.fit import fit_direct_light, unexplained
from relume.lightstage.direct_light.light_directions import DirectedLight
from relume.lightstage.direct_light.surface import Geometry, Sample, direct_light, over_neighbours, samples_of
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Barycentric, Interpolation, Smooth
from relume.lightstage.relighting.specular_spikes import spiky_and_mirror_pixels
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh

ALPHAS = (0.05, 0.08, 0.12, 0.18, 0.26, 0.38)
"""The widths of gloss that are tried where none is given."""
_TRIED_ROWS = 8
_TOGETHER = 16
"""Directions that a thread takes at once."""


@dataclass(frozen=True)
class DirectLightSettings:
    """How direct light is fitted to a field, and what it leaves over interpolated.

    interpolation : of all, without a mesh
    remainder : interpolation of what direct light leaves over. It changes from pixel to pixel where the model is off,
        so that lights next to a direction count too and none is believed to the end: with the default's noise, light
        from a stage's light does not give back quite what was measured under it; without noise it does
    spike_interpolation : of pixels that are spikes and are not explained by direct light, with a mesh or without
    light_radius : radians, half the angle across the stage's lights, seen from the subject
    alpha : width of the microfacets' slopes, found from the pictures for None
    side : side² rays look through each pixel; 3 ones keep edges smooth
    filter_share : of each neighbour in a pixel along rows and columns. 0.08 and the pixel's square together are as
        wide as a Blackman–Harris filter of ±1.5 pixels, which fits renderers and lenses alike
    """

    interpolation: Interpolation = Smooth()
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
    settings : with an `alpha`
    threads : every core for None
    """

    source: ReflectanceField
    geometry: Geometry
    camera: Camera
    settings: DirectLightSettings
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
        from relume._kernel import in_threads

        pixels = (wide.stop - wide.start) * self.camera.width
        alpha = required(self.settings.alpha)

        def under(begin: int, end: int) -> list[np.ndarray]:
            return [
                self.gathered(
                    direct_light(self.geometry, samples, pixels, directions[i], radii[i], alpha, 1), wide, rows
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
    if settings.alpha is None:
        settings = replace(settings, alpha=_found_alpha(source, ready, source.camera, shown, settings.light_radius))
    return DirectModel(source, ready, source.camera, settings, threads)


def _found_alpha(
    source: ReflectanceField, geometry: Geometry, camera: Camera, shown: np.ndarray, radius: float
) -> float:
    """The width of gloss with which direct light explains most, in some of the rows (R,) that show the mesh."""
    lights = source.lights
    rows = shown[np.unique(np.linspace(0, len(shown) - 1, _TRIED_ROWS + 2).astype(int)[1:-1])]
    (sample,) = samples_of(geometry, camera, rows, 1)
    values = np.concatenate([source.block(slice(0, len(lights)), slice(row, row + 1)) for row in rows], axis=1)
    values = values.reshape(len(lights), -1, 3)[:, sample.pixels]
    errors = []
    for alpha in ALPHAS:
        basis = [
            direct_light(geometry, [sample], len(rows) * camera.width, direction, radius, alpha)
            for direction in lights.directions
        ]
        errors.append(unexplained(values, np.stack(basis)[..., sample.pixels], lights))
    return ALPHAS[int(np.argmin(errors))]


def left_over(
    model: DirectModel, rows: slice, irradiances: np.ndarray, spike_irradiances: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What direct light leaves over in these rows under a light, (K, 3), and the scales of its two parts, (K, 2, 3).

    irradiances, spike_irradiances : (N, 3), by the remainder's interpolation and by that of pixels that are spikes
    """
    wide, samples = model.samples(rows)
    scales, left = model.fitted(samples, wide, rows)
    return sum_remainder(
        left, unmodelled_spikes(scales, left, model.source.lights), irradiances, spike_irradiances
    ), scales


def sum_remainder(
    left: np.ndarray, spiky: np.ndarray, irradiances: np.ndarray, spike_irradiances: np.ndarray
) -> np.ndarray:
    over = np.einsum("nkc,nc->kc", left, irradiances)
    over[spiky] = np.einsum("nkc,nc->kc", left[:, spiky], spike_irradiances)
    return over


def unmodelled_spikes(scales: np.ndarray, left: np.ndarray, lights: StageLights) -> np.ndarray:
    """Which of K pixels (K,) are spikes that direct light (K, 2, 3) does not explain: all is left over (N, K, 3)."""
    found = np.asarray(~scales.any(axis=(1, 2)))
    found[found] = spiky_and_mirror_pixels(left[:, found], lights)[0]
    return found


def direct_picture(
    model: DirectModel, samples: Sequence[Sample], wide: slice, rows: slice, light: DirectedLight
) -> np.ndarray:
    """Direct light (2, K, 3) of all directions together, each looked at through its `light.rays`."""
    from relume._kernel import in_threads

    pixels = (wide.stop - wide.start) * model.camera.width
    alpha, rays = required(model.settings.alpha), light.looked_at()

    def some(begin: int, end: int) -> np.ndarray:
        total = np.zeros((3, 2, pixels), np.float32)
        for i in range(begin, end):
            chosen = [samples[j] for j in _turns(len(samples), *rays[i].tolist())]
            one = direct_light(model.geometry, chosen, pixels, light.directions[i], light.radii[i], alpha, 1)
            for channel in range(3):
                total[channel] += one * np.float32(light.irradiances[i, channel])
        return total

    parts = in_threads(some, len(light.directions), model.threads, chunk=_TOGETHER)
    total = sum(parts, np.zeros((3, 2, pixels), np.float32))
    return np.moveaxis(model.gathered(total, wide, rows), 0, 2)


def _turns(count: int, wanted: int, first: int) -> list[int]:
    """`wanted` of `count` rays, from the first on."""
    return [(first + j) % count for j in range(wanted)] if wanted < count else list(range(count))


def required(alpha: float | None) -> float:
    """The width of gloss; raises ValueError where it was not found yet."""
    if alpha is None:
        raise ValueError("the settings have no alpha; let `direct_model` find it")
    return alpha

"""A reflectance field for light between the stage's lights: shadows and glints move instead of fading over.

Interpolated reflectance functions show two faint shadows where one should stand between them. With a mesh of the
subject, direct light (cosine, gloss and shadow, `dense_surface`) is fitted to each pixel, and only what it leaves over
is interpolated: R(ω) = Σ_i w_i(ω) (R_i − M_i) + M(ω), as a control variate. Without a mesh it is the interpolation
alone. Pixels whose functions are spikes that direct light does not explain, as a mirror's, take weights that are never
below 0 (`glints`). What the model is and which weights a pixel takes depend on the field alone, so that a picture is
linear in the light of given directions; with directions that `leaves_of` chose for a map, up to that choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from relume.lightstage.dense_directions import DirectedLight
from relume.lightstage.dense_fit import fitted_direct, unexplained
from relume.lightstage.dense_surface import Geometry, Sample, direct_light, over_neighbours, samples_of
from relume.lightstage.field import Noise, ReflectanceField
from relume.lightstage.glints import interpolated, spikes_of
from relume.lightstage.interpolation import Barycentric, Interpolation, Smooth
from relume.lightstage.lights import StageLights
from relume.lightstage.relighting import MEMORY, Progress
from relume.scene.camera import Camera
from relume.scene.shapes import Mesh

ALPHAS = (0.05, 0.08, 0.12, 0.18, 0.26, 0.38)
"""The widths of gloss that are tried where none is given."""
_TRIED_ROWS = 8
_LIGHT_BYTES = 96
"""Bytes that each light and pixel of a block of rows takes, with what is computed from them."""
_TIMED_PLACES, _TIMED_PIXELS, _TIMED_LIGHTS = 3, 2048, 100
_TOGETHER = 16
"""Directions that a thread takes at once."""


@dataclass(frozen=True)
class Densification:
    """How a field is densified.

    interpolation : of all, without a mesh
    remainder : interpolation of what direct light leaves over. It changes from pixel to pixel where the model is off,
        so that lights next to a direction tell more and none is believed to the end: with the default's noise, light
        from a stage's light does not give back quite what was measured under it; without noise it does
    glints : of pixels that are spikes and are not explained by direct light, with a mesh or without
    light_radius : radians, half the angle across the stage's lights, seen from the subject
    alpha : width of the microfacets' slopes, found from the pictures for None
    side : side² rays look through each pixel; 3 ones keep edges smooth
    filter_share : of each neighbour in a pixel along rows and columns. 0.08 and the pixel's square together are as
        wide as a Blackman–Harris filter of ±1.5 pixels, which fits renderers and lenses alike
    """

    interpolation: Interpolation = Smooth()
    remainder: Interpolation = Smooth(cells=1.15, noise=0.1)
    glints: Interpolation = Barycentric()
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
    settings: Densification
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
        scales = fitted_direct(values, basis, lights)
        left = values.copy()
        for light in range(len(lights)):
            left[light] -= np.einsum("bk,kbc->kc", basis[light], scales)
        return scales, left


@dataclass(frozen=True, eq=False)
class Densified:
    """A `ReflectanceField` of other lights than those that were measured; its blocks are computed when asked for.

    In a measured light's own direction it is what was measured where the interpolation is exact there: without a mesh
    by default, with one where `settings.remainder` has no noise.

    Ask for all lights of some rows at once: what a block of rows needs is kept only until other rows are asked for.

    source : what was measured
    lights : of this field
    radii : (M,) radians, of the disc that each of them fills
    settings : how
    model : of direct light; None without a mesh
    """

    source: ReflectanceField
    lights: StageLights
    radii: np.ndarray
    settings: Densification
    model: DirectModel | None
    _kept: dict = field(default_factory=dict, repr=False)

    @property
    def shape(self) -> tuple[int, int]:
        return self.source.shape

    @property
    def camera(self) -> Camera | None:
        return self.source.camera

    @property
    def noise(self) -> Noise | None:
        """None: what is interpolated shares its noise."""
        return None

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        """As of every `ReflectanceField`; some values may be a little below 0, as interpolation makes them."""
        count, directions = len(self.source.lights), self.lights.directions[lights]
        by = self.settings.interpolation if self.model is None else self.settings.remainder
        weights = by.weights(self.source.lights, directions)
        glints = self.settings.glints.weights(self.source.lights, directions)
        shape = (len(directions), rows.stop - rows.start, self.shape[1], 3)
        if self.model is None:
            values = self.source.block(slice(0, count), rows).reshape(count, -1, 3)
            return interpolated(values, spikes_of(values, self.source.lights)[0], weights, glints).reshape(shape)
        place = (rows.start, rows.stop)
        if place not in self._kept:
            wide, samples = self.model.samples(rows)
            self._kept.clear()
            self._kept[place] = (wide, samples, *self.model.fitted(samples, wide, rows))
        wide, samples, scales, left = self._kept[place]
        found = interpolated(left, _glinting(scales, left, self.source.lights), weights, glints)
        for i, (direction, radius) in enumerate(zip(directions, self.radii[lights], strict=True)):
            one = self.model.basis(samples, wide, rows, direction[None], np.array([radius]))[0]
            found[i] += np.einsum("bk,kbc->kc", one, scales)
        return found.reshape(shape)


def _glinting(scales: np.ndarray, left: np.ndarray, lights: StageLights) -> np.ndarray:
    """Which of K pixels (K,) are spikes that direct light (K, 2, 3) does not explain: all is left over (N, K, 3)."""
    found = np.asarray(~scales.any(axis=(1, 2)))
    found[found] = spikes_of(left[:, found], lights)[0]
    return found


def densified(
    source: ReflectanceField,
    lights: StageLights,
    geometry: Sequence[Mesh] | None = None,
    settings: Densification = Densification(),
    radii: np.ndarray | None = None,
) -> Densified:
    """The field as it would be under other lights.

    geometry : meshes of the subject in the stage's frame; None where there is none
    radii : (M,) radians, of the disc that each light fills; the stage's `light_radius` unless given
    Raises ValueError for a mesh without a camera, and for one that the camera does not see.
    """
    discs = np.full(len(lights), settings.light_radius) if radii is None else np.asarray(radii, np.float64)
    if discs.shape != (len(lights),):
        raise ValueError(f"radii are {discs.shape}; expected one a light, ({len(lights)},)")
    model = None if geometry is None else direct_model(source, geometry, settings)
    return Densified(source, lights, discs, settings, model)


def direct_model(
    source: ReflectanceField,
    geometry: Sequence[Mesh],
    settings: Densification = Densification(),
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


def densely_relit(
    source: ReflectanceField,
    light: DirectedLight,
    geometry: Sequence[Mesh] | None = None,
    settings: Densification = Densification(),
    irradiances: np.ndarray | None = None,
    progress: Progress | None = None,
    *,
    threads: int | None = None,
    memory: int = MEMORY,
) -> np.ndarray:
    """The picture (H, W, 3) float32 under light from many directions, without a field of them in between.

    The same as the sum over `densified` blocks, but for lights that are looked at through fewer rays. The picture
    under several lights together is the sum of their pictures, to rounding.

    light : as `leaves_of` makes it from a map
    geometry : meshes of the subject in the stage's frame; None where there is none
    irradiances : (N, 3) of the stage's lights, for what direct light leaves over; interpolated from `light` unless
        given
    threads : every core unless given
    memory : bytes that a block of rows may take; they change no more than the last bits
    Raises ValueError as `densified`, and for less memory than a row takes.
    """
    if irradiances is None:
        by = settings.interpolation if geometry is None else settings.remainder
        irradiances = by.gathered(source.lights, light.directions, light.irradiances)
    glints = settings.glints.gathered(source.lights, light.directions, light.irradiances)
    blocks = row_blocks(source, memory)
    model = None if geometry is None else direct_model(source, geometry, settings, threads)
    picture = np.empty((*source.shape, 3), np.float32)
    for rows in blocks:
        picture[rows] = _relit_rows(source, model, rows, light, irradiances, glints)
        if progress:
            progress(rows.stop / source.shape[0])
    return picture


def row_blocks(source: ReflectanceField, memory: int) -> list[slice]:
    """The rows of a field that are relit at once with so many bytes; raises ValueError where one row takes more."""
    height, width = source.shape
    row = len(source.lights) * width * _LIGHT_BYTES
    # Pixels gather light from the rows beside them too.
    step = int(memory // row) - 2
    if step < 1:
        raise ValueError(
            f"memory is {memory / 1e6:.1f} MB; rows of {width} pixels under {len(source.lights)} lights need at least "
            f"{np.ceil(3 * row / 1e5) / 10:.1f} MB"
        )
    return [slice(begin, min(begin + step, height)) for begin in range(0, height, step)]


def _relit_rows(
    source: ReflectanceField,
    model: DirectModel | None,
    rows: slice,
    light: DirectedLight,
    irradiances: np.ndarray,
    glints: np.ndarray,
) -> np.ndarray:
    """Some rows of `densely_relit`; `irradiances` and `glints` (N, 3) are of what direct light leaves over."""
    if model is None:
        left = source.block(slice(0, len(source.lights)), rows).reshape(len(source.lights), -1, 3)
        glinting, direct = spikes_of(left, source.lights)[0], 0.0
    else:
        wide, samples = model.samples(rows)
        scales, left = model.fitted(samples, wide, rows)
        glinting = _glinting(scales, left, source.lights)
        direct = np.einsum("bkc,kbc->kc", direct_picture(model, samples, wide, rows, light), scales)
    over = np.einsum("nkc,nc->kc", left, irradiances)
    over[glinting] = np.einsum("nkc,nc->kc", left[:, glinting], glints)
    return (over + direct).reshape(-1, source.shape[1], 3)


def seconds_for(
    source: ReflectanceField,
    light: DirectedLight,
    geometry: Sequence[Mesh],
    settings: Densification = Densification(),
    *,
    threads: int | None = None,
) -> float:
    """About how long `densely_relit` takes with a mesh: some rows are fitted and lit by some directions.

    Raises ValueError as `densely_relit`.
    """
    begin = perf_counter()
    model = direct_model(source, geometry, settings, threads)
    once, height = perf_counter() - begin, source.shape[0]
    size = min(height, -(-_TIMED_PIXELS // source.shape[1]))
    places = np.unique(np.linspace(0, height - size, _TIMED_PLACES + 2).astype(int)[1:-1])
    some = slice(0, len(light.directions), max(1, len(light.directions) // _TIMED_LIGHTS))
    few = DirectedLight(light.directions[some], light.irradiances[some], light.radii[some], light.looked_at()[some])
    fitting, lighting, timed = 0.0, 0.0, 0
    for place in places:
        rows = slice(int(place), int(place) + size)
        first = perf_counter()
        wide, samples = model.samples(rows)
        model.fitted(samples, wide, rows)
        second = perf_counter()
        direct_picture(model, samples, wide, rows, few)
        fitting, lighting = fitting + second - first, lighting + perf_counter() - second
        timed += wide.stop - wide.start
    lighting *= len(light.directions) / max(len(few.directions), 1)
    return once + (fitting + lighting) * height / timed


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
        raise ValueError("the settings tell no alpha; let `direct_model` find it")
    return alpha

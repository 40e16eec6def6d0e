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
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from relume.lightstage.direct_light.directions import DirectedLight
from relume.lightstage.direct_light.model import (
    Densification,
    DirectModel,
    direct_model,
    direct_picture,
    glinting_pixels,
    over_of,
)
from relume.lightstage.field.field import Noise, ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.relighting import MEMORY, Progress
from relume.lightstage.relighting.specular_spikes import interpolated, spikes_of
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh

_LIGHT_BYTES = 96
"""Bytes that each light and pixel of a block of rows takes, with what is computed from them."""
_TIMED_PLACES, _TIMED_PIXELS, _TIMED_LIGHTS = 3, 2048, 100


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
        found = interpolated(left, glinting_pixels(scales, left, self.source.lights), weights, glints)
        for i, (direction, radius) in enumerate(zip(directions, self.radii[lights], strict=True)):
            one = self.model.basis(samples, wide, rows, direction[None], np.array([radius]))[0]
            found[i] += np.einsum("bk,kbc->kc", one, scales)
        return found.reshape(shape)


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
        glinting = glinting_pixels(scales, left, source.lights)
        direct = np.einsum("bkc,kbc->kc", direct_picture(model, samples, wide, rows, light), scales)
    return (over_of(left, glinting, irradiances, glints) + direct).reshape(-1, source.shape[1], 3)


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

"""Relighting: a subject under any light, as the sum of its pictures under each (Debevec et al. 2000, eq. 3, 4).

A light is given as irradiances E_i = ∫ L dω over the cell of light i; the picture is Σ_i R_i · E_i, channel by channel.
Sums run over the lights in their order and in float64 (`sum_kernel`), so the picture has the same bytes however the
field is cut into blocks, wherever it is kept and however many threads work.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import Pictures, ReflectanceField
from relume.lightstage.field.lights import StageLights

MEMORY = 1 << 30
"""Bytes a sum may work in by default: large enough that blocks cost nothing, small beside any machine's memory."""
Progress = Callable[[float], None]
"""Called with the part that is done, 0…1."""


def weighted_sum(
    field: ReflectanceField,
    irradiances: np.ndarray,
    *,
    threads: int | None = None,
    memory: int = MEMORY,
    progress: Progress | None = None,
) -> RadianceMap:
    """The subject under light of these irradiances; with a variance where the field's noise is known.

    field : the subject's
    irradiances : (N, 3), of every light's cell; may be negative, as smooth interpolation makes them, and the picture
        then too
    threads : every core unless given
    memory : bytes for blocks, sums and the picture; a field in memory is not counted, nor copied
    progress : called with the share of the work that is done, 0 to 1
    Raises ValueError for irradiances of another shape or that are not finite, and for too little memory.
    Source: Debevec et al. 2000, eq. 3, 4. The variance is Σ E_i² · (constant + slope · R_i), not below 0.
    """
    given = checked(field.lights, irradiances)
    return next(summed(field, given[None], threads=threads, memory=memory, progress=progress))


def weighted_sums(
    field: ReflectanceField,
    irradiances: np.ndarray,
    *,
    threads: int | None = None,
    memory: int = MEMORY,
    progress: Progress | None = None,
) -> Iterator[RadianceMap]:
    """Pictures under each of the irradiances (K, N, 3), in their order, each the very bytes of `weighted_sum`'s.

    memory : bytes for blocks, sums and pictures; where they do not hold all pictures, the field is read again for the
        next of them
    Raises ValueError as `weighted_sum` does, before the first picture.
    """
    given = np.asarray(irradiances, np.float64)
    if given.ndim != 3 or len(given) == 0:
        raise ValueError(f"irradiances are {given.shape}; expected (pictures, {len(field.lights)} lights, 3)")
    for each in given:
        checked(field.lights, each)
    return (
        picture
        for part in cut(len(given), pictures_at_once(field, memory))
        for picture in summed(
            field, given[part], threads=threads, memory=memory, progress=within(progress, part, len(given))
        )
    )


def pictures_at_once(field: ReflectanceField, memory: int) -> int:
    """How many pictures of the field may be summed in one pass with so many bytes, at least 1.

    Half of the memory is for pictures and their sums, the other half for the field's blocks.
    """
    planes = 1 if field.noise is None else 2
    return max(1, memory // 2 // (field.shape[0] * field.shape[1] * 3 * 12 * planes))


def within(progress: Progress | None, part: slice, count: int) -> Progress:
    """What a pass over some of `count` pictures calls with its own progress."""

    def report(done: float) -> None:
        if progress:
            progress((part.start + done * (part.stop - part.start)) / count)

    return report


def weighted_sum_per_pixel(
    field: ReflectanceField,
    labels: np.ndarray,
    irradiances: np.ndarray,
    *,
    memory: int = MEMORY,
    progress: Progress | None = None,
) -> RadianceMap:
    """The subject with a light of its own at every pixel: light through leaves, a shadow's edge (paper §3.4).

    labels : (H, W) integers; pixel (x, y) has the irradiances of number labels[y, x]
    irradiances : (K, N, 3)
    Raises ValueError for another shape, a label without irradiances, and too little memory.
    """
    from relume.lightstage.relighting.sum_kernel import add_labelled

    numbers, weights = labelled(field, labels, irradiances)
    (rows, columns), noise = field.shape, field.noise
    radiance = np.zeros((rows, columns, 3), np.float32)
    variance = None if noise is None else np.zeros_like(radiance)
    plan = planned(field, memory, len_totals=2, extra=8)
    for row in plan.rows:
        own = numbers[row].reshape(-1)
        totals = np.zeros((2, (row.stop - row.start) * columns, 3))
        for light in plan.lights:
            values = field.block(light, row).reshape(light.stop - light.start, -1, 3)
            add_labelled(values, weights[light], own, totals[0])
            if noise is not None:
                add_labelled(values, noise.slope * weights[light] ** 2, own, totals[1])
            del values
            if progress:
                progress(plan.done(row, light))
        radiance[row] = totals[0].reshape(-1, columns, 3)
        if variance is not None and noise is not None:
            # After all lights, so that no block changes a bit.
            totals[1] += noise.constant * (weights**2).sum(0)[own]
            variance[row] = np.maximum(totals[1], 0).reshape(-1, columns, 3)
    return RadianceMap(radiance, variance)


def summed(
    field: ReflectanceField,
    irradiances: np.ndarray,
    *,
    threads: int | None,
    memory: int,
    progress: Progress | None,
    seen: Callable[[slice, np.ndarray, np.ndarray | None], None] | None = None,
) -> Iterator[RadianceMap]:
    """Pictures under each of the irradiances (K, N, 3), in one pass over the field.

    seen : called with every block on the way: its rows, and what `encoded` gives for it
    """
    from relume.lightstage.relighting.sum_kernel import add_weighted

    count, (rows, columns), noise = len(irradiances), field.shape, field.noise
    weights = np.moveaxis(irradiances, 0, 1)
    if noise is not None and noise.slope > 0:
        weights = np.concatenate([weights, noise.slope * weights**2], axis=1)
    radiance = np.zeros((count, rows, columns, 3), np.float32)
    variance = None if noise is None else np.zeros_like(radiance)
    plan = planned(field, memory, len_totals=weights.shape[1], pictures=count)
    for row in plan.rows:
        totals = np.zeros((weights.shape[1], (row.stop - row.start) * columns * 3))
        for light in plan.lights:
            values, scale = encoded(field, light, row)
            # What a stored 1 stands for goes into the weights: the values are read as they are kept.
            scaled = weights[light] if scale is None else weights[light] * scale[:, None, None]
            add_weighted(values.reshape(len(values), -1), np.ascontiguousarray(scaled), totals, threads)
            if seen:
                seen(row, values, scale)
            del values
            if progress:
                progress(plan.done(row, light))
        radiance[:, row] = totals[:count].reshape(count, -1, columns, 3)
        if variance is not None and noise is not None:
            constant = noise.constant * (irradiances**2).sum(1)[:, None, None]
            spread = totals[count:].reshape(-1, row.stop - row.start, columns, 3) if noise.slope > 0 else 0.0
            variance[:, row] = np.maximum(spread + constant, 0)
    for index in range(count):
        yield RadianceMap(radiance[index], None if variance is None else variance[index])


@dataclass(frozen=True)
class Plan:
    """The blocks in which a field is read: for each of the rows all of the lights."""

    rows: tuple[slice, ...]
    lights: tuple[slice, ...]

    def done(self, rows: slice, lights: slice) -> float:
        """The part that is done when this block is."""
        before, height, count = rows.start, self.rows[-1].stop, self.lights[-1].stop
        return (before + (rows.stop - rows.start) * lights.stop / count) / height


def planned(field: ReflectanceField, memory: int, *, len_totals: int, pictures: int = 1, extra: int = 0) -> Plan:
    """Blocks that fit into `memory` bytes beside the pictures and their sums.

    len_totals : sums in float64 a value of the block
    extra : further bytes a value of the block
    Raises ValueError where not even the smallest block fits: what is needed.
    """
    (height, columns), count = field.shape, len(field.lights)
    row_values = columns * 3
    held = height * row_values * 4 * pictures * (1 if field.noise is None else 2)
    if isinstance(field, Pictures) and field.values.flags.c_contiguous and extra == 0:
        return Plan((slice(0, height),), (slice(0, count),))
    chunk_lights, chunk_rows = getattr(field, "chunks", (1, 1))
    chunk_lights, chunk_rows = min(chunk_lights, count), min(chunk_rows, height)
    # A block is held as it is kept, while it is put together from its chunks, and for the sum as float32.
    value_bytes = getattr(field, "value_bytes", 8) + extra
    smallest = chunk_rows * row_values * (chunk_lights * value_bytes + 8 * len_totals)
    if held + smallest > memory:
        raise ValueError(
            f"memory is {memory / 1e6:.1f} MB; pictures of {columns}×{height} from {count} lights need at least "
            f"{np.ceil((held + smallest) / 1e5) / 10:.1f} MB"
        )
    free = memory - held
    # All rows at once where one chunk of lights then fits, for then each picture is read in one go.
    row_bytes = row_values * (chunk_lights * value_bytes + 8 * len_totals)
    rows = min(height, free // row_bytes // chunk_rows * chunk_rows)
    lights = (free - rows * row_values * 8 * len_totals) // (rows * row_values * value_bytes)
    lights = min(count, max(lights // chunk_lights, 1) * chunk_lights)
    return Plan(cut(height, rows), cut(count, lights))


def encoded(field: ReflectanceField, lights: slice, rows: slice) -> tuple[np.ndarray, np.ndarray | None]:
    """A block's values as they are kept (lights, rows, columns, 3), and what 1 stands for in each picture.

    The scale (lights,) float64 is None where values are kept as they are.
    """
    if isinstance(field, Pictures):
        scale = None if field.scale is None else field.scale[lights].astype(np.float64)
        return np.ascontiguousarray(field.values[lights, rows]), scale
    kept: Callable[[slice, slice], tuple[np.ndarray, np.ndarray | None]] | None = getattr(field, "encoded", None)
    return kept(lights, rows) if kept else (np.ascontiguousarray(field.block(lights, rows)), None)


def checked(lights: StageLights, irradiances: np.ndarray) -> np.ndarray:
    """Irradiances as float64; ValueError unless they are (N, 3) and finite."""
    given = np.asarray(irradiances, np.float64)
    if given.shape != (len(lights), 3):
        raise ValueError(f"irradiances are {given.shape}; expected one of three channels a light, {len(lights)}×3")
    if not np.isfinite(given).all():
        light = lights.names[int(np.argmin(np.isfinite(given).all(1)))]
        raise ValueError(f'the irradiance of the light "{light}" is not a finite number')
    return given


def labelled(field: ReflectanceField, labels: np.ndarray, irradiances: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Labels (H, W) int64 and weights (N, K, 3), checked."""
    numbers, given = np.asarray(labels), np.asarray(irradiances, np.float64)
    if numbers.shape != field.shape or numbers.dtype.kind not in "iu":
        raise ValueError(
            f"labels are {numbers.shape} {numbers.dtype}; expected integers for every pixel, {field.shape}"
        )
    if given.ndim != 3:
        raise ValueError(f"irradiances are {given.shape}; expected (labels, {len(field.lights)} lights, 3)")
    for each in given:
        checked(field.lights, each)
    if numbers.min() < 0 or numbers.max() >= len(given):
        raise ValueError(
            f"labels are {numbers.min()}…{numbers.max()}, but there are irradiances for 0…{len(given) - 1}"
        )
    return numbers.astype(np.int64), np.ascontiguousarray(np.moveaxis(given, 0, 1))


def cut(count: int, size: int) -> tuple[slice, ...]:
    """The numbers below `count` in runs of `size`, the last one shorter."""
    return tuple(slice(begin, min(begin + size, count)) for begin in range(0, count, size))

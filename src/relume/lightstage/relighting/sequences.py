"""Many lights at once: a map that turns, a probe video. The field is read once for as many pictures as memory holds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.relighting.relighting import MEMORY, Progress, checked, cut, summed


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
    together = pictures_at_once(field, memory)
    return _batches(field, given, together, threads, memory, progress)


def pictures_at_once(field: ReflectanceField, memory: int) -> int:
    """How many pictures of the field may be summed in one pass with so many bytes, at least 1.

    Half of the memory is for pictures and their sums, the other half for the field's blocks.
    """
    planes = 1 if field.noise is None else 2
    return max(1, memory // 2 // (field.shape[0] * field.shape[1] * 3 * 12 * planes))


def _batches(
    field: ReflectanceField,
    irradiances: np.ndarray,
    together: int,
    threads: int | None,
    memory: int,
    progress: Progress | None,
) -> Iterator[RadianceMap]:
    count = len(irradiances)
    for part in cut(count, together):

        def report(done: float, part: slice = part) -> None:
            if progress:
                progress((part.start + done * (part.stop - part.start)) / count)

        yield from summed(field, irradiances[part], threads=threads, memory=memory, progress=report)

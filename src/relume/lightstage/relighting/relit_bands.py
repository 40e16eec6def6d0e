"""Relighting by bands of rows: stages and sequences larger than memory, in this process or by a cluster's workers.

A band is summed under all lights of a run at once, so that its part of the field is read once for all frames. A pixel's
picture depends on that pixel alone (`specular_spikes`, `diffuse_fit`), but for what is found in all bands first: the
lights' strengths, where few lights need a fit. So bands are joined without a seam, to the bytes of the whole sum.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.cluster.attempt import threads as worker_threads
from relume.image.radiance import RadianceMap
from relume.lightstage.blocks import Cluster, Made, RowsOf, bands_of, by_bands
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.relighting.diffuse_fit import FIT_MAPS, DiffuseFit, fitted_rows, strengths_in
from relume.lightstage.relighting.relighting import (
    Progress,
    cut,
    pictures_at_once,
    weighted_sum_per_pixel,
    weighted_sums,
    within,
)
from relume.lightstage.relighting.specular_spikes import spiky_pictures


@dataclass(frozen=True)
class Means:
    """With what bands are worked on.

    cluster : whose workers do it; this process for None
    place : a folder or URL of the run's own that they see; None for memory
    memory : bytes for a band
    threads : of a task; a worker's share of the cores, or all cores, for None
    """

    cluster: Cluster
    place: Path | str | None
    memory: int
    threads: int | None = None


@dataclass(frozen=True, eq=False)
class BandFit:
    """A `DiffuseFit` whose maps lie with the bands they were made in.

    made : `FIT_MAPS` of every band
    strengths : as of `DiffuseFit`
    shape : rows and columns of the whole
    """

    made: Made
    strengths: np.ndarray
    shape: tuple[int, int]

    def of(self, rows: slice) -> DiffuseFit:
        """The fit of one of the bands."""
        number = self.made.bands.index(rows)
        lobes, constants, colours = (np.asarray(self.made.of(name, number)) for name in FIT_MAPS)
        return DiffuseFit(lobes, constants, colours, self.strengths, rows.start, self.shape)


@dataclass(frozen=True, eq=False)
class Irradiances:
    """What a field's lights give of each of K lights.

    smooth : (K, N, 3)
    barycentric : (K, N, 3), for pixels that are spikes; None where all pixels take the others
    added : (directions, irradiances) of what a fit adds to each (`diffuse_fit.terms`); () without a fit
    """

    smooth: np.ndarray
    barycentric: np.ndarray | None = None
    added: tuple[tuple[np.ndarray, np.ndarray], ...] = ()

    def part(self, which: slice) -> Irradiances:
        """Those of some of the lights."""
        spiky = None if self.barycentric is None else self.barycentric[which]
        return Irradiances(self.smooth[which], spiky, self.added[which])


@dataclass(frozen=True, eq=False)
class _Relit:
    """What every band of a relit field needs."""

    field: ReflectanceField
    given: Irradiances
    fit: BandFit | None
    labels: np.ndarray | None
    memory: int
    threads: int | None


@dataclass(frozen=True, eq=False)
class Frames:
    """The pictures of a sequence, as bands made them: "radiance" (K, rows, W, 3) and, where known, "variance".

    parts : of runs of frames
    firsts : the first frame of each
    """

    parts: tuple[Made, ...]
    firsts: tuple[int, ...]
    noisy: bool
    count: int

    def frame(self, index: int) -> RadianceMap:
        """One of the pictures, put together."""
        part = max(i for i, first in enumerate(self.firsts) if first <= index)
        made, place = self.parts[part], index - self.firsts[part]
        return RadianceMap(_joined(made, "radiance", place), _joined(made, "variance", place) if self.noisy else None)

    def __iter__(self) -> Iterator[RadianceMap]:
        # Nothing here holds a picture while the next is put together.
        return map(self.frame, range(self.count))


def fits_at_once(field: ReflectanceField, pictures: int, memory: int) -> bool:
    """Whether so many pictures are summed in one pass over the field with so much memory, spikes and all."""
    return pictures_at_once(field, memory) >= 2 * pictures + 2


def fit_in_bands(field: ReflectanceField, means: Means, progress: Progress | None = None) -> BandFit:
    """The Lambertian fit of each pixel (`diffuse_fit.fit_diffuse`); only its samples and the strengths are joined."""
    count, width = len(field.lights), field.shape[1]
    bands = bands_of(field, count * width * 3 * 4 * 2 + width * 3 * 16, means.memory)
    shared = field, means.memory
    made = by_bands(
        _fitted_band, shared, bands, cluster=means.cluster, place=means.place, progress=progress, memory=means.memory
    )
    return BandFit(made, strengths_in(made.each("sample"), field), field.shape)


def relit_in_bands(
    field: ReflectanceField,
    given: Irradiances,
    means: Means,
    fit: BandFit | None = None,
    labels: np.ndarray | None = None,
    progress: Progress | None = None,
) -> Frames:
    """The subject under each of the lights.

    fit : where `given.added` is to be lit
    labels : (H, W) integers, which of the lights shines on a pixel: there is one picture then
    Frames of which not even a chunk's rows fit into the memory together are made in several runs, each of which reads
    the field.
    """
    width, planes = field.shape[1], 1 if field.noise is None else 2
    chunk_rows = min(getattr(field, "chunks", (1, 1))[1], field.shape[0])
    a_picture = width * 36 * planes  # bytes a row, as `pictures_at_once` reckons
    count = len(given.smooth)
    together = max(1, (means.memory // 2 // (chunk_rows * a_picture) - 2) // 2)
    runs = [slice(0, count)] if labels is not None else cut(count, together)
    parts = []
    for run in runs:
        pictures = 1 if labels is not None else run.stop - run.start
        if fit is not None:
            bands = fit.made.bands  # its maps lie in these
        else:
            bands = bands_of(field, a_picture * (2 * pictures + 2), means.memory // 2)
        shared = _Relit(field, given.part(run), fit, labels, means.memory, means.threads)
        parts.append(
            by_bands(
                _relit_band,
                shared,
                bands,
                cluster=means.cluster,
                place=means.place if len(runs) == 1 or means.place is None else _numbered(means.place, len(parts)),
                progress=within(progress, run, count),
                memory=means.memory,
            )
        )
    return Frames(tuple(parts), tuple(run.start for run in runs), planes == 2, 1 if labels is not None else count)


def _fitted_band(shared: tuple[ReflectanceField, int], rows: slice) -> dict[str, np.ndarray]:
    field, memory = shared
    return fitted_rows(field, rows, memory)


def _relit_band(shared: _Relit, rows: slice) -> dict[str, np.ndarray]:
    """Radiance and variance of a band under all lights of the run."""
    part, given = RowsOf(shared.field, rows), shared.given
    threads = shared.threads if shared.threads is not None else worker_threads()
    # What comes of it is a twelfth of the memory at most, and is held once.
    count = 1 if shared.labels is not None else len(given.smooth)
    names = ("radiance",) if part.noise is None else ("radiance", "variance")
    made = {name: np.empty((count, *part.shape, 3), np.float32) for name in names}
    memory = shared.memory
    added = None
    if shared.fit is not None:
        fit = shared.fit.of(rows)
        added = (fit.lit(*terms) for terms in given.added)
    if shared.labels is not None:
        labels = shared.labels[rows]
        picture = weighted_sum_per_pixel(part, labels, given.smooth, memory=memory)
        for label, more in enumerate(added or ()):
            picture.radiance[labels == label] += more[labels == label]
        pictures: Iterable[RadianceMap] = [picture]
    elif given.barycentric is None:
        pictures = weighted_sums(part, given.smooth, threads=threads, memory=memory)
    else:
        pictures = spiky_pictures(part, given.smooth, given.barycentric, threads, memory, None, added)
    for index, picture in enumerate(pictures):
        for name in names:
            made[name][index] = getattr(picture, name)
    return made


def _joined(made: Made, name: str, index: int) -> np.ndarray:
    """One frame's rows, band after band; of the bands' files no more than one is held beside it."""
    first = made.of(name, 0)
    whole = np.empty((made.bands[-1].stop, *first.shape[2:]), first.dtype)
    for number, rows in enumerate(made.bands):
        whole[rows] = made.of(name, number)[index]
    return whole


def _numbered(place: Path | str, number: int) -> Path | str:
    """A folder in the run's own for one of several runs."""
    if isinstance(place, str):
        return f"{place}/{number}"
    folder = place / str(number)
    folder.mkdir(exist_ok=True)
    return folder

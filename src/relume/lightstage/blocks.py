"""A stage's work cut into pure blocks: groups of lights that are imported, bands of rows that are relit or measured.

A block reads its part of the field, works it out and writes its own region, whole or not at all; nothing that is as
large as a picture's light goes through a scheduler. Which blocks there are follows from the field and the memory alone,
never from the number of workers, and what they made is joined in the order of the rows. So one process, two or eight
workers give the same bytes.
"""

from __future__ import annotations

import io
import os
import pickle
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from relume.errors import OutputNotWritten, UnreadableFile
from relume.image.mapped_arrays import give_back_freed
from relume.lightstage.acquire.store_place import as_place, filesystem, is_url, reading, within_process
from relume.lightstage.field.field import Derived, ReflectanceField

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster as Connected

    Cluster = str | os.PathLike[str] | Client | Connected | None
else:
    Cluster = Any
"""Whose workers do the blocks, as `relume.cluster.run_tasks` takes it; None is this process."""
Progress = Callable[[float], None]
"""Called with the part that is done, 0…1."""
_INLINE = 1 << 20
"""Bytes of what all bands share, up to which they travel with each band and not in a file."""
BAND = 128 << 20
"""Bytes that a band of rows has of the field, as it is kept, about: long enough to make up for handing it over."""


def spread(
    function: Callable[[Any], Any],
    tasks: Sequence[Any],
    names: Sequence[str],
    cluster: Cluster,
    progress: Progress | None = None,
    *,
    paths: Sequence[str | os.PathLike[str]] = (),
    memory: int | None = None,
) -> list[Any]:
    """The results of a function of every task, in their order; in this process an error of one ends it.

    names : of the tasks, for people
    paths : that every worker has to see
    memory : bytes a task takes, which every worker has to have
    Raises Incomplete where some failed on a cluster: the others are done.
    """
    if cluster is None:
        results = []
        for done, task in enumerate(tasks):
            results.append(function(task))
            if progress:
                progress((done + 1) / len(tasks))
        return results
    from relume.cluster.tasks import run_tasks

    def report(done: int, failed: int, to_go: int, _left: float | None) -> None:
        if progress:
            progress((done + failed) / max(1, done + failed + to_go))

    return run_tasks(
        function, tasks, names=names, cluster=cluster, progress=report, paths=paths, memory=memory
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class RowsOf(Derived):
    """Some of a field's rows as a field of its own, which is asked for blocks of them.

    field : the whole
    rows : which
    held : their values (N, rows, W, 3), where they are in memory; read when they are asked for else
    """

    field: ReflectanceField
    rows: slice
    held: np.ndarray | None = None

    def read(self) -> RowsOf:
        """The same with its values in memory."""
        return RowsOf(self.field, self.rows, self.field.block(slice(0, len(self.lights)), self.rows))

    @property
    def shape(self) -> tuple[int, int]:
        return self.rows.stop - self.rows.start, self.field.shape[1]

    @property
    def camera(self) -> None:
        """None: its pictures are no camera's whole ones."""
        return None

    @property
    def chunks(self) -> tuple[int, int]:
        return getattr(self.field, "chunks", (1, 1))

    @property
    def value_bytes(self) -> int:
        return getattr(self.field, "value_bytes", 8)

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        if self.held is not None:
            return self.held[lights, rows]
        return self.field.block(lights, self._of_whole(rows))

    def encoded(self, lights: slice, rows: slice) -> tuple[np.ndarray, np.ndarray | None]:
        """Values as they are kept, and what 1 stands for, as `relighting.encoded` gives them for the whole."""
        from relume.lightstage.relighting.relighting import encoded

        return encoded(self.field, lights, self._of_whole(rows))

    def _of_whole(self, rows: slice) -> slice:
        return slice(self.rows.start + rows.start, self.rows.start + rows.stop)


def bands_of(field: ReflectanceField, row_bytes: int, memory: int) -> tuple[slice, ...]:
    """The rows in bands, of whole files of a store where they fit: the same ones whoever works on them.

    row_bytes : that a row takes while it is worked on
    memory : bytes for a band; a row or a chunk's rows are the least
    """
    height, width = field.shape
    kept = len(field.lights) * width * 3 * max(1, getattr(field, "value_bytes", 4) // 2)
    most = max(1, min(memory // row_bytes, max(1, BAND // kept)))
    for unit in (getattr(field, "file_rows", 1), getattr(field, "chunks", (1, 1))[1]):
        if most >= unit:
            most = most // unit * unit
            break
    return tuple(slice(begin, min(begin + most, height)) for begin in range(0, height, most))


def sum_of_lights(field: ReflectanceField) -> np.ndarray:
    """Brightness (H, W) under all lights at once, float64; read in bands of rows, summed light after light."""
    total, count = np.zeros(field.shape, np.float64), len(field.lights)
    deep = min(count, getattr(field, "chunks", (1, 1))[0])
    for rows in bands_of(field, deep * field.shape[1] * 3 * 8, 2 * BAND):
        for first in range(0, count, deep):
            for picture in field.block(slice(first, min(first + deep, count)), rows):
                total[rows] += picture.mean(axis=-1)
    return total


@dataclass(frozen=True, eq=False)
class Made:
    """What bands of rows made: arrays by name, (…, rows, W, channels) or one for each band.

    place : where they lie, a folder or URL; None where they are in memory
    bands : in the order of the rows
    held : of each band, where they are in memory
    """

    place: Path | str | None
    bands: tuple[slice, ...]
    held: tuple[dict[str, np.ndarray], ...] = ()

    def of(self, name: str, number: int) -> np.ndarray:
        """What a band made; None is never among it. Raises KeyError for what it did not make."""
        if self.place is None:
            return self.held[number][name]
        return _read_array(_file(self.place, name, self.bands[number]))

    def each(self, name: str) -> list[np.ndarray]:
        """What every band made."""
        return [self.of(name, number) for number in range(len(self.bands))]

    def whole(self, name: str, axis: int = 0) -> np.ndarray:
        """The bands' arrays as one, put together along their axis of rows, one band after another."""
        first, total = self.of(name, 0), self.bands[-1].stop
        shape = (*first.shape[:axis], total, *first.shape[axis + 1 :])
        result = np.empty(shape, first.dtype)
        for number, rows in enumerate(self.bands):
            result[(slice(None),) * axis + (rows,)] = self.of(name, number)
        return result


@dataclass(frozen=True, eq=False)
class _Band:
    """A band to be worked out: `function(shared, rows)` gives its arrays, which are written to `place`."""

    function: Callable[[Any, slice], dict[str, np.ndarray]]
    shared: Any
    place: Path | str
    rows: slice


def by_bands(
    function: Callable[[Any, slice], dict[str, np.ndarray]],
    shared: Any,
    bands: Sequence[slice],
    *,
    cluster: Cluster = None,
    place: Path | str | None = None,
    progress: Progress | None = None,
    memory: int | None = None,
    paths: Sequence[Path | str] = (),
) -> Made:
    """What a function of all that is shared and of a band of rows makes of each band.

    function : of a module, pure; its arrays are kept in memory where there is no place, else as files in it
    shared : what every band needs, such as the field: it has to be picklable where there is a place
    place : a folder, or URL, that all workers see (`scratch`); needed with a cluster
    memory : bytes that a band takes
    paths : that every worker has to see beside it
    Raises as `spread`.
    """
    names = [f"rows {rows.start}…{rows.stop - 1}" for rows in bands]
    if place is None:
        held = spread(lambda rows: function(shared, rows), bands, names, None, progress)
        return Made(None, tuple(bands), tuple(held))
    carried = shared
    if cluster is not None and not is_url(place):
        packed = pickle.dumps(shared, pickle.HIGHEST_PROTOCOL)
        if len(packed) > _INLINE:
            file = Path(place) / f"shared-{secrets.token_hex(4)}"
            file.write_bytes(packed)
            carried = _InFile(file)
    tasks = [_Band(function, carried, place, rows) for rows in bands]
    seen = [each for each in (place, *paths) if not is_url(each)]
    spread(_do_band, tasks, names, cluster, progress, paths=seen, memory=memory)
    return Made(place, tuple(bands))


@dataclass(frozen=True)
class _InFile:
    """What is shared, as it lies in a file of this run's own folder."""

    path: Path


@lru_cache(1)
def _loaded(path: Path) -> Any:
    # The folder is the run's own, which nobody else may write to (`scratch`).
    return pickle.loads(path.read_bytes())


def _do_band(band: _Band) -> None:
    shared = _loaded(band.shared.path) if isinstance(band.shared, _InFile) else band.shared
    for name, array in band.function(shared, band.rows).items():
        _write_array(_file(band.place, name, band.rows), array)
    # What the threads that decode chunks have freed would else stay with each of them.
    give_back_freed()


@contextmanager
def scratch_if(needed: bool, beside: str | os.PathLike[str] | None, cluster: Cluster) -> Iterator[Path | str | None]:
    """`scratch` where it is needed, which it is with a cluster; else None."""
    if not needed and cluster is None:
        yield None
        return
    with scratch(beside, cluster) as place:
        yield place


@contextmanager
def scratch(beside: str | os.PathLike[str] | None, cluster: Cluster) -> Iterator[Path | str]:
    """A new folder, which its owner alone may enter, for what blocks write; it is gone afterwards.

    beside : the folder or URL in which it is made; the system's temporary folder for None
    Raises OutputNotWritten where it cannot be made, ValueError for a URL that workers cannot see.
    """
    name = f".relume-{secrets.token_hex(6)}"
    if beside is not None and is_url(beside):
        if cluster is not None and within_process(beside):
            raise ValueError(f"{beside}: no worker sees the memory of this process; give a folder or another URL")
        place = f"{as_place(beside)}/{name}"
        try:
            yield place
        finally:
            system, path = filesystem(place)
            if system.exists(path):
                system.rm(path, recursive=True)
        return
    try:
        folder = Path(tempfile.mkdtemp(prefix=".relume-", dir=beside)).absolute()
    except OSError as error:
        raise OutputNotWritten(f"{beside}: no folder can be made there ({error.strerror}); choose another") from None
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _file(place: Path | str, name: str, rows: slice) -> Path | str:
    file = f"{name}_{rows.start:07d}.npy"
    return f"{place}/{file}" if is_url(place) else Path(place) / file


def _write_array(file: Path | str, array: np.ndarray) -> None:
    """Write an array whole or not at all; raises OutputNotWritten."""
    try:
        if isinstance(file, str):
            buffer = io.BytesIO()
            np.save(buffer, array)
            with reading(file):
                system, path = filesystem(file)
                system.pipe_file(path, buffer.getvalue())
            return
        partial = file.with_suffix(f".{secrets.token_hex(4)}.partial")
        with partial.open("wb") as stream:
            np.save(stream, array)
        partial.replace(file)
    except (OSError, UnreadableFile) as error:
        words = getattr(error, "strerror", None) or str(error)
        raise OutputNotWritten(f"{file}: cannot be written: {words}") from None


def _read_array(file: Path | str) -> np.ndarray:
    """An array that a block wrote, from a folder without reading what is not looked at."""
    if isinstance(file, str):
        with reading(file):
            system, path = filesystem(file)
            return np.load(io.BytesIO(system.cat_file(path)))
    return np.load(file, mmap_mode="r")

"""One picture by the workers of a cluster: parts of it are traced there and come back in files, to be added up here.

A part is a whole pass, a share of the pixels of one, or rows of a picture. What a part holds does not depend on who
traces it nor on how many parts there are, and parts are taken in their order, not in that of their arrival: so the sums
have the bits of one process. What all parts share lies in one file, which each worker reads and makes ready once.
"""

from __future__ import annotations

import pickle
import secrets
import shutil
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from relume.cluster.connection import connect
from relume.cluster.renaming import remove
from relume.cluster.tally import TaskProgress
from relume.cluster.tasks import run_tasks
from relume.errors import OutputNotWritten
from relume.image.files import replacing

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster

Planes = Mapping[str, np.ndarray]
AHEAD = 2
"""Passes a worker that are traced before the first of them is added up: one more than it works on."""
_FOLDER = ".relume-parts-"


class Divisible(Protocol):
    """What can be traced in parts: a value that pickles."""

    def ready(self) -> Callable[[Any], Planes]:
        """Make it ready in this process, once; what comes back traces a part that is named by a small value."""
        ...


@dataclass(frozen=True, eq=False)
class PassWorkers:
    """Workers for the parts of a picture.

    cluster : as `run_tasks` takes it
    folder : where parts lie between a worker and here; one that all see, and that this process alone uses
    memory : bytes that a part takes; workers with less are refused before anything starts
    """

    cluster: str | Client | Cluster
    folder: Path
    memory: int | None = None

    @contextmanager
    def sharing(self, divisible: Divisible) -> Iterator[Parts]:
        """Give the workers what its parts share, for the block. Raises OutputNotWritten, ClusterUnusable."""
        # What a process that was killed left there.
        for left in self.folder.glob(f"{_FOLDER}*"):
            shutil.rmtree(left, ignore_errors=True)
        folder = self.folder.absolute() / f"{_FOLDER}{secrets.token_hex(4)}"
        try:
            folder.mkdir(parents=True)
        except OSError as error:
            raise OutputNotWritten(f"{folder}: cannot be made ({error.strerror}); choose another -o") from None
        try:
            with connect(self.cluster) as connected:
                with replacing(folder / "shared.pickle") as temporary, open(temporary, "wb") as file:
                    pickle.dump(divisible, file)
                yield Parts(replace(connected, progress=None), folder, self.memory)
        finally:
            shutil.rmtree(folder, ignore_errors=True)


class Parts:
    """Parts of one picture, asked of workers in rounds."""

    def __init__(self, cluster: Cluster, folder: Path, memory: int | None) -> None:
        self.cluster, self.folder, self.memory = cluster, folder, memory
        self.asked = 0

    @property
    def workers(self) -> int:
        """How many there are now."""
        return max(1, len(self.cluster.client.scheduler_info(n_workers=-1).get("workers", {})))

    def traced(
        self, parts: Sequence[Any], names: Sequence[str], progress: TaskProgress | None = None
    ) -> list[Path]:  # fmt: skip
        """The files that hold these parts, in their order; for `taken`. Raises Incomplete where one failed."""
        shared = self.folder / "shared.pickle"
        targets = [self.folder / f"{self.asked + index:06d}.npz" for index in range(len(parts))]
        # Workers are looked at once: those that join later, by every task.
        first = {"memory": self.memory, "paths": [shared]} if self.asked == 0 else {}
        self.asked += len(parts)
        tasks = [PartTask(shared, part, target) for part, target in zip(parts, targets, strict=True)]
        run_tasks(_part_traced, tasks, names=names, cluster=self.cluster, progress=progress, **first)
        return targets

    def taken(self, path: Path) -> dict[str, np.ndarray]:
        """The planes in such a file, which is removed."""
        try:
            with np.load(path) as file:
                planes = {name: file[name] for name in file.files}
        except OSError as error:
            raise OutputNotWritten(
                f"{path}: written by a worker, and not seen from here ({error.strerror or error}); give all machines "
                "one folder"
            ) from None
        remove(path)
        return planes

    def kept(self, name: str, array: np.ndarray) -> Path:
        """A file with an array that the parts of one round share.

        No two rounds have one name: over a network a worker may for a while see what a file held before.
        """
        path = self.folder / f"{name}_{self.asked:06d}.npy"
        with replacing(path) as temporary, open(temporary, "wb") as file:
            np.save(file, array)
        return path


class WholePasses:
    """Passes that depend on their seeds alone, given in turn and traced a round ahead.

    seeds : of all of them, in their order
    """

    def __init__(self, parts: Parts, seeds: Sequence[int]) -> None:
        self.parts, self.seeds, self.places = parts, seeds, {seed: index for index, seed in enumerate(seeds)}
        self.ahead: dict[int, Path] = {}

    def __call__(self, seed: int) -> dict[str, np.ndarray]:
        """The planes of one; those after it are traced with it."""
        index = self.places[seed]
        if index not in self.ahead:
            these = range(index, min(index + AHEAD * self.parts.workers, len(self.seeds)))
            files = self.parts.traced([self.seeds[each] for each in these], [f"pass {each + 1}" for each in these])
            self.ahead = dict(zip(these, files, strict=True))
        return self.parts.taken(self.ahead.pop(index))


@dataclass(frozen=True)
class PartTask:
    """One part for a worker.

    shared : the file of what the parts share, of a folder that no other picture ever has
    part : which
    target : the file for its planes
    """

    shared: Path
    part: Any
    target: Path


def _part_traced(task: PartTask) -> None:
    planes = _ready(task.shared)(task.part)
    with replacing(task.target) as temporary, open(temporary, "wb") as file:
        packed: dict[str, Any] = dict(planes)
        np.savez(file, **packed)


@lru_cache(maxsize=1)
def _ready(shared: Path) -> Callable[[Any], Planes]:
    """What the parts share, made ready.

    What that warns of, the process that gives the tasks has warned of: it made the same ready for itself.
    """
    with open(shared, "rb") as file:
        divisible: Divisible = pickle.load(file)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return divisible.ready()

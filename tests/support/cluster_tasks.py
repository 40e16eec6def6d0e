"""Functions that workers of a cluster are given in tests, and workers started by hand in processes of their own."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SUPPORT = Path(__file__).parent
SOURCE = SUPPORT.parents[1] / "src"
Task = tuple[str, int]


def noise(task: Task) -> bytes:
    """A picture of noise of the task's own seed, blurred by relume's kernels."""
    from relume.image.blurring import motion_blurred
    from relume.image.radiance import RadianceMap

    picture = RadianceMap(np.random.default_rng(task[1]).random((24, 32, 3), np.float32))
    return motion_blurred(picture, 5.0, 0.3).radiance.tobytes()


def count(task: Task) -> int:
    """Leave a file for every time that the task was begun."""
    folder, number = task
    Path(folder, f"{number}.{os.getpid()}.{time.time_ns()}").touch()
    return os.getpid()


def slow(task: Task) -> int:
    """Half a second of work that leaves a file as it begins."""
    count(task)
    time.sleep(0.5)
    return task[1]


def dies_first(task: Task) -> int:
    """Task 3 kills its worker when it is begun for the first time, as kill -9 does."""
    slow(task)
    if task[1] == 3 and len(begun(task[0], 3)) == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return task[1]


def always_dies(task: Task) -> int:
    """Task 1 kills whatever worker it is given to."""
    if task[1] == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return task[1]


def fails(task: Task) -> int:
    """Task 2 fails at every place, task 4 by its input, task 5 but once."""
    folder, number = task
    count(task)
    warnings.warn("the light is doubtful", UserWarning, stacklevel=1)
    if number == 2:
        raise RuntimeError("nothing works here")
    if number == 4:
        raise ValueError("4 is not a number of photographs")
    if number == 5 and len(begun(folder, 5)) == 1:
        raise OSError(28, "No space left on device", "/scratch/5.exr")
    return number


def once(task: tuple[str, int]) -> int:
    """A task that writes a file, and is not done again where that is there."""
    from relume.cluster.records import key_of, record, recorded

    target = Path(task[0], f"{task[1]}.result")
    key = key_of([], task)
    if recorded(target, key) is None:
        slow(task)
        target.write_text("done")
        record(target, key, [])
    return task[1]


@dataclass(frozen=True)
class Numbered:
    """Passes of noise for `PassWorkers`, by their seeds; each second one comes back before the one it follows.

    folder : where a file is left for every time that one is begun
    dies : whether the worker of the second dies as it is begun for the first time
    fails : the seed of one that fails
    """

    folder: str
    seeds: tuple[int, ...]
    dies: bool = False
    fails: int | None = None

    def ready(self) -> Callable[[int], dict[str, np.ndarray]]:
        """The function of a seed."""
        count((self.folder, 10**6))
        return self.trace

    def trace(self, seed: int) -> dict[str, np.ndarray]:
        """One pass."""
        place = self.seeds.index(seed)
        count((self.folder, place))
        if self.dies and place == 1 and len(begun(self.folder, 1)) == 1:
            os.kill(os.getpid(), signal.SIGKILL)
        if seed == self.fails:
            raise ValueError("nothing is seen in this pass")
        time.sleep(0.1 * (place % 2 == 0))
        return {"radiance": np.random.default_rng(seed).random((40, 50, 3)).astype(np.float32)}


def begun(folder: str | Path, number: int) -> list[Path]:
    """The files that a task left, one for every time it was begun."""
    return sorted(Path(folder).glob(f"{number}.*.*"))


def in_main_thread(task: Task) -> bool:
    """Whether a task runs in its process's main thread."""
    import threading

    return threading.current_thread() is threading.main_thread()


def environment(source: Path = SOURCE) -> dict[str, str]:
    """The environment of a process that finds relume and these functions."""
    return {**os.environ, "PYTHONPATH": f"{source}{os.pathsep}{SUPPORT}"}


def free_port() -> int:
    with socket.socket() as each:
        each.bind(("127.0.0.1", 0))
        return each.getsockname()[1]


class ByHand:
    """A scheduler and workers, each a process as `dask scheduler` and `dask worker` start it."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        self.address = f"tcp://127.0.0.1:{self.port}"
        self.processes: list[subprocess.Popen[bytes]] = []
        self.scheduler = self.start_scheduler()

    def start_scheduler(self) -> subprocess.Popen[bytes]:
        words = ["scheduler", "--host", "127.0.0.1", "--port", str(self.port), "--no-dashboard"]
        self.scheduler = self._start(*words, "--scheduler-file", str(self.folder / "scheduler.json"))
        self._until(self._listens)
        return self.scheduler

    def start_worker(self, *, memory: str = "0", source: Path = SOURCE) -> subprocess.Popen[bytes]:
        words = ["worker", self.address, "--nthreads", "1", "--no-nanny", "--memory-limit", memory, "--no-dashboard"]
        return self._start(*words, "--local-directory", str(self.folder / "scratch"), source=source)

    def _start(self, *words: str, source: Path = SOURCE) -> subprocess.Popen[bytes]:
        with open(self.folder / "log.txt", "ab") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]],
                env=environment(source), cwd=self.folder, stdout=log, stderr=log,
            )  # fmt: skip
        self.processes.append(process)
        return process

    def _listens(self) -> bool:
        with socket.socket() as each:
            return each.connect_ex(("127.0.0.1", self.port)) == 0

    @staticmethod
    def _until(true: Callable[[], bool], seconds: float = 60.0) -> None:
        end = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < end, "it did not come"
            time.sleep(0.05)

    def end(self) -> None:
        for process in self.processes:
            process.kill()
            process.wait()


@contextmanager
def by_hand(folder: Path, workers: int) -> Iterator[ByHand]:
    """A scheduler with so many workers, all of them processes that end with the block."""
    cluster = ByHand(folder)
    try:
        for _ in range(workers):
            cluster.start_worker()
        yield cluster
    finally:
        cluster.end()

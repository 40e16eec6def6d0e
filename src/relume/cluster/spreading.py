"""Tasks given to the workers of a scheduler, a few ahead at a time, each again elsewhere where it failed.

Dask itself gives the task of a worker that died to another. It cannot know which task killed a worker and which only
waited there, and gives up on either after four deaths; such a task is given once more here, alone and at the end.
"""

from __future__ import annotations

import queue
import secrets
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from relume.cluster.attempt import Outcome, reason
from relume.cluster.program import program
from relume.cluster.tally import Tally
from relume.cluster.workers import share_cores

if TYPE_CHECKING:
    from distributed import Future

_LOOK = 2.0  # s between looks at which workers there are
_QUICK = 0.1  # s; of quicker tasks more are given ahead
_AHEAD = 32
LOST = 15.0  # s without a scheduler
_ALONE = 600.0  # s without any worker
UNFIT = 20
"""How often a task may meet a worker that is not fit for it."""


def _carrier() -> Callable[..., Any]:
    """What is sent with every task. It travels as code, since it is defined in another function: a scheduler needs no
    relume, and a worker without it says so, where it would else go down over a message that it cannot read.
    """

    def relume_task(packed: bytes, program: str, memory: int | None) -> Any:
        try:
            from relume.cluster.attempt import attempt_packed
        except ImportError as error:
            from distributed import get_worker

            return get_worker().address, f"a worker has no relume that can be used ({error}); install {program} there"
        return attempt_packed(packed, program, memory)

    return relume_task


class Spreading:
    """One run of many tasks on a cluster."""

    def __init__(
        self, client: Any, function: Callable[[Any], Any], tasks: Sequence[Any], tries: int, memory: int | None,
        tally: Tally,
    ) -> None:  # fmt: skip
        self.client, self.function, self.tasks, self.tries, self.tally = client, function, tasks, tries, tally
        self.carried, self.needs = _carrier(), (program(), memory)
        self.run_name = f"{getattr(function, '__name__', 'task').strip('_')}-{secrets.token_hex(4)}"
        self.waiting = deque(range(len(tasks)))
        self.suspects: deque[int] = deque()
        self.alone: int | None = None
        self.flying: dict[int, Future] = {}
        self.landed: queue.SimpleQueue[tuple[int, Future]] = queue.SimpleQueue()
        self.tried: dict[int, list[str]] = {}
        self.given: dict[int, int] = {}
        self.unfit: set[str] = set()
        self.workers: dict[str, int] = {}
        self.looked, self.seen_scheduler, self.seen_worker = 0.0, time.monotonic(), time.monotonic()

    def run(self) -> None:
        """Until every task is settled in the tally."""
        try:
            while len(self.tally.outcomes) < len(self.tasks):
                self._look()
                self._give()
                self._take()
        finally:
            left = list(self.flying.values())
            self.flying.clear()
            if left:
                with suppress(Exception):
                    self.client.cancel(left, force=True)

    def _look(self) -> None:
        """Which workers there are; settles all that is left where there is nobody to do it."""
        now = time.monotonic()
        if now - self.looked < _LOOK:
            return
        self.looked = now
        if self.client.status == "running":
            with suppress(OSError, TimeoutError):
                workers = self.client.nthreads()
                self.seen_scheduler = now
                if workers.keys() - self.workers.keys() and self.workers:
                    with suppress(Exception):  # a worker that is going as it is asked
                        share_cores(self.client)
                self.workers = workers
        if self.workers:
            self.seen_worker = now
        if now - self.seen_scheduler > LOST or self.client.status == "closed":
            self._give_up("not done: the scheduler was lost")
        elif now - self.seen_worker > _ALONE:
            self._give_up(f"not done: no worker was left for {_ALONE / 60:.0f} minutes")

    def _give_up(self, why: str) -> None:
        for index in range(len(self.tasks)):
            if index not in self.tally.outcomes:
                self.tally.settle(index, Outcome(failed=why))

    def _give(self) -> None:
        """Give as many tasks as keep every worker busy; suspects one by one when nothing else is left."""
        if self.client.status != "running":
            return
        threads = sum(self.workers.values())
        took = (time.monotonic() - self.tally.begun) * max(1, threads) / max(1, len(self.tally.outcomes))
        most = 2 * threads + (_AHEAD if self.tally.outcomes and took < _QUICK else 1)
        while self.waiting and len(self.flying) < most:
            self._submit(self.waiting.popleft())
        if not self.waiting and not self.flying and self.suspects:
            self.alone = self.suspects.popleft()
            self._submit(self.alone)

    def _submit(self, index: int) -> None:
        self.given[index] = count = self.given.get(index, 0) + 1
        avoided = self.unfit | set(self.tried.get(index, ()))
        others = [address for address in self.workers if address not in avoided] if avoided else []
        future = self.client.submit(
            self.carried, self._packed(index), *self.needs, key=(self.run_name, index, count), pure=False,
            workers=others or None, allow_other_workers=bool(others),
        )  # fmt: skip
        self.flying[index] = future
        future.add_done_callback(lambda done: self.landed.put((index, done)))

    def _packed(self, index: int) -> bytes:
        from distributed.protocol.pickle import dumps

        try:
            return dumps((self.function, self.tasks[index]))
        except Exception as error:
            raise ValueError(f"a task cannot be sent to a worker: {reason(error)}; give values that pickle") from error

    def _take(self) -> None:
        """Settle what came back, or wait for it a moment."""
        try:
            landed = [self.landed.get(timeout=0.2)]
        except queue.Empty:
            return
        with suppress(queue.Empty):
            while True:
                landed.append(self.landed.get_nowait())
        landed = [(index, future) for index, future in landed if self.flying.get(index) is future]
        finished = [(index, future) for index, future in landed if future.status == "finished"]
        # All that is there in one message; a result whose worker died since then is done again, and awaited.
        try:
            outcomes = self.client.gather([future for _, future in finished])
        except Exception as error:
            outcomes = [Outcome(failed=reason(error), again=True)] * len(finished)
        for (index, _), outcome in zip(finished, outcomes, strict=True):
            if isinstance(outcome, tuple):
                outcome = Outcome(failed=outcome[1], again=True, unfit=True, worker=outcome[0])
            self._settle(index, outcome)
        for index, future in landed:
            if index in self.flying:
                self._failed(index, future)

    def _failed(self, index: int, future: Future) -> None:
        """A task without an outcome: its worker died, or could not even begin."""
        from distributed import KilledWorker

        if future.status != "error":  # cancelled, or lost: the scheduler went
            del self.flying[index]
            self.waiting.append(index)
            time.sleep(0.05)
            return
        error: Any = future.exception(timeout=10)
        if not isinstance(error, KilledWorker):
            self._settle(index, Outcome(failed=reason(error) if error else "failed", again=True))
        elif index == self.alone:
            self._settle(index, Outcome(failed="the worker died in this task, every time: it may be out of memory"))
        else:
            del self.flying[index]
            self.suspects.append(index)

    def _settle(self, index: int, outcome: Outcome) -> None:
        del self.flying[index]
        tried = self.tried.setdefault(index, [])
        if outcome.unfit:
            self.unfit.add(outcome.worker)
            again = self.given[index] < UNFIT
        else:
            tried.append(outcome.worker)
            again = outcome.again and len(tried) < self.tries
        if outcome.failed and again:
            self.waiting.append(index)
        else:
            self.tally.settle(index, outcome)

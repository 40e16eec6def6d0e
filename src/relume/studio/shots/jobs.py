"""Jobs in a worker process: one at a time, the latest wins, and a worker that dies takes nothing with it."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from relume.studio.shots.worker import GO_ON, HOLD, JOBS, READY, work

GRACE = 8.0
"""Seconds that a job has to stop at a safe place before its process is ended: a chunk of a render takes as long."""
LOOKED_AT_EVERY = 0.1
SHOWN_STEPS = ("first picture", "around the pointer")
"""Steps that say that there is another picture to be shown."""
About = tuple[float, float] | None


class Jobs:
    """The jobs of one studio; safe to use from several threads.

    state : of the last job, for JSON: its kind, number, status ("waiting", "running", "paused", "stopping", "done",
        "failed", "stopped"), step, share of it, seconds so far, result or the line that says what went wrong
    changes : how often that changed
    measured : what the last job that looked at plate and light has found of them; None before
    merged : the same of the last job that merged the photographs
    """

    def __init__(self, scratch: Path) -> None:
        self.changes = 0
        self.measured: dict[str, Any] | None = None
        self.merged: dict[str, Any] | None = None
        self.state: dict[str, Any] = {"status": "none", "number": 0}
        self._scratch = scratch
        self._wanted: tuple[str, Path, Path, About] | None = None
        self._stop = False
        self._closed = False
        self._wake = threading.Condition()
        self._worker: tuple[Any, Connection] | None = None
        self._ready = False
        self._thread = threading.Thread(target=self._run, name="relume jobs", daemon=True)
        self._thread.start()

    @property
    def seen(self) -> tuple[object, ...]:
        """What a window shows of the job at once: that it begins, that there is a picture of it, that it ends."""
        state = self.state
        return state["number"], state["status"], sum(each in SHOWN_STEPS for each in state.get("steps", ()))

    @property
    def process(self) -> int | None:
        """The worker's process id; None while there is none."""
        return None if self._worker is None else self._worker[0].pid

    def start(self, kind: str, shot: Path, out: Path, about: About = None) -> int:
        """Do a job in place of the one that runs; returns its number. Raises ValueError for a kind there is none of.

        about : the place that is looked at, whose surroundings come first, as `rl.insert` has it
        """
        if kind not in JOBS:
            raise ValueError(f'there is no job "{kind[:40]}"; there are {", ".join(JOBS)}')
        with self._wake:
            self._wanted = kind, shot, out, about
            self._stop = self.state["status"] in ("running", "stopping", "paused")
            number = self.state["number"] + 1
            if not self._stop:
                self._say(status="waiting", kind=kind, number=number)
            self._wake.notify_all()
            return number

    def stop(self) -> None:
        """Stop the job that runs; what it kept serves the next."""
        with self._wake:
            self._wanted = None
            self._stop = True
            if self.state["status"] == "waiting":  # and will not begin
                self._say(status="stopped")
            self._wake.notify_all()

    def pause(self, paused: bool) -> None:
        """Hold the job that runs, from its next report on, or let it go on; the processor is free meanwhile."""
        with self._wake:
            if self._worker is None or self.state["status"] != ("running" if paused else "paused"):
                return
            with suppress(OSError):  # of a worker that died just now, which is said elsewhere
                self._worker[1].send(HOLD if paused else GO_ON)
            self._say(status="paused" if paused else "running")

    def close(self) -> None:
        """Stop all, and wait for it."""
        with self._wake:
            self._closed = self._stop = True
            self._wanted = None
            self._wake.notify_all()
        self._thread.join(timeout=GRACE + 5)

    def _run(self) -> None:
        number = 0
        while True:
            with self._wake:
                while self._wanted is None and not self._closed:
                    self._wake.wait()
                if self._closed:
                    break
                assert self._wanted is not None
                (kind, shot, out, about), self._wanted, self._stop = self._wanted, None, False
                number = max(number + 1, self.state["number"])
                self._say(
                    status="running", kind=kind, number=number, step="", share=0.0, steps=[], error=None, result=None
                )
            try:
                self._do(kind, shot, out, about)
            except OSError as error:
                self._say(status="failed", error=f"the worker process cannot be started: {error.strerror}")
                self._end()
        self._end()

    def _do(self, kind: str, shot: Path, out: Path, about: About) -> None:
        """One job to its end, whatever that is."""
        process, pipe = self._worker or self._started()
        begun, asked_to_stop = time.monotonic(), None
        try:
            pipe.send((kind, str(shot), str(out), str(self._scratch), about))
            while True:
                # What it says, as long as it lives.
                if pipe.poll(LOOKED_AT_EVERY):
                    said = pipe.recv()
                    if said == READY:
                        self._ready = True
                        continue
                    if said[0] == "step":
                        self._stepped(said[1], said[2], begun)
                        continue
                    self._finished(said, begun)
                    return
                if not process.is_alive() and not pipe.poll(0):
                    raise EOFError
                # A wish to stop is a signal first, and the process's end where that does not help, or comes too early.
                if self._stop and not self._ready:
                    self._end()
                    self._finished(("stopped",), begun)
                    return
                if self._stop and asked_to_stop is None:
                    asked_to_stop = time.monotonic()
                    with self._wake, suppress(OSError):
                        held = self.state["status"] == "paused"
                        self._say(status="stopping")
                        os.kill(process.pid, signal.SIGINT)
                        if held:  # what waits may be another thread than the one that the signal reaches
                            pipe.send(GO_ON)
                elif asked_to_stop is not None and time.monotonic() - asked_to_stop > GRACE:
                    self._end()
                    self._finished(("stopped",), begun)
                    return
        except (EOFError, OSError):
            process.join(timeout=2)
            code = process.exitcode
            self._end()
            why = f"by signal {-code}" if code is not None and code < 0 else f"with code {code}"
            line = f"the worker process ended {why}, perhaps for want of memory; nothing is lost: start the job again"
            self._finished(("stopped",) if self._stop else ("failed", line), begun)

    def _stepped(self, step: str, share: float, begun: float) -> None:
        steps = [each for each in self.state["steps"] if each != step] + [step]
        self._say(step=step, share=round(float(share), 4), seconds=round(time.monotonic() - begun, 1), steps=steps)

    def _finished(self, said: tuple[Any, ...], begun: float) -> None:
        facts = {"result": said[1]} if said[0] == "done" else {"error": said[1]} if said[0] == "failed" else {}
        if said[0] == "done" and "camera" in said[1]:
            self.measured = said[1]
        if said[0] == "done" and "brackets" in said[1]:
            self.merged, facts = said[1], {"result": None}
        self._say(status=said[0], seconds=round(time.monotonic() - begun, 1), **facts)

    def _say(self, **facts: Any) -> None:
        with self._wake:
            self.state = {**self.state, **facts}
            self.changes += 1

    def _started(self) -> tuple[Any, Connection]:
        """A new worker: spawned, since a fork of a server with threads may hold their locks."""
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        process = context.Process(target=work, args=(there,), name="relume studio worker", daemon=True)
        process.start()
        there.close()
        self._worker, self._ready = (process, here), False
        return self._worker

    def _end(self) -> None:
        if self._worker is None:
            return
        process, pipe = self._worker
        self._worker = None
        pipe.close()
        process.join(timeout=0.5 if self._ready else 0)
        if process.is_alive():
            process.kill()
            process.join(timeout=5)

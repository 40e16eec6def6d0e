"""Ctrl-C and requests to end during a long render: the first is kept until a pass is done, the second acts at once."""

from __future__ import annotations

import signal
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

ENDING = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
"""Signals that ask a program to end, of which each system has some: SIGHUP comes when a terminal or a connection is
closed, SIGBREAK is Windows' Ctrl-Break."""
HANGUP = "SIGHUP"
"""A terminal that is closed sends it twice, by its shell and by the system, and so may a session that ends after a
SIGTERM: after another signal it says nothing new, and is nobody's impatience."""
SECOND = 0.3
"""Seconds that a second signal leaves for files to be tidied away before the process ends, where it is forced to."""


@dataclass(frozen=True)
class HardStop:
    """How a program that owns its process is ended while native code keeps Python from doing so.

    end : called with the signal's number and what to say, or "" after a second signal; it ends the process at
        once, with `os._exit`, and is called in another thread than the main one
    after : seconds that the pass under way may still take after the first signal; 4 leaves one to write what was done
    """

    end: Callable[[int, str], None]
    after: float = 4.0


class StopFlag:
    """Whether a signal asked for the end: its number, or None."""

    def __init__(self) -> None:
        self.signal: int | None = None


@contextmanager
def interruptible(*, force: HardStop | None = None, save: Callable[[], None] = lambda: None) -> Iterator[StopFlag]:
    """Within the block the first signal to end, such as Ctrl-C, is only noted; a second raises KeyboardInterrupt.

    force : a renderer's native code keeps Python from acting on a signal until its pass is done. Where this is given, a
        thread ends the process if the block has not ended so many seconds after the first signal, or 0.3 seconds after
        the second
    save : called before the process is ended after the first signal, in that thread

    A terminal that closes sends its signal twice: only as the first does it count.
    Outside the main thread, and for signals that the process ignores, nothing changes. The handlers that
    were there come back afterwards.
    """
    asked = StopFlag()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return

    def noted(number: int, frame: FrameType | None) -> None:
        if asked.signal is None:
            asked.signal = number
        elif not _hangs_up(number):
            raise KeyboardInterrupt

    known = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
    numbers = [n for n in known if signal.getsignal(n) not in (signal.SIG_IGN, None)]
    before = {number: signal.signal(number, noted) for number in numbers}
    watch = _Watch(force, save, numbers) if force is not None else None
    try:
        yield asked
    finally:
        if watch is not None:
            watch.end()
        for number, handler in before.items():
            signal.signal(number, handler)


def _hangs_up(number: int) -> bool:
    return number == getattr(signal, HANGUP, None)


class _Watch:
    """A thread that hears of signals at once, from the pipe that C code writes their numbers to."""

    def __init__(self, force: HardStop, save: Callable[[], None], numbers: list[signal.Signals]) -> None:
        self.force, self.save, self.numbers = force, save, {int(n) for n in numbers}
        self.read, self.write = socket.socketpair()
        self.write.setblocking(False)
        self.before = signal.set_wakeup_fd(self.write.fileno(), warn_on_full_buffer=False)
        self.over = threading.Event()
        self.thread = threading.Thread(target=self._run, name="relume interruption", daemon=True)
        self.thread.start()

    def end(self) -> None:
        self.over.set()
        signal.set_wakeup_fd(self.before)
        self.write.close()
        self.thread.join()
        self.read.close()

    def _run(self) -> None:
        first = self._next(None)
        if first is None:
            return
        second = self._next(self.force.after, impatient=True)
        if second is None:
            if not self.over.is_set():
                self._leave(first)
        elif not self.over.wait(SECOND):
            self.force.end(second, "")

    def _next(self, seconds: float | None, *, impatient: bool = False) -> int | None:
        """The next signal's number; None when the block ends or the time is over.

        impatient : pass over those that are sent twice by themselves
        """
        until = None if seconds is None else time.monotonic() + seconds
        try:
            while True:
                self.read.settimeout(None if until is None else max(until - time.monotonic(), 1e-3))
                data = self.read.recv(1)
                if not data:
                    return None
                if data[0] in self.numbers and not (impatient and _hangs_up(data[0])):
                    return data[0]
        except TimeoutError:
            return None

    def _leave(self, number: int) -> None:
        try:
            self.save()
            words = (
                "interrupted; the pass under way was given up, those before it are kept; give the same command again"
            )
        except Exception as error:
            words = f"interrupted, and what was done could not be kept: {error}"
        if not self.over.is_set():
            self.force.end(number, words)

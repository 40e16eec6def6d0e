"""A clock that ends a process in which no test begins for long, and says where it stands."""

from __future__ import annotations

import faulthandler
import time

import pytest


class HangClock:
    """The same as pytest's `faulthandler_timeout`, which starts and ends a thread for each test.

    That takes a millisecond where both cores are busy. This one is set anew once a minute.
    """

    def __init__(self, stderr: int, seconds: float = 900, every: float = 60) -> None:
        self.stderr, self.seconds, self.every = stderr, seconds, every
        self.next = float("-inf")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self) -> None:
        if time.monotonic() >= self.next:
            faulthandler.dump_traceback_later(self.seconds + self.every, exit=True, file=self.stderr)
            self.next = time.monotonic() + self.every

    @pytest.hookimpl(trylast=True)
    def pytest_exception_interact(self) -> None:
        # Pytest stops the clock at each failure, before a debugger may wait for somebody.
        self.next = float("-inf")

    def pytest_sessionfinish(self) -> None:
        faulthandler.cancel_dump_traceback_later()

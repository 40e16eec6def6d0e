"""The guard of tests against servers that hang: what each thread did is shown, not waited for."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from types import SimpleNamespace

import pytest

import hanging
from serving import DUMPING, first_line

HANGING = DUMPING + "import threading; stuck = threading.Event()\ndef wait_for_ever():\n    stuck.wait()\n"


def process_of(code: str) -> subprocess.Popen[str]:
    python, environment = [sys.executable, "-c", code], {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.Popen(python, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_a_process_that_says_nothing_is_ended_and_its_threads_are_shown():
    process, begun = process_of(HANGING + "wait_for_ever()"), time.monotonic()
    with pytest.raises(AssertionError, match=r"most recent call first(.|\n)*in wait_for_ever"):
        first_line(process, 2.0)
    assert process.wait(10) < 0 and time.monotonic() - begun < 30


def test_a_process_that_speaks_is_left_alone():
    process = process_of(HANGING + "print('ready', flush=True); stuck.wait()")
    assert first_line(process, 60.0) == "ready\n"
    time.sleep(0.1)
    assert process.poll() is None
    process.kill()
    process.communicate()


def test_a_process_that_fails_is_shown_at_once():
    with pytest.raises(AssertionError, match="no such thing"):
        first_line(process_of("raise SystemExit('no such thing')"), 60.0)


def test_a_process_whose_test_waits_for_ever_is_ended_and_says_where():
    code = "import time; from hanging import HangClock; HangClock(2, 0.1, 0.1).pytest_runtest_protocol(); "
    process = process_of(code + "time.sleep(60)")
    said = process.communicate(timeout=30)[1]
    assert process.returncode == 1 and "Timeout" in said and "in <module>" in said


def test_the_clock_is_set_anew_once_a_minute_and_after_each_failure(monkeypatch: pytest.MonkeyPatch):
    now, started = [1000.0], []
    monkeypatch.setattr(hanging, "time", SimpleNamespace(monotonic=lambda: now[0]))
    later = SimpleNamespace(dump_traceback_later=lambda seconds, exit, file: started.append((now[0] - 1000, seconds)))
    monkeypatch.setattr(hanging, "faulthandler", later)
    clock = hanging.HangClock(2)
    for moment, fails in ((0, False), (1, False), (59, False), (61, False), (62, True), (63, False), (64, False)):
        now[0] = 1000.0 + moment
        clock.pytest_runtest_protocol()
        if fails:
            clock.pytest_exception_interact()
    assert started == [(0, 960), (61, 960), (63, 960)]

"""The guard of tests against servers that hang: what each thread did is shown, not waited for."""

from __future__ import annotations

import subprocess
import sys
import time

import pytest

from serving import DUMPING, first_line

HANGING = DUMPING + "import threading; stuck = threading.Event()\ndef wait_for_ever():\n    stuck.wait()\n"


def process_of(code: str) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


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

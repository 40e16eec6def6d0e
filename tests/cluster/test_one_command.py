"""A process that runs one command keeps its objects to its end; one that calls `main` with words is left as it is."""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from pathlib import Path

from command_line import printed

PHOTOGRAPH = str(Path(__file__).parents[2] / "examples" / "room" / "plate" / "IMG_0001.jpg")
PROGRAM = """
import atexit, gc, sys
atexit.register(lambda: print(gc.get_freeze_count(), 'OpenImageIO' in sys.modules, gc.get_threshold()))
from relume.cli import main
sys.exit(main())
"""


def ended(*words: str) -> tuple[int, bool]:
    """How many objects a command's process kept to its end, and whether OpenImageIO was loaded; without a word."""
    done = subprocess.run([sys.executable, "-c", PROGRAM, *words], capture_output=True, text=True, env=os.environ)
    assert (done.returncode, done.stderr) == (0, "")
    kept, loaded, *young = done.stdout.splitlines()[-1].split(maxsplit=2)
    assert young == [str((10_000, *gc.get_threshold()[1:]))]  # the others are Python's, by its version
    return int(kept), loaded == "True"


def test_what_lives_to_the_end_of_a_command_is_not_looked_through():
    kept, loaded = ended("--help")
    assert not loaded
    assert kept > 20_000


def test_objects_that_their_library_counts_are_taken_apart_and_all_before_them_kept():
    """nanobind would print what is left of its types and functions."""
    kept, loaded = ended("info", PHOTOGRAPH)
    assert loaded
    assert kept > 20_000


def test_a_program_that_calls_main_keeps_its_own_ways(capsys):
    before, kept = (gc.get_threshold(), list(sys.meta_path)), gc.get_freeze_count()
    printed(["info", PHOTOGRAPH], capsys)
    assert (gc.get_threshold(), sys.meta_path) == before
    assert gc.get_freeze_count() <= kept

"""The sample files beside the repository, for every test that wants real photographs."""

import os
import signal
import threading
from pathlib import Path

import pytest

# The processes of the suite share the cores already. OpenBLAS's threads wait for each other in a loop: where another
# process has a core, a matrix of 256 rows takes a hundred times as long by two threads as by one. Read at NumPy's
# import, by the tests' own child processes too.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# `nohup … &` starts the suite with Ctrl-C ignored, and so the processes that tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN and threading.current_thread() is threading.main_thread():
    signal.signal(signal.SIGINT, signal.default_int_handler)

LONGEST = "test_room_truth.py"
SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of sample files beside the repository; the test is skipped where there is none."""
    if not SHARED.is_dir():
        pytest.skip(f"the sample files in {SHARED} are not here")
    return SHARED


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest file first: begun last, it would keep one process busy alone."""
    items.sort(key=lambda item: item.path.name != LONGEST)

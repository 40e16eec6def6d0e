"""The sample files beside the repository, for every test that wants real photographs."""

from pathlib import Path

import pytest

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

"""Workers that the tests of this folder share."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from relume.cluster import connect
from relume.cluster.connection import Cluster


@pytest.fixture(scope="package")
def two() -> Iterator[Cluster]:
    """Two workers of this machine, for every test that kills none."""
    pytest.importorskip("distributed", reason="Dask distributed is not installed: pip install 'relume[cluster]'")
    with connect("local:2") as cluster:
        yield cluster

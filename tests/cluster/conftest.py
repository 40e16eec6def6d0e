"""Two workers in processes of their own, for all tests of this folder."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from relume.cluster import Cluster, connect


@pytest.fixture(scope="package")
def two() -> Iterator[Cluster]:
    """Two workers of this machine, for every test that kills none."""
    pytest.importorskip("distributed", reason="Dask distributed is not installed: pip install 'relume[cluster]'")
    with connect("local:2") as cluster:
        yield cluster

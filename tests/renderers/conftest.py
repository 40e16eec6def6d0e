"""Mitsuba for tests that call its parts themselves."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from kept_lobes import lobes_are_kept
from relume.renderers.mitsuba.path_tracer import _mitsuba

__all__ = ["lobes_are_kept", "mi"]


@pytest.fixture(scope="module")
def mi() -> Iterator[Any]:
    with _mitsuba(None, None) as mitsuba:
        if "_ad_" not in mitsuba.variant():
            pytest.skip("only a scalar variant of Mitsuba runs here")
        yield mitsuba

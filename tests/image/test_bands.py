"""Rows at a time: what is done with a picture in bands is what is done with it as a whole."""

from __future__ import annotations

import threading
import warnings

import numpy as np
import pytest

from relume.errors import DoubtWarning, warn
from relume.image import bands
from relume.image.bands import SMALL, in_bands, side_by_side


def test_bands_cover_a_picture_once_from_the_top(monkeypatch):
    monkeypatch.setattr(bands, "BAND", 100)
    found = in_bands(23, 20, lambda rows: (rows.start, rows.stop))
    assert found == [(0, 5), (5, 10), (10, 15), (15, 20), (20, 23)]
    # A row wider than a band is a band.
    assert in_bands(2, 1000, lambda rows: (rows.start, rows.stop)) == [(0, 1), (1, 2)]


@pytest.mark.parametrize("state", ["ignore", "raise"])
def test_threads_take_the_error_state_along(monkeypatch, state):
    monkeypatch.setattr(bands, "BAND", 10)
    with np.errstate(divide=state), warnings.catch_warnings():
        if state == "ignore":
            assert in_bands(40, 10, lambda rows: float((np.ones(1) / np.zeros(1))[0])) == [np.inf] * 40
        else:
            with pytest.raises(FloatingPointError):
                in_bands(40, 10, lambda rows: float((np.ones(1) / np.zeros(1))[0]))


def test_works_side_by_side_meet_and_small_ones_alone_do():
    met = threading.Barrier(2, timeout=10)
    assert side_by_side([lambda: (met.wait() >= 0, "first"), lambda: (met.wait() >= 0, "second")], SMALL) == [
        (True, "first"), (True, "second"),
    ]  # fmt: skip
    running: list[str] = []

    def alone() -> int:
        running.append("begun")
        assert running.count("begun") == running.count("ended") + 1
        running.append("ended")
        return len(running)

    assert side_by_side([alone, alone, alone], SMALL + 1) == [2, 4, 6]


def test_what_works_warn_of_comes_in_their_order_and_the_first_error_is_raised():
    later = threading.Event()

    def slow() -> None:
        later.wait(10)
        warn("first", 0.5)
        raise ValueError("of the first")

    def quick() -> None:
        warn("second")
        later.set()
        raise KeyError("of the second")

    with warnings.catch_warnings(record=True) as caught, pytest.raises(ValueError, match="of the first"):
        warnings.simplefilter("always")
        side_by_side([slow, quick])
    assert [str(each.message) for each in caught] == ["first", "second"]
    assert isinstance(caught[0].message, DoubtWarning) and caught[0].message.effect == 0.5

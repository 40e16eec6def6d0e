"""Rows at a time: what is done with a picture in bands is what is done with it as a whole."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from relume.image import bands
from relume.image.bands import in_bands


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

"""Random numbers by place: a counter's hash, so that a pixel's numbers do not depend on who draws them, or when."""

from __future__ import annotations

import numpy as np

from relume._kernel import exact_inlined

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
"""SplitMix64's step from counter to counter."""
FIRST, SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
S27, S30, S31 = (np.uint64(n) for n in (27, 30, 31))


@exact_inlined
def mixed(state):
    """SplitMix64's output of a counter (Steele, Lea & Flood 2014): every place has its own number, drawn or not."""
    z = (state ^ (state >> S30)) * FIRST
    z = (z ^ (z >> S27)) * SECOND
    return z ^ (z >> S31)

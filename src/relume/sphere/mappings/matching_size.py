"""How many rows a map needs in another mapping to be as fine."""

from __future__ import annotations

import numpy as np

from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import Mapping

_TRIAL = 384
"""Rows of which every mapping has an image."""


def matching_size(light: EnvironmentMap, mapping: Mapping) -> int:
    """Rows of a map in `mapping` with at least as many pixels a steradian, on average, as the light has.

    The light's own number where the mapping is its own.
    """
    if mapping == light.mapping:
        return light.size
    here, there = light.mapping.solid_angles(light.size), mapping.solid_angles(_TRIAL)
    density = np.count_nonzero(here) / here.sum()
    rows = _TRIAL * np.sqrt(density * there.sum() / np.count_nonzero(there))
    grid = getattr(mapping, "grid", (1, 1))[0]
    return grid * max(1, int(np.ceil(rows / grid - 0.01)))

"""The specular cube that game engines look up by roughness: a mirror at level 0, the roughest surface at the last.

The usual approximation of real-time shading, N = V = R (Karis 2013), one GGX lobe a level; `reflection.glossy`
holds what it leaves out.
"""

from __future__ import annotations

from relume.light.reflection.lobes import GGXLobe
from relume.light.reflection.reflection_map import reflection_map, rows_for
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mip_cube import Cube, cube_of

_ROWS_A_TEXEL = 4
"""Rows of the lobe's table for each texel of the level, twice as fine as the texels: more are not seen in them."""
_FEWEST_ROWS = 64


def roughness_levels(light: EnvironmentMap, size: int) -> tuple[Cube, ...]:
    """Cubes of `size`, size/2, … 1 texels an edge, level i for the perceptual roughness i / (levels − 1), α its square.

    Radiance in the light's unit: constant light stays what it is at every level. Raises ValueError for a size that is
    no power of two.
    """
    if size < 1 or size & (size - 1):
        raise ValueError(f"the cube is {size} texels along an edge; roughness levels need a power of two, as 256")
    levels, last = [cube_of(light, size)], size.bit_length() - 1
    for level in range(1, last + 1):
        lobe, texels = GGXLobe((level / last) ** 2), size >> level
        rows = min(rows_for(lobe, light.size), max(_FEWEST_ROWS, _ROWS_A_TEXEL * texels))
        levels.append(cube_of(reflection_map(light, lobe, rows).light, texels))
    return tuple(levels)

"""Environment cubes with mip levels, as game engines sample them: environment maps in the mapping `Strip`.

The faces are +X, −X, +Y, −Y, +Z, −Z of our world, each stored as OpenGL, Vulkan, Direct3D and KTX2 read it. A direction
(x, y, z) falls on the face of its largest coordinate, at s to the right and t down (OpenGL 4.6, table 8.19):

    face   s = ½ + ½ ·    t = ½ + ½ ·
    +X       −z / |x|       −y / |x|
    −X       +z / |x|       −y / |x|
    +Y       +x / |y|       +z / |y|
    −Y       +x / |y|       −z / |y|
    +Z       +x / |z|       −y / |z|
    −Z       −x / |z|       −y / |z|

So a shader that looks a cube up in a right-handed, +Y-up world direction meets the light that comes from there: glTF
Sample Viewer and Filament do that. Because that table was made for a left-handed space, every face shows its view
mirrored. Engines that take cubes of unmirrored views turn the direction into that left-handed space first, by negating
x (three.js, PlayCanvas) or z (Bevy, Stride), as the KTX 2.0 specification advises: `mirrored_strip` is for them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import Strip
from relume.sphere.mappings.mapping import pixel_directions


def faces_of(strip: EnvironmentMap) -> np.ndarray:
    """The six faces of a strip, (6, S, S, 3)."""
    return np.stack(np.split(strip.radiance, 6, axis=1))


def mirrored_strip(light: EnvironmentMap, axis: str) -> EnvironmentMap:
    """A strip of faces for an engine that negates `axis`, "x" or "z", before it looks up, or such a strip made ours.

    Raises ValueError for another mapping or axis.
    """
    if not isinstance(light.mapping, Strip):
        raise ValueError(f"a {light.mapping.name} map; only strips of cube faces are mirrored")
    if axis not in ("x", "z"):
        raise ValueError(f'axis is "{axis}"; engines negate "x" (three.js, PlayCanvas) or "z" (Bevy, Stride)')
    # The texels that such an engine is to find at each place.
    sign = np.where(np.array(["x", "y", "z"]) == axis, -1, 1)
    points = light.mapping.image_points(pixel_directions(light.mapping, light.size) * sign)
    column, row = np.moveaxis((points * [6 * light.size, light.size]).astype(int), -1, 0)
    clipped = None if light.clipped is None else light.clipped[row, column]
    return replace(light, radiance=light.radiance[row, column], clipped=clipped)


def mips(strip: EnvironmentMap) -> tuple[EnvironmentMap, ...]:
    """The strip and its smaller levels down to faces of 1 × 1, each texel the mean of 2 × 2 by solid angle.

    The total is kept. Raises ValueError for a size that is no power of two: half of it would not be whole at every
    level.
    """
    if strip.size & (strip.size - 1):
        raise ValueError(f"the cube is {strip.size} texels along an edge; mip levels need a power of two, as 256")
    levels, flux = [strip], strip.radiance * Strip().solid_angles(strip.size)[..., None]
    while (size := len(flux) // 2) > 0:
        flux = flux.reshape(size, 2, 6 * size, 2, 3).sum((1, 3))
        radiance = (flux / Strip().solid_angles(size)[..., None]).astype(np.float32)
        levels.append(EnvironmentMap(radiance, Strip(), strip.unit))
    return tuple(levels)

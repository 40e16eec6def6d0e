"""Environment cubes with mip levels, as game engines sample them.

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
x (three.js, PlayCanvas) or z (Bevy, Stride), as the KTX 2.0 specification advises: `Cube.mirrored` is for them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.resample import bilinear
from relume.sphere.cubes import FACES, OPENGL, face_solid_angles
from relume.sphere.illumination import IlluminationMap

__all__ = ["FACES", "Cube", "cube_of", "directions", "mips", "solid_angles"]

_LEAST_CELLS = 4
"""Look-ups a texel and side: a texel at a corner of its face is slanted, and 4 × 4 cells follow that."""
_CELLS_A_PIXEL = 3
"""Look-ups a pixel of the map and side: fewer count a sun of one pixel too much or too little, by 5 % at two."""
_WIDEST = 512
"""Look-ups at a time along a face, at most, unless the cube itself is larger."""


@dataclass(frozen=True, eq=False)
class Cube:
    """Light from every direction on the six faces of a cube.

    faces : (6, S, S, 3) float32, in `unit`; faces, rows (t, down) and columns (s, right) as the module says
    unit : "cd/m²" when calibrated, else "relative"
    """

    faces: np.ndarray
    unit: str = "relative"

    def __post_init__(self) -> None:
        shape = self.faces.shape
        if self.faces.ndim != 4 or shape[0] != 6 or shape[1] != shape[2] or shape[3] != 3 or shape[1] < 1:
            raise ValueError(f"faces has shape {shape}; a cube has six square faces of three channels: (6, S, S, 3)")
        if not np.all(np.isfinite(self.faces)) or self.faces.min() < 0:
            raise ValueError("faces holds negative or non-finite values; light must be finite and not below 0")

    @property
    def size(self) -> int:
        """Texels along an edge."""
        return self.faces.shape[1]

    def look_up(self, directions: np.ndarray) -> np.ndarray:
        """Radiance (…, 3) from unit directions (…, 3) of the world, bilinear within a face and constant at its rim."""
        face, s, t = OPENGL.points(np.asarray(directions, np.float64))
        radiance = np.empty((*face.shape, 3))
        for index in range(6):
            here = face == index
            radiance[here] = bilinear(self.faces[index], s[here] * self.size, t[here] * self.size)
        return radiance

    def total(self) -> np.ndarray:
        """∫ L dω over the whole sphere, (3,): the sum of radiance × solid angle."""
        return np.einsum("fhwc,fhw->c", self.faces.astype(np.float64), solid_angles(self.size))

    def mirrored(self, axis: str) -> Cube:
        """The cube for an engine that negates `axis`, "x" or "z", of the world direction before it looks up.

        Raises ValueError for another axis.
        """
        if axis not in ("x", "z"):
            raise ValueError(f'axis is "{axis}"; engines negate "x" (three.js, PlayCanvas) or "z" (Bevy, Stride)')
        face, s, t = OPENGL.points(directions(self.size) * np.where(np.array(["x", "y", "z"]) == axis, -1, 1))
        return Cube(self.faces[face, (t * self.size).astype(int), (s * self.size).astype(int)], self.unit)


def directions(size: int) -> np.ndarray:
    """The unit directions, in the world, of the middles of a cube's texels: (6, size, size, 3)."""
    middles = (np.arange(size) + 0.5) / size
    return np.stack([OPENGL.directions(face, middles[None, :], middles[:, None]) for face in range(6)])


def solid_angles(size: int) -> np.ndarray:
    """Steradians of a cube's texels, exact: (6, size, size), read-only; they sum to 4π."""
    return np.broadcast_to(face_solid_angles(size), (6, size, size))


def cube_of(light: IlluminationMap, size: int) -> Cube:
    """The light on a cube of `size` texels an edge, its total kept in each channel.

    A texel is the mean, by solid angle, of look-ups in its cells: 4 × 4, more where the map is finer. Then each channel
    is scaled to the map's own total, by less than 1 % unless a few pixels near a pole give most of it. Constant light
    stays constant. Raises ValueError for a size below 1.
    """
    if size < 1:
        raise ValueError(f"size is {size}; a cube has at least 1 texel along an edge")
    # A texel in the middle of a face spans 2/size radians, a pixel of a lat-long map π/rows.
    cells = max(_LEAST_CELLS, int(np.ceil(_CELLS_A_PIXEL * 2 * light.size / (np.pi * size))))
    # Blocks of cells are summed at the end, so that a small cube of a fine map is no long row of short look-ups.
    block = max(1, min(cells // _LEAST_CELLS, _WIDEST // size))
    grid, cells = size * block, -(-cells // block)
    weights = solid_angles(grid * cells)[0, :, :, None]
    places = (np.arange(grid * cells) + 0.5) / (grid * cells)
    faces = np.zeros((6, grid, grid, 3))
    for face in range(6):
        for row, column in np.ndindex(cells, cells):
            towards = OPENGL.directions(face, places[None, column::cells], places[row::cells, None])
            faces[face] += light.look_up(towards) * weights[row::cells, column::cells]
    faces = faces.reshape(6, size, block, size, block, 3).sum((2, 4))
    texels = solid_angles(size)[..., None]
    wanted, present = light.total(), faces.sum((0, 1, 2))
    scale = np.divide(wanted, present, out=np.ones(3), where=present > 0)
    return Cube((faces / texels * scale).astype(np.float32), light.unit)


def mips(cube: Cube) -> tuple[Cube, ...]:
    """The cube and its smaller levels down to 1 × 1, each texel the mean of 2 × 2 by solid angle; the total is kept.

    Raises ValueError for a size that is no power of two: half of it would not be whole at every level.
    """
    if cube.size & (cube.size - 1):
        raise ValueError(f"the cube is {cube.size} texels along an edge; mip levels need a power of two, as 256")
    levels, flux = [cube], cube.faces * solid_angles(cube.size)[..., None]
    while (size := flux.shape[1] // 2) > 0:
        flux = flux.reshape(6, size, 2, size, 2, 3).sum((2, 4))
        levels.append(Cube((flux / solid_angles(size)[..., None]).astype(np.float32), cube.unit))
    return tuple(levels)

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

from dataclasses import dataclass, replace

import numpy as np

from relume.image.bilinear import bilinear
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import OPENGL, Strip, face_solid_angles


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

    def lookup(self, directions: np.ndarray) -> np.ndarray:
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
        return Cube(self.faces[_mirrored_places(self.size, axis)], self.unit)


def directions(size: int) -> np.ndarray:
    """The unit directions, in the world, of the middles of a cube's texels: (6, size, size, 3)."""
    middles = (np.arange(size) + 0.5) / size
    return np.stack([OPENGL.directions(face, middles[None, :], middles[:, None]) for face in range(6)])


def solid_angles(size: int) -> np.ndarray:
    """Steradians of a cube's texels, exact: (6, size, size), read-only; they sum to 4π."""
    return np.broadcast_to(face_solid_angles(size), (6, size, size))


def cube_of(light: EnvironmentMap, size: int) -> Cube:
    """The light on a cube of `size` texels an edge, its total kept in each channel (`EnvironmentMap.remapped`).

    Raises ValueError for a size below 1.
    """
    if size < 1:
        raise ValueError(f"size is {size}; a cube has at least 1 texel along an edge")
    return Cube(np.stack(np.split(light.remapped(Strip(), size).radiance, 6, axis=1)), light.unit)


def mirrored_strip(light: EnvironmentMap, axis: str) -> EnvironmentMap:
    """A strip of faces for an engine that negates `axis`, or such a strip made ours: the same exchange.

    Raises ValueError for another mapping or axis.
    """
    if not isinstance(light.mapping, Strip):
        raise ValueError(f"a {light.mapping.name} map; only strips of cube faces are mirrored")
    places = _mirrored_places(light.size, axis)
    clipped = None if light.clipped is None else _exchanged(light.clipped, places)
    return replace(light, radiance=_exchanged(light.radiance, places), clipped=clipped)


def _exchanged(strip: np.ndarray, places: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    faces = np.stack(np.split(strip, 6, axis=1))
    return np.concatenate(list(faces[places]), axis=1)


def _mirrored_places(size: int, axis: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Face, row and column of the texels that an engine negating `axis` is to find at each place: (6, S, S) each."""
    if axis not in ("x", "z"):
        raise ValueError(f'axis is "{axis}"; engines negate "x" (three.js, PlayCanvas) or "z" (Bevy, Stride)')
    face, s, t = OPENGL.points(directions(size) * np.where(np.array(["x", "y", "z"]) == axis, -1, 1))
    return face, (t * size).astype(int), (s * size).astype(int)


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

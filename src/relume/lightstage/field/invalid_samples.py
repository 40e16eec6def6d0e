"""Which values of a reflectance field say nothing about the subject: too bright, light in the lens, the stage's bar.

"Each function exhibits a thin black curve … where the phi axis bar occasionally obscures the view of the face, and a
bright spot due to lens flare where the light points into the camera. These regions appear in the same places across
images and are ignored in the lighting analysis" (Debevec et al. 2000, Fig. 4). A mask answers for blocks of lights and
rows, True where a value says nothing; a subject's own highlights are genuine, however bright, and
stay. The bar is found by `bar_shadow`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Protocol

import numpy as np

from relume.errors import UnreadableFile
from relume.image import files
from relume.lightstage.acquire.picture_folder import PictureFolder
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised

_SAMPLED_LIGHTS = 32
_FAINTEST = 0.02
"""Glow that counts, relative to the level of the pictures: fainter glow of one light among hundreds is not seen."""
_BEYOND = np.radians(10)
"""Outside the picture to look for lights that shine on the lens: the depth of a small hood."""
_QUANTILE = 0.25
"""Three quarters of a ring's pixels must glow: a rim that catches light fills less than one."""
_BLACK = 5
"""Times the faintest glow: where more than that is expected, a glow could be a highlight."""


class Mask(Protocol):
    """What says nothing."""

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        """(lights, rows, columns) bool, True where a value says nothing; slices have a step of 1."""
        ...


@dataclass(frozen=True, eq=False)
class PackedMask:
    """A mask held in memory, eight pixels a byte.

    bits : (N, H, ⌈W/8⌉) uint8
    columns : W
    """

    bits: np.ndarray
    columns: int

    @staticmethod
    def of(masked: np.ndarray) -> PackedMask:
        """Of (N, H, W) bool."""
        return PackedMask(np.packbits(masked, axis=-1), masked.shape[-1])

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        return np.unpackbits(self.bits[lights, rows], axis=-1, count=self.columns).astype(bool)


@dataclass(frozen=True, eq=False)
class Saturated:
    """Values that no photograph of a folder recorded, as its pictures mark them."""

    field: PictureFolder

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        return np.stack([self.field.saturated(light)[rows] for light in range(len(self.field.lights))[lights]])


@dataclass(frozen=True, eq=False)
class AroundLights:
    """Pixels that look at a light, or close past it.

    camera : that took the pictures
    directions : (N, 3) unit, from the camera towards each light
    radii : (N,) radians around each light; 0 for lights that nothing is masked for
    """

    camera: Camera
    directions: np.ndarray
    radii: np.ndarray

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        rays = _rays(self.camera)[rows]
        cosines = np.einsum("nc,yxc->nyx", self.directions[lights], rays)
        radii = self.radii[lights, None, None]
        return (cosines > np.cos(radii)) & (radii > 0)


def direct_light(
    lights: StageLights, camera: Camera, *, angular_radius: float, margin: float = np.radians(1.0)
) -> AroundLights:
    """The mask of pixels that would see a light itself if nothing stood before it.

    angular_radius : of a light as the camera sees it, radians
    margin : around it, radians; a degree, for what lens and sensor blur and for how well directions are known
    """
    if not (angular_radius > 0 and margin >= 0 and angular_radius + margin < np.pi):
        raise ValueError(f"a light of radius {angular_radius} and a margin of {margin}; expected radians, above 0")
    seen_from = lights.directions if lights.positions is None else normalised(lights.positions - camera.position)
    return AroundLights(camera, seen_from, np.full(len(lights), angular_radius + margin))


def lens_flare_and_direct_light(field: ReflectanceField, camera: Camera, *, angular_radius: float) -> AroundLights:
    """The mask of lights that shine into the lens, each as far as its glow reaches.

    Rings around a light in or near the picture are compared with the brightest that the lights outside show there, in
    pixels that these leave black: the glow ends where a quarter of a ring stays black. A light that the subject hides
    wholly, so that not a pixel of its disc is as bright as the pictures' level, masks nothing unless it glows.
    """
    disc = direct_light(field.lights, camera, angular_radius=angular_radius)
    rays = _rays(camera)
    if rays.shape[:2] != field.shape:
        raise ValueError(f"the camera's pictures are {rays.shape[:2]}; expected the field's {field.shape}")
    nearest = np.array([np.arccos(min((rays @ towards).max(), 1.0)) for towards in disc.directions])
    lens = np.flatnonzero(nearest < _BEYOND + disc.radii)
    outside = np.setdiff1d(np.arange(len(field.lights)), lens)
    radii = np.zeros(len(field.lights))
    if not len(lens) or not len(outside):
        return AroundLights(camera, disc.directions, radii)
    level = level_of_pictures(field, outside)
    pixel = 1 / camera.focal_length
    for light in lens:
        around = outside[np.argsort(-field.lights.directions[outside] @ field.lights.directions[light])[:8]]
        expected = np.max([grey_picture(field, int(i)) for i in around], axis=0)
        excess = grey_picture(field, int(light)) - expected
        angles = np.arccos(np.clip(rays @ disc.directions[light], -1, 1))
        seen = angles < disc.radii[light]
        shines = bool(seen.any()) and excess[seen].max() > level
        dark = expected <= _BLACK * _FAINTEST * level
        glow = _reach_of_glow(excess[dark], angles[dark], 2 * pixel, _FAINTEST * level)
        radii[light] = max(glow, disc.radii[light] if shines else 0.0)
    return AroundLights(camera, disc.directions, radii)


@dataclass(frozen=True, eq=False)
class UserMask:
    """Masks drawn by hand.

    pixels : (H, W) bool for each light
    """

    pixels: tuple[np.ndarray, ...]

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        return np.stack([pixels[rows] for pixels in self.pixels[lights]])


def user_mask(path: str | Path, lights: StageLights, shape: tuple[int, int]) -> UserMask:
    """Masks from a picture for all lights, or from a folder with one a light, called as the light is (before the dot).

    White says: leave this out; from half of the last code on, in any channel. A light without a picture in the folder
    is left whole. Raises UnreadableFile for a picture of another size than `shape` and for one that no light is called
    as.
    """
    path = Path(path)
    if not path.is_dir():
        return UserMask((_drawn(path, shape),) * len(lights))
    drawn = {file.stem: file for file in sorted(path.iterdir()) if file.is_file() and not file.name.startswith(".")}
    stems = [Path(name).stem for name in lights.names]
    if not drawn:
        raise UnreadableFile(f"{path}: no masks in this folder; add pictures called as the lights are")
    for stem, file in drawn.items():
        if stem not in stems:
            raise UnreadableFile(f'{file}: no light is called "{stem}"; the first is "{lights.names[0]}"')
    nothing = np.zeros(shape, bool)
    return UserMask(tuple(_drawn(drawn[s], shape) if s in drawn else nothing for s in stems))


def _drawn(path: Path, shape: tuple[int, int]) -> np.ndarray:
    pixels = files.read_photograph(path).pixels
    if pixels.shape[:2] != shape:
        raise UnreadableFile(f"{path}: a mask of {pixels.shape[1]}×{pixels.shape[0]}; expected {shape[1]}×{shape[0]}")
    return np.any(pixels > np.iinfo(pixels.dtype).max // 2, axis=-1)


@lru_cache(4)
def _rays(camera: Camera) -> np.ndarray:
    return camera.rays()


def grey_picture(field: ReflectanceField, light: int) -> np.ndarray:
    """The mean (H, W) of the channels under one light."""
    return field.block(slice(light, light + 1), slice(0, field.shape[0]))[0].mean(axis=-1)


def level_of_pictures(field: ReflectanceField, lights: np.ndarray) -> float:
    """How bright lit, matte parts of the subject are: what is brighter under one light in ten, as
    highlights are, does not count.

    Each pixel's 90th percentile over a sample of the lights, and of these the 95th percentile.
    """
    sampled = lights[np.linspace(0, len(lights) - 1, min(len(lights), _SAMPLED_LIGHTS)).astype(int)]
    lit = np.quantile(np.stack([grey_picture(field, int(i)) for i in sampled]), 0.9, axis=0)
    return float(np.percentile(lit, 95))


def _reach_of_glow(excess: np.ndarray, angles: np.ndarray, step: float, faintest: float) -> float:
    """The radius up to which every ring around a light glows; 0 where the innermost one does not.

    excess : (P,) of pixels over what is expected there
    angles : (P,) radians from the light; a ring without pixels counts nothing
    step : width of a ring, radians
    """
    if not len(angles):
        return 0.0
    ring = (angles / step).astype(int)
    rings = np.arange(ring.min(), ring.max() + 1)
    order = np.argsort(ring, kind="stable")
    bounds = np.searchsorted(ring[order], [*rings, rings[-1] + 1])
    values = excess[order]
    reach = 0.0
    for index, start, end in zip(rings, bounds[:-1], bounds[1:], strict=True):
        if end > start:
            if np.quantile(values[start:end], _QUANTILE) <= faintest:
                break
            reach = float((index + 1) * step)
    return reach

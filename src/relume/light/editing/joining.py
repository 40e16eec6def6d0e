"""Two environment maps joined into one: a sky over a ground, or what one map shows through a mask over the other.

N. Greene, "Environment Mapping and Other Applications of World Projections", IEEE CG&A 6 (1986), joins a photographed
sky, taken through a fisheye lens, and a rendered ground. What the first map does not show comes from the second.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image import files
from relume.image.radiance import OUTSIDE, RadianceMap
from relume.light.editing.edits import warn_of_frame
from relume.sphere.environment_files import as_environment, as_radiance_map, read_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, Mapping, matching_size, pixel_directions, shown
from relume.sphere.resampling.blur import blurred

_HALF = 0.5


@dataclass(frozen=True)
class Horizon:
    """The first map above a height, the second below it.

    elevation : radians above the level, of the middle of the edge
    softness : radians over which one goes over into the other; 0 for a hard edge
    """

    elevation: float = 0.0
    softness: float = np.radians(2)

    def __post_init__(self) -> None:
        if not abs(self.elevation) <= np.pi / 2 or not 0 <= self.softness <= np.pi:
            raise ValueError(
                f"the edge is at {np.degrees(self.elevation):g}° and {np.degrees(self.softness):g}° wide; expected "
                "−90 to 90° and 0 to 180°"
            )

    def __str__(self) -> str:
        return f"above {np.degrees(self.elevation):g}°, soft over {np.degrees(self.softness):g}°"

    def share(self, mapping: Mapping, size: int) -> np.ndarray:
        """The share of the first map in every pixel of a map of `size` rows in `mapping`, (rows, columns), 0 to 1."""
        up = pixel_directions(mapping, size)[..., 1]
        above = np.arctan2(up, np.sqrt(np.maximum(1 - up**2, 0))) - self.elevation
        if self.softness == 0:
            return (above >= 0).astype(np.float64)
        x = np.clip(above / self.softness + _HALF, 0, 1)
        return x * x * (3 - 2 * x)


@dataclass(frozen=True, eq=False)
class Mask:
    """The first map where a mask is white, the second where it is black.

    share_of_first : (rows, columns) from 0 to 1, laid out by `mapping`
    softness : radians, the deviation of a blur that is added; 0 leaves the mask as it was painted
    """

    share_of_first: np.ndarray
    mapping: Mapping = LatLong()
    softness: float = 0.0

    def __post_init__(self) -> None:
        rows = self.share_of_first.shape[0] if self.share_of_first.ndim == 2 else 0
        if not rows or self.share_of_first.shape != self.mapping.shape(rows):
            raise ValueError(f"the mask has shape {self.share_of_first.shape}; it is no {self.mapping.name} map")
        if not (self.share_of_first.min() >= 0 and self.share_of_first.max() <= 1):
            raise ValueError("the mask holds values beyond 0 to 1; give the share of the first map")

    @classmethod
    def read(cls, path: Path | str, mapping: Mapping = LatLong(), softness: float = 0.0) -> Mask:
        """A mask painted as a grey PNG, TIFF or JPEG.

        path : the file
        mapping : how the mask is laid out
        softness : radians, the deviation of a blur that is added
        Raises UnreadableFile, and ValueError for another shape.
        """
        pixels = files.read_photograph(path).pixels
        if np.ptp(pixels.astype(np.int64), axis=-1).max() > 0:
            raise UnreadableFile(f"{path}: a mask in colours; save it grey, white where the first map is to be")
        try:
            return cls(pixels[..., 0] / float(np.iinfo(pixels.dtype).max), mapping, softness)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    def __str__(self) -> str:
        return "by a mask" + (f", soft by {np.degrees(self.softness):g}°" if self.softness else "")

    def share(self, mapping: Mapping, size: int) -> np.ndarray:
        """The share of the first map in every pixel of a map of `size` rows in `mapping`, (rows, columns), 0 to 1."""
        return _moved(self.share_of_first, self.mapping, mapping, size, self.softness)


def join_maps(
    first: EnvironmentMap, second: EnvironmentMap, where: Horizon | Mask = Horizon(), *, mapping: Mapping | None = None
) -> EnvironmentMap:
    """The first map over the second, by their shares in each pixel, in linear light.

    where : which map is seen where; what the first does not show, or has only filled in, comes from the second
    mapping : of the result; that of the first unless given, lat-long where that shows a part of the sphere

    The result is as fine as the finer of the two. Marks of clipped pixels stay where their map has a share. Raises
    ValueError for maps of two units, and where neither shows a pixel.
    """
    if first.unit != second.unit:
        raise ValueError(
            f"one map is in {first.unit} and the other in {second.unit}; bring both to one scale first, by a "
            "gain or by a spot of known luminance"
        )
    whole = abs(float(first.mapping.solid_angles(64).sum()) / (4 * np.pi) - 1) < 1e-2
    wanted = mapping or (first.mapping if whole else LatLong())
    size = max(matching_size(each.mapping, each.size, wanted) for each in (first, second))
    share = where.share(wanted, size) * _seen(first, wanted, size, where.softness)
    here, there = (each.remapped(wanted, size) for each in (first, second))
    missing = _not_seen(there) & (share < 1)
    if np.any(missing & shown(wanted.solid_angles(size))):
        count = int(np.count_nonzero(missing))
        raise ValueError(f"{count} pixels are in neither map; give maps that show the whole sphere between them")
    radiance = share[..., None] * here.radiance + (1 - share[..., None]) * there.radiance
    marks = np.zeros(share.shape, np.uint8)
    for part, weight in ((there, 1 - share), (here, share)):
        if part.clipped is not None:
            marks = np.where((weight > 0) & (part.clipped != 0), part.clipped, marks)
    clipped = marks if marks.any() else None
    return EnvironmentMap(
        radiance.astype(np.float32), wanted, first.unit, clipped, second.attributes | first.attributes
    )


@dataclass(frozen=True, eq=False)
class Join:
    """`join_maps` as an edit: the map that is edited over another one.

    below : the other map, or its file
    where : which is seen where; a path is of a mask laid out as the map that is edited
    softness : of a mask that is a path, as `Mask` has it
    """

    name = "join"
    below: EnvironmentMap | Path
    where: Horizon | Mask | Path = Horizon()
    softness: float = 0.0

    def __str__(self) -> str:
        what = self.below.name if isinstance(self.below, Path) else "a map"
        return f"over {what}, " + (f"by {self.where.name}" if isinstance(self.where, Path) else str(self.where))

    def __call__(self, picture: RadianceMap) -> RadianceMap:
        first = as_environment(picture)
        second = read_environment(self.below) if isinstance(self.below, Path) else self.below
        where = self.where
        if isinstance(where, Path):
            where = Mask.read(where, first.mapping, self.softness)
        warn_of_frame(picture)
        if picture.variance is not None:
            warn("environment maps that are joined lose their variance")
        return as_radiance_map(join_maps(first, second, where))


def _not_seen(light: EnvironmentMap) -> np.ndarray:
    return np.zeros(light.radiance.shape[:2], bool) if light.clipped is None else light.clipped == OUTSIDE


def _seen(light: EnvironmentMap, mapping: Mapping, size: int, softness: float) -> np.ndarray:
    """(rows, columns) 0 where the map shows nothing, 1 inside what it shows, soft inside its rim."""
    inside = ~_not_seen(replace(light, radiance=np.ones_like(light.radiance)).remapped(mapping, size))
    if inside.all():
        return np.ones(inside.shape)
    # Twice the blur less 1 is 0 on a straight rim and rises inwards alone.
    blur = _moved(inside.astype(np.float64), mapping, mapping, size, softness)
    return np.clip(2 * blur - 1, 0, 1) * inside


def _moved(values: np.ndarray, here: Mapping, there: Mapping, size: int, softness: float) -> np.ndarray:
    """Numbers from 0 to 1 of one layout in another, blurred on the sphere by a deviation in radians."""
    light = EnvironmentMap(np.repeat(values[..., None], 3, axis=2).astype(np.float32), here)
    return np.clip(blurred(light, softness).remapped(there, size).radiance[..., 0].astype(np.float64), 0, 1)

"""Light on the command line: an illumination map from a file, refused in one line where it is none."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from relume.errors import UnreadableFile
from relume.image.files.read_options import ReadOptions

if TYPE_CHECKING:
    from relume.image.radiance import RadianceMap
    from relume.sphere.environment_map import EnvironmentMap
    from relume.sphere.mappings.mapping import Mapping

Clamp = Annotated[
    bool,
    Parameter(negative="", help="Take negative pixels, which a resize may leave, for 0; refused unless given."),
]


def read_light(
    path: Path, mapping: Mapping | None = None, *, clamp: bool = False, reading: ReadOptions = ReadOptions()
) -> EnvironmentMap:
    """The light in a file.

    mapping : what the file's own memory and its shape are overruled by, where given
    clamp : take negative pixels for 0, and say how many they were
    reading : limits, and how what the file leaves open is understood
    Raises UnreadableFile for what is missing or damaged, does not tell its mapping, or holds pixels that are no light,
    which it counts.
    """
    from relume.sphere.environment_map import as_environment

    picture = read_picture(path, mapping, clamp=clamp, reading=reading)
    width, height = picture.size
    try:
        if mapping is not None and (height, width) != mapping.shape(height):
            raise ValueError(
                f"{width}×{height} pixels, but a picture in {mapping.name} of {height} rows is "
                f"{mapping.shape(height)[1]} wide; tell another mapping, or crop it"
            )
        return as_environment(picture, mapping)
    except ValueError as error:
        raise UnreadableFile(f"{path}: {error}") from None


def read_picture(
    path: Path, mapping: Mapping | None = None, *, clamp: bool = False, reading: ReadOptions = ReadOptions()
) -> RadianceMap:
    """The radiance map in a file, with nothing in it that is no light; arguments and errors as `read_light`."""
    from relume.image import files

    return light_only(path, _without_surroundings(files.read_radiance(path, reading), mapping), clamp)


def _without_surroundings(picture: RadianceMap, mapping: Mapping | None) -> RadianceMap:
    """The picture with 0 beside the discs and faces of its mapping: what other programs leave there is no light."""
    import numpy as np

    from relume.sphere.mappings.mapping import mapping_named

    try:
        mapping = mapping or mapping_named(picture.attributes.get("mapping", ""))
        areas = mapping.solid_angles(picture.size[1])
    except ValueError:
        return picture
    if areas.shape != picture.radiance.shape[:2] or areas.min() > 0:
        return picture
    return replace(picture, radiance=np.where(areas[..., None] > 0, picture.radiance, np.float32(0)))


def light_only(path: Path, picture: RadianceMap, clamp: bool) -> RadianceMap:
    """The picture if all of it can be light; `clamp` and errors as `read_light`."""
    import numpy as np

    odd = int(np.count_nonzero(~np.isfinite(picture.radiance).all(-1)))
    dark = int(np.count_nonzero((picture.radiance < 0).any(-1)))
    if not odd and not dark:
        return picture
    if odd or not clamp:
        faults = [f"{odd} pixels are NaN or infinite"] if odd else []
        faults += [f"{dark} negative" if odd else f"{dark} pixels are negative"] if dark else []
        raise UnreadableFile(
            f"{path}: {' and '.join(faults)}, which no light is; "
            "paint over them, or write the map again from where it came"
            + ("; --clamp takes the negative ones for 0" if dark and not odd else "")
        )
    warnings.warn(
        f"{path}: {dark} pixels were negative, the lowest {picture.radiance.min():.3g}; they count as 0 (--clamp)",
        stacklevel=3,
    )
    return replace(picture, radiance=np.maximum(picture.radiance, np.float32(0)))

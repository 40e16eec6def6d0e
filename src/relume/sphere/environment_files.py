"""Environment maps as files hold them: from radiance maps and back, and read from a path."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image import files
from relume.image.files.read_options import ReadOptions
from relume.image.radiance import RadianceMap
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.irregular import evened, is_openexr_cube, strip_of_openexr
from relume.sphere.map_store import number_in_store, read_stored_map
from relume.sphere.mappings.mapping import Mapping
from relume.sphere.mappings.names import mapping_named
from relume.sphere.mappings.orientation import orient_back, orientation_named
from relume.sphere.mip_cube import mirrored_strip

LAYOUT = ("mapping", "envmap", "orientation", "mirror", "face", "view")
"""Attributes that say where a file's pixels look."""


def read_environment(
    path: Path | str, mapping: Mapping | None = None, *, clamp: bool = False, options: ReadOptions = ReadOptions()
) -> EnvironmentMap:
    """The environment map in a file, in our frame.

    path : the file, in any format that holds radiance
    mapping : used instead of the one that the file stores or that its shape suggests
    clamp : set negative pixels to 0, with a warning that counts them
    options : limits, and how to read what the file leaves open

    Raises UnreadableFile for a file that is missing or damaged, whose mapping is not known, or that has pixels which
    cannot be light (negative, infinite or NaN), with their number.
    """
    picture = read_light_pixels(path, mapping, clamp=clamp, options=options)
    if mapping is not None and mapping.name == "latlong":
        picture = evened(picture)
    width, height = picture.size
    try:
        if mapping is not None and (height, width) != mapping.shape(height):
            raise ValueError(
                f"{width}×{height} pixels, but in the mapping {mapping.name} {height} rows are "
                f"{mapping.shape(height)[1]} wide; give another mapping, or crop the map"
            )
        return as_environment(picture, mapping)
    except ValueError as error:
        raise UnreadableFile(f"{path}: {error}") from None


def read_light_pixels(
    path: Path | str, mapping: Mapping | None = None, *, clamp: bool = False, options: ReadOptions = ReadOptions()
) -> RadianceMap:
    """The radiance map in a file, or in a store's file, checked to hold light only; arguments as `read_environment`."""
    stored = number_in_store(Path(path)) is not None
    picture = read_stored_map(path) if stored else files.read_radiance(path, options)
    return require_light(path, _without_surroundings(picture, mapping), clamp=clamp)


def _without_surroundings(picture: RadianceMap, mapping: Mapping | None) -> RadianceMap:
    """The picture with 0 beside the discs and faces of its mapping, where other programs leave anything."""
    try:
        mapping = mapping or mapping_named(picture.attributes.get("mapping", ""))
        areas = mapping.solid_angles(picture.size[1])
    except ValueError:
        return picture
    if areas.shape != picture.radiance.shape[:2] or areas.min() > 0:
        return picture
    return replace(picture, radiance=np.where(areas[..., None] > 0, picture.radiance, np.float32(0)))


def require_light(path: Path | str, picture: RadianceMap, *, clamp: bool) -> RadianceMap:
    """The picture if all its pixels can be light; `clamp` and errors as `read_environment`."""
    odd = int(np.count_nonzero(~np.isfinite(picture.radiance).all(-1)))
    dark = int(np.count_nonzero((picture.radiance < 0).any(-1)))
    if not odd and not dark:
        return picture
    if odd or not clamp:
        faults = [f"{odd} pixels are NaN or infinite"] if odd else []
        faults += [f"{dark} negative" if odd else f"{dark} pixels are negative"] if dark else []
        raise UnreadableFile(
            f"{path}: {' and '.join(faults)}, which is not light; paint over them, or export the map again"
            + ("; --clamp sets the negative ones to 0" if dark and not odd else "")
        )
    warn(f"{path}: {dark} pixels were negative, the lowest {picture.radiance.min():.3g}; they are set to 0 (--clamp)")
    return replace(picture, radiance=np.maximum(picture.radiance, np.float32(0)))


def as_environment(picture: RadianceMap, mapping: Mapping | None = None) -> EnvironmentMap:
    """A radiance map as an environment map: in the given mapping, else the one its file stores, else by its shape.

    picture : radiance of the whole sphere
    2:1 is lat-long, also a pixel off that, with a warning; 6:1 a strip of cube faces; 4:3 and 3:4 are crosses where the
    cells beside the faces are empty. An OpenEXR file of `envmap` cube becomes a strip.
    A map that `relume convert --for` laid out for another program is turned back into our frame.

    Raises ValueError where the mapping is not known: a square map may be an angular map, a mirrored ball or more.
    """
    if mapping is None and is_openexr_cube(picture):
        picture = strip_of_openexr(picture)
    if (mapping.name if mapping else picture.attributes.get("mapping", "latlong")) == "latlong":
        picture = evened(picture)
    if mapping is None:
        name = picture.attributes.get("mapping")
        mapping = mapping_named(name) if name else _mapping_of_shape(picture)
    kept = {key: text for key, text in picture.attributes.items() if key not in LAYOUT}
    light = EnvironmentMap(picture.radiance, mapping, picture.unit, picture.clipped, kept)
    if "mirror" in picture.attributes:
        light = mirrored_strip(light, picture.attributes["mirror"])
    if "orientation" in picture.attributes:
        return orient_back(light, orientation_named(picture.attributes["orientation"]))
    return light


def as_radiance_map(light: EnvironmentMap) -> RadianceMap:
    """An environment map as a radiance map that stores its mapping, ready to be written to a file.

    light : in any mapping
    """
    attributes = {**light.attributes, "mapping": light.mapping.name}
    return RadianceMap(light.radiance.astype(np.float32), None, light.clipped, light.unit, attributes)


def _mapping_of_shape(picture: RadianceMap) -> Mapping:
    width, height = picture.size
    shapes = {(2, 1): "latlong", (6, 1): "strip", (4, 3): "cross", (3, 4): "cross-vertical"}
    for (across, down), name in shapes.items():
        if width * down != height * across:
            continue
        mapping = mapping_named(name)
        beside = picture.radiance[mapping.solid_angles(height) == 0]
        # A photograph may be 4:3 too, but it does not leave the same cells empty.
        if beside.size == 0 or np.all(beside == beside[0]):
            return mapping
    raise ValueError(
        f"a map of {width}×{height} pixels does not say its mapping; an equirectangular (lat-long) map is twice as "
        "wide as high"
    )

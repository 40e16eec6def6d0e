"""What `relume convert` reads: a map, the six faces of a cube, or a painting."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import relume as rl
from relume.errors import UnreadableFile
from relume.image.files.read_options import ReadOptions

if TYPE_CHECKING:
    from relume.sphere.environment_map import EnvironmentMap
    from relume.sphere.mappings.mapping import Mapping


def read_mapping(text: str, option: str) -> Mapping:
    from relume.sphere.mappings.names import mapping_named

    try:
        return mapping_named("strip" if text == "faces" else text)
    except ValueError as error:
        raise ValueError(f"{option}: {str(error).replace(' strip,', ' strip, faces,')}") from None


def read_input(
    paths: list[Path],
    from_: str | None,
    gamma: str | None,
    exposure: float,
    hot: list[str],
    clamp: bool,
    mirror: str | None,
    reading: ReadOptions,
) -> EnvironmentMap:
    """The light that the files hold."""
    told = None if from_ is None else read_mapping(from_, "--from")
    if gamma is not None:
        if len(paths) != 1:
            raise ValueError(f"{len(paths)} paintings; give one")
        return _painted(paths[0], gamma, exposure, hot, told)
    if len(paths) == 6:
        if from_ not in (None, "faces"):
            raise ValueError(f"--from {from_}: six files are the faces of a cube; leave it out, or give one map")
        return read_faces(paths, clamp, mirror, reading)
    if len(paths) != 1:
        raise ValueError(f"{len(paths)} files; give one map, or the six faces +X −X +Y −Y +Z −Z")
    if from_ == "faces":
        raise ValueError("--from faces: give the six files +X −X +Y −Y +Z −Z; one file with all of them is a strip")
    refuse_paintings(paths[0])
    return rl.read_environment(paths[0], told, clamp=clamp, options=reading)


def refuse_paintings(path: Path) -> None:
    """Refuse a photograph where radiance is needed, with what can be done about it."""
    from relume.image.files import has_radiance, subtype

    if not has_radiance(path):
        subtype(path)  # a damaged file is told as that
        raise UnreadableFile(
            f"{path}: a photograph or painting, whose values are no light yet; merge a bracket, or say for which "
            "display it was painted, like --gamma 2.2 or --gamma srgb"
        )


def _painted(path: Path, gamma: str, exposure: float, hot: list[str], mapping: Mapping | None) -> EnvironmentMap:
    from relume.image import files
    from relume.probe.painting import HotSpot, paint, read_gamma
    from relume.sphere.mappings.mapping import LatLong

    spots = []
    for text in hot:
        name, equals, stops = text.rpartition("=")
        if not equals:
            raise ValueError(f'--hot "{text}": write MASK=STOPS, like sun.png=12')
        try:
            spots.append(HotSpot.of_picture(files.read_photograph(name), stops=float(stops)))
        except ValueError as error:
            raise ValueError(f'--hot "{text}": {error}; write MASK=STOPS, like sun.png=10') from None
    painting = files.read_photograph(path)
    return paint(painting, read_gamma(gamma, str(path)), 2.0**exposure, spots, mapping=mapping or LatLong())


def read_faces(
    paths: list[Path], clamp: bool, mirror: str | None, reading: ReadOptions = ReadOptions()
) -> EnvironmentMap:
    """Six files as one strip; `mirror` where they do not remember for which engine they are."""
    import numpy as np

    from relume.image.radiance import RadianceMap
    from relume.sphere.environment_files import as_environment, read_light_pixels

    pictures = [read_light_pixels(path, clamp=clamp, options=reading) for path in paths]
    first, side = pictures[0], pictures[0].size[1]
    for path, picture in zip(paths, pictures, strict=True):
        if picture.size != (side, side) or picture.unit != first.unit:
            width, height = picture.size
            raise UnreadableFile(
                f"{path}: {width}×{height} pixels, {picture.unit}; the faces of a cube are six squares of one size and "
                f"unit, here {side}×{side}, {first.unit}"
            )
        if picture.attributes.get("mirror") != first.attributes.get("mirror"):
            raise UnreadableFile(f"{path}: mirrored for another engine than {paths[0]}; give six faces of one cube")
    clipped = None
    if any(picture.clipped is not None for picture in pictures):
        empty = np.zeros((side, side), np.uint8)
        clipped = np.concatenate([empty if p.clipped is None else p.clipped for p in pictures], axis=1)
    radiance = np.concatenate([picture.radiance for picture in pictures], axis=1)
    attributes = {**({"mirror": mirror} if mirror else {}), **first.attributes, "mapping": "strip"}
    return as_environment(RadianceMap(radiance, None, clipped, first.unit, attributes))

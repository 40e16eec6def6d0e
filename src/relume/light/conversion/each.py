"""`convert_each`: every picture of a folder in another format, or every environment map in another mapping."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.capture.exposure.folder import every_picture
from relume.cluster.file_tasks import FileMade, FileTask, make_each
from relume.errors import warn
from relume.image import files
from relume.image.files.encodings import SUFFIXES
from relume.image.files.read_options import ReadOptions
from relume.light.conversion.file_formats import PHOTOGRAPHS, FormatChange, change_format, require_radiance
from relume.light.conversion.maps import (
    CameraView,
    ConvertedMap,
    MapConversion,
    change_exposure,
    convert_map,
    crop_view,
    read_painting,
)
from relume.sphere.environment_files import read_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import Mapping

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster


@dataclass(frozen=True)
class MapInFile:
    """How a file is read as an environment map.

    mapping : where the file does not store it
    gamma : of the display that a painting was made for, a number or "srgb"; None for radiance
    stops : to brighten by
    hot : masks, and the stops by which a painting is brightened where each is white
    clamp : set negative pixels to 0
    """

    mapping: Mapping | None = None
    gamma: str | None = None
    stops: float = 0.0
    hot: tuple[tuple[Path, float], ...] = ()
    clamp: bool = False

    def read(self, path: Path, options: ReadOptions = ReadOptions()) -> EnvironmentMap:
        """The map that a file holds.

        path : the file
        options : limits, and how what a file leaves open is understood
        Raises UnreadableFile, ValueError.
        """
        if self.gamma is not None:
            return read_painting(path, self.gamma, self.stops, self.hot, self.mapping)
        require_radiance(path)
        return change_exposure(read_environment(path, self.mapping, clamp=self.clamp, options=options), self.stops)


@dataclass(frozen=True)
class ViewOutOfMap:
    """A perspective picture cropped out of a map, `pixels` wide and high.

    camera : where it looks, and its field of view
    pixels : width and height
    """

    camera: CameraView
    pixels: tuple[int, int] = (1024, 1024)


Conversion = FormatChange | MapConversion | ViewOutOfMap


def convert_each(
    paths: Iterable[str | os.PathLike[str]], out: str | os.PathLike[str], conversion: Conversion = FormatChange(), *,
    ending: str = ".exr", reading: MapInFile = MapInFile(), encoding: files.Encoding | None = None,
    options: ReadOptions = ReadOptions(), dry_run: bool = False,
    cluster: str | os.PathLike[str] | Client | Cluster | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> tuple[FileMade, ...]:  # fmt: skip
    """Convert files, and all pictures in folders, to `out`/name with `ending`; those that are there are kept.

    paths : files, and folders of them, with the folders inside
    out : the folder, made where it is missing
    conversion : `FormatChange` writes what a file holds in the format of `ending`, `MapConversion` the environment map
        in it in another mapping, `ViewOutOfMap` a picture out of that
    ending : of the files, like ".exr"
    reading : how files are read as maps; of no use to a `FormatChange`
    encoding : how maps and views are written; as the ending says unless given
    options : limits, and how what a file leaves open is understood
    dry_run : find and check names, and convert nothing
    cluster : None converts in this process; else as `run_tasks` takes it
    progress : called with "files" and the share of them that is settled

    Facts are those of `change_format` and `convert_map`. Raises Incomplete, with the others written, where files could
    not be converted; UnreadableFile, OutputNotWritten; ValueError for two files that would have one name.
    """
    out = Path(out).absolute()
    wanted = (
        (*SUFFIXES, *PHOTOGRAPHS) if isinstance(conversion, FormatChange) else (".exr", ".hdr", ".pic", ".tif", ".tiff")
    )
    if ending not in wanted:
        raise ValueError(f"ending {ending}: not a format for this; give one of {', '.join(dict.fromkeys(wanted))}")
    found = every_picture(paths, out)
    # Workers begin elsewhere than here.
    reading = replace(reading, hot=tuple((Path(mask).absolute(), stops) for mask, stops in reading.hot))
    value, masks = (conversion, reading, encoding, options), tuple(mask for mask, _ in reading.hot)
    tasks = [
        FileTask(path.name, (path, *masks), _targets(conversion, out / f"{_stem(path)}{ending}"), value)
        for path in found
    ]
    return make_each(_converted, tasks, out, step="files", cluster=cluster, progress=progress, dry_run=dry_run)


def _converted(task: FileTask) -> dict[str, Any]:
    """Convert one file."""
    conversion, reading, encoding, options = task.value
    path, out = task.sources[0], task.targets[0]
    if isinstance(conversion, FormatChange):
        return change_format(path, out, conversion, options)
    light = reading.read(path, options)
    if isinstance(conversion, ViewOutOfMap):
        picture = crop_view(light, conversion.camera, conversion.pixels)
        files.write(out, picture, encoding)
        return {"written": [str(out)], "size": list(picture.size), "unit": picture.unit}
    made: ConvertedMap = convert_map(light, _before_faces(conversion, out), conversion, encoding)
    for line in made.notes:
        warn(line)
    return {**made.facts, "doubts": list(made.doubts)}


def _targets(conversion: Conversion, out: Path) -> tuple[Path, ...]:
    return tuple(conversion.paths(out)) if isinstance(conversion, MapConversion) else (out,)


def _before_faces(conversion: MapConversion, out: Path) -> Path:
    """The name that `MapConversion.paths` made the first target of."""
    return out.with_stem(out.stem.rpartition("_")[0]) if conversion.faces else out


def _stem(path: Path) -> str:
    """A file's name without its ending, of which .float.gz is one."""
    return path.stem.removesuffix(".float") if path.name.lower().endswith(".float.gz") else path.stem

"""Environment maps that follow one another in one zarr store: each map is a file in it, which is read by itself.

`radiance` (N, H, W, 3) is float16 or float32, `clipped` (N, H, W) holds the codes of `RadianceMap`, and `variance`
(N, H, W, 3) is there where it was kept. Every map is one chunk, and the file of its radiance stands for it wherever a
map's file is asked for: MAPS.zarr/radiance/11.0.0.0 is the twelfth. Needs zarr, of the extra "lightstage".
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, printable
from relume.image.radiance import RadianceMap

SUFFIX = ".zarr"
KIND, VERSION = "relume environment maps", 1
RADIANCE = "radiance"
_CHUNK = re.compile(r"(\d+)\.0\.0\.0")


@dataclass(frozen=True, eq=False)
class MapStore:
    """A store that is being filled.

    path : of it
    arrays : of zarr, by their names
    """

    path: Path
    arrays: dict[str, Any]

    @classmethod
    def begun(
        cls, path: str | os.PathLike[str], count: int, rows: int, kind: type[np.floating] = np.float16, *,
        variance: bool = False, unit: str = "relative", attributes: dict[str, str] | None = None,
    ) -> MapStore:  # fmt: skip
        """An empty store of so many lat-long maps, at a path where nothing is.

        kind : float16 or float32, of the radiance
        variance : whether that is kept, as float32
        attributes : of every map
        Raises ValueError where zarr is missing.
        """
        zarr = required_zarr()
        path = Path(path)
        text = {"mapping": "latlong", **(attributes or {})}
        head = {"kind": KIND, "version": VERSION, "unit": unit, "attributes": text}
        root = zarr.create_group(str(path.absolute()), attributes=head)
        shapes = {RADIANCE: (kind, 3), "clipped": (np.uint8, 0)} | ({"variance": (np.float32, 3)} if variance else {})
        # Fast, and as small as light becomes without loss; by the checksum damage is found.
        codecs = (zarr.codecs.BloscCodec(cname="lz4", clevel=1, shuffle="shuffle"), zarr.codecs.Crc32cCodec())
        arrays = {}
        for name, (dtype, channels) in shapes.items():
            one = (rows, 2 * rows, *([channels] if channels else []))
            arrays[name] = root.create_array(
                name, shape=(count, *one), chunks=(1, *one), dtype=dtype,
                compressors=codecs,
                # One file a map, in one folder; a black one is a file as well.
                chunk_key_encoding={"name": "v2", "separator": "."}, config={"write_empty_chunks": True},
            )  # fmt: skip
        return cls(path, arrays)

    def write(self, number: int, picture: RadianceMap) -> Path:
        """Write a map, counted from 0, and give its file; several threads may do so at once.

        Raises ValueError for light that is not finite or that the store's halves cannot hold, and for variance that
        is NaN; infinite variance says that nothing is known.
        """
        stored = self.arrays[RADIANCE]
        unusable = {RADIANCE: ~np.isfinite(picture.radiance)}
        if picture.variance is not None:
            unusable["variance"] = np.isnan(picture.variance)
        for name, bad in unusable.items():
            if bad.any():
                raise ValueError(f"map {number + 1}: {name} is not finite in {int(bad.sum())} values; mend them first")
        most = float(picture.radiance.max())
        if most > float(np.finfo(stored.dtype).max):
            raise ValueError(f"a map reaches {most:.3g}, beyond the largest half, 65504; keep the store as float")
        stored[number] = picture.radiance.astype(stored.dtype)
        shape = picture.radiance.shape[:2]
        self.arrays["clipped"][number] = np.zeros(shape, np.uint8) if picture.clipped is None else picture.clipped
        if "variance" in self.arrays:
            unknown = np.full(picture.radiance.shape, np.inf, np.float32)
            self.arrays["variance"][number] = unknown if picture.variance is None else picture.variance
        return file_in_store(self.path, number)


def file_in_store(store: Path, number: int) -> Path:
    """The file that stands for a map, counted from 0."""
    return store / RADIANCE / f"{number}.0.0.0"


def number_in_store(path: str | os.PathLike[str]) -> int | None:
    """Which map of a store a file stands for, counted from 0; None for a file of no store.

    path : as `LightSequence` names the maps of a store
    """
    path = Path(path)
    found = _CHUNK.fullmatch(path.name)
    return int(found[1]) if found and path.parent.name == RADIANCE and is_map_store(path.parent.parent) else None


def name_of_map(path: Path) -> str:
    """A map's name for messages: of its file, or of its store with its number from 1."""
    number = number_in_store(path)
    return path.name if number is None else f"{path.parent.parent.name}, map {number + 1}"


def is_map_store(path: str | os.PathLike[str]) -> bool:
    """Whether a folder is a store of maps."""
    try:
        text = (Path(path) / "zarr.json").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return False
    return f'"{KIND}"' in text


def maps_in_store(path: str | os.PathLike[str]) -> tuple[Path, ...]:
    """The files of a store's maps, in order; raises UnreadableFile where one is missing, or a part of one."""
    path = Path(path)
    array, root = _opened(path)
    paths = tuple(file_in_store(path, number) for number in range(array.shape[0]))
    for number, each in enumerate(paths):
        if not each.is_file():
            raise UnreadableFile(f"{path}: map {number + 1} of {len(paths)} is missing; make the maps again")
        _require_parts(path, root, number)
    return paths


def store_facts(path: str | os.PathLike[str]) -> dict[str, Any]:
    """What a store holds, in plain values: kind "maps", format, size (width, height) and dtype of a map, frames, unit.

    Further rate, maps a second, None where the store does not say it; whether variance is there; and the attributes of
    every map. Raises UnreadableFile, also where a map is missing.
    """
    path = Path(path)
    array, root = _opened(path)
    try:
        attributes, unit = dict(root.attrs["attributes"]), str(root.attrs["unit"])
        rate = float(attributes["rate"]) if "rate" in attributes else None
        frames, height, width = (int(count) for count in array.shape[:3])
    except (KeyError, TypeError, ValueError) as error:
        raise UnreadableFile(f"{path}: a damaged store ({_words(error)}); make the maps again") from None
    maps_in_store(path)
    return {
        "file": path.name, "kind": "maps", "format": "zarr", "size": [width, height], "dtype": str(array.dtype),
        "frames": frames, "unit": unit, "rate": rate, "variance": "variance" in root, "attributes": attributes,
    }  # fmt: skip


def read_stored_map(path: str | os.PathLike[str]) -> RadianceMap:
    """The map that a file of a store stands for; raises UnreadableFile for a damaged one."""
    path = Path(path)
    store, number = path.parent.parent, number_in_store(path)
    if number is None:
        raise UnreadableFile(f"{path}: no map of a store; name the store, as maps.zarr")
    array, root = _opened(store)
    if number >= array.shape[0] or not path.is_file():
        raise UnreadableFile(f"{store}: has no map {number + 1}; it has {array.shape[0]}")
    _require_parts(store, root, number)
    try:
        radiance = np.asarray(array[number]).astype(np.float32)
        clipped = np.asarray(root["clipped"][number])
        variance = np.asarray(root["variance"][number]) if "variance" in root else None
        head = dict(root.attrs)
        return RadianceMap(radiance, variance, clipped, str(head["unit"]), dict(head["attributes"]))
    except Exception as error:  # each codec has its own
        raise UnreadableFile(f"{store}: map {number + 1} is damaged ({_words(error)}); make the maps again") from None


def required_zarr() -> Any:
    """The module zarr; ValueError that names what to install where it is missing or too old."""
    try:
        import zarr
    except ImportError:
        raise ValueError('a store needs zarr, which is not installed: pip install "relume[lightstage]"') from None
    if int(zarr.__version__.split(".")[0]) < 3:
        raise ValueError(f'a store needs zarr 3, found {zarr.__version__}: pip install -U "relume[lightstage]"')
    return zarr


def _opened(path: Path) -> tuple[Any, Any]:
    """The array of radiance and the group that it is in."""
    zarr = required_zarr()
    if not is_map_store(path):
        raise UnreadableFile(f"{path}: no store of maps; give one that relume probe made of a film")
    try:
        root = zarr.open_group(str(path.absolute()), mode="r")
        version, array = int(root.attrs["version"]), root[RADIANCE]
    except Exception as error:  # each codec has its own
        raise UnreadableFile(f"{path}: a damaged store ({_words(error)}); make the maps again") from None
    if version > VERSION:
        raise UnreadableFile(f"{path}: a store of version {version}, and {VERSION} is known; update relume")
    return array, root


def _require_parts(store: Path, root: Any, number: int) -> None:
    """Refuse a map of which an array has no file: zarr would read it as 0, which for variance is certainty."""
    for name, dimensions in (("clipped", 3), ("variance", 4)):
        part = store / name / ".".join([str(number), *["0"] * (dimensions - 1)])
        if (name == "clipped" or name in root) and not part.is_file():
            raise UnreadableFile(f"{store}: {name} of map {number + 1} is missing; make the maps again")


def _words(error: Exception) -> str:
    return " ".join(printable(str(error)).split())[:160] or type(error).__name__

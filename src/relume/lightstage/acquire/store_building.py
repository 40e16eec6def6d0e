"""Building a store of a reflectance field in one pass over its pictures: each is asked for once.

Lights are taken in groups that are a chunk deep, each by whoever is free, in this process or by a cluster's workers: no
file belongs to two groups. A group counts once all of its chunks are written and their sizes noted, so a build that
was cut short goes on with the groups that are not finished. It goes on only with what the same import began: a
fingerprint of what the values are made from is kept beside them.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import CannotResume, OutputNotWritten, UnreadableFile, warn
from relume.lightstage.acquire.store import RESUME, description, is_store, opened, unfinished
from relume.lightstage.acquire.store_place import (
    Place,
    as_place,
    chunk_sizes,
    created_group,
    is_bare,
    is_url,
    opened_group,
    reading,
    within_process,
)
from relume.lightstage.blocks import Cluster, spread
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.relighting.relighting import MEMORY, Progress, cut
from relume.renderers.progressive.fingerprint import fingerprint
from relume.sphere.map_store import required_zarr

_CHUNK = 32 * 32 * 256 * 3
"""Bytes of a chunk: large enough that opening its file costs little, small enough that a tile is read alone."""
_DEPTH, _ACROSS = 32, 256
_SHARDED = 1 << 29
"""Bytes of values from which on many chunks share a file: a stage of terabytes would be millions of files else."""
_SHARD = 64 << 20
"""Bytes of such a file before packing."""
_OPEN_CHUNKS = 32 << 20
"""Bytes for the chunks that are packed at one time, twice what a shard has where there are shards."""
COARSE = 0.02
"""Rounding by more than this part of the mean value causes a warning; pictures that fill their 8 bits stay below."""
_HALF_EXPONENT = 15
"""Each picture's largest value is kept as a half between 2¹⁴ and 2¹⁵: below 2⁻¹⁴ halves lose digits."""
_SMALLEST_EXPONENT = -126
"""Of a scale: one over it must be a float32 too."""
_LATE = ("mesh", "light_radius", "rounding")
"""Attributes that a finished store is given: no value depends on them."""


def build_store(
    field: ReflectanceField,
    path: Place,
    *,
    dtype: Any = np.float16,
    max_memory: int = MEMORY,
    progress: Progress | None = None,
    made_from: object = None,
    mesh: str | os.PathLike[str] | None = None,
    light_radius: float | None = None,
    cluster: Cluster = None,
) -> None:
    """Write a field as a store, or go on with one that was cut short.

    field : what is written
    path : a folder, or an fsspec URL
    dtype : float16 unless given. It keeps every value to 1 in 2000, down to 4·10⁻⁹ (2⁻²⁸) of the largest of its own
        picture, and smaller ones to 2·10⁻¹² (2⁻³⁹) of that. float32 keeps all. uint8 holds 255 steps up to the largest
        value of each light's picture, which is fit for what came from 8 bits
    max_memory : bytes for the pictures of a group and their chunks; 1 GiB unless given
    progress : called with the share of the work that is done, 0 to 1
    made_from : what the values depend on beside lights, camera and noise: options, the pictures' sizes and times. A
        store that was cut short is gone on with only where it is the same
    mesh : of the subject, whose absolute path is kept
    light_radius : angular radius of every light, radians, likewise
    cluster : whose workers write the groups of lights, as `relume.cluster.run_tasks` takes it; this process for None.
        Incomplete names the groups that failed; the others stay, and the same import goes on with what is missing
    Raises ValueError for values that the type cannot hold (negative in 8 bits, not finite), a radius that is none, and
    too little memory. Raises UnreadableFile for a mesh that is not there, and CannotResume where the store that is
    there belongs to another field or import. Raises OutputNotWritten where it is whole already, cannot be written, or
    lost a part meanwhile.
    Warns where 8 bits are coarse for these pictures.
    """
    mesh = None if mesh is None else Path(mesh)
    zarr, path, kind = required_zarr(), as_place(path), np.dtype(dtype)
    if kind not in (np.float16, np.float32, np.uint8):
        raise ValueError(f"dtype is {kind}; a store holds float16, float32 or uint8")
    if cluster is not None and within_process(path):
        raise ValueError(f"{path}: no worker sees the memory of this process; give a folder or another URL")
    geometry = _geometry(mesh, light_radius)
    attributes = description(field.lights, field.camera, field.noise) | {"shape": list(field.shape), "dtype": kind.name}
    attributes["made_from"] = None if made_from is None else fingerprint(made_from)
    try:
        with writing(path):
            root = _begun(zarr, path, field, kind, attributes, max_memory)
        _fill(root, path, field, max_memory, progress, cluster)
        with writing(path):
            root.update_attributes({"rounding": _rounding(path, root)} | geometry)
    except OSError as error:
        raise OutputNotWritten(f"{path}: cannot be written: {error.strerror or error}") from error


def file_facts(paths: Iterable[Path]) -> list[tuple[str, int, int]]:
    """Absolute path, bytes and time of change (ns) of files, for `build_store`'s made_from: content is not read.

    paths : files, in an order that counts; a folder stands for the files in it, hidden ones aside, by name
    """
    found = []
    for path in paths:
        files = [each for each in sorted(path.iterdir()) if each.name[0] != "."] if path.is_dir() else [path]
        found_here = [(each.resolve(), each.stat()) for each in files if not each.is_dir()]
        found += [(str(each), stat.st_size, stat.st_mtime_ns) for each, stat in found_here]
    return found


def _geometry(mesh: Path | None, light_radius: float | None) -> dict[str, Any]:
    """The attributes that `stored_geometry` reads."""
    if mesh is not None and not Path(mesh).is_file():
        raise UnreadableFile(f"{mesh}: no such file; name the mesh of the subject, or leave it out")
    if light_radius is not None and not 0 <= light_radius < np.pi:
        raise ValueError(f"light_radius is {light_radius}; expected radians, not below 0 and below π")
    return {
        "mesh": None if mesh is None else str(Path(mesh).absolute()),
        "light_radius": None if light_radius is None else float(light_radius),
    }


def _begun(
    zarr: Any, path: Path | str, field: ReflectanceField, kind: np.dtype, attributes: dict[str, Any], max_memory: int
) -> Any:
    """The store to fill: a new one, or the one that was cut short."""
    if not is_store(path) and not is_bare(path):
        raise OutputNotWritten(f"{path}: something else is there; choose another path")
    if is_store(path):
        root = opened(path, "r+")
        kept = {key: value for key, value in dict(root.attrs).items() if key not in _LATE}
        differing = sorted(key for key in attributes | kept if attributes.get(key) != kept.get(key))
        if differing == ["made_from"]:
            raise CannotResume(
                f"{path}: the store there was begun by another import: its options, or its source's files, differ; "
                "delete it, or choose another path"
            )
        if fields := [key for key in differing if key != "made_from"]:
            raise CannotResume(
                f"{path}: the store there is of another field: its {fields[0]} differs; delete it, or choose "
                "another path"
            )
        if {"values", "scale", "statistics", "sizes"} <= set(root.array_keys()):
            return root
    depth = _depth(field, kind, max_memory)
    root = created_group(zarr, path, attributes)
    shape = (len(field.lights), *field.shape, 3)
    across = min(_ACROSS, shape[2])
    down = max(1, min(_CHUNK // (_DEPTH * _ACROSS * 3 * kind.itemsize), shape[1]))
    codecs = (zarr.codecs.BloscCodec(cname="lz4", clevel=1, shuffle="shuffle"), zarr.codecs.Crc32cCodec())
    chunks, shards = (depth, down, across, 3), None
    if np.prod(shape) * kind.itemsize >= _SHARDED:
        wide = -(-shape[2] // across) * across
        rows = _SHARD // (depth * wide * 3 * kind.itemsize) // down
        shards = (depth, min(max(1, rows), -(-shape[1] // down)) * down, wide, 3)
    grid = tuple(-(-size // part) for size, part in zip(shape[:3], (shards or chunks)[:3], strict=True))
    root.create_array("values", shape=shape, dtype=kind, chunks=chunks, shards=shards, compressors=codecs)
    root.create_array("scale", shape=shape[:1], dtype=np.float32, chunks=(depth,))
    root.create_array("statistics", shape=(shape[0], 2), dtype=np.float64, chunks=(depth, 2))
    root.create_array("sizes", shape=grid, dtype=np.int64, chunks=(1, *grid[1:]))
    return root


def _depth(field: ReflectanceField, kind: np.dtype, max_memory: int) -> int:
    """Lights of a group: as many as memory holds, at most the depth of a chunk."""
    (height, width), count = field.shape, len(field.lights)
    # A picture is held as float32, as what is written, and while one of the group is rounded.
    a_light = height * width * 3 * (4 + kind.itemsize)
    rounded = height * width * 3 * 8
    packed = 3 * _SHARD if count * height * width * 3 * kind.itemsize >= _SHARDED else _OPEN_CHUNKS
    depth = min(_DEPTH, count, (max_memory - packed - rounded) // a_light)
    if depth < 1:
        raise ValueError(
            f"max_memory is {max_memory / 1e6:.0f} MB; pictures of {width}×{height} need "
            f"{np.ceil((a_light + rounded + packed) / 1e6):.0f} MB"
        )
    return int(depth)


@contextmanager
def writing(path: Path | str) -> Iterator[None]:
    """What a URL's storage says inside, as an OutputNotWritten of one line; a folder's errors stay what they are."""
    try:
        with reading(path) if is_url(path) else nullcontext():
            yield
    except UnreadableFile as error:
        if not is_url(path):
            raise
        raise OutputNotWritten(str(error)) from error


@dataclass(frozen=True, eq=False)
class _Group:
    """A group of lights to be written.

    field : all of it
    path : of the store that was begun
    number : of the group
    """

    field: ReflectanceField
    path: Path | str
    number: int


def _fill(
    root: Any,
    path: Path | str,
    field: ReflectanceField,
    max_memory: int,
    progress: Progress | None,
    cluster: Cluster,
) -> None:
    """Write the groups that are not finished, each with its sizes last, and see that all are there."""
    values, sizes = root["values"], root["sizes"]
    depth, count = values.chunks[0], len(field.lights)
    waiting = np.flatnonzero(unfinished(path, np.asarray(sizes))).tolist()
    if not waiting and "rounding" in root.attrs:
        raise OutputNotWritten(f"{path}: the store is whole already; delete it to import again")
    if depth > _depth(field, values.dtype, max_memory):
        raise ValueError(
            f"max_memory is {max_memory / 1e6:.0f} MB, less than what {path} was begun with; give more, or delete it"
        )
    where = path if isinstance(path, str) else path.absolute()
    ends = [(number * depth, min((number + 1) * depth, count) - 1) for number in waiting]
    spread(
        _write_group,
        [_Group(field, where, number) for number in waiting],
        [f"lights {first}…{last} ({field.lights.names[first]} …)" for first, last in ends],
        cluster,
        progress,
        paths=[] if isinstance(where, str) else [where],
    )
    lost = np.count_nonzero(unfinished(path, np.asarray(sizes)))
    if lost:
        raise OutputNotWritten(f"{path}: {lost} groups of lights were written and are not there; {RESUME}")


def _write_group(group: _Group) -> None:
    """Write a group's values, then what 1 stands for in each picture, and last the sizes, by which it counts."""
    zarr, field, path = required_zarr(), group.field, group.path
    with writing(path):
        root = opened_group(zarr, path, "r+")
        with zarr.config.set({"array.write_empty_chunks": True}):
            # An array that is opened again has forgotten that its chunks of nothing but zeros are to be written.
            values = root["values"]
    depth, sizes = values.chunks[0], root["sizes"]
    lights = slice(group.number * depth, min((group.number + 1) * depth, len(field.lights)))
    pictures = field.block(lights, slice(0, field.shape[0]))
    coded, steps, statistics = _coded(pictures, values.dtype, field.lights.names[lights])
    del pictures
    with writing(path):
        for rows in cut(field.shape[0], values.shards[1] if values.shards else field.shape[0]):
            values[lights, rows] = coded[:, rows]
        root["scale"][lights], root["statistics"][lights] = steps, statistics
        sizes[group.number] = chunk_sizes(path, sizes.shape, range(group.number, group.number + 1))[0]


def _coded(pictures: np.ndarray, kind: np.dtype, names: tuple[str, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Pictures in the store's type and, of each, what 1 stands for, and its mean and greatest value (n, 2).

    Raises ValueError for what the type cannot hold.
    """
    coded, steps = np.empty(pictures.shape, kind), np.ones(len(pictures), np.float32)
    statistics = np.zeros((len(pictures), 2))
    for index, (picture, name) in enumerate(zip(pictures, names, strict=True)):
        least, most = float(picture.min()), float(picture.max())
        statistics[index] = picture.mean(dtype=np.float64), most
        if not (np.isfinite(least) and np.isfinite(most)):
            raise ValueError(
                f'the picture of the light "{name}" holds values that are not finite; mend or leave it out'
            )
        if kind == np.float16:
            # A power of two changes no digit.
            exponent = int(np.frexp(max(-least, most))[1]) - _HALF_EXPONENT if least or most else 0
            steps[index] = 2.0 ** max(exponent, _SMALLEST_EXPONENT)
            coded[index] = picture * np.float32(1 / steps[index])
        elif kind == np.uint8:
            steps[index] = most / 255 if most > 0 else 1.0
            if least < -0.5 * steps[index]:
                raise ValueError(
                    f'the picture of the light "{name}" reaches {least:g}, below 0, which 8 bits cannot hold; '
                    "keep it as half floats (--dtype half, in Python half or np.float16)"
                )
            coded[index] = np.clip(np.rint(picture * np.float32(1 / steps[index])), 0, 255)
        else:
            coded[index] = picture
    return coded, steps, statistics


def _rounding(path: Path | str, root: Any) -> list[float]:
    """Variance of what rounding added, constant and slope.

    A step s of 8 bits adds s²/12, here the mean over the lights, black pictures adding nothing. A half is off by at
    most 2⁻¹¹ of the value R, so its variance is below R · (greatest R) · 2⁻²²/3; so is that of the smallest, which are
    off by at most R and 2⁻³⁹ of their picture's greatest. Both hold for R not below 0.
    """
    kind, steps = root["values"].dtype, np.asarray(root["scale"], np.float64)
    mean, greatest = np.asarray(root["statistics"]).T
    if kind == np.float32:
        return [0.0, 0.0]
    if kind == np.float16:
        return [0.0, max(float(greatest.max()), 0.0) * 2.0**-22 / 3]
    constant = float(np.mean(np.where(greatest > 0, steps**2, 0)) / 12)
    if constant**0.5 > COARSE * mean.mean():
        warn(
            f"{path}: 8 bits are coarse here: they round by {100 * constant**0.5 / mean.mean():.0f} % of the mean "
            "value, for the brightest pixels stand far above it; keep it as half floats (--dtype half, "
            "in Python half or np.float16)"
        )
    return [constant, 0.0]

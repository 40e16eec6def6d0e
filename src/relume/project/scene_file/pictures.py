"""Writing what was rendered of a scene file: one picture, numbered pictures, a movie; frames by many workers."""

from __future__ import annotations

import hashlib
import pickle
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from relume.cluster.claims import held
from relume.cluster.connection import connect
from relume.cluster.records import RECORDS, key_of, record, recorded
from relume.cluster.tasks import run_tasks
from relume.errors import OutputNotWritten, naming
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.project.forecast import memory_for
from relume.renderers.progressive.pass_workers import PassWorkers
from relume.renderers.results import Render
from relume.virtual_camera.film.film import Film


def write_picture(out: Path, picture: Render, film: Film, unit: str) -> None:
    """Write one picture in the format that its suffix names."""
    from relume.virtual_camera.developing import develop

    suffix = out.suffix.lower()
    if suffix == ".exr":
        layers: dict[str, np.ndarray] = {"radiance": picture.radiance, "matte": picture.matte}
        layers |= {"depth": picture.depth, "normal": picture.normal}
        if picture.rays is not None:
            layers["rays"] = picture.rays.astype(np.float32)
        files.write_layers(out, layers, unit=unit)
    elif suffix == ".hdr":
        files.write(out, RadianceMap(picture.radiance, unit=unit))
    else:
        files.write(out, develop(picture.radiance, film))


def write_frames(out: Path, pictures: Iterator[Render], film: Film, unit: str) -> None:
    """Write a movie, or numbered pictures into a folder, as they are rendered."""
    from relume.virtual_camera.developing import develop

    if out.suffix.lower() == ".mp4":
        from relume.image.files.video import Movie

        with Movie(out) as movie:
            for picture in _each_named(pictures):
                movie.add(develop(picture.radiance, film).pixels)
        return
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"{out}: cannot be made a folder ({error.strerror}); choose another") from None
    for index, picture in enumerate(_each_named(pictures)):
        write_picture(out / f"frame_{index + 1:04d}.png", picture, film, unit)


def _each_named(pictures: Iterator[Render]) -> Iterator[Render]:
    """The pictures; an error on the way to one has its number."""
    for number in count(1):
        with naming(f"frame {number}"):
            try:
                picture = next(pictures)
            except StopIteration:
                return
        yield picture


@contextmanager
def workers_for(out: Path, cluster: Any, pixels: int) -> Iterator[PassWorkers | None]:
    """Who makes the parts of one picture, which lie in a hidden folder beside it until it is there."""
    if cluster is None:
        yield None
        return
    folder = out.absolute().with_name(f".{out.stem}.parts")
    try:
        with held(folder), connect(cluster) as connected:
            yield PassWorkers(connected, folder, int(memory_for(pixels)))
    finally:
        # Another run may hold it: then it is not empty, and stays.
        with suppress(OSError):
            folder.rmdir()


@dataclass(frozen=True)
class PictureTask:
    """One frame for a worker.

    motion : the file in which all that the frames share is pickled, beside them
    key : a hash of it
    index : of the frame, from 0
    target : its picture
    """

    motion: Path
    key: str
    index: int
    target: Path


def spread_frames(
    out: Path, pictures: Callable[..., Iterator[Render]], count: int, film: Film, unit: str, cluster: Any,
    report: Callable[[str, float], None],
) -> None:  # fmt: skip
    """Write the frames of a motion by the workers of a cluster; those that an earlier run wrote are kept.

    pictures : called with a callback for stages and the frames that are asked for
    A movie is joined here of frames that lie in a hidden folder until it is there.
    """
    movie = out.suffix.lower() == ".mp4"
    folder = (out.with_name(f".{out.stem}.frames") if movie else out).absolute()
    targets = [folder / f"frame_{index + 1:04d}.png" for index in range(count)]
    with held(folder) as lock, connect(cluster) as connected:
        # What all frames share lies in a file, which each worker reads once.
        shared = pickle.dumps((pictures, film, unit))
        motion, key = folder / RECORDS / "motion.pickle", hashlib.sha256(shared).hexdigest()
        motion.parent.mkdir(exist_ok=True)
        with files.replacing(motion) as temporary:
            temporary.write_bytes(shared)
        run_tasks(
            _picture, [PictureTask(motion, key, index, target) for index, target in enumerate(targets)],
            names=[f"frame {index + 1}" for index in range(count)], cluster=connected, paths=[lock, motion],
            progress=lambda done, failed, to_go, left: report("rendering", (done + failed) / count),
        )  # fmt: skip
        motion.unlink()
        if movie:
            from relume.image.files.video import Movie

            with Movie(out) as file:
                for target in targets:
                    file.add(files.read_photograph(target).pixels)
    if movie:
        shutil.rmtree(folder)


def _picture(task: PictureTask) -> None:
    key = key_of([], task.key, task.index)
    if recorded(task.target, key) is None:
        pictures, film, unit = _motion(task.motion, task.key)
        write_picture(task.target, next(pictures(lambda stage, share: None, (task.index,))), film, unit)
        record(task.target, key, [])


@lru_cache(maxsize=1)
def _motion(path: Path, key: str) -> tuple[Callable[..., Iterator[Render]], Film, str]:
    """What the frames share; `key` is there for the cache alone."""
    return pickle.loads(path.read_bytes())

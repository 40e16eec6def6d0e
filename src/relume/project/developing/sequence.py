"""`develop_sequence`: many files developed, as the frames of a sequence or each by itself."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.capture.exposure.folder import every_picture
from relume.cluster.file_tasks import FileTask, make_each, refuse_clashes
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.project.developing.develop_files import (
    DevelopSettings,
    Facts,
    Progress,
    camera_for,
    develop_file,
    read_scene_light,
)
from relume.project.developing.frames import Shared, develop_frames_in
from relume.virtual_camera.tone.display.encoding import HLG, PQ, HdrGainMap, Srgb, encoded_and_clipped

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster

FIXED_MEMORY, MEMORY = 300e6, 60
"""Bytes that a worker takes to develop a frame, and more for each of its pixels; measured with 1 and 9 megapixels: 37
to 48 a pixel with plain exposure, histogram adjustment, local Reinhard and an eye's glare."""


def develop_sequence(
    paths: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str],
    settings: DevelopSettings = DevelopSettings(), *, each: bool = False, dry_run: bool = False,
    cluster: str | os.PathLike[str] | Client | Cluster | None = None,
    progress: Progress = lambda stage, share: None,
) -> Facts:  # fmt: skip
    """Develop files as the frames of a sequence, whose adaptation follows the light; returns facts by name.

    paths : the frames' files, in order, or folders of them
    out : a folder for pictures, named as the frames are, or an .mp4 (sRGB). Pictures that are there, of the same
        files, settings and adaptation, are kept
    settings : lens, film or tone operator, display, and how fast the adaptation follows
    each : every file, and all pictures in folders, by itself with its own camera and adaptation, into a folder: no
        sequence
    dry_run : read and check everything, and write nothing
    cluster : workers that develop the frames, as `run_tasks` takes them; None develops here
    progress : called with the name of each step and the share of it that is done, 0 to 1

    The camera of a sequence is chosen by the first frame that can be read and is not black. A frame that cannot be
    developed is left out of what the adaptation follows. Raises Incomplete, with the others written, where some could
    not be developed (no .mp4 is written then); ValueError, UnreadableFile, OutputNotWritten, ClusterUnusable.
    """
    if settings.depth is not None or settings.vectors is not None:
        raise ValueError("depth and vectors are of one picture; develop the frames of a sequence one by one")
    out = Path(out)
    sources = every_picture(paths, out) if each else [Path(path) for path in paths]
    if not sources:
        raise ValueError("no frames; give the files of a sequence")
    movie = out.suffix.lower() == ".mp4"
    display = settings.preset.camera.display
    suffix = ".avif" if isinstance(display, PQ | HLG) else ".jpg" if isinstance(display, HdrGainMap) else ".png"
    folder = (out.with_name(f".{out.stem}.frames") if movie else out).absolute()
    # Frames of a movie may have one name, in folders of their own.
    names = [f"frame_{index + 1:06d}" if movie else path.stem for index, path in enumerate(sources)]
    targets = [folder / f"{name}{suffix}" for name in names]
    tasks = [
        FileTask(path.name, (path.absolute(), *_files_of(settings)), (target,), None)
        for path, target in zip(sources, targets, strict=True)
    ]
    if not movie:
        refuse_clashes(tasks)
    if each:
        if movie:
            raise ValueError(f"{out}: a movie is of a sequence; name a folder for pictures that are no frames")
        tasks = [replace(task, value=_everywhere(settings)) for task in tasks]
        return _each_by_itself(tasks, out, dry_run, cluster, progress)

    # Choose the camera of all by the first frame in which there is light.
    first = _first_lit(sources, settings)
    camera, facts = camera_for(settings, first)
    if movie and camera.display != Srgb():
        raise ValueError("an .mp4 is for sRGB screens; leave the display out, or write pictures into a folder")
    if dry_run:
        return {"would write": str(out), "frames": len(sources), **({} if movie else _listed(targets)), **facts}
    shared = Shared(_everywhere(settings), camera, settings.view(first, camera))
    if movie and cluster is None:
        white, black = _movie_of(sources, out, shared, progress)
        return _summary(out, len(sources), None, facts, white, black)
    made = develop_frames_in(tasks, folder, shared, cluster, progress, memory=_memory(first))
    if movie:
        # What workers wrote is joined here.
        from relume.image.files.video import Movie

        with Movie(out, settings.frames_per_second) as file:
            for target in targets:
                file.add(files.read_photograph(target).pixels)
        shutil.rmtree(folder)
    kept = sum(each.kept for each in made)
    return _summary(out, len(made), kept, facts, max(each.white for each in made), max(each.black for each in made))


def _movie_of(paths: Sequence[Path], out: Path, shared: Shared, progress: Progress) -> tuple[float, float]:
    """Write the movie frame after frame; the most of a frame that is white and black."""
    from relume.image.files.video import Movie

    def each() -> Iterator[RadianceMap]:
        for index, path in enumerate(paths):
            progress("developing", index / len(paths))
            yield read_scene_light(path, shared.settings, lit=False)

    fps, white, black = shared.settings.frames_per_second, 0.0, 0.0
    frames = shared.camera.tone_map_frames(
        each(), repeat(shared.view), frames_per_second=fps, settling=shared.settings.settling
    )
    with Movie(out, fps) as file:
        for frame in frames:
            pixels, clipping = encoded_and_clipped(frame.values, frame.display, gain=frame.gain)
            file.add(pixels)
            white, black = max(white, *clipping.above), max(black, *clipping.below)
    progress("developing", 1.0)
    return float(white), float(black)


def _each_by_itself(tasks: Sequence[FileTask], out: Path, dry_run: bool, cluster: Any, progress: Progress) -> Facts:
    made = make_each(
        _developed_alone, tasks, out.absolute(), step="developing", cluster=cluster, progress=progress, dry_run=dry_run
    )
    if dry_run:
        return {"would write": str(out), "pictures": len(made), **_listed([each.target for each in made])}
    return {
        "written": str(out), "pictures": len(made), "kept from before": sum(each.kept for each in made),
        "white in the worst picture": max(each.facts["white"] for each in made),
        "black in the worst picture": max(each.facts["black"] for each in made),
    }  # fmt: skip


def _developed_alone(task: FileTask) -> dict[str, Any]:
    """Develop one file by itself."""
    return develop_file(task.sources[0], task.targets[0], task.value).facts


def _first_lit(paths: Sequence[Path], settings: DevelopSettings) -> RadianceMap:
    """The first frame that could be developed by itself; what is wrong with the first of all where none could."""
    refused: list[UnreadableFile | ValueError] = []
    for path in paths:
        try:
            return read_scene_light(path, settings)
        except (UnreadableFile, ValueError) as error:
            refused.append(error)
    raise refused[0]


def _listed(targets: Sequence[Path]) -> Facts:
    return {"files": [str(target) for target in targets]}


def _summary(out: Path, frames: int, kept: int | None, facts: Facts, white: float, black: float) -> Facts:
    counted = {} if kept is None else {"kept from before": kept}
    worst = {"white in the worst frame": white, "black in the worst frame": black}
    return {"written": str(out), "frames": frames, **counted, **facts, **worst}


def _everywhere(settings: DevelopSettings) -> DevelopSettings:
    """The settings with paths that hold in other folders, where workers begin."""
    paths = {name: None if (path := getattr(settings, name)) is None else Path(path).absolute() for name in _PATHS}
    return replace(settings, **paths)


_PATHS = ("response", "match")


def _files_of(settings: DevelopSettings) -> tuple[Path, ...]:
    """The files that the settings name."""
    paths = (getattr(_everywhere(settings), name) for name in _PATHS)
    return tuple(path for path in paths if path is not None)


def _memory(picture: RadianceMap) -> int:
    """Bytes that a frame takes."""
    width, height = picture.size
    return int(FIXED_MEMORY + MEMORY * width * height)

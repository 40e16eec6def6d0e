"""`reflect_each`: the reflection maps of light that changes with time, a folder for each picture of a film."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.cluster.file_tasks import FileMade, FileTask, make_each
from relume.errors import warn
from relume.light.light_sequence import LightSequence
from relume.light.reflection.files import ReflectionFiles, reflection_facts, write_reflection_maps

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster


def reflect_each(
    lights: LightSequence, out: str | os.PathLike[str], wanted: ReflectionFiles | None = None, *, rate: float = 24.0,
    dry_run: bool = False, cluster: str | os.PathLike[str] | Client | Cluster | None = None,
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> tuple[FileMade, ...]:  # fmt: skip
    """Write the reflection maps of each picture of a film under light that changes: `out`/frame_0001 and so on.

    lights : environment maps one after the other
    out : the folder, made where it is missing
    rate : pictures a second, from the first map to the last; 24 as of a cinema film
    wanted : as `write_reflection_maps`
    dry_run : check names and maps, and write nothing
    cluster : None makes them in this process; else as `run_tasks` takes it
    progress : called with "pictures" and the share of them that is settled

    What is there, made from the same maps, is kept. Facts are those of `reflection_facts`. Raises UnreadableFile,
    OutputNotWritten; Incomplete, with the others written, where some failed.
    """
    out, wanted = Path(out).absolute(), wanted or ReflectionFiles()
    lights.checked()
    tasks = []
    for number, seconds in enumerate(lights.times(rate), 1):
        moment = lights.moment(seconds)
        sources = (moment.before, moment.after) if moment.share else (moment.before,)
        folder = out / f"frame_{number:04d}"
        value = (wanted, moment.share, lights.mapping, lights.clamp)
        paths = tuple(path.absolute() for path in sources)
        tasks.append(FileTask(folder.name, paths, tuple(wanted.paths(folder)), value))
    return make_each(_reflected, tasks, out, step="pictures", cluster=cluster, progress=progress, dry_run=dry_run)


def _reflected(task: FileTask) -> dict[str, Any]:
    """Write the maps of one picture."""
    wanted, share, mapping, clamp = task.value
    light = LightSequence(task.sources, 1.0, "linear", mapping, clamp).at(share)
    folder = task.targets[0].parent
    made = write_reflection_maps(light, folder, wanted)
    for line in made.notes:
        warn(line)
    return {"error bound": made.error_bounds, "unit": light.unit, **reflection_facts(light)}

"""`insert_frames`: a shot inserted into every frame of its sequence, in this process or by the workers of a cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from relume.cluster.attempt import threads as worker_threads
from relume.cluster.claims import held
from relume.cluster.connection import connect
from relume.cluster.tasks import run_tasks
from relume.errors import Doubt, GatheredDoubts, Incomplete, IncompleteSequence, RelumeError, ranked
from relume.project.forecast import memory_for
from relume.project.insertion.agreement import gains_on_one_scale
from relume.project.insertion.frame_shots import at_frame, at_moment, moves
from relume.project.insertion.insert import insert, prepare_shot
from relume.project.insertion.outcome import Inserted
from relume.project.insertion.photographs import calibrate, plate_size, read_photographs
from relume.project.insertion.place import find_camera
from relume.project.insertion.render_change import Motion
from relume.project.insertion.sequence import (
    SequenceMade,
    assemble_frames,
    chosen_frames,
    files_named_in,
    make_frames,
)
from relume.project.shot_file.shot import Shot
from relume.project.stages import Progress, Stages, Steps
from relume.renderers.renderer import Renderer
from relume.scene.motion.keyframes import Shutter

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster


def insert_frames(
    shot: Shot, out: str | Path, *, frames: str | Iterable[int] | None = None, assemble: bool = False,
    renderer: Renderer | None = None, threads: int | None = None, progress: Progress = lambda step, share: None,
    restart: bool = False, force: Callable[[int, str], None] | None = None,
    finished: Callable[[Inserted, Path], None] = lambda result, folder: None,
    cluster: str | os.PathLike[str] | Client | Cluster | None = None,
) -> SequenceMade:  # fmt: skip
    """Insert the objects into every frame of the shot's sequence, with what moves blurred while the shutter is open.

    shot : with a [sequence]
    out : folder for frame_0001 and so on, and a movie; frames that are complete there are kept. Many processes may make
        frames of one folder at once: each frame is made by one of them. What `prepare_shot` kept there is used
    frames : these alone, as "1-9x2,12" or by their numbers; then no movie is written, which is of all frames
    assemble : make no frame, and write what all frames share: the movie. Raises IncompleteSequence where one is missing
    finished : called with each frame's result and folder before the frame counts as made; `write_report` fits
    cluster : workers that make the frames, as `run_tasks` takes them; one of them measures light, camera and
        reflectance before. All see `out` and the shot's files by the same paths. None makes all here

    renderer, threads, progress, restart and force are those of `insert`. Raises RelumeError, of which Incomplete names
    frames that failed on a cluster while the others were made; ValueError for frames that the sequence has not.
    """
    with GatheredDoubts() as gathered:
        shot = with_steady_light(shot, out, progress)
    if assemble:
        return _knowing(assemble_frames(shot, out, frames), gathered.doubts)
    if cluster is not None:
        task = FrameTask(shot, Path(out), 0, renderer, threads, restart, finished)
        return _knowing(_spread(task, frames, progress, cluster), gathered.doubts)
    shutter = shutter_of(shot)
    count, begun = len(chosen_frames(shot, frames)), [0.0]

    def share_of_all(step: str, share: float) -> None:
        progress(step, share)
        if step == "frames":
            begun[0] = share
        if step == "render":
            progress("frames", begun[0] + share / count)

    def make(frame: Shot, folder: Path, others: tuple[Path, ...]) -> Sequence[Doubt]:
        number = int(folder.name.rpartition("_")[2])
        motion = None if shutter is None else Motion(lambda time: at_moment(shot, number + time), shutter)
        result = insert(
            frame, folder, renderer=renderer, threads=threads, progress=share_of_all, others=others, motion=motion,
            restart=restart, force=force,
        )  # fmt: skip
        finished(result, folder)
        return result.doubts

    return _knowing(make_frames(shot, out, make, frames=frames, progress=share_of_all), gathered.doubts)


def shutter_of(shot: Shot) -> Shutter | None:
    """When the shutter of the sequence's frames opens and closes; None where each frame is a still."""
    if shot.sequence is None or shot.sequence.shutter is None:
        return None
    # Where only maps of light change, a frame is a still under their mean.
    if shot.light.maps is not None and not moves(shot):
        return None
    return Shutter(*shot.sequence.shutter)


def with_steady_light(shot: Shot, out: str | Path, progress: Progress = lambda step, share: None) -> Shot:
    """The shot with the light's scale and white that its first frame's plate shows, for all plates of a film.

    What a plate shows says it to a few percent, and by which pixels changes as the camera moves: measured anew in each
    frame, the objects would flicker. The very same shot where all frames have one plate, and where light.scale gives
    the white too. What was measured is kept in `out`/stages.
    """
    table = shot.sequence
    if table is None or table.plates is None or isinstance(shot.light.scale, tuple):
        return shot
    first = at_frame(shot, table.frames[0])
    steps = Steps(Stages(Path(out) / "stages"), progress)
    calibrated = calibrate(first, read_photographs(first), steps)
    fit = find_camera(first, calibrated, steps)
    red, green, blue = map(float, gains_on_one_scale(first, calibrated, fit.camera))
    light = shot.light.model_copy(update={"scale": (red, green, blue), "surface_reflectance": None})
    return shot.model_copy(update={"light": light})


def _knowing(made: SequenceMade, doubts: Iterable[Doubt]) -> SequenceMade:
    """The frames with what the user should know of all of them."""
    return replace(made, doubts=ranked([*made.doubts, *doubts]))


@dataclass(frozen=True, eq=False)
class FrameTask:
    """What a worker is given to make one frame of; the arguments of `insert_frames`."""

    shot: Shot
    out: Path
    number: int
    renderer: Renderer | None
    threads: int | None
    restart: bool
    finished: Callable[[Inserted, Path], None]


def _spread(task: FrameTask, frames: str | Iterable[int] | None, progress: Progress, cluster: Any) -> SequenceMade:
    """The frames by the workers of a cluster, which coordinate by the files in the folder of results alone."""
    # Workers begin in other folders than this process.
    shot = task.shot.model_copy(update={"folder": task.shot.folder.absolute()})
    out = task.out.absolute()
    # All shots first, so that a wrong key is reported before hours of rendering.
    numbers = chosen_frames(shot, frames)
    shots = [at_frame(shot, number) for number in numbers]
    tasks = [replace(task, shot=shot, out=out, number=number) for number in numbers]
    width, height = plate_size(read_photographs(shots[0]))

    def counted(done: int, failed: int, to_go: int, seconds_left: float | None) -> None:
        progress("frames", (done + failed) / len(numbers))

    with held(out) as lock, connect(cluster) as connected:
        # What all frames share, once.
        try:
            run_tasks(
                _prepared, tasks[:1], cluster=connected, memory=int(memory_for(width * height)),
                paths=[lock, *files_named_in(shots[-1])],
            )  # fmt: skip
        except Incomplete as error:
            raise RelumeError(error.failed[0][1]) from None
        kept = run_tasks(
            _frame_made, tasks, names=[f"frame {number}" for number in numbers], cluster=connected, progress=counted
        )
        # The frames as they lie there.
        if frames is None:
            made = assemble_frames(shot, out)
        else:
            made = make_frames(shot, out, _not_there, frames=numbers)
    return replace(made, frames=tuple(replace(f, kept=k) for f, k in zip(made.frames, kept, strict=True)))


def _prepared(task: FrameTask) -> None:
    prepare_shot(task.shot, task.out, frame=task.number)


def _frame_made(task: FrameTask) -> bool:
    """Make a frame, unless that was done; whether it was."""
    made = insert_frames(
        task.shot, task.out, frames=[task.number], renderer=task.renderer, threads=task.threads or worker_threads(),
        restart=task.restart, finished=task.finished,
    )  # fmt: skip
    return made.frames[0].kept


def _not_there(shot: Shot, folder: Path, others: tuple[Path, ...]) -> Sequence[Doubt]:
    raise IncompleteSequence(f"{folder}: made by a worker, and not seen from here; give all machines one folder")

"""`insert`: from a shot's photographs to a picture with objects in it that were never there.

A chain of results, each a frozen value made by one function from those before it:
photographs → calibrated → place → change → composite.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from relume.cluster.claims import held
from relume.cluster.connection import connect
from relume.errors import GatheredDoubts, ranked, warn
from relume.project.forecast import memory_for, require_room
from relume.project.insertion.agreement import on_one_scale
from relume.project.insertion.composite import begin_plate_look, composited, development_of, plate_look
from relume.project.insertion.doubts import doubts_at_borders, doubts_on
from relume.project.insertion.frame_shots import at_frame
from relume.project.insertion.outcome import Inserted, require_folder, write_outcome, write_picture
from relume.project.insertion.photographs import calibrate, plate_size, read_photographs
from relume.project.insertion.place import find_camera, find_place
from relume.project.insertion.prepared import PreparedShot
from relume.project.insertion.quick_look import (
    SmallShot,
    look_about,
    quick,
    quick_renderer,
    rough_shot,
    small_shot,
)
from relume.project.insertion.render_change import AROUND, Motion, Rendering, render_change
from relume.project.shot_file.objects import doubts_about, placed_meshes
from relume.project.shot_file.shot import Shot
from relume.project.stages import Progress, Stages, Steps
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.progressive.graceful_shutdown import HardStop
from relume.renderers.progressive.pass_workers import PassWorkers
from relume.renderers.renderer import Renderer

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster


def insert(
    shot: Shot,
    out: str | Path,
    *,
    renderer: Renderer | None = None,
    threads: int | None = None,
    progress: Progress = lambda step, share: None,
    others: tuple[Path, ...] = (),
    motion: Motion | None = None,
    restart: bool = False,
    force: Callable[[int, str], None] | None = None,
    preview: bool = False,
    cluster: str | os.PathLike[str] | Client | Cluster | None = None,
    about: tuple[float, float] | None = None,
) -> Inserted:
    """Do the whole job and write composite.exr and .png, layers.exr, light.exr and response.json.

    shot : as `read_shot` or `Shot.new` made it
    out : folder; stages kept there from an earlier run are used where nothing they depend on has changed, and an
        interrupted render is resumed
    renderer : Differential with the shot's settings unless given; of another renderer two pictures are subtracted
    threads : to render with; all cores unless given. The pixels do not depend on it
    progress : called with the name of each step and the share of it that is done, 0 to 1
    others : folders of stages of other shots, which serve where they were made from the same
    motion : what moves while the shutter is open; None for a still
    restart : discard the saved state of an interrupted render
    force : for programs that own their process: ends it at once, with `os._exit`, where native code keeps Python from
        doing so. Called in a thread of its own, 4 s after a first Ctrl-C, with the signal's number and what to say
    preview : a quick look instead: over a small copy of the plate with few rays, written to preview.exr and .png. What
        it finds in the photographs is kept for the job itself. A second look takes a few seconds. A rough picture comes
        first, and the step "first picture" says when
    cluster : workers that trace the passes, as `run_tasks` takes them, or the parts of a large plate; all else is done
        here. All see `out` by the same path. The bits are those of one process; None renders here
    about : the place, shares of the picture's width and height, whose surroundings previews show first; the step
        "around the pointer" says when. The result is the same

    `write_report` makes a page of the result. Raises RelumeError; nothing is written to `out` but kept stages
    and previews before everything is computed.
    """
    out = Path(out)
    require_folder(out)
    steps = Steps(Stages(out / "stages", others), progress)
    if cluster is not None:
        _check_spread(renderer, motion, preview)
    if preview:
        return _quick_look(shot, out, steps, renderer, threads, about)
    with GatheredDoubts() as gathered, ExitStack() as stack:
        # Photographs → calibrated → place → change → composite.
        meshes = placed_meshes(shot)
        with steps.timed("photographs"):
            photographs = read_photographs(shot)
        across, down = plate_size(photographs)
        require_room(out, across * down)
        workers = None
        if cluster is not None:
            # At once, so that nobody measures for minutes before a scheduler is found not to answer.
            stack.enter_context(held(out))
            connected = stack.enter_context(connect(cluster))
            workers = PassWorkers(connected, out / "stages", int(memory_for(across * down)))
        calibrated = calibrate(shot, photographs, steps)
        del photographs
        fit = find_camera(shot, calibrated, steps)
        calibrated = on_one_scale(shot, calibrated, fit.camera)
        development = development_of(shot, calibrated)
        begin_plate_look(shot, calibrated, development, steps)
        place = find_place(shot, calibrated, fit, meshes, renderer, steps)
        rendering = Rendering(renderer, threads, motion, restart, force and HardStop(force), workers, about)
        change = render_change(shot, calibrated, place, meshes, development.film, steps, rendering)
        composite = composited(shot, calibrated, place, change, development, steps)
        # What the user should know.
        doubts = (
            *doubts_about(meshes, place.camera, place.bare.local),
            *doubts_on(calibrated, place, composite.change.matte if meshes else None, shot.light.scale),
            *doubts_at_borders(calibrated, place, composite.change, meshes),
        )
    # Nothing but kept stages was written until here.
    doubts = ranked([*gathered.doubts, *doubts])
    result = Inserted(calibrated, place, composite, steps.seconds, tuple(steps.kept), doubts)
    with steps.timed("write"):
        write_outcome(result, out, steps.stages)
        steps.stages.mapped.release()
    return result


def _check_spread(renderer: Renderer | None, motion: Motion | None, preview: bool) -> None:
    """Refuse to spread over workers what has no parts for them."""
    if renderer is not None and not isinstance(renderer, Differential):
        raise ValueError(
            f"cluster: its workers trace the passes of rl.Differential, and {type(renderer).__name__} has none; leave "
            "one of them out"
        )
    if preview or motion is not None:
        what = "a quick look is over before workers are ready" if preview else "frames with motion are whole tasks"
        raise ValueError(f"cluster: {what}; leave it out")


def _quick_look(
    shot: Shot, out: Path, steps: Steps, renderer: Renderer | None, threads: int | None,
    about: tuple[float, float] | None,
) -> Inserted:  # fmt: skip
    """The same chain over a small copy of the plate, whose own stages are kept apart; over a smaller one before."""
    folder = steps.stages.folder / "preview"
    own = Steps(Stages(folder), steps.progress, steps.seconds, steps.kept)
    first = Steps(Stages(folder / "rough"), steps.progress)
    known = first.stages.folder.is_dir()
    with GatheredDoubts() as gathered:
        meshes = placed_meshes(shot)
        small = small_shot(shot, steps)
        shot, rough = quick(shot), rough_shot(small)

        def looked(small: SmallShot, steps: Steps) -> Inserted:
            place = find_place(shot, small.calibrated, small.fit, meshes, renderer, steps)
            development = development_of(shot, small.calibrated)
            rendering = Rendering(renderer or quick_renderer(shot, threads))
            change = render_change(shot, small.calibrated, place, meshes, development.film, steps, rendering)
            composite = composited(shot, small.calibrated, place, change, development, steps)
            return Inserted(small.calibrated, place, composite, steps.seconds, tuple(steps.kept), ())

        # A rough picture at once, where an earlier look has found its place.
        if known:
            with GatheredDoubts():
                roughly = looked(rough, first)
                write_picture(roughly, out, "preview")
            steps.progress("first picture", 1.0)
            # Then what is looked at, in the rough picture.
            if about is not None:
                chosen = renderer if isinstance(renderer, Differential) else quick_renderer(shot, threads)
                with GatheredDoubts():
                    place = find_place(shot, small.calibrated, small.fit, meshes, renderer, own)
                    look_about(shot, small, place, roughly.composite, about, meshes, chosen, out)
                steps.progress(AROUND, 1.0)
        result = looked(small, own)
        doubts = (
            *doubts_about(meshes, result.camera, result.place.bare.local),
            *doubts_at_borders(result.calibrated, result.place, result.change, meshes),
        )
    with steps.timed("write"):
        write_picture(result, out, "preview")
    # For the next look to begin with.
    if not known:
        with GatheredDoubts():
            find_place(shot, rough.calibrated, rough.fit, meshes, renderer, first)
            first.stages.folder.mkdir(exist_ok=True)
    return replace(result, doubts=ranked([*gathered.doubts, *doubts]))


def prepare_shot(
    shot: Shot, out: str | Path, *, frame: int | None = None, progress: Progress = lambda step, share: None
) -> PreparedShot:
    """The shot ready to be rendered, for another program: all but the render is done, its stages kept in `out`.

    shot : as `read_shot` or `Shot.new` made it
    out : the folder that `insert` would write to; it is made where it is missing
    frame : of the shot's sequence. What all frames share, `insert_frames` then takes from `out`, in however many
        processes; each frame still has to measure a plate of its own. Unless given, the shot as if it had no sequence
    progress : called with the name of each step and the share of it that is done, 0 to 1
    Raises RelumeError. Warns of doubtful measurements, and of objects that hover, sink or are far too large or small.
    """
    out = Path(out)
    require_folder(out)
    steps = Steps(Stages(out / "stages"), progress)
    if frame is not None:
        shot = at_frame(shot, frame)
    meshes = placed_meshes(shot)
    calibrated = calibrate(shot, read_photographs(shot), steps)
    fit = find_camera(shot, calibrated, steps)
    calibrated = on_one_scale(shot, calibrated, fit.camera)
    place = find_place(shot, calibrated, fit, meshes, None, steps)
    development = development_of(shot, calibrated)
    if frame is not None:
        plate_look(shot, calibrated, development, steps)
    own = doubts_on(calibrated, place, None, shot.light.scale)
    for doubt in (*doubts_about(meshes, place.camera, place.bare.local), *own):
        warn(doubt.line, doubt.effect)
    scene = place.relit(shot).adding(*meshes)
    return PreparedShot(
        scene, place.camera, calibrated.plate, development.photograph, development.film,
        samples=shot.render.samples, depth=shot.render.depth,
    )  # fmt: skip

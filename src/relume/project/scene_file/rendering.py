"""Rendering a scene file: the renderer that shows it, then one picture, numbered pictures, a movie or its light."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from relume.errors import warn
from relume.image import files
from relume.project.scene_file.frame_plan import frame_plan, require_own_frames
from relume.project.scene_file.metering import metered_scene
from relume.project.scene_file.pictures import Sessions, join_frames, make_frames, render_into, workers_for
from relume.project.scene_file.renders import Pictures, Report, mitsuba_of, require_shown
from relume.project.scene_file.scene_file import SceneFile
from relume.project.scene_file.settings import (
    RendererName,
    RenderSettings,
    check_plate,
    check_region,
    renderer_name,
    whitted_of,
)
from relume.renderers.progressive.graceful_shutdown import HardStop
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.virtual_camera.film.film import Film

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster


@dataclass(frozen=True, eq=False)
class RenderedScene:
    """What was rendered.

    renderer : its name
    film : what developed pictures were made with
    size : width and height in pixels
    shapes : how many the scene holds
    frames : how many were asked for; None of one picture
    kept : how many of them an earlier run had made
    """

    renderer: RendererName
    film: Film
    size: tuple[int, int]
    shapes: int
    frames: int | None = None
    kept: int = 0


def render_scene(
    read: SceneFile, out: str | Path, settings: RenderSettings = RenderSettings(), *,
    dry_run: bool = False, report: Report = lambda name, share: None,
    cluster: str | os.PathLike[str] | Client | Cluster | None = None, restart: bool = False, preview: bool = False,
    force: Callable[[int, str], None] | None = None,
) -> RenderedScene:  # fmt: skip
    """Render a scene file into one picture (.exr with matte, depth and normals, .hdr, .png, .jpg), a folder or an .mp4.

    read : the scene file, read
    settings : renderer and its quality, size, frames; the file's own unless given
    out : the picture; a folder for numbered pictures, or an .mp4, of a motion (`settings.frames`) or of the scene
        file's sequence. Frames that are there, made from the same, are kept; so is a movie's hidden folder of frames
        until it is whole. Many processes may make frames of a sequence in one folder
    dry_run : check everything and render nothing
    report : called with the name of each step and the share of it that is done, 0 to 1
    cluster : workers that make the frames, or of one picture the passes (mitsuba) or the rows (whitted), as `run_tasks`
        takes them; None makes them here. The bits are the same
    restart : discard the saved state of an interrupted render, which is else resumed (mitsuba)
    preview : show what there is of the picture under way as .preview.png beside it, or in the folder, while it is made
    force : as in `insert`: how a first Ctrl-C is answered in time, for programs that own their process
    Raises ValueError for settings that do not go together, UnsupportedScene, OutputNotWritten. Raises Interrupted,
    which leaves the state of a render to a later run, and Incomplete for frames that failed on a cluster while the
    others were written.
    """
    out = Path(out)
    # Refuse what cannot be before any work.
    plan = frame_plan(read, out, settings)
    movie = out.suffix.lower() == ".mp4"
    one = plan is None or (bool(out.suffix) and not movie)
    name = renderer_name(read, settings, moving=plan is not None)
    require_shown(read, name, plan)
    check_region(read, settings)
    check_plate(read, settings)
    if cluster is not None and one and name not in ("mitsuba", "whitted"):
        by = "prefiltered maps" if name == "prefiltered" else name
        raise ValueError(
            f"cluster: one picture by {by} has no parts for workers, for what is prepared for it takes the time; leave "
            "it out, or give --frames N"
        )
    if cluster is not None and one and plan is not None and plan.shutter is not None:
        raise ValueError("cluster: its workers make whole frames of what moves; give a folder, or leave cluster out")
    if plan is not None and one and plan.numbers[1:]:
        warn(
            f"frame {plan.numbers[0]} of {len(plan.numbers)} is rendered; give a folder or an .mp4 for all, or "
            "--frames N for another"
        )
    if plan is not None and not one and not movie:
        require_own_frames(out, plan, ".png")
    film = metered_scene(read.scene).brighter(settings.exposure)
    left, top, right, bottom = settings.region or (0, 0, read.camera.width, read.camera.height)
    shapes = len(read.scene.local) + len(read.scene.objects)
    count = None if plan is None or one else len(plan.numbers)
    result = RenderedScene(name, film, (right - left, bottom - top), shapes, count)
    if dry_run:
        return result
    # Render, and write each picture as soon as it is there.
    unit, pictures = read.scene.light.unit, Pictures(read, settings, plan, name)
    sessions = Sessions(film, restart, preview, force and HardStop(force))
    if one:
        with workers_for(out, cluster, (right - left) * (bottom - top)) as workers:
            number = 1 if plan is None else plan.numbers[0]
            render_into(out, pictures, number, film, unit, report, sessions, workers)
        return result
    assert plan is not None  # else it is one picture
    folder = (out.with_name(f".{out.stem}.frames") if movie else out).absolute()
    kept = make_frames(folder, pictures, ".png", film, unit, cluster=cluster, report=report, sessions=sessions)
    if movie:
        join_frames(out, folder, plan)
        shutil.rmtree(folder)
    return replace(result, kept=kept)


def render_environment(
    read: SceneFile, out: str | Path, point: ArrayLike, settings: RenderSettings = RenderSettings(), *,
    rows: int = 512, dry_run: bool = False, report: Report = lambda name, share: None,
) -> EnvironmentMap | None:  # fmt: skip
    """Render the equirectangular (lat-long) environment map of the scene seen from a point, and write it.

    read : the scene file, read
    out : the map, .exr or .hdr
    point : metres, world
    settings : renderer and its quality; the file's own unless given
    rows : the map is twice as wide
    dry_run : check the settings and render nothing; None is returned
    report : called with the name of each step and the share of it that is done, 0 to 1
    Miller & Hoffman (1984), §5.2. Raises as `render_scene`.
    """
    from relume.renderers.environment_probe import environment

    if settings.denoise:
        raise ValueError("denoise is for pictures: the six faces of a map would no longer meet; leave it out")
    name = renderer_name(read, settings, "environment map")
    require_shown(read, name, None)
    renderer = whitted_of(read, settings) if name == "whitted" else mitsuba_of(settings)
    if dry_run:
        return None
    light = environment(
        read.scene, point, renderer, size=rows, seed=settings.seed or 0,
        progress=lambda share: report("rendering", share),
    )  # fmt: skip
    files.write(out, as_radiance_map(light))
    return light

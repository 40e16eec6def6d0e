"""Rendering a scene file: the renderer that shows it, then one picture, numbered pictures, a movie or its light."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from relume.errors import warn
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.project.scene_file.lights import metered_scene
from relume.project.scene_file.pictures import spread_frames, workers_for, write_frames, write_picture
from relume.project.scene_file.scene_file import SceneFile
from relume.renderers.progressive.accumulation import RenderSession
from relume.renderers.progressive.pass_workers import PassWorkers
from relume.renderers.results import Render
from relume.scene.materials.whitted import WhittedMaterial
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.virtual_camera.film.film import Film

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster
    from relume.renderers.mitsuba.path_tracer import Mitsuba
    from relume.renderers.prefiltered.prefiltered import Prefiltered, Prepared
    from relume.renderers.turntable import Orbit, Turntable
    from relume.renderers.whitted.whitted import Whitted

RendererName = Literal["mitsuba", "prefiltered", "whitted"]
FilterName = Literal["plain", "subdivision", "quadrilateral", "preintegrated", "mip"]
Shown = Literal["picture", "ray tree", "environment map"]
Report = Callable[[str, float], None]
"""Called with the name of what is done and its share, 0 to 1."""
ALL: tuple[RendererName, ...] = ("mitsuba", "prefiltered", "whitted")
FOR: dict[str, tuple[RendererName, ...]] = {
    "filter": ("prefiltered",),
    "plate": ("prefiltered",),
    "samples": ("mitsuba",),
    "seed": ("mitsuba", "whitted"),
    "depth": ("whitted",),
    "rays": ("whitted",),
    "contribution": ("whitted",),
    "constellation": ("whitted",),
    "subdivisions": ("whitted",),
    "tolerance": ("whitted",),
    "region": ("whitted",),
    "frames": ("prefiltered", "whitted"),
    "ray tree": ("whitted",),
    "environment map": ("mitsuba", "whitted"),
}
"""The renderers that a setting or a kind of picture means something to; what is not here means something to all."""


@dataclass(frozen=True, eq=False)
class RenderSettings:
    """How a scene file is rendered; None leaves a setting to the file, or to the renderer's own default.

    renderer : unless given, the first that the other settings allow and that can shade the scene
    filter : prefiltered: how a pixel reads the maps; preintegrated unless given
    plate : prefiltered: a radiance map of the picture's size, to matte the objects over
    samples : mitsuba: rays a pixel; 256 unless given
    seed : mitsuba, whitted: of what is random; 0 unless given
    depth, rays, contribution, constellation : whitted: see `Whitted`
    subdivisions, tolerance : whitted: see `Antialiasing`
    region : whitted: left, top, right and bottom in pixels, the part of the picture that is rendered
    frames : prefiltered, whitted: this many pictures of a motion; one picture of the scene as it stands unless given
    motion : of frames; a turntable unless given, or unless orbits of the file move its objects
    degrees : how far the motion goes; 360 unless given
    exposure : stops to brighten developed pictures by; at 0 they are metered by the scene's lights
    threads : all cores unless given
    """

    renderer: RendererName | None = None
    filter: FilterName | None = None
    plate: RadianceMap | None = None
    samples: int | None = None
    seed: int | None = None
    depth: int | None = None
    rays: int | None = None
    contribution: float | None = None
    constellation: int | None = None
    subdivisions: int | None = None
    tolerance: float | None = None
    region: tuple[int, int, int, int] | None = None
    frames: int | None = None
    motion: Literal["turntable", "orbit"] | None = None
    degrees: float | None = None
    exposure: float = 0.0
    threads: int | None = None


@dataclass(frozen=True, eq=False)
class RenderedScene:
    """What was rendered.

    renderer : its name
    film : what developed pictures were made with
    size : width and height in pixels
    shapes : how many the scene holds
    """

    renderer: RendererName
    film: Film
    size: tuple[int, int]
    shapes: int


def render_scene(
    read: SceneFile, out: str | Path, settings: RenderSettings = RenderSettings(), *,
    dry_run: bool = False, report: Report = lambda name, share: None,
    cluster: str | os.PathLike[str] | Client | Cluster | None = None,
) -> RenderedScene:  # fmt: skip
    """Render a scene file into one picture (.exr with matte, depth and normals, .hdr, .png, .jpg), a folder or an .mp4.

    out : the picture; with `settings.frames` a folder for numbered pictures, or an .mp4
    dry_run : check everything and render nothing
    cluster : workers that make the frames, or of one picture the passes (mitsuba) or the rows (whitted), as `run_tasks`
        takes them; None makes them here. The bits are the same
    Raises ValueError for settings that do not go together, UnsupportedScene, OutputNotWritten; Incomplete for frames
    that failed on a cluster, while the others were written.
    """
    out, name = Path(out), renderer_name(read, settings)
    # Refuse what cannot be before any work.
    check_region(read, settings)
    _check_plate(read, settings)
    if settings.degrees is not None and settings.motion is None and read.moves:
        raise ValueError("degrees say how far a motion goes, and the scene file's orbits say that; give the motion too")
    if cluster is not None and settings.frames is None and name == "prefiltered":
        raise ValueError(
            "cluster: one picture by prefiltered maps has no parts for workers, for its tables take the time; leave it "
            "out, or give --frames N"
        )
    film = metered_scene(read.scene).brighter(settings.exposure)
    left, top, right, bottom = settings.region or (0, 0, read.camera.width, read.camera.height)
    shapes = len(read.scene.local) + len(read.scene.objects)
    result = RenderedScene(name, film, (right - left, bottom - top), shapes)
    if dry_run:
        return result
    # Render, and write each picture as soon as it is there.
    by = {"mitsuba": _by_mitsuba, "prefiltered": _by_maps, "whitted": _by_trees}[name]
    unit = read.scene.light.unit
    if settings.frames is None:
        with workers_for(out, cluster, (right - left) * (bottom - top)) as workers:
            write_picture(out, next(by(read, settings, report, workers=workers)), film, unit)
    elif cluster is None:
        write_frames(out, by(read, settings, report), film, unit)
    else:
        spread_frames(out, partial(by, read, settings), settings.frames, film, unit, cluster, report)
    return result


def render_environment(
    read: SceneFile, out: str | Path, point: ArrayLike, settings: RenderSettings = RenderSettings(), *,
    rows: int = 512, dry_run: bool = False, report: Report = lambda name, share: None,
) -> EnvironmentMap | None:  # fmt: skip
    """Render the equirectangular (lat-long) environment map of the scene seen from a point, and write it.

    point : metres, world
    rows : the map is twice as wide
    dry_run : check the settings and render nothing; None is returned
    Miller & Hoffman (1984), §5.2. Raises as `render_scene`.
    """
    from relume.renderers.environment_probe import environment

    name = renderer_name(read, settings, "environment map")
    renderer = whitted_of(read, settings) if name == "whitted" else _mitsuba(settings)
    if dry_run:
        return None
    light = environment(
        read.scene, point, renderer, size=rows, seed=settings.seed or 0,
        progress=lambda share: report("rendering", share),
    )  # fmt: skip
    files.write(out, as_radiance_map(light))
    return light


def renderer_name(read: SceneFile, settings: RenderSettings, shown: Shown = "picture") -> RendererName:
    """The renderer that the settings allow and the scene needs; raises ValueError where there is none."""
    from relume.renderers.mitsuba.scene import why_not

    left = _allowed(settings, shown)
    # What the scene needs: Whitted for its own table, materials and orbits, else light transport where that can.
    orbits = settings.frames is not None and read.moves
    shapes = (*read.scene.local, *read.scene.objects)
    if read.asks_whitted or orbits or any(isinstance(shape.material, WhittedMaterial) for shape in shapes):
        wanted: RendererName = "whitted"
    elif why_not(read.scene) is None and "mitsuba" in left:
        wanted = "mitsuba"
    else:
        wanted = "whitted" if read.scene.lights else "prefiltered"
    # Whitted shades nearly everything in its way; the others refuse what they have no place for.
    if read.asks_whitted and "whitted" not in left and settings.renderer is None:
        raise ValueError(
            "the scene file's [whitted] table needs the renderer whitted, and a given setting is not for it; leave "
            "the setting out, or name the renderer"
        )
    if wanted not in left:
        wanted = "whitted" if "whitted" in left else left[0]
    if orbits and wanted != "whitted":
        raise ValueError(f"the scene file's orbits need the renderer whitted, not {wanted}; leave one of them out")
    return wanted


def whitted_of(read: SceneFile, settings: RenderSettings) -> Whitted:
    """The scene file's Whitted renderer with the given settings; subdivisions bring antialiasing back."""
    from relume.renderers.whitted.antialiasing import Antialiasing

    def given(*names: str) -> dict[str, Any]:
        return {name: value for name in names if (value := getattr(settings, name)) is not None}

    method, finer = read.whitted, given("subdivisions", "tolerance")
    antialiasing = replace(method.antialiasing or Antialiasing(), **finer) if finer else method.antialiasing
    changed = given("depth", "rays", "contribution", "constellation", "threads")
    return replace(method, antialiasing=antialiasing, **changed)


def check_region(read: SceneFile, settings: RenderSettings) -> None:
    """Raises ValueError for a region that is no part of the picture."""
    if settings.region is not None:
        (left, top, right, bottom), camera = settings.region, read.camera
        if not (0 <= left < right <= camera.width and 0 <= top < bottom <= camera.height):
            raise ValueError(
                f"region {left},{top},{right},{bottom} is not a part of a picture of {camera.width}×{camera.height} "
                f"pixels; left and top begin at 0, right and bottom end at {camera.width} and {camera.height}"
            )


def _allowed(settings: RenderSettings, shown: Shown) -> list[RendererName]:
    """The renderers that every given setting is for, the preferred one first."""
    left: list[RendererName] = list(ALL) if settings.renderer is None else [settings.renderer]
    against = f"the renderer {settings.renderer} is given"
    for name, allowed in FOR.items():
        if name != shown and getattr(settings, name, None) is None:
            continue
        both: list[RendererName] = [each for each in left if each in allowed]
        whose = f"{name} is for the renderer {' or '.join(allowed)}"
        if not both:
            see = " (a plate under light transport: relume insert)" if name == "plate" else ""
            raise ValueError(f"{whose}, but {against}; leave one of them out{see}")
        if len(both) < len(left):
            left, against = both, whose
    return left


def _check_plate(read: SceneFile, settings: RenderSettings) -> None:
    camera, plate = read.camera, settings.plate
    if plate is not None and plate.size != (camera.width, camera.height):
        raise ValueError(
            f"the plate is {plate.size[0]}×{plate.size[1]} pixels, the picture {camera.width}×{camera.height}; "
            f"give the picture the size {plate.size[0]}x{plate.size[1]}"
        )


def _mitsuba(settings: RenderSettings) -> Mitsuba:
    from relume.renderers.mitsuba.path_tracer import Mitsuba

    return Mitsuba(samples=256 if settings.samples is None else settings.samples, threads=settings.threads)


def _prefiltered(settings: RenderSettings) -> Prefiltered:
    from relume.renderers.prefiltered import filters
    from relume.renderers.prefiltered.prefiltered import Prefiltered

    kinds = {
        "plain": filters.Plain,
        "subdivision": filters.Subdivision,
        "quadrilateral": filters.Quadrilateral,
        "preintegrated": filters.Preintegrated,
        "mip": filters.Mip,
    }
    kind = kinds[settings.filter or "preintegrated"]
    return Prefiltered(kind(), background=settings.plate is None, threads=settings.threads)


def _motion(read: SceneFile, settings: RenderSettings) -> Orbit | Turntable:
    """The motion about the middle of the scene's objects, a turntable unless given."""
    from relume.renderers import turntable as motions
    from relume.scene.shapes.shapes import bounds

    x, y, z = bounds(read.scene.objects).mean(axis=0)
    angle = math.radians(360.0 if settings.degrees is None else settings.degrees)
    kind = motions.Orbit if settings.motion == "orbit" else motions.Turntable
    return kind((float(x), float(y), float(z)), angle)


def _by_mitsuba(
    read: SceneFile, settings: RenderSettings, report: Report, workers: PassWorkers | None = None
) -> Iterator[Render]:
    """One picture by light transport."""
    yield _mitsuba(settings).render(
        read.scene, read.camera, seed=settings.seed or 0, progress=lambda share: report("rendering", share),
        watch=RenderSession(workers=workers),
    )  # fmt: skip


def _prepared_maps(read: SceneFile, settings: RenderSettings) -> Prepared:
    return _prefiltered(settings).prepared(read.scene)


_kept_maps = lru_cache(maxsize=1)(_prepared_maps)
"""For single frames, whose tables are those of the frame before as long as scene and settings are the very same."""


def _by_maps(
    read: SceneFile, settings: RenderSettings, report: Report, only: Sequence[int] | None = None,
    workers: PassWorkers | None = None,
) -> Iterator[Render]:  # fmt: skip
    """One picture, or a motion's, by prefiltered environment maps; in no parts for workers."""
    assert workers is None
    from relume.composite.differential import over
    from relume.renderers.turntable import frames

    report("tables", 0.0)
    make = _prepared_maps if only is None else _kept_maps
    prepared = make(read, settings)
    report("tables", 1.0)
    if settings.frames is None:
        pictures = iter([prepared.render(read.camera)])
    else:
        pictures = frames(prepared, read.camera, _motion(read, settings), settings.frames, only)
    for index, picture in enumerate(pictures):
        if settings.plate is not None:
            picture = replace(picture, radiance=over(picture.radiance, picture.matte, settings.plate.radiance))
        report("rendering", (index + 1) / (settings.frames or 1))
        yield picture


def _by_trees(
    read: SceneFile, settings: RenderSettings, report: Report, only: Sequence[int] | None = None,
    workers: PassWorkers | None = None,
) -> Iterator[Render]:  # fmt: skip
    """One picture, or a motion's, by Whitted's trees: the file's orbits, and a motion unless they are all there is."""
    from relume.renderers import turntable as motions
    from relume.scene.motion.moving_objects import left_in_space

    def rendering(share: float) -> None:
        report("rendering", share)

    method, seed = whitted_of(read, settings), settings.seed or 0
    if settings.frames is None:
        prepared = method.prepared(read.scene)
        picture = prepared.render(read.camera, seed=seed, region=settings.region, progress=rendering, workers=workers)
        _warn_of_darkness(picture, method, read)
        yield picture
        return
    motion = None if read.moves and settings.motion is None else _motion(read, settings)
    orbits = read.orbits or (None,) * len(read.scene.objects)
    turning = isinstance(motion, motions.Turntable)
    moving = [solid for solid, orbit in zip(read.scene.objects, orbits, strict=True) if turning or orbit is not None]
    if left := left_in_space(moving):
        warn(f"checks and waves lie in space: {', '.join(left)} will move through them")
    yield from motions.traced_frames(
        method, read.at, read.camera, motion, settings.frames, seed=seed, region=settings.region, progress=rendering,
        only=only,
    )  # fmt: skip


def _warn_of_darkness(picture: Render, method: Whitted, read: SceneFile) -> None:
    """Warn where all surfaces that are seen are black, for a lamp is easily put where it shines on nothing."""
    from scipy.ndimage import binary_erosion

    # Without the outlines, where the background is seen beside them.
    inner = np.asarray(binary_erosion(picture.depth > 0, [[True] * 3] * 3), bool)
    surfaces = picture.radiance[inner]
    if not len(surfaces) or surfaces.any():
        return
    unlit = not method.constellation and read.scene.light.radiance.any()
    reason = "the light map lights nothing while constellation is 0" if unlit else "is a lamp inside a shape, or below?"
    warn(f"no light reaches the surfaces that are seen, so they are black; {reason}")

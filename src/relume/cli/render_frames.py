"""What `relume render` renders and writes: one picture, numbered pictures in a folder, or a movie."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from relume.cli.arguments import made_folder

if TYPE_CHECKING:
    import numpy as np

    from relume.cli.render_choice import Region
    from relume.image.radiance import RadianceMap
    from relume.project.scene_file.scene_file import SceneFile
    from relume.renderers.prefiltered.filters import Filter
    from relume.renderers.results import Render
    from relume.renderers.turntable import Orbit, Turntable
    from relume.renderers.whitted.whitted import Whitted
    from relume.scene.scene import Scene
    from relume.virtual_camera.film.film import Film

Report = Callable[[str, float], None]


@dataclass(frozen=True)
class Movie:
    """What --frames, --motion and --degrees say: how many pictures of which motion, and how far it goes."""

    frames: int
    motion: Literal["turntable", "orbit"] | None = None
    degrees: float | None = None

    def way(self, scene: Scene) -> Orbit | Turntable:
        """The motion about the middle of the scene's objects, a turntable unless told."""
        from relume.renderers import turntable as motions
        from relume.scene.shapes.bounds import bounds

        x, y, z = bounds(scene.objects).mean(axis=0)
        angle = math.radians(360.0 if self.degrees is None else self.degrees)
        return (motions.Orbit if self.motion == "orbit" else motions.Turntable)((float(x), float(y), float(z)), angle)


def by_mitsuba(read: SceneFile, *, samples: int, seed: int, threads: int | None, report: Report) -> Iterator[Render]:
    """One picture by light transport."""
    from relume.renderers.mitsuba.path_tracer import Mitsuba

    method = Mitsuba(samples=samples, threads=threads)
    yield method.render(read.scene, read.camera, seed=seed, progress=lambda share: report("rendering", share))


def by_maps(
    read: SceneFile,
    movie: Movie | None,
    *,
    filter: str,
    plate: RadianceMap | None,
    threads: int | None,
    report: Report,
) -> Iterator[Render]:
    """One picture, or a movie's, by reflection maps."""
    from relume.composite.layering import over
    from relume.renderers.prefiltered.prefiltered import Prefiltered
    from relume.renderers.turntable import frames

    report("tables", 0.0)
    prepared = Prefiltered(_filter(filter), background=plate is None, threads=threads).prepared(read.scene)
    report("tables", 1.0)
    if movie is None:
        pictures = iter([prepared.render(read.camera)])
    else:
        pictures = frames(prepared, read.camera, movie.way(read.scene), movie.frames)
    for index, picture in enumerate(pictures):
        if plate is not None:
            picture = replace(picture, radiance=over(picture.radiance, picture.matte, plate.radiance))
        report("rendering", (index + 1) / (1 if movie is None else movie.frames))
        yield picture


def by_trees(
    method: Whitted, read: SceneFile, movie: Movie | None, *, seed: int, region: Region | None, report: Report
) -> Iterator[Render]:
    """One picture, or a movie's, by Whitted's trees: the file's orbits, and a motion unless they are all there is."""
    from relume.renderers import turntable as motions
    from relume.scene.motion.moving_objects import left_in_space

    def rendering(share: float) -> None:
        report("rendering", share)

    if movie is None:
        picture = method.prepared(read.scene).render(read.camera, seed=seed, region=region, progress=rendering)
        _tell_of_darkness(picture, method, read)
        yield picture
        return
    way = None if read.moves and movie.motion is None else movie.way(read.scene)
    orbits = read.orbits or (None,) * len(read.scene.objects)
    turning = isinstance(way, motions.Turntable)
    moving = [solid for solid, orbit in zip(read.scene.objects, orbits, strict=True) if turning or orbit is not None]
    if left := left_in_space(moving):
        warnings.warn(f"checks and waves lie in space: {', '.join(left)} will move through them", stacklevel=2)
    yield from motions.traced_frames(
        method, read.at, read.camera, way, movie.frames, seed=seed, region=region, progress=rendering
    )


def _tell_of_darkness(picture: Render, method: Whitted, read: SceneFile) -> None:
    """Warn where all surfaces that are seen are black, for a lamp is easily put where it shines on nothing."""
    import numpy as np
    from scipy.ndimage import binary_erosion

    # Without the outlines, where the background is seen beside them.
    inner = np.asarray(binary_erosion(picture.depth > 0, [[True] * 3] * 3), bool)
    surfaces = picture.radiance[inner]
    if not len(surfaces) or surfaces.any():
        return
    unlit = not method.constellation and read.scene.light.radiance.any()
    reason = "the light map lights nothing while constellation is 0" if unlit else "is a lamp inside a shape, or below?"
    warnings.warn(f"no light reaches the surfaces that are seen, so they are black; {reason}", stacklevel=3)


def write_picture(out: Path, picture: Render, film: Film, unit: str) -> None:
    """Write one picture in the format that its suffix names."""
    import numpy as np

    from relume.image import files
    from relume.image.radiance import RadianceMap
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
        from relume.image.files.video import Movie as MovieFile

        with MovieFile(out) as file:
            for picture in pictures:
                file.add(develop(picture.radiance, film).pixels)
        return
    made_folder(out)
    for index, picture in enumerate(pictures):
        write_picture(out / f"frame_{index + 1:04d}.png", picture, film, unit)


def _filter(name: str) -> Filter:
    from relume.renderers.prefiltered import filters

    ways: dict[str, type[Filter]] = {
        "plain": filters.Plain,
        "subdivision": filters.Subdivision,
        "quadrilateral": filters.Quadrilateral,
        "preintegrated": filters.Preintegrated,
        "mip": filters.Mip,
    }
    return ways[name]()

"""`relume render`: a scene in, a picture, frames or a movie out."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from relume.cli.arguments import DryRun, Threads, require_files, require_suffix
from relume.cli.console import Manner, progress, speaking, tell

if TYPE_CHECKING:
    import numpy as np

    from relume.develop.film import Film
    from relume.image.radiance import RadianceMap
    from relume.render.filters import Filter
    from relume.render.renderer import Render
    from relume.scene.camera import Camera
    from relume.scene.scene import Scene

PICTURES = (".exr", ".hdr", ".png", ".jpg", ".jpeg")
FILTERS = Literal["plain", "subdivision", "quadrilateral", "preintegrated", "mip"]


def render(
    scene: Annotated[Path, Parameter(help="A scene file, .toml, or a mesh: .glb, .gltf, .obj, .ply or .stl.")],
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The picture, .exr with matte, depth and normals, .hdr, .png or .jpg; "
            "with --frames a folder or an .mp4.",
        ),
    ],
    renderer: Annotated[
        Literal["mapped", "mitsuba"],
        Parameter(help="mapped: reflection maps, in no time and without shadows; mitsuba: light transport."),
    ] = "mitsuba",
    light: Annotated[
        Path | None, Parameter(help="The illumination map, .exr or .hdr, instead of the scene file's.")
    ] = None,
    size: Annotated[str | None, Parameter(help="WIDTHxHEIGHT in pixels, instead of the scene file's.")] = None,
    filter: Annotated[
        FILTERS, Parameter(help="mapped: how a pixel reads the maps (Miller & Hoffman 1984, §8; mip: Williams 1983).")
    ] = "preintegrated",
    plate: Annotated[
        Path | None, Parameter(help="mapped: a radiance map to matte the objects over, of the picture's size.")
    ] = None,
    samples: Annotated[int, Parameter(help="mitsuba: rays a pixel.")] = 256,
    seed: Annotated[int, Parameter(help="mitsuba: another seed for its noise.")] = 0,
    frames: Annotated[int | None, Parameter(help="mapped: this many pictures of a motion.")] = None,
    motion: Annotated[
        Literal["turntable", "orbit"],
        Parameter(help="turntable: the objects turn; orbit: the camera goes round them, counter-clockwise."),
    ] = "turntable",
    degrees: Annotated[float, Parameter(help="How far, with --frames.", allow_leading_hyphen=True)] = 360.0,
    exposure: Annotated[
        float,
        Parameter(help="Stops to brighten .png, .jpg and .mp4 by; negative darkens.", allow_leading_hyphen=True),
    ] = 0.0,
    threads: Threads = None,
    dry_run: DryRun = False,
    manner: Manner = Manner(),
) -> None:
    """Render a scene under an illumination map, as one picture or as frames of a motion."""
    from relume.develop.film import metered
    from relume.image import files
    from relume.render.mapped import Mapped

    with speaking(manner):
        _check(out, renderer, frames, plate)
        world, camera = _read(scene, light, size)
        behind = files.read_radiance(plate) if plate is not None else None
        if behind is not None and behind.size != (camera.width, camera.height):
            raise ValueError(
                f"--plate {plate} is {behind.size[0]}×{behind.size[1]} pixels, the picture "
                f"{camera.width}×{camera.height}; give --size {behind.size[0]}x{behind.size[1]}"
            )
        told = {"shapes": len(world.local) + len(world.objects), "size": f"{camera.width}×{camera.height}"}
        if dry_run:
            tell(manner, {"would write": str(out), **told})
            return
        film = metered(world.light).brighter(exposure)
        with progress(manner) as report:
            if renderer == "mitsuba":
                from relume.render.mitsuba import Mitsuba

                method = Mitsuba(samples=samples, threads=threads)
                picture = method.render(world, camera, seed=seed, progress=lambda share: report("rendering", share))
                _write(out, picture, film, world.light.unit)
            else:
                report("tables", 0.0)
                prepared = Mapped(_filter(filter), background=behind is None, threads=threads).prepared(world)
                report("tables", 1.0)
                if frames is None:
                    _write(out, _matted(prepared.render(camera), behind), film, world.light.unit)
                else:
                    from relume.render import motion as motions

                    way = math.radians(degrees)
                    moving = motions.Turntable(way) if motion == "turntable" else motions.Orbit(_middle(world), way)
                    pictures = (_matted(p, behind) for p in motions.frames(prepared, camera, moving, frames))
                    counted = _counting(pictures, frames, lambda share: report("rendering", share))
                    _write_frames(out, counted, film, world.light.unit)
        tell(manner, {"written": str(out), **told})


def _check(out: Path, renderer: str, frames: int | None, plate: Path | None) -> None:
    """Refuse what cannot be, before any work."""
    if renderer != "mapped" and (frames is not None or plate is not None):
        option = "--plate" if frames is None else "--frames"
        raise ValueError(f"{option} is for --renderer mapped; for mitsuba in photographs see relume insert")
    if frames is not None and frames < 1:
        raise ValueError(f"--frames is {frames}; give 1 or more")
    if frames is None:
        require_suffix(out, *PICTURES)
    elif out.suffix.lower() == ".mp4":
        require_suffix(out, ".mp4")
    elif out.suffix:
        raise ValueError(f"-o {out}: with --frames give a folder for numbered pictures, or an .mp4")
    if plate is not None:
        require_files([plate])


def _read(path: Path, light: Path | None, size: str | None) -> tuple[Scene, Camera]:
    from relume.image import files
    from relume.shot.scene_file import read_scene, scene_of_mesh
    from relume.sphere.illumination import as_illumination

    require_files([path, *([light] if light is not None else [])])
    if path.suffix.lower() == ".toml":
        read = read_scene(path)
        scene = read.scene
        if light is not None:
            scene = replace(scene, light=as_illumination(files.read_radiance(light)))
    elif light is None:
        raise ValueError(f"{path}: a mesh brings no light; give --light MAP, or a scene file")
    else:
        read = scene_of_mesh(path, light)
        scene = read.scene
    return scene, read.camera if size is None else _resized(read.camera, size)


def _resized(camera: Camera, size: str) -> Camera:
    """The same field of view across, in other pixels."""
    try:
        width, height = (int(word) for word in size.lower().replace("×", "x").split("x"))
    except ValueError:
        raise ValueError(f'--size: "{size}" is no size; write WIDTHxHEIGHT, like 1280x720') from None
    return replace(camera, width=width, height=height, focal_length=camera.focal_length * width / camera.width)


def _filter(name: str) -> Filter:
    from relume.render import filters

    ways: dict[str, type[Filter]] = {
        "plain": filters.Plain,
        "subdivision": filters.Subdivision,
        "quadrilateral": filters.Quadrilateral,
        "preintegrated": filters.Preintegrated,
        "mip": filters.Mip,
    }
    return ways[name]()


def _middle(scene: Scene) -> tuple[float, float, float]:
    """The middle of the objects' bounding box."""
    import numpy as np

    from relume.scene.shapes import Sphere

    points = [
        np.add.outer([-o.radius, o.radius], np.asarray(o.centre)) if isinstance(o, Sphere) else o.vertices
        for o in scene.objects
    ]
    every = np.concatenate(points) if points else np.zeros((1, 3))
    x, y, z = (every.min(0) + every.max(0)) / 2
    return float(x), float(y), float(z)


def _matted(picture: Render, plate: RadianceMap | None) -> Render:
    from relume.composite.layering import over

    return (
        picture if plate is None else replace(picture, radiance=over(picture.radiance, picture.matte, plate.radiance))
    )


def _counting(pictures: Iterator[Render], count: int, report: Callable[[float], None]) -> Iterator[Render]:
    for index, picture in enumerate(pictures):
        yield picture
        report((index + 1) / count)


def _write(out: Path, picture: Render, film: Film, unit: str) -> None:
    from relume.develop.film import develop
    from relume.image import files
    from relume.image.radiance import RadianceMap

    suffix = out.suffix.lower()
    if suffix == ".exr":
        layers: dict[str, np.ndarray] = {"radiance": picture.radiance, "matte": picture.matte}
        files.write_layers(out, layers | {"depth": picture.depth, "normal": picture.normal}, unit=unit)
    elif suffix == ".hdr":
        files.write(out, RadianceMap(picture.radiance, unit=unit))
    else:
        files.write(out, develop(picture.radiance, film))


def _write_frames(out: Path, pictures: Iterator[Render], film: Film, unit: str) -> None:
    from relume.develop.film import develop
    from relume.errors import OutputNotWritten

    if out.suffix.lower() == ".mp4":
        from relume.image.files.video import Movie

        with Movie(out) as movie:
            for picture in pictures:
                movie.add(develop(picture.radiance, film).pixels)
        return
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"-o {out}: cannot be made a folder ({error.strerror}); choose another") from None
    for index, picture in enumerate(pictures):
        _write(out / f"frame_{index + 1:04d}.png", picture, film, unit)

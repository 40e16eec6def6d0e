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
from relume.errors import UnreadableFile

if TYPE_CHECKING:
    import numpy as np

    from relume.develop.film import Film
    from relume.image.radiance import RadianceMap
    from relume.render.filters import Filter
    from relume.render.renderer import Render
    from relume.scene.camera import Camera
    from relume.scene.scene import Scene

SCENES = (".toml", ".glb", ".gltf", ".obj", ".ply", ".stl")
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
        Literal["mapped", "mitsuba"] | None,
        Parameter(
            help="mitsuba: light transport; mapped: reflection maps, without noise and without shadows. mitsuba unless "
            "an option or a material (mirror, glossy, retroreflector, glass) is for mapped alone."
        ),
    ] = None,
    light: Annotated[
        Path | None, Parameter(help="The illumination map, .exr or .hdr, instead of the scene file's.")
    ] = None,
    size: Annotated[str | None, Parameter(help="WIDTHxHEIGHT in pixels, instead of the scene file's.")] = None,
    filter: Annotated[
        FILTERS | None,
        Parameter(
            help="mapped: how a pixel reads the maps (Miller & Hoffman 1984, §8; mip: Williams 1983); preintegrated "
            "unless given."
        ),
    ] = None,
    plate: Annotated[
        Path | None, Parameter(help="mapped: a radiance map to matte the objects over, of the picture's size.")
    ] = None,
    samples: Annotated[int | None, Parameter(help="mitsuba: rays a pixel; 256 unless given.")] = None,
    seed: Annotated[int | None, Parameter(help="mitsuba: another seed for its noise.")] = None,
    frames: Annotated[int | None, Parameter(help="mapped: this many pictures of a motion.")] = None,
    motion: Annotated[
        Literal["turntable", "orbit"] | None,
        Parameter(
            help="With --frames. turntable: the objects turn; orbit: the camera goes round; both counter-clockwise "
            "from above. turntable unless given."
        ),
    ] = None,
    degrees: Annotated[
        float | None, Parameter(help="With --frames: how far; 360 unless given.", allow_leading_hyphen=True)
    ] = None,
    exposure: Annotated[
        float,
        Parameter(
            help="Stops to brighten .png, .jpg and .mp4 by; at 0 they are metered: the light's mean radiance is ½.",
            allow_leading_hyphen=True,
        ),
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
        for_mapped = {"--filter": filter, "--plate": plate, "--frames": frames}
        _check(
            out,
            renderer,
            for_mapped,
            {"--samples": samples, "--seed": seed},
            {"--motion": motion, "--degrees": degrees},
        )
        world, camera = _read(scene, light, size)
        if renderer is None:
            renderer = "mapped" if _needs_maps(world) or any(v is not None for v in for_mapped.values()) else "mitsuba"
        behind = files.read_radiance(plate) if plate is not None else None
        if behind is not None and behind.size != (camera.width, camera.height):
            raise ValueError(
                f"--plate {plate} is {behind.size[0]}×{behind.size[1]} pixels, the picture "
                f"{camera.width}×{camera.height}; give --size {behind.size[0]}x{behind.size[1]}"
            )
        film = metered(world.light).brighter(exposure)
        told = {
            "renderer": renderer,
            "shapes": len(world.local) + len(world.objects),
            "size": f"{camera.width}×{camera.height}",
            "exposure": film.exposure,
        }
        if dry_run:
            tell(manner, {"would write": str(out), **told})
            return
        with progress(manner) as report:
            if renderer == "mitsuba":
                from relume.render.mitsuba import Mitsuba

                method = Mitsuba(samples=256 if samples is None else samples, threads=threads)
                picture = method.render(
                    world, camera, seed=seed or 0, progress=lambda share: report("rendering", share)
                )
                _write(out, picture, film, world.light.unit)
            else:
                report("tables", 0.0)
                prepared = Mapped(
                    _filter(filter or "preintegrated"), background=behind is None, threads=threads
                ).prepared(world)
                report("tables", 1.0)
                if frames is None:
                    _write(out, _matted(prepared.render(camera), behind), film, world.light.unit)
                else:
                    from relume.render import motion as motions

                    way = math.radians(360.0 if degrees is None else degrees)
                    moving = (motions.Orbit if motion == "orbit" else motions.Turntable)(_middle(world), way)
                    pictures = (_matted(p, behind) for p in motions.frames(prepared, camera, moving, frames))
                    counted = _counting(pictures, frames, lambda share: report("rendering", share))
                    _write_frames(out, counted, film, world.light.unit)
        tell(manner, {"written": str(out), **told})


def _check(
    out: Path,
    renderer: str | None,
    for_mapped: dict[str, object],
    for_mitsuba: dict[str, object],
    for_frames: dict[str, object],
) -> None:
    """Refuse what cannot be, before any work."""
    given = [name for name, value in for_mapped.items() if value is not None]
    other = [name for name, value in for_mitsuba.items() if value is not None]
    moving = [name for name, value in for_frames.items() if value is not None]
    if renderer == "mitsuba" and given:
        raise ValueError(f"{given[0]} is for --renderer mapped; for mitsuba in photographs see relume insert")
    if other and (renderer == "mapped" or given):
        raise ValueError(f"{other[0]} is for --renderer mitsuba; reflection maps have no noise")
    frames, plate = for_mapped["--frames"], for_mapped["--plate"]
    if moving and frames is None:
        raise ValueError(f"{moving[0]} tells how things move; give --frames N too")
    if isinstance(frames, int) and frames < 1:
        raise ValueError(f"--frames is {frames}; give 1 or more")
    if frames is None and out.suffix.lower() == ".mp4":
        raise ValueError(f"-o {out}: a movie needs --frames N")
    if frames is None:
        require_suffix(out, *PICTURES)
    elif out.suffix.lower() == ".mp4":
        require_suffix(out, ".mp4")
    elif out.suffix:
        raise ValueError(f"-o {out}: with --frames give a folder for numbered pictures, or an .mp4")
    elif left := sorted(path.name for path in out.glob("frame_*.png"))[frames if isinstance(frames, int) else 0 :]:
        raise ValueError(f"-o {out}: holds frames of another movie, from {left[0]} on; remove them")
    if isinstance(plate, Path):
        require_files([plate])


def _needs_maps(scene: Scene) -> bool:
    from relume.scene.reflective import Reflective

    return any(isinstance(shape.material, Reflective) for shape in scene.objects)


def _read(path: Path, light: Path | None, size: str | None) -> tuple[Scene, Camera]:
    from relume.image import files
    from relume.shot.scene_file import SIZE, read_scene, scene_of_mesh
    from relume.sphere.illumination import as_illumination

    require_files([path, *([light] if light is not None else [])])
    if path.suffix.lower() not in SCENES:
        raise UnreadableFile(f"{path}: neither a scene file nor a mesh; give {', '.join(SCENES)}")
    if path.suffix.lower() == ".toml":
        read = read_scene(path)
        scene = read.scene
        if light is not None:
            scene = replace(scene, light=as_illumination(files.read_radiance(light)))
    elif light is None:
        raise ValueError(f"{path}: a mesh brings no light; give --light MAP, or a scene file")
    else:
        scene = (read := scene_of_mesh(path, light, SIZE if size is None else _read_size(size))).scene
    return scene, read.camera if size is None else _resized(read.camera, size)


def _resized(camera: Camera, size: str) -> Camera:
    """The same field of view across, in other pixels."""
    width, height = _read_size(size)
    return replace(camera, width=width, height=height, focal_length=camera.focal_length * width / camera.width)


def _read_size(size: str) -> tuple[int, int]:
    try:
        width, height = (int(word) for word in size.lower().replace("×", "x").split("x"))
    except ValueError:
        raise ValueError(f'--size: "{size}" is no size; write WIDTHxHEIGHT, like 1280x720') from None
    if width < 1 or height < 1:
        raise ValueError(f"--size: {size} holds no pixels; write WIDTHxHEIGHT, like 1280x720")
    return width, height


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

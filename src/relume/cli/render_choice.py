"""What `relume render` makes of its words: which renderer they and the scene ask for, and what cannot be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from relume.cli.arguments import require_files, require_suffix
from relume.cli.render_tree import DRAWINGS
from relume.errors import UnreadableFile

if TYPE_CHECKING:
    from relume.project.scene_file.scene_file import SceneFile
    from relume.renderers.mitsuba.path_tracer import Mitsuba
    from relume.renderers.whitted.whitted import Whitted
    from relume.scene.cameras.camera import Camera

Name = Literal["mapped", "mitsuba", "whitted"]
Region = tuple[int, int, int, int]
SCENES = (".toml", ".glb", ".gltf", ".obj", ".ply", ".stl")
PICTURES = (".exr", ".hdr", ".png", ".jpg", ".jpeg")
LARGEST = 65536
"""Pixels along a side of a picture, as in the scene file."""
FOR: dict[str, tuple[Name, ...]] = {
    "--filter": ("mapped",),
    "--plate": ("mapped",),
    "--samples": ("mitsuba",),
    "--seed": ("mitsuba", "whitted"),
    "--depth": ("whitted",),
    "--rays": ("whitted",),
    "--contribution": ("whitted",),
    "--constellation": ("whitted",),
    "--subdivisions": ("whitted",),
    "--tolerance": ("whitted",),
    "--region": ("whitted",),
    "--tree": ("whitted",),
    "--frames": ("mapped", "whitted"),
    "--environment": ("mitsuba", "whitted"),
}
"""The renderers that an option means something to; an option that is not here means something to all."""


def renderers_for(options: Mapping[str, object], renderer: Name | None) -> list[Name]:
    """The renderers that all options given (not None) are for, at best the first.

    Raises ValueError naming two options that go with none together.
    """
    left: list[Name] = ["mitsuba", "mapped", "whitted"] if renderer is None else [renderer]
    against = f"--renderer {renderer} is given"
    for name, allowed in FOR.items():
        if options.get(name) is None:
            continue
        both: list[Name] = [each for each in left if each in allowed]
        whose = f"for --renderer {' or '.join(allowed)}"
        if not both:
            see = " (mitsuba in photographs: relume insert)" if name == "--plate" else ""
            raise ValueError(f"{name} is {whose}, but {against}; leave one of them out{see}")
        if len(both) < len(left):
            left, against = both, f"{name} is {whose}"
    return left


def chosen(read: SceneFile, left: list[Name], *, given: bool, moving: bool) -> Name:
    """The renderer among those left that can show what the scene holds; raises ValueError for orbits that none shows.

    given : whether the renderer was named
    moving : whether frames are asked for
    """
    from relume.renderers.mitsuba.scene import why_not
    from relume.scene.materials.whitted import WhittedMaterial

    orbits = moving and read.moves
    shapes = (*read.scene.local, *read.scene.objects)
    if read.asks_whitted or orbits or any(isinstance(shape.material, WhittedMaterial) for shape in shapes):
        wanted: Name = "whitted"
    elif why_not(read.scene) is None and "mitsuba" in left:
        wanted = "mitsuba"
    else:
        wanted = "whitted" if read.scene.lights else "mapped"
    # Whitted shades nearly everything in its way; the others refuse what they have no place for.
    if read.asks_whitted and "whitted" not in left and not given:
        raise ValueError(
            "the scene file's [whitted] table asks for the renderer whitted, and an option that was given is not for "
            "it; leave the option out, or give --renderer too"
        )
    if wanted not in left:
        wanted = "whitted" if "whitted" in left else left[0]
    if orbits and wanted != "whitted":
        raise ValueError(f"the scene file's orbits are for --renderer whitted, not for {wanted}; leave one of them out")
    return wanted


def check_output(out: Path, frames: int | None, for_frames: Mapping[str, object]) -> None:
    """Refuse what cannot be written, before any work.

    for_frames : options that tell how things move
    """
    moving = [name for name, value in for_frames.items() if value is not None]
    if moving and frames is None:
        raise ValueError(f"{moving[0]} tells how things move; give --frames N too")
    if frames is not None and frames < 1:
        raise ValueError(f"--frames is {frames}; give 1 or more")
    if frames is None and out.suffix.lower() == ".mp4":
        raise ValueError(f"-o {out}: a movie needs --frames N")
    if frames is None:
        require_suffix(out, *PICTURES)
    elif out.suffix.lower() == ".mp4":
        require_suffix(out, ".mp4")
    elif out.suffix:
        raise ValueError(f"-o {out}: with --frames give a folder for numbered pictures, or an .mp4")
    elif left := sorted(path.name for path in out.glob("frame_*.png"))[frames:]:
        raise ValueError(f"-o {out}: holds frames of another movie, from {left[0]} on; remove them")


def check_drawing(out: Path, others: Mapping[str, object]) -> None:
    """Refuse what cannot be drawn of a tree, before any work.

    others : options that ask for pictures
    """
    given = [name for name, value in others.items() if value is not None]
    if given:
        raise ValueError(f"--tree draws one pixel's rays, and {given[0]} asks for pictures; leave one of them out")
    require_suffix(out, *DRAWINGS)


def check_environment(out: Path, others: Mapping[str, object]) -> None:
    """Refuse what no environment can be, before any work.

    others : options that ask for pictures
    """
    given = [name for name, value in others.items() if value is not None]
    if given:
        raise ValueError(f"--environment shows all directions, and {given[0]} asks for pictures; leave one of them out")
    require_suffix(out, ".exr", ".hdr")


def mitsuba_with(samples: int | None, threads: int | None) -> Mitsuba:
    """Light transport with what the command line says."""
    from relume.renderers.mitsuba.path_tracer import Mitsuba

    return Mitsuba(samples=256 if samples is None else samples, threads=threads)


def read_file(path: Path, light: Path | None, size: str | None) -> SceneFile:
    """The scene file, or the mesh as one, under this light and in this size where they are given."""
    from relume.image import files
    from relume.project.scene_file.scene_file import SIZE, read_scene, scene_of_mesh
    from relume.sphere.environment_files import as_environment

    require_files([path, *([light] if light is not None else [])])
    if path.suffix.lower() == ".bpt":
        raise UnreadableFile(f'{path}: patches have no material; write patches = "{path.name}" in a scene file')
    if path.suffix.lower() not in SCENES:
        raise UnreadableFile(f"{path}: neither a scene file nor a mesh; give {', '.join(SCENES)}")
    if path.suffix.lower() == ".toml":
        read = read_scene(path)
        if light is not None:
            try:
                found = as_environment(files.read_radiance(light))
            except ValueError as error:
                raise ValueError(f"--light {light}: {error}") from None
            read = replace(read, scene=replace(read.scene, light=found))
    elif light is None:
        raise ValueError(f"{path}: a mesh brings no light; give --light MAP, or a scene file")
    else:
        read = scene_of_mesh(path, light, SIZE if size is None else read_size(size))
    return read if size is None else replace(read, camera=_resized(read.camera, size))


def whitted_with(
    method: Whitted,
    *,
    depth: int | None,
    rays: int | None,
    subdivisions: int | None,
    tolerance: float | None,
    contribution: float | None,
    constellation: int | None,
    threads: int | None,
) -> Whitted:
    """The scene file's renderer with what the command line says otherwise; subdivisions bring antialiasing back."""
    from relume.renderers.whitted.antialiasing import Antialiasing

    given = {"depth": depth, "rays": rays, "contribution": contribution}
    given |= {"constellation": constellation, "threads": threads}
    finer = {"subdivisions": subdivisions, "tolerance": tolerance}
    finer = {name: value for name, value in finer.items() if value is not None}
    antialiasing = replace(method.antialiasing or Antialiasing(), **finer) if finer else method.antialiasing
    return replace(
        method, antialiasing=antialiasing, **{name: value for name, value in given.items() if value is not None}
    )


def read_region(text: str, camera: Camera) -> Region:
    """Four numbers of pixels from text like "0,0,320,240"; raises ValueError where they are no part of the picture."""
    try:
        left, top, right, bottom = (int(word) for word in text.replace(",", " ").split())
    except ValueError:
        raise ValueError(
            f'--region: "{text}" is no part of a picture; write LEFT,TOP,RIGHT,BOTTOM in pixels, like 0,0,320,240'
        ) from None
    if not (0 <= left < right <= camera.width and 0 <= top < bottom <= camera.height):
        raise ValueError(
            f"--region {text} is no part of a picture of {camera.width}×{camera.height} pixels; "
            f"left and top begin at 0, right and bottom end at {camera.width} and {camera.height}"
        )
    return left, top, right, bottom


def _resized(camera: Camera, size: str) -> Camera:
    """The same field of view across, in other pixels."""
    width, height = read_size(size)
    return camera.resized(width, height)


def read_size(size: str) -> tuple[int, int]:
    """Width and height in pixels of text like "1280x720"; raises ValueError where they are none."""
    try:
        width, height = (int(word) for word in size.lower().replace("×", "x").split("x"))
    except ValueError:
        raise ValueError(f'--size: "{size}" is no size; write WIDTHxHEIGHT, like 1280x720') from None
    if width < 1 or height < 1:
        raise ValueError(f"--size: {size} holds no pixels; write WIDTHxHEIGHT, like 1280x720")
    if max(width, height) > LARGEST:
        raise ValueError(f"--size: {size} is too large; give at most {LARGEST} pixels along a side")
    return width, height

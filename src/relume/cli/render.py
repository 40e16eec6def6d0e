"""`relume render`: a scene in, a picture, frames or a movie out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from relume.cli.arguments import DryRun, Threads, require_files
from relume.cli.console import OutputOptions, print_facts, progress, warnings_as_notes

if TYPE_CHECKING:
    from relume.image.radiance import RadianceMap
    from relume.scene.cameras.camera import Camera

FILTERS = Literal["plain", "subdivision", "quadrilateral", "preintegrated", "mip"]


def render(
    scene: Annotated[Path, Parameter(help="A scene file, .toml, or a mesh: .glb, .gltf, .obj, .ply or .stl.")],
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The picture, .exr with matte, depth and normals (whitted: and rays), .hdr, .png or .jpg; "
            "with --frames a folder or an .mp4.",
        ),
    ],
    renderer: Annotated[
        Literal["mapped", "mitsuba", "whitted"] | None,
        Parameter(
            help="mitsuba: light transport; mapped: reflection maps, without noise and without shadows; whitted: "
            "shadows, mirrors and glass by recursive ray tracing (Whitted 1980). Unless given, what the scene file and "
            "the options ask for: whitted for a [whitted] table, its materials and ambient light; mapped for mirror, "
            "glossy, retroreflector and glass; else mitsuba."
        ),
    ] = None,
    light: Annotated[
        Path | None, Parameter(help="The illumination map, .exr, .hdr or another format, instead of the scene file's.")
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
    seed: Annotated[int | None, Parameter(help="mitsuba, whitted: another seed for what is random.")] = None,
    depth: Annotated[
        int | None, Parameter(help="whitted: nodes from a tree's root to its farthest leaf; 8 unless the file says.")
    ] = None,
    rays: Annotated[
        int | None, Parameter(help="whitted: rays at a glossy or frosted surface; 16 unless the file says.")
    ] = None,
    contribution: Annotated[
        float | None,
        Parameter(help="whitted: branches that carry less of the pixel are cut off; 1/1024 unless the file says."),
    ] = None,
    constellation: Annotated[
        int | None,
        Parameter(
            help="whitted: lights that stand for the illumination map on diffuse surfaces; 64 unless the file says. "
            "More make shadows of an even sky smoother."
        ),
    ] = None,
    subdivisions: Annotated[
        int | None, Parameter(help="whitted: how often a pixel's square is halved; 3 unless the file says.")
    ] = None,
    tolerance: Annotated[
        float | None,
        Parameter(help="whitted: corners that differ by this share are halved; 0.1 unless the file says."),
    ] = None,
    region: Annotated[
        str | None,
        Parameter(
            help="whitted: only this part of the picture, LEFT,TOP,RIGHT,BOTTOM in pixels, as a smaller picture."
        ),
    ] = None,
    tree: Annotated[
        str | None,
        Parameter(
            help="whitted: instead of the picture draw the tree of rays behind pixel X,Y (.png or .svg), and print "
            "where the picture's time goes."
        ),
    ] = None,
    frames: Annotated[int | None, Parameter(help="mapped, whitted: this many pictures of a motion.")] = None,
    motion: Annotated[
        Literal["turntable", "orbit"] | None,
        Parameter(
            help="With --frames. turntable: the objects turn; orbit: the camera goes round; both counter-clockwise "
            "from above. turntable unless given, or unless orbits of the scene file move its objects (whitted)."
        ),
    ] = None,
    degrees: Annotated[
        float | None, Parameter(help="With --frames: how far; 360 unless given.", allow_leading_hyphen=True)
    ] = None,
    environment: Annotated[
        str | None,
        Parameter(
            help="mitsuba, whitted: instead of the picture the lat-long illumination map of the scene seen from the "
            "point X,Y,Z in metres, .exr or .hdr (Miller & Hoffman 1984, §5.2); --size 1024x512 unless given.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    exposure: Annotated[
        float,
        Parameter(
            help="Stops to brighten .png, .jpg and .mp4 by; at 0 they are metered: the light's mean radiance is ½, or, "
            "if that takes less light, a white card that faces the scene's other lights is white.",
            allow_leading_hyphen=True,
        ),
    ] = 0.0,
    threads: Threads = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Render a scene under an illumination map and lights, as one picture or as frames of a motion."""
    from relume.cli import render_choice as choice
    from relume.cli import render_frames as pictures
    from relume.cli.render_tree import draw_tree, read_pixel
    from relume.project.metering import metered_scene

    with warnings_as_notes(output):
        options: dict[str, object] = {
            "--filter": filter,
            "--plate": plate,
            "--samples": samples,
            "--seed": seed,
            "--depth": depth,
            "--rays": rays,
            "--contribution": contribution,
            "--constellation": constellation,
            "--subdivisions": subdivisions,
            "--tolerance": tolerance,
            "--region": region,
            "--tree": tree,
            "--frames": frames,
            "--environment": environment,
        }
        given = renderer is not None
        possible = choice.renderers_for(options, renderer)
        if environment is not None:
            choice.check_environment(out, {"--tree": tree, "--frames": frames, "--region": region, "--plate": plate})
        elif tree is not None:
            choice.check_drawing(out, {"--frames": frames, "--region": region})
        else:
            choice.check_output(out, frames, {"--motion": motion, "--degrees": degrees})
        require_files([plate] if plate is not None else [])
        read = choice.read_file(scene, light, size if environment is None else None)
        world, camera = read.scene, read.camera
        renderer = choice.chosen(read, possible, given=given, moving=frames is not None)
        if degrees is not None and motion is None and read.moves:
            raise ValueError("--degrees tells how far a motion goes, and the scene file's orbits do; give --motion too")
        movie = None if frames is None else pictures.Movie(frames, motion, degrees)
        part = None if region is None else choice.read_region(region, camera)
        whitted = choice.whitted_with(
            read.whitted,
            depth=depth,
            rays=rays,
            contribution=contribution,
            constellation=constellation,
            subdivisions=subdivisions,
            tolerance=tolerance,
            threads=threads,
        )
        if environment is not None:
            from relume.cli.render_environment import write_environment

            method = whitted if renderer == "whitted" else choice.mitsuba_with(samples, threads)
            write_environment(out, read, environment, size, method, seed=seed or 0, dry_run=dry_run, output=output)
            return
        behind = _plate(plate, camera)
        film = metered_scene(world).brighter(exposure)
        told = {
            "renderer": renderer,
            "shapes": len(world.local) + len(world.objects),
            "size": f"{camera.width}×{camera.height}" if part is None else f"{part[2] - part[0]}×{part[3] - part[1]}",
            "exposure": film.exposure,
        }
        pixel = None if tree is None else read_pixel(tree, camera)
        if dry_run:
            print_facts(output, {"would write": str(out), **told})
            return
        if pixel is not None:
            drawn = draw_tree(out, whitted, world, camera, pixel, film=film, seed=seed or 0)
            print_facts(output, {"written": str(out), **told, **drawn})
            return
        with progress(output) as report:
            if renderer == "mitsuba":
                count = 256 if samples is None else samples
                rendered = pictures.by_mitsuba(read, samples=count, seed=seed or 0, threads=threads, report=report)
            elif renderer == "whitted":
                rendered = pictures.by_trees(whitted, read, movie, seed=seed or 0, region=part, report=report)
            else:
                way = filter or "preintegrated"
                rendered = pictures.by_maps(read, movie, filter=way, plate=behind, threads=threads, report=report)
            if movie is None:
                pictures.write_picture(out, next(rendered), film, world.light.unit)
            else:
                pictures.write_frames(out, rendered, film, world.light.unit)
        print_facts(output, {"written": str(out), **told})


def _plate(path: Path | None, camera: Camera) -> RadianceMap | None:
    from relume.image import files

    plate = files.read_radiance(path) if path is not None else None
    if plate is not None and plate.size != (camera.width, camera.height):
        raise ValueError(
            f"--plate {path} is {plate.size[0]}×{plate.size[1]} pixels, the picture "
            f"{camera.width}×{camera.height}; give --size {plate.size[0]}x{plate.size[1]}"
        )
    return plate

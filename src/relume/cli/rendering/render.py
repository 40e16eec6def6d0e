"""`relume render`: a scene in, a picture, frames or a movie out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

from cyclopts import Parameter, Token
from cyclopts.validators import Number

import relume as rl
from relume.cli.arguments import ClusterWord, DryRun, Threads, require_files, require_output_folder, require_suffix
from relume.cli.console import OutputOptions, force, print_facts, progress, spread, warnings_as_notes
from relume.cli.option_types import Pixel, Point, Size, numbers

FILTERS = Literal["plain", "subdivision", "quadrilateral", "preintegrated", "mip"]
RENDERERS = Literal["prefiltered", "mitsuba", "whitted", "radiosity", "irradiance-cache", "photon-map"]
PICTURES = (".exr", ".hdr", ".png", ".jpg", ".jpeg")
ROWS = 512
SCENES = "A scene file, .toml, or a mesh: .glb, .gltf, .obj, .ply, .stl or .usd."


def _renderer(kind: object, tokens: Sequence[Token]) -> str:
    """A renderer's name; "mapped" is what prefiltered was called before."""
    word = tokens[-1].value.lower()
    word = "prefiltered" if word == "mapped" else word
    if word not in get_args(RENDERERS):
        raise ValueError(f'"{word}" is not a renderer; choose from {", ".join(get_args(RENDERERS))}')
    return word


@Parameter(name="*")
@dataclass(frozen=True)
class TracingOptions:
    """How far rays are followed, and how the recursive ray tracer works."""

    depth: Annotated[
        int | None,
        Parameter(
            help="mitsuba: bounces before a path ends, 12 unless given; whitted: nodes from a tree's root to its "
            "farthest leaf, 8 unless the file says."
        ),
    ] = None
    rays: Annotated[
        int | None, Parameter(help="whitted: rays at a glossy or frosted surface; 16 unless the file says.")
    ] = None
    contribution: Annotated[
        float | None,
        Parameter(help="whitted: branches that carry less of the pixel are cut off; 1/1024 unless the file says."),
    ] = None
    constellation: Annotated[
        int | None,
        Parameter(
            help="whitted: lights that stand for the environment map on diffuse surfaces; 64 unless the file says. "
            "More make shadows of an even sky smoother."
        ),
    ] = None
    subdivisions: Annotated[
        int | None, Parameter(help="whitted: how often a pixel's square is halved; 3 unless the file says.")
    ] = None
    tolerance: Annotated[
        float | None, Parameter(help="whitted: corners that differ by this share are halved; 0.1 unless the file says.")
    ] = None
    region: Annotated[
        tuple[int, int, int, int] | None,
        numbers(
            "LEFT,TOP,RIGHT,BOTTOM",
            like="0,0,320,240",
            help="whitted: only this part of the picture, in pixels, as a smaller picture.",
        ),
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class MotionOptions:
    """Frames of a motion or of the scene file's sequence."""

    frames: Annotated[
        str | None,
        Parameter(
            help="This many pictures of a motion; of a scene file with [sequence] these of its frames, as 3,5-8 or "
            "1-100x2, all unless given."
        ),
    ] = None
    motion: Annotated[
        Literal["turntable", "orbit"] | None,
        Parameter(
            help="With --frames. turntable: the objects turn; orbit: the camera goes round; both counter-clockwise "
            "from above. turntable unless given, or unless orbits of the scene file move its objects (whitted)."
        ),
    ] = None
    degrees: Annotated[
        float | None, Parameter(help="With --frames: how far, degrees; 360 unless given.", allow_leading_hyphen=True)
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class TransportOptions:
    """How long light transport goes on, and what is done about the noise that is left."""

    samples: Annotated[
        int | None,
        Parameter(
            validator=Number(gte=2),
            help="mitsuba: rays a pixel, 256 unless given; radiosity, irradiance-cache: 4 unless given; photon-map: "
            "16 unless given, each in a pass of its own.",
        ),
    ] = None
    noise: Annotated[
        float | None,
        Parameter(validator=Number(gt=0), help="mitsuba: stop once the expected error is below this share, like 0.01."),
    ] = None
    denoise: Annotated[
        bool, Parameter(negative="", help="mitsuba: take what noise is left out of the picture (Open Image Denoise).")
    ] = False
    seed: Annotated[
        int | None, Parameter(help="Another seed for what is random; not of prefiltered, where nothing is.")
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class InsteadOptions:
    """What is made instead of the picture."""

    tree: Annotated[
        Pixel | None,
        Parameter(
            help="whitted: instead of the picture draw the tree of rays behind this pixel (.png or .svg), and print "
            "where the picture's time goes."
        ),
    ] = None
    brdf: Annotated[
        str | None,
        Parameter(
            help="Instead of the picture plot a material (.png or .svg): cross-sections of the light that it scatters, "
            "its albedo by angle, and balls of it. A material of the scene file by its name, a preset, or a MERL "
            ".binary file; the last two need no scene."
        ),
    ] = None
    environment: Annotated[
        Point | None,
        Parameter(
            help="mitsuba, whitted: instead of the picture the equirectangular (lat-long) environment map of the scene "
            "seen from this point in metres, .exr or .hdr (Miller & Hoffman 1984, §5.2); --size 1024x512 unless given."
        ),
    ] = None

    def check(self, out: Path, pictures: dict[str, object], cluster: str | None) -> None:
        """Refuse an output that cannot be written, and options of pictures where none is made."""
        if self.environment is not None:
            _check_alone("--environment shows all directions", {"--tree": self.tree, **pictures})
            require_suffix(out, ".exr", ".hdr")
        elif self.tree is not None:
            _check_alone("--tree draws one pixel's rays", pictures)
            require_suffix(out, ".png", ".svg")
        else:
            _check_output(out)
            return
        if cluster is not None:
            raise ValueError(
                "--cluster makes a picture or the frames of a motion, and neither an environment map nor a tree; leave "
                "it out"
            )


def render(
    scene: Annotated[Path | None, Parameter(help=SCENES)] = None,
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The picture, .exr with matte, depth and normals (whitted: and rays), .hdr, .png or .jpg; "
            "for frames a folder or an .mp4.",
        ),
    ],
    renderer: Annotated[
        RENDERERS | None,
        Parameter(
            converter=_renderer,
            help="mitsuba: path tracing. prefiltered: prefiltered environment maps (reflection maps), without "
            "noise and without shadows. whitted: shadows, mirrors and glass by recursive ray tracing (Whitted "
            "1980). For teaching: radiosity and irradiance-cache for diffuse surfaces, photon-map for these "
            "with mirrors, glass and fog. Unless given, what the scene file and the options need: whitted for "
            "a [whitted] table, its materials and ambient light; prefiltered for mirror, glossy, "
            "retroreflector and glass; else mitsuba.",
        ),
    ] = None,
    light: Annotated[
        Path | None,
        Parameter(help="The environment map (HDRI), .exr, .hdr or another format, instead of the scene file's."),
    ] = None,
    size: Annotated[Size | None, Parameter(help="Pixels, instead of the scene file's.")] = None,
    filter: Annotated[
        FILTERS | None,
        Parameter(
            help="prefiltered: how a pixel reads the maps (Miller & Hoffman 1984, §8; mip: Williams 1983); "
            "preintegrated unless given."
        ),
    ] = None,
    plate: Annotated[
        Path | None, Parameter(help="prefiltered: a radiance map to matte the objects over, of the picture's size.")
    ] = None,
    transport: TransportOptions = TransportOptions(),
    tracing: TracingOptions = TracingOptions(),
    moving: MotionOptions = MotionOptions(),
    instead: InsteadOptions = InsteadOptions(),
    exposure: Annotated[
        float,
        Parameter(
            help="Stops to brighten .png, .jpg and .mp4 by; at 0 they are metered: the light's mean radiance is ½, or, "
            "if that takes less light, a white card that faces the scene's other lights is white.",
            allow_leading_hyphen=True,
        ),
    ] = 0.0,
    restart: Annotated[bool, Parameter(negative="", help="Discard the saved state of an interrupted render.")] = False,
    threads: Threads = None,
    cluster: ClusterWord = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Render a scene under an environment map and lights, as one picture or as frames of a motion.

    Frames that are there, made from the same, are kept, and an interrupted render is resumed. Beside a picture under
    way its .preview.png shows what there is.
    """
    environment = instead.environment
    with warnings_as_notes(output):
        # Refuse what cannot be written, before any work.
        pictures = {"--frames": moving.frames, "--region": tracing.region, "--plate": plate}
        if instead.brdf is not None:
            others = {"--light": light, "--size": size, "--cluster": cluster, "--renderer": renderer, **pictures}
            others |= {"--filter": filter, "--restart": restart or None, "--exposure": exposure or None}
            return print_facts(output, _plot(instead, scene, out, others | _named(tracing), transport, dry_run, output))
        instead.check(out, pictures, cluster)
        require_files([each for each in (scene, light, plate) if each is not None])
        # Read what the options name.
        read = rl.read_scene(_given(scene), light, size if environment is None else None)
        settings = rl.RenderSettings(
            renderer=renderer,
            filter=filter,
            plate=None if plate is None else rl.read_radiance(plate),
            **vars(transport),
            **vars(tracing),
            **vars(moving),
            exposure=exposure,
            threads=threads,
        )
        # Render one of three things, and print what was done.
        if environment is not None:
            facts = _environment(read, out, environment, settings, size, dry_run, output)
        elif instead.tree is not None:
            facts = _tree(read, out, instead.tree, settings, dry_run)
        else:
            facts = _pictures(read, out, settings, None if dry_run else cluster, restart, dry_run, output)
        print_facts(output, {"would write" if dry_run else "written": str(out), **facts})


def _pictures(
    read: rl.SceneFile, out: Path, settings: rl.RenderSettings, cluster: str | None, restart: bool, dry_run: bool,
    output: OutputOptions,
) -> dict[str, object]:  # fmt: skip
    with spread(cluster, output, tasks=out.suffix.lower() not in PICTURES) as (workers, report):
        made = rl.render_scene(
            read, out, settings, dry_run=dry_run, report=report, cluster=workers, restart=restart, preview=True,
            force=force,
        )  # fmt: skip
    facts: dict[str, object] = {"renderer": made.renderer, "shapes": made.shapes}
    facts |= {"size": f"{made.size[0]}×{made.size[1]}", "exposure": made.film.exposure}
    return facts if made.frames is None else {**facts, "frames": made.frames, "kept from before": made.kept}


def _given(scene: Path | None) -> Path:
    if scene is None:
        raise ValueError("no scene is given; name a scene file or a mesh, as in relume render scene.toml -o a.exr")
    return scene


def _named(tracing: TracingOptions) -> dict[str, object]:
    return {f"--{name}": value for name, value in vars(tracing).items()}


def _plot(
    instead: InsteadOptions, scene: Path | None, out: Path, others: dict[str, object], transport: TransportOptions,
    dry_run: bool, output: OutputOptions,
) -> dict[str, object]:  # fmt: skip
    material = instead.brdf or ""
    others |= {"--tree": instead.tree, "--environment": instead.environment, "--noise": transport.noise}
    others |= {"--denoise": transport.denoise or None}
    _check_alone("--brdf plots one material", others)
    require_suffix(out, ".png", ".svg")
    require_files([] if scene is None else [scene])
    rays = 64 if transport.samples is None else transport.samples
    with progress(output) as report:
        rl.report.draw_brdf(
            material, out, scene=scene, samples=rays, seed=transport.seed or 0, dry_run=dry_run,
            progress=lambda share: report("rendering", share),
        )  # fmt: skip
    return {"would write" if dry_run else "written": str(out), "material": material}


def _environment(
    read: rl.SceneFile, out: Path, point: Point, settings: rl.RenderSettings, size: Size | None, dry_run: bool,
    output: OutputOptions,
) -> dict[str, object]:  # fmt: skip
    import numpy as np

    width, rows = size or (2 * ROWS, ROWS)
    if width != 2 * rows:
        raise ValueError(f"--size {width}x{rows}: with --environment the map is twice as wide as high")
    facts: dict[str, object] = {"environment at": list(point), "size": f"{width}×{rows}"}
    with progress(output) as report:
        light = rl.render_environment(read, out, point, settings, rows=rows, dry_run=dry_run, report=report)
    if light is not None:
        facts["total"] = [float(f"{value:.6g}") for value in light.total()]
        above = light.irradiance(np.array([0.0, 1.0, 0.0]))
        facts["irradiance from above"] = [float(f"{value:.6g}") for value in above]
    return facts


def _tree(read: rl.SceneFile, out: Path, pixel: Pixel, settings: rl.RenderSettings, dry_run: bool) -> dict[str, object]:
    drawn = rl.report.draw_ray_tree(read, out, pixel, settings, dry_run=dry_run)
    facts: dict[str, object] = {"renderer": "whitted", "pixel": f"{pixel[0]},{pixel[1]}"}
    if drawn is not None:
        shares = drawn.shares
        facts |= {
            "tree": drawn.rays,
            "intensity": ", ".join(f"{value:.6g}" for value in drawn.tree.intensity[0]),
            "overhead": f"{shares.overhead:.0%}",
            "intersection": f"{shares.intersection:.0%}",
            "shading": f"{shares.shading:.0%}",
            "picture": f"{shares.seconds:.2f} s of one core, {shares.rays} rays",
        }
    return facts


def _check_alone(what: str, others: dict[str, object]) -> None:
    """Refuse options that ask for pictures where no picture is made."""
    given = [name for name, value in others.items() if value is not None]
    if given:
        raise ValueError(f"{what}, and {given[0]} is of something else; leave one of them out")


def _check_output(out: Path) -> None:
    """Refuse an output that cannot be written; whether there are frames for it the scene file says too."""
    if out.suffix.lower() == ".mp4":
        require_suffix(out, ".mp4")
    elif out.suffix:
        require_suffix(out, *PICTURES)
    else:
        require_output_folder(out)

"""`relume stage matte`: coded backdrops in, an environment matte out; and mattes over any backdrop or environment."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, refuse_input, require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, progress, warnings_as_notes
from relume.cli.option_types import numbers
from relume.cli.stage.light import Rotate, read_turned
from relume.cli.stage.options import Exposure, require_picture

Rectangle = tuple[float, float, float, float, float]


def matte(
    patterns: Annotated[
        Path,
        Parameter(
            help="A folder of pictures before stripes: black, white, gray_x0, gray_x1, …, gray_y0, …, 0 the coarsest; "
            "or with patterns.json. Or a matte that was made before, .exr."
        ),
    ],
    /,
    *,
    out: Annotated[
        Path,
        Parameter(alias="-o", help="The matte, .exr; with --over or --light the picture: .exr, .hdr, .png or .jpg."),
    ],
    over: Annotated[
        Path | None,
        Parameter(help="A backdrop to put the subject before, a picture; its white is the patterns' white."),
    ] = None,
    light: Annotated[
        Path | None, Parameter(help="An environment map to put the subject into, with --backdrop and --stage.")
    ] = None,
    stage: Annotated[
        Path | None, Parameter(help="With --light: the subject's light stage, whose camera took the patterns too.")
    ] = None,
    backdrop: Annotated[
        Rectangle | None,
        numbers(
            "X,Y,Z,WIDTH,HEIGHT",
            like="0,0,-1.6,4,4",
            help="With --light: the middle of the backdrop, its width and height, metres; it faces the camera.",
        ),
    ] = None,
    rotate: Rotate = None,
    exposure: Exposure = 0.0,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Recover per pixel where, how widely and in what colour the backdrop is seen, for glass and mirrors (appendix).

    With --light, light from beside the backdrop relights the subject by its stage, and what stands where the backdrop
    stood is seen through the matte: the two sum to the whole environment.
    """
    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        _check(out, over, light, stage, backdrop)
        require_files([path for path in (over, light) if path])
        refuse_input(out, [path for path in (patterns, over) if path is not None and path.is_file()])
        if dry_run:
            print_facts(output, {"would write": str(out), "from": str(patterns)})
            return
        # The matte: made before, or recovered from the patterns.
        with progress(output) as report:
            report("matte", 0.0)
            if patterns.is_file():
                found = rl.lightstage.read_matte(patterns)
            else:
                found = rl.lightstage.environment_matte(rl.lightstage.read_patterns(patterns))
            report("matte", 1.0)
        # The matte itself, or a picture with it.
        if over is not None:
            picture = rl.RadianceMap(rl.lightstage.composite_matte(found, rl.lightstage.read_backdrop(over)))
            rl.lightstage.write_picture(out, picture, exposure)
        elif light is not None and stage is not None and backdrop is not None:
            picture = _in_environment(found, light, stage, backdrop, rotate)
            rl.lightstage.write_picture(out, picture, exposure)
        else:
            rl.lightstage.write_matte(out, found)
        print_facts(output, {"written": str(out), **_facts(found)})


def _check(out: Path, over: Path | None, light: Path | None, stage: Path | None, backdrop: Rectangle | None) -> None:
    if over is not None and light is not None:
        raise ValueError("--over and --light: give one of them")
    if (light is None) != (stage is None) or (light is None) != (backdrop is None):
        raise ValueError("--light, --stage and --backdrop go together: give all three, or --over, or none")
    if over is None and light is None:
        require_suffix(out, ".exr")
    else:
        require_picture(out)


def _facts(matte: rl.lightstage.EnvironmentMatte) -> dict[str, object]:
    import numpy as np

    seen = matte.colours.max(axis=-1) > 0
    return {
        "size": list(matte.shape[::-1]),
        "backdrop": list(matte.texels),
        "covered": float(f"{matte.coverage.mean():.4g}"),
        "with two areas": float(f"{np.all(seen, axis=0).mean():.4g}"),
        "residual, 99 %": float(f"{np.percentile(matte.residual, 99):.3g}"),
    }


def _in_environment(
    matte: rl.lightstage.EnvironmentMatte, light: Path, stage: Path, backdrop: Rectangle, rotate: Rotate
) -> rl.RadianceMap:
    import numpy as np

    field = rl.lightstage.read_stage(stage)
    if field.camera is None:
        raise ValueError(f"--stage {stage}: has no camera, which --light needs; add it to stage.json")
    x, y, z, width, height = backdrop
    standing = rl.lightstage.Backdrop.facing(np.array([x, y, z]), field.camera.position, width, height)
    return rl.lightstage.place_in_environment(matte, field, read_turned(light, rotate), standing)

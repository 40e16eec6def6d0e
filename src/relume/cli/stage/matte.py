"""`relume stage matte`: coded backdrops in, an environment matte out; and mattes over any backdrop or environment."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, read_rotation, refuse_input, require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, progress, warnings_as_notes
from relume.cli.stage.output import require_picture, write_picture

if TYPE_CHECKING:
    import numpy as np

    from relume.image.radiance import RadianceMap
    from relume.lightstage.field.field import ReflectanceField
    from relume.lightstage.matting.environment_matte import EnvironmentMatte


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
        Path | None, Parameter(help="An illumination map to put the subject into, with --backdrop and --stage.")
    ] = None,
    stage: Annotated[
        Path | None, Parameter(help="With --light: the subject's light stage, whose camera took the patterns too.")
    ] = None,
    backdrop: Annotated[
        str | None,
        Parameter(
            allow_leading_hyphen=True,
            help="With --light: where the backdrop's middle stood and how wide and high it was, as X,Y,Z,WIDTH,HEIGHT "
            "metres, facing the camera.",
        ),
    ] = None,
    rotate: Annotated[
        str | None,
        Parameter(allow_leading_hyphen=True, help="Turn the map by YAW[,PITCH[,ROLL]] degrees, right-handed."),
    ] = None,
    exposure: Annotated[float, Parameter(allow_leading_hyphen=True, help="Stops to brighten .png and .jpg by.")] = 0.0,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Recover per pixel where, how widely and in what colour the backdrop is seen, for glass and mirrors (appendix).

    With --light, light from beside the backdrop relights the subject by its stage, and what stands where the backdrop
    stood is seen through the matte: the two sum to the whole environment.
    """
    from relume.image.radiance import RadianceMap
    from relume.lightstage.matting.composite import composite
    from relume.lightstage.matting.environment_matte import environment_matte
    from relume.lightstage.matting.gray_code import read_patterns
    from relume.lightstage.matting.matte_file import read_matte, write_matte

    with warnings_as_notes(output):
        _check(out, over, light, stage, backdrop)
        require_files([path for path in (over, light) if path])
        refuse_input(out, [path for path in (patterns, over) if path is not None and path.is_file()])
        if dry_run:
            print_facts(output, {"would write": str(out), "from": str(patterns)})
            return
        with progress(output) as report:
            report("matte", 0.0)
            found = read_matte(patterns) if patterns.is_file() else environment_matte(read_patterns(patterns))
            report("matte", 1.0)
        if over is None and light is None:
            write_matte(out, found)
        elif over is not None:
            write_picture(out, RadianceMap(composite(found, _backdrop(over))), exposure)
        else:
            assert light is not None and stage is not None and backdrop is not None
            write_picture(out, _in_environment(found, light, stage, backdrop, rotate), exposure)
        print_facts(output, {"written": str(out), **_facts(found)})


def _check(out: Path, over: Path | None, light: Path | None, stage: Path | None, backdrop: str | None) -> None:
    if over is not None and light is not None:
        raise ValueError("--over and --light: give one of them")
    if (light is None) != (stage is None) or (light is None) != (backdrop is None):
        raise ValueError("--light, --stage and --backdrop go together: give all three, or --over, or none")
    if over is None and light is None:
        require_suffix(out, ".exr")
    else:
        require_picture(out)


def _facts(matte: EnvironmentMatte) -> dict[str, object]:
    import numpy as np

    seen = matte.colours.max(axis=-1) > 0
    return {
        "size": list(matte.shape[::-1]),
        "backdrop": list(matte.texels),
        "covered": float(f"{matte.coverage.mean():.4g}"),
        "with two areas": float(f"{np.all(seen, axis=0).mean():.4g}"),
        "residual, 99 %": float(f"{np.percentile(matte.residual, 99):.3g}"),
    }


def _backdrop(path: Path) -> np.ndarray:
    """A backdrop's linear values: a radiance map as it is, a photograph by the sRGB curve."""
    from relume.image import files
    from relume.image.colour import decode_srgb

    if files.has_radiance(path):
        return files.read_radiance(path).radiance
    photograph = files.read_photograph(path)
    return decode_srgb(photograph.pixels / (255 if photograph.pixels.dtype.itemsize == 1 else 65535))


def _in_environment(matte: EnvironmentMatte, light: Path, stage: Path, text: str, rotate: str | None) -> RadianceMap:
    """The subject in an environment: relit by what is beside the backdrop, and what is behind it through the matte."""
    import numpy as np

    from relume.lightstage.acquire.read_stage import read_stage
    from relume.lightstage.matting.composite import Backdrop, illumination_without_backdrop, over_environment
    from relume.lightstage.relighting.irradiances import irradiances
    from relume.lightstage.relighting.relighting import weighted_sum

    field: ReflectanceField = read_stage(stage)
    if field.camera is None:
        raise ValueError(f"--stage {stage}: tells no camera, which --light needs; add it to stage.json")
    if field.shape != matte.shape:
        raise ValueError(
            f"--stage {stage}: pictures of {field.shape[1]}×{field.shape[0]}, but the matte has "
            f"{matte.shape[1]}×{matte.shape[0]}; give the stage of the camera that took the patterns"
        )
    try:
        x, y, z, width, height = (float(word) for word in text.replace(",", " ").split())
    except ValueError:
        raise ValueError(f'--backdrop: "{text}" is no place and size; write X,Y,Z,WIDTH,HEIGHT in metres') from None
    environment = rl.read_environment(light)
    if rotate is not None:
        environment = environment.rotated(read_rotation(rotate, "--rotate"))
    standing = Backdrop.facing(np.array([x, y, z]), field.camera.position, width, height)
    beside = illumination_without_backdrop(environment, standing)
    rest = weighted_sum(field, irradiances(field.lights, beside))
    picture = over_environment(matte, standing, field.camera, environment, foreground=rest.radiance)
    return replace(rest, radiance=picture, variance=None, unit=environment.unit)

"""`relume stage inspect`: what a stage holds, and a report with reflectance functions and a light turned by hand."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, made_folder, require_files
from relume.cli.console import OutputOptions, note, print_facts, progress, warnings_as_notes
from relume.cli.stage.options import Camera, Stage, work_of
from relume.cli.stage.output import require_output_folder


def inspect(
    stage: Stage,
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(alias="-o", help="The folder for report.html and mosaic.exr; only facts are told unless given."),
    ] = None,
    light: Annotated[
        list[Path] | None, Parameter(negative="", help="An illumination map to turn in the report; again for each.")
    ] = None,
    functions: Annotated[
        str | None, Parameter(help="Reflectance functions of the mosaic, DOWNxACROSS; 20 along the longer side.")
    ] = None,
    camera: Camera = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Say what a stage holds; with -o draw its lights, reflectance functions and a page to turn a light map by hand.

    The page needs no server: it can be sent to a colleague.
    """
    import numpy as np

    from relume.image import files
    from relume.image.radiance import RadianceMap
    from relume.lightstage.acquire.read_stage import read_stage
    from relume.lightstage.relighting.mosaic import mosaic
    from relume.report.stage_report import write_stage_report

    with warnings_as_notes(output):
        if out is not None:
            require_output_folder(out)
        require_files(light or [])
        field = read_stage(stage, camera)
        areas = field.lights.solid_angles
        facts: dict[str, object] = {
            **work_of(field, 1 << 31),
            "grid": list(field.lights.grid) if field.lights.grid else None,
            "cells, sr": [float(f"{value:.4g}") for value in (areas.min(), np.median(areas), areas.max())],
            "camera": None if field.camera is None else [float(f"{v:.5g}") for v in field.camera.position],
            "noise": None if field.noise is None else [field.noise.constant, field.noise.slope],
        }
        if out is None or dry_run:
            print_facts(output, facts if out is None else {"would write": str(out), **facts})
            return
        maps = {path.name: rl.read_environment(path) for path in light or []}
        with progress(output) as report:
            report("report", 0.0)
            made_folder(out)
            down, across = _functions(functions, field.shape)
            files.write(out / "mosaic.exr", RadianceMap(mosaic(field, down, across).radiance))
            doubts = write_stage_report(field, out / "report.html", maps, title=f"light stage {stage.name}")
            report("report", 1.0)
        for line in doubts:
            note(output, line)
        print_facts(output, {"written": [str(out / "report.html"), str(out / "mosaic.exr")], **facts})


def _functions(text: str | None, shape: tuple[int, int]) -> tuple[int, int]:
    from relume.report.stage_report import sampling

    if text is None:
        return sampling(shape)
    try:
        down, across = (int(word) for word in text.lower().split("x"))
    except ValueError:
        raise ValueError(f'--functions: "{text}" is no number of functions; write DOWNxACROSS, like 15x44') from None
    return down, across

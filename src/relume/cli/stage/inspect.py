"""`relume stage inspect`: what a stage holds, and a report with an interactive relighting viewer."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, made_folder, require_files, require_output_folder
from relume.cli.console import OutputOptions, print_facts, progress, warnings_as_notes
from relume.cli.option_types import numbers
from relume.cli.stage.options import Camera, Stage, rounded, work_facts


def inspect(
    stage: Stage,
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(alias="-o", help="The folder for report.html and mosaic.exr; only facts are printed unless given."),
    ] = None,
    light: Annotated[
        list[Path] | None, Parameter(negative="", help="An environment map to turn in the report; again for each.")
    ] = None,
    functions: Annotated[
        tuple[int, int] | None,
        numbers(
            "DOWNxACROSS",
            like="15x44",
            above=0,
            help="Reflectance functions of the mosaic; 20 along the longer side unless given.",
        ),
    ] = None,
    camera: Camera = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Print what a stage holds; with -o draw its lights, its reflectance functions and an interactive viewer.

    In the viewer an environment map is turned by hand and the subject follows. The page needs no server: it can be
    sent to a colleague.
    """
    import numpy as np

    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        if out is not None:
            require_output_folder(out)
        require_files(light or [])
        field = rl.lightstage.read_stage(stage, camera)
        # What the stage holds.
        areas = field.lights.solid_angles
        facts: dict[str, object] = {
            **work_facts(rl.lightstage.estimate_work(field, 1 << 31)),
            "grid": list(field.lights.grid) if field.lights.grid else None,
            "cells, sr": rounded((areas.min(), np.median(areas), areas.max())),
            "camera": None if field.camera is None else rounded(field.camera.position, 5),
            "noise": None if field.noise is None else [field.noise.constant, field.noise.slope],
        }
        if out is None or dry_run:
            print_facts(output, facts if out is None else {"would write": str(out), **facts})
            return
        # The report.
        maps = {path.name: rl.read_environment(path) for path in light or []}
        with progress(output) as report:
            report("report", 0.0)
            made_folder(out)
            down, across = functions or rl.lightstage.mosaic_size(field.shape)
            rl.write(out / "mosaic.exr", rl.RadianceMap(rl.lightstage.mosaic(field, down, across).radiance))
            rl.write_report(field, out / "report.html", lights=maps, title=f"light stage {Path(stage).name}")
            report("report", 1.0)
        print_facts(output, {"written": [str(out / "report.html"), str(out / "mosaic.exr")], **facts})

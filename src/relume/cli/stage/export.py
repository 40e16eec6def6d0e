"""`relume stage export`: a stage for museums' viewers, as pictures with their lights, PTM and HSH."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, require_output_folder
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.stage.options import Camera, Stage, work_facts


def export(
    stage: Stage,
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The folder for the pictures, .lp, .ptm and .rti.")],
    name: Annotated[str, Parameter(help="What the files are called, one word.")] = "stage",
    pictures: Annotated[Literal["jpg", "png", "none"], Parameter(help="Pictures beside the .lp.")] = "jpg",
    ptm: Annotated[Literal["LRGB", "RGB", "none"], Parameter(help="Polynomial texture map.")] = "LRGB",
    hsh: Annotated[
        Literal["1", "2", "3", "none"], Parameter(help="Degree of the hemispherical harmonics; 2 is read everywhere.")
    ] = "2",
    exposure: Annotated[
        float | None, Parameter(help="Factor of the values; unless given, 95 in 100 lit pixels stay below white.")
    ] = None,
    camera: Camera = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Write a stage so that RTI viewers and builders open it (RTIViewer, RelightLab, OpenLIME).

    Lights behind the subject are left out: these formats hold the hemisphere before the camera.
    """
    with warnings_as_notes(output):
        require_output_folder(out)
        form = rl.lightstage.RTIForm(
            None if pictures == "none" else pictures,
            None if ptm == "none" else ptm,
            None if hsh == "none" else int(hsh),
            exposure,
        )
        field = rl.lightstage.read_stage(stage, camera)
        if dry_run:
            print_facts(output, {"would write": str(out), **work_facts(rl.lightstage.estimate_work(field, 1 << 30))})
            return
        done = rl.lightstage.export_rti(field, out, form, name)
        facts = {"written": [str(path) for path in done.files], "lights": done.lights, "left out": len(done.left_out)}
        facts |= {"exposure": float(f"{done.exposure:.5g}"), "above white": float(f"{done.clipped:.3g}")}
        print_facts(output, {**facts, "ptm error": done.ptm_error, "hsh error": done.hsh_error})

"""`relume stage relight`: a stage and light in, the subject under that light out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, Threads
from relume.cli.console import Manner, progress, speaking, tell
from relume.cli.stage_light import Light
from relume.cli.stage_options import Camera, MaxMemory, Stage, bytes_of, work_of
from relume.cli.stage_output import require_frames, require_picture, write_frames, write_picture


def relight(
    stage: Stage,
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The picture: .exr (with its variance where the noise is known), .hdr, .png or .jpg; with --frames a "
            "folder, or an .mp4.",
        ),
    ],
    light: Light = Light(),
    camera: Camera = None,
    frames: Annotated[
        int | None,
        Parameter(help="Turn the maps once about the vertical, right-handed, in so many pictures."),
    ] = None,
    exposure: Annotated[
        float, Parameter(allow_leading_hyphen=True, help="Stops to brighten .png, .jpg and .mp4 by.")
    ] = 0.0,
    max_memory: MaxMemory = "2G",
    threads: Threads = None,
    dry_run: DryRun = False,
    manner: Manner = Manner(),
) -> None:
    """Relight a subject: the sum of its pictures, each by what its light has to give (Debevec et al. 2000, eq. 4).

    The light is integrated over all of the sphere. Values are radiance, in the map's unit. A folder of maps as --light
    gives a picture for each.
    """
    from relume.lightstage.reading import read_stage
    from relume.lightstage.relighting import relight as relit
    from relume.lightstage.sequences import relight_sequence

    with speaking(manner):
        light.check(maps_only=frames is not None)
        moving = frames is not None or light.is_sequence
        if moving:
            require_frames(out, light.pictures if frames is None else frames)
        else:
            require_picture(out)
        memory = bytes_of(max_memory, "--max-memory")
        field = read_stage(stage, camera)
        if dry_run:
            tell(manner, {"would write": str(out), **work_of(field, memory)})
            return
        with progress(manner) as report:
            settings = {"threads": threads, "memory": memory, "progress": lambda share: report("relighting", share)}
            if moving:
                amounts, unit = light.turning(field.lights, frames, lambda share: report("light", share))
                pictures = relight_sequence(field, amounts, **settings)
                count = write_frames(out, (replace(each, unit=unit) for each in pictures), exposure)
            else:
                given, unit = light.irradiances(field.lights)
                write_picture(out, replace(relit(field, given, **settings), unit=unit), exposure)
                count = 1
        facts = {"written": str(out), "pictures": count, "lights": len(field.lights)}
        tell(manner, {**facts, "size": list(field.shape[::-1]), "unit": unit})

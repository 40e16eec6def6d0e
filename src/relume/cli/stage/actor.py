"""`relume stage actor`: an actor filmed in a stage in, the actor before the place out (Light Stage 3)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.stage.options import Exposure, require_frames


def actor(
    frames: Annotated[Path, Parameter(help="The folder of the actor's frames.")],
    /,
    *,
    empty: Annotated[Path, Parameter(help="The stage alone under the same light: a picture, or a folder of one each.")],
    over: Annotated[Path, Parameter(help="The backdrop: a picture, or a folder of one a frame.")],
    out: Annotated[Path, Parameter(alias="-o", help="An .mp4, or a folder for the frames.")],
    infrared: Annotated[
        Path | None, Parameter(help="Folder of infrared frames, the actor dark; differences from --empty unless given.")
    ] = None,
    infrared_empty: Annotated[Path | None, Parameter(help="With --infrared: the same without the actor.")] = None,
    exposure: Exposure = 0.0,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Matte an actor who was filmed in a stage, frame by frame, and put them before another backdrop."""
    with warnings_as_notes(output):
        require_frames(out, 2)
        for path in (frames, empty, over, infrared, infrared_empty):
            if path is not None and not path.exists():
                raise rl.errors.UnreadableFile(f"{path}: no such file or folder; check the path")
        if (infrared is None) != (infrared_empty is None):
            raise ValueError("--infrared and --infrared-empty go together: give both or none")
        pair = None if infrared is None or infrared_empty is None else (infrared, infrared_empty)
        if dry_run:
            print_facts(output, {"would write": str(out), "matte": "differences" if pair is None else "infrared"})
            return
        count = rl.lightstage.composite_actor_film(frames, empty, over, out, infrared=pair, stops=exposure)
        print_facts(output, {"written": str(out), "pictures": count})

"""`relume stage perform`: a film under strobes that repeat in, the performance under any light out (Light Stage 4)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, MapsOptions, require_files
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.stage.light import Light
from relume.cli.stage.options import Exposure, require_frames


def perform(
    film: Annotated[Path, Parameter(help="A video, or a folder of its frames; a frame shows one lamp.")],
    /,
    *,
    lamps: Annotated[Path, Parameter(help="An .lp, or a list of directions, of the lamps in the order of flashes.")],
    out: Annotated[Path, Parameter(alias="-o", help="An .mp4, or a folder for the frames.")],
    tracking: Annotated[
        list[int] | None,
        Parameter(
            negative="", help="Place in the period, from 0, of a frame in which all lamps flash; again for each."
        ),
    ] = None,
    film_start: Annotated[int, Parameter(help="The frame, from 0, at which the first period begins.")] = 0,
    encoding: Annotated[str | None, Parameter(help="Of photographs: linear or a response file; else srgb.")] = None,
    light: Light = Light(),
    maps: MapsOptions = MapsOptions(),
    exposure: Exposure = 0.0,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Relight a performance filmed under strobes that repeat: every frame by all lamps, aligned along the motion.

    A folder of maps as --light goes on with the film, 24 a second.
    """
    with warnings_as_notes(output):
        light.check()
        if not light.is_sequence:
            maps.refuse()
        require_frames(out, 2)
        require_files([lamps] if film.is_dir() else [lamps, film])
        cycle = rl.lightstage.StrobeCycle.listed(lamps, tracking or (), film_start)
        strobes = rl.lightstage.read_strobes(film, cycle, encoding=encoding)
        facts = {"lamps": len(cycle.lights), "period": cycle.period, "pictures": len(strobes.times)}
        if dry_run:
            print_facts(output, {"would write": str(out), **facts})
            return
        given = light.sequence(None, maps)[: len(strobes.times)] if light.is_sequence else light.lighting()
        settings = rl.lightstage.RelightSettings(nearest=light.nearest)
        rl.lightstage.relight_strobes(strobes, given, out, settings, stops=exposure)
        print_facts(output, {"written": str(out), **facts})

"""`relume info`: what a file holds, or what this machine renders with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.console import OutputOptions, print_facts, refuse, version, warnings_as_notes
from relume.cli.reading_options import ReadingOptions


def info(
    paths: Annotated[
        list[Path] | None, Parameter(help="Pictures, radiance maps, light maps, camera raws, cubes.", negative="")
    ] = None,
    /,
    *,
    system: Annotated[
        bool, Parameter(negative="", help="Show what this machine renders with, and what is missing.")
    ] = False,
    draw: Annotated[
        Path | None,
        Parameter(help="Draw a light map at three exposures with its axes, as this .png."),
    ] = None,
    from_: Annotated[
        str | None, Parameter(name="--from", help="Mapping of the map to draw, where the file does not remember it.")
    ] = None,
    options: ReadingOptions = ReadingOptions(),
    output: OutputOptions = OutputOptions(),
) -> None:
    """Show what picture files hold: size, exposure, unit, range, faults; or what this machine renders with.

    Where a file cannot be read the others are shown, and the exit code is 2. With --json each file is one line.
    """
    from relume.cli.info_lines import lines_of

    with warnings_as_notes(output):
        if system:
            print_facts(output, _system(), title="relume on this machine")
        elif not paths:
            raise ValueError("name a file, or ask about this machine with --system")
        reading = options.reading()
        if draw is not None:
            _draw(paths or [], draw, from_, reading)
        elif from_ is not None:
            raise ValueError("--from is for --draw; give that too")
        unreadable: list[rl.RelumeError] = []
        for path in paths or ():
            try:
                facts = rl.report.describe(path, reading)
            except rl.RelumeError as error:
                unreadable.append(error)
                continue
            print_facts(output, facts if output.json else lines_of(facts, whole=output.verbose), title=str(path))
        if unreadable:
            for error in unreadable[:-1]:
                refuse(str(error), 2)
            raise unreadable[-1]


def _draw(paths: list[Path], out: Path, from_: str | None, reading: rl.ReadOptions) -> None:
    from relume.cli.arguments import require_suffix

    if len(paths) != 1:
        raise ValueError(f"--draw shows one map; {len(paths)} files are named")
    require_suffix(out, ".png", option="--draw")
    light = rl.read_environment(paths[0], None if from_ is None else rl.mappings.mapping_named(from_), options=reading)
    rl.report.draw_environment(light, out, title=paths[0].name)


def _system() -> dict[str, object]:
    import os
    import platform
    from importlib.metadata import version as version_of

    choice = rl.renderers.choose_variant()
    return {
        "relume": version(),
        "python": platform.python_version(),
        "mitsuba": version_of("mitsuba"),
        "variant": choice.name,
        "because": choice.reason,
        "cores": os.cpu_count(),
    }

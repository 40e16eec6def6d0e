"""`relume stage patterns`: the pictures that a projector shows while a camera photographs each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import require_output_folder
from relume.cli.console import OutputOptions, print_facts
from relume.cli.option_types import Size


def patterns(
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The folder for the .png files, and projector.json.")],
    size: Annotated[Size, Parameter(help="Pixels of the projector, WIDTHxHEIGHT.")] = (1024, 768),
    period: Annotated[int, Parameter(help="Of the shifted cosines, projector pixels, even.")] = 16,
    steps: Annotated[int, Parameter(help="Shifts of the cosines, 4 or more.")] = 8,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Write the patterns of a scan: white, black, Gray code and shifted cosines of both axes."""
    require_output_folder(out)
    written = rl.lightstage.write_patterns(out, rl.lightstage.ProjectorPatterns(*size, period, steps))
    print_facts(output, {"written": str(out), "pictures": len(written) - 1})

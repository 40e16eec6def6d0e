"""`relume stage reflectometry`: photographs of a patch under a turning lamp in, its reflectance in numbers out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import require_suffix
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.option_types import Colour


def reflectometry(
    patch: Annotated[Path, Parameter(help="A folder of photographs of a patch, with patch.json: their angles.")],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The report, .html.")],
    light: Annotated[Colour, Parameter(help="Colour of the lamp, beside its irradiance.")] = (1.0, 1.0, 1.0),
    output: OutputOptions = OutputOptions(),
) -> None:
    """Measure a patch of skin (Debevec et al. 2000, §4.1, Fig. 10, 11): albedo, highlight, roughness, and plots."""
    with warnings_as_notes(output):
        require_suffix(out, ".html")
        samples = rl.lightstage.read_patch(patch)
        found = rl.lightstage.fit_patch(samples, light)
        rl.report.write_patch_report(out, samples, found, light, patch.name)
        print_facts(output, {"written": str(out), "samples": len(samples.values), **found.facts()})

"""`relume merge`: photographs in, calibrated radiance out, with a report of how sure it is."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, require_suffix
from relume.cli.console import OutputOptions, finish, note, print_facts, progress, warnings_as_notes
from relume.cli.merge_options import Lens, Readings, Steps, settings_of
from relume.cli.option_types import numbers


def merge(
    photographs: Annotated[
        list[Path],
        Parameter(help="Photographs (JPEG, PNG, TIFF or camera raw) or folders of them, in any order.", negative=""),
    ],
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The radiance map, .exr (all of it) or .hdr; without a suffix a folder for one map a bracket.",
        ),
    ],
    times: Annotated[
        tuple[float, ...] | Path | None,
        numbers(
            "SECONDS,…|FILE", like="1/30,1/60,0.5", above=0,
            help="Seconds of each photograph, like 1/30,1/60, in the order given, those of a folder by name, 9 before "
            "10; or a text file with a line for each, like: IMG_9.jpg 1/640.",
        ),
    ] = None,
    true_shutter: Annotated[
        bool, Parameter(negative="", help="Take marked shutter speeds for powers of two: 1/60 s for 1/64 s.")
    ] = False,
    ignore: Annotated[
        tuple[int, int, int] | None,
        numbers("R,G,B", like="0,0,255", help="Colour of pixels that are no part of the picture."),
    ] = None,
    profile: Annotated[
        Path | None,
        Parameter(help="The camera's profile, or a curve of pfstools or hdrgen, used as it is."),
    ] = None,
    save_profile: Annotated[
        Path | None, Parameter(alias="--save-response", help="Also write the camera's profile here, .json.")
    ] = None,
    report: Annotated[Path | None, Parameter(help="Also write a report here, .html.")] = None,
    accept: Annotated[bool, Parameter(negative="", help="Exit with 0 although the result is doubtful.")] = False,
    steps: Steps = Steps(),
    lens: Lens = Lens(),
    readings: Readings = Readings(),
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:  # fmt: skip
    """Measure radiance from differently exposed photographs: several brackets of a camera come out on one scale.

    Exposures come from --times, else from a list beside the photographs, else from EXIF, else from the pixels. --times
    go with the photographs in the order given, those of a folder by name, IMG_9 before IMG_10; a list in a file has a
    line like "IMG_9.jpg 1/640" for each. What is read in a picture (--spot, --lux, --luminaire, --white, --glare) is
    read in the first bracket and holds for all. A doubtful result is written all the same, with exit code 4.
    """
    import relume as rl

    # Notes are shown as they come and kept for the JSON.
    notes: list[str] = []

    def noted(line: str) -> None:
        notes.append(" ".join(line.split()))
        note(output, line)

    with warnings_as_notes(output):
        warnings.showwarning = lambda message, *_, **__: noted(str(message))  # until `warnings_as_notes` ends
        # What is to be done; refused before any work where it cannot.
        for path, suffix, option in ((save_profile, ".json", "--save-profile"), (report, ".html", "--report")):
            if path is not None:
                require_suffix(path, suffix, option=option)
        plan = rl.capture.plan_merge(
            photographs, out, times=times, ignore=ignore, true_shutter=true_shutter, profile=profile,
            save_profile=save_profile, settings=settings_of(steps, lens, readings),
        )  # fmt: skip
        for line in plan.notes:
            noted(line)
        # The work, or what it would be.
        if dry_run:
            facts, blocks = rl.report.plan_facts(plan), rl.report.plan_summary(plan)
        else:
            with progress(output) as advance:
                shoot = rl.capture.merge_shoot(plan, progress=lambda step: advance(step, 0.0))
            for line in shoot.result.notes:
                noted(line)
            if report is not None:
                rl.report.write_capture_report(shoot.result, report, settings=plan.settings, profile=plan.profile_name)
            facts, blocks = rl.report.merge_facts(shoot), rl.report.merge_summary(shoot, report=report)
        # What came of it.
        if output.json:
            written = None if report is None or dry_run else str(report)
            print_facts(output, facts | {"notes": notes, "report": written})
        else:
            for title, lines in blocks:
                print_facts(output, lines, title=title)
        if not dry_run:
            finish(output, shoot.result.warnings, accept=accept)

"""`relume merge`: photographs in, calibrated radiance out, with a report of how sure it is."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, read_times, require_suffix
from relume.cli.console import Manner, note, progress, speaking, tell
from relume.cli.merge_options import Lens, Readings, Steps, numbers, treatment_of, whole
from relume.errors import DoubtfulResult, NotABracket, OutputNotWritten

if TYPE_CHECKING:
    from relume.capture.profile import CameraProfile

MAPS = (".exr", ".hdr")


def merge(
    photographs: Annotated[
        list[Path],
        Parameter(help="Photographs (JPEG, PNG, TIFF or camera raw) or folders of them, in any order.", negative=""),
    ],
    /,
    *,
    out: Annotated[
        Path,
        Parameter(alias="-o", help="The radiance map, .exr (all of it) or .hdr; a folder for several brackets."),
    ],
    times: Annotated[
        str | None,
        Parameter(help="Exposure time of each photograph in seconds, like 1/30,1/60, or a file that lists them."),
    ] = None,
    true_shutter: Annotated[
        bool, Parameter(negative="", help="Take marked shutter speeds for powers of two: 1/60 s for 1/64 s.")
    ] = False,
    ignore: Annotated[
        str | None, Parameter(help="Colour R,G,B of pixels that are no part of the picture, like 0,0,255.")
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
    manner: Manner = Manner(),
) -> None:
    """Measure radiance from differently exposed photographs: several brackets of a camera come out on one scale.

    Exposures come from --times, else from a list beside the photographs, else from EXIF, else from the pixels. A
    doubtful result is written all the same and told with exit code 4.
    """
    from relume.capture.folder import expand
    from relume.capture.grouping import group_files
    from relume.capture.profile import read_profile
    from relume.cli.merge_job import Job, Reading, forecast, results_of, write
    from relume.image.files.signatures import kind_of

    with speaking(manner):
        paths = expand(photographs)
        raws = tuple(path for path in paths if kind_of(path) == "RAW")
        if raws and len(raws) < len(paths):
            note(manner, f"{len(paths) - len(raws)} photographs beside {len(raws)} camera raws are left out")
            paths = raws
        reading = Reading(exposure_times(times), ignored_colour(ignore), true_shutter)
        groups = (paths,) if times else group_files(paths)
        for path, suffix, option in ((save_profile, ".json", "--save-profile"), (report, ".html", "--report")):
            if path is not None:
                require_suffix(path, suffix, option=option)
        if save_profile is not None and profile is not None:
            raise NotABracket(
                f"--save-profile {save_profile}: --profile gives one, so there is none to save; leave it out"
            )
        known = read_profile(profile) if profile is not None else None
        if known is not None and (known.sensor is not None) != bool(raws):
            kinds = ("encoded photographs", "camera raws")
            raise NotABracket(
                f"--profile {profile}: a profile of {kinds[not raws]}, and these are {kinds[bool(raws)]}; save one of "
                "such as these with --save-profile"
            )
        treatment = treatment_of(steps, lens, readings, known)
        idle = without_effect(steps, raw=bool(raws), profile=known, ignore=ignore, true_shutter=true_shutter)
        if idle:
            why = "camera raws are merged as they are" if raws else "the profile's response is taken as it is"
            note(manner, f"without effect: {', '.join(idle)}; {why}")
        job = Job(groups, targets(groups, out), reading, known, treatment, readings, bool(raws))
        if dry_run:
            tell(manner, forecast(job))
            return
        with progress(manner) as advance:
            results = results_of(job, lambda step: advance(step, 0.0))
        for line in (line for result in results for line in result.measurement.notes()):
            note(manner, line)
        tell(manner, write(job, results, save_profile=save_profile, report=report))
        objections = [line for result in results for line in result.measurement.objections()]
        for line in objections if accept or len(objections) > 1 else ():
            note(manner, line)
        if objections and not accept:
            raise DoubtfulResult(
                f"{objections[0]} (all was written; --accept takes it as it is)"
                if len(objections) == 1
                else f"{len(objections)} doubts, noted above (all was written; --accept takes it as it is)"
            )


def exposure_times(text: str | None) -> list[float] | Path | None:
    """Seconds from the command line, or the file that lists them."""
    try:
        listed = text is not None and Path(text).is_file()
    except OSError:  # a row of times longer than any file's name
        listed = False
    return Path(text) if text is not None and listed else read_times(text)


def ignored_colour(text: str | None) -> tuple[int, int, int] | None:
    """The colour of what is no part of the picture."""
    if text is None:
        return None
    red, green, blue = whole(numbers(text, "--ignore", 3), "--ignore")
    return red, green, blue


def without_effect(
    steps: Steps, *, raw: bool, profile: CameraProfile | None, ignore: str | None, true_shutter: bool
) -> tuple[str, ...]:
    """The options given that do nothing for these photographs."""
    of_response = {"--neutral": steps.neutral is not None, "--method": steps.method != Steps.method}
    of_steps = {
        "--no-align": not steps.align,
        "--no-deghost": not steps.deghost,
        "--paper-weights": steps.paper_weights,
    }
    given: dict[str, bool] = {}
    if raw:
        given = of_response | of_steps | {"--ignore": ignore is not None, "--true-shutter": true_shutter}
    elif profile is not None:
        given = of_response | {"--refine": steps.refine}
    return tuple(option for option, is_given in given.items() if is_given)


def targets(groups: Sequence[Sequence[Path]], out: Path) -> tuple[Path, ...]:
    """The map to write for each bracket; refuses before any work what cannot be written."""
    names = [group[0].stem if len(group) == 1 else f"{group[0].stem}-{group[-1].stem}" for group in groups]
    if len(groups) == 1:
        path = out / f"{names[0]}.exr" if out.is_dir() else out
        require_suffix(path, *MAPS)
        return (path,)
    if out.suffix.lower() in MAPS:
        found = "; ".join(f"{group[0].name} … {group[-1].name} ({len(group)})" for group in groups)
        raise NotABracket(
            f"{len(groups)} brackets are here, not one: {found}. Give a folder as -o, or the photographs of one bracket"
        )
    if out.exists() and not out.is_dir():
        raise OutputNotWritten(f"-o {out}: not a folder; {len(groups)} radiance maps are to be written in it")
    if len(set(names)) < len(names):
        # Cameras count from 1 in every folder: one map must not overwrite another.
        names = [f"{group[0].absolute().parent.name}-{name}" for group, name in zip(groups, names, strict=True)]
    taken: list[str] = []
    for name in names:
        numbered = (name if number == 0 else f"{name}_{number}" for number in count())
        taken.append(next(each for each in numbered if each not in taken))
    return tuple(out / f"{name}.exr" for name in taken)

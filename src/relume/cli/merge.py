"""`relume merge`: photographs in, calibrated radiance out, with a report of how sure it is."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, read_times, require_suffix
from relume.cli.console import OutputOptions, finish, note, print_facts, progress, warnings_as_notes
from relume.cli.merge_options import Lens, Readings, Steps, numbers, settings_of, whole
from relume.errors import NotABracket, OutputNotWritten

if TYPE_CHECKING:
    from relume.capture.response.camera_profile import CameraProfile
    from relume.cli.merge_facts import Block

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
        Parameter(
            alias="-o",
            help="The radiance map, .exr (all of it) or .hdr; without a suffix a folder for one map a bracket.",
        ),
    ],
    times: Annotated[
        str | None,
        Parameter(
            help="Seconds of each photograph, like 1/30,1/60, in the order given, those of a folder by name, 9 before "
            "10; or a text file with a line for each, like: IMG_9.jpg 1/640."
        ),
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
    output: OutputOptions = OutputOptions(),
) -> None:
    """Measure radiance from differently exposed photographs: several brackets of a camera come out on one scale.

    Exposures come from --times, else from a list beside the photographs, else from EXIF, else from the pixels. --times
    go with the photographs in the order given, those of a folder by name, IMG_9 before IMG_10; a list in a file has a
    line like "IMG_9.jpg 1/640" for each. What is read in a picture (--spot, --lux, --luminaire, --white, --glare) is
    read in the first bracket and holds for all. A doubtful result is written all the same and told with exit code 4.
    """
    from relume.capture.exposure.folder import expand, name_order
    from relume.capture.exposure.grouping import group_files
    from relume.capture.response.camera_profile import read_profile
    from relume.cli import merge_facts
    from relume.cli.merge_job import Job, Reading, forecast, merged, write
    from relume.image.files.signatures import kind_of

    notes: list[str] = []

    def noted(line: str) -> None:
        notes.append(" ".join(line.split()))
        note(output, line)

    with warnings_as_notes(output):
        warnings.showwarning = lambda message, *_, **__: noted(str(message))  # until `warnings_as_notes` ends
        paths = expand(photographs)
        raws = tuple(path for path in paths if kind_of(path) == "RAW")
        if raws and len(raws) < len(paths):
            left = len(paths) - len(raws)
            words = ("photograph", "is") if left == 1 else ("photographs", "are")
            noted(f"{left} {words[0]} beside {len(raws)} camera raw{'s' * (len(raws) > 1)} {words[1]} left out")
            paths = raws
        reading = Reading(exposure_times(times), ignored_colour(ignore), true_shutter)
        require_as_many(reading.times, paths)
        if isinstance(reading.times, list) and list(paths) != sorted(paths, key=name_order):
            noted(f"--times go with the photographs in the order given, {', '.join(path.name for path in paths)}")
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
        settings = settings_of(steps, lens, readings)
        idle = without_effect(steps, raw=bool(raws), profile=known, ignore=ignore, true_shutter=true_shutter)
        if idle:
            why = "camera raws are merged as they are" if raws else "the profile's response is taken as it is"
            noted(f"without effect: {', '.join(idle)}; {why}")
        name = "" if profile is None else profile.name
        job = Job(groups, targets(groups, out), reading, known, settings, bool(raws), name)
        if settings.placed and len(groups) > 1:
            require_one_camera(groups, settings.placed[0])
        if dry_run:
            plans = forecast(job)
            say(output, merge_facts.planned_numbers(plans, notes), merge_facts.planned_blocks(plans))
            return
        with progress(output) as advance:
            result = merged(job, lambda step: advance(step, 0.0))
        for line in result.notes:
            noted(line)
        doubts = result.warnings
        written = write(job, result, save_profile=save_profile, report=report)
        say(
            output,
            merge_facts.numbers(result, job.targets, profile=written, report=report, notes=notes),
            merge_facts.blocks(result, job.targets, profile=written, report=report),
        )
        finish(output, doubts, accept=accept)


def say(output: OutputOptions, facts: Mapping[str, object], blocks: Sequence[Block]) -> None:
    """Print one object for machines, or the blocks for a person."""
    if output.json:
        print_facts(output, facts)
        return
    for title, lines in blocks:
        print_facts(output, lines, title=title)


def require_as_many(times: list[float] | Path | None, paths: Sequence[Path]) -> None:
    """Refuse another number of times than of photographs, and say which order they go in."""
    if isinstance(times, list) and len(times) != len(paths):
        raise NotABracket(
            f"{len(times)} times were given for {len(paths)} photographs; give one a photograph, in this order (a "
            f"folder's is by name, 9 before 10): {', '.join(path.name for path in paths)}"
        )


def require_one_camera(groups: Sequence[Sequence[Path]], option: str) -> None:
    """Refuse a reading for brackets of several cameras: it tells the scale of one of them only."""
    from relume.image.files import read_facts

    cameras = dict.fromkeys(read_facts(group[0]).camera or "an unknown one" for group in groups)
    if len(cameras) > 1:
        raise NotABracket(
            f"{option} is read in one bracket, and these are of several cameras ({', '.join(cameras)}); merge them "
            "camera by camera"
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
    if out.suffix and not out.is_dir():
        require_suffix(out, *MAPS)
        if len(groups) == 1:
            return (out,)
        found = "; ".join(map(_described, groups))
        raise NotABracket(
            f"{len(groups)} brackets are here, not one: {found}. Give a folder as -o, or the photographs of one bracket"
        )
    if out.exists() and not out.is_dir():
        raise OutputNotWritten(f"-o {out}: not a folder; without .exr or .hdr it is one, for the maps")
    if len(set(names)) < len(names):
        # Cameras count from 1 in every folder: one map must not overwrite another.
        names = [f"{group[0].absolute().parent.name}-{name}" for group, name in zip(groups, names, strict=True)]
    taken: list[str] = []
    for name in names:
        numbered = (name if number == 0 else f"{name}_{number}" for number in count())
        taken.append(next(each for each in numbered if each not in taken))
    return tuple(out / f"{name}.exr" for name in taken)


def _described(group: Sequence[Path]) -> str:
    """A bracket in words, with what of its first photograph parts brackets."""
    from relume.image.files import read_facts

    first = read_facts(group[0])
    told = [f"{len(group)} photograph{'s' * (len(group) > 1)}"]
    told.append(first.camera or ("camera unknown" if first.exposure else "no EXIF"))
    told.append("{}×{}".format(*first.size))
    if first.exposure and first.exposure.f_number:
        told.append(f"f/{first.exposure.f_number:g}")
    if first.settings.focal_length:
        told.append(f"{first.settings.focal_length:g} mm")
    if first.settings.taken:
        told.append(f"taken {first.settings.taken:%Y-%m-%d %H:%M:%S}")
    names = group[0].name if len(group) == 1 else f"{group[0].name} … {group[-1].name}"
    return f"{names} ({', '.join(told)})"

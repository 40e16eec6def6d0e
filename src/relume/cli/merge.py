"""`relume merge`: photographs in, calibrated radiance out, with a report of how sure it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter

import relume as rl
from relume.cli.arguments import Accept, ClusterWord, DryRun, require_suffix
from relume.cli.console import OutputOptions, finish, one_by_one, print_facts, progress, spread, warnings_as_doubts
from relume.cli.option_types import TimesFromNames, numbers

Method = Literal["debevec-malik", "mitsunaga-nayar", "robertson"]
STEPS, LENS, SCALE = Group("Steps", sort_key=1), Group("Lens", sort_key=2), Group("Absolute scale, one of", sort_key=3)
Spot = tuple[int, int, float] | tuple[int, int, float, float]
Lux = tuple[int, int, int, int, float, float]
Luminaire = tuple[int, int, int, int, float, float, float]
BOX = "X,Y,WIDTH,HEIGHT"


@Parameter(name="*")
@dataclass(frozen=True)
class Steps:
    """What is done to the photographs."""

    method: Annotated[Method, Parameter(group=STEPS, help="How the response is recovered.")] = "debevec-malik"
    refine: Annotated[
        bool, Parameter(group=STEPS, negative="", help="Correct exposures that the photographs contradict.")
    ] = False
    align: Annotated[bool, Parameter(group=STEPS, help="Bring photographs that moved onto one another.")] = True
    deghost: Annotated[bool, Parameter(group=STEPS, help="Leave out what moved between them.")] = True
    paper_weights: Annotated[
        bool, Parameter(group=STEPS, negative="", help="Weight as Debevec & Malik do (eq. 4).")
    ] = False
    neutral: Annotated[
        int | None,
        Parameter(group=STEPS, help="Pixel value whose equal channels are grey; white unless given, 128 for film."),
    ] = None
    scans: Annotated[
        list[Path] | None,
        Parameter(group=STEPS, negative="", consume_multiple=True,
                  help="These are scans of one negative: the profile of each one's density setting, in their order."),
    ] = None  # fmt: skip


@Parameter(name="*")
@dataclass(frozen=True)
class Lens:
    """What the lens did to the light."""

    glare: Annotated[
        tuple[int, int, int, int] | None,
        numbers(
            BOX, like="40,60,8,8", group=LENS, help="A black place of the picture: its veil of glare is taken out."
        ),
    ] = None
    glare_lamp: Annotated[
        tuple[int, int, int, int] | None,
        numbers(
            BOX, like="300,200,6,6", group=LENS, help="A small lamp in --glare-map: its veil and halo are taken out."
        ),
    ] = None
    glare_map: Annotated[
        Path | None,
        Parameter(group=LENS, help="A radiance map of a lamp in a dark room by the same lens and aperture."),
    ] = None
    flat_field: Annotated[
        list[Path] | None,
        Parameter(
            group=LENS, negative="", consume_multiple=True,
            help="Radiance maps of an evenly lit wall by the same lens and aperture: its vignetting is taken out.",
        ),
    ] = None  # fmt: skip
    lateral: Annotated[
        tuple[float, float, float, float] | str | None,
        numbers(
            "RED_A,RED_B,BLUE_A,BLUE_B", like="auto or 0.0004,-0.0002,-0.0003,0.0001", group=LENS, words=("auto",),
            help="Bring red and blue onto green: auto finds lateral colour in the edges; numbers say how much larger "
            "than green each is drawn, a + b ρ² of the radius, ρ in half diagonals, below 0 smaller.",
        ),
    ] = None  # fmt: skip
    white: Annotated[
        tuple[int, int, int, int] | None,
        numbers(BOX, like="40,60,8,8", group=LENS, help="A white light or card that is to come out grey."),
    ] = None
    focal_length: Annotated[float | None, Parameter(group=LENS, help="In pixels, where the photographs hold none.")] = (
        None
    )


@Parameter(name="*")
@dataclass(frozen=True)
class Readings:
    """What gives the map its scale to cd/m²."""

    absolute: Annotated[
        bool, Parameter(group=SCALE, negative="", help="From shutter, aperture and ISO; good to a third of a stop.")
    ] = False
    spot: Annotated[
        Spot | None,
        numbers("X,Y,CD[,RADIUS]", like="60,40,500", group=SCALE, help="A spot meter's reading: cd/m² at pixel X,Y."),
    ] = None
    lux: Annotated[
        Lux | None,
        numbers(
            f"{BOX},LUX,REFLECTANCE", like="20,30,16,8,1000,0.18", group=SCALE,
            help="A lux meter's reading on a matt card in that rectangle.",
        ),
    ] = None  # fmt: skip
    luminaire: Annotated[
        Luminaire | None,
        numbers(
            f"{BOX},R,G,B", like="20,30,16,8,100,100,100", group=SCALE,
            help="A light of known cd/m² and colour (white: R = G = B).",
        ),
    ] = None  # fmt: skip


def settings_of(steps: Steps, lens: Lens, readings: Readings) -> rl.capture.MergeSettings:
    """The settings that the options ask for."""
    return rl.capture.MergeSettings(
        method=rl.capture.RESPONSE_METHODS[steps.method],
        weighting=rl.capture.Hat() if steps.paper_weights else rl.capture.InverseVariance(),
        refine=steps.refine,
        align=steps.align,
        deghost=steps.deghost,
        neutral=steps.neutral,
        glare=_glare(lens),
        vignetting=rl.capture.read_flat_fields(lens.flat_field or ()),
        lateral=_lateral(lens.lateral),
        balance=None if lens.white is None else rl.capture.WhiteCard(rl.capture.Rectangle(*lens.white)),
        scale=_scale(readings),
        focal_length=lens.focal_length,
    )


def _glare(lens: Lens) -> Callable[[rl.RadianceMap], rl.capture.Glare] | None:
    """What shows the glare; raises ValueError for two, and for a half of one."""
    if (lens.glare_lamp is None) != (lens.glare_map is None):
        raise ValueError("--glare-lamp and --glare-map go together: the lamp's pixels, and the map that shows it")
    if lens.glare_lamp is not None and lens.glare_map is not None:
        if lens.glare is not None:
            raise ValueError("--glare and --glare-lamp both give the glare; give one")
        return rl.capture.LampInTheDark(lens.glare_map, rl.capture.Rectangle(*lens.glare_lamp))
    return None if lens.glare is None else rl.capture.DarkPlace(rl.capture.Rectangle(*lens.glare))


def _lateral(given: tuple[float, float, float, float] | str | None) -> Any:
    if given is None or isinstance(given, str):
        return None if given is None else rl.capture.recover_lateral_colour
    return rl.capture.LateralColour(given[:2], given[2:])


def _scale(readings: Readings) -> Callable[..., rl.capture.Scale] | None:
    """The reading that was given; raises ValueError for two."""
    given = [name for name in ("absolute", "spot", "lux", "luminaire") if getattr(readings, name)]
    if len(given) > 1:
        raise ValueError(f"--{given[0]} and --{given[1]} both give the scale; give one")
    if readings.spot is not None:
        return rl.capture.SpotReading(*readings.spot[:2], *readings.spot[2:])
    if readings.lux is not None:
        return rl.capture.LuxReading(rl.capture.Rectangle(*readings.lux[:4]), *readings.lux[4:])
    if readings.luminaire is not None:
        return rl.capture.LuminaireReading(rl.capture.Rectangle(*readings.luminaire[:4]), readings.luminaire[4:])
    return rl.capture.ExposureScale() if readings.absolute else None


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
    times_from_names: TimesFromNames = False,
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
    accept: Accept = False,
    steps: Steps = Steps(),
    lens: Lens = Lens(),
    readings: Readings = Readings(),
    each: Annotated[
        bool,
        Parameter(
            negative="",
            help="Merge every bracket in the folders by itself, to -o FOLDER/name.exr; one that cannot be merged is "
            "named, and the others are written.",
        ),
    ] = False,
    cluster: ClusterWord = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:  # fmt: skip
    """Measure radiance from differently exposed photographs: several brackets of a camera come out on one scale.

    Exposures come from --times or --times-from-names, else from a list beside the photographs, else from EXIF, else
    from the pixels. What is read in a picture (--spot, --lux, --luminaire, --white, --glare) is read in the first
    bracket and holds for all. A doubtful result is written all the same, with exit code 4.
    """
    with warnings_as_doubts(output) as doubts:
        # What is to be done.
        for path, suffix, option in ((save_profile, ".json", "--save-profile"), (report, ".html", "--report")):
            if path is not None:
                require_suffix(path, suffix, option=option)
        if steps.scans:
            _scans(photographs, out, times, steps, output, bool(each or cluster or profile or save_profile or report))
        elif each:
            _refuse_of_one_shoot(out, times=times, save_profile=save_profile, report=report)
            shared = {"times_from_names": times_from_names, "ignore": ignore, "true_shutter": true_shutter}
            chosen = shared | {"profile": profile, "settings": settings_of(steps, lens, readings)}
            _each(photographs, out, chosen, cluster, dry_run, output)
        if steps.scans or each:
            return finish(output, doubts, accept=accept or dry_run)
        if cluster is not None:
            raise ValueError("--cluster is for many brackets; give --each too, or leave it out")
        plan = rl.capture.plan_merge(
            photographs, out, times=times, times_from_names=times_from_names, ignore=ignore, true_shutter=true_shutter,
            profile=profile, save_profile=save_profile, settings=settings_of(steps, lens, readings),
        )  # fmt: skip
        doubts += [rl.errors.Doubt(line) for line in plan.notes]
        # The work, or what it would be.
        if dry_run:
            facts, blocks = rl.report.plan_facts(plan), rl.report.plan_summary(plan)
        else:
            with progress(output) as advance, one_by_one(advance) as step:
                shoot = rl.capture.merge_shoot(plan, progress=step)
            doubts += shoot.result.doubts
            if report is not None:
                rl.report.write_capture_report(shoot.result, report, settings=plan.settings, profile=plan.profile_name)
            facts, blocks = rl.report.merge_facts(shoot), rl.report.merge_summary(shoot, report=report)
        # What came of it.
        if output.json:
            written = None if report is None or dry_run else str(report)
            lesser = [" ".join(each.words.split()) for each in rl.errors.ranked(doubts) if not each.wrong]
            print_facts(output, facts | {"notes": lesser, "report": written})
        else:
            for title, lines in blocks:
                print_facts(output, lines, title=title)
        finish(output, doubts, accept=accept or dry_run, rest=report)


def _scans(
    scans: list[Path],
    out: Path,
    times: tuple[float, ...] | Path | None,
    steps: Steps,
    output: OutputOptions,
    more: bool,
) -> None:
    """Scans of one negative at different density settings, into one map."""
    require_suffix(out, ".exr", ".hdr", option="-o")
    if more:
        raise ValueError(
            "--each, --cluster, --profile, --save-profile and --report are not for --scans; leave them out"
        )
    if isinstance(times, Path) or len(set(times or ())) > 1:
        raise ValueError("--scans are of one negative, and --times is its one exposure; give one number")
    seconds = times[0] if times else None
    rl.write(out, rl.capture.merge_scan_files(scans, steps.scans or (), seconds=seconds))
    print_facts(output, {"written": str(out), "scans": len(scans)})


def _refuse_of_one_shoot(out: Path, **given: object) -> None:
    """Refuse what belongs to one shoot alone beside --each."""
    for name, value in given.items():
        if value is not None:
            raise ValueError(
                f"--{name.replace('_', '-')} is of one shoot, and --each merges many brackets; leave it out"
            )
    if out.suffix:
        raise ValueError(f"-o {out}: with --each it is a folder for a map of each bracket; leave {out.suffix} away")


def _each(
    folders: list[Path], out: Path, chosen: dict[str, Any], cluster: str | None, dry_run: bool, output: OutputOptions
) -> None:
    """Merge every bracket by itself, or list them."""
    if dry_run:
        found = rl.capture.find_brackets(folders, out)
        maps = {str(target): len(group) for target, group in zip(found.targets, found.groups, strict=True)}
        print_facts(output, {"would write": len(maps), **maps, **dict(found.failed)})
        return
    with spread(cluster, output) as (workers, advance):
        made = rl.capture.merge_each(folders, out, **chosen, cluster=workers, progress=advance)
    kept = sum(each.kept for each in made)
    print_facts(output, {"written": str(out), "brackets": len(made), "kept from before": kept})

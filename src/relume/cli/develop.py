"""`relume develop`: radiance in, a photograph out; frames of a sequence, and the way back."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from relume.cli.arguments import DryRun, refuse_input, require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, progress, version, warnings_as_notes
from relume.cli.develop_options import CameraOptions, SceneOptions
from relume.cli.option_types import numbers
from relume.cli.reading_options import ReadingOptions

PICTURES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".avif")


def develop(
    pictures: Annotated[
        list[Path] | None,
        Parameter(
            name="IN",
            negative="",
            help="The radiance map, .exr, .hdr or another format; several are the frames of a sequence, in that order.",
        ),
    ] = None,
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(
            alias="-o",
            help="The picture to write: .png or .jpg, .avif for --display pq and hlg; for a sequence a folder or an "
            ".mp4; with --undo an .exr.",
        ),
    ] = None,
    camera: CameraOptions = CameraOptions(),
    scene: SceneOptions = SceneOptions(),
    response: Annotated[
        Path | None,
        Parameter(help="A profile or response that merge or insert wrote, or a curve of pfstools or hdrgen."),
    ] = None,
    seconds: Annotated[
        float | None,
        Parameter(help="With --response: exposure per unit of radiance; metered from the picture unless given."),
    ] = None,
    match: Annotated[
        Path | None, Parameter(help="Match this photograph's camera: its exposure, vignetting, sharpness and grain.")
    ] = None,
    undo: Annotated[
        bool, Parameter(negative="", help="The way back: IN is a photograph, OUT its radiance before the camera.")
    ] = False,
    repair: Annotated[
        bool, Parameter(negative="", help="Replace NaN and infinite pixels by their neighbours, with a warning.")
    ] = False,
    sheet: Annotated[Path | None, Parameter(help="Also write a contact sheet at several --stops.")] = None,
    stops: Annotated[
        tuple[float, ...] | None,
        numbers("STOPS,…", like="-4,-2,0,2,4", help="Stops of --sheet; -4,-2,0,2,4 unless given."),
    ] = None,
    false_colour: Annotated[
        Path | None, Parameter(help="Also write the luminances in false colour, with their scale.")
    ] = None,
    report: Annotated[Path | None, Parameter(help="Also write a report with a wipe, stops and facts, .html.")] = None,
    fps: Annotated[
        float | None, Parameter(help="Frames per second of a sequence; 24 unless given.", validator=Number(gt=0))
    ] = None,
    settling: Annotated[
        float | None,
        Parameter(
            help="Seconds in which a sequence's adaptation follows the light, 0.4; 0 takes each frame alone.",
            validator=Number(gte=0),
        ),
    ] = None,
    list_presets: Annotated[bool, Parameter(negative="", help="List the built-in presets, and stop.")] = False,
    show_preset: Annotated[
        str | None, Parameter(help="Print a preset's TOML, to start one's own from, and stop.")
    ] = None,
    reading: ReadingOptions = ReadingOptions(),
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Develop radiance into a photograph: lens, glare, tone mapping or film, display; or undo a photograph.

    Everything happens in linear light and in physical order, whatever order the options are in: motion, defocus, soft
    focus, glare, distortion, vignetting, then the tone operator or film, then the display.
    """
    import relume as rl

    with warnings_as_notes(output), progress(output) as advance:
        # Presets are shown without a picture.
        if list_presets:
            print_facts(output, rl.Preset.builtin())
            return
        if show_preset is not None:
            print(rl.Preset.text(show_preset), end="")
            return
        # Refuse what contradicts, before any work is done.
        if not pictures or out is None:
            raise ValueError("give a radiance map and -o, a picture, like: relume develop room.exr -o room.png")
        require_files(pictures)
        refuse_input(out, pictures)
        sequence = len(pictures) > 1 or out.suffix.lower() == ".mp4" or out.is_dir()
        beside = {"--sheet": sheet, "--false-colour": false_colour, "--report": report}
        _refuse_outputs(beside, out, pictures)
        if stops is not None and sheet is None:
            raise ValueError("--stops are of --sheet; give that too, or leave them out")
        if match is not None and seconds is not None:
            raise ValueError("--match takes the plate's exposure; leave --seconds out")
        if match is not None and (camera.chooses_tone or camera.soft is not None or camera.vignetting):
            raise ValueError("--match is a whole camera; leave --tone, --film, --shutter, --soft and --vignetting out")
        if response is None and seconds is not None and not undo:
            raise ValueError("--seconds is the exposure on --response; give that too, or leave it out")
        if scene.depth_along is not None and scene.depth is None:
            raise ValueError("--depth-along is of --depth; give that too, or leave it out")
        for option, value in (("--fps", fps), ("--settling", settling)):
            if value is not None and not sequence:
                raise ValueError(f"{option} is of a sequence; give several pictures, or leave it out")
        if any(beside.values()) and (undo or sequence):
            raise ValueError("--sheet, --false-colour and --report are of one picture; leave them out")
        if undo and (camera.tone or camera.film or camera.exposure is not None or repair):
            raise ValueError("--undo has no tone, film, exposure or repair of its own; leave them out")
        settings = rl.DevelopSettings(
            preset=camera.read(vectors=scene.vectors is not None),
            field_of_view=scene.field_of_view,
            luminance=scene.luminance,
            depth=scene.depth,
            depth_along=scene.depth_along,
            vectors=scene.vectors,
            seed=scene.seed,
            response=response,
            exposure=seconds,
            match=match,
            reading=reading.reading(),
            repair=repair,
            frames_per_second=24.0 if fps is None else fps,
            settling=0.4 if settling is None else settling,
        )
        # One of the three jobs.
        if undo:
            if len(pictures) != 1:
                raise ValueError(f"--undo takes one photograph, not {len(pictures)}; merge a bracket with relume merge")
            print_facts(output, rl.undevelop_file(pictures[0], out, settings, dry_run=dry_run))
            return
        if sequence:
            if out.suffix and out.suffix.lower() != ".mp4":
                raise ValueError(f"-o {out}: {len(pictures)} pictures are given; name a folder or an .mp4 for them")
            print_facts(output, rl.develop_sequence(pictures, out, settings, dry_run=dry_run, progress=advance))
            return
        if not out.suffix:
            raise ValueError(f"-o {out}: name a picture, like {out}.png; several frames need a folder")
        require_suffix(out, *PICTURES)
        made = rl.develop_file(pictures[0], out, settings, dry_run=dry_run, progress=advance)
        # What was asked for beside the picture.
        facts = dict(made.facts)
        if sheet and not dry_run:
            rl.write(sheet, made.stops_sheet(stops or (-4, -2, 0, 2, 4)))
            facts["sheet"] = str(sheet)
        if false_colour and not dry_run:
            rl.write(false_colour, rl.tone.false_colour(made.image))
            facts["false colour"] = str(false_colour)
        if report and not dry_run:
            rl.write_develop_report(report, made, facts={**facts, "relume": version()})
            facts["report"] = str(report)
        print_facts(output, facts)


def _refuse_outputs(beside: dict[str, Path | None], out: Path, pictures: list[Path]) -> None:
    """Refuse files beside the picture of other kinds, the inputs, and two of one name; raises ValueError."""
    seen = {out.resolve()}
    for option, path in beside.items():
        if path is None:
            continue
        require_suffix(path, *((".html",) if option == "--report" else (".png", ".jpg")), option=option)
        refuse_input(path, pictures)
        if path.resolve() in seen:
            raise ValueError(f"{option} {path}: another output has that name; give each its own")
        seen.add(path.resolve())

"""`relume develop`: radiance in, a picture out that a person believes; frames of a sequence, and the way back."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, refuse_input, require_files
from relume.cli.console import OutputOptions, print_facts, progress, warnings_as_notes
from relume.cli.develop_options import CameraOptions
from relume.cli.develop_view import ViewOptions
from relume.cli.reading_options import ReadingOptions

STOPS = "-4,-2,0,2,4"


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
    scene: ViewOptions = ViewOptions(),
    response: Annotated[
        Path | None,
        Parameter(help="A profile or response that merge or insert wrote, or a curve of pfstools or hdrgen."),
    ] = None,
    seconds: Annotated[
        float | None,
        Parameter(help="With --response: exposure per unit of radiance; metered from the picture unless given."),
    ] = None,
    match: Annotated[
        Path | None, Parameter(help="A photograph whose camera it shall be: its exposure, fall-off, sharpness, grain.")
    ] = None,
    undo: Annotated[
        bool, Parameter(negative="", help="The way back: IN is a photograph, OUT its radiance before the camera.")
    ] = False,
    repair: Annotated[
        bool, Parameter(negative="", help="Replace NaN and infinite radiance by what is about it, and say so.")
    ] = False,
    sheet: Annotated[Path | None, Parameter(help="Write a contact sheet at several --stops too.")] = None,
    stops: Annotated[
        str | None,
        Parameter(help="Of --sheet, with commas between; -4,-2,0,2,4 unless given.", allow_leading_hyphen=True),
    ] = None,
    false_colour: Annotated[
        Path | None, Parameter(help="Write the luminances in false colour, with their scale, too.")
    ] = None,
    report: Annotated[Path | None, Parameter(help="Write a page with a wipe, stops and facts, .html, too.")] = None,
    fps: Annotated[float | None, Parameter(help="Frames a second of a sequence; 24 unless given.")] = None,
    settling: Annotated[
        float | None,
        Parameter(help="Seconds in which a sequence's adaptation follows the light, 0.4; 0 takes each frame alone."),
    ] = None,
    list_presets: Annotated[bool, Parameter(negative="", help="Tell the presets that come along, and stop.")] = False,
    show_preset: Annotated[
        str | None, Parameter(help="Print a preset's TOML, to start one's own from, and stop.")
    ] = None,
    accepted: ReadingOptions = ReadingOptions(),
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Develop radiance into a picture: through a lens, with glare, on film or as an eye sees it; undo a photograph.

    Everything happens in linear light and in physical order, whatever order the options are in: motion, defocus, soft
    focus, glare, distortion, vignetting, then the tone or film, then the display.
    """
    from relume.cli import develop_job as job

    with warnings_as_notes(output), progress(output) as advance:
        if list_presets:
            from relume.project.presets.preset import builtin_presets

            print_facts(output, builtin_presets())
            return
        if show_preset is not None:
            from relume.project.presets.preset import preset_file

            print(preset_file(show_preset).read_text(encoding="utf-8"), end="")
            return
        if not pictures or out is None:
            raise ValueError("give a radiance map and -o, a picture, like: relume develop room.exr -o room.png")
        require_files(pictures)
        refuse_input(out, pictures)
        sequence = len(pictures) > 1 or out.suffix.lower() == ".mp4" or out.is_dir()
        if stops is not None and sheet is None:
            raise ValueError("--stops are of --sheet; give that too, or leave them out")
        extras = job.Extras(sheet, job.read_stops(stops or STOPS), false_colour, report)
        extras.require(out, pictures)
        source = job.Source(response, seconds, match)
        if match is not None and seconds is not None:
            raise ValueError("--match takes the plate's exposure; leave --seconds out")
        if match is not None and (camera.makes_the_picture or camera.soft is not None or camera.vignetting):
            raise ValueError("--match is a whole camera; leave --tone, --film, --shutter, --soft and --vignetting out")
        if scene.depth_along is not None and scene.depth is None:
            raise ValueError("--depth-along is of --depth; give that too, or leave it out")
        for option, value in (("--fps", fps), ("--settling", settling)):
            if value is not None and not sequence:
                raise ValueError(f"{option} is of a sequence; give several pictures, or leave it out")
            if value is not None and not (value >= 0 if option == "--settling" else value > 0):
                raise ValueError(
                    f"{option} is {value:g}; expected {'0 or more' if option == '--settling' else 'above 0'}"
                )
        preset = camera.read(vectors=scene.vectors is not None)
        if extras.any and (undo or sequence):
            raise ValueError("--sheet, --false-colour and --report are of one picture; leave them out")
        if undo:
            if camera.tone or camera.film or camera.exposure is not None or repair:
                raise ValueError("--undo has no tone, film, exposure or repair of its own; leave them out")
            facts = job.undo(pictures, out, preset, scene, source, accepted.reading(), dry_run)
        elif sequence:
            rate = job.Rate(24.0 if fps is None else fps, 0.4 if settling is None else settling)
            facts = job.frames(pictures, out, preset, scene, source, rate, accepted.reading(), repair, dry_run, advance)
        else:
            facts = job.picture(
                pictures[0], out, preset, scene, source, extras, accepted.reading(), repair, dry_run, advance
            )
        print_facts(output, facts)

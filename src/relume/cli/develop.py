"""`relume develop`: radiance in, a photograph out; frames of a sequence, and the way back."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, refuse_input, require_files, require_suffix
from relume.cli.console import OutputOptions, print_facts, progress, warnings_as_notes
from relume.cli.develop_options import BesideOptions, CameraOptions, RealCameraOptions, SceneOptions, SequenceOptions
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
    real: RealCameraOptions = RealCameraOptions(),
    undo: Annotated[
        bool, Parameter(negative="", help="The way back: IN is a photograph, OUT its radiance before the camera.")
    ] = False,
    repair: Annotated[
        bool, Parameter(negative="", help="Replace NaN and infinite pixels by their neighbours, with a warning.")
    ] = False,
    beside: BesideOptions = BesideOptions(),
    frames: SequenceOptions = SequenceOptions(),
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
        real.refuse_contradictions(camera, undo=undo)
        beside.refuse_contradictions(out, pictures, several=undo or sequence)
        frames.refuse_single_picture(sequence)
        if undo and (camera.tone or camera.film or camera.exposure is not None or repair):
            raise ValueError("--undo has no tone, film, exposure or repair of its own; leave them out")
        settings = rl.DevelopSettings(
            preset=camera.read(vectors=scene.vectors is not None),
            **scene.settings(),
            response=real.response,
            exposure=real.seconds,
            match=real.match,
            reading=reading.reading(),
            repair=repair,
            frames_per_second=24.0 if frames.fps is None else frames.fps,
            settling=0.4 if frames.settling is None else frames.settling,
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
        facts = made.facts if dry_run else made.facts | beside.write(made)
        print_facts(output, facts)

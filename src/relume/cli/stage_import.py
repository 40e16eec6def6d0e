"""`relume stage import`: pictures under one light at a time in, a calibrated store that is quick to relight out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from relume.cli.arguments import DryRun, require_files
from relume.cli.console import Manner, progress, speaking, tell
from relume.cli.stage_import_lights import VIDEOS, stage_of_balls, stage_of_list
from relume.cli.stage_options import Camera, MaxMemory, bytes_of, work_of
from relume.errors import OutputNotWritten, UnreadableFile

if TYPE_CHECKING:
    from relume.lightstage.field import ReflectanceField


def import_stage(
    source: Annotated[
        Path,
        Parameter(help="A folder with stage.json or an .lp, such a file, a folder of pictures, or a film of a stage."),
    ],
    /,
    *,
    out: Annotated[
        Path, Parameter(alias="-o", help="The store to write, like cat.zarr; a store cut short is gone on with.")
    ],
    ball: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            help="Find the lights in a mirrored ball: find, or its X,Y,RADIUS in pixels; again for each "
            "ball. Balls with their radii in metres (X,Y,RADIUS=METRES) and --field-of-view tell places, not only "
            "directions.",
        ),
    ] = None,
    ball_pictures: Annotated[
        list[Path] | None,
        Parameter(
            negative="",
            help="A folder with pictures of the ball under the same lights in the same order, where it is not in the "
            "subject's own; again for each ball.",
        ),
    ] = None,
    lights: Annotated[
        Path | None,
        Parameter(help="The lights in an .lp, or a list of directions in the order of the pictures' names."),
    ] = None,
    field_of_view: Annotated[
        float | None, Parameter(help="Of the camera, across, degrees, for --ball; far away unless given.")
    ] = None,
    film: Annotated[
        str | None,
        Parameter(
            help="The course of a film's lamp, RINGS,COLUMNS,FRAMES: rings from top to bottom, lights a ring that are "
            "kept, and frames a turn."
        ),
    ] = None,
    film_start: Annotated[float, Parameter(help="The film's frame at which the lamp starts.")] = 0.0,
    film_azimuth: Annotated[
        float, Parameter(allow_leading_hyphen=True, help="Where each ring starts, degrees from +Z towards +X.")
    ] = 0.0,
    clockwise: Annotated[bool, Parameter(negative="", help="The film's lamp turns from +Z towards −X.")] = False,
    ambient: Annotated[
        Path | None, Parameter(help="A picture with all lights off, which is taken from every other.")
    ] = None,
    target: Annotated[
        str | None,
        Parameter(
            help="A white or grey card in the pictures, LEFT,TOP,WIDTH,HEIGHT=REFLECTANCE: every light's colour and "
            "intensity are measured on it and divided out."
        ),
    ] = None,
    mask: Annotated[
        Path | None, Parameter(help="White where values say nothing: one picture, or a folder with one a light.")
    ] = None,
    flare: Annotated[
        bool, Parameter(negative="", help="Leave out, and fill, lights that shine into the lens, and their flare.")
    ] = False,
    lamp_size: Annotated[float, Parameter(help="Apparent diameter of the lamps, degrees, for --flare.")] = 2.0,
    bars: Annotated[
        bool, Parameter(negative="", help="Leave out, and fill, the shadow of the stage's own bar.")
    ] = False,
    dtype: Annotated[
        Literal["half", "float", "8bit"], Parameter(help="How values are kept; 8bit with a scale for each picture.")
    ] = "half",
    camera: Camera = None,
    max_memory: MaxMemory = "2G",
    dry_run: DryRun = False,
    manner: Manner = Manner(),
) -> None:
    """Bring in a light stage: find its lights, calibrate its pictures, mend what says nothing, keep it in a store.

    A store is quick to relight, whatever its size. Overexposed values of photographs are left out and filled from the
    lights around.
    """
    import numpy as np

    from relume.lightstage.reading import read_stage
    from relume.lightstage.store_building import build_store, file_facts

    with speaking(manner):
        memory = bytes_of(max_memory, "--max-memory")
        _check(source, out, ball, ball_pictures, lights, film, ambient, field_of_view)
        facts: dict[str, object] = {}
        if film is not None:
            field = _filmed(source, out, film, film_start, film_azimuth, clockwise)
        elif ball or lights:
            from relume.lightstage.reading import folder_of

            left = [ambient] if ambient else []
            if ball:
                angle = None if field_of_view is None else float(np.radians(field_of_view))
                stage, facts = stage_of_balls(source, ball, ball_pictures or [], angle, left)
            else:
                assert lights is not None
                stage = stage_of_list(source, lights)
            field = folder_of(stage, source / "stage.json", camera, kept=0)
        else:
            field = read_stage(source, camera, kept=0)
        unmended = field
        field, told = _mended(field, ambient, target, mask, flare, lamp_size, bars)
        facts |= told
        if dry_run:
            tell(manner, {"would write": str(out), **work_of(field, memory), **facts})
            return
        kinds = {"half": np.float16, "float": np.float32, "8bit": np.uint8}
        options = [ball, field_of_view, film, film_start, film_azimuth, clockwise, target, flare, lamp_size, bars, camera]
        others = [path for path in (*(ball_pictures or ()), lights, ambient, mask) if path]
        made_from = {"options": options, "files": file_facts([*_files_of(source, unmended), *others])}
        with progress(manner) as report:
            build_store(
                field, out, dtype=kinds[dtype], max_memory=memory, progress=lambda share: report("importing", share),
                made_from=made_from,
            )  # fmt: skip
        tell(manner, {"written": str(out), "lights": len(field.lights), "size": list(field.shape[::-1]), **facts})


def _check(
    source: Path, out: Path, ball: list[str] | None, ball_pictures: list[Path] | None, lights: Path | None,
    film: str | None, ambient: Path | None,
    field_of_view: float | None,
) -> None:  # fmt: skip
    """Refuse what cannot be, before any work."""
    if not source.exists():
        raise UnreadableFile(f"{source}: no such folder or file; check the path")
    if (ball is not None) + (lights is not None) + (film is not None) > 1:
        raise ValueError("--ball, --lights and --film: give one of them")
    if (ball or lights) and not source.is_dir():
        raise UnreadableFile(f"{source}: a file; with --ball or --lights give the folder of the pictures")
    if source.suffix.lower() in VIDEOS and film is None:
        raise ValueError(f"{source}: a film; tell its lamp's course with --film RINGS,COLUMNS,FRAMES")
    if out.exists() and not out.is_dir():
        raise OutputNotWritten(f"-o {out}: a file, not a store; choose another name")
    if field_of_view is not None and not 0 < field_of_view < 180:
        raise ValueError(f"--field-of-view is {field_of_view}; give degrees above 0 and below 180")
    if ball_pictures and not ball:
        raise ValueError("--ball-pictures are for --ball; give --ball find, or its circle")
    for folder in ball_pictures or []:
        if not folder.is_dir():
            raise UnreadableFile(f"{folder}: no such folder; --ball-pictures names one")
    require_files([path for path in (lights, ambient) if path])


def _files_of(source: Path, field: ReflectanceField) -> list[Path]:
    """The files that the source's values come from: what describes it and, but for a film, its pictures."""
    from relume.lightstage.folder import PictureFolder

    if source.suffix.lower() in VIDEOS or not isinstance(field, PictureFolder):
        return [source / "zarr.json" if source.is_dir() else source]
    described = [source / "stage.json", *sorted(source.glob("*.lp"))] if source.is_dir() else [source]
    pictures = [path for names in field.files for path in names]
    return [path for path in described if path.is_file()] + pictures


def _mended(
    field: ReflectanceField,
    ambient: Path | None,
    target: str | None,
    mask: Path | None,
    flare: bool,
    lamp_size: float,
    bars: bool,
) -> tuple[ReflectanceField, dict[str, object]]:
    """The field calibrated and filled, and what was done to it."""
    import numpy as np

    from relume.lightstage import masking
    from relume.lightstage.ambient import WithoutAmbient
    from relume.lightstage.bar_shadow import bar_shadow
    from relume.lightstage.calibration import calibrate
    from relume.lightstage.corrected import Corrected
    from relume.lightstage.folder import PictureFolder

    facts: dict[str, object] = {}
    masks: list[masking.Mask] = []
    if isinstance(field, PictureFolder):
        masks.append(masking.Saturated(field))
    taken: ReflectanceField = field
    if ambient is not None:
        if not isinstance(field, PictureFolder):
            raise ValueError("--ambient is for pictures, not for a store")
        taken = WithoutAmbient.of(field, ambient)
    gains = None
    if target is not None:
        measured = calibrate(taken, _target(target, taken.shape))
        gains = measured.gains
        facts["irradiance, median"] = [float(f"{v:.4g}") for v in np.median(measured.irradiances, axis=0)]
        facts["lights not on the target"] = int((~measured.measured).sum())
    if flare:
        if taken.camera is None:
            raise ValueError("--flare needs the camera; tell it in stage.json")
        masks.append(
            masking.lens_flare_and_direct_light(taken, taken.camera, angular_radius=float(np.radians(lamp_size) / 2))
        )
    if bars:
        masks.append(bar_shadow(taken))
    if mask is not None:
        masks.append(masking.user_mask(mask, taken.lights, taken.shape))
    if gains is None and not masks:
        return taken, facts
    return Corrected(taken, gains, mask=masking.AnyOf(tuple(masks)) if masks else None), facts


def _target(text: str, shape: tuple[int, int]):
    """The card of --target."""
    import numpy as np

    from relume.lightstage.calibration import Target

    place, equals, reflectance = text.partition("=")
    try:
        left, top, width, height = (int(word) for word in place.split(","))
        share = float(reflectance)
        if (
            not equals
            or min(left, top) < 0
            or min(width, height) < 1
            or left + width > shape[1]
            or top + height > shape[0]
        ):
            raise ValueError
    except ValueError:
        raise ValueError(
            f'--target: "{text}" is no card in pictures of {shape[1]}×{shape[0]}; write '
            "LEFT,TOP,WIDTH,HEIGHT=REFLECTANCE, like 40,60,80,80=0.9"
        ) from None
    pixels = np.zeros(shape, bool)
    pixels[top : top + height, left : left + width] = True
    return Target(pixels, share)


def _filmed(source: Path, out: Path, film: str, start: float, azimuth: float, clockwise: bool) -> ReflectanceField:
    """The field of a film, whose frames are unpacked beside the store."""
    import numpy as np

    from relume.lightstage.reading import folder_of, read_stage
    from relume.lightstage.spinning import SpinningStage, SteadyTurning
    from relume.lightstage.spinning_film import frame_paths, stage_of_frames, unpack_video

    try:
        rings, columns, frames = (float(word) for word in film.split(","))
        if rings < 1 or columns < 1 or frames <= 0 or rings % 1 or columns % 1:
            raise ValueError
    except ValueError:
        raise ValueError(f'--film: "{film}" is no course; write RINGS,COLUMNS,FRAMES, like 32,64,72') from None
    course = SpinningStage(
        SteadyTurning(1 / frames, start), int(rings), float(np.pi / (2 * rings)), float(np.pi / rings),
        float(np.radians(azimuth)), clockwise,
    )  # fmt: skip
    if source.is_dir():
        paths = frame_paths(source)
        return folder_of(stage_of_frames(paths, course, int(columns)), source / "stage.json", kept=0)
    folder = out.with_name(out.stem + "_frames")
    unpack_video(source, folder, course, int(columns))
    return read_stage(folder, kept=0)

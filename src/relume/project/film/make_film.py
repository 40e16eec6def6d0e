"""`make_film`: a film file's frames rendered, developed with one exposure and joined to a movie.

Frames are kept as radiance, so that a film is developed anew without rendering anything again.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relume.cluster.records import key_of, record, recorded
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.image.resizing import resized
from relume.project.developing.develop_files import DevelopSettings
from relume.project.developing.sequence import develop_sequence
from relume.project.film.film_file import FilmFile, read_film
from relume.project.scene_file.frame_plan import FramePlan, frame_plan, require_own_frames
from relume.project.scene_file.metering import metered_scene
from relume.project.scene_file.pictures import Sessions, join_frames, make_frames
from relume.project.scene_file.renders import Pictures, Report, require_shown
from relume.project.scene_file.settings import RendererName, renderer_name
from relume.renderers.progressive.graceful_shutdown import HardStop
from relume.virtual_camera.tone.metered import FixedExposure

if TYPE_CHECKING:
    from distributed import Client

    from relume.cluster.connection import Cluster

FRAMES, DEVELOPED, SHEET = "frames", "developed", "sheet.png"
"""What the folder of a film holds beside its movie."""
UNSETTLED = 1e9
"""Seconds that an adaptation takes to a new light: what it is at the film's first frame holds to the end."""
_WIDE, _GAP, _PAGE = 320, 8, 28


@dataclass(frozen=True)
class FilmMade:
    """What `make_film` made, or of a dry run would make.

    folder : of everything
    movie, sheet : the film and its contact sheet; None where some frames alone were asked for, and for no sheet
    frames, kept : how many were asked for, and how many of them an earlier run had rendered
    renderer, size : of the frames; pixels
    rate : frames a second
    """

    folder: Path
    movie: Path | None
    sheet: Path | None
    frames: int
    kept: int
    renderer: RendererName
    size: tuple[int, int]
    rate: float


def make_film(
    film: str | Path, out: str | Path | None = None, *, frames: str | None = None, light: str | Path | None = None,
    size: tuple[int, int] | None = None, samples: int | None = None, threads: int | None = None,
    dry_run: bool = False, report: Report = lambda name, share: None, restart: bool = False,
    force: Callable[[int, str], None] | None = None,
    cluster: str | os.PathLike[str] | Client | Cluster | None = None,
) -> FilmMade:  # fmt: skip
    """Make the film of a film file: frames/*.exr, developed/*.png, the movie and sheet.png.

    film : the file, .toml
    out : folder, in place of the file's own
    frames : these of the sequence alone, as "1-9x2,12", rendered and not developed
    light : an environment map in place of the file's
    size, samples, threads : of the frames, in place of the file's; all cores unless given
    dry_run : check everything and make nothing
    report : called with the name of each step and the share of it that is done, 0 to 1
    restart : discard the saved state of an interrupted frame
    force : as in `insert`
    cluster : workers that render and develop the frames, as `run_tasks` takes them; None makes all here
    What is there, made from the same, is kept; several processes may render parts of a film into one folder. Raises
    InvalidScene, UnsupportedScene, OutputNotWritten, Interrupted, Incomplete, ValueError.
    """
    read = read_film(film, light, size)
    folder = read.folder / read.output.folder if out is None else Path(out)
    settings = replace(read.settings, frames=frames, threads=threads)
    if samples is not None:
        settings = replace(settings, samples=samples)
    # Refuse what cannot be before any work.
    plan = frame_plan(read.scene, folder / FRAMES, settings)
    assert plan is not None  # read_film requires a sequence
    name = renderer_name(read.scene, settings, moving=True)
    require_shown(read.scene, name, plan)
    require_own_frames(folder / FRAMES, plan, ".exr")
    camera = read.scene.camera
    whole = frames is None
    made = FilmMade(
        folder, folder / read.output.movie if whole else None, folder / SHEET if whole and read.output.sheet else None,
        len(plan.numbers), 0, name, (camera.width, camera.height), plan.rate,
    )  # fmt: skip
    if dry_run:
        return made
    # The frames.
    exposure = metered_scene(read.scene.scene)
    sessions = Sessions(exposure, restart, True, force and HardStop(force))
    kept = make_frames(
        folder / FRAMES, Pictures(read.scene, settings, plan, name), ".exr", exposure, read.scene.scene.light.unit,
        cluster=cluster, report=report, sessions=sessions,
    )  # fmt: skip
    if whole:
        _develop(read, plan, folder, exposure.exposure, report, cluster)
        _joined(read, plan, folder)
    return replace(made, kept=kept)


def _develop(read: FilmFile, plan: FramePlan, folder: Path, exposure: float, report: Report, cluster: object) -> None:
    """Develop the frames, all with the adaptation of the first; with plain exposure the scene's own light meter's."""
    preset, camera = read.preset, read.scene.camera
    if not preset.has_tone:
        preset = replace(preset, camera=replace(preset.camera, tone=FixedExposure(exposure)))
    field_of_view = 2 * math.atan(camera.width / 2 / camera.focal_length)
    settings = DevelopSettings(preset, field_of_view, frames_per_second=plan.rate, settling=UNSETTLED)
    sources = [folder / FRAMES / f"frame_{number:04d}.exr" for number in plan.numbers]
    develop_sequence(sources, folder / DEVELOPED, settings, cluster=cluster, progress=report)  # pyright: ignore[reportArgumentType]


def _joined(read: FilmFile, plan: FramePlan, folder: Path) -> None:
    """The movie of the developed frames and their contact sheet, unless they are there already."""
    developed = [folder / DEVELOPED / f"frame_{number:04d}.png" for number in plan.numbers]
    movie, sheet = folder / read.output.movie, folder / SHEET
    key = key_of(developed, plan.rate)
    if recorded(movie, key) is None:
        join_frames(movie, folder / DEVELOPED, plan)
        record(movie, key, [])
    if read.output.sheet:
        count = min(read.output.sheet, len(developed))
        chosen = [developed[index * len(developed) // count] for index in range(count)]
        files.write(sheet, contact_sheet(chosen))


def contact_sheet(pictures: Sequence[Path], columns: int = 4) -> Photograph:
    """Pictures of one size side by side, smaller, row after row."""
    small = []
    for path in pictures:
        photograph = files.read_photograph(path)
        width, height = photograph.size
        wide = min(_WIDE, width)
        small.append(_smaller(photograph, wide, max(1, round(height * wide / width))))
    high, wide = small[0].shape[:2]
    columns = min(columns, len(small))
    rows = -(-len(small) // columns)
    page = np.full((rows * (high + _GAP) + _GAP, columns * (wide + _GAP) + _GAP, 3), _PAGE, np.uint8)
    for index, picture in enumerate(small):
        y, x = _GAP + index // columns * (high + _GAP), _GAP + index % columns * (wide + _GAP)
        page[y : y + high, x : x + wide] = picture
    return Photograph(page, "contact sheet")


def _smaller(photograph: Photograph, width: int, height: int) -> np.ndarray:
    """Its pixels (H, W, 3) uint8 at another size, averaged in linear light."""
    from relume.image.colour import decode_srgb, encode_srgb

    linear = decode_srgb(photograph.pixels.astype(np.float32) / np.iinfo(photograph.pixels.dtype).max)
    radiance = resized(RadianceMap(np.asarray(linear, np.float32)), width, height).radiance
    return np.round(255 * encode_srgb(np.clip(radiance, 0, 1))).astype(np.uint8)

"""A sequence of relit pictures from a stage to its files: what `relume stage relight --frames` calls."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from relume.image.files.atomic import made_folder
from relume.lightstage.blocks import Cluster, spread
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.relighting.relight import prepared, relight_sequence
from relume.lightstage.relighting.relight_in_bands import pictures_in_bands
from relume.lightstage.relighting.relight_settings import RelightSettings
from relume.lightstage.relighting.relighting import Progress, within
from relume.lightstage.relighting.relit_bands import Frames
from relume.lightstage.relighting.relit_files import film_for, write_frame, write_frames
from relume.lightstage.relighting.specular_spikes import share_below, warn_below
from relume.lightstage.relighting.stage_lighting import StageLighting
from relume.sphere.environment_map import EnvironmentMap
from relume.virtual_camera.film.film import Film


def relight_frames(
    stage: ReflectanceField | str | os.PathLike[str],
    lights: Sequence[StageLighting | EnvironmentMap],
    out: str | os.PathLike[str],
    settings: RelightSettings = RelightSettings(),
    *,
    stops: float = 0.0,
    cluster: Cluster = None,
    progress: Progress | None = None,
) -> int:
    """The subject under each light in turn (`relight_sequence`), as an .mp4 or a folder of frames (`write_frames`).

    stage, settings : as of `relight`
    lights : one a frame
    out : the .mp4, or the folder
    stops : by which developed pictures are brighter than the first frame's film makes them
    cluster : whose workers sum bands of rows and then write the frames, each its own; this process for None
    progress : called with the share of the work that is done, 0 to 1
    Returns how many frames there are. Raises as `relight_sequence`, Incomplete that names what failed, and
    OutputNotWritten.
    """
    if cluster is None or Path(out).suffix.lower() == ".mp4" or settings.compression is not None:
        pictures = relight_sequence(stage, lights, settings, cluster=cluster, progress=progress)
        return write_frames(out, pictures, stops)
    field, several, unit = prepared(stage, lights, fitted=not settings.nearest)
    folder = made_folder(Path(out)).absolute()
    first, last = within(progress, slice(0, 3), 4), within(progress, slice(3, 4), 4)
    with pictures_in_bands(field, several, settings, cluster, first) as frames:
        film = film_for(frames.frame(0), stops)
        tasks = [_Frame(frames, number, folder, film, unit) for number in range(frames.count)]
        names = [f"frame {number + 1}" for number in range(frames.count)]
        below = spread(_write, tasks, names, cluster, last, paths=[folder])
    if not settings.nearest:
        warn_below(max(below))
    return frames.count


@dataclass(frozen=True, eq=False)
class _Frame:
    """A frame to be put together from its bands and written."""

    frames: Frames
    number: int
    folder: Path
    film: Film
    unit: str


def _write(frame: _Frame) -> float:
    """Write a frame and return the share of its pixels that are below 0."""
    picture = replace(frame.frames.frame(frame.number), unit=frame.unit)
    write_frame(frame.folder, frame.number + 1, picture, frame.film)
    return share_below(picture.radiance)

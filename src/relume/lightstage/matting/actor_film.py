"""An actor's film before another place, from files: what `relume stage actor` calls."""

from __future__ import annotations

import os
from collections.abc import Iterable
from itertools import chain, islice, repeat
from pathlib import Path

import numpy as np

from relume.image.radiance import RadianceMap
from relume.lightstage.acquire.rotating_arm import frame_paths
from relume.lightstage.matting.actor_matte import (
    DIFFERENCES,
    MatteLevels,
    composite_actor_frames,
    difference_matte,
    infrared_matte,
)
from relume.lightstage.matting.composite import read_backdrop
from relume.lightstage.relighting.relit_files import write_frames

Place = str | os.PathLike[str]


def composite_actor_film(
    frames: Place,
    empty: Place,
    backdrop: Place,
    out: Place,
    *,
    infrared: tuple[Place, Place] | None = None,
    levels: MatteLevels | None = None,
    stops: float = 0.0,
) -> int:
    """Write an actor's frames before another backdrop, as an .mp4 or a folder of frames, and return their number.

    frames : the folder of the actor's frames, radiance maps or photographs
    empty, backdrop : a picture for all, or a folder of one a frame, as `composite_actor` takes them
    out : the .mp4, or the folder of frames
    infrared : the folder of infrared frames, and the infrared picture (or folder) of the empty stage; a matte of
        differences unless given
    levels : of the matte; those of `infrared_matte` and `difference_matte` unless given
    stops : as of `write_frames`
    Raises ValueError, before anything is written, for folders of another number of frames and first pictures of
    another size; UnreadableFile, OutputNotWritten.
    """
    paths = list(frame_paths(frames))
    names = [Path(each) for each in (empty, backdrop, *(infrared or ()))]
    for folder in names:
        if folder.is_dir() and (count := len(frame_paths(folder))) != len(paths):
            raise ValueError(f"{folder}: {count} pictures for the {len(paths)} frames in {frames}; give one a frame")
    _require_one_size(Path(frames), names)
    if infrared is None:
        pairs = zip(map(read_backdrop, paths), _pictures(names[0]), strict=False)
        mattes = (difference_matte(frame, alone, levels or DIFFERENCES) for frame, alone in pairs)
    else:
        seen = zip(_pictures(names[2]), _pictures(names[3]), strict=False)
        mattes = (
            infrared_matte(frame.mean(axis=-1), alone.mean(axis=-1), levels=levels or MatteLevels())
            for frame, alone in seen
        )
    made = composite_actor_frames(
        map(read_backdrop, paths),
        (matte for matte, _ in zip(mattes, paths, strict=False)),
        (picture for picture, _ in zip(_pictures(names[0]), paths, strict=False)),
        (picture for picture, _ in zip(_pictures(names[1]), paths, strict=False)),
    )
    # The first frame is made before its folder, so that what is refused leaves none.
    first = list(islice(made, 1))
    return write_frames(out, (RadianceMap(picture) for picture in chain(first, made)), stops)


def _require_one_size(frames: Path, others: Iterable[Path]) -> None:
    """Refuse folders and pictures whose first is of another size than the first frame."""
    rows, columns = next(iter(_pictures(frames))).shape[:2]
    for place in others:
        height, width = next(iter(_pictures(place))).shape[:2]
        if (height, width) != (rows, columns):
            raise ValueError(
                f"{place}: {width}×{height} pixels, but the frames in {frames} have {columns}×{rows}; give one size"
            )


def _pictures(place: Path) -> Iterable[np.ndarray]:
    """Linear pictures of a folder, in the order of their names, or one picture again and again."""
    return map(read_backdrop, frame_paths(place)) if place.is_dir() else repeat(read_backdrop(place))

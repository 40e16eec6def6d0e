"""The shortest useful shot file, written: plate, ball, one length, objects.

The ball was photographed by the plate's camera from the plate's place, on the table where the objects shall stand. What
is not given is guessed, and stands in the file with a comment, so that it can be changed there.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from glob import escape
from pathlib import Path

import numpy as np

from relume.errors import OutputNotWritten, UnreadableFile, warn
from relume.image import files
from relume.probe.ball.view_files import find_ball_photographs
from relume.scene.shapes.meshes import read_meshes

GUESSED_RADIUS = 0.05
"""Metres, where no radius is given: between balls of bearings and garden globes."""
SMALLEST, LARGEST = 0.4, 16.0
"""Times the ball's radius: an object of which the longest side is beyond is not in metres, or stands on no table."""
RESIZED = 4.0
"""Times the ball's radius: the longest side that such an object gets, two balls."""
GAP = 0.4
"""Of their mean width, between objects that stand side by side."""


def new_shot_text(
    folder: Path,
    plate: Sequence[Path],
    balls: Sequence[Path],
    objects: Sequence[Path],
    radius: float | None,
    foot: tuple[float, float] | None = None,
    rim: tuple[float, float, float] | None = None,
) -> str:
    """The shot file as text.

    folder : where it will stand; names in it are relative to that
    plate : its photographs, or one radiance map
    balls : photographs of the ball; every folder is a view, the others together make one more
    objects : meshes; they stand side by side where the ball stood, the middle of the row in its place
    radius : of the ball, metres; guessed unless given, with a warning
    foot : where a stand under the ball meets the table, x and y in pixels of the plate; None for a ball on the table
    rim : where the plate shows the ball, or would: x, y and radius in pixels; found unless given
    Raises UnreadableFile, and ValueError for what is not given.
    """
    for name, paths in (("plate", plate), ("ball", balls), ("object", objects)):
        if not paths:
            raise ValueError(f"no {name} was given; a shot needs plate, ball and object")
    if radius is not None and not 0 < radius < np.inf:
        raise ValueError(f"radius is {radius}; give the ball's in metres, like 0.05")
    if radius is None:
        warn(
            f"the ball's radius was not given, and {GUESSED_RADIUS} m are taken: an object in metres comes out too "
            "large or too small by as much as that is wrong, light and perspective stay; give radius, metres",
            effect=0.05,
        )
    return _text(folder, plate, balls, objects, radius, foot, rim)


def write_new_shot(path: Path, text: str, force: bool) -> None:
    """Write it, its folder made; raises OutputNotWritten for a file that says something else, unless forced."""
    if path.exists() and not force:
        if path.is_file() and path.read_text(encoding="utf-8", errors="replace") == text:
            return
        raise OutputNotWritten(
            f"{path} is there and says something else; give it alone (relume insert {path} …) to use it, or force "
            "to replace it"
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"{path.parent}: cannot be made ({error.strerror}); choose another -o") from None
    files.write_text(path, text)


def _text(
    folder: Path, plate: Sequence[Path], balls: Sequence[Path], objects: Sequence[Path], radius: float | None,
    foot: tuple[float, float] | None, rim: tuple[float, float, float] | None,
) -> str:  # fmt: skip
    views = find_ball_photographs(balls)
    known = GUESSED_RADIUS if radius is None else radius
    measured = "by caliper or tape" if radius is not None else "a guess: measure the ball across and give half of that"
    # One bracket a line, so that a person finds it.
    lines = [
        "# Written by `relume insert`; every key is in docs/shot-file.md. Camera and frame are found from the ball.",
        f"plate.photographs = {_names(folder, plate)}",
        "light.balls = [",
        *(f"  {{ photographs = {_names(folder, view.paths)} }}," for view in views),
        "]",
        f"light.ball.radius = {known:g}  # metres, {measured}",
    ]
    lines.append("render = { samples = 64, denoise = true }")
    if rim is not None:
        shown = ", ".join(f"{value:g}" for value in rim)
        lines.append(f"camera.ball.rim = [{shown}]  # x, y, radius: where the plate would show the ball, pixels")
    if foot is not None:
        lines.append(f"camera.ball.foot = [{foot[0]:g}, {foot[1]:g}]  # where the ball's stand meets the table, pixels")
    sizes = [_size(path, known) for path in objects]
    middles = _side_by_side([width for width, *_ in sizes])
    for path, (_, extent, own), x in zip(objects, sizes, middles, strict=True):
        lines += ["", "[[objects]]", f"mesh = {_names(folder, [path], patterns=False)[1:-1]}"]
        if own != extent:
            lines.append(f"size = {extent:.3g}  # metres of its longest side; the file has {own:.3g}")
        if len(objects) > 1:
            lines.append(f"stand = [{x:.3g}, 0]  # metres to the right of the ball's place, and towards the camera")
    return "\n".join(lines) + "\n"


def _names(folder: Path, paths: Sequence[Path], *, patterns: bool = True) -> str:
    """Paths as TOML, relative to the folder; what would be a pattern is escaped where patterns are read."""
    names = []
    for path in paths:
        if path.is_dir():
            raise UnreadableFile(f"{path}: a folder; give the files in it, like {path.as_posix()}/*")
        if not path.is_file():
            raise UnreadableFile(f"{path}: no such file; check the path")
        try:
            name = os.path.relpath(path.resolve(), folder.resolve())
        except ValueError:  # another drive
            name = str(path.resolve())
        name = Path(name).as_posix()
        names.append(escape(name) if patterns and any(c in name for c in "*?[") else name)
    # TOML's basic strings escape as JSON's do.
    return json.dumps(names, ensure_ascii=False).replace("\x7f", "\\u007f")


def _size(path: Path, radius: float) -> tuple[float, float, float]:
    """How wide the object will be, how long its longest side, and how long that is in its file; metres."""
    points = np.concatenate([mesh.vertices for mesh in read_meshes(path)])
    extents = np.ptp(points, axis=0)
    own = float(extents.max())
    extent = own if SMALLEST * radius <= own <= LARGEST * radius or own == 0 else float(f"{RESIZED * radius:.3g}")
    return float(extents[0]) * (extent / own if own else 1.0), extent, own


def _side_by_side(widths: Sequence[float]) -> list[float]:
    """The middles of things in a row, about 0."""
    gap = GAP * float(np.mean(widths))
    starts = np.concatenate([[0.0], np.cumsum(np.array(widths) + gap)])
    return [float(start + width / 2 - (starts[-1] - gap) / 2) for start, width in zip(starts, widths, strict=False)]

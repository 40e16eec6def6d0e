"""The shortest useful shot file, written: plate, ball, one length, objects.

The ball was photographed by the plate's camera from the plate's place, on the table where the objects shall stand. What
is not given is guessed, and stands in the file with a comment, so that it can be changed there.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from glob import escape
from itertools import islice
from pathlib import Path

import numpy as np

from relume.capture.exposure.named_times import seconds_in_names, times_in_names
from relume.errors import NotABracket, OutputNotWritten, UnreadableFile, warn
from relume.image import files
from relume.image.files.atomic import relative_name
from relume.project.shot_file.ball_table import GUESSED_PLACE, GUESSED_SIZE
from relume.scene.shapes.meshes import read_meshes

NEW_RENDER = {"samples": 64, "denoise": True}
"""[render] of a new shot, here and in the studio: minutes on two cores, and what noise is left is taken out."""
GUESSED_RADIUS = 0.05
"""Metres, where no radius is given: between balls of bearings and garden globes."""
NAMED = 6
"""The most photographs of which a refusal gives the order."""
LARGEST_RADIUS = 0.5
"""Metres: nobody carries a larger mirrored ball, and a radius in centimetres is above it."""
PLACE_GUESSED = 0.2
"""What a guessed place of the objects does: they are seen from a wrong height, and their light is turned."""
SMALLEST, LARGEST = 0.4, 16.0
"""Times the ball's radius: an object of which the longest side is beyond is not in metres, or stands on no table."""
RESIZED = 4.0
"""Times the ball's radius: the longest side that such an object gets, two balls."""
GAP = 0.4
"""Of their mean width, between objects that stand side by side."""


@dataclass(frozen=True)
class NewShot:
    """What a new shot is made of.

    plate : its photographs, or one radiance map
    balls : photographs of the ball; every folder is a view, the others together make one more. With `light` one
        photograph at most, from the plate's place, that shows where the camera stood
    objects : meshes; they stand side by side where the ball stood, the middle of the row in its place
    radius : of the ball, metres; guessed unless given, with a warning
    foot : where a stand under the ball meets the table, x and y in pixels of the plate; None for a ball on the table
    rim : where the plate shows the ball, or would: x, y and radius in pixels; found unless given
    light : a finished map, in place of the light that the ball shows
    times : seconds of the ball's photographs in order, or of the plate's and then the ball's
    times_from_names : read them from the names instead
    surface_reflectance : of what the objects stand on, which says how bright a light of unknown scale is
    """

    plate: Sequence[Path]
    balls: Sequence[Path]
    objects: Sequence[Path]
    radius: float | None = None
    foot: tuple[float, float] | None = None
    rim: tuple[float, float, float] | None = None
    light: Path | None = None
    times: Sequence[float] | None = None
    times_from_names: bool = False
    surface_reflectance: float | None = None

    def text(self, folder: Path) -> str:
        """The shot file.

        folder : where it will stand; names in it are relative to that
        Raises UnreadableFile, NotABracket, and ValueError for what is not given.
        """
        needed = {"plate": self.plate, "ball": self.balls or self.light, "object": self.objects}
        for name, given in needed.items():
            if not given:
                or_light = " (or a finished map as light)" if name == "ball" else ""
                instead = "; without a photograph of the place `relume render` shows objects in a light alone"
                instead = instead if name == "plate" else ""
                raise ValueError(f"no {name} was given{or_light}; a shot needs plate, ball and object{instead}")
        if self.radius is not None and not 0 < self.radius < np.inf:
            raise ValueError(f"radius is {self.radius}; give the ball's in metres, like 0.05")
        if self.light is not None and (self.times is not None or self.times_from_names):
            raise ValueError("times are of a ball's bracket, and the light is a finished map; leave them out")
        _warn_of_radius(self.radius)
        measured = "by caliper or tape" if self.radius is not None else "a guess: measure the ball and give half of it"
        known = GUESSED_RADIUS if self.radius is None else self.radius
        lines = [
            "# Written by `relume insert`; every key is in docs/reference/shot-file.md. The ball gives the camera.",
            *(self._map(folder, known, measured) if self.light is not None else self._balls(folder, known, measured)),
            f"render = {{ {', '.join(f'{key} = {json.dumps(value)}' for key, value in NEW_RENDER.items())} }}",
        ]
        if self.surface_reflectance is not None:
            lines.append(f"light.surface_reflectance = {self.surface_reflectance:g}  # of what the objects stand on")
        if self.foot is not None:
            foot = f"[{self.foot[0]:g}, {self.foot[1]:g}]"
            lines.append(f"camera.ball.foot = {foot}  # where the ball's stand meets the table, pixels")
        return "\n".join([*lines, *_objects(folder, self.objects, known)]) + "\n"

    def _balls(self, folder: Path, radius: float, measured: str) -> list[str]:
        """Plate and light by the ball's photographs."""
        from relume.probe.ball.view_files import find_ball_photographs  # compiled loops; reading a shot needs none

        views = find_ball_photographs(self.balls)
        plate, seconds = self._seconds([view.paths for view in views])
        # One bracket a line, so that a person finds it.
        lines = [f"plate.photographs = {_names(folder, self.plate)}"]
        lines += [f"plate.times = {plate}"] if plate else []
        lines.append("light.balls = [")
        for view, own in zip(views, seconds, strict=True):
            times = f", times = {own}" if own else ""
            lines.append(f"  {{ photographs = {_names(folder, view.paths)}{times} }},")
        lines += ["]", f"light.ball.radius = {radius:g}  # metres, {measured}"]
        if self.rim is not None:
            rim = f"[{', '.join(f'{value:g}' for value in self.rim)}]"
            lines.append(f"camera.ball.rim = {rim}  # x, y, radius: where the plate would show the ball, pixels")
        return lines

    def _map(self, folder: Path, radius: float, measured: str) -> list[str]:
        """Plate and light by a finished map, and the camera by one photograph of the ball or its rim."""
        assert self.light is not None
        lines = [
            f"plate.photographs = {_names(folder, self.plate)}",
            f"light.map = {_names(folder, [self.light], patterns=False)[1:-1]}  # light.heading turns it about +Y",
            f"camera.ball.radius = {radius:g}  # metres, {measured}",
        ]
        if len(self.balls) > 1:
            raise ValueError(
                f"{len(self.balls)} photographs of the ball beside a finished map, which is the light; one of them "
                "says where the camera stood: give one, or leave the map out"
            )
        if self.balls and self.rim is None:
            return [*lines, f"camera.ball.photograph = {_names(folder, self.balls, patterns=False)[1:-1]}"]
        rim, source = self.rim, "where the plate would show the ball, pixels"
        if rim is None:
            width, height = files.read_facts(self.plate[0]).size
            rim = (GUESSED_PLACE[0] * width, GUESSED_PLACE[1] * height, GUESSED_SIZE * width)
            source = "a guess, pixels of the plate"
            warn(
                f"no ball says where the objects shall stand; x,y,radius {rim[0]:.0f},{rim[1]:.0f},{rim[2]:.0f} are "
                f"taken, as if the plate showed a ball of {radius:g} m there: give the rim that it would have in the "
                "plate (--rim X,Y,RADIUS)",
                effect=PLACE_GUESSED,
            )
        return [*lines, f"camera.ball.rim = [{', '.join(f'{value:g}' for value in rim)}]  # x, y, radius: {source}"]

    def _seconds(self, views: Sequence[Sequence[Path]]) -> tuple[list[float], list[list[float]]]:
        """Exposure times of the plate and of each view, as they are given; empty where they are the EXIF's."""
        if self.times_from_names:
            if self.times is not None:
                raise ValueError("times are given and are to be read from the names too; choose one of the two")
            # The name of one photograph alone may hold no time, as plate.jpg; a bracket's all have to.
            one = len(self.plate) == 1 and times_in_names([self.plate[0].name]) is None
            plate = [] if one else list(seconds_in_names(self.plate))
            return plate, [list(seconds_in_names(view)) for view in views]
        if self.times is None:
            return [], [[] for _ in views]
        of_balls = sum(len(view) for view in views)
        if len(self.times) not in (of_balls, of_balls + len(self.plate)):
            names = [
                f"{path.parent.name}/{path.name}" if len(views) > 1 else path.name for view in views for path in view
            ]
            order = ", ".join(names[:NAMED])
            order += ", …" if of_balls > NAMED else ""
            raise NotABracket(
                f"{len(self.times)} times were given for {of_balls} photographs of the ball and {len(self.plate)} of "
                f"the plate; give one for each of the ball's, in this order: {order}; or the plate's first and then "
                "these"
            )
        rest = iter(self.times)
        plate = list(islice(rest, len(self.times) - of_balls))
        return plate, [list(islice(rest, len(view))) for view in views]


def write_new_shot(path: Path, text: str, force: bool) -> None:
    """Write it, its folder made; raises OutputNotWritten for a file that says something else, unless forced."""
    if path.exists() and not force:
        if path.is_file() and path.read_text(encoding="utf-8", errors="replace") == text:
            return
        raise OutputNotWritten(
            f"{path} is there and says something else; give it alone (relume insert {path} …) to use it, or force "
            "(--force) to replace it"
        )
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"{path.parent}: cannot be made ({error.strerror}); choose another -o") from None
    files.write_text(path, text)


def _warn_of_radius(radius: float | None) -> None:
    if radius is None:
        # Without a ball the radius is that of the rim, drawn or guessed.
        warn(
            f"the ball's radius was not given, and {GUESSED_RADIUS} m are taken: an object in metres comes out too "
            "large or too small by as much as that is wrong, light and perspective stay; give radius, in metres "
            "(--radius)",
            effect=0.05,
        )
    elif radius > LARGEST_RADIUS:
        warn(
            f"the ball's radius is {radius:g} m, more than a metre across; is it in centimetres? 5 cm are 0.05 "
            "(--radius)",
            effect=0.05,
        )


def _objects(folder: Path, objects: Sequence[Path], radius: float) -> list[str]:
    """The objects' tables: side by side, each of a size for a table."""
    lines: list[str] = []
    sizes = [_size(path, radius) for path in objects]
    middles = _side_by_side([width for width, *_ in sizes])
    for path, (_, extent, own), x in zip(objects, sizes, middles, strict=True):
        lines += ["", "[[objects]]", f"mesh = {_names(folder, [path], patterns=False)[1:-1]}"]
        if own != extent:
            lines.append(f"size = {extent:.3g}  # metres of its longest side; the file has {own:.3g}")
            if radius <= LARGEST_RADIUS:  # else the radius is doubted
                warn(
                    f"{path.name}: its longest side is {own:.3g} m in the file, which would not stand beside the ball, "
                    f"and {extent:.3g} m are taken; give size, in metres, in the shot file",
                    effect=0.05,
                )
        if len(objects) > 1:
            lines.append(f"stand = [{x:.3g}, 0]  # metres to the right of the ball's place, and towards the camera")
    return lines


def _names(folder: Path, paths: Sequence[Path], *, patterns: bool = True) -> str:
    """Paths as TOML, relative to the folder; what would be a pattern is escaped where patterns are read."""
    names = []
    for path in paths:
        if path.is_dir():
            raise UnreadableFile(f"{path}: a folder; give the files in it, like {path.as_posix()}/*")
        if not path.is_file():
            raise UnreadableFile(f"{path}: no such file; check the path")
        name = relative_name(path.resolve(), folder.resolve())
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

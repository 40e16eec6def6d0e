"""The shot at one frame of its sequence: a plain shot, as if the shot file described that frame alone."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from relume.errors import InvalidShot, UnreadableFile, warn
from relume.image.files.atomic import relative_name
from relume.image.files.video import is_video, read_video
from relume.project.keyed_values import BETWEEN, motion_of, placement_at, table_at, values_at
from relume.project.shot_file.added_lights import AddedLight
from relume.project.shot_file.camera_file import CameraFile
from relume.project.shot_file.sequence_table import SequenceTable
from relume.project.shot_file.shot import Shot
from relume.scene.cameras.files import motion_span, require_frames
from relume.scene.motion.keyframes import Interpolation

SAME_RATE = 1e-3
"""Share by which two rates may differ: that of 24000/1001 and 24 is left out of the warning."""


def frames_of(shot: Shot) -> list[int]:
    """The frames of the shot's sequence; raises InvalidShot where it has none, or a frame has no plate."""
    table = _sequence(shot)
    if table.plates is None and shot.camera.keyframes:
        raise InvalidShot(
            "camera.keyframes: the plate is one photograph, in which the camera stood still; give a plate for each "
            "frame in sequence.plates, or move the objects"
        )
    _require_camera(shot, table)
    if shot.camera.keyframes and shot.camera.pose is None:
        raise InvalidShot("camera.keyframes: the camera comes from elsewhere; give camera.pose to move it from")
    if (maps := shot.light.sequence_of_maps(shot.folder, table.rate)) is not None:
        maps.checked()
    if table.plates is not None:
        _require_plates(shot, table, _plates(shot, table.plates))
    return list(table.frames)


def at_frame(shot: Shot, frame: float) -> Shot:
    """The same as `at_moment`, but for maps of light that change: their mean while the frame's shutter is open.

    Raises InvalidShot where the keys give a value there that no shot file may have.
    """
    return _at(shot, frame, True)


def moves(shot: Shot) -> bool:
    """Whether keys or files move anything in the shot's sequence; maps of light may change beside."""
    keyed = (shot.camera, shot.light, *shot.light.added, *shot.objects)
    return (
        any(each.keyframes for each in keyed)
        or any(motion_of(shot.folder / each.mesh) is not None for each in shot.objects)
        or _span_of_camera(shot) is not None
    )


def at_moment(shot: Shot, frame: float) -> Shot:
    """The shot at a frame, or between two: without keys or a sequence, its files' motion stopped there.

    Raises InvalidShot where the keys give a value there that no shot file may have.
    """
    return _at(shot, frame, False)


def _at(shot: Shot, frame: float, exposed: bool) -> Shot:
    """The shot there; `exposed` asks for the mean light of the time that the shutter is open."""
    table = _sequence(shot)
    between = BETWEEN[table.interpolation]
    # Motion in a file begins with the sequence.
    seconds = (frame - table.frames[0]) / table.rate
    objects = []
    for index, each in enumerate(shot.objects):
        changes = placement_at(each.keyframes, frame, between)
        if each.stand is None and "translate" in changes:
            # What keys move has a place of its own, also at the frame in which they put it at the origin.
            changes["stand"] = False
        if motion_of(shot.folder / each.mesh) is not None:
            changes["time"] = seconds
        objects.append(table_at(each, changes, f"objects.{index}", frame, InvalidShot))
    camera = values_at(shot.camera.keyframes, frame, between, ("position", "look_at", "focal_length"))
    pose = {name: camera.pop(name) for name in ("position", "look_at") if name in camera}
    if pose and shot.camera.pose is not None:
        camera["pose"] = shot.camera.pose.model_dump() | pose
    moving = shot.camera.file if table.plates is not None else None
    if moving is not None:
        camera["file"] = moving.at(frame, table.frames[0], table.rate).model_dump()
    light = values_at(shot.light.keyframes, frame, between, ("turn", "exposure"))
    if shot.light.added:
        light["added"] = [_added_at(each, index, frame, between) for index, each in enumerate(shot.light.added)]
    opened, closed = (each / table.rate for each in table.shutter or (0.0, 0.0))
    light |= shot.light.at_second(seconds, shot.folder, table.rate, (opened, closed) if exposed else (0.0, 0.0))
    changes = {
        "objects": objects,
        "camera": table_at(shot.camera, camera, "camera", frame, InvalidShot),
        "light": table_at(shot.light, light, "light", frame, InvalidShot),
        "sequence": None,
    }
    if table.plates is not None:
        # Between two frames, and while the shutter is open beyond the last, the plate is that of the nearest.
        plates = _plates(shot, table.plates)
        number = min(plates, key=lambda number: abs(number - frame - table.offset))
        name = relative_name(plates[number], shot.folder)
        of_video = number if is_video(plates[number]) else None
        changes["plate"] = shot.plate.model_copy(update={"photographs": [name], "frame": of_video})
        # Every frame of a film has grain of its own, and so have the objects in it.
        changes["match"] = shot.match.model_copy(update={"seed": seed_of_frame(shot.match.seed, number)})
    return shot.model_copy(update=changes)


def _added_at(table: AddedLight, index: int, frame: float, between: Interpolation) -> AddedLight:
    changes = values_at(table.keyframes, frame, between, ("direction", "irradiance", "size"))
    return table_at(table, changes, f"light.added.{index}", frame, InvalidShot)


def seed_of_frame(seed: int, frame: int) -> int:
    """The seed of what is drawn anew in each frame."""
    return int(np.random.SeedSequence([seed, frame]).generate_state(1)[0])


def _sequence(shot: Shot) -> SequenceTable:
    if shot.sequence is None:
        raise InvalidShot('sequence: missing; give the frames to make, as [sequence] frames = "1-120"')
    return shot.sequence


def _require_plates(shot: Shot, table: SequenceTable, plates: Mapping[int, Path]) -> None:
    """Raises InvalidShot where a frame has no plate; warns of a video of another rate than the sequence's."""
    path = next(iter(plates.values()))
    missing = [frame for frame in table.frames if frame + table.offset not in plates]
    if missing and is_video(path):
        raise InvalidShot(
            f"sequence.plates: {path.name} has {len(plates)} frames, and frame {missing[0]} would be its "
            f"{missing[0] + table.offset}; give fewer frames, or another sequence.offset"
        )
    if missing:
        others = f", nor of {len(missing) - 1} others" if len(missing) > 1 else ""
        with_offset = f", sequence.offset {table.offset} added" if table.offset else ""
        raise InvalidShot(
            f"sequence.plates: no picture has the number of frame {missing[0]}{with_offset}{others}; the last number "
            "in a name is its frame's"
        )
    if is_video(path) and abs(float(read_video(path).rate) / table.rate - 1) > SAME_RATE:
        warn(
            f"sequence.rate is {table.rate:g} and {path.name} has {float(read_video(path).rate):.5g} frames a second; "
            "what moves by seconds goes by sequence.rate: give the video's, unless that is meant"
        )


def _span_of_camera(shot: Shot) -> tuple[float, float] | None:
    """When the file that moves the camera from plate to plate begins and ends; None where none does."""
    asked = shot.camera.file
    if asked is None or shot.sequence is None or shot.sequence.plates is None:
        return None
    if asked.numbered and asked.name is not None:
        return None
    return motion_span(shot.path(asked.path), asked.name)


def _require_camera(shot: Shot, table: SequenceTable) -> None:
    """Raises InvalidShot where the camera's file does not say where the camera was in all frames."""
    asked, span = shot.camera.file, _span_of_camera(shot)
    if asked is None or span is None:
        return
    path = shot.path(asked.path)
    first, last = (asked.at(frame, table.frames[0], table.rate) for frame in (table.frames[0], table.frames[-1]))
    if asked.numbered:
        if not span[0] <= (first.frame or 0) <= (last.frame or 0) <= span[1]:
            raise InvalidShot(
                f"camera.file: {path.name} has the frames {span[0]:g} to {span[1]:g}, and the sequence asks for "
                f"{first.frame:g} to {last.frame:g} of it; give camera.file.offset, or other frames"
            )
        _require_moments(shot, table, asked, path)
        return
    own, half = asked.rate or table.rate, 0.5
    if ((first.time or 0) - span[0]) * own < -half or ((last.time or 0) - span[1]) * own > half:
        raise InvalidShot(
            f"camera.file: {path.name} moves for {(span[1] - span[0]) * own + 1:.4g} frames, and the sequence has "
            f"{table.frames[-1] - table.frames[0] + 1}; give as many, or camera.file.offset and rate"
        )


def _require_moments(shot: Shot, table: SequenceTable, asked: CameraFile, path: Path) -> None:
    """Raises InvalidShot where a frame's shutter or its rows ask for a moment at which the file has no camera."""
    opened, closed = table.shutter or (0.0, 0.0)
    read, moments = abs(shot.camera.readout or 0.0) / 2, list[float]()
    for frame in table.frames:
        ends = ((frame + share, sign * read) for share, sign in ((opened, -1), (closed, 1)))
        low, high = (asked.at(moment, table.frames[0], table.rate).shifted(late).frame or 0.0 for moment, late in ends)
        # No camera that was not found lies between two moments that are half a frame apart.
        moments += np.linspace(low, high, 2 * int(np.ceil(high - low)) + 1).tolist()
    try:
        require_frames(path, moments)
    except UnreadableFile as error:
        raise InvalidShot(
            f"camera.file: {error} (a frame asks from its shutter and first row to its last); leave such frames out"
        ) from None


def _plates(shot: Shot, patterns: Sequence[str]) -> dict[int, Path]:
    plates: dict[int, Path] = {}
    paths = shot.files(patterns)
    if any(is_video(path) for path in paths):
        if len(paths) > 1:
            raise InvalidShot(f"sequence.plates: {paths[0].name} and {len(paths) - 1} more; give one video alone")
        return dict.fromkeys(range(1, read_video(paths[0]).frames + 1), paths[0])
    for path in paths:
        numbers = re.findall(r"\d+", path.stem)
        if not numbers:
            raise InvalidShot(
                f"sequence.plates: {path.name} has no number; name each after its frame, as plate_0001.exr"
            )
        if int(numbers[-1]) in plates:
            raise InvalidShot(
                f"sequence.plates: {plates[int(numbers[-1])].name} and {path.name} are both frame {int(numbers[-1])}; "
                "keep one"
            )
        plates[int(numbers[-1])] = path
    if not plates:
        raise UnreadableFile(f"{shot.folder}: no plates; check sequence.plates")
    return plates

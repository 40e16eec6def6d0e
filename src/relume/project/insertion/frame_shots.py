"""The shot at one frame of its sequence: a plain shot, as if the shot file described that frame alone."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from relume.errors import InvalidShot, UnreadableFile
from relume.project.keyed_values import BETWEEN, motion_of, placement_at, table_at, values_at
from relume.project.shot_file.added_lights import AddedLight
from relume.project.shot_file.sequence_table import SequenceTable
from relume.project.shot_file.shot import Shot
from relume.scene.motion.keyframes import Interpolation


def frames_of(shot: Shot) -> list[int]:
    """The frames of the shot's sequence; raises InvalidShot where it has none, or a frame has no plate."""
    table = _sequence(shot)
    if table.plates is None and shot.camera.keyframes:
        raise InvalidShot(
            "camera.keyframes: the plate is one photograph, in which the camera stood still; give a plate for each "
            "frame in sequence.plates, or move the objects"
        )
    if shot.camera.keyframes and shot.camera.pose is None:
        raise InvalidShot("camera.keyframes: the camera comes from elsewhere; give camera.pose to move it from")
    if (maps := shot.light.sequence_of_maps(shot.folder, table.rate)) is not None:
        maps.checked()
    if table.plates is not None:
        plates = _plates(shot, table.plates)
        if missing := [frame for frame in table.frames if frame not in plates]:
            others = f", nor of {len(missing) - 1} others" if len(missing) > 1 else ""
            raise InvalidShot(
                f"sequence.plates: no picture has the number of frame {missing[0]}{others}; the last number in a name "
                "is its frame's"
            )
    return list(table.frames)


def at_frame(shot: Shot, frame: float) -> Shot:
    """The same as `at_moment`, but for maps of light that change: their mean while the frame's shutter is open.

    Raises InvalidShot where the keys give a value there that no shot file may have.
    """
    return _at(shot, frame, True)


def moves(shot: Shot) -> bool:
    """Whether keys or files move anything in the shot's sequence; maps of light may change beside."""
    keyed = (shot.camera, shot.light, *shot.objects)
    return any(each.keyframes for each in keyed) or any(
        motion_of(shot.folder / each.mesh) is not None for each in shot.objects
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
        plate = plates[min(plates, key=lambda number: abs(number - frame))]
        changes["plate"] = shot.plate.model_copy(update={"photographs": [str(plate.relative_to(shot.folder))]})
    return shot.model_copy(update=changes)


def _added_at(table: AddedLight, index: int, frame: float, between: Interpolation) -> AddedLight:
    changes = values_at(table.keyframes, frame, between, ("direction", "irradiance", "size"))
    return table_at(table, changes, f"light.added.{index}", frame, InvalidShot)


def _sequence(shot: Shot) -> SequenceTable:
    if shot.sequence is None:
        raise InvalidShot('sequence: missing; give the frames to make, as [sequence] frames = "1-120"')
    return shot.sequence


def _plates(shot: Shot, patterns: Sequence[str]) -> dict[int, Path]:
    plates: dict[int, Path] = {}
    for path in shot.files(patterns):
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

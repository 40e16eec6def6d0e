"""A moving camera as Nuke and most trackers write it: a .chan file, one line of numbers a frame."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.pose import UpAxis, pose
from relume.scene.motion.keyframes import Linear, Slerp, Track

COLUMNS = "frame, x, y, z, then degrees about x, y and z, and the vertical field of view in degrees"
BEYOND = 1.0
"""Frames before the first line and after the last in which the motion goes straight on: a shutter reaches so far."""


@dataclass(frozen=True, eq=False)
class ChanFile:
    """The lines of a .chan file, in order.

    frames : (N,) numbers; places : (N, 3) units; turns : (N, 3) degrees about x, y, z
    fields : (N,) degrees from the lowest to the highest row; None where the file has no such column
    """

    path: Path
    frames: np.ndarray
    places: np.ndarray
    turns: np.ndarray
    fields: np.ndarray | None

    def require(self, frame: float) -> None:
        """Raises UnreadableFile for a frame further from the lines than a shutter reaches."""
        if not self.frames[0] - BEYOND <= frame <= self.frames[-1] + BEYOND:
            raise UnreadableFile(f"{self.path}: holds the frames {_span(self)}, and frame {frame:g} was asked for")


def read_chan(path: Path) -> ChanFile:
    """Read a .chan file, but for empty lines and # comments; raises UnreadableFile naming the line that is wrong."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise UnreadableFile(f"{path}: cannot be read as text ({error}); export it again as .chan") from None
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        words = line.partition("#")[0].split()
        if not words:
            continue
        try:
            values = [float(word) for word in words]
        except ValueError:
            raise UnreadableFile(f"{path}: line {number} is no row of numbers; a line is {COLUMNS}") from None
        if len(values) not in (7, 8) or (rows and len(values) != len(rows[0])):
            raise UnreadableFile(f"{path}: line {number} has {len(values)} columns; a line has 7 or 8: {COLUMNS}")
        if not np.isfinite(values).all() or (len(values) == 8 and not 0 < values[7] < 180):
            raise UnreadableFile(f"{path}: line {number} is no camera ({line.strip()[:60]}); a line is {COLUMNS}")
        if rows and values[0] <= rows[-1][0]:
            raise UnreadableFile(f"{path}: line {number}: frame {values[0]:g} comes after {rows[-1][0]:g}; sort them")
        rows.append(values)
    if not rows:
        raise UnreadableFile(f"{path}: holds no frames; a line is {COLUMNS}")
    table = np.array(rows)
    return ChanFile(path, table[:, 0], table[:, 1:4], table[:, 4:7], table[:, 7] if table.shape[1] == 8 else None)


def holds_focal_length(path: Path) -> bool:
    """Whether the lines of a .chan file say the field of view; raises UnreadableFile."""
    return read_chan(path).fields is not None


def read_chan_camera(
    path: Path, width: int, height: int, up: UpAxis | None, unit: float | None, frame: float | None,
    focal_length: float | None,
) -> Camera:  # fmt: skip
    """The camera of a .chan file at a frame.

    up : "y" unless given, as Nuke has it; unit : metres to a unit, 1 unless given
    frame : by the file's own numbers; not needed where it has one line. Between two lines the camera turns the shorter
        way and all else goes in straight lines; before the first and after the last it goes on so for a frame
    focal_length : pixels, where the file has no field of view
    Rotations are in Nuke's order ZXY: about z first, then x, then y. Raises UnreadableFile.
    """
    from scipy.spatial.transform import Rotation

    chan = read_chan(path)
    if frame is None:
        if len(chan.frames) > 1:
            raise UnreadableFile(f"{path}: holds the frames {_span(chan)}; give the frame")
        frame = float(chan.frames[0])
    chan.require(frame)
    if (chan.fields is None) == (focal_length is None):
        has = "no field of view" if chan.fields is None else "the field of view in its last column"
        raise UnreadableFile(f"{path}: has {has}; {'give' if chan.fields is None else 'leave out'} the focal length")
    quaternions = Rotation.from_euler("zxy", chan.turns[:, [2, 0, 1]], degrees=True).as_quat()
    matrix = np.eye(4)
    matrix[:3, 3] = _reached(chan.frames, chan.places, frame)
    matrix[:3, :3] = Rotation.from_quat(_turn(chan.frames, quaternions, frame)).as_matrix()
    position, rotation = pose(path, matrix, up or "y", unit or 1.0)
    if chan.fields is not None:
        field = Track(chan.frames, chan.fields).at(frame)
        focal_length = float(height / 2 / np.tan(np.radians(field) / 2))
    assert focal_length is not None  # one of the two is there
    return Camera(width, height, focal_length, position, rotation)


def _span(chan: ChanFile) -> str:
    return f"{chan.frames[0]:g} to {chan.frames[-1]:g}"


def _reached(times: np.ndarray, values: np.ndarray, time: float) -> np.ndarray:
    """Between two lines, and straight on beyond the ends."""
    index = _interval(times, time)
    return values[0] if index is None else Linear().between(times, values, index, time)


def _turn(times: np.ndarray, quaternions: np.ndarray, time: float) -> np.ndarray:
    index = _interval(times, time)
    if index is None:
        return quaternions[0]
    if times[index] <= time <= times[index + 1]:
        return Slerp().between(times, quaternions, index, time)
    from scipy.spatial.transform import Rotation

    first, second = Rotation.from_quat(quaternions[index]), Rotation.from_quat(quaternions[index + 1])
    share = (time - times[index]) / (times[index + 1] - times[index])
    return (Rotation.from_rotvec(share * (second * first.inv()).as_rotvec()) * first).as_quat()


def _interval(times: np.ndarray, time: float) -> int | None:
    """Which two lines count for a time; None where there is one line only."""
    if len(times) < 2:
        return None
    return int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2))

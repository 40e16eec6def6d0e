"""A sensor that is read row after row, while its camera goes on moving: the pose of each row."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True, eq=False)
class RollingShutter:
    """How a camera moves from the time of its first row to that of its last; its own pose is that of the middle row.

    moves : (2, 3) metres, world: at share s of the readout, −½ at the first row and ½ at the last, the camera is at
        position + s · moves[0] + s² · moves[1]
    turns : (2, 3) radians, world: there it is turned by the rotation vector s · turns[0] + s² · turns[1]
    middle : the row of the camera's own pose, pixels from the upper edge of the picture
    rows : from the first to the last, pixels; negative where the last row is the upper one
    Raises ValueError for what is not finite, no rows, or a turn of more than a right angle.
    """

    moves: np.ndarray
    turns: np.ndarray
    middle: float
    rows: float

    def __post_init__(self) -> None:
        given = np.stack([self.moves, self.turns])
        if given.shape != (2, 2, 3) or not np.isfinite(given).all() or not np.isfinite([self.middle, self.rows]).all():
            raise ValueError(f"a rolling shutter of moves {self.moves} and turns {self.turns}; expected (2, 3) numbers")
        if self.rows == 0 or np.linalg.norm(self.turns, axis=1).max() > np.pi / 2:
            turn = np.degrees(np.linalg.norm(self.turns[0]))
            raise ValueError(
                f"a rolling shutter of {self.rows:g} rows that turns by {turn:.0f}°; "
                "expected rows, and less than a right angle between the first and the last"
            )

    def shares(self, rows: np.ndarray) -> np.ndarray:
        """The share of the readout at rows, pixels from the upper edge; at most that of a height beyond it."""
        return np.clip((rows - self.middle) / self.rows, -1.5, 1.5)

    def moved(self, shares: np.ndarray) -> np.ndarray:
        """(…, 3) metres, world, from the camera's own place."""
        s = np.asarray(shares)[..., None]
        return s * self.moves[0] + s * s * self.moves[1]

    def turned(self, directions: np.ndarray, shares: np.ndarray, back: bool = False) -> np.ndarray:
        """Directions (…, 3), world, turned as the camera is at these shares (…); or back (Rodrigues)."""
        s = np.asarray(shares)[..., None]
        vector = s * self.turns[0] + s * s * self.turns[1]
        angle = np.linalg.norm(vector, axis=-1, keepdims=True)
        axis = vector / np.maximum(angle, 1e-300)
        angle = -angle if back else angle
        along = np.sum(axis * directions, axis=-1, keepdims=True) * axis
        return along + (directions - along) * np.cos(angle) + np.cross(axis, directions) * np.sin(angle)

    def carried(self, turn: np.ndarray) -> RollingShutter:
        """That of the camera turned with the world by a rotation (3, 3)."""
        return replace(self, moves=self.moves @ turn.T, turns=self.turns @ turn.T)

    def window(self, top: float) -> RollingShutter:
        """That of the part of the picture that begins at this row."""
        return replace(self, middle=self.middle - top)

    def scaled(self, scale: float, height: float, wanted: float) -> RollingShutter:
        """That of a picture `wanted` rows high, of one `height` rows high scaled about its middle."""
        return replace(self, middle=wanted / 2 + (self.middle - height / 2) * scale, rows=self.rows * scale)


def rolling_through(
    places: tuple[np.ndarray, np.ndarray, np.ndarray], rotations: tuple[np.ndarray, np.ndarray, np.ndarray],
    height: int, upwards: bool = False,
) -> RollingShutter:  # fmt: skip
    """The shutter of a picture `height` rows high, through the poses at its first, middle and last row.

    places : (3,) each, metres; rotations : (3, 3) each, world-from-camera
    upwards : whether the first row is the lowest
    Where the motion begins or ends with the middle row, that of the other half counts for both.
    """
    from scipy.spatial.transform import Rotation

    before, after = places[0] - places[1], places[2] - places[1]
    turn_before, turn_after = (Rotation.from_matrix(rotations[k] @ rotations[1].T).as_rotvec() for k in (0, 2))
    if not before.any() and not turn_before.any():
        before, turn_before = -after, -turn_after
    elif not after.any() and not turn_after.any():
        after, turn_after = -before, -turn_before
    moves = np.stack([after - before, 2 * (after + before)])
    turns = np.stack([turn_after - turn_before, 2 * (turn_after + turn_before)])
    return RollingShutter(moves, turns, height / 2, -float(height) if upwards else float(height))

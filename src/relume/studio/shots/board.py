"""The chequered board in a photograph, looked at while its squares are being typed."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import relume as rl
from relume.studio.shots.cameras import camera_facts


def board_camera(path: Path, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The camera that sees the board so, for JSON; the board's own surface is the ground.

    asked : squares, the long side first, and the side of one in metres; focal_length in pixels, the EXIF's unless given
    Raises GridNotFound, UnreadableFile, ValueError.
    """
    squares, square, focal_length = asked.get("squares"), asked.get("square"), asked.get("focal_length")
    if (
        not isinstance(squares, list)
        or len(squares) != 2
        or not all(isinstance(n, int) and 3 <= n < 100 for n in squares)
    ):
        raise ValueError("squares are two whole numbers from 3 on, the long side first")
    if not isinstance(square, int | float) or square <= 0:
        raise ValueError("square is the side of one in metres, like 0.03")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        photograph = rl.read_photograph(path)
        found = rl.camera_from_grid(
            photograph, squares=(squares[0], squares[1]), square=float(square), focal_length=focal_length
        )
    return camera_facts(found)

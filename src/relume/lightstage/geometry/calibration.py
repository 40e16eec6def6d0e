"""A projector and a camera calibrated together, from photographs of a chequered board under the projector's patterns.

The camera sees the board's corners; where the projector would see them is decoded about each corner and carried to it
by the homography that a small piece of a plane gives (Moreno & Taubin 2012). Both are then calibrated as cameras are
(Zhang 2000, by OpenCV), and their places to each other by all boards at once.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from relume.errors import GridNotFound, UnreadableFile
from relume.lightstage.geometry.decoding import DecodingSettings, decoded_places
from relume.lightstage.geometry.pattern_photographs import PatternPhotographs, read_pattern_photographs
from relume.lightstage.geometry.patterns import ProjectorPatterns
from relume.lightstage.geometry.rig import ScannerRig
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.grid import inner_corners

FEWEST = 3
"""Boards, each at another slant: two leave the focal length and the principal point open."""
ENOUGH = 20
"""Decoded pixels about a corner: four make a homography, and noise wants some more."""
SEEN = 0.5
"""Of a board's corners, how many the projector must reach."""
_FLIP = np.diag([1.0, -1.0, -1.0])
"""OpenCV's cameras look along +Z with y down; ours look along −Z with y up."""


def calibrate_rig(
    boards: str | os.PathLike[str] | Sequence[str | os.PathLike[str] | PatternPhotographs],
    *,
    squares: tuple[int, int],
    square: float,
) -> ScannerRig:
    """The camera and the projector that photographs of a board under the patterns were made with.

    boards : folders of photographs, or what was read of them, or the one folder that these folders lie in; the same
        board at three slants or more, better at ten
    squares : (along the long side, along the short side)
    square : side of a square, metres
    The rig's frame is the camera's: it stands at the origin and looks along −Z. Both lenses have one focal length, a
    principal point of their own and k1; the camera's principal point is the picture's middle, the projector's is
    not, since projectors throw upward. A subject's distance is known as well as the focal lengths are, and the rig says
    how well: to some tenths of a percent from seven boards at 20° in pictures of 400 pixels, to a tenth of that from
    ten boards at 40°, near and far, in pictures of 2000. The shape itself is known much better.
    Raises UnreadableFile for a folder that holds no folders. Raises ValueError for too few boards or squares, and for
    photographs of unlike sizes or patterns. Raises GridNotFound where a board is not seen or lies in the projector's
    shade.
    Source: Moreno & Taubin 2012, "Simple, accurate, and robust projector-camera calibration".
    """
    import cv2

    if isinstance(boards, str | os.PathLike):
        boards = _folders(Path(boards))
    if len(boards) < FEWEST:
        raise ValueError(f"a calibration needs {FEWEST} boards, each at another slant, better ten; {len(boards)} given")
    if min(squares) < 3 or not 0 < square < np.inf:
        raise ValueError(f"a board of {squares[0]}×{squares[1]} squares of {square} m; give 3 each way, above 0 m")
    # What the camera and the projector see of every board.
    names = [f"board {i + 1}" if isinstance(b, PatternPhotographs) else str(Path(b)) for i, b in enumerate(boards)]
    world, seen, shown, kinds = [], [], [], []
    for name, board in zip(names, boards, strict=True):
        photographs = board if isinstance(board, PatternPhotographs) else read_pattern_photographs(board)
        kinds.append((photographs.light.shape, photographs.patterns))
        if kinds[-1] != kinds[0]:
            raise ValueError(f"{name}: photographs of {_kind(*kinds[-1])}, but {names[0]} of {_kind(*kinds[0])}; all "
                             "boards are one camera's and one projector's")  # fmt: skip
        corners, pixels = _board(photographs, squares, name)
        reached = np.isfinite(pixels[:, 0])
        world.append(_plane(squares, square)[reached])
        seen.append(corners[reached])
        shown.append(pixels[reached])
    height, width = photographs.light.shape
    sizes = (width, height), (photographs.patterns.width, photographs.patterns.height)
    # Each by itself, then both together.
    flags = cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
    points = [np.ascontiguousarray(each, np.float32) for each in world]
    lenses, known = [], []
    for places, size, middle in zip((seen, shown), sizes, (cv2.CALIB_FIX_PRINCIPAL_POINT, 0), strict=True):
        places = [np.ascontiguousarray(each - 0.5, np.float32) for each in places]
        guess = np.array([[size[0], 0, size[0] / 2 - 0.5], [0, size[0], size[1] / 2 - 0.5], [0, 0, 1]], np.float64)
        start = flags | middle | cv2.CALIB_USE_INTRINSIC_GUESS
        _, matrix, lens, _, _, spread, *_ = cv2.calibrateCameraExtended(
            points, places, size, guess, np.zeros(5), flags=start
        )
        lenses.append((places, matrix, lens))
        # The height's focal length is the one that is free.
        known.append(float(spread[1, 0] / matrix[1, 1]))
    (first, matrix, lens), (second, throw, beam) = lenses
    found = cv2.stereoCalibrateExtended(
        points, first, second, matrix, lens, throw, beam, sizes[0], np.eye(3), np.zeros((3, 1)),
        flags=cv2.CALIB_FIX_INTRINSIC,
    )  # fmt: skip
    turn, shift, errors = found[5], found[6], found[-1]
    residual = np.sqrt((np.asarray(errors).reshape(-1, 2) ** 2).mean(axis=0))
    # OpenCV's frames to ours.
    rotation = _FLIP @ turn.T @ _FLIP
    position = _FLIP @ (-turn.T @ shift[:, 0])
    camera = _camera(sizes[0], matrix, lens, np.zeros(3), np.eye(3))
    projector = _camera(sizes[1], throw, beam, position, rotation)
    return ScannerRig(camera, projector, (float(residual[0]), float(residual[1])), (known[0], known[1]))


def _board(photographs: PatternPhotographs, squares: tuple[int, int], name: str) -> tuple[np.ndarray, np.ndarray]:
    """A board's inner corners (N, 2) in the camera's pixels, and in the projector's, NaN where it does not reach."""
    light = photographs.light
    top = max(float(np.quantile(light, 0.995)), 1e-30)
    grey = np.rint(255 * np.sqrt(np.clip(light / top, 0, 1))).astype(np.uint8)
    columns, rows = squares[0] - 1, squares[1] - 1
    found, corners = inner_corners(grey, columns, rows)
    if not found:
        raise GridNotFound(
            f"{name}: no board of {squares[0]}×{squares[1]} squares found; the whole board must be in the picture and "
            "in the projector's light, sharp, with a light margin round it"
        )
    corners = corners.astype(np.float64) + 0.5
    # Black squares answer weakly, but straight: what is believed there is decided by the noise alone.
    places = decoded_places(photographs, DecodingSettings(least_direct=0.1)).places
    lattice = corners.reshape(rows, columns, 2)
    steps = [np.linalg.norm(np.diff(lattice, axis=axis), axis=-1).min() for axis in (0, 1)]
    pixels = np.stack([_carried(corner, places, 0.6 * min(steps)) for corner in corners])
    reached = np.isfinite(pixels[:, 0]).mean()
    if reached < SEEN:
        raise GridNotFound(
            f"{name}: the projector's patterns are lost in shade, or too dark, at {1 - reached:.0%} of the board's "
            "corners; move the board into its light"
        )
    return corners, pixels


def _carried(corner: np.ndarray, places: np.ndarray, radius: float) -> np.ndarray:
    """A camera pixel (2,) carried to the projector by the homography about it; NaN where there is none."""
    import cv2

    height, width = places.shape[:2]
    low = np.maximum(np.floor(corner - radius), 0).astype(int)
    high = np.minimum(np.ceil(corner + radius), [width, height]).astype(int)
    there = places[low[1] : high[1], low[0] : high[0]]
    rows, columns = np.nonzero(np.isfinite(there[..., 0]))
    if len(rows) < ENOUGH:
        return np.full(2, np.nan)
    own = np.stack([columns + low[0] + 0.5, rows + low[1] + 0.5], axis=-1) - corner
    matrix, _ = cv2.findHomography(own, there[rows, columns], cv2.RANSAC, 1.0)
    if matrix is None:
        return np.full(2, np.nan)
    return matrix[:2, 2] / matrix[2, 2]


def _folders(place: Path) -> list[Path]:
    """The folders that lie in a folder, by name."""
    if not place.is_dir():
        raise UnreadableFile(f"{place}: no such folder; give the one with a folder of photographs for each board")
    if not (folders := sorted(path for path in place.iterdir() if path.is_dir())):
        raise UnreadableFile(f"{place}: no folders in it; make one for each slant of the board, with its photographs")
    return folders


def _kind(size: tuple[int, ...], patterns: ProjectorPatterns) -> str:
    """The size of a board's photographs, and its patterns, in words."""
    shown = f"{patterns.width}×{patterns.height}, period {patterns.period}, {patterns.steps} steps"
    return f"{size[1]}×{size[0]} pixels under patterns of {shown}"


def _plane(squares: tuple[int, int], square: float) -> np.ndarray:
    """The board's inner corners (N, 3) on the board, metres."""
    across, down = np.meshgrid(np.arange(squares[0] - 1), np.arange(squares[1] - 1))
    return np.stack([across.ravel(), down.ravel(), np.zeros(across.size)], axis=-1) * square


def _camera(
    size: tuple[int, int], matrix: np.ndarray, lens: np.ndarray, position: np.ndarray, rotation: np.ndarray
) -> Camera:
    k1 = float(lens.ravel()[0])
    centre = (float(matrix[0, 2]) + 0.5, float(matrix[1, 2]) + 0.5)
    return Camera(*size, float(matrix[0, 0]), position, rotation, centre, Distortion(k1))

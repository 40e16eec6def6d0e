"""The camera's pose from a photographed calibration grid (Debevec 1998, Fig. 8b)."""

from __future__ import annotations

import numpy as np

from relume.errors import GridNotFound
from relume.image.photograph import Photograph
from relume.scene.camera import Camera


def camera_from_grid(
    photograph: Photograph, *, squares: tuple[int, int], square: float, focal_length: float | None = None
) -> Camera:
    """Find a chequered board lying on the ground in a photograph and place the camera in its frame.

    squares : (along the long side, along the short side)
    square : side of a square, metres
    focal_length : pixels; from the photograph's EXIF unless given
    The frame's origin is the board's middle, +X to the right along its long side as the photograph shows it, +Z
    towards the camera and +Y up. Raises GridNotFound.
    """
    import cv2

    focal = focal_length or photograph.focal_length
    if focal is None:
        raise GridNotFound(f"{photograph.name}: no focal length in its EXIF; give camera.focal_length in pixels")
    columns, rows = squares[0] - 1, squares[1] - 1
    grey = (photograph.pixels.astype(np.float64).mean(2) * (255 / np.iinfo(photograph.pixels.dtype).max)).astype(
        np.uint8
    )
    found, corners = _corners(cv2, grey, columns, rows)
    if not found:
        raise GridNotFound(
            f"{photograph.name}: no grid of {squares[0]}×{squares[1]} squares found; the whole board must be in the "
            "photograph, sharp, with a light margin round it"
        )
    image = corners.reshape(rows, columns, 2).astype(np.float64)
    # Of the board's two readings take the one whose long side runs to the right of the photograph.
    if image[:, -1, 0].mean() < image[:, 0, 0].mean():
        image = image[::-1, ::-1]
    # Seen from above, +Z is a quarter turn clockwise from +X: it comes towards the camera.
    across, along = image[:, -1].mean(0) - image[:, 0].mean(0), image[-1].mean(0) - image[0].mean(0)
    if across[0] * along[1] < across[1] * along[0]:
        image = image[::-1]
    x = (np.arange(columns) - (columns - 1) / 2) * square
    z = (np.arange(rows) - (rows - 1) / 2) * square
    world = np.stack(np.broadcast_arrays(x[None, :], 0.0, z[:, None]), axis=-1).reshape(-1, 3)

    width, height = photograph.size
    # OpenCV puts pixel centres at whole numbers; ours are at ½.
    lens = np.array([[focal, 0, width / 2 - 0.5], [0, focal, height / 2 - 0.5], [0, 0, 1]])
    solved, turn, shift = cv2.solvePnP(world, image.reshape(-1, 2), lens, np.zeros(4), flags=cv2.SOLVEPNP_SQPNP)
    if not solved:
        raise GridNotFound(f"{photograph.name}: the grid's corners fit no camera; is `square` in metres?")
    turn, shift = cv2.solvePnPRefineLM(world, image.reshape(-1, 2), lens, np.zeros(4), turn, shift)
    camera_from_world, _ = cv2.Rodrigues(turn)
    # OpenCV's camera looks along +Z with y down.
    rotation = camera_from_world.T @ np.diag([1.0, -1.0, -1.0])
    return Camera(width, height, focal, (-camera_from_world.T @ shift).ravel(), rotation)


def _corners(cv2, grey: np.ndarray, columns: int, rows: int) -> tuple[bool, np.ndarray]:
    """Inner corners (columns·rows, 2), pixel centres at whole numbers; small boards are sought in an enlargement."""
    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    for scale in (1, 2, 4):
        picture = grey if scale == 1 else cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
        # Evening the histogram helps in dim light, but loses plain boards that are found without it.
        for evened in (0, cv2.CALIB_CB_NORMALIZE_IMAGE):
            found, corners = cv2.findChessboardCornersSB(picture, (columns, rows), flags=flags | evened)
            if found:
                break
        if found:
            corners = ((corners.reshape(-1, 1, 2) + 0.5) / scale - 0.5).astype(np.float32)
            # Saddle points of the photograph itself are steadier than those of an enlargement.
            spacing = np.linalg.norm(np.diff(corners.reshape(rows, columns, 2), axis=0), axis=-1).min()
            window = max(2, int(spacing / 4))
            stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-4)
            return True, cv2.cornerSubPix(grey, corners, (window, window), (-1, -1), stop).reshape(-1, 2)
        if max(picture.shape) > 4000:
            break
    return False, np.empty((0, 2))

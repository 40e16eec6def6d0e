"""The camera's pose, and with a warning its lens, from a photographed calibration grid (Debevec 1998, Fig. 8b)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.errors import GridNotFound, warn
from relume.image.bands import in_bands
from relume.image.photograph import Photograph
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.fit import CameraFit, Minimum, least_squares
from relume.sphere.directions import rotation_from_vector

CORNER_NOISE = 0.05
"""Pixels to which corners are found at best: a few hundredths in photographs computed through a known camera."""
ENOUGH = 1500
"""Pixels across in which a board that takes a tenth of the picture is found; its corners are then found in all."""
FOCAL_LENGTHS = np.geomspace(0.5, 8, 17)
"""In widths of the picture: where the search for an unknown focal length starts, from 18 mm to 290 mm on full frame."""
LARGEST_DEVIATION = 0.05
"""The largest relative standard deviation of a focal length from a grid; where it is larger, measure it instead."""
SIGNIFICANT = 3.0
"""Standard deviations by which k1 must differ from 0: by chance, 3 boards in 1000 do."""


def camera_from_grid(
    photograph: Photograph, *, squares: tuple[int, int], square: float, focal_length: float | None = None
) -> Camera:
    """Find a chequered board lying on the ground in a photograph and place the camera in its frame.

    photograph : in which the whole board is seen
    squares : how many across and along, the squares counted and not the corners
    square : the side of one, metres
    focal_length : pixels; that of the photograph's EXIF unless given
    The frame is the board's: +X to the right along its long side, +Y up, the origin in its middle. Raises GridNotFound.
    """
    return fit_grid(photograph, squares=squares, square=square, focal_length=focal_length).camera


def fit_grid(
    photograph: Photograph,
    *,
    squares: tuple[int, int],
    square: float,
    thickness: float = 0.0,
    focal_length: float | None = None,
    centre: tuple[float, float] | None = None,
    distortion: Distortion | None = None,
    estimate_focal_length: bool = False,
    estimate_k1: bool = False,
) -> CameraFit:
    """Find a chequered board lying on the ground and place the camera in its frame, with residuals in pixels.

    squares : (along the long side, along the short side)
    square : side of a square, metres
    thickness : of the board, metres: how far its printed surface lies above what it lies on
    focal_length : pixels; from the photograph's EXIF unless given
    centre : the principal point, pixels from the upper left corner; the picture's middle unless given
    distortion : of the lens, where it is known; the corners are seen through it
    estimate_focal_length : find it from the board; one flat board determines it only where it is seen at a slant
    estimate_k1 : find the first radial coefficient from the board; it is kept where it differs from 0 with certainty
    The frame's origin lies under the board's middle, on what the board lies on; +X to the right along its long side
    as the photograph shows it, +Z towards the camera and +Y up. A warning names what is estimated and its standard
    deviation, which is the Jacobian's for corners found to 0.05 pixels or as well as they fit, whichever is worse.
    Raises GridNotFound where there is no board or it does not determine what is to be estimated.
    """
    if focal_length is not None and estimate_focal_length:
        raise ValueError("both a focal_length and estimate_focal_length; give one of them")
    focal = focal_length or photograph.focal_length
    if focal is None and not estimate_focal_length:
        raise GridNotFound(f"{photograph.name}: no focal length in its EXIF; give camera.focal_length in pixels")
    return fit_corners(
        _oriented(photograph, squares),
        photograph.size,
        square=square,
        thickness=thickness,
        focal_length=None if estimate_focal_length else focal,
        centre=centre,
        distortion=distortion,
        estimate_k1=estimate_k1,
        name=photograph.name,
    )


def fit_corners(
    corners: np.ndarray,
    size: tuple[int, int],
    *,
    square: float,
    thickness: float = 0.0,
    focal_length: float | None,
    centre: tuple[float, float] | None = None,
    distortion: Distortion | None = None,
    estimate_k1: bool = False,
    name: str = "grid",
) -> CameraFit:
    """Place the camera in the frame of a board whose inner corners are known; `fit_grid` without the search.

    corners : (rows, columns, 2) pixels, x right and y down, rows along +Z and columns along +X
    size : (width, height) of the photograph, pixels
    focal_length : pixels; None where it is estimated from the board
    name : of the photograph, for warnings and errors; the rest as for `fit_grid`
    """
    if estimate_k1 and distortion is not None:
        raise ValueError("both a distortion and estimate_k1; give the distortion, or have its k1 estimated")
    rows, columns = corners.shape[:2]
    x = (np.arange(columns) - (columns - 1) / 2) * square
    z = (np.arange(rows) - (rows - 1) / 2) * square
    world = np.stack(np.broadcast_arrays(x[None, :], thickness, z[:, None]), axis=-1).reshape(-1, 3)
    seen = _Seen(name, world, corners.reshape(-1, 2).astype(np.float64))

    if focal_length is None:
        if distortion is not None:
            raise ValueError("a distortion without focal_length, to which its terms refer; give both")
        tries = [seen.placed(Camera(*size, f * size[0], np.zeros(3), np.eye(3), centre)) for f in FOCAL_LENGTHS]
        start = min(tries, key=lambda camera: float(np.sum(seen.errors(camera) ** 2)))
    else:
        start = seen.placed(Camera(*size, focal_length, np.zeros(3), np.eye(3), centre, distortion))
    free = focal_length is None
    found, minimum = seen.refined(start, free, False)
    if estimate_k1:
        found, minimum = _with_k1(seen, found, minimum, free)
    if free:
        _warn_of_focal_length(seen, found, minimum)
    return CameraFit(found, seen.pixels, seen.errors(found).reshape(-1, 2))


@dataclass(frozen=True, eq=False)
class _Seen:
    """Corners in the photograph `name`: world (N, 3), pixels (N, 2)."""

    name: str
    world: np.ndarray
    pixels: np.ndarray

    def errors(self, camera: Camera) -> np.ndarray:
        # A corner the camera does not see at all is farther off than any that it does.
        return np.nan_to_num(camera.project(self.world) - self.pixels, nan=1e6).ravel()

    def placed(self, lens: Camera) -> Camera:
        """The lens where the corners say it stood, to a fraction of a pixel."""
        import cv2

        straight = self.pixels
        if lens.distortion is not None:
            straight = lens.pinhole().project(lens.position + lens.rays_through(self.pixels))
        across, down = lens.principal_point
        matrix = np.array([[lens.focal_length, 0, across], [0, lens.focal_length, down], [0, 0, 1]])
        solved, turn, shift = cv2.solvePnP(self.world, straight, matrix, np.zeros(4), flags=cv2.SOLVEPNP_SQPNP)
        if not solved:
            raise GridNotFound(f"{self.name}: the grid's corners fit no camera; is `square` in metres?")
        camera_from_world, _ = cv2.Rodrigues(turn)
        # OpenCV's camera looks along +Z with y down.
        rotation = camera_from_world.T @ np.diag([1.0, -1.0, -1.0])
        return replace(lens, position=(-camera_from_world.T @ shift).ravel(), rotation=rotation)

    def refined(self, start: Camera, focal_length: bool, k1: bool) -> tuple[Camera, Minimum]:
        """The camera that fits best, and its unknowns: turn, move, then the logarithm of the focal length, then k1."""
        distance = float(np.linalg.norm(start.position))

        def camera_of(values: np.ndarray) -> Camera:
            more = iter(values[6:])
            focal = start.focal_length * float(np.exp(next(more))) if focal_length else start.focal_length
            distortion = Distortion(k1=float(next(more))) if k1 else start.distortion
            rotation = start.rotation @ rotation_from_vector(values[:3])
            # The search may pass through lenses that fold over within the picture; errors() punishes them.
            try:
                return replace(
                    start,
                    focal_length=focal,
                    position=start.position + distance * values[3:6],
                    rotation=rotation,
                    distortion=distortion,
                )
            except ValueError:
                return replace(start, position=start.position + 1e6 * distance)

        unknowns = np.zeros(6 + focal_length + k1)
        minimum = least_squares(lambda values: self.errors(camera_of(values)), unknowns, CORNER_NOISE)
        return camera_of(minimum.values), minimum


def _with_k1(seen: _Seen, start: Camera, without: Minimum, focal_length: bool) -> tuple[Camera, Minimum]:
    """The camera and its unknowns, with k1 where the board determines it, and a warning either way."""
    found, minimum = seen.refined(start, focal_length, True)
    k1, deviation = float(minimum.values[-1]), float(minimum.deviations[-1])
    if not abs(k1) >= SIGNIFICANT * deviation:
        warn(
            f"{seen.name}: the lens's k1 from one flat board is {k1:.3g} ± {deviation:.2g}, which is not "
            "significant: it is left out: give camera.distortion, or photograph a board that fills the picture"
        )
        return start, without
    across, down = found.principal_point
    corner = np.hypot(max(across, found.width - across), max(down, found.height - down)) / found.focal_length
    warn(
        f"{seen.name}: the lens's k1 from one flat board is {k1:.3g} ± {deviation:.2g}, "
        f"± {deviation * corner**3 * found.focal_length:.1f} pixels in the picture's corners; "
        "give camera.distortion where the lens has been calibrated"
    )
    return found, minimum


def _warn_of_focal_length(seen: _Seen, found: Camera, minimum: Minimum) -> None:
    share = float(minimum.deviations[6])
    if not share <= LARGEST_DEVIATION:
        spread = f"± {100 * share:.0f} %" if np.isfinite(share) else "or any other"
        raise GridNotFound(
            f"{seen.name}: the board does not determine the focal length ({found.focal_length:.0f} pixels, {spread}); "
            "give camera.focal_length, or photograph the board nearer and at a slant"
        )
    warn(
        f"{seen.name}: the focal length from one flat board is {found.focal_length:.1f} ± "
        f"{share * found.focal_length:.1f} pixels; give camera.focal_length where it is known"
    )


def _oriented(photograph: Photograph, squares: tuple[int, int]) -> np.ndarray:
    """The board's inner corners (rows, columns, 2) in pixels, as its frame counts them."""
    columns, rows = squares[0] - 1, squares[1] - 1
    height, width = photograph.pixels.shape[:2]
    grey = np.empty((height, width), np.uint8)

    def work(rows: slice) -> None:
        grey[rows] = photograph.pixels[rows].astype(np.float64).mean(2) * (255 / np.iinfo(photograph.pixels.dtype).max)

    in_bands(height, width, work)
    found, corners = inner_corners(grey, columns, rows)
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
    # OpenCV puts pixel centres at whole numbers; ours are at ½.
    return image + 0.5


def inner_corners(grey: np.ndarray, columns: int, rows: int) -> tuple[bool, np.ndarray]:
    """Whether a board is seen, and its inner corners (columns·rows, 2), pixel centres at whole numbers.

    Boards are sought in a large photograph made smaller first, where they take a tenth of the time, and small ones at
    last in an enlargement.
    """
    import cv2

    flags = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY
    for scale in (*([ENOUGH / max(grey.shape)] if max(grey.shape) > 2 * ENOUGH else []), 1, 2, 4):
        way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        picture = grey if scale == 1 else cv2.resize(grey, None, fx=scale, fy=scale, interpolation=way)
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

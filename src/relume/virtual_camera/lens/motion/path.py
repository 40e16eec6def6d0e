"""Motion blur along the paths that a moving camera gives to every pixel: homographies over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from relume.image.bands import in_threads
from relume.virtual_camera.lens.motion.shutter import Shutter
from relume.virtual_camera.protocols import Relative
from relume.virtual_camera.view import View

_BAND = 8
_CHORD = 0.02
"""Pixels by which straight ways between key times may miss a camera's arc: a fiftieth cannot be seen."""
_SHRINKING = 7.5e-6
"""Share of half the diagonal by which they may: chords lie inside their arc, and so shrink what turns with them. Over a
chord by ⅔ of this at most, so that areas, and light, are kept to 1e-5."""
_PROBES = 9
_MOST_KEYS = 4097
_AHEAD = 1e-3
"""The least third coordinate of a corner, that of the picture's middle being 1: at 0 it is in the camera's plane, at
infinity. A thousandth is a fraction of a degree before that."""
_TRIED = 181
"""Parts of a turn, a degree each at most, that are looked at for where a corner first goes behind."""


@dataclass(frozen=True, eq=False)
class HomographyPath(Relative):
    """The camera's picture moves by a homography that changes with time: hand shake, a zoom, a turn, a plane passed.

    matrices : (K, 3, 3), K ≥ 2; at each key time the pixel coordinates in the picture given from those on the sensor
        (as stabilisers give them, frame to reference); x right, y down, the first pixel's middle at (½, ½)
    times : (K,) from −½, when the shutter opens, to ½, when it has closed, rising; None for even ones
    shutter : how the light is shared out over that time

    Between key times a pixel goes straight and evenly. Along its path the bilinear interpolation of radiance is summed
    in steps of about half a pixel or less. Radiance stays the same along a ray, so its mean over time is what the
    sensor gathers: even light stays even. Where homographies change the size of things, what is kept of a source is the
    sum of radiance × solid angle, not that of pixel values: to 1e-4 for lights of a few pixels. A single point on a
    line that a turn leaves in place may differ by its change of scale there, for so bilinear weights do. Pixels are
    averaged over the time for which the picture shows what they saw (`coverage`); those that never saw it are black.
    Raises ValueError for matrices of another shape, not finite or singular, and for times that do not rise from −½ to
    ½. When applied, raises ValueError for a path on which a corner of the picture is not before the camera at a key
    time.
    """

    matrices: np.ndarray
    times: np.ndarray | None = None
    shutter: Shutter = field(default_factory=Shutter)

    def __post_init__(self) -> None:
        matrices = np.asarray(self.matrices)
        if matrices.ndim != 3 or matrices.shape[1:] != (3, 3) or len(matrices) < 2:
            raise ValueError(f"matrices are {matrices.shape}; expected (K, 3, 3) with at least 2 of them")
        if not np.all(np.isfinite(matrices)) or np.any(np.abs(np.linalg.det(matrices)) < 1e-12):
            raise ValueError("a matrix of the path is singular or not finite; expected homographies that can be undone")
        if self.times is not None:
            times = np.asarray(self.times)
            ends = times.shape == (len(matrices),) and np.allclose(times[[0, -1]], [-0.5, 0.5])
            if not ends or np.any(np.diff(times) <= 0):
                raise ValueError(f"times are {times}; expected {len(matrices)} that rise from -0.5 to 0.5")

    @classmethod
    def along(
        cls, matrix_at: Callable[[float], np.ndarray], keys: int, *, shutter: Shutter | None = None
    ) -> HomographyPath:
        """The path that a function of the time, −½ to ½, gives as a (3, 3) matrix, sampled at `keys` even times.

        matrix_at : (3, 3) at a time from −½ to ½
        shutter : how the light is shared out over that time
        """
        matrices = np.stack([np.asarray(matrix_at(float(time)), np.float64) for time in np.linspace(-0.5, 0.5, keys)])
        return cls(matrices, shutter=shutter or Shutter())

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 that the sensor gathers.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        return _along(self, radiance, np.empty((0, 0), np.float32))

    def coverage(self, shape: tuple[int, int], view: View) -> np.ndarray:
        """The share (H, W) float32 of a pixel's light that a picture of that shape (rows, columns) shows.

        view : the picture's view (`VirtualCamera.view`)
        """
        known = np.empty(shape, np.float32)
        _along(self, np.zeros((*shape, 3), np.float32), known)
        return known


@dataclass(frozen=True)
class TurningCamera(Relative):
    """The camera turns evenly about its lens' centre, as on a tripod (Debevec & Malik 1997, §3, Fig. 9c).

    yaw, pitch, roll : radians turned while the shutter is open, about the camera's up (+Y), right (+X) and backward
        (+Z) axes, anticlockwise seen from their tips: to the left, up, and the camera anticlockwise. All three are one
        turn about a fixed axis, the vector (pitch, yaw, roll)
    shutter : how the light is shared out over that time

    The picture given shows the middle of the exposure. Every pixel follows the arc that the view's focal length gives,
    about the picture's middle, to 0.02 pixels or better; for what is kept see HomographyPath, of which this is one.
    Raises ValueError for an angle that is not finite, and for a turn of more than half a circle. When applied, raises
    ValueError for a turn that takes a corner of the picture behind the camera, and names the largest that does not.
    """

    yaw: float
    pitch: float = 0.0
    roll: float = 0.0
    shutter: Shutter = field(default_factory=Shutter)

    def __post_init__(self) -> None:
        angle = np.linalg.norm([self.pitch, self.yaw, self.roll])
        if not angle <= np.pi:
            raise ValueError(f"the camera turns by {np.degrees(angle):g}°; expected at most 180° in one exposure")

    def path(self, shape: tuple[int, int], focal_length: float) -> HomographyPath:
        """The homographies of a picture of that shape (rows, columns), `focal_length` in pixels."""
        height, width = shape
        camera = np.array([[focal_length, 0, -width / 2], [0, -focal_length, -height / 2], [0, 0, -1]])
        inverse = np.linalg.inv(camera)
        turn = np.array([self.pitch, self.yaw, self.roll])
        _refuse_behind(turn, shape, focal_length)

        def matrix_at(time: float) -> np.ndarray:
            return camera @ _rotation(time * turn) @ inverse

        allowed = min(_CHORD, _SHRINKING * float(np.hypot(*shape)) / 2)
        keys = 2
        while keys < _MOST_KEYS and _chord_error(matrix_at, keys, shape) > allowed:
            keys = 2 * keys - 1
        return HomographyPath.along(matrix_at, keys, shutter=self.shutter)

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 that the sensor gathers.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        return self.path((radiance.shape[0], radiance.shape[1]), view.focal_length).apply(radiance, view)

    def coverage(self, shape: tuple[int, int], view: View) -> np.ndarray:
        """The share (H, W) float32 of a pixel's light that a picture of that shape (rows, columns) shows.

        view : the picture's view (`VirtualCamera.view`)
        """
        return self.path(shape, view.focal_length).coverage(shape, view)


def _along(path: HomographyPath, radiance: np.ndarray, known: np.ndarray) -> np.ndarray:
    from relume.virtual_camera.lens.motion.kernels import along_paths

    height, width = radiance.shape[:2]
    matrices = np.ascontiguousarray(path.matrices, np.float64)
    # A homography is one at any scale; the kernel takes what is before the camera to have a positive third coordinate.
    middle = matrices[:, 2] @ np.array([width / 2, height / 2, 1.0])
    matrices = matrices / np.where(middle == 0, 1.0, middle)[:, None, None]
    ahead = (matrices[:, 2] @ _corners(height, width)).min(1)
    if ahead.min() < _AHEAD:
        key = int(np.argmax(ahead < _AHEAD))
        raise ValueError(
            f"at key time {key + 1} of {len(matrices)} the path takes a corner of the {width}×{height} picture behind "
            "the camera; expected homographies that keep all corners before it for the whole exposure: shorten the path"
        )
    even = np.linspace(-0.5, 0.5, len(matrices))
    times = even if path.times is None else np.ascontiguousarray(path.times, np.float64)
    light = np.ascontiguousarray(radiance, np.float32).reshape(-1)
    shown = np.empty_like(light)
    opening = path.shutter.opening
    in_threads(
        lambda begin, end: along_paths(light, height, width, matrices, times, opening, shown, known, begin, end),
        height,
        chunk=_BAND,
    )
    return shown.reshape(height, width, 3)


def _corners(height: int, width: int) -> np.ndarray:
    """The corners of a picture as homogeneous pixel coordinates (3, 4)."""
    return np.array([[0.0, width, 0.0, width], [0.0, 0.0, height, height], [1.0, 1.0, 1.0, 1.0]])


def _refuse_behind(turn: np.ndarray, shape: tuple[int, int], focal_length: float) -> None:
    """Raise ValueError for a turn (3,) that takes a corner of the picture behind the camera."""
    height, width = shape
    x, y, _ = np.column_stack([_corners(height, width), [width / 2, height / 2, 1]])
    rays = np.stack([x - width / 2, height / 2 - y, np.full(5, -focal_length)])

    def stays(share: float) -> bool:
        # Either half of the exposure turns as far, the other way round.
        ahead = -np.stack([(_rotation(half * share * turn) @ rays)[2] for half in (-0.5, 0.5)])
        return bool(np.all(ahead > 0) and np.all(ahead[:, :4] > 1.01 * _AHEAD * ahead[:, 4:]))

    shares = np.linspace(0, 1, _TRIED)
    behind = next((i for i, share in enumerate(shares) if not stays(share)), None)
    if behind is None:
        return
    low, high = shares[max(behind - 1, 0)], shares[behind]
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (middle, high) if stays(middle) else (low, middle)
    angle = float(np.degrees(np.linalg.norm(turn)))
    most = np.floor(10 * low * angle) / 10
    across, down = (float(np.degrees(2 * np.arctan2(side / 2, focal_length))) for side in (width, height))
    raise ValueError(
        f"the camera turns by {angle:g}° and a picture of {across:.3g}° × {down:.3g}° then has a corner behind the "
        f"camera; expected all corners before it for the whole exposure: turn it by at most {most:g}°"
    )


def _rotation(turn: np.ndarray) -> np.ndarray:
    """The (3, 3) rotation by |turn| radians about `turn` (3,), anticlockwise (Rodrigues 1840)."""
    angle = float(np.linalg.norm(turn))
    if angle == 0:
        return np.eye(3)
    x, y, z = turn / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def _chord_error(matrix_at: Callable[[float], np.ndarray], keys: int, shape: tuple[int, int]) -> float:
    """How far from its arc, in place or in time, the straight ways between keys take a pixel, pixels.

    Only what passes the picture counts: what is beyond it is not known however it moves.
    """
    height, width = shape
    y, x = (side.ravel() for side in np.mgrid[0 : height : _PROBES * 1j, 0 : width : _PROBES * 1j])
    grid = np.stack([x, y, np.ones_like(x)])
    # Curvature changes slowly along an arc: its first, middle and last pieces stand for all.
    worst, step = 0.0, 1 / (keys - 1)
    for piece in {0, (keys - 1) // 2, keys - 2}:
        begin = piece * step - 0.5
        first, middle, last = (matrix_at(begin + share * step) @ grid for share in (0, 0.5, 1))
        ahead = (first[2] > 1e-6) & (middle[2] > 1e-6) & (last[2] > 1e-6)
        places = [points[:2] / np.where(ahead, points[2], 1) for points in (first, middle, last)]
        near = ahead & np.all(np.abs(places[1] - [[width / 2], [height / 2]]) < [[width], [height]], axis=0)
        if near.any():
            gap = (places[0] + places[2]) / 2 - places[1]
            worst = max(worst, float(np.hypot(*gap)[near].max()))
    return worst

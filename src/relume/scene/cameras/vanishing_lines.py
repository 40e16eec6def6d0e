"""The camera from lines drawn on a photograph along the world's axes (Caprile and Torre 1990; Guillou et al. 2000)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from relume.errors import warn
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.fit import CameraFit, Minimum, least_squares
from relume.scene.cameras.known_lengths import KnownLength
from relume.sphere.directions import normalised, rotation_from_vector

DRAWN = 0.5
"""Pixels to which a person draws a line's ends at best."""
LARGEST_DEVIATION = 0.1
"""The largest relative standard deviation of the focal length, and that of the principal point in picture widths."""
DOUBTFUL = 0.03
"""The share from which on the focal length is doubtful: a third of what is refused."""
LEVEL = 1e4
"""Pixels by which a horizon that leans by one radian counts as wrong: far more than any line, so that it is level."""
AXES = "xyz"


@dataclass(frozen=True, eq=False)
class AxisLines:
    """Segments (N, 2, 2) drawn along the world's axes, pixels from the upper left corner: [[x, y], [x, y]] each.

    x, z : along things that are level and at right angles to each other, such as a table's edges
    y : along things that stand upright
    level : whether the camera's horizon is level, which stands for a second set of lines

    Their direction does not matter. Two sets are enough, or one where the camera is level or another has one line.
    """

    x: ArrayLike = field(default_factory=lambda: np.empty((0, 2, 2)))
    y: ArrayLike = field(default_factory=lambda: np.empty((0, 2, 2)))
    z: ArrayLike = field(default_factory=lambda: np.empty((0, 2, 2)))
    level: bool = False

    def __post_init__(self) -> None:
        for axis, segments in zip(AXES, self.segments(), strict=True):
            if segments.ndim != 3 or segments.shape[1:] != (2, 2) or not np.isfinite(segments).all():
                raise ValueError(f"lines.{axis} are {segments.shape}; expected (N, 2, 2), two finite points a line")
            short = np.flatnonzero(np.linalg.norm(segments[:, 1] - segments[:, 0], axis=-1) < 2)
            if short.size:
                raise ValueError(f"lines.{axis}.{short[0]} is shorter than 2 pixels; draw it as long as can be")

    def segments(self) -> tuple[np.ndarray, ...]:
        """The three sets, (N, 2, 2) each."""
        return tuple(np.asarray(s, np.float64).reshape((-1, 2, 2)) if np.size(s) == 0 else np.asarray(s, np.float64)
                     for s in (self.x, self.y, self.z))  # fmt: skip


def fit_vanishing_lines(
    size: tuple[int, int],
    lines: AxisLines,
    *,
    origin: tuple[float, float],
    length: KnownLength,
    focal_length: float | None = None,
    centre: tuple[float, float] | None = None,
    distortion: Distortion | None = None,
    estimate_centre: bool = False,
) -> CameraFit:
    """Find the camera from lines drawn on a photograph along the world's axes.

    size : (width, height) of the photograph, pixels
    lines : several along each axis are fitted by least squares, all axes at once and at right angles
    origin : where the photograph shows the world's origin, a point of the ground y = 0; pixels
    length : a known length, which sets the scale
    focal_length : pixels; from two sets of lines that meet within reach unless given
    centre : the principal point, pixels; the picture's middle unless given
    distortion : of the lens; the lines are straightened first, for which the focal length must be given
    estimate_centre : find the principal point too, for a photograph that was cropped; needs lines along all three axes
    The frame is that of a grid: +Y up in the photograph, +X to the right, +Z = X × Y, mostly towards the camera.
    Points and offsets are the segments' ends and how far they lie from the best line through the vanishing point;
    through a distorting lens the offsets are those of the straightened picture.
    Raises ValueError, in one line, where the lines do not determine the camera.
    """
    # The lines, straightened where the lens bends them.
    segments = lines.segments()
    if distortion is not None:
        if focal_length is None:
            raise ValueError("lines through a lens's distortion; give focal_length as well, to which its terms refer")
        straight = Camera(*size, focal_length, np.zeros(3), np.eye(3), centre, distortion)
        rays = [straight.rays_through(s) for s in segments]
        segments = tuple(straight.pinhole().project(r) for r in rays)
        if not all(np.isfinite(s).all() for s in segments):
            raise ValueError("a line ends where the distortion has folded over; draw it within the photograph")
    if estimate_centre and not all(len(s) > 1 for s in segments):
        raise ValueError("estimate_centre needs two lines or more along each of x, y and z; draw them, or leave it out")
    middle = np.array(centre or (size[0] / 2, size[1] / 2))
    view, minimum = _view_of(size, segments, lines.level, focal_length, middle, estimate_centre)
    _check_determined(minimum, view, size, focal_length is None, estimate_centre)

    # The camera's place: along the ray of the origin, as far as the known length says.
    found_centre = centre if not estimate_centre else (float(view.centre[0]), float(view.centre[1]))
    lens = Camera(*size, view.focal_length, np.zeros(3), view.world_from_camera(), found_centre, distortion)
    ray = lens.rays_through(np.asarray(origin, np.float64))
    if not ray[1] < 0:
        raise ValueError(
            f"origin {origin[0]:.0f}, {origin[1]:.0f} lies above the horizon of the lines; give a point of "
            "the ground, or check which axis each line was drawn along"
        )
    # At first the origin is one unit away; the known length sets the unit.
    camera = replace(lens, position=-ray * length.metres_per_unit(replace(lens, position=-ray)))
    ends = np.concatenate([s.reshape(-1, 2) for s in lines.segments()])
    return CameraFit(camera, ends, np.concatenate(_offsets(view, segments)))


def turn_from_lines(
    size: tuple[int, int], lines: AxisLines, focal_length: float | None, centre: tuple[float, float]
) -> tuple[float, np.ndarray, float]:
    """Focal length, pixels, world-from-camera rotation (3, 3), and the focal length's deviation as a share of it.

    The frame is that of `fit_vanishing_lines`: the world's +X points to the right, which may be its −X in truth; then
    the rotation is half a turn about +Y off. Raises ValueError where the lines determine no rotation.
    """
    view, minimum = _view_of(size, lines.segments(), lines.level, focal_length, np.array(centre), False)
    spread = 0.0 if focal_length is not None else float(minimum.deviations[3])
    return view.focal_length, view.world_from_camera(), spread


def _view_of(
    size: tuple[int, int], segments: Sequence[np.ndarray], level: bool, focal_length: float | None,
    middle: np.ndarray, estimate_centre: bool,
) -> tuple[_View, Minimum]:  # fmt: skip
    """Vanishing points give a first view; all lines at once refine it."""
    points = {axis: _vanishing_point(AXES[axis], s, size) for axis, s in enumerate(segments) if len(s) > 1}
    focal = focal_length or _focal_length(points, middle, estimate_centre)
    start = _View(focal, middle, _rotation(points, segments, focal, middle, level))
    return _refined(start, segments, level, focal_length is None, estimate_centre)


@dataclass(frozen=True, eq=False)
class _View:
    """A camera from lines: focal length, principal point (2,), the world's axes as columns (3, 3), y down, z ahead."""

    focal_length: float
    centre: np.ndarray
    axes: np.ndarray

    def vanishing_points(self) -> np.ndarray:
        """Homogeneous pixel coordinates (3, 3), a row an axis; the last is 0 where its lines stay parallel."""
        x, y, z = self.axes
        return np.stack([self.focal_length * x + self.centre[0] * z, self.focal_length * y + self.centre[1] * z, z], 1)

    def world_from_camera(self) -> np.ndarray:
        """Our rotation: columns right, up and backward in the world."""
        return self.axes.T @ np.diag([1.0, -1.0, -1.0])


def _vanishing_point(axis: str, segments: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Where the lines meet, homogeneous pixel coordinates (3,) of any length; linear least squares."""
    scale, middle = np.hypot(*size), np.array(size) / 2
    ends = (segments - middle) / scale
    a, b = (np.concatenate([ends[:, i], np.ones((len(ends), 1))], axis=1) for i in (0, 1))
    # The cross product is as long as the segment, so that long ones count for more.
    _, singular, rows = np.linalg.svd(np.cross(a, b))
    # Lines of one direction through one point: their differences are those of drawing.
    if singular[1] < DRAWN / scale * np.sqrt(len(segments)) * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1).mean():
        raise ValueError(f"lines.{axis} lie all on one line; draw them apart, so that it shows where they meet")
    x, y, w = rows[-1]
    return np.array([x * scale + w * middle[0], y * scale + w * middle[1], w])


def _focal_length(points: dict[int, np.ndarray], middle: np.ndarray, free: bool) -> float:
    """A first focal length, pixels: lines to two vanishing points are at right angles in the world."""
    if len(points) < 2:
        raise ValueError(
            "lines along one axis do not determine the focal length; give it, or two lines along another axis"
        )
    squares = []
    for first, second in combinations(points.values(), 2):
        a, b = (v[:2] - v[2] * middle for v in (first, second))
        with np.errstate(divide="ignore", invalid="ignore"):
            squares.append(float(-(a @ b) / (first[2] * second[2])))
    usable = [square for square in squares if np.isfinite(square) and square > 0]
    if usable:
        return float(np.sqrt(np.median(usable)))
    if free:
        return float(2 * np.max(middle))
    raise ValueError(
        "the lines meet where no right angle is seen, or not at all; give focal_length, draw lines that run towards "
        "each other, or give the centre of a cropped photograph"
    )


def _rotation(
    points: dict[int, np.ndarray], segments: Sequence[np.ndarray], focal: float, middle: np.ndarray, level: bool
) -> np.ndarray:
    """The world's axes (3, 3) in the camera's frame, y down, from vanishing points; signs as `_View` has them."""
    to_rays = np.array([[1 / focal, 0, -middle[0] / focal], [0, 1 / focal, -middle[1] / focal], [0, 0, 1]])
    seen = {axis: normalised(to_rays @ point) for axis, point in points.items()}
    if not seen:
        raise ValueError("no two lines along any axis; draw two or more along each of two axes")
    if len(seen) == 1:
        ((axis, direction),) = seen.items()
        seen |= _second(axis, direction, segments, to_rays, level)
    columns = np.zeros((3, 3))
    for axis, direction in seen.items():
        columns[:, axis] = direction
    return _signed(columns, list(seen))


def _second(
    axis: int, direction: np.ndarray, segments: Sequence[np.ndarray], to_rays: np.ndarray, level: bool
) -> dict[int, np.ndarray]:
    """Another axis, from a single line along it or from a level horizon."""
    for other, lines in enumerate(segments):
        if other != axis and len(lines):
            a, b = (to_rays @ np.append(end, 1.0) for end in lines[0])
            found = np.cross(direction, np.cross(a, b))
            if np.linalg.norm(found) > 1e-6 * np.linalg.norm(a) * np.linalg.norm(b):
                return {other: normalised(found)}
    right = np.array([1.0, 0, 0])
    if level and axis == 1:  # nothing determines which way +X runs: to the camera's right
        return {0: normalised(right - (right @ direction) * direction)}
    if level and np.linalg.norm(np.cross(direction, right)) > 1e-3:
        return {1: normalised(np.cross(direction, right))}
    raise ValueError(
        f"lines along {AXES[axis]} alone do not determine how the camera was turned; draw lines along another axis, "
        "or give level = true where its horizon is level"
    )


def _signed(columns: np.ndarray, known: list[int]) -> np.ndarray:
    """A rotation from two or three axes: y up in the picture, x to its right, z = x × y."""
    if len(known) == 2:
        missing = 3 - sum(known)
        columns[:, missing] = np.cross(columns[:, (missing + 1) % 3], columns[:, (missing + 2) % 3])
    left, _, right = np.linalg.svd(columns)
    axes = left @ right
    up = -axes[1, 1]
    # A camera that looks straight down sees no up; there the ground lies ahead.
    axes[:, 1] *= np.sign(up if abs(up) > 0.05 else -axes[2, 1]) or 1.0
    axes[:, 0] *= np.sign(axes[0, 0]) or 1.0
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    return axes


def _refined(
    start: _View, segments: Sequence[np.ndarray], level: bool, focal_length: bool, centre: bool
) -> tuple[_View, Minimum]:
    """The view that fits best; its unknowns are the turn, the logarithm of the focal length, the centre in widths."""
    width = 2 * float(np.max(start.centre))

    def view_of(values: np.ndarray) -> _View:
        focal = start.focal_length * float(np.exp(values[3])) if focal_length else start.focal_length
        middle = start.centre + width * values[-2:] if centre else start.centre
        return _View(focal, middle, rotation_from_vector(values[:3]) @ start.axes)

    def errors(values: np.ndarray) -> np.ndarray:
        view = view_of(values)
        lean = [LEVEL * view.axes[0, 1]] if level else []
        # One number a line: the root of the sum of its two ends' squared distances.
        return np.concatenate([_misses(v, s) for v, s in zip(view.vanishing_points(), segments, strict=True)] + [lean])

    minimum = least_squares(errors, np.zeros(3 + focal_length + 2 * centre), DRAWN)
    return view_of(minimum.values), minimum


def _misses(point: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Root of the two ends' summed squared distances from the best line through a vanishing point, signed, pixels.

    With ends a, b and the point at v, the line that fits best misses by |(a − v) × (b − v)| ∕ √(|a − v|² + |b − v|²);
    written homogeneously it holds for parallel lines as well.
    """
    v, w = point[:2], point[2]
    a, b = segments[:, 0], segments[:, 1]
    area = w * _cross(a, b) - _cross(a, v) - _cross(v, b)
    reach = np.sum((w * a - v) ** 2, axis=-1) + np.sum((w * b - v) ** 2, axis=-1)
    return area / np.sqrt(np.maximum(reach, 1e-300))


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _offsets(view: _View, segments: Sequence[np.ndarray]) -> list[np.ndarray]:
    """From each end (2N, 2) to the best line through its vanishing point, pixels."""
    offsets = []
    for point, lines in zip(view.vanishing_points(), segments, strict=True):
        v, w = point[:2], point[2]
        from_point = w * lines - v
        # The best line runs along the main axis of the two ends as seen from the vanishing point.
        along = np.linalg.svd(from_point)[2][:, 0] if len(lines) else np.empty((0, 2))
        if abs(w) * np.hypot(*view.centre) < 1e-6 * np.linalg.norm(v):
            along = np.broadcast_to(v / np.linalg.norm(v), along.shape)
            from_point = lines - lines.mean(1, keepdims=True)
            w = 1.0
        beside = from_point - np.sum(from_point * along[:, None], axis=-1, keepdims=True) * along[:, None]
        offsets.append((-beside / w).reshape(-1, 2))
    return offsets


def _check_determined(minimum: Minimum, view: _View, size: tuple[int, int], focal_length: bool, centre: bool) -> None:
    if focal_length and DOUBTFUL < minimum.deviations[3] <= LARGEST_DEVIATION:
        warn(
            f"the lines determine the focal length to ± {100 * minimum.deviations[3]:.0f} % only "
            f"({view.focal_length:.0f} pixels); give camera.focal_length where it is known"
        )
    if focal_length and not minimum.deviations[3] <= LARGEST_DEVIATION:
        spread = f" (± {100 * minimum.deviations[3]:.0f} %)" if np.isfinite(minimum.deviations[3]) else ""
        raise ValueError(
            f"the lines do not determine the focal length{spread}: those along one axis stay almost parallel; give "
            "focal_length, or draw longer lines that run towards each other"
        )
    if centre and not np.all(minimum.deviations[-2:] <= LARGEST_DEVIATION):
        raise ValueError(
            "the lines do not determine the principal point: those along one axis stay almost parallel; leave "
            "estimate_centre out, or give the centre"
        )

"""A camera with a pose and a lens: world points to pixels and pixels to rays."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.scene.cameras.distortion import Distortion
from relume.scene.cameras.rolling_shutter import RollingShutter
from relume.sphere.directions import look_at


@dataclass(frozen=True, eq=False)
class Camera:
    """Where a picture was taken from, and through which lens.

    width, height : pixels
    focal_length : pixels; both ways alike
    position : (3,) metres, world
    rotation : (3, 3) world-from-camera; columns are right, up and backward, so the camera looks along −Z
    centre : the principal point, pixels from the upper left corner, x right and y down; the picture's middle if None
    distortion : of the lens; none if None
    aperture : radius of the lens, metres; 0 for a pinhole, which is sharp everywhere
    focus : distance of the plane in focus along the viewing axis, metres
    rolling : how it moves while its rows are read one after another; None where all rows are of one moment

    `project` and `rays` are those of the lens's middle; an aperture spreads rays about it, which only renderers do.
    With a rolling shutter the rays of a row start at `eyes` and not at `position`, which is the middle row's.
    """

    width: int
    height: int
    focal_length: float
    position: np.ndarray
    rotation: np.ndarray
    centre: tuple[float, float] | None = None
    distortion: Distortion | None = None
    aperture: float = 0.0
    focus: float = np.inf
    rolling: RollingShutter | None = None

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or not 0 < self.focal_length < np.inf:
            raise ValueError(f"a camera of {self.width}×{self.height} pixels and focal length {self.focal_length}")
        if not np.all(np.abs(self.position) < 1e15):
            raise ValueError(f"a camera at {self.position}; expected metres, less than 1e15 from the origin")
        if self.centre is not None and not (len(self.centre) == 2 and np.all(np.isfinite(self.centre))):
            raise ValueError(f"a camera whose principal point is {self.centre}; expected two numbers, in pixels")
        if not 0 <= self.aperture < np.inf or not self.focus > 0:
            raise ValueError(
                f"a camera of aperture {self.aperture} and focus {self.focus}; expected metres, a radius of 0 or more "
                "and a distance above 0"
            )
        if self.distortion is not None and not np.isfinite(self.rays_through(border(self.width, self.height))).all():
            raise ValueError(
                f"{self.distortion} folds over within a picture of {self.width}×{self.height} pixels and focal length "
                f"{self.focal_length:g}; check its coefficients, which are those of normalised coordinates"
            )

    @staticmethod
    def looking_at(position: np.ndarray, target: np.ndarray, *, width: int, height: int, focal_length: float) -> Camera:
        """A camera at `position` that looks at `target`, horizon level.

        position, target : (3,) world, metres
        width, height : pixels
        focal_length : pixels; the picture's width, over twice the tangent of half its angle

        >>> camera = Camera.looking_at((0, 1, 4), (0, 1, 0), width=640, height=480, focal_length=800)
        >>> camera.project(np.array([[0, 1, 0], [1, 1, 0], [0, 2, 0]])).tolist()
        [[320.0, 240.0], [520.0, 240.0], [320.0, 40.0]]
        """
        position = np.asarray(position, np.float64)
        return Camera(width, height, focal_length, position, look_at(position, np.asarray(target, np.float64)))

    @property
    def principal_point(self) -> tuple[float, float]:
        """Where the viewing axis meets the picture, pixels from the upper left corner."""
        return (self.width / 2, self.height / 2) if self.centre is None else self.centre

    def pinhole(self) -> Camera:
        """The same camera without distortion, all its rows at one moment."""
        return replace(self, distortion=None, rolling=None)

    def resized(self, width: int, height: int) -> Camera:
        """The same field of view across, in `width` × `height` pixels; another aspect crops or adds
        above and below alike."""
        scale, centre = width / self.width, None
        if self.centre is not None:
            x, y = self.centre
            centre = (x * scale, height / 2 + (y - self.height / 2) * scale)
        rolling = None if self.rolling is None else self.rolling.scaled(scale, self.height, height)
        return replace(
            self, width=width, height=height, focal_length=self.focal_length * scale, centre=centre, rolling=rolling
        )

    def window(self, left: int, top: int, width: int, height: int) -> Camera:
        """What these pixels of the picture show, as a picture of its own: the same place, lens and size of pixels.

        left, top : of the part's upper left corner, pixels from that of the picture
        width, height : of the part, pixels
        """
        across, down = self.principal_point
        rolling = None if self.rolling is None else self.rolling.window(top)
        return replace(self, width=width, height=height, centre=(across - left, down - top), rolling=rolling)

    def rays(self) -> np.ndarray:
        """Unit directions (H, W, 3), world, through the pixel centres."""
        return self.rays_through(self.middles())

    def middles(self) -> np.ndarray:
        """Pixel coordinates (H, W, 2) of the pixel centres."""
        x, y = np.arange(self.width) + 0.5, np.arange(self.height) + 0.5
        return np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)

    def rays_through(self, points: np.ndarray) -> np.ndarray:
        """Unit directions (…, 3), world, through pixel coordinates `points` (…, 2), x right and y down from the corner.

        NaN where the distortion model has folded over, which is never within the picture.
        """
        across, down = self.principal_point
        if self.distortion is None:
            x, y = points[..., 0] - across, down - points[..., 1]
            local = np.stack(np.broadcast_arrays(x, y, -self.focal_length), axis=-1)
        else:
            seen = (np.asarray(points, np.float64) - [across, down]) / self.focal_length
            straight = self.distortion.undistorted(seen)
            local = np.stack(np.broadcast_arrays(straight[..., 0], -straight[..., 1], -1.0), axis=-1)
        local = local / np.linalg.norm(local, axis=-1, keepdims=True)
        world = local @ self.rotation.T
        return world if self.rolling is None else self.rolling.turned(world, self.rolling.shares(points[..., 1]))

    def eyes(self, points: np.ndarray) -> np.ndarray:
        """Where the rays through pixel coordinates `points` (…, 2) start, (…, 3) metres, world."""
        position = np.asarray(self.position, np.float64)
        if self.rolling is None:
            return np.broadcast_to(position, (*points.shape[:-1], 3))
        return position + self.rolling.moved(self.rolling.shares(points[..., 1]))

    def eyes_towards(self, points: np.ndarray) -> np.ndarray:
        """From where world points (…, 3) are seen, (…, 3) metres: at the time of the row that shows each.

        The middle row's place for what is behind the camera.
        """
        if self.rolling is None:
            return np.broadcast_to(np.asarray(self.position, np.float64), np.shape(points))
        return self.eyes(np.nan_to_num(self.project(points), nan=self.rolling.middle))

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixel coordinates (…, 2), x right and y down, of world points (…, 3).

        NaN behind the camera and beyond where the distortion model folds over. With a rolling shutter each point is
        where it is in the row that shows it, which is found by repetition.
        """
        points = np.asarray(points, np.float64)
        if self.rolling is None:
            return self._seen(points - self.position)
        shares = np.zeros(points.shape[:-1])
        for _ in range(ROW_STEPS):
            way = points - self.position - self.rolling.moved(shares)
            found = self._seen(self.rolling.turned(way, shares, back=True))
            last, shares = shares, self.rolling.shares(np.nan_to_num(found[..., 1], nan=self.rolling.middle))
            if np.all(np.abs(shares - last) < 1e-9):
                break
        return found

    def _seen(self, way: np.ndarray) -> np.ndarray:
        """Pixel coordinates of what lies at `way` (…, 3), world, from the camera in its own pose."""
        local = way @ self.rotation
        depth = np.where(local[..., 2] < 0, -local[..., 2], np.nan)
        across, down = self.principal_point
        if self.distortion is None:
            x = across + self.focal_length * local[..., 0] / depth
            return np.stack([x, down - self.focal_length * local[..., 1] / depth], axis=-1)
        straight = np.stack([local[..., 0] / depth, -local[..., 1] / depth], axis=-1)
        return np.array([across, down]) + self.focal_length * self.distortion.distorted(straight)


ROW_STEPS = 50
"""Repetitions after which the row of a point is taken as found: a pan by a tenth of the picture needs six."""


def border(width: int, height: int) -> np.ndarray:
    """Points (64, 2) along the edge of a picture: what folds over nowhere there does so nowhere inside."""
    along = np.linspace(0, 1, 16, endpoint=False)
    zero, one = np.zeros_like(along), np.ones_like(along)
    sides = [(along, zero), (one, along), (1 - along, one), (zero, 1 - along)]
    return np.concatenate([np.stack(side, axis=-1) for side in sides]) * [width, height]


LARGEST_UNDISTORTED = 4.0
"""Times the picture's sides: an undistorted picture that is larger is that of a model stretched beyond its measure."""


def undistorted(camera: Camera) -> Camera:
    """A camera without distortion that sees all that `camera` sees, as finely in the middle: same pose, larger picture.

    All its rows are of one moment: that of the middle row of a rolling shutter.
    Raises ValueError where its picture would be more than four times as wide or high.
    """
    if camera.distortion is None and camera.rolling is None:
        return camera
    pinhole = camera.pinhole()
    seen = pinhole.project(camera.position + camera.rays_through(border(camera.width, camera.height)))
    low, high = np.floor(seen.min(0)), np.ceil(seen.max(0))
    width, height = (int(n) for n in high - low)
    if not (width <= LARGEST_UNDISTORTED * camera.width and height <= LARGEST_UNDISTORTED * camera.height):
        raise ValueError(
            f"the undistorted picture has {width}×{height} pixels for {camera.width}×{camera.height}; the distortion "
            "does not hold out to the corners: check its coefficients"
        )
    across, down = camera.principal_point
    return replace(pinhole, width=width, height=height, centre=(across - float(low[0]), down - float(low[1])))


def reprojected(picture: np.ndarray, seen_by: Camera, wanted: Camera) -> np.ndarray:
    """A picture (H, W) or (H, W, C) as another camera at the same place would have taken it, float32.

    picture : (H, W) or (H, W, C)
    seen_by : the camera of `picture`
    wanted : the camera whose lens or turn the result has
    With `wanted = undistorted(seen_by)` the distortion is undone, the other way round it is redone.
    Bilinear, so that nothing gets brighter or darker than its neighbours; NaN where `picture` does not reach.
    Raises ValueError for a picture of another size than its camera, and for cameras at different places.
    """
    from scipy.ndimage import map_coordinates

    if picture.shape[:2] != (seen_by.height, seen_by.width):
        raise ValueError(f"a picture of {picture.shape} from a camera of {seen_by.width}×{seen_by.height} pixels")
    if np.linalg.norm(wanted.position - seen_by.position) > 0:
        raise ValueError("the two cameras stand at different places; what one hides from the other is in no picture")
    points = seen_by.project(seen_by.position + wanted.rays())
    x, y = points[..., 0], points[..., 1]
    with np.errstate(invalid="ignore"):
        # Half a pixel beyond the outermost centres the picture still reaches: its edge is repeated there.
        reached = (x >= 0) & (x <= seen_by.width) & (y >= 0) & (y <= seen_by.height)
    places = np.where(reached, np.stack([y, x]) - 0.5, 0.0)
    planes = np.asarray(picture, np.float32).reshape(*picture.shape[:2], -1)
    found = np.stack([map_coordinates(p, places, order=1, mode="nearest") for p in np.moveaxis(planes, -1, 0)], axis=-1)
    return np.where(reached[..., None], found, np.float32(np.nan)).reshape(*reached.shape, *picture.shape[2:])

"""Light directions from a mirrored ball in the pictures: where the ball shows the lamp, and where it stands therefore.

A lamp is mirrored where the ball's normal halves the angle between the directions to lamp and camera; with the normal n
and the direction v to the camera, the lamp stands towards 2 (n·v) n − v. Pixels: x right, y down, (0, 0) the picture's
corner. Without a camera all rays run along −Z and directions are in the picture's frame: x right, y up, z towards the
camera.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter, label

from relume.errors import BallNotFound, warn
from relume.image.colour import luminance
from relume.probe.ball.silhouette import Outline, cone_through, outline_through
from relume.probe.ball.unwrapping import CAMERA_FROM_PIXELS
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised

PARALLEL = np.radians(0.5)
"""Rays that differ by less, the error of a highlight's place on a ball, do not determine how far away a light is."""
# How the lamp is separated from the rest that a ball mirrors.
_SMEAR = 0.01
"""Blur in radii of the ball before the brightest place is sought; a lamp's plateau is wider than the sparks of dust and
of the ball beside, which this evens away."""
_LEVEL = 0.9
"""Share of the brightest pixel above which a pixel belongs to the lamp and not to its glare."""
_REACH = 0.1
"""Radii round the brightest place within which the lamp's pixels lie."""
_RIM = 0.98
"""Share of the ball's radius that is searched; beyond it the surroundings are squeezed into a thin bright ring."""
_CONTRAST = 4.0
"""How many times brighter the lamp has to be than the ball is at most places."""


@dataclass(frozen=True, eq=False)
class MirrorBall:
    """A mirrored ball as a camera sees it.

    outline : its silhouette, pixels
    camera : None for one so far away that its rays are parallel
    radius : metres; 1, which makes places those in radii from the camera, unless known
    """

    outline: Outline
    camera: Camera | None = None
    radius: float = 1.0

    @property
    def centre(self) -> np.ndarray:
        """World position (3,), metres, or the origin where there is no camera."""
        if self.camera is None:
            return np.zeros(3)
        axis, distance = self._cone()
        return self.camera.position + self.radius * distance * axis

    def normals(self, points: np.ndarray) -> np.ndarray:
        """Outward unit normals (N, 3) of the ball, world, seen at pixels (N, 2); NaN beside the ball."""
        return self._met(np.asarray(points, np.float64))[1]

    def reflections(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (N, 3) on the ball seen at pixels (N, 2), metres, world, and where the rays go from there, unit.

        NaN beside the ball.
        """
        rays, normals, places = self._met(np.asarray(points, np.float64))
        return places, rays - 2 * (rays * normals).sum(axis=-1, keepdims=True) * normals

    def _met(self, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The rays (N, 3) from the camera through pixels (N, 2), and the ball's normals and places that they meet."""
        if self.camera is None:
            across = (pixels - self.outline.centre) / self.outline.radius * [1.0, -1.0]
            square = (across**2).sum(axis=-1)
            normals = np.concatenate([across, np.sqrt(np.where(square <= 1, 1 - square, np.nan))[..., None]], axis=-1)
            return np.array([0.0, 0.0, -1.0]), normals, self.radius * normals
        axis, distance = self._cone()
        rays = self.camera.rays_through(pixels)
        # |t d − D a|² = 1, the nearer root.
        along = distance * (rays @ axis)
        inside = along**2 - distance**2 + 1
        near = along - np.sqrt(np.where(inside >= 0, inside, np.nan))
        normals = near[..., None] * rays - distance * axis
        return rays, normals, self.camera.position + self.radius * near[..., None] * rays

    def _cone(self) -> tuple[np.ndarray, float]:
        """The direction from the camera to the ball's centre, world, and its distance in radii."""
        camera = self.camera
        assert camera is not None
        across, down = camera.principal_point
        # The cone's own picture has its principal point in the middle.
        points = self.outline.points + np.array([camera.width / 2 - across, camera.height / 2 - down])
        cone = cone_through(points, (camera.width, camera.height), camera.focal_length)
        return camera.rotation @ CAMERA_FROM_PIXELS @ cone.axis, cone.distance


@dataclass(frozen=True, eq=False)
class BallReadings:
    """What a ball shows of the lights, a row a picture.

    places : (N, 3) where the lamp is mirrored on the ball, metres, world; of a matte ball its centre
    directions : (N, 3) unit, from there towards the light
    matte : whether the ball is matte, and its shading was read
    """

    places: np.ndarray
    directions: np.ndarray
    matte: bool = False


def read_ball(pictures: Iterable[np.ndarray], ball: MirrorBall, names: Sequence[str] | None = None) -> BallReadings:
    """Where a ball shows the lamp in each picture, and where the lamp stands.

    pictures : (H, W, 3) scene-linear, or as encoded: only what is brightest counts; looked at one after another
    names : of the pictures, for messages
    Raises BallNotFound where a picture shows no lamp in the ball.
    """
    points = [
        find_highlight(picture, ball.outline, f"picture {index + 1}" if names is None else names[index])
        for index, picture in enumerate(pictures)
    ]
    return BallReadings(*ball.reflections(np.array(points).reshape(-1, 2)))


def find_highlight(picture: np.ndarray, outline: Outline, name: str = "picture") -> tuple[float, float]:
    """Where the lamp is mirrored in a ball, pixels (x, y), to fractions of one.

    It is the middle of what the light has above `_LEVEL` of the brightest: of a saturated plateau its middle, and
    of a lamp that is not saturated its peak, so that neither glare nor the lit surroundings pull at it.
    Raises BallNotFound where nothing stands out.
    """
    left, top, light = _disc(np.asarray(picture), outline, name)
    blurred = np.asarray(gaussian_filter(light, max(_SMEAR * outline.radius, 0.5)))
    row, column = np.unravel_index(int(np.argmax(blurred)), blurred.shape)
    y, x = np.indices(light.shape)
    reach = max(_REACH * outline.radius, 2.0)
    peak = float(light[np.hypot(x - column, y - row) <= reach].max())
    if not peak > _CONTRAST * max(float(np.median(light[light > 0])) if np.any(light > 0) else 0.0, 1e-12):
        raise BallNotFound(f"{name}: the ball shows no lamp: nothing in it is much brighter than the rest; is it lit?")
    weight = np.maximum(light - _LEVEL * peak, 0)
    # Of bright pieces the one with most light is the lamp.
    pieces, count = label(weight > 0, np.ones((3, 3)))  # pyright: ignore
    lamp = pieces == 1 + int(np.argmax(np.bincount(pieces.ravel(), weight.ravel(), count + 1)[1:]))
    row, column = np.unravel_index(int(np.argmax(np.where(lamp, blurred, 0))), blurred.shape)
    # The window goes to where the middle of its own light is: streaks that reach out of it do not count.
    across = max(reach, 1.5 * float(np.sqrt(lamp.sum() / np.pi)))
    found = np.array([column, row], np.float64)
    bright = np.argwhere(weight > 0)[:, ::-1]
    amounts = weight[bright[:, 1], bright[:, 0]]
    for _ in range(20):
        inside = np.where(np.hypot(*(bright - found).T) <= across, amounts, 0)
        middle = inside @ bright / inside.sum()
        still = np.allclose(middle, found, atol=0.01)
        found = middle
        if still:
            break
    return left + float(found[0]) + 0.5, top + float(found[1]) + 0.5


def _disc(picture: np.ndarray, outline: Outline, name: str) -> tuple[int, int, np.ndarray]:
    """The luminance of a ball's disc in its box, whose left and upper corner come first; 0 beside the disc."""
    height, width = picture.shape[:2]
    (x, y), radius = outline.centre, outline.radius * _RIM
    left, top = max(int(x - radius), 0), max(int(y - radius), 0)
    box = picture[top : max(int(np.ceil(y + radius)), 0), left : max(int(np.ceil(x + radius)), 0)]
    if box.size == 0:
        raise BallNotFound(f"{name}: the ball at {x:.0f},{y:.0f} is not in a picture of {width}×{height} pixels")
    light = luminance(box.astype(np.float64))
    rows, columns = np.indices(light.shape)
    inside = np.hypot(columns + left + 0.5 - x, rows + top + 0.5 - y) < radius
    return left, top, np.where(inside & np.isfinite(light), np.maximum(light, 0), 0.0)


def outline_of_mask(mask: np.ndarray, name: str = "mask") -> Outline:
    """The silhouette of a ball from a picture (H, W) or (H, W, 3) that is bright on it and dark beside it.

    Its largest bright piece is taken, and a circle laid through its rim; where something hides a part of the rim, the
    rest gives the circle. Raises BallNotFound for a mask without a round piece.
    """
    level = np.asarray(mask, np.float64)
    level = level.mean(axis=2) if level.ndim == 3 else level
    pieces, count = label(level > level.max() / 2)  # pyright: ignore
    if count == 0 or level.max() <= 0:
        raise BallNotFound(f"{name}: black all over; paint the ball white in it")
    largest = pieces == 1 + int(np.argmax(np.bincount(pieces.ravel())[1:]))
    rim = _rim(np.pad(largest, 1)) - 1.0
    circle = outline_through(rim)
    for _ in range(10):
        off = np.abs(np.hypot(*(rim - circle.centre).T) - circle.radius)
        kept = off <= max(2.5 * float(np.median(off)), 1.0)
        if kept.all():
            break
        rim = rim[kept]
        circle = outline_through(rim)
    # A circle's rim crosses 8 r sides of pixels.
    if circle.radius < 2 or len(rim) < 4 * circle.radius:
        raise BallNotFound(f"{name}: its white piece is not round; paint the ball white and all else black")
    return circle


def _rim(piece: np.ndarray) -> np.ndarray:
    """The middles (M, 2) of the pixels' sides, x and y, at which a piece (H, W) ends."""
    row, column = np.nonzero(piece[:, 1:] != piece[:, :-1])
    lower, across = np.nonzero(piece[1:] != piece[:-1])
    return np.concatenate([np.stack([column + 1.0, row + 0.5], axis=1), np.stack([across + 0.5, lower + 1.0], axis=1)])


def unit_mean(readings: Sequence[BallReadings]) -> np.ndarray:
    """Directions (N, 3) from several balls, for lights so far away that all see them alike: the mean of theirs."""
    return normalised(np.sum([reading.directions for reading in readings], axis=0))


def light_places(readings: Sequence[BallReadings], names: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """The points (N, 3) nearest to the rays that several balls mirror, by least squares, and how far they miss them.

    readings : in metres and one world; one row a light
    The misses (N,) are root mean squares, metres. Raises ValueError for rays that meet behind the balls. Warns of
    lights whose rays are nearly parallel: their distance is a guess.
    """
    places = np.stack([reading.places for reading in readings], axis=1)
    rays = np.stack([reading.directions for reading in readings], axis=1)
    # Σ (I − d dᵀ)(p − o) = 0: the squared distances to all rays are least.
    across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
    positions = np.linalg.solve(across.sum(axis=1), (across @ places[..., None]).sum(axis=1))[..., 0]
    offset = positions[:, None] - places
    residuals = np.sqrt(((across @ offset[..., None])[..., 0] ** 2).sum(axis=-1).mean(axis=1))
    parallax = np.arccos(np.clip((rays[:, :, None] * rays[:, None]).sum(axis=-1), -1, 1)).max(axis=(1, 2))
    measurable = parallax >= PARALLEL
    apart = measurable & ((offset * rays).sum(axis=-1).min(axis=1) <= 0)
    if np.any(apart):
        odd = names[int(np.argmax(apart))]
        raise ValueError(f"{odd}: the balls' rays run apart; check the balls' circles, their order and their radii")
    if not measurable.all():
        warn(
            f"{names[int(np.argmin(measurable))]}: the balls' rays are parallel within half a degree "
            f"({(~measurable).sum()} such lights), so that its distance is a guess; put the balls farther apart, or "
            "treat it as a distant light"
        )
    return positions, residuals

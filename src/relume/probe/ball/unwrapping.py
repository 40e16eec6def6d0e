"""Unwrapping a photographed mirrored ball with the true perspective of its camera.

Camera frame here: x right, y down, z forward, as pixels run. The ball is the unit sphere; the camera stands
`distance` radii from its centre. A direction at angle β from the camera's is seen in the ball where the normal
makes the angle γ, with β = γ + atan2(D sin γ, D cos γ − 1), and in the picture at the angle α from the ball's middle,
tan α = sin γ / (D − cos γ).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from scipy.ndimage import distance_transform_edt

from relume.errors import BallNotFound, warn
from relume.image.bilinear import bilinear
from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap
from relume.probe.ball.mirror_edge import fitted_lens
from relume.probe.ball.mirroring import missing_colour
from relume.probe.ball.outline import find_outline, shown
from relume.probe.ball.reflectance import BallReflectance
from relume.probe.ball.rim_selection import placed_rim
from relume.probe.ball.silhouette import Outline, cone_through
from relume.sphere.directions import angle_between, lengths, look_at, normalised, rotation_between

MOST_CUT = 0.03
"""The share of the ball that may lie beyond the picture's edge: a crop that cuts 4 % of the radius off all four sides
takes 1.9 to 2.1 % of it, by how the crop falls on whole pixels, and the rim is found as well as of whole ones."""
NEUTRAL = 1.2
"""Largest reflectance of a channel, against the smallest, below which a ball is taken for grey."""
MIXED = 1.0
"""Pixels inside the silhouette that a pixel cut by it reaches when the picture is looked up between its pixels."""
LONGER = 1.0
"""Ln of how much longer than by R = f·tan α, or shorter, the lens is sought that draws a ball as large as it is."""
TURNED = np.radians(1)
"""Turn of all directions from which on an unsure focal length is a doubt: twice what a good horizon has."""
CAMERA_FROM_PIXELS = np.diag([1.0, -1.0, -1.0])
"""Turns the pixel frame (y down, z forward) into the camera frame of the world's conventions (y up, z backward)."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What a view of the ball shows in some directions (…).

    radiance : (…, 3), the ball's reflectance divided out
    incidence : (…) cosine of incidence: 1 where the ball faces the camera, falling to 0 at the silhouette, where the
        whole neighbourhood of the direction behind the ball is squeezed into no width; 0 in the blind cone
    sampling : (…) pixels per radian where it is squeezed most, 0 where the picture shows nothing of it, and in the
        outermost pixel of the ball, which mixes it with what is behind. It is squeezed radially, f d(tan α)/dβ: all
        pixels take in nearly the same solid angle (`solid_angles`), near the silhouette a long narrow strip of it
    saturated : (…) share that was saturated in every photograph, 0 to 1
    """

    radiance: np.ndarray
    incidence: np.ndarray
    sampling: np.ndarray
    saturated: np.ndarray


@dataclass(frozen=True, eq=False)
class BallView:
    """One radiance map of the ball, with where its camera stood: everything needed to look light up in it.

    picture : the radiance map
    focal_length : pixels; the principal point is the picture's middle
    axis : unit vector from the camera to the ball's centre, pixel frame
    distance : from the camera to the ball's centre, in ball radii
    world_from_pixels : rotation of the pixel frame into the world
    outline : the silhouette the ball was found by
    reflectance : of the ball; what is looked up is divided by it
    """

    picture: RadianceMap
    focal_length: float
    axis: np.ndarray
    distance: float
    world_from_pixels: np.ndarray
    outline: Outline
    reflectance: BallReflectance = BallReflectance()

    @property
    def towards_camera(self) -> np.ndarray:
        """The direction from the ball to its camera, in the world."""
        return -self.world_from_pixels @ self.axis

    def turned(self, rotation: np.ndarray) -> BallView:
        """The same view with its world turned by `rotation`."""
        return replace(self, world_from_pixels=rotation @ self.world_from_pixels)

    def adjusted(self, right: float, down: float, outward: float) -> BallView:
        """The same view with its silhouette moved, and grown; where its camera stood stays.

        right, down, outward : pixels
        """
        axis = normalised(self.axis + np.array([right, down, 0.0]) * self.axis[2] / self.focal_length)
        sine = min((1 + outward / self.outline.radius) / self.distance, 0.999)
        world = self.world_from_pixels @ rotation_between(axis, self.axis)
        return replace(self, axis=axis, distance=1 / sine, world_from_pixels=world)

    def see(self, directions: np.ndarray, nearness: float = 0.0) -> Seen:
        """What the view shows in world directions (…, 3).

        nearness : ball radius over the distance of what is seen; directions are those from the ball's centre, and
            the ray that leaves its surface meets them there. 0 is light at infinity
        """
        x, y, incidence, gamma = self.places(directions, nearness)
        sine, cosine = np.sin(gamma), np.cos(gamma)
        alpha_rise, beta_rise = self._rises(cosine)
        width, height = self.picture.size
        shown = (x >= 0) & (x <= width) & (y >= 0) & (y <= height)
        saturated = np.zeros(x.shape)
        if self.picture.clipped is not None:
            outside, over = self._marks
            if outside is not None:
                shown &= bilinear(outside, x, y) < 0.01
            if over is not None:
                saturated = bilinear(over, x, y)
        radiance = bilinear(self.picture.radiance, x, y)
        if min(self.reflectance.normal) < 1:
            radiance = radiance / self.reflectance.at(incidence)
        # The outermost pixel mixes the ball with what is behind it.
        tangent = sine / (self.distance - cosine)
        outermost = 1 - tangent * np.sqrt(self.distance**2 - 1)
        clean = shown & (outermost * self.outline.radius > MIXED)
        stretch = 1 + tangent**2  # 1/cos² α: the picture is flat
        sampling = np.where(clean, self.focal_length * stretch * np.maximum(alpha_rise, 0) / beta_rise, 0)
        return Seen(radiance, np.where(shown, incidence, 0), sampling, saturated)

    @cached_property
    def _marks(self) -> tuple[np.ndarray | None, np.ndarray | None]:
        """(H, W) float32: 1 where no photograph shows anything, and where all are saturated; None where nothing is."""
        marks = (self.picture.clipped == mark for mark in (OUTSIDE, SATURATED))
        outside, over = (mark.astype(np.float32) if np.any(mark) else None for mark in marks)
        return outside, over

    def mirrored_at(self, directions: np.ndarray, nearness: float) -> np.ndarray:
        """Where on the ball directions (…, 3) are mirrored: (…, 3) in radii from its centre, world.

        directions : (…, 3) unit, world, from the ball's centre
        nearness : ball radius over the distance of what is seen; 0 is light at infinity
        """
        return self._mirrored_at(directions, nearness)[1] @ self.world_from_pixels.T

    def _mirrored_at(self, directions: np.ndarray, nearness: float) -> tuple[np.ndarray, np.ndarray]:
        local = np.asarray(directions, np.float64) @ self.world_from_pixels
        gamma, normal = self._normal(local)
        if nearness:
            # From the surface point n (in radii) the point at 1/nearness lies along ω − nearness·n.
            gamma, normal = self._normal(normalised(local - nearness * normal))
        return gamma, normal

    def places(self, directions: np.ndarray, nearness: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Where in the picture directions (…, 3) are mirrored: x and y in pixels, the cosine of incidence, and γ.

        directions : (…, 3) unit, world, from the ball's centre
        nearness : ball radius over the distance of what is seen; 0 is light at infinity
        """
        gamma, normal = self._mirrored_at(directions, nearness)
        point = self.distance * self.axis + normal
        width, height = self.picture.size
        x = width / 2 + self.focal_length * point[..., 0] / point[..., 2]
        y = height / 2 + self.focal_length * point[..., 1] / point[..., 2]
        way = normalised(point)
        along = way[..., 0] * normal[..., 0] + way[..., 1] * normal[..., 1] + way[..., 2] * normal[..., 2]
        return x, y, np.maximum(-along, 0), gamma

    def solid_angles(self, directions: np.ndarray) -> np.ndarray:
        """Steradians of light from infinity that one pixel takes in where directions (…, 3) are seen: (…).

        It is (sin β dβ)/(sin α dα) times the solid angle of the pixel itself, cos³/f²: nearly the same all over the
        ball for a distant camera, 4/radius² (its pixels lie on 4π sr alike), and 0 in the blind cone.
        """
        local = np.asarray(directions, np.float64) @ self.world_from_pixels
        beta = angle_between(local, -self.axis)
        gamma, normal = self._normal(local)
        alpha_rise, beta_rise = self._rises(np.cos(gamma))
        alpha = np.arctan2(np.sin(gamma), self.distance - np.cos(gamma))
        # At the middle both sines vanish, and their ratio is that of the angles.
        middle = gamma < 1e-5
        ratio = np.where(
            middle, beta_rise / np.where(middle, alpha_rise, 1), np.sin(beta) / np.where(middle, 1, np.sin(alpha))
        )
        point = self.distance * self.axis + normal
        pixel = (point[..., 2] / np.linalg.norm(point, axis=-1)) ** 3 / self.focal_length**2
        seen = beta < np.pi - np.arcsin(1 / self.distance)
        return np.where(seen, pixel * ratio * beta_rise / np.maximum(alpha_rise, 1e-12), 0)

    def _rises(self, cosine: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """dα/dγ and dβ/dγ, of cos γ."""
        far = self.distance
        squared = far**2 - 2 * far * cosine + 1
        rise = (far * cosine - 1) / squared
        return rise, 1 + (far**2 - far * cosine) / squared

    def _normal(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """γ (…) and the normals (…, 3) at which directions (…, 3), in the pixel frame, are reflected to the camera."""
        back = -self.axis
        cosine = np.clip(directions @ back, -1, 1)
        # A channel at a time: NumPy takes several times as long for products along an axis of three.
        sideways = np.empty_like(directions)
        for c in range(3):
            np.subtract(directions[..., c], cosine * back[c], out=sideways[..., c])
        length = lengths(sideways)
        # Straight ahead and behind, where nothing lies aside, it stays 0.
        there = np.where(length > 0, length, 1)
        angle = np.interp(np.arctan2(length, cosine), *_reflections(self.distance))
        along, aside = np.cos(angle), np.sin(angle)
        for c in range(3):
            sideways[..., c] = along * back[c] + aside * (sideways[..., c] / there)
        return angle, sideways


@lru_cache(16)
def _reflections(distance: float) -> tuple[np.ndarray, np.ndarray]:
    """β of the light that reaches the camera and the γ of its normals, both rising; many look-ups share a table."""
    gamma = np.linspace(0, np.arccos(1 / distance), 8192)
    beta = gamma + np.arctan2(distance * np.sin(gamma), distance * np.cos(gamma) - 1)
    gamma.flags.writeable = beta.flags.writeable = False
    return beta, gamma


def unwrap_ball(
    picture: RadianceMap,
    *,
    camera: np.ndarray,
    centre: np.ndarray,
    focal_length: float | None = None,
    radius: float | None = None,
    outline: Outline | None = None,
    reflectance: BallReflectance = BallReflectance(),
    name: str = "picture",
    measured: bool = False,
) -> BallView:
    """Find the ball in a radiance map and place its view in the world.

    picture : radiance of the whole ball, with some of what is around it
    camera, centre : where the camera and the ball's centre were, metres, world; the horizon is level
    focal_length : pixels; taken from the ball's size and distance when unknown
    radius : the ball's, metres; needed only when the focal length is unknown
    outline : taken exactly as given, as from `outline_through` or `outline_of_circle`; the rim is sought and followed
        as an ellipse unless given. Only a ball that is picked so may be cut by the picture's edge
    reflectance : of the ball, divided out of what it shows; 1 unless given
    name : of the picture, for messages
    measured : whether radius and places are by tape measure, so that they say how large the ball is in the picture
    Raises BallNotFound; ValueError when neither focal length nor radius is given.
    """
    camera, centre = np.asarray(camera, np.float64), np.asarray(centre, np.float64)
    # The ball, where tape and lens expect it or anywhere.
    shown_light = _continued(picture)
    expected = None
    if measured and focal_length is not None and radius is not None:
        sine = min(radius / max(float(np.linalg.norm(camera - centre)), 1e-9), 0.99)
        expected = focal_length * sine / float(np.sqrt(1 - sine**2))
    found = find_outline(shown_light, name, focal_length, expected=expected) if outline is None else outline
    away = float(np.linalg.norm(camera - centre))
    lenses = _lenses(focal_length, found, picture.size, radius, away, measured, name)
    if lenses[0] is None:
        # The ellipse alone says how long the lens was.
        assert found.focal_length is not None
        lenses = [_fitted_lens(shown_light, found, found.focal_length, name)]
    if outline is None:
        # What was recognised only by whole profiles is where those are likeliest: edges led elsewhere.
        found = found if found.roughly else placed_rim(shown_light, found, lenses, expected)
        cut = found.cut(picture.size)
        if cut > MOST_CUT:
            circle = (*found.centre, found.radius)
            raise BallNotFound(
                f"{name}: the picture's edge cuts off {100 * cut:.0f} % of the ball; take it whole", (circle,),
                shown_light, f"or pick its rim with --pick {shown(circle)}, and what is cut off is filled in",
            )  # fmt: skip
    focal_length = lenses[0]
    assert focal_length is not None
    # What it does to colours.
    missing = missing_colour(shown_light, found)
    if missing is not None and max(reflectance.normal) < NEUTRAL * min(reflectance.normal):
        channel = ("red", "green", "blue")[missing[0]]
        warn(
            f"{name}: nothing in the ball is as {channel} as most of what is around it ({missing[1]:.2f} of it at "
            "most): a coloured ball colours the light; use a chromed one, or give its reflectance R,G,B",
            effect=1 - missing[1],
        )
    cone = cone_through(found.points, picture.size, focal_length)
    # The camera that looks straight at the ball, then turned in itself so that the ball lies where it is seen.
    straight = look_at(camera, centre) @ CAMERA_FROM_PIXELS
    world_from_pixels = straight @ rotation_between(cone.axis, np.array([0.0, 0.0, 1.0]))
    return BallView(picture, focal_length, cone.axis, cone.distance, world_from_pixels, found, reflectance)


def _lenses(
    focal_length: float | None, found: Outline, size: tuple[int, int], radius: float | None, away: float,
    measured: bool, name: str,
) -> list[float | None]:  # fmt: skip
    """The focal lengths by which the rim is placed, the picture's first: as known, by tape measure, or None, fitted."""
    from scipy.optimize import brentq

    if focal_length is not None:
        return [focal_length]
    if found.focal_length is not None and not (measured and radius is not None):
        return [None]
    if radius is None:
        raise ValueError(f"{name}: no focal length in its EXIF; give the ball's radius, so that it can be found")
    sine = radius / away
    if sine >= 1:
        raise ValueError(f"{name}: the given camera position is inside the ball; radius and places are in metres")

    def too_near(logarithm: float) -> float:
        return float(np.log(cone_through(found.points, size, float(np.exp(logarithm))).distance * sine))

    # In the picture's middle R = f·tan α; aside of it a ball is drawn larger, and the lens is shorter.
    lens = float(np.log(found.radius * np.sqrt(1 - sine**2) / sine))
    if too_near(lens - LONGER) < 0 < too_near(lens + LONGER):
        lens = float(brentq(too_near, lens - LONGER, lens + LONGER))  # pyright: ignore[reportArgumentType]
    # The tape may be a guess, and the picture a crop: a circle is followed too.
    return [float(np.exp(lens)), None]


def _fitted_lens(light: np.ndarray, found: Outline, focal_length: float, name: str) -> float:
    """The focal length that the ball's ellipse has, pixels, with a doubt where that leaves directions open."""
    lens, unsure = fitted_lens(light, found, focal_length)
    aside = float(np.hypot(found.centre[0] - light.shape[1] / 2, found.centre[1] - light.shape[0] / 2)) / lens
    turn = unsure * aside / (1 + aside**2)
    if turn > TURNED:
        warn(
            f"{name}: no focal length in its EXIF, and the shape of the ball gives {lens:.0f} pixels to "
            f"{100 * unsure:.0f} % only, which turns what it shows by up to {np.degrees(turn):.1f}°; give the "
            "ball's radius and distance by tape measure (--radius and --distance, in a shot file light.ball.radius "
            "and the camera of light.balls)",
            effect=turn,
        )
    return lens


def _continued(picture: RadianceMap) -> np.ndarray:
    """Radiance that goes on beyond every photograph, lest the border there be taken for a rim."""
    if picture.clipped is None or not np.any(picture.clipped == OUTSIDE) or np.all(picture.clipped == OUTSIDE):
        return picture.radiance
    rows, columns = distance_transform_edt(picture.clipped == OUTSIDE, return_distances=False, return_indices=True)  # pyright: ignore
    return picture.radiance[rows, columns]

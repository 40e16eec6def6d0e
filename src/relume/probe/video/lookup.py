"""Where in a film's frame each pixel of a map is seen: tables that are made once and serve all frames."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import cv2
import numpy as np

from relume.image.radiance import RadianceMap
from relume.probe.ball.probing import FAR
from relume.probe.ball.reflectance import BallReflectance
from relume.probe.ball.silhouette import outline_of_circle
from relume.probe.ball.unwrapping import CAMERA_FROM_PIXELS, MIXED, BallView
from relume.sphere.directions import look_at, normalised, rotation_about
from relume.sphere.inpainting import mean_by_distance
from relume.sphere.mappings.mapping import LatLong, continued_round, pixel_directions

Circle = tuple[float, float, float]
Point = tuple[float, float, float]
BESIDE = 1.15
"""Radii to each side of the ball that are cut out of a frame."""
BESIDE_EACH = np.ones((3, 3), np.uint8)
"""The pixels between which is looked up, wherever between them."""


class Lookup(Protocol):
    """Where a film's frame shows the directions of a lat-long map."""

    @property
    def seen(self) -> np.ndarray:
        """(H, 2H) bool, the pixels of the map that the frame shows."""
        ...

    def cut(self, frame: np.ndarray) -> np.ndarray:
        """The part of a frame (H, W, 3) that is looked at."""
        ...

    @property
    def gain(self) -> np.ndarray | None:
        """(H, 2H, 3) one over what a ball keeps of the light; None where it keeps all."""
        ...

    def to_map(self, part: np.ndarray) -> np.ndarray:
        """Such a part, with its values replaced by float32, as a map (H, 2H, …): the mean in each of its pixels."""
        ...

    def least(self, part: np.ndarray) -> np.ndarray:
        """The least of a part (h, w, 3) float32 that reaches into each pixel of the map by `to_map`: (H, 2H, 3)."""
        ...


@dataclass(frozen=True)
class BallPlace:
    """A mirrored ball and its camera.

    camera : the direction from the ball's centre to the camera, world, +Y up
    distance : from the camera to the ball's centre, in ball radii; 20 unless given, a metre for a ball of 5 cm
    angle : radians by which a facet of a multi-image filter sees the ball from aside: arctan of the distance between
        facets over the distance from lens to ball (Waese & Debevec 2001). 0 lays facets on one another by translation
        alone, which their sketch finds sufficient in practice
    reflectance : of the ball
    """

    camera: Point = (0.0, 0.0, 1.0)
    distance: float = FAR
    angle: float = 0.0
    reflectance: BallReflectance = BallReflectance()

    def __post_init__(self) -> None:
        if not self.distance > 1.5:
            raise ValueError(f"the camera is {self.distance:g} ball radii from the ball's centre; give 1.5 or more")
        if not abs(self.angle) < 0.5:
            raise ValueError(f"facets see the ball {self.angle:g} radians aside; expected less than 0.5, like 0.047")

    def view(self, circle: Circle, aside: tuple[float, float] = (0.0, 0.0)) -> BallView:
        """The ball as a facet sees it, in a picture of its own with the ball in the middle.

        circle : the rim in the frame, pixels
        aside : right and down, in units of `angle`, from where the facet sees the ball
        """
        radius = circle[2]
        side = 2 * int(np.ceil(BESIDE * radius))
        straight = look_at(normalised(self.camera), np.zeros(3)) @ CAMERA_FROM_PIXELS
        right, down, forward = straight.T
        offset = aside[0] * right + aside[1] * down
        if self.angle and np.any(offset):
            axis = np.cross(-forward, offset)
            straight = rotation_about(axis, float(np.linalg.norm(axis)) * self.angle) @ straight
        focal_length = radius * float(np.sqrt(self.distance**2 - 1))
        return BallView(
            RadianceMap(np.zeros((side, side, 3), np.float32)), focal_length, np.array([0.0, 0.0, 1.0]), self.distance,
            straight, outline_of_circle(side / 2, side / 2, radius), self.reflectance,
        )  # fmt: skip


@dataclass(frozen=True, eq=False)
class BallLookup:
    """A mirrored ball in a frame, unwrapped to a lat-long map.

    place : of the ball and its camera
    circle : its rim in the frame, (x, y, radius) pixels
    size : rows of the map
    aside : see `BallPlace.view`
    """

    place: BallPlace
    circle: Circle
    size: int
    aside: tuple[float, float] = (0.0, 0.0)

    @cached_property
    def _view(self) -> BallView:
        return self.place.view(self.circle, self.aside)

    @cached_property
    def _finer(self) -> int:
        """How many times finer than the map the ball is looked up, so that no pixel of it is left out."""
        finest = 2 / self.circle[2]  # radians across a pixel of the ball, which all take in 4/radius² sr
        return max(1, int(np.ceil(np.pi / self.size / finest)))

    @cached_property
    def _table(self) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray, np.ndarray | None]:
        """Places in the part as OpenCV takes them, where they are seen, and 1/reflectance where that is not 1."""
        view, rows = self._view, self.size * self._finer
        directions = pixel_directions(LatLong(), rows)
        x, y, incidence, gamma = view.places(directions, 0.0)
        outermost = 1 - np.sin(gamma) / (view.distance - np.cos(gamma)) * np.sqrt(view.distance**2 - 1)
        seen = (incidence > 0) & (outermost * self.circle[2] > MIXED)
        left, top = self._corner
        middle = view.picture.size[0] / 2
        x, y = (at - middle + of - 0.5 for at, of in ((x, self.circle[0] - left), (y, self.circle[1] - top)))
        maps = cv2.convertMaps(x.astype(np.float32), y.astype(np.float32), cv2.CV_16SC2)
        gain = None
        if min(self.place.reflectance.normal) < 1:
            gain = self._reduced((1 / self.place.reflectance.at(incidence)).astype(np.float32))
        return maps, self._reduced(seen.astype(np.float32)) > 0.999, gain

    @property
    def _corner(self) -> tuple[int, int]:
        half = int(np.ceil(BESIDE * self.circle[2]))
        return round(self.circle[0]) - half, round(self.circle[1]) - half

    @property
    def seen(self) -> np.ndarray:
        """(H, 2H) bool; not in the outermost pixel of the ball, which mixes it with what is behind it."""
        return self._table[1]

    @property
    def gain(self) -> np.ndarray | None:
        """(H, 2H, 3) one over the ball's reflectance."""
        return self._table[2]

    def cut(self, frame: np.ndarray) -> np.ndarray:
        """The square about the ball; beyond the frame's edge its last pixels go on."""
        left, top = self._corner
        side = 2 * int(np.ceil(BESIDE * self.circle[2]))
        height, width = frame.shape[:2]
        inside = frame[max(top, 0) : max(top + side, 0), max(left, 0) : max(left + side, 0)]
        before, beyond = (max(-top, 0), max(-left, 0)), (max(top + side - height, 0), max(left + side - width, 0))
        if not any(before + beyond):
            return np.ascontiguousarray(inside)
        return np.pad(inside, ((before[0], beyond[0]), (before[1], beyond[1]), (0, 0)), mode="edge")

    def to_map(self, part: np.ndarray) -> np.ndarray:
        """(H, 2H, …) float32, bilinear, the ball's reflectance still in it."""
        return self._reduced(cv2.remap(part, *self._table[0], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))

    def least(self, part: np.ndarray) -> np.ndarray:
        """(H, 2H, 3): none of the pixels between which it is looked up is less, but by how it fades."""
        fine = cv2.remap(cv2.erode(part, BESIDE_EACH), *self._table[0], cv2.INTER_LINEAR)
        finer = self._finer
        return fine if finer == 1 else fine.reshape(self.size, finer, 2 * self.size, finer, 3).min((1, 3))

    def _reduced(self, picture: np.ndarray) -> np.ndarray:
        if self._finer == 1:
            return picture
        return cv2.resize(picture, (2 * self.size, self.size), interpolation=cv2.INTER_AREA)


@dataclass(frozen=True)
class FrameLookup:
    """An equirectangular frame, as 360° cameras write it: its middle is −Z, and +X lies to its right.

    size : rows of the map
    """

    size: int

    @property
    def seen(self) -> np.ndarray:
        """Everything."""
        return np.ones((self.size, 2 * self.size), bool)

    @property
    def gain(self) -> np.ndarray | None:
        """None: nothing is mirrored."""
        return None

    def cut(self, frame: np.ndarray) -> np.ndarray:
        """The whole frame."""
        return frame

    def to_map(self, part: np.ndarray) -> np.ndarray:
        """(H, 2H, …) float32, the mean of the pixels that each pixel of the map covers."""
        if part.shape[0] == self.size:
            return part
        way = cv2.INTER_AREA if part.shape[0] > self.size else cv2.INTER_LINEAR
        return cv2.resize(part, (2 * self.size, self.size), interpolation=way)

    def least(self, part: np.ndarray) -> np.ndarray:
        """(H, 2H, 3): none of the pixels that each covers is less."""
        if part.shape[0] == self.size:
            return part
        reach = 2 * int(np.ceil(part.shape[0] / self.size / 2)) + 1
        least = cv2.erode(part, np.ones((reach, reach), np.uint8))
        return cv2.resize(least, (2 * self.size, self.size), interpolation=cv2.INTER_NEAREST)


@dataclass(frozen=True, eq=False)
class Continuation:
    """Fills what no take of a film shows from the rim of what they show, as `continued` does, by weights made once.

    seen : (H, 2H) bool
    """

    seen: np.ndarray
    weights: np.ndarray = field(init=False, repr=False)
    rim: np.ndarray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        kernel = np.ones((3, 3), np.uint8)
        around = continued_round(self.seen)
        near = cv2.dilate((~around).astype(np.uint8), kernel).astype(bool) & around
        rim = near[1:-1, 1:-1]
        weights = np.zeros((0, int(rim.sum())))
        if rim.any():
            directions = pixel_directions(LatLong(), len(self.seen))
            length = np.sqrt(LatLong().solid_angles(len(self.seen)))[rim]
            weights = mean_by_distance(
                directions[~self.seen], directions[rim], np.eye(int(rim.sum())), power=2, shares=length
            )
        object.__setattr__(self, "weights", weights.astype(np.float32))
        object.__setattr__(self, "rim", rim)

    def fill(self, radiance: np.ndarray) -> None:
        """Write what continues the map's seen pixels into its others."""
        if len(self.weights):
            radiance[~self.seen] = self.weights @ radiance[self.rim]

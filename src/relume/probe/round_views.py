"""Round pictures of nearly all around, joined into one map: fisheyes, and mirrors seen through a telecentric lens.

A telecentric lens sees along parallel rays. Then a mirrored ball and a parabolic mirror show every direction at a
radius that has a formula; what a parabola shows is seen from its focus alone (Nayar 1997).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.errors import warn
from relume.image.bilinear import bilinear
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

FINE = 2
"""Places a pixel of the map is looked up at, each way."""
FEATHER = 0.1
"""Radii inside the rim over which one view goes over into another: rims are the worst of every lens."""
LEAST = 1e-3
"""Share of its full weight that a view keeps at its very rim, so that no gap opens where views just meet."""
CLIPPED = 1e-6
"""Share of its weight that a clipped value keeps: it counts where no view measured the direction, and only there."""
OVERLAP = 100
"""Places that two views must both show, and not black, for their brightness to be compared."""
FLOOR = 1e-3
"""Of a view's median brightness, the least that is compared: black says nothing of how bright the other view is."""


class RoundLens(Protocol):
    """A frozen value: at which radius a direction is seen, 1 at the rim."""

    @property
    def ahead(self) -> bool:
        """Whether the middle shows what the camera looks at, as lenses do; mirrors show the camera there."""
        ...

    def radius(self, angle: np.ndarray) -> np.ndarray:
        """The radius of directions at these angles, radians, from what the middle shows."""
        ...


@dataclass(frozen=True)
class FisheyeLens:
    """A fisheye: r ∝ θ, or r ∝ sin(θ/2) where it is equisolid.

    field : the angle across, radians, up to 2π
    equisolid : equal areas are equal solid angles; most real fisheyes come near that
    ahead : whether the middle shows what the camera looks at, as lenses do; mirrors show the camera there
    """

    field: float = np.pi
    equisolid: bool = False
    ahead: bool = True

    def __post_init__(self) -> None:
        _require_field(self.field)

    def radius(self, angle: np.ndarray) -> np.ndarray:
        """The radius, 1 at the rim, at which an `angle` from the axis is seen, radians."""
        return np.sin(angle / 2) / np.sin(self.field / 4) if self.equisolid else 2 * angle / self.field

    def angle(self, radius: np.ndarray) -> np.ndarray:
        """The angle, radians, that is seen at a radius: the inverse."""
        if self.equisolid:
            return 2 * np.arcsin(np.clip(radius * np.sin(self.field / 4), 0, 1))
        return radius * self.field / 2


@dataclass(frozen=True)
class TelecentricBall:
    """A mirrored ball through a telecentric lens: r = sin(θ/2), all directions.

    ahead : whether the middle shows what the camera looks at, as lenses do; mirrors show the camera there
    """

    ahead: bool = False

    def radius(self, angle: np.ndarray) -> np.ndarray:
        """The radius, 1 at the rim, at which an `angle` from the axis is seen, radians."""
        return np.sin(angle / 2)


@dataclass(frozen=True)
class ParabolicMirror:
    """A parabolic mirror that bulges towards a telecentric lens: r ∝ tan(θ/2) (Nayar 1997).

    field : the angle across that it shows, radians: 2 acos((1 − q²)/(1 + q²)), q the mirror's radius over twice its
        focal length; π for one that is cut at the height of its focus
    ahead : whether the middle shows what the camera looks at, as lenses do; mirrors show the camera there
    """

    field: float = np.pi
    ahead: bool = False

    def __post_init__(self) -> None:
        _require_field(self.field)

    def radius(self, angle: np.ndarray) -> np.ndarray:
        """The radius, 1 at the rim, at which an `angle` from the axis is seen, radians."""
        return np.tan(np.minimum(angle, 3.1) / 2) / np.tan(min(self.field, 6.2) / 4)

    def angle(self, radius: np.ndarray) -> np.ndarray:
        """The angle, radians, that is seen at a radius: the inverse."""
        return 2 * np.arctan(radius * np.tan(min(self.field, 6.2) / 4))


@dataclass(frozen=True, eq=False)
class RoundView:
    """One round picture, of a fisheye or of a mirror.

    picture : the radiance map
    lens : which lens or mirror drew it
    centre, radius : of its rim, pixels from the upper left corner
    rotation : (3, 3) world-from-camera, as of `Camera`
    name : for messages
    """

    picture: RadianceMap
    lens: RoundLens
    centre: tuple[float, float]
    radius: float
    rotation: np.ndarray
    name: str = "view"

    def __post_init__(self) -> None:
        turn = np.asarray(self.rotation)
        if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-5) or np.linalg.det(turn) < 0:
            raise ValueError(f"the rotation is {turn.tolist()}; expected a 3×3 rotation matrix")
        if not 0 < self.radius < np.inf:
            raise ValueError(f"a rim of radius {self.radius}; expected pixels, above 0")

    def see(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The radiance (…, 3) in world directions (…, 3), how much it counts (…), and what is clipped (…) uint8.

        It counts 0 where the view does not show it, and next to nothing where it is clipped; codes of `RadianceMap`.
        """
        x, y, z = np.moveaxis(np.asarray(directions, np.float64) @ self.rotation, -1, 0)
        ring = np.hypot(x, y)
        radius = self.lens.radius(np.arctan2(ring, -z if self.lens.ahead else z))
        scale = self.radius * radius / np.maximum(ring, 1e-12)
        across, down = self.centre[0] + x * scale, self.centre[1] - y * scale
        width, height = self.picture.size
        shown = (radius <= 1) & (across >= 0) & (across <= width) & (down >= 0) & (down <= height)
        across, down = np.where(shown, across, 0.5), np.where(shown, down, 0.5)
        codes = self._clipped(across, down)
        shown &= codes != OUTSIDE
        weight = np.where(shown, np.clip((1 - radius) / FEATHER, LEAST, 1), 0.0) * np.where(codes == 0, 1, CLIPPED)
        return bilinear(self.picture.radiance, across, down), weight, np.where(shown, codes, OUTSIDE).astype(np.uint8)

    def _clipped(self, across: np.ndarray, down: np.ndarray) -> np.ndarray:
        """The code of places in the picture: the worst of the pixels that each lies between."""
        codes = np.zeros(across.shape, np.uint8)
        if self.picture.clipped is not None:
            for code in (BLACK, SATURATED, OUTSIDE):
                codes[bilinear((self.picture.clipped == code).astype(np.float32), across, down) > 0] = code
        return codes


@dataclass(frozen=True, eq=False)
class RoundProbe:
    """The light that round views show.

    light : a lat-long map, black where none shows anything; its `clipped` marks that as OUTSIDE, and what is clipped
        in every view that shows it
    seen : (H, W) share of each pixel that a view shows
    gains : (N,) by which each view was multiplied; 1 for the first
    """

    light: EnvironmentMap
    seen: np.ndarray
    gains: np.ndarray


def join_round_views(views: Sequence[RoundView], size: int = 512, *, balance: bool = True) -> RoundProbe:
    """Join round pictures from one place into a map, soft over a tenth of their radius.

    views : from one place, turned as `orient_round_views` found
    size : rows of the map
    balance : whether views are brought to the brightness of the first by what they both show
    What is clipped in one view comes from the others; what is clipped in all that show it is kept as it is, marked in
    the map's `clipped`. Raises ValueError without views; warns of what is clipped so, of what no view shows, and of
    views that have nothing in common with those before that is not black.
    """
    if not views:
        raise ValueError("no views were given; give at least one round picture")
    directions = pixel_directions(LatLong(), FINE * size)
    seen = [view.see(directions) for view in views]
    gains = _balanced([(radiance.sum(-1), weight) for radiance, weight, _ in seen]) if balance else np.ones(len(views))
    # Each direction from the views that show it.
    total = np.sum([weight for _, weight, _ in seen], axis=0)
    light = sum(radiance * (gain * weight)[..., None] for (radiance, weight, _), gain in zip(seen, gains, strict=True))
    shown = total > 0
    light = np.where(shown[..., None], light / np.where(shown, total, 1)[..., None], 0.0)
    light, share = (_reduced(plane) for plane in (light, shown.astype(np.float64)))
    if (missing := float(np.mean(share < 0.5))) > 0:
        warn(f"{missing:.1%} of the map's pixels are shown by no view; they are black", effect=missing)
    light = light / np.maximum(share, 1e-12)[..., None] * (share > 0)[..., None]
    # What none measured. A pixel of the map is as bad as the worst of its places.
    bounded = shown & np.all([codes != 0 for *_, codes in seen], axis=0)
    saturated, black = (
        _reduced((bounded & np.any([codes == code for *_, codes in seen], axis=0)).astype(np.float64)) > 0
        for code in (SATURATED, BLACK)
    )
    if saturated.any():
        warn(f"{saturated.mean():.2%} of the map's pixels are clipped in every view that shows them; their light is a "
             "lower bound: add shorter exposures")  # fmt: skip
    clipped = np.select([share == 0, saturated, black], [OUTSIDE, SATURATED, BLACK], 0).astype(np.uint8)
    light = EnvironmentMap(light.astype(np.float32), clipped=clipped if clipped.any() else None)
    return RoundProbe(light, share, gains)


def _balanced(seen: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """The gains (N,) that bring views, each its brightness and weight (…), to the brightness of the first."""
    gains = np.ones(len(seen))
    compared = [(weight > LEAST) & (light > _floor(light[weight > LEAST])) for light, weight in seen]
    for index in range(1, len(seen)):
        common = np.concatenate([
            np.log(gains[before] * seen[before][0][both] / seen[index][0][both])
            for before in range(index)
            if (both := compared[before] & compared[index]).any()
        ] or [np.zeros(0)])  # fmt: skip
        if len(common) < OVERLAP:
            warn(
                f"view {index + 1} has nothing in common with those before it that is not black; its brightness is "
                "left as it is"
            )
        else:
            gains[index] = float(np.exp(np.median(common)))
    return gains


def _floor(light: np.ndarray) -> float:
    """The brightness below which a view counts as black, from what it shows."""
    lit = light[light > 0]
    return FLOOR * float(np.median(lit)) if len(lit) else 0.0


def _reduced(plane: np.ndarray) -> np.ndarray:
    rows, columns = (n // FINE for n in plane.shape[:2])
    return plane.reshape(rows, FINE, columns, FINE, -1).mean((1, 3)).reshape(rows, columns, *plane.shape[2:])


def _require_field(field: float) -> None:
    if not 0 < field <= 2 * np.pi:
        raise ValueError(f"a field of {np.degrees(field):g}°; expected more than 0° and up to 360°")

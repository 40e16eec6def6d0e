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
from relume.image.radiance import RadianceMap
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

FINE = 2
"""Places a pixel of the map is looked up at, each way."""
FEATHER = 0.1
"""Radii inside the rim over which one view goes over into another: rims are the worst of every lens."""
LEAST = 1e-3
"""Share of its full weight that a view keeps at its very rim, so that no gap opens where views just meet."""
OVERLAP = 100
"""Places that two views must both show for their brightness to be compared."""


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
    """A fisheye: r ∝ θ, or r ∝ sin(θ/2) where `equisolid`; `field` is the angle across, radians, up to 2π."""

    field: float = np.pi
    equisolid: bool = False
    ahead: bool = True

    def __post_init__(self) -> None:
        _require_field(self.field)

    def radius(self, angle: np.ndarray) -> np.ndarray:
        """The radius, 1 at the rim."""
        return np.sin(angle / 2) / np.sin(self.field / 4) if self.equisolid else 2 * angle / self.field


@dataclass(frozen=True)
class TelecentricBall:
    """A mirrored ball through a telecentric lens: r = sin(θ/2), all directions."""

    ahead: bool = False

    def radius(self, angle: np.ndarray) -> np.ndarray:
        """The radius, 1 at the rim."""
        return np.sin(angle / 2)


@dataclass(frozen=True)
class ParabolicMirror:
    """A parabolic mirror that bulges towards a telecentric lens: r ∝ tan(θ/2) (Nayar 1997).

    field : the angle across that it shows, radians: 2 acos((1 − q²)/(1 + q²)), q the mirror's radius over twice its
        focal length; π for one that is cut at the height of its focus
    """

    field: float = np.pi
    ahead: bool = False

    def __post_init__(self) -> None:
        _require_field(self.field)

    def radius(self, angle: np.ndarray) -> np.ndarray:
        """The radius, 1 at the rim."""
        return np.tan(np.minimum(angle, 3.1) / 2) / np.tan(min(self.field, 6.2) / 4)


@dataclass(frozen=True, eq=False)
class RoundView:
    """One round picture.

    picture : the radiance map
    lens : which lens or mirror drew it
    centre, radius : of its rim, pixels from the upper left corner
    rotation : (3, 3) world-from-camera, as of `Camera`
    """

    picture: RadianceMap
    lens: RoundLens
    centre: tuple[float, float]
    radius: float
    rotation: np.ndarray

    def __post_init__(self) -> None:
        turn = np.asarray(self.rotation)
        if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-5) or np.linalg.det(turn) < 0:
            raise ValueError(f"the rotation is {turn.tolist()}; expected a 3×3 rotation matrix")
        if not 0 < self.radius < np.inf:
            raise ValueError(f"a rim of radius {self.radius}; expected pixels, above 0")

    def see(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The radiance (…, 3) in world directions (…, 3), and how much it counts (…), 0 where it is not shown."""
        x, y, z = np.moveaxis(np.asarray(directions, np.float64) @ self.rotation, -1, 0)
        ring = np.hypot(x, y)
        radius = self.lens.radius(np.arctan2(ring, -z if self.lens.ahead else z))
        scale = self.radius * radius / np.maximum(ring, 1e-12)
        across, down = self.centre[0] + x * scale, self.centre[1] - y * scale
        width, height = self.picture.size
        shown = (radius <= 1) & (across >= 0) & (across <= width) & (down >= 0) & (down <= height)
        weight = np.where(shown, np.clip((1 - radius) / FEATHER, LEAST, 1), 0.0)
        if self.picture.clipped is not None:
            weight = weight * (bilinear((self.picture.clipped != 0).astype(np.float32), across, down) == 0)
        return bilinear(self.picture.radiance, np.where(shown, across, 0.5), np.where(shown, down, 0.5)), weight


@dataclass(frozen=True, eq=False)
class RoundProbe:
    """The light that round views show.

    light : a lat-long map, black where none shows anything
    seen : (H, W) share of each pixel that a view shows
    gains : (N,) by which each view was multiplied; 1 for the first
    """

    light: EnvironmentMap
    seen: np.ndarray
    gains: np.ndarray


def join_round_views(views: Sequence[RoundView], size: int = 512, *, balance: bool = True) -> RoundProbe:
    """Join round pictures from one place into a map, soft over a tenth of their radius.

    size : rows of the map
    balance : whether views are brought to the brightness of the first by what they both show
    What is clipped in one view comes from the others. Raises ValueError without views; warns where no view shows
    something, and of views that have nothing in common with those before.
    """
    if not views:
        raise ValueError("no views were given; give at least one round picture")
    directions = pixel_directions(LatLong(), FINE * size)
    seen = [view.see(directions) for view in views]
    gains = np.ones(len(views))
    for index in range(1, len(views)) if balance else ():
        both = [(seen[before], before) for before in range(index)]
        ratios = [
            np.log(np.maximum(radiance, 1e-12).sum(-1) * gains[before] / np.maximum(seen[index][0], 1e-12).sum(-1))[
                (weight > LEAST) & (seen[index][1] > LEAST)
            ]
            for (radiance, weight), before in both
        ]
        common = np.concatenate(ratios)
        if len(common) < OVERLAP:
            warn(f"view {index + 1} has nothing in common with those before it; its brightness is left as it is")
        else:
            gains[index] = float(np.exp(np.median(common)))
    total = np.sum([weight for _, weight in seen], axis=0)
    light = sum(radiance * (gain * weight)[..., None] for (radiance, weight), gain in zip(seen, gains, strict=True))
    shown = total > 0
    light = np.where(shown[..., None], light / np.maximum(total, 1e-12)[..., None], 0.0)
    light, share = (_reduced(plane) for plane in (light, shown.astype(np.float64)))
    if (missing := float(np.mean(share < 0.5))) > 0:
        warn(f"{missing:.1%} of the map's pixels are shown by no view; they are black", effect=missing)
    light = light / np.maximum(share, 1e-12)[..., None] * (share > 0)[..., None]
    return RoundProbe(EnvironmentMap(light.astype(np.float32)), share, gains)


def _reduced(plane: np.ndarray) -> np.ndarray:
    rows, columns = (n // FINE for n in plane.shape[:2])
    return plane.reshape(rows, FINE, columns, FINE, -1).mean((1, 3)).reshape(rows, columns, *plane.shape[2:])


def _require_field(field: float) -> None:
    if not 0 < field <= 2 * np.pi:
        raise ValueError(f"a field of {np.degrees(field):g}°; expected more than 0 and up to 360, in radians")

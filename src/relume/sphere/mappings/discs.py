"""Mappings onto discs, whose polar angle θ from the disc's centre depends on the radius r alone; r = 1 at the rim."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from relume.sphere.mappings.mapping import refuse_size

_FULL_TURN = 2 * np.pi


class _Disc:
    """One disc that fills a square, equidistant, r ∝ θ, or equisolid, r ∝ sin(θ/2)."""

    pole: ClassVar[float] = -1.0
    """The z of the direction at the image's centre."""

    field: float = _FULL_TURN
    """The angle across the whole disc, radians."""
    equisolid: bool = False
    """Whether equal areas are equal solid angles."""

    def _angle(self, radius: np.ndarray) -> np.ndarray:
        """θ of r."""
        return 2 * np.arcsin(radius * np.sin(self.field / 4)) if self.equisolid else radius * self.field / 2

    def _radius(self, angle: np.ndarray) -> np.ndarray:
        """r of θ; above 1 where the disc does not show it."""
        return np.sin(angle / 2) / np.sin(self.field / 4) if self.equisolid else 2 * angle / self.field

    def _cap(self, squared: np.ndarray) -> np.ndarray:
        """1 − cos θ, of r²: the solid angle within r over 2π."""
        if self.equisolid:
            return 2 * squared * np.sin(self.field / 4) ** 2
        return 1 - np.cos(np.sqrt(squared) * self.field / 2)

    def shape(self, size: int) -> tuple[int, int]:
        refuse_size(size, "round")
        return size, size

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(np.asarray(directions, np.float64), -1, 0)
        ring = np.hypot(x, y)
        radius = self._radius(np.arctan2(ring, self.pole * z))
        radius = np.where(radius <= 1 + 1e-12, radius, np.nan)
        # At the two poles every azimuth is right; the first one is taken.
        scale = np.divide(radius, ring, out=np.zeros_like(ring), where=ring > 0)
        across = np.where(ring > 0, x * scale, radius)
        return np.stack([0.5 + across / 2, 0.5 - y * scale / 2], axis=-1)

    def directions(self, points: np.ndarray) -> np.ndarray:
        across, upward = 2 * points[..., 0] - 1, 1 - 2 * points[..., 1]
        radius = np.hypot(across, upward)
        angle = self._angle(np.where(radius <= 1, radius, np.nan))
        scale = np.divide(np.sin(angle), radius, out=np.zeros_like(radius), where=radius > 0)
        directions = np.stack([across * scale, upward * scale, self.pole * np.cos(angle)], axis=-1)
        return np.where((radius <= 1)[..., None], directions, np.nan)

    def shown(self, points: np.ndarray) -> np.ndarray:
        middle = points - 0.5
        # A hair within the rim, so that rounding leaves the point on the disc.
        return 0.5 + middle / np.maximum(2.000001 * np.linalg.norm(middle, axis=-1, keepdims=True), 1)

    def solid_angles(self, size: int) -> np.ndarray:
        # Green's theorem: ∬ sin θ dθ dψ = ∮ (1 − cos θ(r)) dψ round the pixel. Beyond the rim 1 − cos θ is a
        # constant, whose integral round a closed path is 0, so pixels outside get 0 and the rest sums to the disc's.
        # One quarter gives all four.
        nodes, weights = np.polynomial.legendre.leggauss(16)
        rows, _ = self.shape(size)
        edges = np.linspace(-1, 1, rows + 1)[rows // 2 :]
        along = edges[:-1, None] + (nodes + 1) / rows
        straight, moving = edges[:, None, None], along[None]
        squared = straight**2 + moving**2
        turn = straight / np.maximum(squared, 1e-300)
        # integral[e, k] walks cell k of the line `coordinate = edges[e]` upwards, counter-clockwise for a right edge.
        integral = (self._cap(np.minimum(squared, 1.0)) * turn * weights).sum(-1) / rows
        walked = integral[1:] - integral[:-1]
        inner_edge = np.maximum(edges[:-1], 0)
        nearest = inner_edge[:, None] ** 2 + inner_edge[None, :] ** 2
        quarter = np.where(nearest < 1 - 1e-12, np.maximum(walked + walked.T, 0.0), 0.0)
        inner = slice(rows % 2, None)  # the middle row and column of an odd number are no pair
        half = np.concatenate([quarter[inner][::-1], quarter])
        return np.concatenate([half[:, inner][:, ::-1], half], axis=1)


@dataclass(frozen=True)
class Angular(_Disc):
    """Debevec's angular map (light probe): the centre is −Z and the radius is the angle from it, r = acos(−z)/π."""

    name = "angular"


@dataclass(frozen=True)
class MirrorBall(_Disc):
    """A mirrored ball seen from far away on +Z: the centre reflects +Z, the rim −Z, θ = 2 asin r."""

    name = "ball"
    pole: ClassVar[float] = 1.0
    equisolid = True


@dataclass(frozen=True)
class Fisheye(_Disc):
    """The round image of a fisheye lens that looks along −Z: equidistant, r ∝ θ, or equisolid, r ∝ sin(θ/2).

    field : the angle across the whole disc, radians; π unless given, as most such lenses have
    equisolid : equal areas are equal solid angles; most real fisheyes come near that, while renderers and domes
        mean the equidistant one, which is the default

    Raises ValueError for a field that is not above 0 and up to 2π.
    """

    field: float = np.pi
    equisolid: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.field <= _FULL_TURN:
            raise ValueError(f"a fisheye of {np.degrees(self.field):g}°; expected more than 0 and up to 360")

    @property
    def name(self) -> str:
        """What a file remembers: fisheye, its projection and its angle in degrees."""
        # The shortest number that is read as this very field again.
        degrees = (f"{np.degrees(self.field):.{digits}g}" for digits in range(3, 18))
        exact = next(
            (text for text in degrees if np.radians(float(text)) == self.field), f"{np.degrees(self.field):.17g}"
        )
        return f"fisheye:{'equisolid' if self.equisolid else 'equidistant'}:{exact}"

    @classmethod
    def named(cls, text: str) -> Fisheye:
        """The fisheye of a name: fisheye, fisheye:160, fisheye:equisolid, fisheye:equisolid:160.

        text : the name, its angle in degrees
        Raises ValueError.
        """
        words = text.split(":")[1:]
        equisolid = words[:1] == ["equisolid"]
        if words[:1] in (["equisolid"], ["equidistant"]):
            words = words[1:]
        try:
            (degrees,) = map(float, words or ["180"])
        except ValueError:
            raise ValueError(
                f'"{text}" is not a fisheye; write fisheye:equidistant:DEGREES or fisheye:equisolid:DEGREES'
            ) from None
        return cls(float(np.radians(degrees)), equisolid)


@dataclass(frozen=True)
class _Orthographic(_Disc):
    """A hemisphere projected along z onto its rim's plane, r = sin θ."""

    def _angle(self, radius: np.ndarray) -> np.ndarray:
        return np.arcsin(radius)

    def _radius(self, angle: np.ndarray) -> np.ndarray:
        return np.sin(angle)

    def _cap(self, squared: np.ndarray) -> np.ndarray:
        return 1 - np.sqrt(1 - squared)


@dataclass(frozen=True)
class Hemispheres:
    """Two hemispheres projected along z, side by side (Miller & Hoffman 1984, §4.2): z < 0 left, z ≥ 0 right.

    x is to the right and y up in both, as the paper prints it; so the right disc, unlike the left, shows its half as
    seen from outside.
    """

    name = "hemispheres"
    grid = (1, 2)

    def shape(self, size: int) -> tuple[int, int]:
        """Rows and columns, (size, 2·size); raises ValueError for fewer than one row."""
        refuse_size(size, self.name)
        return size, 2 * size

    def image_points(self, directions: np.ndarray) -> np.ndarray:
        """Where unit directions (…, 3) fall in the image: (…, 2)."""
        directions = np.asarray(directions, np.float64)
        behind = directions[..., 2] >= 0
        u, v = 0.5 + directions[..., 0] / 2, 0.5 - directions[..., 1] / 2
        return np.stack([(u + behind) / 2, v], axis=-1)

    def directions(self, points: np.ndarray) -> np.ndarray:
        """The unit directions (…, 3) of image points (…, 2)."""
        behind, within = self._parted(points)
        directions = _Orthographic().directions(within)
        directions[..., 2] = np.where(behind, -directions[..., 2], directions[..., 2])
        return directions

    def shown(self, points: np.ndarray) -> np.ndarray:
        """The points (…, 2), drawn to the nearest rim where they lie beside the two discs."""
        behind, within = self._parted(points)
        within = _Orthographic().shown(within)
        return np.stack([(within[..., 0] + behind) / 2, within[..., 1]], axis=-1)

    def solid_angles(self, size: int) -> np.ndarray:
        """Steradians of every pixel of an image of `size` rows, (rows, columns); they sum to 4π."""
        disc = _Orthographic().solid_angles(size)
        return np.concatenate([disc, disc], axis=1)

    def _parted(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether points lie in the right half, and where in their own half."""
        behind = points[..., 0] >= 0.5
        return behind, np.stack([2 * points[..., 0] - behind, points[..., 1]], axis=-1)

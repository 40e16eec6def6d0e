"""Clothes of any colour from two takes of a subject, in white and in black (Debevec et al. 2000, §3.4, Fig. 7).

White minus black is the light that comes by way of the cloth: seen on it, and thrown by it onto face and neck. Times a
tint, and added to the black take, it is the light by way of another cloth. The tint is where the wanted albedo stands
between black and white, (ρ − ρ_black) / (ρ_white − ρ_black), by channel: what a cloth throws is linear in its albedo
as long as light that it throws twice is left out. Colours are linear Rec. 709.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import gaussian_filter
from scipy.ndimage import shift as shifted

from relume.errors import warn
from relume.image.radiance import SATURATED, RadianceMap
from relume.lightstage.field.field import Derived, Noise, ReflectanceField
from relume.lightstage.relighting.relighting import weighted_sum

MOVED = 0.5
"""Pixels between two takes from which on their difference is edges rather than cloth; it is measured to 0.2 or so."""
_ROUNDS = 30
_REACH = 6


@dataclass(frozen=True)
class ClothAlbedos:
    """What the two takes were worn in: diffuse albedo, one number or (R, G, B).

    white : 0.8 unless given, as clean cotton nearly is
    black : 0.03 unless given, as a black cotton shirt nearly is
    """

    white: float | tuple[float, float, float] = 0.8
    black: float | tuple[float, float, float] = 0.03

    def __post_init__(self) -> None:
        white, black = np.broadcast_to(self.white, 3), np.broadcast_to(self.black, 3)
        if not (np.all(black >= 0) and np.all(white > black) and np.all(white <= 1)):
            raise ValueError(
                f"the white cloth's albedo is {self.white} and the black one's {self.black}; expected 0 ≤ black < "
                "white ≤ 1"
            )

    def tint(self, albedo: ArrayLike) -> np.ndarray:
        """What white minus black is multiplied with for a cloth of this albedo: (3,); 0 for black and 1 for white.

        albedo : one number or (R, G, B), from 0 to 1
        Warns where it is brighter than the white cloth or darker than the black one: the takes are then extrapolated.
        """
        wanted = np.asarray(albedo, np.float64)
        if wanted.shape not in ((), (3,)) or not np.all((wanted >= 0) & (wanted <= 1)):
            raise ValueError(f"a cloth of albedo {wanted.tolist()}; expected R, G and B from 0 to 1")
        white, black = np.broadcast_to(self.white, 3), np.broadcast_to(self.black, 3)
        tint = (np.broadcast_to(wanted, 3) - black) / (white - black)
        if np.any(tint > 1 + 1e-9) or np.any(tint < -1e-9):
            warn(
                f"a cloth of albedo {wanted.tolist()} lies outside the two that were worn, {self.black} to "
                f"{self.white}; its light is extrapolated"
            )
        return tint


def recolour_clothing(black: RadianceMap, white: RadianceMap, tint: ArrayLike) -> RadianceMap:
    """The picture in another cloth: black + tint · (white − black).

    black, white : of one camera, under one light
    tint : (3,), as `ClothAlbedos.tint` makes it
    Variance is carried where both takes have it; a pixel that is saturated in either is so in the result.
    Source: Debevec et al. 2000, §3.4 and Fig. 7. Raises ValueError for takes of two sizes or units. Warns where the
    subject moved between them.
    """
    if black.radiance.shape != white.radiance.shape or black.unit != white.unit:
        raise ValueError(
            f"the takes are {black.size[0]}×{black.size[1]} {black.unit} and {white.size[0]}×{white.size[1]} "
            f"{white.unit}; expected two of one camera"
        )
    share = _share(tint)
    _warn_moved(displacement(black.radiance, white.radiance))
    variance = clipped = None
    if black.variance is not None and white.variance is not None:
        variance = (1 - share) ** 2 * black.variance + share**2 * white.variance
    if black.clipped is not None or white.clipped is not None:
        marks = [take.clipped for take in (black, white) if take.clipped is not None]
        clipped = np.where(np.any([mark == SATURATED for mark in marks], axis=0), SATURATED, np.max(marks, axis=0))
        clipped = clipped.astype(np.uint8)
    mixed = _mixed(black.radiance, white.radiance, share)
    return replace(black, radiance=mixed, variance=variance, clipped=clipped)


@dataclass(frozen=True, eq=False)
class RecolouredField(Derived):
    """A reflectance field in another cloth, made of two fields as it is asked for; see `recolour_field`.

    field, white : the takes in black and in white, of one camera and the same lights
    tint : (3,)
    """

    field: ReflectanceField
    white: ReflectanceField
    tint: np.ndarray

    def __post_init__(self) -> None:
        _share(self.tint)
        if self.field.shape != self.white.shape:
            raise ValueError(f"the takes are {self.field.shape} and {self.white.shape}; expected two of one camera")
        ours, theirs = self.field.lights, self.white.lights
        if len(ours) != len(theirs) or np.min(np.sum(ours.directions * theirs.directions, axis=1)) < np.cos(0.01):
            raise ValueError(
                f"the takes have {len(ours)} and {len(theirs)} lights, or they stand elsewhere; expected the same in "
                "the same order"
            )

    @property
    def noise(self) -> Noise | None:
        """The takes' variances, each by the square of its share, in the channel where they are most.

        None where a take's is unknown, and outside the two cloths. Of R = (1 − t) B + t W a share's photons give
        (1 − t)² B s_B + t² W s_W ≤ max((1 − t) s_B, t s_W) · R, which is what is given.
        """
        black, white = self.field.noise, self.white.noise
        if black is None or white is None or np.any(self.tint < 0) or np.any(self.tint > 1):
            return None
        return Noise(
            float(((1 - self.tint) ** 2 * black.constant + self.tint**2 * white.constant).max()),
            float(np.maximum((1 - self.tint) * black.slope, self.tint * white.slope).max()),
        )

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        return _mixed(self.field.block(lights, rows), self.white.block(lights, rows), self.tint)


def recolour_field(black: ReflectanceField, white: ReflectanceField, tint: ArrayLike) -> RecolouredField:
    """The field in another cloth: black + tint · (white − black), light by light, when it is asked for.

    black, white : the takes, of one camera and one stage
    tint : (3,), as `ClothAlbedos.tint` makes it
    Raises ValueError for fields of two sizes or of other lights. Warns where the subject moved between the takes, as
    seen in the sum of their pictures.
    """
    field = RecolouredField(black, white, _share(tint))
    _warn_moved(displacement(_summed(black), _summed(white)))
    return field


def displacement(black: np.ndarray, white: np.ndarray) -> float:
    """By how many pixels the subject of the second picture (H, W, 3) is displaced from that of the first.

    The shift under which the logarithms' fine detail differs least, where both have edges: the best of whole pixels up
    to six, then least squares on gradients (Lucas & Kanade 1981). Pixels that changed otherwise, like the cloth, weigh
    little in either. 0 where there are no edges.
    """
    first, second = (_detail(picture) for picture in (black, white))
    strength = np.hypot(*np.gradient(first))
    inside = np.zeros(first.shape, bool)
    inside[_REACH:-_REACH, _REACH:-_REACH] = True
    inside &= strength > 1e-3
    if not inside.any():
        return 0.0
    edges = inside & (strength >= np.quantile(strength[inside], 0.7))
    noise = 1.4826 * float(np.median(np.abs(first[edges]))) + 1e-6
    reach = range(-_REACH, _REACH + 1)

    def cost(shift: tuple[int, int]) -> float:
        square = np.square((np.roll(second, (-shift[0], -shift[1]), (0, 1)) - first)[edges] / noise)
        return float((square / (1 + square)).mean())

    shift = np.array(min(((down, across) for down in reach for across in reach), key=cost), np.float64)
    for _ in range(_ROUNDS):
        moved = shifted(second, -shift, order=3, mode="nearest")
        difference = (moved - first)[edges]
        scale = 1.4826 * float(np.median(np.abs(difference))) + 1e-6
        weight = 1 / np.square(1 + np.square(difference / (3 * scale)))
        slope = np.stack([np.gradient(0.5 * (first + moved), axis=axis)[edges] for axis in (0, 1)], axis=-1)
        normal = slope.T @ (slope * weight[:, None])
        if np.linalg.cond(normal) > 1e8:
            break
        step = np.linalg.solve(normal, slope.T @ (weight * difference))
        shift = shift - np.clip(step, -0.5, 0.5)
        if np.abs(step).max() < 1e-3:
            break
    return float(np.linalg.norm(shift))


def _share(tint: ArrayLike) -> np.ndarray:
    share = np.asarray(tint, np.float64)
    if share.shape != (3,) or not np.all(np.isfinite(share)):
        raise ValueError(f"the tint is {share.tolist()}; expected R, G and B, as ClothAlbedos.tint gives it")
    return share


def _mixed(black: np.ndarray, white: np.ndarray, tint: np.ndarray) -> np.ndarray:
    """Never below 0, which noise would leave where the white take happens to be the darker one."""
    share = tint.astype(np.float32)
    return np.maximum(black + share * (white - black), np.minimum(np.minimum(black, white), 0))


def _summed(field: ReflectanceField) -> np.ndarray:
    """The subject under all lights at once, (H, W, 3)."""
    return weighted_sum(field, np.repeat(field.lights.solid_angles[:, None], 3, axis=1)).radiance


def _detail(picture: np.ndarray) -> np.ndarray:
    """The logarithm of a picture without what is smooth in it, (H, W): light that changes smoothly leaves it alone."""
    mean = np.maximum(picture.mean(axis=-1, dtype=np.float64), 0)
    positive = mean[mean > 0]
    logarithm = np.log(mean + (0.05 * float(np.median(positive)) if positive.size else 1.0))
    return gaussian_filter(logarithm, 0.7) - gaussian_filter(logarithm, 4.0)


def _warn_moved(pixels: float) -> None:
    if pixels > MOVED:
        warn(
            f"the subject moved by about {pixels:.1f} pixels between the takes; what they differ in is then edges too: "
            "align them, or take them again"
        )

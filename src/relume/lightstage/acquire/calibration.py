"""The colour and intensity of each light of a stage, from a matte target of known reflectance in its pictures.

A Lambertian surface of reflectance ρ and normal n sends back L = ρ/π · E · n·l of the irradiance E that light l gives a
surface that faces it. The paper normalises "the reflectance functions based on the light source color" (Debevec et al.
2000, §3.3): a picture times `gains` is what it would be under irradiance 1. World frame; E is in the pictures' unit,
as one white, diffuse pixel that faces the light and reads 1/π is E = 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.errors import warn
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised

GRAZING = np.radians(80)
"""From here on, measured from the normal, a light does not count: a degree's error of a normal would be a tenth."""
_FEWEST_PIXELS = 4
_OUTLIER = 3.0
_ROUNDS = 5


@dataclass(frozen=True, eq=False)
class Target:
    """A matte white or grey thing in the pictures.

    pixels : (H, W) bool, where it is seen; keep a pixel away from its edge
    reflectance : ρ, of all channels or (3,); 0.18 grey card, 0.9 white board
    normals : (3,) of a flat target or (H, W, 3), world, unit; None where unknown: `calibrate` then finds it
    """

    pixels: np.ndarray
    reflectance: float | tuple[float, float, float]
    normals: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.pixels.ndim != 2 or self.pixels.dtype != bool or self.pixels.sum() < _FEWEST_PIXELS:
            raise ValueError(
                f"the target is {int(np.sum(self.pixels))} pixels of {self.pixels.shape} {self.pixels.dtype}; expected "
                f"a bool mask (H, W) of at least {_FEWEST_PIXELS}"
            )
        reflectance = np.asarray(self.reflectance, np.float64)
        if reflectance.shape not in ((), (3,)) or not ((reflectance > 0) & (reflectance <= 1)).all():
            raise ValueError(f"a reflectance of {self.reflectance}; expected one or three numbers above 0, at most 1")
        if self.normals is not None and self.normals.shape not in ((3,), (*self.pixels.shape, 3)):
            raise ValueError(f"normals are {self.normals.shape}; expected (3,) or {(*self.pixels.shape, 3)}")


@dataclass(frozen=True, eq=False)
class Calibration:
    """What each light gives.

    irradiances : (N, 3) float64, on a surface that faces the light, in the unit of the pictures
    measured : (N,) bool; False where the light does not reach the target, or something shades it, and the irradiance
        of the lights around stands in
    deviations : (N,) float64, how far target pixels are from Lambert's law, root mean square over mean; NaN where not
        measured
    """

    irradiances: np.ndarray
    measured: np.ndarray
    deviations: np.ndarray

    @property
    def gains(self) -> np.ndarray:
        """(N, 3) float64, times which a picture is as under irradiance 1 in every channel."""
        return 1 / self.irradiances


def target_on_ball(
    camera: Camera, centre: np.ndarray, radius: float, reflectance: float | tuple[float, float, float]
) -> Target:
    """A matte ball as a target: its pixels and normals as the camera sees them.

    camera : the stage's, world, metres
    centre, radius : of the ball, world, metres
    reflectance : of the ball, 0 to 1
    The rim, seen at more than 80° from its normal, is left out. Raises ValueError where the camera is within
    the ball or does not see it.
    """
    rays = camera.rays()
    offset = camera.position - np.asarray(centre, np.float64)
    if radius <= 0 or np.linalg.norm(offset) <= radius:
        raise ValueError(f"a ball of radius {radius} around {np.asarray(centre).tolist()}, but the camera is within it")
    along = rays @ offset
    depth = along**2 - (offset @ offset - radius**2)
    distance = -along - np.sqrt(np.maximum(depth, 0))
    normals = (offset + distance[..., None] * rays) / radius
    facing = -(normals * rays).sum(axis=-1)
    seen = (depth > 0) & (distance > 0) & (facing > np.cos(GRAZING))
    if not seen.any():
        raise ValueError(f"the camera does not see a ball of radius {radius} around {np.asarray(centre).tolist()}")
    return Target(seen, reflectance, np.where(seen[..., None], normals, 0.0))


def calibrate(field: ReflectanceField, target: Target, *, deviation: float = 0.25) -> Calibration:
    """The irradiance that each light gives, from how bright the target is under it.

    Where a light is farther than 80° from every normal of the target, or the target is dark or shaded under it, the
    irradiance of the lights around stands in, and a warning names such lights. Of a target without normals the normal
    is found, as of a flat one. Highlights and shadows on less than half of the target do not count.

    field : the stage's pictures
    target : a card or a ball of known reflectance in them
    deviation : from Lambert's law, from which on the target counts as shaded. A quarter, as pixels of a rendered ball
        deviate by 0.03 where it is lit and by 0.28 or more where a head shades it. Raise it for pictures noisier than
        that
    Raises ValueError for a target of another size than the pictures and where no light reaches it.
    """
    readings, inside = _readings(field, target)
    if target.normals is None:
        normals = normal_of_flat_target(field.lights, np.median(readings, axis=1).mean(axis=1))
    else:
        normals = normalised(target.normals if target.normals.ndim == 1 else target.normals[target.pixels])
    reflectance = np.broadcast_to(np.asarray(target.reflectance, np.float64), (3,))
    irradiances, deviations = np.full((len(field.lights), 3), np.nan), np.full(len(field.lights), np.nan)
    for light, direction in enumerate(field.lights.directions):
        cosines = np.broadcast_to(normals @ direction, inside)
        reached = cosines > np.cos(GRAZING)
        if reached.sum() >= _FEWEST_PIXELS:
            slope, deviations[light] = _robust_slope(readings[light][reached], cosines[reached])
            irradiances[light] = np.pi * slope / reflectance
    measured = (np.nan_to_num(irradiances) > 0).all(axis=1) & (np.nan_to_num(deviations, nan=np.inf) <= deviation)
    if not measured.any():
        raise ValueError(
            "no light reaches the target from less than 80 degrees, unshaded; check its normals and its pixels"
        )
    if not measured.all():
        missing = np.flatnonzero(~measured)
        warn(
            f"{len(missing)} of {len(measured)} lights do not reach the target, or it is shaded, the first is "
            f'"{field.lights.names[missing[0]]}"; the irradiance of the lights around stands in'
        )
    return Calibration(
        _completed(field.lights, irradiances, measured), measured, np.where(measured, deviations, np.nan)
    )


def normal_of_flat_target(lights: StageLights, radiances: np.ndarray) -> np.ndarray:
    """The normal (3,) of a flat matte target from its mean radiance (N,) under each light.

    The lights are taken to be of one intensity: brightness alone does not separate a weak light from a grazing one;
    some that are not, less than half, do not count. Raises ValueError where fewer than four lights reach it.
    """
    lit = radiances > 0.05 * radiances.max()
    if lit.sum() < _FEWEST_PIXELS:
        raise ValueError(f"{int(lit.sum())} lights reach the target; its normal takes at least {_FEWEST_PIXELS}")
    kept = np.flatnonzero(lit)
    for _ in range(_ROUNDS):
        normal = np.linalg.lstsq(lights.directions[kept], radiances[kept], rcond=None)[0]
        foretold = lights.directions @ normal
        misfit = np.abs(radiances - foretold)
        # Shaded lights obey no line: only those that the plane faces are compared with it.
        facing = np.flatnonzero(lit & (foretold > np.cos(GRAZING) * np.linalg.norm(normal)))
        limit = _OUTLIER * 1.4826 * np.median(misfit[facing]) + 1e-9 * radiances.max() if len(facing) else 0
        kept = facing[misfit[facing] <= limit]
        if len(kept) < _FEWEST_PIXELS:
            raise ValueError("the lights do not determine the normal of the target; give it")
    return normalised(normal)


def _readings(field: ReflectanceField, target: Target) -> tuple[np.ndarray, int]:
    """The target's pixels (N, P, 3) under each light, and P; one picture in memory at a time."""
    if target.pixels.shape != field.shape:
        raise ValueError(f"the target's mask is {target.pixels.shape}; expected the pictures' {field.shape}")
    seen = np.flatnonzero(target.pixels.any(axis=1))
    rows = slice(int(seen[0]), int(seen[-1]) + 1)
    inside = target.pixels[rows]
    readings = np.stack(
        [field.block(slice(i, i + 1), rows)[0][inside].astype(np.float64) for i in range(len(field.lights))]
    )
    if not np.isfinite(readings).all():
        raise ValueError("a pixel of the target is not a finite number; leave it out of its mask")
    return readings, readings.shape[1]


def _robust_slope(radiances: np.ndarray, cosines: np.ndarray) -> tuple[np.ndarray, float]:
    """The slope (3,) of radiances (P, 3) over cosines (P,), and the relative misfit of the pixels kept.

    Least squares through the origin over the pixels that Lambert's law explains: starting from the median slope, those
    beyond three deviations leave, as highlights and shadows do.
    """
    grey = radiances.mean(axis=1)
    kept = np.ones(len(grey), bool)
    slope = np.median(grey / cosines)
    for _ in range(_ROUNDS):
        misfit = np.abs(grey - slope * cosines)
        kept = misfit <= _OUTLIER * 1.4826 * np.median(misfit) + 1e-9 * np.abs(grey).max()
        slope = (grey[kept] @ cosines[kept]) / (cosines[kept] @ cosines[kept])
    channels = cosines[kept] @ radiances[kept] / (cosines[kept] @ cosines[kept])
    misfit = grey[kept] - slope * cosines[kept]
    mean = np.abs(grey[kept]).mean()
    return channels, float(np.sqrt(np.mean(misfit**2)) / mean) if mean > 0 else np.nan


def _completed(lights: StageLights, irradiances: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Irradiances (N, 3) with those of unmeasured lights from the four measured ones nearest to them.

    Their geometric mean, weighted by the inverse of the squared angle: intensities differ by factors.
    """
    result = irradiances.copy()
    known = np.flatnonzero(measured)
    for light in np.flatnonzero(~measured):
        angles = np.arccos(np.clip(lights.directions[known] @ lights.directions[light], -1, 1))
        nearest = np.argsort(angles, kind="stable")[:4]
        weights = 1 / angles[nearest] ** 2
        result[light] = np.exp(weights @ np.log(irradiances[known[nearest]]) / weights.sum())
    return result

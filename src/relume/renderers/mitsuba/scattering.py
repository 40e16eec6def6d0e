"""Where a surface scatters light to: the values of the very surfaces that are rendered, for plots of them.

The frame is that of the surface: x along u, y up in the picture, z the normal. Images are taken at their middle, and
what fills a body is left out. A surface in Mitsuba is asked as light from a lamp meets it, so that light that is bent
into glass is counted by its energy.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from relume.errors import UnsupportedScene
from relume.renderers.mitsuba.materials import bsdf
from relume.renderers.mitsuba.path_tracer import _mitsuba
from relume.scene.materials.reflective import Reflective
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.shapes.shapes import AnyMaterial

SAMPLES = 1 << 13
"""Directions drawn for an albedo, about: a grid of them errs by a few thousandths."""
_SMOOTH = 0.002
"""Between directions that are one smooth ray."""


@dataclass(frozen=True, eq=False)
class Scattering:
    """A surface and what light from some directions does at it.

    values : (L, V, 3) f·cos θv in 1/sr towards the directions asked for
    reflected : (L, 3) what is seen of even light from these directions, by its radiance; smooth rays included
    transmitted : (L, 3) share of the light that goes through
    smooth : for each direction of light its mirrored and refracted rays, (direction (3,), share (3,)); none where rough
    """

    values: np.ndarray
    reflected: np.ndarray
    transmitted: np.ndarray
    smooth: tuple[tuple[tuple[np.ndarray, np.ndarray], ...], ...]


def scattering(material: AnyMaterial, lights: np.ndarray, views: np.ndarray, seed: int = 0) -> Scattering:
    """What light from `lights` (L, 3) does at a surface, towards `views` (V, 3), unit vectors in its frame.

    Raises UnsupportedScene for materials that are reflection maps' or Whitted's alone, and as the renders do.
    """
    require_brdf(material)
    lights, views = np.asarray(lights, np.float32), np.asarray(views, np.float32)
    with _mitsuba(None, None) as mi:
        surface = mi.load_dict({"type": "sphere", "bsdf": bsdf(mi, material, media=True)}).bsdf()
        values = _values(mi, surface, np.repeat(lights, len(views), axis=0), np.tile(views, (len(lights), 1)))
        numbers = _numbers(seed)
        each = np.repeat(lights, len(numbers), axis=0)
        numbers = np.tile(numbers, (len(lights), 1))
        bent = _drawn(mi, surface, mi.TransportMode.Importance, each, numbers)
        # Layers share light out by where it is seen from (decision 44): what is seen is never more than comes in.
        seen = _drawn(mi, surface, mi.TransportMode.Radiance, each, numbers)
    count = len(lights)
    weight, towards, is_smooth = (array.reshape(count, -1, *array.shape[1:]) for array in bent)
    through = (weight * (towards[..., 2:] * lights[:, None, 2:] < 0)).mean(axis=1)
    smooth = tuple(map(_rays, weight, towards, is_smooth))
    weight, towards = (array.reshape(count, -1, 3) for array in seen[:2])
    back = (weight * (towards[..., 2:] * lights[:, None, 2:] > 0)).mean(axis=1)
    return Scattering(values.reshape(count, len(views), 3), back, through, smooth)


def require_brdf(material: AnyMaterial) -> None:
    """Raises UnsupportedScene for a material that other renderers shade by no BRDF."""
    if isinstance(material, Reflective | WhittedMaterial):
        raise UnsupportedScene(
            f"{type(material).__name__} {material.name!r} has no BRDF that could be drawn; use a diffuse, pbr, ward or "
            "measured material"
        )


def _interaction(mi: Any, found: Any, light: Any) -> Any:
    """A place whose normal is z, met by light from a direction."""
    found.wi, found.uv = light, mi.Point2f(0.5, 0.5)
    # Normal maps turn directions through the frames of the place.
    found.sh_frame, found.n = mi.Frame3f(mi.Normal3f(0, 0, 1)), mi.Normal3f(0, 0, 1)
    found.dp_du, found.dp_dv = mi.Vector3f(1, 0, 0), mi.Vector3f(0, 1, 0)
    return found


def _each(mi: Any, lights: np.ndarray) -> list[Any]:
    """Interactions of the scalar variant, one a light."""
    return [_interaction(mi, mi.SurfaceInteraction3f(), mi.Vector3f(*map(float, light))) for light in lights]


def _together(mi: Any, lights: np.ndarray) -> Any:
    """All interactions as one of a Dr.Jit variant."""
    import drjit

    return _interaction(mi, drjit.zeros(mi.SurfaceInteraction3f, len(lights)), _vectors(mi, lights))


def _vectors(mi: Any, rows: np.ndarray) -> Any:
    return mi.Vector3f(*(np.ascontiguousarray(axis) for axis in rows.T))


def _values(mi: Any, surface: Any, lights: np.ndarray, views: np.ndarray) -> np.ndarray:
    """f·cos θ (N, 3) of pairs of directions."""
    context = mi.BSDFContext(mi.TransportMode.Importance)
    if "_ad_" in mi.variant():
        return _rows(surface.eval(context, _together(mi, lights), _vectors(mi, views)), len(views))
    pairs = zip(_each(mi, lights), views, strict=True)
    return np.array([np.array(surface.eval(context, one, mi.Vector3f(*map(float, view)))) for one, view in pairs])


def _numbers(seed: int) -> np.ndarray:
    """(N, 3) float32 random numbers, the last two over a jittered grid, the first in another order."""
    side = round(SAMPLES**0.5)
    generator = np.random.default_rng([seed, 17])
    across, along = np.meshgrid(np.arange(side), np.arange(side))
    pair = (np.stack([across.ravel(), along.ravel()]) + generator.random((2, side**2))) / side
    choice = (generator.permutation(side**2) + generator.random(side**2)) / side**2
    return np.minimum(np.stack([choice, *pair], axis=-1), np.float32(1 - 2**-24)).astype(np.float32)


def _drawn(
    mi: Any, surface: Any, mode: Any, lights: np.ndarray, numbers: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Weights (N, 3), directions (N, 3) and whether they are of smooth rays (N,)."""
    context, count = mi.BSDFContext(mode), len(lights)
    if "_ad_" in mi.variant():
        choice, u, v = (np.ascontiguousarray(axis) for axis in numbers.T)
        drawn, factor = surface.sample(context, _together(mi, lights), mi.Float(choice), mi.Point2f(u, v))
        weight, towards = _rows(factor, count), _rows(drawn.wo, count)
        kinds = np.broadcast_to(np.array(drawn.sampled_type), (count,))
    else:
        found = [
            surface.sample(context, one, float(choice), mi.Point2f(float(u), float(v)))
            for one, (choice, u, v) in zip(_each(mi, lights), numbers, strict=True)
        ]
        weight = np.array([np.array(factor) for _, factor in found])
        towards = np.array([np.array(drawn.wo) for drawn, _ in found])
        kinds = np.array([int(drawn.sampled_type) for drawn, _ in found])
    return weight, towards, (kinds & int(mi.BSDFFlags.Delta)) != 0


def _rays(weight: np.ndarray, towards: np.ndarray, is_smooth: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """The few directions that smooth surfaces send light to, each with its share."""
    found = []
    left = is_smooth & (weight.max(axis=1) > 0)
    while left.any():
        direction = towards[np.argmax(left)]
        same = left & (np.linalg.norm(towards - direction, axis=1) < _SMOOTH)
        found.append((direction, (weight * same[:, None]).mean(axis=0)))
        left &= ~same
    return tuple(found)


def _rows(array: Any, count: int) -> np.ndarray:
    """(count, 3), whichever way Dr.Jit's vectors were turned into an array; one value stands for all."""
    found = np.array(array)
    found = found if found.shape[-1] == 3 and found.shape[0] != 3 else found.T
    return np.broadcast_to(found, (count, 3)).astype(np.float64)

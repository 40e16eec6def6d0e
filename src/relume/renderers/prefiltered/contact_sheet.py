"""Balls of every kind of surface under one environment map: what a contact sheet shows (Miller & Hoffman 1984)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relume.light.reflection.brdf import GGX, Ward
from relume.light.reflection.convolution import as_latlong
from relume.light.reflection.lobes import VARNISH, Lambert, Lobe, Mirror, Phong, SelfLuminous
from relume.renderers.prefiltered.filters import Preintegrated
from relume.renderers.prefiltered.prefiltered import Shading
from relume.renderers.prefiltered.shading_inputs import GBuffer
from relume.scene.materials.bumps import Bumps, Wrinkles
from relume.scene.materials.materials import Material
from relume.scene.materials.reflective import Layer, Reflective, Towards, glass, glossy, mirror, retroreflector
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong

_FINER = 2
"""Samples along a pixel's side: wrinkles turn much within a pixel."""
_MOST_ROWS = 1024
"""Finer light is not seen in balls of a few hundred pixels, and the sums of an 8k map would take gigabytes."""
_AZIMUTHS = 12
"""Twice the usual number: all exposures are looked at, and fewer leave dark streaks beside a low, bare sun."""
_WRINKLES = Wrinkles(height=0.008, wavelength=0.4)


@dataclass(frozen=True, eq=False)
class Ball:
    """A picture of one ball.

    caption : the surface
    section : where in the paper it is, or whose model it is
    radiance : (S, S, 3) float32, in the light's unit
    matte : (S, S) float32, the share of a pixel that the ball covers
    """

    caption: str
    section: str
    radiance: np.ndarray
    matte: np.ndarray


def _only(lobe: Lobe | GGX | Ward, towards: Towards = Towards.REFLECTED, bumps: Bumps | None = None) -> Reflective:
    return Reflective((Layer(lobe, towards),), bumps)


SURFACES: tuple[tuple[str, str, Reflective | Material], ...] = (
    ("self-luminous", "§6.1, D by N", _only(SelfLuminous(), Towards.NORMAL)),
    ("Lambert", "§6.1, D by N", _only(Lambert(), Towards.NORMAL)),
    ("Phong, n = 10", "§6.2, S by R", _only(Phong(10))),
    ("Phong, n = 50", "§6.2, S by R", _only(Phong(50))),
    ("Phong, n = 200", "§6.2, S by R", _only(Phong(200))),
    ("mirror", "§6.2, S by R", _only(Mirror())),
    ("Lambert under Phong, n = 50", "§3, line 9, Schlick's weights", glossy((0.5, 0.5, 0.5))),
    ("Phong, n = 50, varnished", "§6.2, S by R", _only(Phong(50, varnish=VARNISH))),
    ("retro-reflector, n = 50", "§9, S by E", retroreflector()),
    ("refraction, index 1.5", "§9, S by the refracted ray", glass(1.5)),
    ("wrinkled mirror", "§8, S by R", mirror(bumps=_WRINKLES)),
    ("wrinkled Phong, n = 200", "§8, S by R", _only(Phong(200), bumps=_WRINKLES)),
    ("GGX, α = 0.1", "§9, in three dimensions", _only(GGX(0.1))),
    ("GGX, α = 0.3", "§9, in three dimensions", _only(GGX(0.3))),
    ("GGX, α = 0.6", "§9, in three dimensions", _only(GGX(0.6))),
    ("Ward, α = 0.2", "§9, in three dimensions", _only(Ward(0.2))),
    ("gold, roughness 0.4", "glTF metal", Material((1.0, 0.71, 0.29), metallic=1.0, roughness=0.4)),
    ("red plastic, roughness 0.3", "glTF dielectric", Material((0.6, 0.03, 0.03), roughness=0.3)),
)
"""Caption, section and surface of every ball, in rows of six."""


def balls(
    light: EnvironmentMap, size: int = 200, *, progress: Callable[[float], None] | None = None
) -> tuple[Ball, ...]:
    """A unit ball of every surface in `SURFACES`, seen along −Z from far away, each `size` pixels wide.

    progress : called with the share that is done

    Raises ValueError for a size below 2.
    """
    if size < 2:
        raise ValueError(f"balls are {size} pixels wide; expected 2 or more")
    light = coarse(as_latlong(light), _MOST_ROWS)
    points, cover = disc(size * _FINER)
    matte, towards = binned(cover, _FINER), np.broadcast_to(np.array([0.0, 0.0, 1.0]), points.shape)
    made = []
    for index, (caption, section, surface) in enumerate(SURFACES):
        normals = _wrinkled(points, surface.bumps if isinstance(surface, Reflective) else None)
        pixels = GBuffer(normals, towards, np.where(cover > 0, 0, -1))
        seen = Shading.of([surface], light, Preintegrated(), azimuths=_AZIMUTHS).shade(pixels)
        radiance = binned(seen * cover[..., None], _FINER) / np.maximum(matte, 1e-6)[..., None]
        made.append(Ball(caption, section, radiance.astype(np.float32), matte.astype(np.float32)))
        if progress:
            progress((index + 1) / len(SURFACES))
    return tuple(made)


def coarse(light: EnvironmentMap, most: int) -> EnvironmentMap:
    """A lat-long map of so many rows at most, energy kept."""
    block = -(-light.size // most)
    if block == 1 or light.size % block:
        return light if block == 1 else light.remapped(LatLong(), most)
    rows, areas = light.size // block, LatLong().solid_angles(light.size)[..., None]
    flux = (light.radiance * areas).reshape(rows, block, 2 * rows, block, 3).sum((1, 3))
    radiance = flux / LatLong().solid_angles(rows)[..., None]
    return EnvironmentMap(radiance.astype(np.float32), LatLong(), light.unit)


def disc(size: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the unit sphere's near side (size, size, 3), and how much of each pixel it covers."""
    across = (2 * np.arange(size) + 1) / size - 1
    x, y = np.meshgrid(across, -across)
    radius = np.hypot(x, y)
    # Pixels that the rim cuts, and those outside, take the rim's point.
    inward = 1 / np.maximum(radius, 1)
    z = np.sqrt(np.maximum(1 - radius**2, 0))
    return normalised(np.stack([x * inward, y * inward, z], axis=-1)), np.clip((1 - radius) * size / 2 + 0.5, 0, 1)


def _wrinkled(points: np.ndarray, bumps: Bumps | None) -> np.ndarray:
    """The normals at points of the unit sphere, which are the points themselves, turned by the bumps."""
    if bumps is None:
        return points
    flat, nowhere = points.reshape(-1, 3), np.zeros((points.size // 3, 3))
    return bumps.turned(flat, flat, nowhere[:, :2], nowhere, nowhere).reshape(points.shape)


def binned(values: np.ndarray, finer: int) -> np.ndarray:
    """Means of blocks of `finer` × `finer` samples."""
    rows, columns = (n // finer for n in values.shape[:2])
    return values.reshape(rows, finer, columns, finer, *values.shape[2:]).mean((1, 3))

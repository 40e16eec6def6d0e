"""The full map of an isotropic BRDF (Miller & Hoffman 1984, §9): view angle × direction × azimuth of the view.

The paper counts three dimensions, view angle and reflected direction. They are enough for lobes that are round about
their direction; real ones are drawn out in the plane of incidence at grazing angles. The lobe's Fourier series about
its direction, cos kψ for k = 0 … `azimuths`, holds that too: k = 0 alone is the paper's map.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from relume.light.harmonics.transform import Flux, analysed, synthesised, wigner
from relume.light.reflection.brdf import Reflectance
from relume.light.reflection.convolution import as_latlong, cut_up
from relume.light.reflection.lobes import quadrature
from relume.sphere.environment_map import EnvironmentMap

AZIMUTHS = 8
"""Mean errors of a fifth of a per cent under a sunset sky; with 5 the lobes of a bare low sun leave streaks at rims."""
NARROWEST = 0.04
"""Radians; the tables grow with the square of what is finer, and are half a gigabyte here."""
VIEWS = 24
"""View angles from the normal to the horizon: one each four degrees."""
_AROUND = 256
"""Azimuths at which half a lobe is sampled, the other half being its mirror image: at grazing angles it is thin."""


@dataclass(frozen=True, eq=False)
class GlossyMap:
    """What a surface reflects, by the view's angle and the direction it mirrors.

    tables : (views, rows, 2·rows, 2·azimuths + 1, 3) float32 in `unit`; in the fourth axis k = 0, then for each k the
        parts in phase and a quarter turn on
    tilts : (views,) the angle of each lobe's middle from the normal, in the plane of incidence away from the viewer;
        the lobes are kept about their middles, which at grazing angles are not the mirrored direction
    albedos : (views,) what the surface reflects of constant light of 1
    brdf : what was convolved
    unit : the light's
    """

    tables: np.ndarray
    tilts: np.ndarray
    albedos: np.ndarray
    brdf: Reflectance
    unit: str

    @cached_property
    def padded(self) -> np.ndarray:
        """The tables with one more entry on every side, for look-up in kernels."""
        half = self.tables.shape[2] // 2
        # Over a pole south is north: odd k change sign.
        k = (np.arange(self.tables.shape[3]) + 1) // 2
        over = np.where(k % 2, -1, 1).astype(np.float32)[:, None]
        views, rows, columns = self.tables.shape[:3]
        wide = np.empty((views, rows + 2, columns + 2, *self.tables.shape[3:]), np.float32)
        wide[:, 1:-1, 1:-1] = self.tables
        wide[:, 0, 1:-1], wide[:, -1, 1:-1] = (np.roll(self.tables[:, row], half, 1) * over for row in (0, -1))
        wide[:, :, 0], wide[:, :, -1] = wide[:, :, -2], wide[:, :, 1]
        return wide

    def lookup(self, normals: np.ndarray, views: np.ndarray) -> np.ndarray:
        """Reflected radiance (…, 3) for unit normals and unit directions to the eye (…, 3)."""
        from relume.light.reflection.glossy_lookup import lookup

        return lookup(self.padded, self.tilts, normals, views)


def glossy_map(
    light: EnvironmentMap,
    brdf: Reflectance,
    rows: int | None = None,
    *,
    views: int = VIEWS,
    azimuths: int = AZIMUTHS,
) -> GlossyMap:
    """Convolve an environment map with an isotropic BRDF for every view.

    rows : the tables' height; as fine as the lobe needs unless given
    views : view angles, evenly spaced from 0 to π/2
    azimuths : the highest k of the lobes' Fourier series; 0 for the paper's three dimensions

    Raises ValueError for sizes that cannot be, and for lobes narrower than NARROWEST.
    """
    if brdf.width < NARROWEST:
        raise ValueError(
            f"{brdf} is {brdf.width:.3g} rad wide; a three-dimensional map needs {NARROWEST}: "
            "below that take a lobe of relume.light.reflection.lobes, which is nearly as good for narrow ones"
        )
    rows = int(np.clip(np.ceil(3 * np.pi / brdf.width), 32, 512)) if rows is None else rows
    if rows < 2 or views < 2 or azimuths < 0:
        raise ValueError(f"{rows} rows, {views} views and {azimuths} azimuths; expected at least 2, 2 and 0")
    degree = int(np.clip(np.ceil(12 / brdf.width), 48, 400))
    tilts, albedos, kernels = _lobes(brdf, views, azimuths, degree)
    source = cut_up(as_latlong(light), brdf.width / 2)
    coefficients = analysed(Flux(source.radiance, source.mapping.solid_angles(source.size)), degree)
    # In single precision, as the tables are kept: under lamps a thousand times as bright as what is around them entries
    # are off by 1e-4 of their mean.
    coefficients = coefficients.astype(np.complex64)
    # Each part as it is made, then all parts of a row put side by side: one after the other would go over all memory.
    parts = np.empty((2 * azimuths + 1, 2 * rows, rows, views, 3), np.float32)
    for k in range(azimuths + 1):
        part = synthesised(coefficients, np.stack([kernel[k] for kernel in kernels]), k, rows).transpose(2, 1, 0, 3)
        parts[max(2 * k - 1, 0)] = np.real(part)
        if k:
            parts[2 * k] = np.imag(part)
    tables = np.empty((views, rows, 2 * rows, 2 * azimuths + 1, 3), np.float32)
    # Colours are moved as one value each.
    colours, made = (array.view("V12")[..., 0] for array in (parts, tables))
    for row in range(rows):
        made[:, row] = colours[:, :, row].transpose(2, 1, 0)
    return GlossyMap(tables, np.array(tilts), np.array(albedos), brdf, light.unit)


# Half of the time of a map, and the same for every light: a light that is edited or moves asks for it again.
@lru_cache(maxsize=16)
def _lobes(
    brdf: Reflectance, views: int, azimuths: int, degree: int
) -> tuple[tuple[float, ...], tuple[float, ...], tuple[np.ndarray, ...]]:
    """Of each view the lobe's tilt, its integral and its coefficients; at most 0.7 MB."""
    # At exactly 90° a view sees no surface.
    angles = np.minimum(np.linspace(0, np.pi / 2, views), np.pi / 2 - 1e-3)
    polar, weights = quadrature(brdf.width, degree)
    # (azimuths + 1, degree + 1, angles): the same for every view.
    functions = np.array(list(wigner(np.arange(azimuths + 1), 0, polar, degree))).transpose(1, 0, 2).copy()
    tilts, albedos, kernels = zip(*(_kernels(brdf, angle, polar, weights, functions) for angle in angles), strict=True)
    return tilts, albedos, kernels


def albedo(brdf: Reflectance, view_angle: float) -> float:
    """∫ f_r N·L dω: what a surface reflects of constant light of 1, seen from that angle."""
    polar, weights = quadrature(brdf.width, 0)
    return _kernels(brdf, view_angle, polar, weights, np.ones((1, 1, len(polar))))[1]


def _kernels(
    brdf: Reflectance, view_angle: float, polar: np.ndarray, weights: np.ndarray, functions: np.ndarray
) -> tuple[float, float, np.ndarray]:
    """The lobe's tilt, its integral, and its coefficients (azimuths + 1, degree + 1) for `synthesised`.

    polar, weights : (P,) of the quadrature
    functions : (azimuths + 1, degree + 1, P), d^l_k0 at the polar angles
    """
    azimuths, degree = functions.shape[0] - 1, functions.shape[1] - 1
    azimuth = np.pi * (np.arange(_AROUND) + 0.5) / _AROUND
    measure = weights[:, None] * (2 * np.pi / _AROUND)
    if azimuths:
        # About its peak the series of a lobe ends soonest: what is narrow is in the middle, which has no azimuth.
        steps = np.linspace(-np.pi / 2, np.pi / 2, 4001)
        plane = np.stack([-np.sin(steps), np.zeros_like(steps), np.cos(steps)], axis=-1)
        tilt = float(steps[np.argmax(brdf(view_angle, plane))])
    else:
        # A lobe that is taken to be round is nearest to the true one about its centre of mass.
        directions = _directions(-view_angle, polar, azimuth)
        centre = np.einsum("pa,pai->i", brdf(view_angle, directions) * measure, directions)
        tilt = float(np.arctan2(-centre[0], centre[2]))
    lobe = brdf(view_angle, _directions(-tilt, polar, azimuth))
    coefficients = np.zeros((azimuths + 1, degree + 1))
    scale = np.sqrt((2 * np.arange(degree + 1) + 1) / (4 * np.pi))
    profiles = lobe @ np.cos(np.outer(azimuth, np.arange(azimuths + 1))) / _AROUND
    for k in range(azimuths + 1):
        profile = profiles[:, k] * (1 if k == 0 else 2)
        coefficients[k] = 2 * np.pi * scale * (functions[k] @ (profile * weights))
    return tilt, float((lobe * measure).sum()), coefficients


def _directions(lean: float, polar: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """Directions (P, A, 3) about one that leans from the normal towards the viewer; ψ = 0 leans further."""
    axis = np.array([np.sin(lean), 0, np.cos(lean)])
    along, across = np.array([np.cos(lean), 0, -np.sin(lean)]), np.array([0.0, 1.0, 0.0])
    ring = np.cos(azimuth)[:, None] * along + np.sin(azimuth)[:, None] * across
    return np.cos(polar)[:, None, None] * axis + np.sin(polar)[:, None, None] * ring

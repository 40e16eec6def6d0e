"""Maps of a subject's surface from its separated reflectance field (Debevec et al. 2000, §4.2, Fig. 14).

Normals, diffuse albedo, specular energy and roughness, as pictures in the field's own pixels. World frame.

Roughness and reflectance are those of a lobe of microfacets that is fitted to each pixel's specular reflectance
function: the GGX distribution of the half vector with Smith's masking (Walter et al. 2007, eq. 20, 33, 34) and a
dielectric's rise of reflectance at grazing angles. Values are per unit of irradiance, so a lobe is
F(v·h) D(h) G / (4 n·v).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.lightstage.blocks import Cluster, Made, by_bands
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.relighting import MEMORY, Progress, within
from relume.lightstage.surface.photometric_stereo import (
    bright_level,
    brightness,
    darkest_level,
    lambertian_lobes,
    lit,
    shows_surface,
)
from relume.lightstage.surface.separation import (
    ANALYSED,
    Separated,
    Separation,
    analysed_rows,
    bands_for_pixels,
    require_separable,
    row_blocks,
    separated_rows,
    view_of,
)
from relume.sphere.directions import normalised

LOWEST, HIGHEST = 0.03, 1.0
"""Bounds of α, the square of the perceptual roughness. Narrower lobes than half the lights' spacing are never resolved
and come out at the lowest bound or by chance."""
COARSE, HALVINGS = 12, 4
"""Candidates at first, even in log α, and times that the search closes in about the best by half."""
MAPS = ("normal", "albedo", "specular_energy", "specular_reflectance", "roughness", "weight")
"""The first two have three channels, the others one."""
DIELECTRIC = 0.04
"""What a dielectric reflects at normal incidence: glass, skin and paint."""


@dataclass(frozen=True, eq=False)
class SurfaceMaps:
    """What the surface is like in each pixel; 0 where it is not known.

    normal : (H, W, 3) float32, unit, world
    albedo : (H, W, 3) float32, diffuse, ρd: what of white light from all around comes back from below the surface
    specular_energy : (H, W) float32, ρs: what of light from all around comes back towards the camera from the surface
    specular_reflectance : (H, W) float32, of the surface at normal incidence (F0); 0.04 for glass, skin and paint
    roughness : (H, W) float32, perceptual, as glTF's: the root of GGX's α; 1 where nothing specular is seen
    weight : (H, W) float32, 0 to 1, how much of the light above the surface agreed with a Lambertian lobe; low in deep
        shadow and for mirrors, whose other maps mean nothing
    """

    normal: np.ndarray
    albedo: np.ndarray
    specular_energy: np.ndarray
    specular_reflectance: np.ndarray
    roughness: np.ndarray
    weight: np.ndarray

    def pictures(self) -> dict[str, np.ndarray]:
        """Pictures (H, W, 3) float32 to look at, values 0 to 1 (Fig. 14): normals hold (X, Y, Z)/2 + ½."""
        normal = np.where(self.weight[..., None] > 0, self.normal / 2 + 0.5, 0).astype(np.float32)
        shown = {"normal": normal, "albedo": np.clip(self.albedo, 0, 1)}
        for name in MAPS[2:]:
            shown[name] = np.repeat(np.clip(getattr(self, name), 0, 1)[..., None], 3, axis=-1)
        return shown


def surface_maps(
    parts: Separated,
    *,
    cluster: Cluster = None,
    place: Path | str | None = None,
    memory: int = MEMORY,
    progress: Progress | None = None,
) -> SurfaceMaps:
    """The maps of a subject's surface, from a separation by colour or a polarised pair.

    The albedo is π times the length of each channel's Lambertian lobe, so that it holds the foreshortening of every
    light and neither shadows nor light from neighbours, which the fit leaves out. The specular energy is the sum of
    the specular values over the solid angles of the lights that reach the pixel.

    cluster, place : whose workers take bands of rows, and where these lie (`blocks.by_bands`)
    memory : bytes for a band
    Source: Debevec et al. 2000, §4.2, §4.4.
    """
    bands = bands_for_pixels(parts.diffuse, memory)
    return _joined(by_bands(_mapped_rows, parts, bands, cluster=cluster, place=place, memory=memory, progress=progress))


def surface_maps_by_colour(
    field: ReflectanceField,
    light: tuple[float, float, float] = (1.0, 1.0, 1.0),
    *,
    cluster: Cluster = None,
    place: Path | str | None = None,
    memory: int = MEMORY,
    progress: Progress | None = None,
) -> SurfaceMaps:
    """`surface_maps` of `separate`, whose maps are never together in memory where there is a place for them.

    light : colour of the lights, as of `separate`, which raises the same
    """
    require_separable(field, light)
    bands, colour = bands_for_pixels(field, memory), normalised(light).astype(np.float32)
    first, second = within(progress, slice(0, 1), 2), within(progress, slice(1, 2), 2)
    analysed = by_bands(
        analysed_rows, (field, colour), bands, cluster=cluster, place=place, memory=memory, progress=first
    )
    darkest = darkest_level(np.concatenate([level.ravel() for level in analysed.each("level")]))
    shared = _ByColour(field, analysed, darkest, colour)
    return _joined(by_bands(_mapped_rows, shared, bands, cluster=cluster, place=place, memory=memory, progress=second))


def _joined(made: Made) -> SurfaceMaps:
    """The bands' maps, without the pixels that show no surface."""
    known = shows_surface(made.whole("bright"))
    maps = [made.whole(name) for name in MAPS]
    for map_ in maps:
        map_[~known] = 0
    return SurfaceMaps(*maps)


@dataclass(frozen=True, eq=False)
class _ByColour:
    """A separation by colour, whose maps lie with the bands they were made in."""

    field: ReflectanceField
    analysed: Made
    darkest: float
    colour: np.ndarray

    def of(self, rows: slice) -> Separation:
        """One of the bands, with its values in memory."""
        number = self.analysed.bands.index(rows)
        maps = {name: np.asarray(self.analysed.of(name, number)) for name in (*ANALYSED, "level")}
        return separated_rows(self.field, rows, maps, self.darkest, self.colour)


def _mapped_rows(shared: _ByColour | Separated, rows: slice) -> dict[str, np.ndarray]:
    """The maps of some rows, and their "bright" level (rows, W)."""
    if isinstance(shared, _ByColour):
        parts, first = shared.of(rows), 0
        seen: ReflectanceField = parts.field
    else:
        parts, first, seen = shared, rows.start, shared.diffuse
    shape = rows.stop - rows.start, seen.shape[1]
    found, every = [], slice(0, len(seen.lights))
    for inner in row_blocks(shape):
        part = slice(first + inner.start, first + inner.stop)
        below, above = parts.diffuse.block(every, part), brightness(parts.specular.block(every, part))
        pixels = below.reshape(len(below), -1, 3), above.reshape(len(below), -1)
        found.append(_maps(*pixels, view_of(seen, part).reshape(-1, 3), seen.lights))
    maps = [np.concatenate(kind).reshape(*shape, *kind[0].shape[1:]) for kind in zip(*found, strict=True)]
    return dict(zip((*MAPS, "bright"), maps, strict=True))


def _maps(diffuse: np.ndarray, specular: np.ndarray, view: np.ndarray, lights: StageLights) -> tuple[np.ndarray, ...]:
    """The six maps of P pixels and their bright level, for diffuse values (N, P, 3), specular brightness (N, P)."""
    bright = brightness(diffuse)
    # What shines is lit, though its diffuse part may be dark.
    both = diffuse + specular[..., None]
    reached, level = lit(both), bright_level(brightness(both))
    lobes = lambertian_lobes(bright, lights, reached)
    normal = lobes.normals
    channels = [lambertian_lobes(diffuse[..., channel], lights, reached) for channel in range(3)]
    albedo = np.pi * np.stack([np.linalg.norm(each.vectors, axis=-1) for each in channels], axis=-1)

    above = reached & (lights.directions.astype(np.float32) @ normal.T > 0)
    energy = np.einsum("np,np,n->p", np.where(above, specular, 0), above, lights.solid_angles)
    energy = np.maximum(energy, 0)
    alpha, reflectance = np.zeros(len(view), np.float32), np.zeros(len(view), np.float32)
    shiny = (energy > 0) & (lobes.weight > 0)
    if shiny.any():
        fitted = specular_lobes(specular[:, shiny], lights, normal[shiny], view[shiny], reached[:, shiny])
        alpha[shiny], reflectance[shiny] = fitted.alpha, fitted.reflectance
    roughness = np.where(alpha > 0, np.sqrt(alpha), lobes.weight > 0)
    maps = (normal, albedo, energy, reflectance, roughness, lobes.weight, level)
    return tuple(np.asarray(kind, np.float32) for kind in maps)


@dataclass(frozen=True, eq=False)
class SpecularLobes:
    """Specular lobes of P pixels.

    alpha : (P,) float32, GGX's width, the square of the perceptual roughness; 0 where no lobe could be fitted
    reflectance : (P,) float32, of the surface at normal incidence (F0)
    """

    alpha: np.ndarray
    reflectance: np.ndarray


def specular_lobes(
    values: np.ndarray,
    lights: StageLights,
    normal: np.ndarray,
    view: np.ndarray,
    usable: np.ndarray,
) -> SpecularLobes:
    """The GGX lobe nearest each pixel's specular values, by least squares over the solid angle.

    values : (N, P), specular brightness; normal, view : (P, 3), unit, world; usable : bool (N, P), lights that count
    The roughness is searched coarse to fine.
    """
    directions = lights.directions.astype(np.float32)
    incident = directions @ normal.T
    outgoing = np.einsum("pk,pk->p", normal, view)
    # |l + v|² = 2 + 2 l·v, and n·h = (n·l + n·v) / |l + v|.
    length = np.sqrt(np.maximum(2 + 2 * (directions @ view.T), 1e-12))
    half_normal, half_view = np.clip((incident + outgoing) / length, 0, 1), length / 2
    rise = schlick_rise(half_view)
    weights = usable * (incident > 0) * lights.solid_angles.astype(np.float32)[:, None]
    incident = np.maximum(incident, 0)
    outgoing = np.maximum(outgoing, 1e-3)

    def nearest(alpha: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        lobe = rise * _lobe(alpha, half_normal, incident, outgoing)
        product, square = (weights * values * lobe).sum(axis=0), (weights * lobe**2).sum(axis=0)
        scale = np.maximum(product, 0) / np.maximum(square, 1e-30)
        return scale, scale * product  # by which the squared error falls

    step = np.log(HIGHEST / LOWEST) / (COARSE - 1)
    best = np.full(len(normal), LOWEST, np.float32)
    scale, gain = nearest(best)

    def tried(alpha: np.ndarray) -> None:
        nonlocal best, scale, gain
        found, won = nearest(alpha)
        better = won > gain
        best, scale, gain = np.where(better, alpha, best), np.where(better, found, scale), np.where(better, won, gain)

    for index in range(1, COARSE):
        tried(np.full_like(best, LOWEST * np.exp(index * step)))
    for _ in range(HALVINGS):
        step /= 2
        centre = best
        for sign in (-1, 1):
            tried(np.clip(centre * np.float32(np.exp(sign * step)), LOWEST, HIGHEST).astype(np.float32))
    known = (scale > 0) & (np.einsum("pk,pk->p", normal, view) > 0)
    return SpecularLobes(np.where(known, best, 0).astype(np.float32), np.where(known, scale, 0).astype(np.float32))


def schlick_rise(half_view: np.ndarray) -> np.ndarray:
    """F(v·h)/F0 of a dielectric, 0.04 at normal incidence as of glass, skin and paint (Schlick 1994)."""
    return np.asarray(1 + (1 - DIELECTRIC) / DIELECTRIC * (1 - half_view) ** 5)


def _lobe(alpha: np.ndarray, half_normal: np.ndarray, incident: np.ndarray, outgoing: np.ndarray) -> np.ndarray:
    """D G / (4 n·v) for GGX's widths (P,) and cosines (N, P) and (P,)."""
    square = alpha**2
    distribution = square / (np.pi * (half_normal**2 * (square - 1) + 1) ** 2)
    # Smith's G₁ over its cosine; the light's cosine returns with the irradiance.
    shadowing = 2 * incident / np.maximum(incident + np.sqrt(square + (1 - square) * incident**2), 1e-12)
    masking = 2 / (outgoing + np.sqrt(square + (1 - square) * outgoing**2))
    return np.asarray(distribution * shadowing * masking / 4)

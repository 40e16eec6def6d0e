"""Maps of a subject's surface from its separated reflectance field (Debevec et al. 2000, §4.2, Fig. 14).

Normals, diffuse albedo, specular energy and roughness, as pictures in the field's own pixels. World frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.surface.photometric_stereo import LobeFit, lambertian_lobes, towards_camera
from relume.lightstage.surface.separation import row_blocks
from relume.lightstage.surface.shadow_map import DARKEST, SHADOW, bright_level, brightness, lit, shows_surface
from relume.lightstage.surface.specular import SpecularFit, specular_lobes


class Parts(Protocol):
    """A reflectance field separated: a `Separation` or a `PolarisedPair`."""

    @property
    def diffuse(self) -> ReflectanceField: ...

    @property
    def specular(self) -> ReflectanceField: ...


@dataclass(frozen=True)
class Fitting:
    """How surface maps are fitted.

    shadow : fraction of a pixel's bright level below which a light is in shadow (`shadow_map`)
    darkest : share of the field's level below which a pixel is no surface but noise; its maps are 0
        (`shadow_map.shows_surface`)
    lobe, specular : of the two fits
    """

    shadow: float = SHADOW
    darkest: float = DARKEST
    lobe: LobeFit = field(default_factory=LobeFit)
    specular: SpecularFit = field(default_factory=SpecularFit)


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
        known = self.weight[..., None] > 0
        grey = {
            "specular_energy": self.specular_energy,
            "specular_reflectance": self.specular_reflectance,
            "roughness": self.roughness,
            "weight": self.weight,
        }
        shown = {name: np.repeat(np.clip(map_, 0, 1)[..., None], 3, axis=-1) for name, map_ in grey.items()}
        normal = np.where(known, self.normal / 2 + 0.5, 0).astype(np.float32)
        return {"normal": normal, "albedo": np.clip(self.albedo, 0, 1), **shown}


def surface_maps(parts: Parts, fitting: Fitting = Fitting()) -> SurfaceMaps:
    """The maps of a subject's surface, from a separation by colour or a polarised pair.

    The albedo is π times the length of each channel's Lambertian lobe, so that it holds the foreshortening of every
    light and neither shadows nor light from neighbours, which the fit leaves out. The specular energy is the sum of
    the specular values over the solid angles of the lights that reach the pixel.
    Source: Debevec et al. 2000, §4.2, §4.4.
    """
    diffuse, specular = parts.diffuse, parts.specular
    view = towards_camera(diffuse.camera, diffuse.shape)
    every = slice(0, len(diffuse.lights))
    found = []
    for rows in row_blocks(diffuse.shape):
        below, above = diffuse.block(every, rows), brightness(specular.block(every, rows))
        pixels = below.reshape(len(below), -1, 3), above.reshape(len(below), -1)
        found.append(_maps(*pixels, view[rows].reshape(-1, 3), diffuse.lights, fitting))
    maps = [np.concatenate(kind).reshape(*diffuse.shape, *kind[0].shape[1:]) for kind in zip(*found, strict=True)]
    known = shows_surface(maps.pop(), fitting.darkest)
    for map_ in maps:
        map_[~known] = 0
    return SurfaceMaps(*maps)


def _maps(
    diffuse: np.ndarray, specular: np.ndarray, view: np.ndarray, lights: StageLights, fitting: Fitting
) -> tuple[np.ndarray, ...]:
    """The six maps of P pixels and their bright level, for diffuse values (N, P, 3), specular brightness (N, P)."""
    bright = brightness(diffuse)
    # What shines is lit, though its diffuse part may be dark.
    both = diffuse + specular[..., None]
    reached, level = lit(both, fitting.shadow), bright_level(brightness(both))
    lobes = lambertian_lobes(bright, lights, reached, fitting.lobe)
    normal = lobes.normals
    channels = [lambertian_lobes(diffuse[..., channel], lights, reached, fitting.lobe) for channel in range(3)]
    albedo = np.pi * np.stack([np.linalg.norm(each.vectors, axis=-1) for each in channels], axis=-1)

    above = reached & (lights.directions.astype(np.float32) @ normal.T > 0)
    energy = np.einsum("np,np,n->p", np.where(above, specular, 0), above, lights.solid_angles)
    energy = np.maximum(energy, 0)
    alpha, reflectance = np.zeros(len(view), np.float32), np.zeros(len(view), np.float32)
    shiny = (energy > 0) & (lobes.weight > 0)
    if shiny.any():
        fitted = specular_lobes(
            specular[:, shiny], lights, normal[shiny], view[shiny], reached[:, shiny], fitting.specular
        )
        alpha[shiny], reflectance[shiny] = fitted.alpha, fitted.reflectance
    roughness = np.where(alpha > 0, np.sqrt(alpha), lobes.weight > 0)
    maps = (normal, albedo, energy, reflectance, roughness, lobes.weight, level)
    return tuple(np.asarray(kind, np.float32) for kind in maps)

"""Specular and diffuse parts of a reflectance field, separated by colour (Debevec et al. 2000, §4.2, eq. 6, 7).

What is reflected at the surface has the light's colour, what comes from below it the body's. Per pixel: a rough
separation with one body chromaticity, its Lambertian lobe, the ramp of chromaticities over the angles, the final
separation, and the normal again. World frame; values as in the field, per unit of irradiance.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from relume.lightstage.field.field import Noise, ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.surface.chromaticity import WHITE, RampSearch, amounts, median_chromaticity, ramp, ramped
from relume.lightstage.surface.photometric_stereo import LobeFit, lambertian_lobes, towards_camera
from relume.lightstage.surface.shadow_map import DARKEST, SHADOW, bright_level, brightness, lit, shows_surface
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised

PIXELS = 4096
"""Pixels worked on at once: with 300 lights a block is then some 15 MB."""


@dataclass(frozen=True)
class ColourSeparation:
    """How a reflectance field is separated by colour.

    light : colour of the lights, linear Rec. 709; white, since a field is per unit of irradiance
    shadow : fraction of a pixel's bright level below which a light is in shadow (`shadow_map`)
    range : fractions of the bright level between which values show the body's chromaticity: above shadows and noise,
        below highlights
    mirror : radians between normal and half vector within which values count less for the ramp: highlights; wide,
        since their tails are pale too
    rounds : times that the ramp is fitted again without what the last one calls specular: the tails of highlights
    pale : μs, as a fraction of the value, beyond which a value soon stops counting for that
    least_angle : radians between the body's and the light's chromaticity below which they are not separated, since
        noise grows with its inverse; such values are all diffuse
    darkest : share of the field's level below which a pixel is no surface but noise: it is left out
        (`shadow_map.shows_surface`)
    ramp, lobe : of the searches
    """

    light: tuple[float, float, float] = WHITE
    shadow: float = SHADOW
    range: tuple[float, float] = (0.2, 0.8)
    mirror: float = 0.6
    rounds: int = 2
    pale: float = 0.1
    least_angle: float = 0.05
    darkest: float = DARKEST
    ramp: RampSearch = field(default_factory=RampSearch)
    lobe: LobeFit = field(default_factory=LobeFit)

    def __post_init__(self) -> None:
        if not all(0 < value < np.inf for value in self.light):
            raise ValueError(f"the light's colour is {self.light}; expected three numbers above 0")
        if not 0 <= self.range[0] < self.range[1]:
            raise ValueError(f"a brightness range of {self.range}; expected two fractions, the lower first")
        if not self.mirror > 0 or not 0 < self.least_angle < np.pi / 2:
            raise ValueError(f"angles of {self.mirror} and {self.least_angle}; expected radians above 0")

    @property
    def light_chromaticity(self) -> np.ndarray:
        return normalised(self.light).astype(np.float32)


@dataclass(frozen=True, eq=False)
class Separation:
    """A reflectance field separated: D + S = R, for every light and pixel.

    field : what was separated
    normal : (H, W, 3) float32, unit, world; 0 where unknown
    alpha : (H, W, 2) float32, α0 and α1 of the chromaticity ramp
    chromaticity : (H, W, 3) float32, d0, the body's, unit; 0 where a pixel is black under all lights
    separable : (H, W) bool; False where the body has the light's colour, as of grey things, mirrors and black ones:
        all of such a pixel is called diffuse
    settings : of the separation
    """

    field: ReflectanceField
    normal: np.ndarray
    alpha: np.ndarray
    chromaticity: np.ndarray
    separable: np.ndarray
    settings: ColourSeparation

    @property
    def diffuse(self) -> Part:
        """The diffuse reflectance field D = R − S, worked out where it is asked for."""
        return Part(self, "diffuse")

    @property
    def specular(self) -> Part:
        """The specular reflectance field S = max(μs, 0) s, worked out where it is asked for."""
        return Part(self, "specular")

    def specular_block(self, values: np.ndarray, lights: slice, rows: slice) -> np.ndarray:
        """S (lights, rows, W, 3) of the field's own values there, in the lights' colour."""
        view = towards_camera(self.field.camera, self.field.shape)[rows].reshape(-1, 3)
        flat = values.reshape(len(values), -1, 3)
        normal, alpha = self.normal[rows].reshape(-1, 3), self.alpha[rows].reshape(-1, 2)
        cosines = facing(self.field.lights.directions[lights], normal, view)
        chromaticity = ramped(
            self.chromaticity[rows].reshape(-1, 3), self.settings.light_chromaticity, ramp(alpha, cosines)
        )
        known = self.separable[rows].reshape(-1)
        return specular_part(flat, chromaticity, known, self.settings).reshape(values.shape)


@dataclass(frozen=True, eq=False)
class Part:
    """One part of a separation, as a reflectance field of its own.

    Its noise is not known: separating magnifies the field's by up to 1/sin of the angle between the two
    chromaticities, which differs from pixel to pixel.
    """

    separation: Separation
    kind: Literal["diffuse", "specular"]

    @property
    def lights(self) -> StageLights:
        return self.separation.field.lights

    @property
    def shape(self) -> tuple[int, int]:
        return self.separation.field.shape

    @property
    def camera(self) -> Camera | None:
        return self.separation.field.camera

    @property
    def noise(self) -> Noise | None:
        return None

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        values = self.separation.field.block(lights, rows)
        specular = self.separation.specular_block(values, lights, rows)
        return specular if self.kind == "specular" else values - specular


def separate(field: ReflectanceField, settings: ColourSeparation = ColourSeparation()) -> Separation:
    """Separate a reflectance field's specular from its diffuse part, by colour.

    The field is read in rows, once; the parts are worked out from it again when they are asked for, so a field larger
    than memory is no trouble. Grey and black things have no colour to go by: see `Separation.separable`, and use a
    polarised pair (`PolarisedPair`) for them.
    Raises ValueError for fewer than four lights.
    Source: Debevec et al. 2000, §4.2, §4.4.
    """
    if len(field.lights) < 4:
        raise ValueError(f"a field of {len(field.lights)} lights; a separation needs four or more")
    view = towards_camera(field.camera, field.shape)
    parts = []
    for rows in row_blocks(field.shape):
        values = field.block(slice(0, len(field.lights)), rows)
        parts.append(_analysed(values.reshape(len(values), -1, 3), view[rows].reshape(-1, 3), field.lights, settings))
    maps = [np.concatenate(kind).reshape(*field.shape, -1) for kind in zip(*parts, strict=True)]
    known = shows_surface(maps.pop(), settings.darkest)
    normal, alpha, chromaticity, separable = (np.where(known, map_, map_.dtype.type(0)) for map_ in maps)
    return Separation(field, normal, alpha, chromaticity, separable[..., 0], settings)


def row_blocks(shape: tuple[int, int]) -> list[slice]:
    """The rows of pictures of this shape, in blocks of about `PIXELS` pixels."""
    step = max(1, PIXELS // shape[1])
    return [slice(start, min(start + step, shape[0])) for start in range(0, shape[0], step)]


def facing(directions: np.ndarray, normal: np.ndarray, view: np.ndarray) -> np.ndarray:
    """cos θi · cos θr (N, P), each not below 0, for lights (N, 3), normals and views (P, 3)."""
    incident = np.maximum(directions.astype(np.float32) @ normal.T, 0)
    return incident * np.maximum(np.einsum("pk,pk->p", normal, view), 0)


def specular_part(
    values: np.ndarray, chromaticity: np.ndarray, separable: np.ndarray, settings: ColourSeparation
) -> np.ndarray:
    """S = max(μs, 0) s (N, P, 3) of values (N, P, 3), given the body's chromaticity for each of them."""
    apart, body = _apart(chromaticity, separable, settings)
    amount = amounts(values, body, settings.light_chromaticity)[1]
    return np.where(apart, np.maximum(amount, 0), 0)[..., None].astype(np.float32) * settings.light_chromaticity


def _apart(
    chromaticity: np.ndarray, separable: np.ndarray, settings: ColourSeparation
) -> tuple[np.ndarray, np.ndarray]:
    """Whether body chromaticities (N, P, 3) differ from the light's, and, where they are not, others that are."""
    sine = np.linalg.norm(np.cross(chromaticity, settings.light_chromaticity), axis=-1)
    apart = (sine > np.sin(settings.least_angle)) & separable
    return apart, np.where(apart[..., None], chromaticity, np.array([1, 0, 0], np.float32))


def _analysed(
    values: np.ndarray, view: np.ndarray, lights: StageLights, settings: ColourSeparation
) -> tuple[np.ndarray, ...]:
    """Of values (N, P, 3): normal (P, 3), ramp (P, 2), body chromaticity (P, 3), whether it is known, level (P, 1)."""
    bright = brightness(values)
    level = bright_level(bright)
    reached = lit(values, settings.shadow)
    light = settings.light_chromaticity
    within = reached & (bright > settings.range[0] * level) & (bright < settings.range[1] * level)
    body = median_chromaticity(values, within)
    separable = np.linalg.norm(np.cross(body, light), axis=-1) > np.sin(settings.least_angle)

    # With one chromaticity for all lights.
    rough = values - specular_part(values, body[None], separable, settings)
    normal = lambertian_lobes(brightness(rough), lights, reached, settings.lobe).normals

    cosines = facing(lights.directions, normal, view)
    weights = reached * (1 - np.exp(-((_mirror_angle(lights, normal, view) / settings.mirror) ** 2)))
    weights = weights * (cosines > 0) * separable
    weights = weights.astype(np.float32)
    alpha = settings.ramp(values, weights, cosines, body, light)
    for _ in range(settings.rounds):
        chromaticity = ramped(body, light, ramp(alpha, cosines)).astype(np.float32)
        pale = _paleness(values, chromaticity, separable, settings)
        alpha = settings.ramp(values, weights / (1 + (pale / settings.pale) ** 2) ** 2, cosines, body, light)

    chromaticity = ramped(body, light, ramp(alpha, cosines)).astype(np.float32)
    final = values - specular_part(values, chromaticity, separable, settings)
    normal = lambertian_lobes(brightness(final), lights, reached, settings.lobe).normals
    return normal, alpha, body, separable[:, None], level[:, None]


def _paleness(
    values: np.ndarray, chromaticity: np.ndarray, separable: np.ndarray, settings: ColourSeparation
) -> np.ndarray:
    """μs over the value's length, (N, P), of either sign: how far each value is from the ramp."""
    apart, body = _apart(chromaticity, separable, settings)
    amount = amounts(values, body, settings.light_chromaticity)[1]
    length = np.maximum(np.linalg.norm(values, axis=-1), 1e-12)
    return np.where(apart, amount / length, 0).astype(np.float32)


def _mirror_angle(lights: StageLights, normal: np.ndarray, view: np.ndarray) -> np.ndarray:
    """Radians (N, P) between the normal and the half vector of light and view: 0 at the mirror angle."""
    half = lights.directions.astype(np.float32)[:, None] + view[None]
    cosine = np.einsum("npk,pk->np", half, normal) / np.maximum(np.linalg.norm(half, axis=-1), 1e-12)
    return np.arccos(np.clip(cosine, -1, 1))

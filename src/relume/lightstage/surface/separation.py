"""Specular and diffuse parts of a reflectance field, separated by colour (Debevec et al. 2000, §4.2, eq. 6, 7).

What is reflected at the surface has the light's colour, what comes from below it the body's. Per pixel: a rough
separation with one body chromaticity, its Lambertian lobe, the ramp of chromaticities over the angles, the final
separation, and the normal again. World frame; values as in the field, per unit of irradiance.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from relume.lightstage.blocks import RowsOf, bands_of, by_bands
from relume.lightstage.field.field import Derived, ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.relighting import MEMORY, Progress, cut
from relume.lightstage.surface.chromaticity import amounts, fitted_ramp, median_chromaticity, ramp, ramped
from relume.lightstage.surface.photometric_stereo import (
    bright_level,
    brightness,
    lambertian_lobes,
    lit,
    shows_surface,
    towards_camera,
)
from relume.sphere.directions import normalised

PIXELS = 4096
"""Pixels worked on at once: with 300 lights a block is then some 15 MB."""
RANGE = (0.2, 0.8)
"""Fractions of a pixel's bright level between which values show the body's chromaticity: above shadows and noise, below
highlights."""
MIRROR = 0.6
"""Radians between normal and half vector within which values count less for the ramp: highlights; wide, since their
tails are pale too."""
ROUNDS = 2
"""Times that the ramp is fitted again without what the last one calls specular: the tails of highlights."""
PALE = 0.1
"""μs, as a fraction of the value, beyond which a value soon stops counting for that."""
LEAST_ANGLE = 0.05
"""Radians between the body's and the light's chromaticity below which they are not separated, since noise grows with
its inverse; such values are all diffuse."""


class Separated(Protocol):
    """A reflectance field separated: a `Separation` or a `PolarisedPair`."""

    @property
    def diffuse(self) -> ReflectanceField: ...

    @property
    def specular(self) -> ReflectanceField: ...


@dataclass(frozen=True, eq=False)
class Separation:
    """A reflectance field separated: D + S = R, for every light and pixel.

    field : what was separated
    normal : (H, W, 3) float32, unit, world; 0 where unknown
    alpha : (H, W, 2) float32, α0 and α1 of the chromaticity ramp
    chromaticity : (H, W, 3) float32, d0, the body's, unit; 0 where a pixel is black under all lights
    separable : (H, W) bool; False where the body has the light's colour, as of grey things, mirrors and black ones:
        all of such a pixel is called diffuse
    light : (3,) float32, the lights' chromaticity, unit
    """

    field: ReflectanceField
    normal: np.ndarray
    alpha: np.ndarray
    chromaticity: np.ndarray
    separable: np.ndarray
    light: np.ndarray

    @property
    def diffuse(self) -> Part:
        """The diffuse reflectance field D = R − S, worked out where it is asked for."""
        return Part(self.field, self, "diffuse")

    @property
    def specular(self) -> Part:
        """The specular reflectance field S = max(μs, 0) s, worked out where it is asked for."""
        return Part(self.field, self, "specular")

    def specular_block(self, values: np.ndarray, lights: slice, rows: slice) -> np.ndarray:
        """S (lights, rows, W, 3) of the field's own values there, in the lights' colour."""
        view = view_of(self.field, rows).reshape(-1, 3)
        flat = values.reshape(len(values), -1, 3)
        normal, alpha = self.normal[rows].reshape(-1, 3), self.alpha[rows].reshape(-1, 2)
        cosines = facing(self.field.lights.directions[lights], normal, view)
        chromaticity = ramped(self.chromaticity[rows].reshape(-1, 3), self.light, ramp(alpha, cosines))
        known = self.separable[rows].reshape(-1)
        return specular_part(flat, chromaticity, known, self.light).reshape(values.shape)


@dataclass(frozen=True, eq=False)
class Part(Derived):
    """One part of a separation, as a reflectance field of its own.

    Its noise is not known: separating magnifies the field's by up to 1/sin of the angle between the two
    chromaticities, which differs from pixel to pixel.
    """

    field: ReflectanceField
    separation: Separation
    kind: Literal["diffuse", "specular"]

    @property
    def noise(self) -> None:
        return None

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        values = self.field.block(lights, rows)
        specular = self.separation.specular_block(values, lights, rows)
        return specular if self.kind == "specular" else values - specular


def separate(
    field: ReflectanceField,
    light: tuple[float, float, float] = (1.0, 1.0, 1.0),
    *,
    memory: int = MEMORY,
    progress: Progress | None = None,
) -> Separation:
    """Separate a reflectance field's specular from its diffuse part, by colour.

    The field is read in rows, once; the parts are worked out from it again when they are asked for, so a field larger
    than memory is no trouble. Grey and black things have no colour to go by: the result's `separable` says where they
    are. For them use `measure_surface` with a polarised pair.

    field : one light at a time, by one camera
    light : colour of the lights, linear Rec. 709; white, since a field is per unit of irradiance
    memory : bytes for a band of rows
    progress : called with the share of the work that is done, 0 to 1
    Raises ValueError for fewer than four lights.
    Source: Debevec et al. 2000, §4.2, §4.4.
    """
    require_separable(field, light)
    colour = normalised(light).astype(np.float32)
    made = by_bands(analysed_rows, (field, colour), bands_for_pixels(field, memory), progress=progress)
    level = made.whole("level")
    known = shows_surface(level)[..., None]
    maps = [np.where(known, map_, map_.dtype.type(0)) for map_ in (made.whole(name) for name in ANALYSED)]
    normal, alpha, chromaticity, separable = maps
    return Separation(field, normal, alpha, chromaticity, separable[..., 0], colour)


def require_separable(field: ReflectanceField, light: tuple[float, float, float]) -> None:
    """Raises ValueError for fewer than four lights, and for no colour."""
    if not all(0 < value < np.inf for value in light):
        raise ValueError(f"the light's colour is {light}; expected three numbers above 0")
    if len(field.lights) < 4:
        raise ValueError(f"a field of {len(field.lights)} lights; a separation needs four or more")


ANALYSED = ("normal", "alpha", "chromaticity", "separable")
"""What a separation finds for each pixel, beside its bright level."""


def analysed_rows(shared: tuple[ReflectanceField, np.ndarray], rows: slice) -> dict[str, np.ndarray]:
    """The maps `ANALYSED` of some rows and their "level" (rows, W), for a field and the lights' chromaticity (3,)."""
    field, colour = shared
    part, found = RowsOf(field, rows).read(), []
    every = slice(0, len(field.lights))
    for inner in row_blocks(part.shape):
        values, view = part.block(every, inner), view_of(part, inner)
        found.append(_analysed(values.reshape(len(values), -1, 3), view.reshape(-1, 3), field.lights, colour))
    maps = [np.concatenate(kind).reshape(*part.shape, -1) for kind in zip(*found, strict=True)]
    return dict(zip((*ANALYSED, "level"), (*maps[:-1], maps[-1][..., 0]), strict=True))


def separated_rows(
    field: ReflectanceField, rows: slice, maps: dict[str, np.ndarray], darkest: float, colour: np.ndarray
) -> Separation:
    """The separation of some rows, read into memory, from what `analysed_rows` made of them.

    darkest : bright level of the field above which a pixel shows its surface (`darkest_level`)
    """
    known = (maps["level"] > darkest)[..., None]
    normal, alpha, chromaticity, separable = (
        np.where(known, maps[name], maps[name].dtype.type(0)) for name in ANALYSED
    )
    return Separation(RowsOf(field, rows).read(), normal, alpha, chromaticity, separable[..., 0], colour)


def bands_for_pixels(field: ReflectanceField, memory: int) -> tuple[slice, ...]:
    """Bands of rows whose values, twice, fit into so many bytes, each of whole `row_blocks` where they do."""
    height, width = field.shape
    bands = bands_of(field, len(field.lights) * width * 3 * 4 * 3, memory)
    step, size = max(1, PIXELS // width), bands[0].stop
    return cut(height, size // step * step) if size >= step else bands


def view_of(field: ReflectanceField, rows: slice) -> np.ndarray:
    """`towards_camera` for some rows of a field, or of a part of one."""
    if isinstance(field, RowsOf):
        start = field.rows.start
        return view_of(field.field, slice(start + rows.start, start + rows.stop))
    return towards_camera(field.camera, field.shape, rows)


def row_blocks(shape: tuple[int, int]) -> tuple[slice, ...]:
    """The rows of pictures of this shape, in blocks of about `PIXELS` pixels."""
    return cut(shape[0], max(1, PIXELS // shape[1]))


def facing(directions: np.ndarray, normal: np.ndarray, view: np.ndarray) -> np.ndarray:
    """cos θi · cos θr (N, P), each not below 0, for lights (N, 3), normals and views (P, 3)."""
    incident = np.maximum(directions.astype(np.float32) @ normal.T, 0)
    return incident * np.maximum(np.einsum("pk,pk->p", normal, view), 0)


def specular_part(values: np.ndarray, chromaticity: np.ndarray, separable: np.ndarray, light: np.ndarray) -> np.ndarray:
    """S = max(μs, 0) s (N, P, 3) of values (N, P, 3), given the body's chromaticity for each of them."""
    return np.maximum(_specular_amount(values, chromaticity, separable, light), 0)[..., None].astype(np.float32) * light


def _specular_amount(
    values: np.ndarray, chromaticity: np.ndarray, separable: np.ndarray, light: np.ndarray
) -> np.ndarray:
    """μs (N, P), of either sign; 0 where the body's chromaticity hardly differs from the light's."""
    apart = _differs(chromaticity, light) & separable
    body = np.where(apart[..., None], chromaticity, np.array([1, 0, 0], np.float32))
    return np.where(apart, amounts(values, body, light)[1], 0)


def _differs(chromaticity: np.ndarray, light: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.cross(chromaticity, light), axis=-1) > np.sin(LEAST_ANGLE)


def _analysed(values: np.ndarray, view: np.ndarray, lights: StageLights, light: np.ndarray) -> tuple[np.ndarray, ...]:
    """Of values (N, P, 3): normal (P, 3), ramp (P, 2), body chromaticity (P, 3), whether it is known, level (P, 1)."""
    bright = brightness(values)
    level = bright_level(bright)
    reached = lit(values)
    body = median_chromaticity(values, reached & (bright > RANGE[0] * level) & (bright < RANGE[1] * level))
    separable = _differs(body, light)

    # With one chromaticity for all lights.
    rough = values - specular_part(values, body[None], separable, light)
    normal = lambertian_lobes(brightness(rough), lights, reached).normals

    # The ramp, less where the half vector is near the normal and highlights are.
    cosines = facing(lights.directions, normal, view)
    half = lights.directions.astype(np.float32)[:, None] + view[None]
    cosine = np.einsum("npk,pk->np", half, normal) / np.maximum(np.linalg.norm(half, axis=-1), 1e-12)
    weights = reached * (1 - np.exp(-((np.arccos(np.clip(cosine, -1, 1)) / MIRROR) ** 2)))
    weights = (weights * (cosines > 0) * separable).astype(np.float32)
    alpha = fitted_ramp(values, weights, cosines, body, light)
    for _ in range(ROUNDS):
        chromaticity = ramped(body, light, ramp(alpha, cosines)).astype(np.float32)
        # How far each value is from the ramp: μs over its length.
        length = np.maximum(np.linalg.norm(values, axis=-1), 1e-12)
        pale = (_specular_amount(values, chromaticity, separable, light) / length).astype(np.float32)
        alpha = fitted_ramp(values, weights / (1 + (pale / PALE) ** 2) ** 2, cosines, body, light)

    chromaticity = ramped(body, light, ramp(alpha, cosines)).astype(np.float32)
    final = values - specular_part(values, chromaticity, separable, light)
    normal = lambertian_lobes(brightness(final), lights, reached).normals
    return normal, alpha, body, separable[:, None], level[:, None]

"""What a stage is driven for: a matte surface, a glossy one, or a given subject.

A subject gives what is seen of it, at M normals, directions or pixels, under lights of a stage and under a map.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from relume.light.reflection.convolution import as_latlong, convolved, cut_up
from relume.light.reflection.lobes import GGXLobe, Lambert, Lobe
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Interpolation, Smooth
from relume.lightstage.relighting.stage_lighting import irradiances
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions


@dataclass(frozen=True)
class SurfaceSubject:
    """A sphere of an even surface that nothing shadows: what every normal, or every mirrored direction, shows.

    lobe : Lambert, whose sums are irradiance, unless given; `SurfaceSubject.glossy(roughness)` for highlights
    """

    lobe: Lobe = Lambert()

    @staticmethod
    def glossy(roughness: float) -> SurfaceSubject:
        """Highlights as wide as a GGX surface's of this perceptual roughness, above 0 and at most 1."""
        if not 0 < roughness <= 1:
            raise ValueError(f"roughness is {roughness}; expected above 0 and at most 1, like 0.4")
        return SurfaceSubject(GGXLobe(roughness**2))

    @property
    def rows(self) -> int:
        """The rows of the lat-long table of what is seen: three to the lobe's width, from 16 to 64."""
        return int(np.clip(np.ceil(3 * np.pi / self.lobe.width), 16, 64))

    @property
    def weights(self) -> np.ndarray:
        """How much each of the M things seen counts: (M,), their sum 1."""
        return LatLong().solid_angles(self.rows).ravel() / (4 * np.pi)

    def lit_by(self, lights: StageLights) -> np.ndarray:
        """What is seen per unit irradiance of each of the stage's `lights`, (M, N)."""
        towards = pixel_directions(LatLong(), self.rows).reshape(-1, 3)
        return self.lobe(np.clip(towards @ lights.directions.T, -1, 1))

    def under(self, light: EnvironmentMap) -> np.ndarray:
        """What is seen under a map, `light`: (M, 3)."""
        source = cut_up(as_latlong(light), self.lobe.width / 2)
        return convolved(source, self.lobe, self.rows)[0].reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class MeasuredSubject:
    """A subject whose reflectance field is known, with its own shadows and highlights.

    field : taken under at least as many lights as the stage has that is driven
    mask : (H, W) bool, the pixels that count; all unless given
    pixels : about how many of them, evenly spread; a few thousand hold what a few hundred lights can do
    by : how the field's lights stand for a lamp, or for light, between them. Smooth unless given: one half of the 288
        lights of a rendered head predicts the other half's pictures with a mean error of 14 % of their mean, nearest
        cells with one of 31 %
    """

    field: ReflectanceField
    mask: np.ndarray | None = None
    pixels: int = 4096
    by: Interpolation = Smooth()

    def __post_init__(self) -> None:
        if self.mask is not None and (self.mask.shape != self.field.shape or not self.mask.any()):
            raise ValueError(f"the mask is {self.mask.shape}; expected {self.field.shape}, with pixels that count")
        if self.pixels < 1:
            raise ValueError(f"{self.pixels} pixels; expected 1 or more")

    @property
    def weights(self) -> np.ndarray:
        """The weights (M,) of the things seen: every pixel that counts weighs the same, and they sum to 1."""
        count = self._values.shape[0]
        return np.full(count, 1 / count)

    def lit_by(self, lights: StageLights) -> np.ndarray:
        """What is seen under each of `lights`, (M, N, 3): that of the field's own lights, by their shares there."""
        shares = self.by.weights(self.field.lights, lights.directions)
        return np.moveaxis(np.tensordot(self._values, shares, (1, 1)), 1, 2)

    def under(self, light: EnvironmentMap) -> np.ndarray:
        """What is seen under a map, `light`: (M, 3)."""
        return np.einsum("pfc,fc->pc", self._values, irradiances(self.field.lights, light, self.by))

    @cached_property
    def _values(self) -> np.ndarray:
        """(M, lights of the field, 3) float64 of the pixels that count."""
        mask = np.ones(self.field.shape, bool) if self.mask is None else self.mask
        rows, columns = np.nonzero(mask)
        chosen = np.unique(np.linspace(0, len(rows) - 1, min(self.pixels, len(rows))).round().astype(int))
        rows, columns = rows[chosen], columns[chosen]
        lights = slice(0, len(self.field.lights))
        # One row of pictures at a time: the field may be larger than memory.
        parts = [
            np.moveaxis(self.field.block(lights, slice(row, row + 1))[:, 0, columns[rows == row]], 0, 1)
            for row in np.unique(rows)
        ]
        return np.concatenate(parts).astype(np.float64)

"""A stage's subject relit many times a second, while its lamps are dragged and a map is turned.

A picture is the sum of the stage's pictures, Σ e_i R_i with Σ over the lights, from the field itself or from its cosine
transform (`relighting.cosine`), which is within a stated error and many times as quick. Where the stage has so few
lights that a fit of each pixel helps, pictures under a grid of lights are made by `relight` first and are then the
field.

A map that turns about the vertical: e_i(ψ) = ∫ L(R_ψ⁻¹ ω) w_i(ω) dω. On a lat-long grid that is, row by row, a circular
correlation of the map with light i's share w_i, whose Fourier coefficients are products: they are summed over the rows
once, and e_i at any angle is a sum of as many terms as the grid has columns, over two.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np

from relume.errors import DoubtWarning
from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import Pictures, ReflectanceField, whole
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.cosine import CompressionError, CosineField, compress_cosine
from relume.lightstage.relighting.diffuse_fit import needs_fit
from relume.lightstage.relighting.interpolation import Smooth
from relume.lightstage.relighting.relight import relight_sequence
from relume.lightstage.relighting.relighting import Progress, cut, weighted_sum
from relume.lightstage.relighting.stage_lighting import StageLighting
from relume.scene.lights import DistantLight
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

GRID = (12, 24)
"""Inclinations and azimuths of the lights that stand for few: as many as a stage needs for smooth interpolation."""
BAND_BYTES = 1 << 28
"""Of the field, compressed at once: small enough for a report every few seconds."""
MAP_ROWS, MOST_ROWS = 192, 512
"""Of a map that turns, and of the map that it is made from."""


@dataclass(frozen=True, eq=False)
class LiveField:
    """A field for many pictures, with or without its compression.

    field : whose lights are to be given irradiances
    compressed : None for sums of the field itself
    """

    field: Pictures
    compressed: CosineField | None = None

    @property
    def lights(self) -> StageLights:
        """The field's lights."""
        return self.field.lights

    @property
    def error(self) -> CompressionError | None:
        """How far its pictures are from sums of the field; None where they are these."""
        return None if self.compressed is None else self.compressed.error

    def compress(self, progress: Progress | None = None) -> LiveField:
        """The same field, many times as quick to relight.

        progress : called with the share of the work that is done, 0 to 1
        Raises ValueError as `compress_cosine`.
        """
        return replace(self, compressed=compress_cosine(self.field, memory=BAND_BYTES, progress=progress))

    def relight(self, irradiances: np.ndarray) -> RadianceMap:
        """The subject under light of `irradiances` (N, 3), one a light of the field."""
        if self.compressed is not None:
            return self.compressed.relight(irradiances)
        return weighted_sum(replace(self.field, noise=None), irradiances)


@dataclass(frozen=True, eq=False)
class TurningMap:
    """What each light of a stage gives of a map that is turned about the vertical.

    spectrum : (N, F, 3) complex, Fourier coefficients over the angle
    """

    spectrum: np.ndarray

    def irradiances(self, angle: float) -> np.ndarray:
        """What each light gives, (N, 3) float64, with the map turned by `angle`, radians, right-handed."""
        count = self.spectrum.shape[1]
        turned = np.exp(1j * angle * np.arange(count))
        turned[1:] *= 2  # negative frequencies are the conjugates of the positive ones
        return np.einsum("nfc,f->nc", self.spectrum, turned).real


def live_field(stage: ReflectanceField, *, progress: Progress | None = None) -> LiveField:
    """The field in memory, or, where few lights leave much open, the pictures under a grid of lights instead of it.

    stage : its reflectance field
    progress : called with the share of the work that is done, 0 to 1
    """
    if not needs_fit(stage.lights):
        values = stage if isinstance(stage, Pictures) else Pictures(whole(stage), stage.lights, stage.camera)
        return LiveField(values)
    rows, columns = GRID
    inclination, azimuth = np.meshgrid(
        np.pi * (np.arange(rows) + 0.5) / rows, 2 * np.pi * np.arange(columns) / columns, indexing="ij"
    )
    ring = np.sin(inclination)
    directions = np.stack([ring * np.sin(azimuth), np.cos(inclination), ring * np.cos(azimuth)], -1).reshape(-1, 3)
    one = [StageLighting(lamps=(DistantLight((x, y, z), (1.0, 1.0, 1.0)),)) for x, y, z in directions.tolist()]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DoubtWarning)  # of single lights that nobody sees
        values = np.stack([each.radiance for each in relight_sequence(stage, one, progress=progress)])
    return LiveField(Pictures(values, StageLights.towards(directions, grid=GRID), stage.camera))


def turning_map(lights: StageLights, light: EnvironmentMap, rows: int = MAP_ROWS) -> TurningMap:
    """A map prepared for turning: its light is shared out to `rows` of pixels, each light keeping its place and energy.

    lights : the stage's
    light : the map
    rows : pixels of 0.9 degrees unless given; a sun's light between 288 is right to half a per cent then
    """
    small = light.remapped(LatLong(), min(MOST_ROWS, light.size))
    height, width = small.radiance.shape[:2]
    flux = small.radiance.astype(np.float64) * small.mapping.solid_angles(height)[..., None]
    # To the four pixels around, as bilinear interpolation does: a sun's middle stays where it was.
    down, across = _shares(height, rows, wraps=False), _shares(width, 2 * rows, wraps=True)
    flux = np.einsum("rh,hwc->rwc", down, flux, optimize=True)
    flux = np.einsum("rwc,kw->rkc", flux, across, optimize=True)
    by, directions = Smooth(), pixel_directions(LatLong(), rows)
    spectrum = np.zeros((len(lights), rows + 1, 3), np.complex128)
    for part in cut(rows, 16):
        weights = by.weights(lights, directions[part].reshape(-1, 3)).reshape(-1, 2 * rows, len(lights))
        share, of_map = np.fft.rfft(weights, axis=1), np.fft.rfft(flux[part], axis=1)  # (rows, F, N), (rows, F, 3)
        # Turned by ψ, right-handed, columns move to the left: u = ½ + longitude / 2π, longitude to the right of −Z.
        spectrum += np.einsum("rfn,rfc->nfc", share.conj(), of_map, optimize=True)
    spectrum /= 2 * rows
    spectrum[:, -1] /= 2  # the highest frequency has no second
    return TurningMap(spectrum)


def _shares(count: int, wanted: int, *, wraps: bool) -> np.ndarray:
    """What each of `wanted` pixels along a line has of each of `count`, (wanted, count); columns sum to 1."""
    place = (np.arange(count) + 0.5) * wanted / count - 0.5
    if not wraps:
        place = np.clip(place, 0, wanted - 1)
    first, shares = np.floor(place).astype(int), np.zeros((wanted, count))
    np.add.at(shares, (first % wanted, np.arange(count)), 1 - (place - first))
    np.add.at(shares, ((first + 1) % wanted, np.arange(count)), place - first)
    return shares

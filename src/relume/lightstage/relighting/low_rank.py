"""Relighting from a low-rank basis: the field's pictures as sums of few, found by its singular value decomposition.

R_i ≈ Σ_k coefficients[k, i] · basis_k, with the rows of `coefficients` orthonormal, so a picture is the sum of K
pictures instead of N. Mirrored lights are bright, small and different under every light: no basis holds them, and they
would spoil it. What stands far above the mean is kept apart, pixel by pixel, and added exactly; the
basis sees the pixel's mean under the other lights instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.cosine import CompressionError, ErrorTally, row_bands, total_of
from relume.lightstage.relighting.relighting import MEMORY, Progress, checked

SPIKE = 30.0
"""Times the field's mean value above which a value is kept apart: above matte surfaces that face the light, below
mirrored lights."""


@dataclass(frozen=True, eq=False)
class Spikes:
    """What stands out of the pictures: `values` (M, 3) float32 at `pixels` (M,), row by row, under `lights` (M,)."""

    values: np.ndarray
    pixels: np.ndarray
    lights: np.ndarray


@dataclass(frozen=True, eq=False)
class LowRank:
    """A field as a few basis pictures (`compress_low_rank`).

    lights : N of them
    basis : (K, H, W, 3) float16 or float32
    coefficients : (K, N) float64, orthonormal rows
    spikes : kept apart, exactly
    error : of the pictures it makes
    """

    lights: StageLights
    basis: np.ndarray
    coefficients: np.ndarray
    spikes: Spikes
    error: CompressionError

    @property
    def shape(self) -> tuple[int, int]:
        return self.basis.shape[1], self.basis.shape[2]

    @property
    def byte_count(self) -> int:
        """Bytes it takes."""
        spikes = self.spikes.values.nbytes + self.spikes.pixels.nbytes + self.spikes.lights.nbytes
        return self.basis.nbytes + self.coefficients.nbytes + spikes

    def relight(self, irradiances: np.ndarray) -> RadianceMap:
        """The subject under light of irradiances (N, 3), within `error`; ValueError as of `relighting.weighted_sum`."""
        from relume.lightstage.relighting.sum_kernel import add_points, blended

        given = checked(self.lights, irradiances)
        picture = blended(self.basis.reshape(len(self.basis), -1), self.coefficients @ given).reshape(-1, 3)
        add_points(picture, self.spikes.pixels, self.spikes.lights, self.spikes.values, given)
        return RadianceMap(picture.reshape(*self.shape, 3))


def compress_low_rank(
    field: ReflectanceField,
    *,
    error: float = 0.02,
    rank: int | None = None,
    memory: int = MEMORY,
    progress: Progress | None = None,
) -> LowRank:
    """The best basis of the field's pictures for a part of its energy, in three passes over it.

    field : whose pictures are compressed
    error : what of the pictures' root mean square may be lost, spikes left out; it sets the rank, and what comes of it
        under light is measured and stated. 0.02 unless given, which keeps a head on a 24 × 12 stage within 1 % under
        daylight maps, but with 245 basis pictures for its 288 lights: sharp shadows have no low rank
    rank : the number of basis pictures, whatever the error
    memory : bytes for blocks of the field; the basis is not counted
    progress : called with the share of the work that is done, 0 to 1
    Raises ValueError for an error or rank out of range and for a field that is black or not finite.
    """
    # The value above which a pixel is kept apart as a spike, by the field's mean.
    count = len(field.lights)
    if not 0 < error < 1 or (rank is not None and not 1 <= rank <= count):
        raise ValueError(f"error is {error} and rank {rank}; expected an error within 0…1, a rank within 1…{count}")
    (height, width), bands, everything = field.shape, row_bands(field, memory), slice(0, len(field.lights))
    above = np.float32(SPIKE * total_of(field, bands) / (count * height * width * 3))

    # The pictures without spikes, and their products with each other.
    products, found = np.zeros((count, count)), []
    for rows in bands:
        values = field.block(everything, rows).reshape(count, -1)
        held = _without_spikes(values, above)
        found.append(_spikes(values - held, rows.start * width))
        exact = held.astype(np.float64)
        products += exact @ exact.T
        if progress:
            progress(0.5 * rows.stop / height)
    spikes = Spikes(*(np.concatenate(part) for part in zip(*found, strict=True)))
    coefficients = _principal(products, error, rank)

    # The basis pictures, and how far sums of them are from the field.
    projected, tally = coefficients.astype(np.float32), ErrorTally(field.lights)
    greatest = np.abs(coefficients).sum(1).max() * float(above)
    kept = np.float16 if greatest < float(np.finfo(np.float16).max) else np.float32
    basis = np.empty((len(coefficients), height, width, 3), kept)
    for rows in bands:
        values = field.block(everything, rows).reshape(count, -1)
        held = _without_spikes(values, above)
        part = (projected @ held).astype(kept)
        basis[:, rows] = part.reshape(len(basis), -1, width, 3)
        remade = projected.T @ part.astype(np.float32) + (values - held)
        tally.add(values.reshape(count, -1, 3), remade.reshape(count, -1, 3))
        if progress:
            progress(0.5 + 0.5 * rows.stop / height)
    return LowRank(field.lights, basis, coefficients, spikes, tally.stated())


def _principal(products: np.ndarray, error: float, rank: int | None) -> np.ndarray:
    """The first right singular vectors (K, N) of pictures whose products with each other are given (N, N)."""
    energies, vectors = np.linalg.eigh(products)
    energies, vectors = np.maximum(energies[::-1], 0), vectors[:, ::-1].T
    if rank is None:
        left = np.append(np.cumsum(energies[::-1])[::-1], 0.0)  # of the energy, after so many
        rank = max(1, int(np.argmax(left <= error**2 * energies.sum())))
    return np.ascontiguousarray(vectors[:rank])


def _without_spikes(values: np.ndarray, above: np.float32) -> np.ndarray:
    """Pictures (N, values) where what exceeds `above` is as the pixel's mean under the other lights."""
    pixels = values.reshape(len(values), -1, 3)
    spikes = np.any(pixels > above, axis=2)
    others = np.maximum(len(values) - np.sum(spikes, axis=0), 1)[:, None]
    mean = np.where(spikes[..., None], np.float32(0), pixels).sum(0, dtype=np.float64) / others
    return np.where(spikes[..., None], mean.astype(np.float32), pixels).reshape(values.shape)


def _spikes(excess: np.ndarray, offset: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What is not 0 in pictures (N, values): by pixel, then by light."""
    pixels = excess.reshape(len(excess), -1, 3)
    at, light = np.nonzero(pixels.any(2).T)
    return pixels[light, at], (at + offset).astype(np.int64), light.astype(np.int32)

"""Relighting from compressed reflectance functions: the product is summed in the cosine domain (paper §3.3, end).

A pixel's values under all lights, laid out by inclination and azimuth, are its reflectance function; its cosine
transform is orthonormal, so Σ R·E over the lights is the same sum over coefficients (Smith and Rowe 1996 multiply
compressed pictures alike). Coefficients are rounded to one step and kept in 8 bits, tile by tile of 8×8 pixels; those
that round to nothing in the whole tile are left out, and larger ones have further digits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.relighting import MEMORY, Progress, checked, cut

TILE = 8
"""Pixels along the side of a tile: neighbours keep the same coefficients."""
_BASE, _DIGITS = 255, 4
"""Eight signed bits hold −127…127; four such digits hold every float that matters."""
_TRIALS = 16


@dataclass(frozen=True)
class CompressionError:
    """How far compressed pictures are from exact ones: Σ|difference| / Σ|exact| over a picture, measured at building.

    worst : the greatest under any single light in one channel; no light without negative parts does worse
    single : under each light alone, all of them taken together
    random : the greatest under 16 random lights (every cell's radiance drawn from an exponential distribution)
    """

    worst: float
    single: float
    random: float


class ErrorTally:
    """Gathers a `CompressionError` over the blocks of a field."""

    def __init__(self, lights: StageLights) -> None:
        radiance = np.random.default_rng(0).exponential(size=(_TRIALS, len(lights)))
        self._random = (radiance * lights.solid_angles).astype(np.float32)
        self._light = np.zeros((2, len(lights), 3))
        self._trial = np.zeros((2, _TRIALS))

    def add(self, exact: np.ndarray, compressed: np.ndarray) -> None:
        """Values (N, pixels, 3) of a block and what became of them."""
        difference = compressed - exact
        for place, values in enumerate((difference, exact)):
            self._light[place] += np.abs(values).sum(1, dtype=np.float64)
            self._trial[place] += np.abs(self._random @ values.reshape(len(values), -1)).sum(1, dtype=np.float64)

    def stated(self) -> CompressionError:
        """The errors of all that was added; a channel that is black under a light counts nowhere."""
        error, sums = self._light
        lit = sums > 1e-6 * sums.max()
        if not lit.any():
            return CompressionError(0.0, 0.0, 0.0)
        ratios = error[lit] / sums[lit]
        return CompressionError(
            float(ratios.max()), float(error.sum() / sums.sum()), float((self._trial[0] / self._trial[1]).max())
        )


@dataclass(frozen=True)
class Grid:
    """The lights laid out as a picture of their own: rows by inclination, columns by azimuth.

    which : (rows · columns,) the light at each place
    own : (rows · columns,) whether the light stands there; else it only fills a short row
    """

    rows: int
    columns: int
    which: np.ndarray
    own: np.ndarray

    def transformed(self, values: np.ndarray) -> np.ndarray:
        """Orthonormal cosine transform of values (N, …) over the lights: (rows · columns, …)."""
        from scipy.fft import dctn

        laid_out = values[self.which].reshape(self.rows, self.columns, -1)
        return np.asarray(dctn(laid_out, axes=(0, 1), norm="ortho", workers=-1)).reshape(
            len(self.which), *values.shape[1:]
        )

    def light(self, irradiances: np.ndarray) -> np.ndarray:
        """The transform of irradiances (N, 3), each counted once."""
        from scipy.fft import dctn

        laid_out = np.where(self.own[:, None], irradiances[self.which], 0.0).reshape(self.rows, self.columns, 3)
        return np.asarray(dctn(laid_out, axes=(0, 1), norm="ortho")).reshape(-1, 3)

    def restored(self, coefficients: np.ndarray) -> np.ndarray:
        """Values (N, …) of coefficients (rows · columns, …)."""
        from scipy.fft import idctn

        shape = (self.rows, self.columns, -1)
        laid_out = idctn(coefficients.reshape(shape), axes=(0, 1), norm="ortho", workers=-1)
        flat = np.asarray(laid_out).reshape(coefficients.shape)
        values = np.empty((int(self.own.sum()), *coefficients.shape[1:]), flat.dtype)
        values[self.which[self.own]] = flat[self.own]
        return values


def laid_out(lights: StageLights) -> Grid:
    """The lights' own grid; where they have none, rows of nearly as many each by inclination, by azimuth within.

    Nothing is resampled: every light has a place of its own, and only those at the end of a short row are repeated,
    without irradiance.
    """
    if lights.grid is not None:
        count = len(lights)
        return Grid(lights.grid[0], lights.grid[1], np.arange(count), np.ones(count, bool))
    rows = max(1, round((len(lights) / 2) ** 0.5))
    by_inclination = np.argsort(-lights.directions[:, 1], kind="stable")
    azimuth = np.arctan2(lights.directions[:, 0], lights.directions[:, 2])
    parts = np.array_split(by_inclination, rows)
    columns = max(len(part) for part in parts)
    which, own = np.zeros((rows, columns), np.int64), np.zeros((rows, columns), bool)
    for row, part in enumerate(parts):
        ordered = part[np.argsort(azimuth[part], kind="stable")]
        which[row] = np.append(ordered, np.repeat(ordered[-1:], columns - len(part)))
        own[row, : len(part)] = True
    return Grid(rows, columns, which.ravel(), own.ravel())


@dataclass(frozen=True, eq=False)
class CosineField:
    """A field's reflectance functions, cosine transformed, rounded and sparse (`compress_cosine`).

    lights, shape : of the field
    grid : how its lights are laid out
    step : what a coefficient's last digit stands for
    starts : (tiles + 1,) int64, where the entries of each tile of 8×8 pixels begin, row by row
    kinds : (entries,) int32, coefficient · 4 + digit
    digits : (entries, 3, 64) int8, −127…127, worth step · 255^digit
    error : of the pictures it makes
    """

    lights: StageLights
    shape: tuple[int, int]
    grid: Grid
    step: float
    starts: np.ndarray
    kinds: np.ndarray
    digits: np.ndarray
    error: CompressionError

    @property
    def byte_count(self) -> int:
        """Bytes it takes."""
        return self.starts.nbytes + self.kinds.nbytes + self.digits.nbytes

    def relight(self, irradiances: np.ndarray) -> RadianceMap:
        """The subject under light of irradiances (N, 3), within `error`; ValueError as of `relighting.weighted_sum`."""
        from relume.lightstage.relighting.sum_kernel import summed_tiles

        light = self.grid.light(checked(self.lights, irradiances))
        worth = self.step * float(_BASE) ** np.arange(_DIGITS)
        weights = (light[:, None, :] * worth[None, :, None]).reshape(-1, 3).astype(np.float32)
        height, width = (-(-size // TILE) * TILE for size in self.shape)
        picture = np.empty((height, width, 3), np.float32)
        summed_tiles(self.starts, self.kinds, self.digits, weights, picture)
        return RadianceMap(np.ascontiguousarray(picture[: self.shape[0], : self.shape[1]]))


def compress_cosine(
    field: ReflectanceField, *, step: float = 0.1, memory: int = MEMORY, progress: Progress | None = None
) -> CosineField:
    """The field's reflectance functions in the cosine domain, in two passes over it.

    field : whose functions are compressed
    step : what coefficients are rounded to, as part of the field's mean value. The error goes with it; 0.1 keeps a head
        on a 24 × 12 stage within 1 % under daylight maps, in an eighth of the bytes of float32
    memory : bytes for blocks of the field; the compressed field is not counted
    progress : called with the share of the work that is done, 0 to 1
    Raises ValueError for a step that is not above 0 and for a field that is black or not finite.
    """
    if not 0 < step < np.inf:
        raise ValueError(f"step is {step}; expected a part of the mean value above 0, as 0.1")
    (height, width), count = field.shape, len(field.lights)
    grid = laid_out(field.lights)
    bands = row_bands(field, memory)
    size = step * total_of(field, bands) / (count * height * width * 3)
    tally, counts, kinds, digits = ErrorTally(field.lights), [np.zeros(1, np.int64)], [], []
    for rows in bands:
        values = field.block(slice(0, count), rows)
        rounded = np.rint(grid.transformed(values) / np.float32(size))
        if np.abs(rounded).max() > _BASE ** (_DIGITS - 1):
            raise ValueError(f"step is {step}; too fine for this field's brightest values, give more")
        kept = grid.restored(rounded * np.float32(size))
        tally.add(values.reshape(count, -1, 3), kept.reshape(count, -1, 3))
        del values, kept
        entries = _entries(rounded.astype(np.int32))
        for gathered, part in zip((counts, kinds, digits), entries, strict=True):
            gathered.append(part)
        if progress:
            progress(rows.stop / height)
    starts = np.cumsum(np.concatenate(counts))
    return CosineField(
        field.lights, field.shape, grid, size, starts, np.concatenate(kinds), np.concatenate(digits), tally.stated()
    )


def row_bands(field: ReflectanceField, memory: int) -> tuple[slice, ...]:
    """Bands of whole tiles of all lights that fit into memory with what is made of them, a row of tiles at least."""
    row = len(field.lights) * field.shape[1] * 3 * 4 * 6
    return cut(field.shape[0], max(1, memory // (row * TILE)) * TILE)


def total_of(field: ReflectanceField, bands: Sequence[slice]) -> float:
    """The sum of a field's magnitudes; raises ValueError for one that is black or not finite."""
    every = slice(0, len(field.lights))
    total = sum(float(np.abs(field.block(every, rows)).sum(dtype=np.float64)) for rows in bands)
    if not 0 < total < np.inf:
        raise ValueError(f"the field's values sum to {total}; expected pictures that are not all black, and finite")
    return total


def _entries(rounded: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of coefficients (M, rows, columns, 3) in steps: entries a tile (tiles,), their kinds, and their digits."""
    count, height, width = rounded.shape[:3]
    down, across = -(-height // TILE), -(-width // TILE)
    room = ((0, 0), (0, down * TILE - height), (0, across * TILE - width), (0, 0))
    tiles = np.pad(rounded, room).reshape(count, down, TILE, across, TILE, 3)
    rest = tiles.transpose(1, 3, 0, 5, 2, 4).reshape(down * across, count, 3, TILE * TILE)
    found = np.zeros((down * across, count, _DIGITS), bool)
    planes = np.zeros((down * across, count, _DIGITS, 3, TILE * TILE), np.int8)
    for digit in range(_DIGITS):
        found[:, :, digit] = rest.any((2, 3))
        if not found[:, :, digit].any():
            break
        # Balanced digits: what is left divides by the base without rest.
        low = (rest + _BASE // 2) % _BASE - _BASE // 2
        found[:, :, digit] = low.any((2, 3))
        planes[:, :, digit] = low
        rest = (rest - low) // _BASE
    _, coefficient, digit = np.nonzero(found)
    return found.sum((1, 2)).astype(np.int64), (coefficient * _DIGITS + digit).astype(np.int32), planes[found]

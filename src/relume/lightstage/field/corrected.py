"""A reflectance field put right as it is read: evenness, colour and intensity of the lights, and what said nothing.

Value by value, R' = gain · R / pattern: the gain of the light's channel (`calibration`), the pattern of the light over
the picture (`fall_off`); what a mask calls empty is then filled from the lights around (`filling`). Nothing is kept:
a block is corrected when it is asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from relume.lightstage.field.fall_off import FlatField, NearLights
from relume.lightstage.field.field import Derived, Noise, ReflectanceField
from relume.lightstage.field.filling import filled
from relume.lightstage.field.invalid_samples import Mask

_WORKING_MEMORY = 256 << 20
_SAMPLED_LIGHTS = 24
_LEVELS = 12
_LIT = 0.05
"""Of the brightest of a mean picture, above which a pixel shows the subject."""
_NOISE_MEMORY = 512 << 20
_BAND = 32
"""Rows of a piece of a large picture in which noise is looked for."""
_MEDIAN_TO_DEVIATION = 1.4826
"""Of a normal distribution: its standard deviation over the median of its magnitude."""


@dataclass(frozen=True, eq=False)
class Corrected(Derived):
    """A reflectance field with its lights made even and its empty values filled.

    field : as taken
    gains : (N, 3), as of a `Calibration`; None for 1
    flat : patterns to divide by; None where the lights are even
    masks : what one of them at least calls empty says nothing
    measured_noise : of the field as taken, where it does not know its own (`estimate_noise`); its own unless given

    A block with masked values takes those rows under all lights, in bands of a quarter of a gibibyte.
    """

    field: ReflectanceField
    gains: np.ndarray | None = None
    flat: FlatField | NearLights | None = None
    masks: Sequence[Mask] = ()
    measured_noise: Noise | None = None

    @property
    def noise(self) -> Noise | None:
        """The field's noise through the correction.

        With R' = f R the variance c + s R becomes f² c + f s R'; one noise stands for all lights and channels, so f²
        and f are their means over these and over a sample of rows. Filled values count as measured ones, though they
        are means and less noisy.
        """
        taken = self.field.noise if self.measured_noise is None else self.measured_noise
        if taken is None:
            return None
        factor, square = np.ones((1, 1)), np.ones((1, 1))
        if self.gains is not None:
            factor, square = self.gains.mean(axis=1)[:, None], (self.gains**2).mean(axis=1)[:, None]
        if self.flat is not None:
            height = self.shape[0]
            rows = np.unique(np.linspace(0, height - 1, min(height, 9)).astype(int))
            everything = slice(0, len(self.lights))
            inverse = np.concatenate([1 / self.flat.pattern(everything, slice(r, r + 1)) for r in rows], axis=1)
            factor = factor * inverse.mean(axis=(1, 2))[:, None]
            square = square * (inverse**2).mean(axis=(1, 2))[:, None]
        return Noise(float(taken.constant * square.mean()), float(taken.slope * factor.mean()))

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        if not any(mask.block(lights, rows).any() for mask in self.masks):
            return self._even(lights, rows)
        chosen = range(self.shape[0])[rows]
        result = np.empty((len(range(len(self.lights))[lights]), len(chosen), self.shape[1], 3), np.float32)
        band = max(1, _WORKING_MEMORY // (len(self.lights) * self.shape[1] * 12))
        everything = slice(0, len(self.lights))
        for first in range(0, len(chosen), band):
            part = slice(chosen[first], chosen[min(first + band, len(chosen)) - 1] + 1)
            masked = np.any([mask.block(everything, part) for mask in self.masks], axis=0)
            if masked[lights].any():
                done = filled(self._even(everything, part), masked, self.lights, lights)
            else:
                done = self._even(lights, part)
            result[:, first : first + band] = done
        return result

    def _even(self, lights: slice, rows: slice) -> np.ndarray:
        """A block with gains and patterns applied."""
        values = self.field.block(lights, rows)
        if self.gains is not None:
            values = values * self.gains[lights, None, None, :].astype(np.float32)
        if self.flat is not None:
            values = values / self.flat.pattern(lights, rows)[..., None]
        return values


def estimate_noise(field: ReflectanceField, *, step: float = 0.0) -> Noise:
    """The noise of a field, from how much neighbouring pixels of its own pictures differ where the subject is smooth.

    Each picture is put through a filter that no plane and no edge along rows or columns passes; where the mean of
    the pictures, in which noise is averaged away, passes it least, the median magnitude at a level of brightness is
    the noise there, and constant and slope are fitted to the levels.

    step : of the codes the pictures were taken in (1/255 for 8 bit, times the scale), in the field's values; an even
        rounding error, of variance step²/12, is not below what the result says
    Texture that stays in the smoothest quarter counts as noise. Of merged brackets the noise of the merge is found, as
    if it were one for all pixels of a level, and not the variance that a merge gives for each. Large pictures are
    sampled in bands of rows, within half a gibibyte. Raises ValueError for pictures of fewer than 8 × 8 pixels and
    where nothing is lit.
    """
    height, width = field.shape
    if min(height, width) < 8:
        raise ValueError(f"pictures of {width}×{height}; their noise is seen from 8×8 on")
    sampled = np.unique(np.linspace(0, len(field.lights) - 1, min(len(field.lights), _SAMPLED_LIGHTS)).astype(int))
    # Pictures, detail, levels and what is between them, six arrays of float64.
    bands = _bands(height, _NOISE_MEMORY // (6 * 8 * len(sampled) * width * 3))
    pictures = np.stack([field.block(slice(i, i + 1), slice(0, height))[0][bands] for i in sampled]).astype(np.float64)
    detail, levels = _detail(pictures), ndimage.uniform_filter(pictures, 3, axes=(-3, -2))
    smooth = _smooth_pixels(pictures.mean(axis=0))
    usable = smooth[None] & _above_black(pictures)
    if usable.sum() < 64:
        raise ValueError("the pictures are dark, or nowhere smooth; give their noise")
    noise = _fitted(levels[usable], detail[usable])
    return replace(noise, constant=max(noise.constant, step**2 / 12))


def _bands(height: int, most: int) -> np.ndarray:
    """Rows (bands, rows) spread evenly over a picture, about `most` of them; all in one band where they are no more."""
    if height <= max(most, _BAND):
        return np.arange(height)[None]
    count = max(1, most // _BAND)
    starts = (np.arange(count) + 0.5) * (height / count) - _BAND / 2
    return starts.astype(int)[:, None] + np.arange(_BAND)


def _detail(pictures: np.ndarray) -> np.ndarray:
    """Pictures (…, H, W, 3) through the second difference along rows and columns, in units of a pixel's own noise."""
    second = np.array([1.0, -2.0, 1.0])
    down = ndimage.convolve1d(pictures, second, axis=-3, mode="reflect")
    # The squares of the nine weights sum to 36.
    return ndimage.convolve1d(down, second, axis=-2, mode="reflect") / 6


def _above_black(pictures: np.ndarray) -> np.ndarray:
    """Which values (…, H, W, 3) are bright enough for their noise to be whole: black cut off at 0 has lost half."""
    neighbourhood = (1,) * (pictures.ndim - 3) + (5, 5, 1)
    return ndimage.minimum_filter(pictures, neighbourhood) > 0


def _smooth_pixels(mean: np.ndarray) -> np.ndarray:
    """The quarter (…, H, W, 3) of the lit pixels of a mean picture that has least detail for its brightness.

    Black cloth behind the subject is not lit: codes that stand still there would be all that is seen.
    """
    detail = ndimage.maximum_filter(np.abs(_detail(mean)), (1,) * (mean.ndim - 3) + (3, 3, 1))
    lit = mean > _LIT * np.percentile(mean, 99)
    if not lit.any():
        return lit
    relative = detail / np.where(lit, np.sqrt(np.where(lit, mean, 1)), 1)
    smooth = lit & (relative <= np.quantile(relative[lit], 0.25))
    # The picture's border is mirrored and differs from itself by less.
    smooth[..., [0, -1], :, :] = False
    smooth[..., [0, -1], :] = False
    return smooth


def _fitted(levels: np.ndarray, deviations: np.ndarray) -> Noise:
    """Constant and slope, neither below 0, of the variance over levels of brightness."""
    from scipy.optimize import nnls

    edges = np.unique(np.quantile(levels, np.linspace(0, 1, _LEVELS + 1)))
    if len(edges) < 2:
        return Noise(float((_MEDIAN_TO_DEVIATION * np.median(np.abs(deviations))) ** 2))
    bins = np.clip(np.searchsorted(edges, levels, side="right") - 1, 0, len(edges) - 2)
    filled = [b for b in range(len(edges) - 1) if np.count_nonzero(bins == b) >= 16]
    variances = np.array([(_MEDIAN_TO_DEVIATION * np.median(np.abs(deviations[bins == b]))) ** 2 for b in filled])
    middles = np.array([levels[bins == b].mean() for b in filled])
    if not variances.any():
        return Noise(0.0)
    # A variance is known to a share of itself.
    weights = 1 / np.maximum(variances, 1e-3 * variances.max())
    constant, slope = nnls(np.stack([weights, middles * weights], axis=1), variances * weights)[0]
    return Noise(float(constant), float(slope))

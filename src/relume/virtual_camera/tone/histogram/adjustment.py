"""Histogram adjustment: what can be seen in the scene can be seen on the screen, and no more (Ward Larson, Rushmeier &
Piatko 1997, "A Visibility Matching Tone Reproduction Operator for High Dynamic Range Scenes", IEEE TVCG 3(4))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads
from relume.image.colour import LUMINANCE_WEIGHTS, luminance
from relume.virtual_camera.protocols import Adaptation
from relume.virtual_camera.tone.display_range import DisplayRange
from relume.virtual_camera.tone.histogram.curve import (
    BRIGHTEST,
    DARKEST,
    FINE,
    INFINITE,
    Contrast,
    HumanContrast,
    LinearContrast,
    bin_logarithms,
    gains,
)
from relume.virtual_camera.tone.histogram.eye import (
    SHARE,
    blurred_by_acuity,
    colours_in_the_dark,
    veil_luminance,
    veiled,
)
from relume.virtual_camera.tone.histogram.fovea import FOVEA, foveal_samples
from relume.virtual_camera.tone.histogram.kernels import counted, shown_by
from relume.virtual_camera.tone.luminance_curve import MOST, without_overflow
from relume.virtual_camera.tone.luminance_statistics import log_average
from relume.virtual_camera.view import View

_UNITS = 1e-30, 1e30
"""Log means by which single precision can represent the other luminances."""


@dataclass(frozen=True)
class HistogramAdjustment:
    """Spends the screen's range on the luminances that occur: one curve for the picture, as Radiance's `pcond` has.

    screen : what the picture is shown on
    contrast : how much steeper than the world the curve may be. `LinearContrast`, as `pcond` without options, shows
        all there is, whatever the picture's unit; `HumanContrast` (`pcond -s`) nothing that an eye there would miss
    veil : whether light scattered in the eye lies over the picture (`-v`)
    acuity : whether detail is lost in the dark (`-a`)
    colour : whether colours are lost in the dark (`-c`)
    centre_weighted : whether samples count less, the farther they are from the middle (`-w`)

    Source: Ward Larson, Rushmeier & Piatko 1997. Half of the histogram is of foveal samples, a degree wide, and half of
    all pixels; `pcond` draws pixels for the second half, 16 to a foveal sample, and differs by what it happens to draw.
    A scene that fits on the screen is exposed in proportion: there the curve gives way to a plain factor at once.
    """

    screen: DisplayRange = DisplayRange()
    contrast: Contrast = LinearContrast()
    veil: bool = False
    acuity: bool = False
    colour: bool = False
    centre_weighted: bool = False

    @staticmethod
    def human(screen: DisplayRange = DisplayRange()) -> HistogramAdjustment:
        """With all that the paper models of the eye, as `pcond -h`, for a `screen`."""
        return HistogramAdjustment(screen, HumanContrast(), veil=True, acuity=True, colour=True)

    @property
    def absolute(self) -> bool:
        """Whether luminances have to be in cd/m²."""
        return self.acuity or self.colour or self.contrast.absolute

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """Logarithms of the luminance that counts as 1 (cd/m²), and by it of the mean, the least and the greatest of
        all samples; then the share of every bin of the fine histogram.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)

        1 is the picture's log mean, or, where the contrast is of an eye, 1 cd/m². What is below 1e-7 of it
        counts as black, and is no sample; what is above 1e7 is shown as that.
        The veil lies over the foveal samples alone, as in `pcond`: a curve that knew it of all pixels would stretch its
        grey to the screen's black again.
        """
        unit = 1.0 if self.contrast.absolute else float(np.clip(log_average(radiance), *_UNITS)) * view.luminance_scale
        scale = view.luminance_scale / unit
        pixels, least, most = _counted(radiance, scale)
        if most * max(1.0, 1 / scale) > MOST:
            radiance = without_overflow(radiance, scale)
            pixels, least, most = _counted(radiance, scale)
        foveal = foveal_samples(radiance, view)
        if self.veil:
            foveal = (1 - SHARE) * foveal + veil_luminance(foveal, view, radiance.shape[:2])
        fovea = luminance(foveal).astype(np.float32) * np.float32(scale)
        halves = (fovea.view(np.uint32) >> 16).ravel()
        weights = _centre_weights(fovea.shape, radiance.shape[:2], view).ravel() if self.centre_weighted else None
        samples = np.bincount(halves, weights, 1 << 15)[FINE.start : INFINITE]
        shares = 0.5 * pixels[FINE.start : INFINITE] / pixels.sum() + 0.5 * samples / max(samples.sum(), 1e-30)
        mean, extremes = 0.0, (DARKEST, DARKEST)
        if shares.any():
            mean = float(shares @ bin_logarithms() / shares.sum())
            extremes = min(least, fovea.min(initial=least, where=fovea > 0)), max(most, fovea.max())
        bins = FINE.stop - FINE.start
        kept = np.append(shares[: bins - 1], shares[bins - 1 :].sum())
        return Adaptation(np.concatenate([[np.log(unit), mean], np.log(np.clip(extremes, DARKEST, BRIGHTEST)), kept]))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Linear display values: the eye's losses where they are asked for, then the curve, a factor to each pixel.

        radiance, view, adaptation : (H, W, 3) float32 in the picture's unit, the picture's view (`VirtualCamera.view`),
            and what `adapt` returned
        """
        unit, mean, darkest, brightest, *_ = adaptation.values
        scale = float(view.luminance_scale / np.exp(unit))
        if self.veil or self.acuity or self.colour:
            radiance = without_overflow(radiance, scale)
        seen = veiled(radiance, view) if self.veil else radiance
        if self.acuity or self.colour:
            fovea = luminance(foveal_samples(seen, view)).astype(np.float64) * view.luminance_scale
            own = None if seen is radiance else seen
            if self.acuity:
                seen = own = blurred_by_acuity(seen, view, fovea, out=own)
            if self.colour:
                seen = own = colours_in_the_dark(seen, fovea, out=own)
        table = gains(adaptation.values[4:], mean, darkest, brightest, self.screen, self.contrast) * np.float32(scale)
        display = np.empty(seen.shape, np.float32) if seen is radiance else seen
        weights = _weights(scale)
        in_threads(lambda begin, end: shown_by(seen, *weights, table, begin, end, display), len(seen), chunk=32)
        return display


def _weights(scale: float) -> tuple[np.float32, np.float32, np.float32]:
    """Of linear R, G, B in a luminance of another unit."""
    red, green, blue = (LUMINANCE_WEIGHTS * scale).astype(np.float32)
    return red, green, blue


def _counted(radiance: np.ndarray, scale: float) -> tuple[np.ndarray, float, float]:
    """The pixels in each upper half of a float32, and the least luminance above 0 and the greatest, times `scale`."""
    weights = _weights(scale)
    bands = in_threads(lambda begin, end: counted(radiance, *weights, begin, end), len(radiance), chunk=64)
    counts, least, most = zip(*bands, strict=True)
    return np.sum(counts, axis=0), float(min(least)), float(max(most))


def _centre_weights(shape: tuple[int, int], picture: tuple[int, int], view: View) -> np.ndarray:
    """(h, w), a paraboloid of the distance from the middle in degrees: 1 there, 0 at 90."""
    distances = (
        (np.arange(samples) - (samples - 1) / 2) * pixels / (samples * view.focal_length * FOVEA) / 90
        for samples, pixels in zip(shape, picture, strict=True)
    )
    y, x = distances
    return np.maximum(1 - x**2 - y[:, None] ** 2, 0)

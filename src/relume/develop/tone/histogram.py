"""Histogram adjustment: what can be seen in the scene can be seen on the screen, and no more (Ward Larson, Rushmeier &
Piatko 1997, "A Visibility Matching Tone Reproduction Operator for High Dynamic Range Scenes", IEEE TVCG 3(4))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.develop.steps import Adaptation, Screen
from relume.develop.tone.acuity import blurred_by_acuity
from relume.develop.tone.dark_colour import colours_in_the_dark
from relume.develop.tone.histogram_curve import (
    BRIGHTEST,
    DARKEST,
    FINE,
    Contrast,
    HumanContrast,
    LinearContrast,
    gains,
)
from relume.develop.tone.histogram_fovea import FOVEA, foveal_samples
from relume.develop.tone.veil import SHARE, veil_luminance, veiled
from relume.develop.view import View
from relume.image.colour import LUMINANCE_WEIGHTS, luminance


@dataclass(frozen=True)
class HistogramAdjustment:
    """Spends the screen's range on the luminances that occur: one curve for the picture, as Radiance's `pcond` has.

    screen : what the picture is shown on
    contrast : how much steeper than the world the curve may be. `LinearContrast`, as `pcond` without options, shows
        all there is and needs no absolute luminance; `HumanContrast` (`pcond -s`) nothing that an eye there would miss
    veil : whether light scattered in the eye lies over the picture (`-v`)
    acuity : whether detail is lost in the dark (`-a`)
    colour : whether colours are lost in the dark (`-c`)
    centre_weighted : whether samples count less, the farther they are from the middle (`-w`)

    Half of the histogram is of foveal samples, a degree wide, and half of all pixels; `pcond` draws pixels for the
    second half, 16 to a foveal sample, and differs by what it happens to draw.
    A scene that fits on the screen is exposed in proportion: there the curve gives way to a plain factor at once.
    """

    screen: Screen = Screen()
    contrast: Contrast = LinearContrast()
    veil: bool = False
    acuity: bool = False
    colour: bool = False
    centre_weighted: bool = False

    @staticmethod
    def human(screen: Screen = Screen()) -> HistogramAdjustment:
        """With all that the paper models of the eye, as `pcond -h`."""
        return HistogramAdjustment(screen, HumanContrast(), veil=True, acuity=True, colour=True)

    @property
    def absolute(self) -> bool:
        """Whether luminances have to be in cd/m²."""
        return self.acuity or self.colour or not isinstance(self.contrast, LinearContrast)

    def adapted(self, radiance: np.ndarray, view: View) -> Adaptation:
        """The logarithms of the least and the greatest luminance, and the share of every bin of the fine histogram.

        The veil lies over the foveal samples alone, as in `pcond`: a curve that knew it of all pixels would stretch its
        grey to the screen's black again. What is below 1e-7 cd/m² counts as black, and is no sample;
        what is above 1e7 counts as that.
        """
        pixels, least, most = _counted(radiance, view)
        foveal = foveal_samples(radiance, view)
        if self.veil:
            foveal = (1 - SHARE) * foveal + veil_luminance(foveal, view, radiance.shape[:2])
        fovea = luminance(foveal).astype(np.float32) * np.float32(view.luminance_scale)
        halves = (fovea.view(np.uint32) >> 16).ravel()
        weights = _centre_weights(fovea.shape, radiance.shape[:2], view).ravel() if self.centre_weighted else None
        samples = np.bincount(halves, weights, 1 << 15)[FINE]
        shares = 0.5 * pixels[FINE] / pixels.sum() + 0.5 * samples / max(samples.sum(), 1e-30)
        shares[-1] += 0.5 * pixels[FINE.stop :].sum() / pixels.sum()
        if not shares.any():
            least = most = DARKEST
        extremes = min(least, fovea.min(initial=least, where=fovea > 0)), max(most, fovea.max())
        return Adaptation(np.concatenate([np.log(np.clip(extremes, DARKEST, BRIGHTEST)), shares]))

    def displayed(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Linear display values: the eye's losses where they are asked for, then the curve, a factor to each pixel."""
        from relume._kernel import in_threads
        from relume.develop.tone.histogram_kernels import shown_by

        seen = veiled(radiance, view) if self.veil else radiance
        if self.acuity or self.colour:
            fovea = luminance(foveal_samples(seen, view)).astype(np.float64) * view.luminance_scale
            own = None if seen is radiance else seen
            if self.acuity:
                seen = own = blurred_by_acuity(seen, view, fovea, out=own)
            if self.colour:
                seen = own = colours_in_the_dark(seen, view, fovea, out=own)
        darkest, brightest = adaptation.values[:2]
        per_luminance = gains(adaptation.values[2:], darkest, brightest, self.screen, self.contrast)
        table = per_luminance * np.float32(view.luminance_scale)
        display = np.empty(seen.shape, np.float32) if seen is radiance else seen
        weights = _weights(view)
        in_threads(lambda begin, end: shown_by(seen, *weights, table, begin, end, display), len(seen), chunk=32)
        return display


def _weights(view: View) -> tuple[np.float32, np.float32, np.float32]:
    """Of linear R, G, B in a luminance in cd/m²."""
    red, green, blue = (LUMINANCE_WEIGHTS * view.luminance_scale).astype(np.float32)
    return red, green, blue


def _counted(radiance: np.ndarray, view: View) -> tuple[np.ndarray, float, float]:
    """The pixels in each upper half of a float32, and the least luminance above 0 and the greatest, cd/m²."""
    from relume._kernel import in_threads
    from relume.develop.tone.histogram_kernels import counted

    weights = _weights(view)
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

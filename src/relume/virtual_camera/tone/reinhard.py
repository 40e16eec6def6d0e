"""Photographic tone reproduction, for the whole picture and with dodging and burning (Reinhard, Stark, Shirley &
Ferwerda 2002)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.bands import in_threads
from relume.image.colour import luminance
from relume.virtual_camera.protocols import Adaptation, Pixelwise, Relative
from relume.virtual_camera.view import View

NEAR_BLACK = 1e-6
"""δ of eq. 1, as a share of the mean luminance: the paper gives no number, and a bare one would make the result depend
on the picture's unit. Of the memorial church and Grace Cathedral it moves the log average by 0.003 %."""
CENTRE = 1 / (2 * np.sqrt(2))
"""α₁ of eq. 5: of the centre's Gaussian two deviations are half its scale (0.35 in the paper's figures)."""
RATIO = 1.6
"""Of each scale to the one before, and of the surround to its centre: that of retinal cells (§3.2)."""
_REACH = 4.6
"""Widths α s to which a Gaussian is followed: light 1e9 times brighter than its surroundings ends unseen."""


@dataclass(frozen=True)
class _Keyed(Relative):
    """An operator that brings the log average to a key."""

    key: float | None = 0.18

    def __post_init__(self) -> None:
        if self.key is not None and not (np.isfinite(self.key) and self.key > 0):
            raise ValueError(f"key is {self.key}; expected a display value above 0, 0.18 for a usual scene, or None")

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """Log average (eq. 1), highest luminance and key of radiance (H, W, 3)."""
        return Adaptation(np.log(settled(radiance, self.key)))


@dataclass(frozen=True)
class Reinhard(_Keyed, Pixelwise):
    """Middle grey by the log average, highlights rolled off (Reinhard et al. 2002); colours keep their proportions.

    key : the display value that the log average goes to before highlights are compressed; 0.18 is a grey card's. 0.36
        and more for bright scenes as snow, 0.09 and less for dark ones (§3.1). None estimates it (Reinhard 2003)
    white : the luminance that becomes 1, where the log average is `key`; infinity compresses all (eq. 3). None is the
        picture's highest luminance, so that nothing saturates

    Adaptation: (3,), natural logarithms of log average, highest luminance and key. Of a black picture 0, 0 and the
    key's, and it stays black.
    """

    white: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.white is not None and not self.white > 0:
            raise ValueError(f"white is {self.white}; expected a luminance above 0, infinity, or None")

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Display values (H, W, 3) (eq. 2 and 4).

        radiance, view, adaptation : (H, W, 3) float32 in the picture's unit, the picture's view (`VirtualCamera.view`),
            and what `adapt` returned
        """
        from relume.virtual_camera.tone.luminance_curve import photographic

        average, highest, key = np.exp(adaptation.values)
        scale = float(key / average)
        return photographic(radiance, scale, scale * highest if self.white is None else self.white)


def settled(radiance: np.ndarray, key: float | None) -> tuple[float, float, float]:
    """Log average (eq. 1), highest luminance, and key; 1, 1 and the key of a black picture.

    A key of None is estimated: 0.18 · 4 ^ ((2 log₂ La − log₂ Lmin − log₂ Lmax) / (log₂ Lmax − log₂ Lmin)) of the
    picture's log average La and its 1st and 99th percentile (Reinhard 2003, "Parameter estimation for photographic
    tone reproduction"): a picture whose average lies high in its range is a bright scene.
    """
    from relume.virtual_camera.tone.luminance_statistics import light_sum, log_average, luminances, percentiles

    colour, highest = light_sum(radiance)
    if highest == 0:
        return 1.0, 1.0, 0.18 if key is None else key
    average = log_average(radiance, NEAR_BLACK * float(luminance(colour)))
    if key is None:
        least, most = percentiles(luminances(radiance), 1.0, 99.0)
        low, middle, high = np.log([least, average, most])
        # Of a picture all of one luminance nothing is known; averages beyond the percentiles are no brighter scenes.
        key = 0.18 * 4 ** float(np.clip((2 * middle - low - high) / (high - low), -1, 1)) if high > low else 0.18
    return average, highest, key


@dataclass(frozen=True)
class ReinhardLocal(_Keyed):
    """Middle grey by the log average; each pixel darkened by the light of its even surroundings, so that detail stays.

    key : the display value that the log average goes to before compression; 0.18 is a grey card's. None estimates it
    sharpening : φ, how soon an edge ends the surroundings; 8 is the paper's
    threshold : ε, contrast of centre to surround from which they are uneven; 0.05 is the paper's
    scales : how many sizes of surroundings are tried, each 1.6 times the one before, from 1 pixel; 8 is the paper's

    Source: Reinhard, Stark, Shirley & Ferwerda 2002, §3.2. As in the authors' own program the surroundings are the
    centre at the first scale that is uneven, or the largest: the paper's "first scale at which |V| < ε" would always be
    the smallest. Beyond the border the picture goes on as its mirror image. There is no white: luminances pass 1 where
    a spark is brighter than its surroundings alone.

    Adaptation: (3,), natural logarithms of log average, highest luminance and key.
    """

    sharpening: float = 8.0
    threshold: float = 0.05
    scales: int = 8

    def __post_init__(self) -> None:
        super().__post_init__()
        if not abs(self.sharpening) <= 50:
            raise ValueError(f"sharpening is {self.sharpening}; expected a power of two, −50 to 50; the paper's is 8")
        if not self.threshold > 0:
            raise ValueError(f"threshold is {self.threshold}; expected a contrast above 0; the paper's is 0.05")
        if not 1 <= self.scales <= 12:
            raise ValueError(f"scales is {self.scales}; expected 1 to 12; 12 reach over hundreds of pixels")

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Display values (H, W, 3) (eq. 9).

        radiance, view, adaptation : (H, W, 3) float32 in the picture's unit, the picture's view (`VirtualCamera.view`),
            and what `adapt` returned
        """
        from relume.virtual_camera.tone.luminance_curve import WEIGHTS
        from relume.virtual_camera.tone.reinhard_local_kernel import TILE, dodge_and_burn

        average, _, key = np.exp(adaptation.values)
        pixels = np.ascontiguousarray(radiance, dtype=np.float32)
        result = np.empty_like(pixels)
        taps, halves = gaussians(self.scales)
        sharpening = (2.0**self.sharpening * key / surroundings(self.scales) ** 2).astype(np.float32)
        scale, threshold = np.float32(key / average), np.float32(self.threshold)
        across = -(-pixels.shape[1] // TILE)

        def work(begin: int, end: int) -> None:
            for tile in range(begin, end):
                top, left = TILE * (tile // across), TILE * (tile % across)
                dodge_and_burn(pixels, WEIGHTS, scale, taps, halves, sharpening, threshold, top, left, result)

        in_threads(work, across * -(-pixels.shape[0] // TILE), chunk=1)
        return result


def surroundings(scales: int) -> np.ndarray:
    """(scales,) s of eq. 5 to 8, pixels: 1, 1.6, 2.56, …"""
    return RATIO ** np.arange(scales, dtype=np.float64)


def gaussians(scales: int) -> tuple[np.ndarray, np.ndarray]:
    """The centres' Gaussians exp(−x² / (α₁ s)²) of eq. 5, sampled, of sum 1 over both sides.

    returns : (scales, R + 1) float32, the middle first, and how many beside the middle each has
    """
    widths = CENTRE * surroundings(scales)
    halves = np.maximum(np.ceil(_REACH * widths), 1).astype(np.int64)
    places = np.arange(halves[-1] + 1)
    taps = np.exp(-((places / widths[:, None]) ** 2)) * (places <= halves[:, None])
    taps /= taps[:, :1] + 2 * taps[:, 1:].sum(1, keepdims=True)
    return taps.astype(np.float32), halves

"""Photographic tone reproduction for the whole picture (Reinhard, Stark, Shirley & Ferwerda 2002, §3.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.colour import luminance
from relume.virtual_camera.protocols import Adaptation
from relume.virtual_camera.view import View

NEAR_BLACK = 1e-6
"""δ of eq. 1, as a share of the mean luminance: the paper gives no number, and a bare one would make the result depend
on the picture's unit. Of the memorial church and Grace Cathedral it moves the log average by 0.003 %."""


@dataclass(frozen=True)
class Reinhard:
    """Middle grey by the log average, highlights rolled off as film does; colours keep their proportions.

    key : the display value that the log average goes to before highlights are compressed; 0.18 is a grey card's. 0.36
        and more for bright scenes as snow, 0.09 and less for dark ones (§3.1). None estimates it (Reinhard 2003)
    white : the luminance that becomes 1, where the log average is `key`; infinity compresses all (eq. 3). None is the
        picture's highest luminance, so that nothing saturates

    Adaptation: (3,), natural logarithms of log average, highest luminance and key. Of a black picture 0, 0 and the
    key's, and it stays black.
    """

    key: float | None = 0.18
    white: float | None = None

    @property
    def absolute(self) -> bool:
        return False

    def __post_init__(self) -> None:
        require_key(self.key)
        if self.white is not None and not self.white > 0:
            raise ValueError(f"white is {self.white}; expected a luminance above 0, infinity, or None")

    def adapt(self, radiance: np.ndarray, view: View) -> Adaptation:
        """Log average (eq. 1), highest luminance and key of radiance (H, W, 3)."""
        return Adaptation(np.log(settled(radiance, self.key)))

    def display_values(self, radiance: np.ndarray, view: View, adaptation: Adaptation) -> np.ndarray:
        """Display values (H, W, 3) (eq. 2 and 4)."""
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

    light = light_sum(radiance)
    if light.highest == 0:
        return 1.0, 1.0, 0.18 if key is None else key
    average = log_average(radiance, NEAR_BLACK * float(luminance(light.colour)))
    if key is None:
        least, most = percentiles(luminances(radiance), 1.0, 99.0)
        low, middle, high = np.log([least, average, most])
        # Of a picture all of one luminance nothing is known; averages beyond the percentiles are no brighter scenes.
        key = 0.18 * 4 ** float(np.clip((2 * middle - low - high) / (high - low), -1, 1)) if high > low else 0.18
    return average, light.highest, key


def require_key(key: float | None) -> None:
    """Raise ValueError for a key that is no display value."""
    if key is not None and not (np.isfinite(key) and key > 0):
        raise ValueError(f"key is {key}; expected a display value above 0, 0.18 for a usual scene, or None")

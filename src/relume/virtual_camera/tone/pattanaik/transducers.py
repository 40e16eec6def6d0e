"""How strongly the eye responds to light and to contrast: gains of cones and rods, and the transducers of each band.

Gains are those of Pattanaik, Ferwerda, Fairchild & Greenberg 1998. Their transducers, which the paper draws as curves,
are rebuilt here from what those stand for: thresholds by a published sensitivity to contrast, strong contrasts alike at
all scales. Scene and screen share them, so that they matter only where rods see. Luminances are in cd/m².
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.virtual_camera.tone.pattanaik.pyramid import PEAKS

COMMON_RESPONSE = 50.0
"""In thresholds: where all bands meet, as strong contrasts look alike at every scale (Georgeson & Sullivan 1975)."""
COMMON_CONTRAST = 1.0
"""The contrast at which they meet, a grating's greatest."""
BEYOND = 1 / 3
"""Exponent of the response to stronger contrasts yet, as that of brightness to luminance (Stevens 1961)."""
ROD_SHARE = 1 / 7
"""Of the rods' response in the achromatic one, beside the cones' own (Pattanaik et al. 1998)."""


def cone_gain(luminance: np.ndarray | float) -> np.ndarray:
    """What multiplies the signal of cones adapted to a luminance, 1/(0.555 (L + 1.0)^0.85) (Pattanaik et al. 1998).

    Weber's law would have the exponent 1: the rest is that brighter scenes look brighter, and of more contrast.
    """
    return 1 / (0.555 * np.power(np.asarray(luminance, np.float64) + 1.0, 0.85))


def rod_gain(luminance: np.ndarray | float) -> np.ndarray:
    """What multiplies the signal of rods, [10/(L² + 10)]/(0.908 (L + 0.001)^0.85): they saturate by day."""
    light = np.asarray(luminance, np.float64)
    return 10 / (light**2 + 10) / (0.908 * np.power(light + 0.001, 0.85))


def sensitivity(frequency: np.ndarray | float) -> np.ndarray:
    """Sensitivity to contrast at cycles per degree, 1 at its best near 8 (Mannos & Sakrison 1974)."""
    scaled = 0.114 * np.asarray(frequency, np.float64)
    return 2.6 * (0.0192 + scaled) * np.exp(-(scaled**1.1))


@dataclass(frozen=True)
class Transducer:
    """From a band's adapted contrast to a response, 1 at threshold: odd, monotonic, and so to be undone.

    threshold : adapted contrast that is just seen
    meeting : adapted contrast with COMMON_RESPONSE

    A straight line up to the threshold, another in logarithms up to the meeting of all bands, then the power BEYOND.
    """

    threshold: float
    meeting: float

    @property
    def is_blind(self) -> bool:
        """Whether even the strongest contrast stays below what the others respond to."""
        return self.threshold >= self.meeting

    @property
    def exponent(self) -> float:
        """Between threshold and meeting."""
        return 1.0 if self.is_blind else float(np.log(COMMON_RESPONSE) / np.log(self.meeting / self.threshold))

    def response(self, contrast: np.ndarray) -> np.ndarray:
        """In thresholds; 0 where blind."""
        size = np.abs(contrast)
        if self.is_blind:
            return np.zeros_like(size)
        strong = COMMON_RESPONSE * (np.maximum(size, self.meeting) / self.meeting) ** BEYOND
        bent = (np.maximum(size, self.threshold) / self.threshold) ** self.exponent
        weak = size / self.threshold
        found = np.where(size <= self.threshold, weak, np.where(size <= self.meeting, bent, strong))
        return np.copysign(found, contrast)


def _transducer(seen: float, best: float, adapted: float, gain: float) -> Transducer:
    """For a sensitivity, relative to the best, that is `best` at an adaptation where the gain is `gain`."""
    contrast = adapted * gain
    return Transducer(contrast / (best * max(seen, 1e-9)), COMMON_CONTRAST * contrast)


CONES = tuple(_transducer(float(sensitivity(peak)), 250.0, 100.0, float(cone_gain(100.0))) for peak in PEAKS)
"""Of the achromatic bands, the finest first: best sensitivity 250 at 100 cd/m² (van Nes & Bouman 1967)."""
RODS = tuple(_transducer(float(sensitivity(8 * peak)), 20.0, 0.01, float(rod_gain(0.01))) for peak in PEAKS)
"""Of the rods: best near 1 cycle per degree, where that is 20 at 0.01 cd/m², and blind above some 6 cycles per degree
(van Nes & Bouman 1967; D'Zmura & Lennie 1986)."""

"""What a screen makes of a PQ or HLG signal (ITU-R BT.2100-2): the way back from `relume.image.colour`."""

from __future__ import annotations

import numpy as np

from relume.image.colour import _A, _B, _C, _C1, _C2, _C3, _M1, _M2, BT2020_WEIGHTS, PQ_PEAK, hlg_gamma


def decode_pq(signal: np.ndarray | float) -> np.ndarray:
    """Luminance in cd/m² of a PQ signal, the EOTF (BT.2100-2, table 4); signals are clipped to 0 … 1."""
    root = np.clip(np.asarray(signal, np.float64), 0, 1) ** (1 / _M2)
    return PQ_PEAK * (np.maximum(root - _C1, 0) / (_C2 - _C3 * root)) ** (1 / _M1)


def decode_hlg(signal: np.ndarray | float) -> np.ndarray:
    """Linear scene light, 0 to 1, of an HLG signal, the inverse OETF (BT.2100-2, table 5); clipped to 0 … 1."""
    code = np.clip(np.asarray(signal, np.float64), 0, 1)
    return np.where(code <= 0.5, code**2 / 3, (np.exp((code - _C) / _A) + _B) / 12)


def hlg_displayed(scene: np.ndarray, peak: float = 1000.0) -> np.ndarray:
    """What a screen shows of HLG's scene light, the OOTF, α·Y^(γ−1)·E (BT.2100-2, table 5), black at 0 cd/m².

    scene : (..., 3) linear, BT.2020, 0 to 1
    peak : of the screen, cd/m²; 1000 is what the standard's nominal gamma is for
    returns : (..., 3) float64, cd/m²
    """
    light = np.maximum(np.asarray(scene, np.float64), 0)
    return peak * light * (light @ BT2020_WEIGHTS)[..., None] ** (hlg_gamma(peak) - 1)

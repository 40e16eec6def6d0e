"""How much light a lens gives its picture: from the luminance before it to the illuminance behind it."""

from __future__ import annotations

import numpy as np


def image_illuminance(
    luminance: np.ndarray | float, f_number: float, *, transmittance: float = 1.0, angle: np.ndarray | float = 0.0
) -> np.ndarray:
    """The illuminance of the sensor, lx: E = (π/4) τ L cos⁴α / N² (ISO 517; Debevec & Malik 1997, §2.1).

    luminance : L, cd/m², of what is seen there
    f_number : N
    transmittance : τ of the glass; 1 is a lens without loss, and the "T-stop" N / √τ holds it already
    angle : α from the axis, radians
    Holds for distances far beyond the focal length. Raises ValueError for an f-number or a transmittance that no lens
    has.
    """
    if not (np.isfinite(f_number) and f_number > 0):
        raise ValueError(f"the f-number is {f_number}; expected a positive number")
    if not 0 < transmittance <= 1:
        raise ValueError(f"the transmittance is {transmittance}; expected above 0, up to 1 for a lens without loss")
    return np.pi / 4 * transmittance * np.asarray(luminance, np.float64) * np.cos(angle) ** 4 / f_number**2

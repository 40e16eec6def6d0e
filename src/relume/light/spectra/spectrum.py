"""A spectrum, and the colour that it has: by the CIE 1931 observer to linear Rec. 709.

Sums are over 1 nm from 380 to 780 nm with everything interpolated linearly; light outside of that is not seen.
Colours are not adapted: white is D65, and what is yellower than that is yellow.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from relume.image.primaries import REC709
from relume.light.spectra.tables import COLOUR_MATCHING, ILLUMINANT_NAMES, ILLUMINANTS, table

SHORTEST, LONGEST = 380.0, 780.0
"""nm: what the eye sees."""


@dataclass(frozen=True)
class Spectrum:
    """Power, or a share, at wavelengths; in between it is linear, beyond both ends it is 0.

    wavelengths : nm, increasing
    values : as many, 0 or more, in any unit
    """

    wavelengths: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.wavelengths) != len(self.values) or len(self.values) < 2:
            raise ValueError(
                f"a spectrum has {len(self.wavelengths)} wavelengths and {len(self.values)} values; give as many, "
                "2 or more"
            )
        lengths, values = np.array(self.wavelengths, np.float64), np.array(self.values, np.float64)
        if not np.all(np.isfinite(lengths)) or not np.all(np.diff(lengths) > 0):
            raise ValueError("the wavelengths of a spectrum do not increase; sort them, in nm")
        if not np.all((values >= 0) & (values < np.inf)):
            raise ValueError("a spectrum has values below 0 or not finite; expected power, 0 or more")
        if lengths[-1] <= SHORTEST or lengths[0] >= LONGEST:
            raise ValueError(
                f"nothing of a spectrum from {lengths[0]:g} to {lengths[-1]:g} is seen; give wavelengths in nm, from "
                "380 to 780"
            )

    def at(self, wavelengths: np.ndarray) -> np.ndarray:
        """Its values at wavelengths of any shape, nm."""
        return np.interp(wavelengths, self.wavelengths, self.values, left=0.0, right=0.0)


def visible() -> np.ndarray:
    """(401,) the wavelengths that are summed over, nm."""
    return np.arange(SHORTEST, LONGEST + 1)


@lru_cache
def rgb_matching() -> np.ndarray:
    """(401, 3) the linear Rec. 709 colour of power 1 at each of the visible wavelengths; not to be written to.

    Each has a channel below 0: no wavelength alone is within Rec. 709. Luminance is that of ȳ, 1 at 555 nm.
    """
    rows = table(COLOUR_MATCHING)
    matching = np.stack([np.interp(visible(), rows[:, 0], rows[:, 1 + axis]) for axis in range(3)], axis=-1)
    found = matching @ np.linalg.inv(REC709.to_xyz()).T
    found.setflags(write=False)
    return found


@lru_cache
def illuminant(name: str) -> Spectrum:
    """A standard illuminant of the CIE: A (a filament), E (even), D50, D65, F2, F11 and others.

    name : like "D65"
    Raises ValueError that lists them for any other.
    """
    lengths = visible()
    if name == "E":
        return _spectrum(lengths, np.ones(lengths.size))
    if name == "A":
        # ISO/CIE 11664-2: the radiator at 2848 K by the c₂ of 1931, 100 at 560 nm.
        power = 100 * (560 / lengths) ** 5 * np.expm1(1.435e7 / (2848 * 560)) / np.expm1(1.435e7 / (2848 * lengths))
        return _spectrum(lengths, power)
    if name not in ILLUMINANT_NAMES:
        raise ValueError(f"no illuminant {name!r}; there are {', '.join(['A', *ILLUMINANT_NAMES, 'E'])}")
    rows = table(ILLUMINANTS)
    return _spectrum(rows[:, 0], rows[:, 1 + ILLUMINANT_NAMES.index(name)])


def blackbody(temperature: float) -> Spectrum:
    """Planck's radiator: its radiance by wavelength, W/(m² sr nm).

    temperature : kelvin
    Raises ValueError below 800 K.
    """
    if not 800 <= temperature < np.inf:
        raise ValueError(f"the temperature is {temperature:g} K; a radiator is seen from 800 K on: give K, like 2700")
    metres = visible() * 1e-9
    # CODATA 2018: 2hc² and hc/k.
    radiance = 1.191042972e-16 / metres**5 / np.expm1(1.438776877e-2 / (metres * temperature)) * 1e-9
    return _spectrum(visible(), radiance)


def _spectrum(lengths: np.ndarray, values: np.ndarray) -> Spectrum:
    return Spectrum(tuple(map(float, lengths)), tuple(map(float, values)))

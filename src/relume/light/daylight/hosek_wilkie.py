"""The sky model of Hošek & Wilkie, and the sun that they added to it: spectral radiance by direction.

L. Hošek & A. Wilkie, "An Analytic Model for Full Spectral Sky-Dome Radiance", SIGGRAPH 2012; "Adding a Solar-Radiance
Function to the Hošek–Wilkie Skylight Model", IEEE CG&A 33 (2013). Their published coefficients are `hosek_wilkie.npz`
(notice in `hosek_wilkie.LICENSE.txt`): 11 bands, 320 to 720 nm in steps of 40; spectra are straight lines between.
Radiance is W/(m²·sr·nm); `to_rgb` makes it cd/m² in linear Rec. 709.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from relume.image.primaries import REC709

WAVELENGTHS = np.arange(320.0, 721.0, 40.0)
CLEAREST, HAZIEST = 1.0, 10.0
_SEGMENTS = 45
"""Of the sun's elevation, each with a cubic polynomial."""
_FEET = ((540.0, 620.0), (460.0, 540.0))
"""nm between which a reflectance goes over from blue to green, and from green to red."""


@dataclass(frozen=True, eq=False)
class _Published:
    """Tables: (turbidity, albedo, control point, band[, coefficient]), (turbidity, segment, band, power), weights."""

    sky: np.ndarray
    sky_mean: np.ndarray
    sun: np.ndarray
    limb: np.ndarray
    xyz: np.ndarray


@cache
def _published() -> _Published:
    with np.load(Path(__file__).with_name("hosek_wilkie.npz")) as file:
        return _Published(**{name: file[name].astype(np.float64) for name in file.files})


def to_rgb(spectral: np.ndarray) -> np.ndarray:
    """(…, 3) cd/m² of linear Rec. 709 from spectral radiance (…, 11), by the CIE 1931 observer; may be negative."""
    return spectral @ _published().xyz.T @ np.linalg.inv(REC709.to_xyz()).T


def reflectances(colour: tuple[float, float, float]) -> np.ndarray:
    """(11,) of a colour of reflectance: blue below 460 nm, green at 540, red above 620, straight lines between."""
    red, green, blue = colour
    (g_end, r_full), (b_end, g_full) = _FEET
    return np.interp(WAVELENGTHS, [b_end, g_full, g_end, r_full], [blue, green, green, red])


@dataclass(frozen=True, eq=False)
class HosekWilkie:
    """The model for one sun, turbidity and ground.

    elevation : of the sun, radians, 0 to π/2
    turbidity : haze, 1 (air alone) to 10
    albedo : (11,) reflectance of the ground in each band
    """

    elevation: float
    turbidity: float
    albedo: np.ndarray

    def _blended(self, table: np.ndarray) -> np.ndarray:
        """A table at this turbidity, albedo and elevation: linear, linear, and a quintic Bézier curve over its root."""
        low = min(int(self.turbidity), int(HAZIEST) - 1)
        haze = self.turbidity - low
        pair = (1 - haze) * table[low - 1] + haze * table[low]
        ground = self.albedo.reshape(-1, *[1] * (pair.ndim - 3))
        points = (1 - ground) * pair[0] + ground * pair[1]
        x = (self.elevation / (np.pi / 2)) ** (1 / 3)
        weights = np.array([1, 5, 10, 10, 5, 1]) * x ** np.arange(6) * (1 - x) ** np.arange(5, -1, -1)
        return np.tensordot(weights, points, axes=1)

    def sky(self, cos_zenith: np.ndarray, from_sun: np.ndarray) -> np.ndarray:
        """Spectral radiance (…, 11) of the sky without the sun's disc.

        cos_zenith : (…,) of directions, 0 at the horizon
        from_sun : (…,) radians between each direction and the sun's middle
        """
        tables = _published()
        a, b, c, d, e, f, g, h, i = self._blended(tables.sky).T
        up, angle = cos_zenith[..., None], from_sun[..., None]
        cosine = np.cos(angle)
        # Eqs. 8 and 9.
        halo = (1 + cosine**2) / (1 + i**2 - 2 * i * cosine) ** 1.5
        towards_horizon = 1 + a * np.exp(b / (up + 0.01))
        from_the_sun = c + d * np.exp(e * angle) + f * cosine**2 + g * halo + h * np.sqrt(np.maximum(up, 0))
        return towards_horizon * from_the_sun * self._blended(tables.sky_mean)

    def sun(self, elevation: np.ndarray) -> np.ndarray:
        """Mean spectral radiance (…, 11) of the sun's disc at elevations (…,) in radians; 0 below the horizon."""
        low = min(int(self.turbidity), int(HAZIEST) - 1)
        haze = self.turbidity - low
        table = _published().sun
        pieces = (1 - haze) * table[low - 1] + haze * table[low]
        above = np.clip(elevation, 0, np.pi / 2)
        piece = np.minimum((np.cbrt(above / (np.pi / 2)) * _SEGMENTS).astype(int), _SEGMENTS - 1)
        x = above - (piece / _SEGMENTS) ** 3 * (np.pi / 2)
        radiance = np.einsum("...bk,...k->...b", pieces[piece], x[..., None] ** np.arange(4))
        return np.where(np.asarray(elevation)[..., None] > 0, np.maximum(radiance, 0), 0.0)


def limb_darkening(from_middle: np.ndarray) -> np.ndarray:
    """(…, 11) how bright the sun is at shares of its radius from its middle (…,), the mean over its disc 1.

    The published polynomials are 1 in the middle. The published solar radiance is already the mean: by it the sun
    outside the air, at turbidity 1, is as bright as measured; darkened once more it would be a fifth too dark.
    """
    limb = _published().limb
    cosine = np.sqrt(np.maximum(1 - np.asarray(from_middle) ** 2, 0))
    powers = np.arange(limb.shape[1])
    mean = limb @ (2 / (powers + 2))
    return cosine[..., None] ** powers @ limb.T / mean

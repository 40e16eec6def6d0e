"""What fills a body: a homogeneous medium that absorbs and scatters light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.scene.materials.checks import Colour, triple


@dataclass(frozen=True)
class Medium:
    """A homogeneous participating medium.

    absorption : σa per channel, 1/metre; 0 or more
    scattering : σs per channel, 1/metre; 0 or more
    anisotropy : g, the mean cosine of Henyey and Greenstein's phase function (1941); −1 to 1 exclusive, 0 even
    """

    absorption: Colour
    scattering: Colour = (0.0, 0.0, 0.0)
    anisotropy: float = 0.0

    def __post_init__(self) -> None:
        for field in ("absorption", "scattering"):
            value = np.asarray(getattr(self, field), float)
            if value.shape != (3,) or not np.all(np.isfinite(value)) or np.any(value < 0):
                raise ValueError(f"{field} of the medium is {value.tolist()}; expected three per metre, 0 or more")
        if not -1 < self.anisotropy < 1:
            raise ValueError(f"anisotropy of the medium is {self.anisotropy}; expected more than -1 and less than 1")

    @property
    def extinction(self) -> Colour:
        """The extinction σt = σa + σs per channel, 1/metre."""
        return triple(np.add(self.absorption, self.scattering))

    @property
    def albedo(self) -> Colour:
        """The albedo σs/σt per channel: the share of an encounter that scatters; 0 where nothing is encountered."""
        extinction = np.asarray(self.extinction)
        return triple(np.asarray(self.scattering) / np.where(extinction > 0, extinction, 1.0))

    def phase(self, cosine: np.ndarray) -> np.ndarray:
        """Henyey and Greenstein's phase function, 1/steradian, of the cosine between the ways before and after."""
        g = self.anisotropy
        return (1 - g * g) / (4 * np.pi * (1 + g * g - 2 * g * np.asarray(cosine, np.float64)) ** 1.5)

    def scattered_cosine(self, share: np.ndarray) -> np.ndarray:
        """The cosine between the ways before and after below which this share (N,), 0 to 1, of all scatterings is."""
        g, u = self.anisotropy, 2 * np.asarray(share, np.float64) - 1
        return u if abs(g) < 1e-3 else (1 + g * g - ((1 - g * g) / (1 + g * u)) ** 2) / (2 * g)

    def diffuse_reflectance(self) -> Colour:
        """The diffuse albedo of a half-space of the medium behind a matched boundary, per channel.

        Van de Hulst's fit as Kulla and Conty 2017 ("Revisiting physically based shading at Imageworks") print it, with
        s = √((1 − a)/(1 − a·g)); within 0.002 of the exact albedo for g = 0.
        """
        albedo = np.asarray(self.albedo)
        s = np.sqrt((1 - albedo) / (1 - albedo * self.anisotropy))
        return triple((1 - s) * (1 - 0.139 * s) / (1 + 1.17 * s))

"""Indices of refraction by wavelength: glasses of catalogues, crystals and water (dispersion).

Wavelengths are in nm, in air as the catalogues have them; coefficients in micrometres, as data sheets print them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

D_LINE, F_LINE, C_LINE = 587.5618, 486.1327, 656.2725
"""nm: helium's yellow line, hydrogen's blue and red ones, by which catalogues give n_d, n_F and n_C."""
VISIBLE = (380.0, 780.0)
"""nm, from violet to red."""


@dataclass(frozen=True)
class _Glass(ABC):
    """What has an index of refraction at each wavelength."""

    @abstractmethod
    def index(self, wavelengths: np.ndarray | float) -> np.ndarray:
        """The index n at `wavelengths` of any shape, nm."""

    @property
    def n_d(self) -> float:
        """The index at helium's yellow line, `Material.ior`."""
        return float(self.index(D_LINE))

    @property
    def abbe(self) -> float:
        """Abbe's number V_d = (n_d − 1)/(n_F − n_C); infinite without dispersion."""
        spread = float(self.index(F_LINE) - self.index(C_LINE))
        return (self.n_d - 1) / spread if spread > 0 else np.inf

    @property
    def dispersion(self) -> float:
        """20/V_d, as KHR_materials_dispersion has it."""
        return 20 / self.abbe

    def _check(self) -> None:
        with np.errstate(all="ignore"):
            ends = self.index(np.linspace(VISIBLE[0], VISIBLE[1], 41))
        if not np.all((ends >= 1) & (ends < 10)):
            raise ValueError(
                f"the coefficients {self} give no index of refraction from 1 to 10 between 380 and 780 nm; they belong "
                "to wavelengths in µm"
            )


@dataclass(frozen=True)
class Sellmeier(_Glass):
    """A glass by Sellmeier's formula, n² = 1 + Σ Bᵢ λ²/(λ² − Cᵢ) (Sellmeier 1871), as glass catalogues print it.

    B : no unit
    C : µm², as many
    """

    B: tuple[float, ...]
    C: tuple[float, ...]

    def __post_init__(self) -> None:
        if not self.B or len(self.B) != len(self.C):
            raise ValueError(f"Sellmeier's formula has {len(self.B)} B and {len(self.C)} C; give as many of each")
        self._check()

    def index(self, wavelengths: np.ndarray | float) -> np.ndarray:
        """The index n at `wavelengths` of any shape, nm."""
        square = (np.asarray(wavelengths, np.float64) * 1e-3) ** 2
        return np.sqrt(1 + sum(b * square / (square - c) for b, c in zip(self.B, self.C, strict=True)))


@dataclass(frozen=True)
class Cauchy(_Glass):
    """A glass by Cauchy's formula, n = A + B/λ² + C/λ⁴ (Cauchy 1830).

    A : no unit
    B : µm²
    C : µm⁴
    """

    A: float
    B: float
    C: float = 0.0

    def __post_init__(self) -> None:
        self._check()

    def index(self, wavelengths: np.ndarray | float) -> np.ndarray:
        """n at wavelengths of any shape, nm."""
        square = (np.asarray(wavelengths, np.float64) * 1e-3) ** 2
        return self.A + self.B / square + self.C / square**2


Glass = Sellmeier | Cauchy


def of_abbe(ior: float, dispersion: float) -> Cauchy:
    """Cauchy's two coefficients from n_d and 20/V_d (KHR_materials_dispersion); n is 1 at least.

    What is so dispersive that n would fall below 1 within 380 to 780 nm gets the most that it can have.
    """
    lines = [(line * 1e-3) ** -2 for line in (D_LINE, F_LINE, C_LINE)]
    slope = (ior - 1) * dispersion / 20 / (lines[1] - lines[2])
    red = (VISIBLE[1] * 1e-3) ** -2
    slope = min(slope, (ior - 1) / (lines[0] - red))
    return Cauchy(ior - slope * lines[0], slope)


def glass_named(name: str) -> Glass:
    """The glass of a name, of `GLASSES`.

    name : as glass catalogues have it, like "N-BK7"
    Raises ValueError that lists the names where there is none.
    """
    if name not in GLASSES:
        raise ValueError(f"no glass {name!r}; there are {', '.join(GLASSES)}")
    return GLASSES[name]


GLASSES: Mapping[str, Glass] = MappingProxyType(
    {
        # Schott's data sheets.
        "N-BK7": Sellmeier((1.03961212, 0.231792344, 1.01046945), (0.00600069867, 0.0200179144, 103.560653)),
        "N-BAK4": Sellmeier((1.28834642, 0.132817724, 0.945395373), (0.00779980626, 0.0315631177, 105.965875)),
        "N-LAK9": Sellmeier((1.46231905, 0.344399589, 1.15508372), (0.00724270156, 0.0243353131, 85.4686868)),
        "N-FK51A": Sellmeier((0.971247817, 0.216901417, 0.904651666), (0.00472301995, 0.0153575612, 168.68133)),
        "F2": Sellmeier((1.34533359, 0.209073176, 0.937357162), (0.00997743871, 0.0470450767, 111.886764)),
        "SF5": Sellmeier((1.46141885, 0.247713019, 0.949995832), (0.0111826126, 0.0508594669, 112.041888)),
        "SF6": Sellmeier((1.72448482, 0.390104889, 1.04572858), (0.0134871947, 0.0569318095, 118.557185)),
        "SF10": Sellmeier((1.61625977, 0.259229334, 1.07762317), (0.0127534559, 0.0581983954, 116.60768)),
        "SF11": Sellmeier((1.73848403, 0.311168974, 1.17490871), (0.0136068604, 0.0615960463, 121.922711)),
        "N-SF11": Sellmeier((1.73759695, 0.313747346, 1.89878101), (0.013188707, 0.0623068142, 155.23629)),
        "N-SF66": Sellmeier((2.0245976, 0.470187196, 2.59970433), (0.0147053225, 0.0692998276, 161.817601)),
        # Malitson 1965 ("Interspecimen comparison of the refractive index of fused silica"), 20 °C.
        "fused silica": Sellmeier((0.6961663, 0.4079426, 0.8974794), (0.0684043**2, 0.1162414**2, 9.896161**2)),
        # The ordinary ray: Malitson and Dodge 1972 ("Refractive index and birefringence of synthetic sapphire").
        "sapphire": Sellmeier((1.4313493, 0.65054713, 5.3414021), (0.0726631**2, 0.1193242**2, 18.028251**2)),
        # Peter 1923 ("Über Brechungsindizes und Absorptionskonstanten des Diamanten").
        "diamond": Sellmeier((0.3306, 4.3356), (0.1750**2, 0.1060**2)),
        # Daimon and Masumura 2007 ("Measurement of the refractive index of distilled water"), 20 °C.
        "water": Sellmeier(
            (0.5684027565, 0.1726177391, 0.02086189578, 0.1130748688),
            (0.005101829712, 0.01821153936, 0.02620722293, 10.69792721),
        ),
        # Fitted to Warren and Brandt 2008 ("Optical constants of ice") from 380 to 780 nm, to 2e-4.
        "ice": Cauchy(1.299589, 0.003758948, -0.0000970854),
    }
)
"""Glasses, crystals and water by name; numbers as refractiveindex.info has them (M. N. Polyanskiy, CC0)."""

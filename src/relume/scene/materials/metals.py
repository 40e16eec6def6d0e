"""Metals by their measured complex indices of refraction, and what they reflect of white light at every angle.

n and k at wavelengths in nm: Ag, Au, Cu of Johnson and Christy 1972 ("Optical constants of the noble metals"); Cr, Fe,
Ni, Pd, Ti of the same 1974 ("Optical constants of transition metals"); Al of Rakić 1995 ("Algorithm for the
determination of intrinsic optical constants of metal films"); Pt, W of the model that Rakić, Djurišić, Elazar and
Majewski 1998 fitted ("Optical properties of metallic films for vertical-cavity optoelectronic devices"); brass,
Cu70Zn30, of Querry 1985 ("Optical constants"). The numbers are as refractiveindex.info has them (M. N. Polyanskiy,
CC0).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np

from relume.light.spectra.reflectance import colour_of
from relume.light.spectra.spectrum import visible
from relume.scene.materials.checks import Colour, triple

FITTED_AT = np.cos(np.radians(np.arange(0.5, 90)))
"""Cosines of the angles at which `Metal.eta_k` is fitted: each degree."""
LEAST_K = 1e-3
"""Of a channel's k: what does not absorb is no metal."""


@dataclass(frozen=True)
class Metal:
    """A metal's complex index n − ik at wavelengths; linear in between.

    wavelengths : nm, increasing
    n, k : as many
    name : for messages
    """

    wavelengths: tuple[float, ...]
    n: tuple[float, ...]
    k: tuple[float, ...]
    name: str = ""

    def __post_init__(self) -> None:
        lengths = np.array(self.wavelengths, np.float64)
        if len(lengths) < 2 or len(self.n) != len(lengths) or len(self.k) != len(lengths):
            raise ValueError(
                f"metal {self.name!r} has {len(lengths)} wavelengths, {len(self.n)} n and {len(self.k)} k; give as "
                "many of each, 2 or more"
            )
        if not np.all(np.diff(lengths) > 0):
            raise ValueError(f"the wavelengths of metal {self.name!r} do not increase; sort them, in nm")
        if lengths[0] > 450 or lengths[-1] < 650:
            raise ValueError(
                f"metal {self.name!r} has an index from {lengths[0]:g} to {lengths[-1]:g} nm; it is needed from 450 to "
                "650 nm at least"
            )
        if min(self.n) <= 0 or min(self.k) < 0:
            raise ValueError(f"metal {self.name!r} has an n of 0 or a k below 0; expected n − ik with both positive")

    def reflectance(self, cosines: np.ndarray) -> np.ndarray:
        """The reflectance (..., 401) of unpolarised light at the visible wavelengths, by Fresnel's equations.

        cosines : (...) of the angle of incidence
        Beyond both ends of its wavelengths the reflectance stays even.
        """
        n, k = (np.interp(visible(), self.wavelengths, values) for values in (self.n, self.k))
        return fresnel(np.asarray(cosines, np.float64)[..., None], n, k)

    def colour(self, cosines: np.ndarray) -> np.ndarray:
        """The colour (..., 3) that is reflected of white light (D65), linear Rec. 709; it may be above 1.

        cosines : (…) of the angle of incidence
        """
        return colour_of(self.reflectance(cosines))

    @property
    def base_color(self) -> Colour:
        """Reflectance at normal incidence, linear Rec. 709, brought into 0 to 1: gold's red is 1.04 and becomes 1."""
        return triple(np.clip(self.colour(np.array(1.0)), 0, 1))

    @property
    def eta_k(self) -> tuple[Colour, Colour]:
        """The n and k of red, green and blue whose Fresnel reflectances are nearest to `colour` at all angles."""
        return _fitted(self)


def fresnel(cosine: np.ndarray, n: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Reflectance of unpolarised light at the boundary from air to n − ik; arrays that broadcast."""
    cosine = np.asarray(cosine, np.float64)
    index = np.asarray(n) - 1j * np.asarray(k)
    inside = np.sqrt(index**2 - (1 - cosine**2))
    across = np.abs((cosine - inside) / (cosine + inside)) ** 2
    along = np.abs((index**2 * cosine - inside) / (index**2 * cosine + inside)) ** 2
    return (across + along) / 2


@lru_cache(maxsize=64)
def _fitted(metal: Metal) -> tuple[Colour, Colour]:
    from scipy.optimize import least_squares

    wanted = np.clip(metal.colour(FITTED_AT), 0, 1)
    # Angles count as the light that an even sky sends from there.
    weights = np.sqrt(FITTED_AT * np.sqrt(1 - FITTED_AT**2))
    found = []
    for channel, near in enumerate((600.0, 550.0, 450.0)):
        start = [max(float(np.interp(near, metal.wavelengths, values)), 0.05) for values in (metal.n, metal.k)]

        def error(index: np.ndarray, channel: int = channel) -> np.ndarray:
            return weights * (fresnel(FITTED_AT, index[0], index[1]) - wanted[:, channel])

        found.append(least_squares(error, start, bounds=([1e-3, LEAST_K], [20, 40]), xtol=1e-12, ftol=1e-12).x)
    eta, k = np.array(found).T
    return triple(eta), triple(k)


def metal_named(name: str) -> Metal:
    """The metal of a name, of `METALS`.

    name : a chemical symbol, like "Au", or an English name
    Raises ValueError that lists them where there is none.
    """
    found = next((metal for symbol, metal in METALS.items() if name in (symbol, metal.name)), None)
    if found is None:
        names = ", ".join(f"{symbol} ({metal.name})" for symbol, metal in METALS.items())
        raise ValueError(f"no metal {name!r}; there are {names}")
    return found


def _of(name: str, rows: str) -> Metal:
    wavelengths, n, k = zip(*(map(float, row.split()) for row in rows.split("|")), strict=True)
    return Metal(wavelengths, n, k, name)


AG = (
    "367.9 0.07 1.657 | 381.5 0.05 1.864 | 397.4 0.05 2.07 | 413.3 0.05 2.275 | 430.5 0.04 2.462 | "
    "450.9 0.04 2.657 | 471.4 0.05 2.869 | 495.9 0.05 3.093 | 520.9 0.05 3.324 | 548.6 0.06 3.586 | "
    "582.1 0.05 3.858 | 616.8 0.06 4.152 | 659.5 0.05 4.483 | 704.5 0.04 4.838 | 756 0.03 5.242 | "
    "821.1 0.04 5.727"
)
AL = (
    "364.7 0.3988 4.396 | 413.3 0.5214 5.001 | 442.8 0.6079 5.368 | 476.9 0.7278 5.778 | 516.6 0.8734 6.242 | "
    "563.6 1.073 6.784 | 619.9 1.366 7.405 | 652.2 1.572 7.735 | 688.8 1.83 8.06 | 729.3 2.161 8.356 | "
    "774.9 2.615 8.491 | 794.8 2.767 8.387"
)
AU = (
    "367.9 1.48 1.895 | 381.5 1.46 1.933 | 397.4 1.47 1.952 | 413.3 1.46 1.958 | 430.5 1.45 1.948 | "
    "450.9 1.38 1.914 | 471.4 1.31 1.849 | 495.9 1.04 1.833 | 520.9 0.62 2.081 | 548.6 0.43 2.455 | "
    "582.1 0.29 2.863 | 616.8 0.21 3.272 | 659.5 0.14 3.697 | 704.5 0.13 4.103 | 756 0.14 4.542 | "
    "821.1 0.16 5.083"
)
CR = (
    "368 1.87 2.69 | 381 1.92 2.74 | 397 2 2.83 | 413 2.08 2.93 | 431 2.19 3.04 | 451 2.33 3.14 | 471 2.51 3.24 | "
    "496 2.75 3.3 | 521 2.94 3.33 | 549 3.18 3.33 | 582 3.22 3.3 | 617 3.17 3.3 | 659 3.09 3.34 | 704 3.05 3.39 | "
    "756 3.08 3.42 | 821 3.2 3.48"
)
CU = (
    "367.9 1.36 1.975 | 381.5 1.33 2.045 | 397.4 1.32 2.116 | 413.3 1.28 2.207 | 430.5 1.25 2.305 | "
    "450.9 1.24 2.397 | 471.4 1.25 2.483 | 495.9 1.22 2.564 | 520.9 1.18 2.608 | 548.6 1.02 2.577 | "
    "582.1 0.7 2.704 | 616.8 0.3 3.205 | 659.5 0.22 3.747 | 704.5 0.21 4.205 | 756 0.24 4.665 | 821.1 0.26 5.18"
)
CUZN = (
    "380 1.487 1.818 | 400 1.445 1.805 | 420 1.35 1.786 | 440 1.191 1.797 | 460 0.994 1.883 | 480 0.816 2.046 | "
    "500 0.686 2.25 | 520 0.602 2.464 | 540 0.549 2.668 | 560 0.505 2.86 | 580 0.468 3.059 | 600 0.45 3.253 | "
    "620 0.449 3.434 | 640 0.444 3.609 | 660 0.445 3.778 | 680 0.444 3.943 | 700 0.446 4.106 | 720 0.45 4.266 | "
    "740 0.455 4.424 | 760 0.458 4.579 | 780 0.464 4.737"
)
FE = (
    "368 2.02 2.43 | 381 2.12 2.5 | 397 2.24 2.58 | 413 2.35 2.65 | 431 2.48 2.71 | 451 2.59 2.77 | "
    "471 2.67 2.82 | 496 2.74 2.88 | 521 2.86 2.91 | 549 2.95 2.93 | 582 2.94 2.99 | 617 2.88 3.05 | "
    "659 2.92 3.1 | 704 2.86 3.19 | 756 2.87 3.28 | 821 2.94 3.39"
)
NI = (
    "368 1.7 2.4 | 381 1.72 2.48 | 397 1.72 2.57 | 413 1.7 2.69 | 431 1.71 2.82 | 451 1.73 2.95 | 471 1.78 3.09 | "
    "496 1.82 3.25 | 521 1.85 3.42 | 549 1.92 3.61 | 582 1.96 3.8 | 617 1.99 4.02 | 659 1.99 4.26 | "
    "704 2.06 4.5 | 756 2.13 4.73 | 821 2.26 4.97"
)
PD = (
    "368 1.24 2.74 | 381 1.26 2.83 | 397 1.3 2.93 | 413 1.33 3.03 | 431 1.37 3.14 | 451 1.41 3.26 | "
    "471 1.46 3.39 | 496 1.52 3.54 | 521 1.57 3.68 | 549 1.64 3.84 | 582 1.68 4.02 | 617 1.75 4.21 | "
    "659 1.8 4.42 | 704 1.86 4.65 | 756 1.95 4.89 | 821 2.06 5.19"
)
PT = (
    "374.7 1.664 2.696 | 389.7 1.703 2.787 | 405.3 1.742 2.878 | 421.6 1.78 2.973 | 438.5 1.819 3.07 | "
    "456.1 1.859 3.172 | 474.4 1.901 3.277 | 493.4 1.944 3.388 | 513.2 1.992 3.503 | 533.8 2.043 3.622 | "
    "555.2 2.098 3.745 | 577.4 2.159 3.872 | 600.6 2.226 4.001 | 624.7 2.297 4.132 | 649.7 2.375 4.264 | "
    "675.8 2.457 4.397 | 702.9 2.545 4.53 | 731.1 2.637 4.662 | 760.4 2.732 4.793 | 790.9 2.829 4.924"
)
TI = (
    "368 1.9 2.9 | 381 1.99 2.93 | 397 2.08 2.95 | 413 2.14 2.98 | 431 2.21 3.01 | 451 2.27 3.04 | 471 2.32 3.1 | "
    "496 2.36 3.19 | 521 2.44 3.3 | 549 2.54 3.43 | 582 2.6 3.58 | 617 2.67 3.72 | 659 2.76 3.84 | "
    "704 2.86 3.96 | 756 3 4.01 | 821 3.21 4.01"
)
W = (
    "374.7 3.204 2.523 | 389.7 3.227 2.53 | 405.3 3.249 2.543 | 421.6 3.271 2.562 | 438.5 3.296 2.586 | "
    "456.1 3.323 2.615 | 474.4 3.354 2.647 | 493.4 3.39 2.68 | 513.2 3.43 2.712 | 533.8 3.473 2.74 | "
    "555.2 3.517 2.764 | 577.4 3.56 2.781 | 600.6 3.599 2.791 | 624.7 3.63 2.796 | 649.7 3.652 2.796 | "
    "675.8 3.661 2.793 | 702.9 3.656 2.79 | 731.1 3.636 2.791 | 760.4 3.599 2.798 | 790.9 3.545 2.815"
)
METALS: Mapping[str, Metal] = MappingProxyType(
    {
        "Ag": _of("silver", AG),
        "Al": _of("aluminium", AL),
        "Au": _of("gold", AU),
        "Cr": _of("chromium", CR),
        "Cu": _of("copper", CU),
        "CuZn": _of("brass", CUZN),
        "Fe": _of("iron", FE),
        "Ni": _of("nickel", NI),
        "Pd": _of("palladium", PD),
        "Pt": _of("platinum", PT),
        "Ti": _of("titanium", TI),
        "W": _of("tungsten", W),
    }
)
"""The measured metals by their symbols."""

"""How far from a light on the retina its light is scattered (Spencer, Shirley, Zimmerman & Greenberg 1995).

Point spreads are in 1/sr by the angle θ in degrees. As printed each sums to 1 within a thousandth over the hemisphere;
`norms_of_scatter` takes out the rest.
"""

from __future__ import annotations

import numpy as np

from relume.virtual_camera.lens.glare.wavelengths import REFERENCE

CORE = 0.02
"""Degrees, the θ₀ of f₀, f₁ and f₂."""
WAVELENGTHS = np.arange(400.0, 701.0, 10.0)
"""nm; the halo of one is wider than the way to the next."""
HALO_DEGREES = np.linspace(0, 8, 2001)
"""Degrees at which the halo is tabulated: the reddest ends before 5."""


def unscattered(degrees: np.ndarray) -> np.ndarray:
    """f₀, sr⁻¹ (Spencer et al. 1995): 2.61·10⁶ exp(−(θ / 0.02)²)."""
    return 2.61e6 * np.exp(-((degrees / CORE) ** 2))


def steep_scatter(degrees: np.ndarray) -> np.ndarray:
    """f₁, sr⁻¹ (Spencer et al. 1995): 20.91 / (θ + 0.02)³."""
    return 20.91 / (degrees + CORE) ** 3


def wide_scatter(degrees: np.ndarray) -> np.ndarray:
    """f₂, sr⁻¹ (Spencer et al. 1995): 72.37 / (θ + 0.02)²."""
    return 72.37 / (degrees + CORE) ** 2


def lenticular_halo(degrees: np.ndarray, wavelength: float = REFERENCE) -> np.ndarray:
    """f₃, sr⁻¹ (Spencer et al. 1995): 436.9 (568 / λ) exp(−19.75 (θ − 3 λ / 568)²)."""
    return 436.9 * REFERENCE / wavelength * np.exp(-19.75 * (degrees - 3 * wavelength / REFERENCE) ** 2)


def norms_of_scatter() -> tuple[float, float, float]:
    """One over the integrals of f₀, f₁ and f₂ over the hemisphere."""
    degrees = np.concatenate([[0.0], np.geomspace(1e-6, 90, 20001)])
    unspread, steep, wide = (_norm(f(degrees), degrees) for f in (unscattered, steep_scatter, wide_scatter))
    return unspread, steep, wide


def halo_of_channels(shares: np.ndarray) -> np.ndarray:
    """(channels, HALO_DEGREES) the halo of light that holds `shares` (channels, WAVELENGTHS), 1/sr, summing to 1."""
    rings = [lenticular_halo(HALO_DEGREES, wavelength) for wavelength in WAVELENGTHS]
    return shares @ np.stack([_norm(ring, HALO_DEGREES) * ring for ring in rings])


def _norm(density: np.ndarray, degrees: np.ndarray) -> float:
    """One over the integral of a point spread over the hemisphere."""
    return float(1 / np.trapezoid(density * 2 * np.pi * np.sin(np.radians(degrees)), np.radians(degrees)))

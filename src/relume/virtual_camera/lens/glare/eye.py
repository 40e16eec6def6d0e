"""The glare that an eye sees about lights (Spencer, Shirley, Zimmerman & Greenberg 1995).

Bloom is scattered by cornea, lens and retina; the ciliary corona and the lenticular halo are diffracted by particles
and fibres of the lens. Each holds its share of the light over the hemisphere; what falls outside the frame is lost.
Point spreads are in 1/sr by the angle θ in degrees. As printed each sums to 1 within a thousandth over the hemisphere;
`norms_of_scatter` takes out the rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from relume.virtual_camera.lens.glare.ciliary_corona import corona
from relume.virtual_camera.lens.glare.convolution import spread_out
from relume.virtual_camera.lens.glare.point_spread import (
    LEVELS,
    SAMPLES,
    PolarSpread,
    balanced,
    pattern_at,
    pixel_means,
    table_distances,
    within_pixel,
)
from relume.virtual_camera.lens.glare.wavelengths import REFERENCE, channel_shares
from relume.virtual_camera.tone.vision import pupil_diameter
from relume.virtual_camera.view import View, seen_luminance

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


PHOTOPIC, MESOPIC, SCOTOPIC = (0.384, 0.478, 0.138, 0.0), (0.368, 0.478, 0.138, 0.016), (0.282, 0.478, 0.207, 0.033)
"""Shares of f₀, f₁, f₂ and f₃ (Spencer et al. 1995)."""
ADAPTATIONS = (0.01, 0.173, 3.0)
"""cd/m² up to which vision is scotopic, in the middle of which it is mesopic, and from which it is photopic."""
HALO_PUPIL = (3.0, 4.0)
"""mm: a narrower pupil hides the outer fibres of the lens, which alone draw the halo; a wider shows all."""
INTEGRATED = 12
"""Pixels round a light in which point spreads are integrated over each pixel."""
ANGLES = 4096
"""Of the pattern over half a turn; a needle's width spans two at least."""


@dataclass(frozen=True)
class EyeGlare:
    """The glare of an eye: what it scatters (Spencer, Shirley, Zimmerman & Greenberg 1995).

    adaptation : cd/m² that the eye is used to; None for what it settled on over a sequence, or the picture's log mean,
        to 1 %
    pupil : its diameter, mm; None for what goes with the adaptation (Moon & Spencer 1944)
    sharp : whether f₀, a blur of a minute of arc, is left to the eye that will look at the picture; the light it
        holds stays where it is then
    mirrored : whether the world goes on beside the picture as its mirror image; else it is black there, and near
        edges half of the wide glare is missing

    The point spread is that of the picture's middle everywhere.
    """

    adaptation: float | None = None
    pupil: float | None = None
    sharp: bool = True
    mirrored: bool = False

    def __post_init__(self) -> None:
        for name, unit in (("adaptation", "cd/m²"), ("pupil", "mm")):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0):
                raise ValueError(f"{name} is {value}; expected {unit} above 0, or None")

    @property
    def absolute(self) -> bool:
        """Whether luminances have to be in cd/m²: where the adaptation is not given."""
        return self.adaptation is None

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 as it arrives on the retina, in its unit.

        radiance, view : (H, W, 3) float32 in the picture's unit, and the picture's view (`VirtualCamera.view`)
        """
        adaptation = self.adaptation or _rounded(view.settled or seen_luminance(radiance, view))
        reach = float(np.hypot(*radiance.shape[:2]))
        spread = _last_point_spread(self, adaptation, view.focal_length, view.seed, reach)
        return spread_out(radiance, spread, mirrored=self.mirrored)

    def shares(self, adaptation: float) -> np.ndarray:
        """The shares (4,) of the light in f₀…f₃ at an adaptation in cd/m², interpolated in its logarithm."""
        rows = np.array([SCOTOPIC, MESOPIC, PHOTOPIC])
        shares = np.array([np.interp(np.log(adaptation), np.log(ADAPTATIONS), column) for column in rows.T])
        pupil = self.pupil or pupil_diameter(adaptation)
        halo = shares[3] * float(np.interp(pupil, HALO_PUPIL, (0, 1)))
        return np.array([shares[0] + shares[3] - halo, shares[1], shares[2], halo])

    def point_spread(self, adaptation: float, view: View, reach: float) -> PolarSpread:
        """The point spread at an `adaptation` in cd/m², for pixels up to `reach` away.

        view : of the picture, by `VirtualCamera.view`
        """
        # Shares of the light, and the needles of the ciliary corona.
        shares = self.shares(adaptation)
        focal, reach = view.focal_length, max(reach, INTEGRATED * 2.0)
        amounts = channel_shares(WAVELENGTHS)
        distances, levels = table_distances(reach, SAMPLES), table_distances(reach, LEVELS)
        degrees = np.degrees(np.arctan(levels / focal))
        needles = corona(degrees, levels, ANGLES, WAVELENGTHS, amounts, view.seed)
        wide = CORE * np.pi / 180 * focal > 2
        blurred, blur_near = not self.sharp and wide, not self.sharp and not wide

        # Densities by distance: of f₁ and f₂ for all channels, of the halo and f₀ for each.
        norms, halo = norms_of_scatter(), shares[3] * halo_of_channels(amounts)

        def scattered(distance: np.ndarray) -> np.ndarray:
            angle, area = _on_retina(distance, focal)
            return area * (shares[1] * norms[1] * steep_scatter(angle) + shares[2] * norms[2] * wide_scatter(angle))

        def other(distance: np.ndarray, channel: int) -> np.ndarray:
            angle, area = _on_retina(distance, focal)
            light = np.interp(angle, HALO_DEGREES, halo[channel])
            return area * (light + (shares[0] * norms[0] * unscattered(angle) if blurred else 0))

        kept, radial, near = np.empty(3), np.empty((3, SAMPLES), np.float32), []
        for channel in range(3):

            def density(distance: np.ndarray, channel: int = channel) -> np.ndarray:
                return scattered(distance) + other(distance, channel)

            # Needles are of f₁ and f₂ alone.
            part = scattered(levels) / density(levels)
            needles[channel] = 1 + part[:, None].astype(np.float32) * (needles[channel] - 1)
            radial[channel] = pixel_means(density, distances)
            kept[channel] = within_pixel(density) + (0 if blurred else shares[0])
            near.append(_integrated(density, needles[channel], reach))
        # f₀ where it is narrower than pixels.
        patch = np.stack(near)
        if blur_near:
            blur = shares[0] * _blur(CORE * np.pi / 180 * focal)
            kept += blur[INTEGRATED, INTEGRATED] - shares[0]
            patch += blur
        patch[:, INTEGRATED, INTEGRATED] = 0
        spread = PolarSpread(kept, radial, needles, patch.astype(np.float32), reach)

        def within(radius: float) -> np.ndarray:
            # A bounded density holds nothing below a billionth of the radius.
            distance = radius * np.geomspace(1e-9, 1, 20001)
            log = np.log(distance)
            common = np.trapezoid(2 * np.pi * distance**2 * scattered(distance), log)
            own = [np.trapezoid(2 * np.pi * distance**2 * other(distance, c), log) for c in range(3)]
            return common + np.array(own) + (0 if blurred else shares[0])

        return balanced(spread, within)


def _rounded(adaptation: float) -> float:
    """A measured adaptation to 1 %, of which no share changes by more than 3e-4: frames of one light have one."""
    return float(np.exp(np.rint(100 * np.log(adaptation)) / 100))


@lru_cache(maxsize=1)
def _last_point_spread(glare: EyeGlare, adaptation: float, focal_length: float, seed: int, reach: float) -> PolarSpread:
    """Kept for the next frame of a sequence: 10 MB that take a third of a frame's time to make."""
    return glare.point_spread(adaptation, View(focal_length, seed=seed), reach)


def _on_retina(distance: np.ndarray, focal: float) -> tuple[np.ndarray, np.ndarray]:
    """Degrees from the point, and steradians of a pixel there: cos³ θ / f², of a plane that touches the sphere."""
    angle = np.arctan(distance / focal)
    return np.degrees(angle), np.cos(angle) ** 3 / focal**2


def _integrated(density: Callable[[np.ndarray], np.ndarray], pattern: np.ndarray, reach: float) -> np.ndarray:
    """(2 INTEGRATED + 1, 2 INTEGRATED + 1) light of the pixels about the point, by Gauss and Legendre's nodes."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    places = (np.arange(-INTEGRATED, INTEGRATED + 1)[:, None] + nodes / 2).ravel()
    x, y = np.meshgrid(places, places)
    light = density(np.hypot(x, y)) * pattern_at(pattern, reach, x, y)
    size = 2 * INTEGRATED + 1
    return np.einsum("iajb,a,b->ij", light.reshape(size, 8, size, 8), weights / 2, weights / 2)


def _blur(core: float) -> np.ndarray:
    """(2 INTEGRATED + 1, 2 INTEGRATED + 1) shares of exp(−(r / core)²) in the pixels about its middle."""
    from scipy.special import erf

    edges = erf((np.arange(-INTEGRATED, INTEGRATED + 2) - 0.5) / core) / 2
    across = np.diff(edges)
    return across[:, None] * across

"""What leaves layers of skin that scatter and absorb, by Monte Carlo: the reference beside a patch's measurement.

Layers lie flat on each other under one smooth interface. Light is refracted in, scattered by Henyey and Greenstein's
phase function, reflected inside at the interface, and from each place where it is scattered its share towards each view
is added, so that few photons give smooth results. Since the layers refract alike, depth counts in mean free paths
alone, and a flight crosses their borders without noticing (Hanrahan & Krueger 1993, §3, §4). What is absorbed on the
way is a weight of each wavelength, so that one walk serves all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from relume.light.reflection.weights import Fresnel
from relume.lightstage.reflectometry.patch_samples import in_plane
from relume.lightstage.surface.torrance_sparrow import SKIN

LEAST_WEIGHT = 0.1
"""Of a photon, below which it goes on ten times as heavy once in ten times, or ends."""
PHOTONS = 4000
_TRIED = tuple(float(value) for value in np.geomspace(0.05, 20, 12))
"""Absorption per mm of the lower layer that is tried: from pale skin to blood."""


@dataclass(frozen=True)
class SkinLayer:
    """A layer that scatters.

    scattering : per mm, of all wavelengths
    absorption : per mm, one for each wavelength
    asymmetry : the mean cosine of scattering, 0 even, near 1 forward
    thickness : mm; infinite for the last
    """

    scattering: float
    absorption: tuple[float, ...]
    asymmetry: float
    thickness: float = np.inf


def skin(absorption: Sequence[float]) -> tuple[SkinLayer, SkinLayer]:
    """Epidermis and dermis, the dermis of this absorption (per mm, one for each wavelength).

    Of the order that Hanrahan and Krueger took for pale skin in visible light: scattering 50 and 21.7 per mm, mean
    cosines 0.79 and 0.81, absorption 3.8 and 0.3 per mm, which keep their ratio here, as darker skin has more of both;
    the epidermis is 0.05 mm thick, as on a forehead.
    """
    upper = tuple(3.8 / 0.3 * value for value in absorption)
    return SkinLayer(50.0, upper, 0.79, 0.05), SkinLayer(21.7, tuple(absorption), 0.81)


def layered_reflection(
    layers: Sequence[SkinLayer], incidence: np.ndarray, viewing: np.ndarray, *, ior: float = SKIN,
    photons: int = PHOTONS, seed: int = 0,
) -> np.ndarray:  # fmt: skip
    """BRDF (M, N, K), 1/sr, of layers lit from angles of incidence (M,), at angles of view (N,), for K wavelengths.

    layers : from the surface down; the last is infinite
    incidence, viewing : radians from the normal, signed, in one plane
    photons : for each angle of incidence
    ior : index of refraction of the layers to the air's, 1.4 as of skin; what the interface itself reflects is not part
        of it
    seed : of the photons' ways
    The same seed gives the same numbers. Raises ValueError for no layer, unless the last is infinite, and where layers
    differ in their number of wavelengths.
    Source: Hanrahan & Krueger 1993, "Reflection from layered surfaces due to subsurface scattering".
    """
    if not layers or np.isfinite(layers[-1].thickness) or len({len(layer.absorption) for layer in layers}) != 1:
        raise ValueError("layers of skin end with one of infinite thickness, and have one number of wavelengths")
    generator = np.random.default_rng(seed)
    surface, inner = Fresnel(ior), Fresnel(1 / ior)
    # Borders in mean free paths of scattering, from the surface down; and what is absorbed down to a depth.
    borders = np.cumsum([layer.scattering * layer.thickness for layer in layers[:-1]])
    tops = np.concatenate([[0.0], borders])
    forward = np.array([layer.asymmetry for layer in layers])
    rates = np.array([layer.absorption for layer in layers]) / np.array([[layer.scattering] for layer in layers])
    above = np.concatenate([np.zeros((1, rates.shape[1])), np.cumsum(np.diff(tops)[:, None] * rates[:-1], axis=0)])

    def absorbed(depth: np.ndarray) -> np.ndarray:
        layer = np.searchsorted(borders, depth)
        return above[layer] + rates[layer] * (depth - tops[layer])[:, None]

    # Towards the views, inside; z is up.
    outside = in_plane(np.asarray(viewing, np.float64))
    views = _refracted(outside, ior)
    leaving = (1 - surface(outside[:, 2])) / ior**2 / views[:, 2]
    # In.
    lamps = in_plane(np.asarray(incidence, np.float64))
    source = np.repeat(np.arange(len(lamps)), photons)
    direction = -_refracted(lamps, ior)[source]
    weight = np.repeat(1 - surface(lamps[source, 2])[:, None], rates.shape[1], axis=1)
    depth, lost = np.zeros(len(source)), np.zeros_like(weight)
    total = np.zeros((len(lamps), len(views), rates.shape[1]))
    while len(weight):
        # A flight; those that come up to the interface are reflected back as often as it reflects, or have left.
        slope = np.abs(direction[:, 2])
        depth = depth - direction[:, 2] * generator.exponential(size=len(weight))
        left = depth < 0
        stays = ~left | (generator.random(len(weight)) < inner(np.maximum(direction[:, 2], 0)))
        direction[left, 2] *= -1
        depth, direction, weight, source = np.abs(depth)[stays], direction[stays], weight[stays], source[stays]
        # What the way up and down, or between two depths, has absorbed.
        before, lost = lost[stays], absorbed(depth)
        way = np.where(left[stays, None], before + lost, np.abs(lost - before))
        weight = weight * np.exp(-way / np.maximum(slope[stays, None], 1e-12))
        # Scattered: towards the views, and on.
        mean = forward[np.searchsorted(borders, depth)]
        towards = _phase(direction @ views.T, mean[:, None])
        for place, upward in enumerate(views[:, 2]):
            out = np.exp(-(depth[:, None] + lost) / upward)
            np.add.at(total[:, place], source, towards[:, place, None] * weight * out)
        direction = _scattered(direction, mean, generator)
        # Light photons end, or stand for ten.
        faint = weight.max(axis=1) < LEAST_WEIGHT
        stays = ~faint | (generator.random(len(weight)) < 0.1)
        weight = np.where(faint[:, None], 10 * weight, weight)[stays]
        depth, direction, lost, source = depth[stays], direction[stays], lost[stays], source[stays]
    return total / photons * leaving[:, None]


def layers_like(albedo: np.ndarray, *, photons: int = PHOTONS, seed: int = 0) -> tuple[SkinLayer, SkinLayer]:
    """Epidermis and dermis that reflect head-on as matte surfaces of these albedos (K,) do: their absorption is found.

    albedo : (K,) of a matte surface, 0 to 1, one a wavelength
    photons : for each angle of incidence
    seed : of the photons' ways

    Where no skin reflects so much or so little, the nearest skin is taken.
    """
    seen = np.pi * layered_reflection(skin(_TRIED), np.zeros(1), np.zeros(1), photons=photons, seed=seed)[0, 0]
    # Absorption falls as the albedo rises.
    wanted = np.log(np.maximum(np.asarray(albedo, np.float64), 1e-6))
    found = np.exp(np.interp(wanted, np.log(seen[::-1]), np.log(_TRIED[::-1])))
    return skin([float(value) for value in found])


def _refracted(directions: np.ndarray, ior: float) -> np.ndarray:
    """Directions (N, 3) away from the surface as they continue inside it, towards the same side."""
    inside = directions / ior
    return np.stack([inside[:, 0], inside[:, 1], np.sqrt(1 - inside[:, 0] ** 2 - inside[:, 1] ** 2)], axis=-1)


def _phase(cosine: np.ndarray, g: np.ndarray) -> np.ndarray:
    """Henyey and Greenstein's phase function, 1/sr."""
    return (1 - g**2) / (4 * np.pi * (1 + g**2 - 2 * g * cosine) ** 1.5)


def _scattered(direction: np.ndarray, g: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """New directions (N, 3) drawn from the phase function about the old ones."""
    draw = generator.random(len(direction))
    even = np.abs(g) < 1e-3
    safe = np.where(even, 1.0, g)
    cosine = np.where(
        even, 2 * draw - 1, (1 + safe**2 - ((1 - safe**2) / (1 - safe + 2 * safe * draw)) ** 2) / (2 * safe)
    )
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    angle = 2 * np.pi * generator.random(len(direction))
    # Two directions at right angles to each (Duff et al. 2017).
    x, y, z = direction.T
    sign = np.copysign(1.0, z)
    scale = -1 / (sign + z)
    first = np.stack([1 + sign * x * x * scale, sign * x * y * scale, -sign * x], axis=-1)
    second = np.stack([x * y * scale, sign + y * y * scale, -y], axis=-1)
    across = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
    found = cosine[:, None] * direction + sine[:, None] * across
    return found / np.sqrt(np.einsum("nk,nk->n", found, found))[:, None]

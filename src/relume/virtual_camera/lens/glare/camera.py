"""The glare of a camera: the star of its iris, the halo of its lens surfaces and the veil of its body."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from relume.virtual_camera.lens.blades import Blades
from relume.virtual_camera.lens.glare.convolution import spread_out
from relume.virtual_camera.lens.glare.diffraction import far_radial, near_light, near_reach, star
from relume.virtual_camera.lens.glare.point_spread import SAMPLES, PolarSpread, balanced, pixel_means, table_distances
from relume.virtual_camera.lens.glare.wavelengths import channel_shares
from relume.virtual_camera.protocols import Relative
from relume.virtual_camera.view import View

WAVELENGTHS = np.arange(410.0, 691.0, 20.0)
"""nm; orders of neighbours agree within a fringe as far as fringes are drawn."""
LEVELS, ANGLES = 128, 8192
"""Of the star: its rays are straight, but as fine as a pixel far from the light."""


@dataclass(frozen=True)
class CameraGlare(Relative):
    """The glare of a camera: the star of its iris, and what lens and body scatter.

    blades : of the iris; six, as most lenses for 35 mm film have, unless given
    f_number : its f-number; stars grow with it
    sensor_width : mm, that the picture's longer side covers, however the camera was held; 36 is 35 mm film
    veil : share of all light that lens and body spread evenly over the frame (the veiling glare index of ISO 9358):
        0.01 is a good lens of today
    halo : share that dust and coatings scatter about a light, falling as (r² + core²)^(−power)
    halo_core : its core, of the picture's diagonal
    halo_power : above 1; 1.25 lies between clean surfaces (1) and the edges of dust (1.5)
    mirrored : whether the world goes on beside the picture as its mirror image; else it is black there
    """

    blades: Blades = Blades(6)
    f_number: float = 8.0
    sensor_width: float = 36.0
    veil: float = 0.01
    halo: float = 0.0
    halo_core: float = 0.002
    halo_power: float = 1.25
    mirrored: bool = False

    def __post_init__(self) -> None:
        for name in ("f_number", "sensor_width", "halo_core"):
            if not (np.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"{name} is {getattr(self, name)}; expected a positive number")
        if not (self.veil >= 0 and self.halo >= 0 and self.veil + self.halo < 1):
            raise ValueError(f"veil is {self.veil}, halo {self.halo}; expected shares of the light, together below 1")
        if not (np.isfinite(self.halo_power) and self.halo_power > 1):
            raise ValueError(f"halo_power is {self.halo_power}; expected more than 1, or the halo would have no end")

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 as it arrives on the sensor, in its unit. The star depends on no field of view.

        radiance : (H, W, 3) float32 in the picture's unit
        """
        height, width = radiance.shape[:2]
        arrived = spread_out(radiance, _last_point_spread(self, height, width), mirrored=self.mirrored)
        if self.veil:
            arrived += (self.veil * radiance.mean((0, 1), dtype=np.float64)).astype(np.float32)
        return arrived

    def point_spread(self, height: int, width: int) -> PolarSpread:
        """Where a point's light goes, without the veil, for a picture of `height` × `width` pixels."""
        diagonal = float(np.hypot(height, width))
        order = WAVELENGTHS * 1e-6 * self.f_number * max(height, width) / self.sensor_width
        shares = channel_shares(WAVELENGTHS)
        near_size = near_reach(float(order.max()))
        reach = max(diagonal, 2.0 * near_size)
        distances, levels = table_distances(reach, SAMPLES), table_distances(reach, LEVELS)
        starlight = 1 - self.veil - self.halo

        rays = np.stack([star(self.blades, order, share, levels, ANGLES) for share in shares])
        mean = far_radial(self.blades, shares @ order, distances) * starlight
        halo = pixel_means(self._halo_at(diagonal), distances)
        part = far_radial(self.blades, shares @ order, levels) * starlight
        part /= part + self._halo_at(diagonal)(levels)
        pattern = (1 + part[:, :, None] * (rays - 1)).astype(np.float32)

        near = starlight * np.tensordot(shares, near_light(self.blades, order, near_size), 1)
        away = np.arange(-near_size, near_size + 1)
        scattered = pixel_means(self._halo_at(diagonal), np.hypot(away, away[:, None]))
        scattered[near_size, near_size] = 0
        near = near + scattered
        near[:, near_size, near_size] = 0
        none = np.zeros(3)
        spread = PolarSpread(none, (mean + halo).astype(np.float32), pattern, near.astype(np.float32), reach)
        core = self.halo_core * diagonal

        def within(radius: float) -> np.ndarray:
            # The integral of r^−3 r dr from the radius on is 1 / radius.
            outside = 2 * np.pi / radius * far_radial(self.blades, shares @ order, np.ones(1))[:, 0]
            return starlight * (1 - outside) + self.halo * (1 - (1 + (radius / core) ** 2) ** (1 - self.halo_power))

        return balanced(spread, within)

    def _halo_at(self, diagonal: float) -> Callable[[np.ndarray], np.ndarray]:
        """The halo, light per pixel by distance; its integral over the plane is π core^(2 − 2 power) / (power − 1)."""
        core = self.halo_core * diagonal
        height = self.halo * (self.halo_power - 1) / np.pi * core ** (2 * self.halo_power - 2)
        return lambda distance: height * (distance**2 + core**2) ** -self.halo_power


@lru_cache(maxsize=1)
def _last_point_spread(glare: CameraGlare, height: int, width: int) -> PolarSpread:
    """Kept for the next frame of a sequence: 13 MB that take a third of a frame's time to make."""
    return glare.point_spread(height, width)

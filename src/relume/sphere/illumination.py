"""An illumination map: radiance as a function of direction, in one of the mappings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from relume.image.radiance import RadianceMap
from relume.image.resample import bilinear
from relume.sphere.mappings import MAPPINGS, LatLong, Mapping, pixel_points


@dataclass(frozen=True, eq=False)
class IlluminationMap:
    """Light from every direction, measured at one point.

    radiance : (size, aspect·size, 3) float32, in `unit`; directions point from the centre towards the light
    mapping : how directions are laid out, `LatLong()` unless said otherwise
    unit : "cd/m²" when calibrated, else "relative"
    """

    radiance: np.ndarray
    mapping: Mapping = LatLong()
    unit: str = "relative"

    def __post_init__(self) -> None:
        shape, aspect = self.radiance.shape, self.mapping.aspect
        if self.radiance.ndim != 3 or shape[2] != 3 or shape[1] != aspect * shape[0]:
            raise ValueError(
                f"radiance has shape {shape}; a {self.mapping.name} map is {aspect} times as wide as high, "
                f"so ({shape[0]}, {aspect * shape[0]}, 3)"
            )
        if self.radiance.size == 0:
            raise ValueError(f"radiance has shape {shape}; a map has at least one row")
        if not np.all(np.isfinite(self.radiance)) or self.radiance.min() < 0:
            raise ValueError("radiance holds negative or non-finite values; light must be finite and not below 0")

    @property
    def size(self) -> int:
        """The number of rows."""
        return self.radiance.shape[0]

    def look_up(self, directions: np.ndarray) -> np.ndarray:
        """Radiance (…, 3) from unit directions (…, 3), bilinear, continuous over a lat-long's seam and poles."""
        points = self.mapping.image_points(directions)
        if isinstance(self.mapping, LatLong):
            image = _wrapped(self.radiance)
            return bilinear(image, points[..., 0] * 2 * self.size + 1, points[..., 1] * self.size + 1)
        return bilinear(self.radiance, points[..., 0] * self.size, points[..., 1] * self.size)

    def total(self) -> np.ndarray:
        """∫ L dω over the whole sphere, (3,): the sum of radiance × solid angle."""
        return np.einsum("hwc,hw->c", self.radiance.astype(np.float64), self.mapping.solid_angles(self.size))

    def irradiance(self, normals: np.ndarray) -> np.ndarray:
        """E = ∫ L max(0, ω·n) dω on surfaces of unit normals (…, 3): (…, 3), π·L under constant light."""
        points = pixel_points(self.mapping, self.size)
        if self.mapping.aspect == 1:
            # The middle of a pixel that the rim cuts may lie outside the disc; the nearest point of the rim counts.
            middle = points - 0.5
            points = 0.5 + middle / np.maximum(2.000001 * np.linalg.norm(middle, axis=-1, keepdims=True), 1)
        directions = self.mapping.directions(points).reshape(-1, 3)
        flux = self.radiance.reshape(-1, 3) * self.mapping.solid_angles(self.size).reshape(-1, 1)
        flat = np.atleast_2d(np.asarray(normals, np.float64).reshape(-1, 3))
        result = np.stack([np.maximum(directions @ n, 0) @ flux for n in flat])
        return result.reshape(np.shape(normals))

    def remapped(self, mapping: Mapping, size: int | None = None) -> IlluminationMap:
        """The same light in another mapping or size (rows; the present number unless given), energy kept."""
        return self._resampled(mapping, size or self.size, np.eye(3))

    def rotated(self, rotation: np.ndarray) -> IlluminationMap:
        """The light turned by an active rotation: what came from ω comes from `rotation` @ ω; energy kept."""
        return self._resampled(self.mapping, self.size, np.asarray(rotation, np.float64))

    def _resampled(self, mapping: Mapping, size: int, rotation: np.ndarray) -> IlluminationMap:
        from relume.sphere.transport import balanced_transport

        matrix = balanced_transport(self.mapping, self.size, mapping, size, rotation)
        source = self.radiance.reshape(-1, 3).astype(np.float64)
        radiance = (matrix @ source).reshape(size, mapping.aspect * size, 3)
        return IlluminationMap(radiance.astype(np.float32), mapping, self.unit)


def as_illumination(picture: RadianceMap) -> IlluminationMap:
    """Read a radiance map as light: by the mapping its file remembers, else by its shape (2:1 is lat-long).

    Raises ValueError when neither tells: a square map may be an angular map or a mirrored ball.
    """
    width, height = picture.size
    name = picture.attributes.get("mapping", "latlong" if width == 2 * height else "")
    if name not in MAPPINGS:
        raise ValueError(
            f"a map of {width}×{height} pixels does not tell its mapping; a lat-long map is twice as wide as high"
        )
    return IlluminationMap(picture.radiance, MAPPINGS[name], picture.unit)


def as_radiance_map(light: IlluminationMap) -> RadianceMap:
    """The light as a picture that remembers its mapping, ready to be written to a file."""
    return RadianceMap(light.radiance.astype(np.float32), unit=light.unit, attributes={"mapping": light.mapping.name})


def _wrapped(radiance: np.ndarray) -> np.ndarray:
    """A lat-long map with one more pixel on every side: round the seam, and over the poles to the other side."""
    half = radiance.shape[1] // 2
    tall = np.concatenate([np.roll(radiance[:1], half, 1), radiance, np.roll(radiance[-1:], half, 1)])
    return np.concatenate([tall[:, -1:], tall, tall[:, :1]], axis=1)

"""What surfaces are made of: the metallic–roughness model of glTF 2.0 with its names, nothing renderer-specific."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Colour = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Material:
    """A surface as glTF 2.0 describes it (metallic–roughness, KHR_materials_transmission, KHR_materials_ior).

    base_color : linear Rec. 709 albedo of a dielectric or reflectance of a metal at normal incidence; a triple, or an
        image (H, W, 3) float32 over the mesh's texture coordinates
    metallic : 0 dielectric, 1 metal; a number or an image (H, W)
    roughness : perceptual; the microfacet width is α = roughness²; a number or an image (H, W). 1 as in glTF
    transmission : share of the light that is not reflected and goes through instead of into the diffuse base
    ior : index of refraction; 1.5 as in glTF, window glass
    name : for messages
    """

    base_color: Colour | np.ndarray = (1.0, 1.0, 1.0)
    metallic: float | np.ndarray = 0.0
    roughness: float | np.ndarray = 1.0
    transmission: float = 0.0
    ior: float = 1.5
    name: str = ""

    def __post_init__(self) -> None:
        for field in ("base_color", "metallic", "roughness", "transmission"):
            value = np.asarray(getattr(self, field))
            if value.size == 0 or not (value.min() >= 0 and value.max() <= 1):
                got = value.tolist() if value.size <= 3 else f"an image from {value.min():g} to {value.max():g}"
                raise ValueError(f"{field} of material {self.name!r} is {got}; expected 0 to 1")
        if not self.ior >= 1:
            raise ValueError(f"ior of material {self.name!r} is {self.ior}; expected 1 or more")


@dataclass(frozen=True)
class Diffuse:
    """A perfectly diffuse (Lambert) surface.

    reflectance : ρ per channel, 0 to 1; radiance is ρ/π times irradiance
    """

    reflectance: Colour

    def __post_init__(self) -> None:
        if len(self.reflectance) != 3 or not all(0 <= r <= 1 for r in self.reflectance):
            raise ValueError(f"reflectance is {self.reflectance}; expected three numbers from 0 to 1")

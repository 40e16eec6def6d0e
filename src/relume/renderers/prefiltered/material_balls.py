"""Balls of glTF's materials under one light, made in seconds for choosing by eye (Miller & Hoffman 1984, §3).

Each is line 9 of the paper: a diffuse map looked up by N, specular maps by R, or of rough metals by N and E, and what
goes through a clear ball by the direction in which it leaves. Tables are as coarse as balls of some dozen pixels show:
`Prefiltered` makes them as fine as any picture needs, which for 36 materials takes ten minutes. The balls see neither
themselves nor a scene: no shadow, no table below them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from relume.light.reflection.brdf import GGX
from relume.light.reflection.convolution import as_latlong
from relume.light.reflection.glossy import GlossyMap, glossy_map
from relume.light.reflection.lobes import Flattened, GGXLobe, Lambert, Lobe, Mirror, WardLobe
from relume.light.reflection.reflection_map import reflection_map, rows_for
from relume.renderers.directional_albedo import COAT_IOR, COSINES, ROUGHNESSES, ggx_shares, rise
from relume.renderers.half_vectors import directional_albedo
from relume.renderers.prefiltered.contact_sheet import binned, coarse, disc
from relume.renderers.prefiltered.materials import MIRROR, SMOOTHEST
from relume.renderers.unsupported import unsupported_features
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.materials import Diffuse, Material, Ward, mean_colour, mean_number
from relume.scene.materials.measured import MeasuredBRDF
from relume.scene.materials.metals import Metal, fresnel
from relume.sphere.environment_map import EnvironmentMap

ROWS = 128
"""Of the light and of every table: two pixels of a ball of 64 mirror directions that are 3.6° apart, an entry 1.4°."""
FINEST = np.pi / ROWS
RADIUS = 0.05
"""Metres: how far light goes through a body that absorbs."""
_FINER = 3
"""Samples along a pixel's side: at the rim R turns much within a pixel."""
_GLOSSY = (48, 16, 4)
"""Rows, views and azimuths of what metals mirror: within 1 to 2 % of maps that take four times as long."""
Shown = Material | Ward | Diffuse | MeasuredBRDF | ABCFacets
"""What a ball can be made of."""


@dataclass(frozen=True, eq=False)
class _Maps:
    """The reflection maps of one light, each made when it is first looked up."""

    light: EnvironmentMap
    by_direction: dict[Lobe, EnvironmentMap] = field(default_factory=dict)
    by_view: dict[float, GlossyMap] = field(default_factory=dict)

    def looked(self, lobe: Lobe, directions: np.ndarray) -> np.ndarray:
        """The table of a lobe by directions (P, 3)."""
        if lobe not in self.by_direction:
            self.by_direction[lobe] = reflection_map(self.light, lobe, min(rows_for(lobe, ROWS), ROWS)).light
        return self.by_direction[lobe].lookup(directions)

    def facets(self, alpha: float, normals: np.ndarray, eye: np.ndarray) -> np.ndarray:
        """White facets in three dimensions (§9), by normals and views (P, 3)."""
        if alpha not in self.by_view:
            rows, views, azimuths = _GLOSSY
            self.by_view[alpha] = glossy_map(self.light, GGX(alpha), rows, views=views, azimuths=azimuths)
        return self.by_view[alpha].lookup(normals, eye)


def material_radiance(
    light: EnvironmentMap, materials: tuple[Shown, ...], size: int, turn: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Radiance (n, S, S, 3) float32 of a ball of each material, in the light's unit, and their matte (S, S) float32.

    turn : (3, 3) rotation from the camera that looks at them, along its −Z from far away, to the light's frame
    """
    maps = _Maps(coarse(as_latlong(light), ROWS))
    points, cover = disc(size * _FINER)
    seen = cover.ravel() > 0
    normals = points.reshape(-1, 3)[seen] @ turn.T
    eye = np.broadcast_to(turn[:, 2], normals.shape)
    matte = binned(cover, _FINER)
    made = np.zeros((len(materials), size, size, 3), np.float32)
    for index, material in enumerate(materials):
        radiance = np.zeros((seen.size, 3))
        radiance[seen] = _reflected(material, normals, eye, maps)
        here = radiance.reshape(*cover.shape, 3) * cover[..., None]
        made[index] = binned(here, _FINER) / np.maximum(matte, 1e-6)[..., None]
    return made, matte.astype(np.float32)


def left_out(material: Shown) -> tuple[str, ...]:
    """What of a material its ball does not show, or only a stand-in shows."""
    if isinstance(material, Ward):
        return ("its direction of brushing",) if material.is_directed else ()
    if isinstance(material, Diffuse):
        return ()
    if isinstance(material, MeasuredBRDF | ABCFacets):
        return ("its highlights",)
    shown = {"clearcoat", "specular", "emission", "thinness"}
    if material.scattering_distance is None:
        shown |= {"what fills the body"}
    return tuple(each for each in unsupported_features(material) if each not in shown)


def _beside_schlick(metal: Metal, base: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Fresnel's reflectance of a measured metal as a share of Schlick's from its base colour, at the angle of view."""
    eta, k = (np.array(part) for part in metal.eta_k)
    return fresnel(cosine, eta, k) / (base + (1 - base) * (1 - cosine) ** 5)


def _reflected(material: Shown, normals: np.ndarray, eye: np.ndarray, maps: _Maps) -> np.ndarray:
    """Line 9 (§3) for points of a ball, (P, 3)."""
    cosine = np.clip((normals * eye).sum(-1, keepdims=True), 0, 1)
    towards = 2 * cosine * normals - eye
    if isinstance(material, Diffuse):
        return np.array(mean_colour(material.reflectance)) * maps.looked(Lambert(), normals)
    if isinstance(material, MeasuredBRDF | ABCFacets):
        return directional_albedo(material, np.array([0.7])) * maps.looked(Lambert(), normals)
    if isinstance(material, Ward):
        # Round, and as wide as its two widths together.
        lobe = WardLobe(float(np.sqrt(mean_number(material.alpha_x) * mean_number(material.alpha_y))))
        shine = np.array(mean_colour(material.reflectance)) * maps.looked(lobe, towards)
        return shine + np.array(mean_colour(material.diffuse)) * maps.looked(Lambert(), normals)
    material = _even(material)
    base, metal, clear = np.array(material.base_color), float(material.metallic), float(material.through)
    # glTF 2.0, appendix B: what facets reflect by the angle of view, and the base below them.
    roughness = float(material.roughness)
    alpha = roughness**2
    dielectric = np.array(material.specular_color) * ((material.ior - 1) / (material.ior + 1)) ** 2
    normal, rim = material.specular * np.minimum(dielectric, 1), material.specular
    white, risen = facet_shares(roughness, cosine, material.ior)
    gloss = normal * (white - risen) + rim * risen
    coat = float(normal.max()) * (white - risen) + rim * risen
    white, risen = facet_shares(roughness, cosine, 1.0)  # Schlick's rise, glTF's for metals
    shine = base * (white - risen) + risen
    if material.metal is not None:
        shine = shine * _beside_schlick(material.metal, base, cosine)
    facets = gloss * (1 - metal) + shine * metal
    if metal > 0 and alpha >= SMOOTHEST:
        found = facets / np.maximum(white, 1e-6) * maps.facets(alpha, normals, eye)
    else:
        found = facets * maps.looked(_lobe(alpha), towards)
    matt = (1 - metal) - clear
    if matt > 0:
        found = found + (1 - coat) * matt * base * maps.looked(Lambert(), normals)
    if material.thin and clear > 0:
        # A sheet mirrors at both of its sides, again and again between them: a wall of the ball sends 2F/(1 + F) back.
        wall = clear * 2 * coat / (1 + coat)
        behind = -eye - 2 * cosine * (normals - 2 * cosine * eye)
        beyond = maps.looked(Mirror(), -eye) + wall * maps.looked(Mirror(), behind)
        found = found * (1 - clear) + wall * maps.looked(_lobe(alpha), towards) + (clear - wall) ** 2 * base * beyond
    elif clear > 0:
        through, length = _through(normals, eye, material.ior)
        # Where a facet leans by h, light that is mirrored turns by 2h; in and out it turns by √2·(ior − 1)·h.
        bent = _lobe(alpha * (material.ior - 1) / np.sqrt(2))
        medium = material.medium
        left = 1.0 if medium is None else np.exp(-np.array(medium.absorption) * length * RADIUS)
        found = found + (1 - coat) ** 2 * clear * base * left * maps.looked(bent, through)
    # The coat of lacquer is of index 1.5 (KHR_materials_clearcoat).
    if material.clearcoat:
        roughness = float(material.clearcoat_roughness)
        white, risen = facet_shares(roughness, cosine, COAT_IOR)
        lacquer = float(material.clearcoat) * (0.04 * (white - risen) + risen)
        found = (1 - lacquer) * found + lacquer * maps.looked(_lobe(roughness**2), towards)
    return found + np.array(material.emission)


def _even(material: Material) -> Material:
    """The material with the means of its images; a body that scatters is as matt as one that nothing gets through.

    Rd of such a body is Jensen and Buhler's (2002): α'/2 · (1 + e^{−4/3·A·√(3(1−α'))}) · e^{−√(3(1−α'))}.
    """
    colours = ("base_color", "emission", "specular_color")
    numbers = ("metallic", "roughness", "transmission", "specular", "clearcoat", "clearcoat_roughness")
    even = replace(
        material,
        normal=None,
        **{name: mean_colour(np.broadcast_to(getattr(material, name), _colours(material, name))) for name in colours},
        **{name: mean_number(getattr(material, name)) for name in numbers},
    )
    if even.scattering_distance is None or not even.through:
        return even
    albedo, ior = np.array(even.scattering_albedo), even.ior
    inside = -1.440 / ior**2 + 0.710 / ior + 0.668 + 0.0636 * ior
    damping = np.sqrt(3 * (1 - albedo))
    matt = albedo / 2 * (1 + np.exp(-4 / 3 * (1 + inside) / (1 - inside) * damping)) * np.exp(-damping)
    return replace(even, base_color=mean_colour(matt), transmission=0.0, scattering_distance=None)


def _colours(material: Material, name: str) -> tuple[int, ...]:
    value = np.asarray(getattr(material, name))
    return value.shape if value.ndim else (3,)


def _lobe(alpha: float) -> Lobe:
    if alpha < MIRROR:
        return Mirror()
    return Flattened(GGXLobe(alpha), FINEST) if alpha < 1.5 * FINEST else GGXLobe(alpha)


def facet_shares(roughness: float, cosine: np.ndarray, ior: float) -> tuple[np.ndarray, np.ndarray]:
    """What white facets reflect, and black ones with a white rim, by the angle of view (Karis 2013, the second sum)."""
    if roughness**2 < MIRROR:
        return np.ones_like(cosine), rise(cosine, ior)
    # The tables' nodes are even in √cos θ and in roughness.
    at = roughness * (ROUGHNESSES - 1)
    low = min(int(at), ROUGHNESSES - 2)
    table = ggx_shares(ior).astype(np.float64)
    row = table[low] + (at - low) * (table[low + 1] - table[low])
    along, risen = (np.interp(np.sqrt(cosine), np.linspace(0, 1, COSINES), row[:, each]) for each in (0, 1))
    return along + risen, risen


def _through(normals: np.ndarray, eye: np.ndarray, ior: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the view leaves a ball that it goes through, and how long its way inside is, in radii."""
    inside = _bent(-eye, normals, 1 / ior)
    length = -2 * (inside * normals).sum(-1, keepdims=True)
    return _bent(inside, -(normals + length * inside), ior), length


def _bent(ray: np.ndarray, normal: np.ndarray, ratio: float) -> np.ndarray:
    """Snell's law for unit vectors; `normal` is on the ray's side."""
    cosine = -(ray * normal).sum(-1, keepdims=True)
    rest = np.sqrt(np.maximum(1 - ratio**2 * (1 - cosine**2), 0))
    return ratio * ray + (ratio * cosine - rest) * normal

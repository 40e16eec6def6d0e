"""Every material of a scene as the coefficients of Whitted's eq. 2, in tables that kernels read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from relume.errors import UnsupportedScene, warn
from relume.light.reflection.brdf import PhongReflectance, Reflectance
from relume.light.reflection.lobes import Lambert, Lobe, Mirror, Phong
from relume.light.reflection.weights import Complement, Even, Fresnel, Schlick, Weight
from relume.renderers.unsupported import warn_of_unsupported
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.bumps import BumpMap, Bumps, Wrinkles
from relume.scene.materials.materials import Colour, Diffuse, Material, Ward
from relume.scene.materials.measured import MeasuredBRDF
from relume.scene.materials.reflective import Reflective, Towards
from relume.scene.materials.whitted import Checks, WhittedMaterial
from relume.scene.shapes.shapes import AnyMaterial

CONSTANT, FRESNEL, SCHLICK = 0, 1, 2
"""How k_s varies with the angle: not; times Fresnel's reflectance; from k_s along the normal to 1 at grazing angles."""
FLAT, CHECKED, PICTURE = 0, 1, 2
"""What paints the diffuse colour."""
SMOOTH = 0.03
"""Below this roughness a surface is smooth, as for Mitsuba (`mitsuba.materials`)."""
BROAD = 0.25
"""Above this microfacet width the reflected lights stand for the whole reflection: no rays are scattered."""


class Coefficients(NamedTuple):
    """One material, M of them one behind the other; colours (M, 3) float64, numbers (M,).

    diffuse, second : k_d, or the two colours of checks
    ambient : what multiplies ambient light; −1 for as the paint
    specular, transmission, highlight : k_s and k_t of eq. 2, k_s of eq. 1
    coat : what is kept, along the normal, from what lies below a coat; −1 for no coat
    law : how k_s varies with the angle
    alpha : width of GGX facets, whose highlight is then shown; 0 for eq. 1's
    tint, stained : how much of the picture is added to k_s, and whether its root multiplies k_t
    everywhere : whether the lights of a constellation show highlights, for there are no S rays to see the map
    paint, picture, size : FLAT, CHECKED or PICTURE; which picture; metres of a check
    bumps : the row of the bumps; −1 for none
    by_uv : whether texture coordinates are asked for
    """

    diffuse: np.ndarray
    second: np.ndarray
    ambient: np.ndarray
    specular: np.ndarray
    transmission: np.ndarray
    highlight: np.ndarray
    coat: np.ndarray
    exponent: np.ndarray
    ior: np.ndarray
    law: np.ndarray
    roughness: np.ndarray
    alpha: np.ndarray
    tint: np.ndarray
    stained: np.ndarray
    everywhere: np.ndarray
    paint: np.ndarray
    picture: np.ndarray
    size: np.ndarray
    bumps: np.ndarray
    by_uv: np.ndarray


class Pictures(NamedTuple):
    """Images one behind the other: pixels (N, 3) float32; begin, rows, columns (I,)."""

    pixels: np.ndarray
    begin: np.ndarray
    rows: np.ndarray
    columns: np.ndarray


class BumpTable(NamedTuple):
    """Wrinkles and bump maps: waves (W, 4) float64, wave vectors times their height and phases; and slopes in pictures.

    first, last : (B,) of a row's waves; none for a bump map
    height : (B,) metres that the waves' cosines are multiplied by
    picture : (B,) which picture of slopes; −1 for wrinkles
    """

    waves: np.ndarray
    first: np.ndarray
    last: np.ndarray
    height: np.ndarray
    picture: np.ndarray


def material_tables(materials: Sequence[AnyMaterial]) -> tuple[Coefficients, Pictures, BumpTable]:
    """All that kernels need to know of these materials; raises UnsupportedScene for what eq. 2 cannot say."""
    pictures: list[np.ndarray] = []
    every_bumps: list[Bumps] = []
    rows = [_row(as_whitted(material), pictures, every_bumps) for material in materials]
    # A first row that is cut off again gives an empty scene's tables their shapes.
    columns = zip(_row(Model(WhittedMaterial()), [], []), *rows, strict=True)
    coefficients = Coefficients(*(np.array(column, np.float64)[1:].copy() for column in columns))
    return coefficients, *_bump_tables(every_bumps, pictures)


@dataclass(frozen=True, eq=False)
class Model:
    """A material in Whitted's terms, and what the others need beyond them.

    law : how k_s varies with the angle
    alpha : width of GGX microfacets; 0 for the paper's own highlight and perturbation
    coat : what a coat keeps from what lies below, along the normal; k_s unless given
    picture : paints the diffuse part by `share`, and k_s by `tint`, as of a metal
    everywhere : whether all lights stand for the reflection, instead of rays
    """

    material: WhittedMaterial
    law: int = CONSTANT
    alpha: float = 0.0
    coat: Colour | None = None
    picture: np.ndarray | None = None
    share: float = 1.0
    tint: float = 0.0
    everywhere: bool = False


def as_whitted(material: AnyMaterial) -> Model:
    """The coefficients that come nearest to a material; raises UnsupportedScene where none do."""
    if isinstance(material, WhittedMaterial):
        return Model(material, FRESNEL if material.fresnel else CONSTANT)
    if isinstance(material, Diffuse):
        return Model(WhittedMaterial(material.reflectance))
    if isinstance(material, Ward):
        raise UnsupportedScene(
            f"Whitted's model cannot shade the Ward surface {material.name!r}; use rl.Mitsuba (--renderer mitsuba)"
        )
    if isinstance(material, MeasuredBRDF | ABCFacets):
        raise UnsupportedScene(
            f"Whitted's model cannot shade the measured surface {material.name!r}; use rl.Mitsuba (--renderer mitsuba)"
        )
    return _metallic_roughness(material) if isinstance(material, Material) else _of_layers(material)


def _metallic_roughness(material: Material) -> Model:
    """glTF's model: smooth mirrors, glass and plastic exactly; rough ones by GGX facets, which scatter rays where they
    are narrow or let light through, and else reflect all lights."""
    warn_of_unsupported(material, "Whitted's model does")
    for name in ("metallic", "roughness", "transmission"):
        if np.ndim(getattr(material, name)):
            warn(f"the {name} image of {material.name!r} is taken at its mean; Whitted's model has one for a surface")
    metallic, roughness = float(np.mean(material.metallic)), float(np.mean(material.roughness))
    alpha = roughness**2 if roughness > SMOOTH else 0.0
    base = np.asarray(material.base_color, np.float64)
    image = base.ndim > 1
    dielectric = ((material.ior - 1) / (material.ior + 1)) ** 2
    clear = float(np.mean(material.transmission))
    through = clear * (1 - metallic)
    plain = np.ones(3) if image else base
    normal = dielectric * (1 - metallic) + (0 if image else metallic * base)
    law = FRESNEL if metallic == 0 else CONSTANT if metallic == 1 and not alpha else SCHLICK
    share = (1 - metallic) * (1 - clear)
    surface = WhittedMaterial(
        (0.0, 0.0, 0.0) if image else _triple(share * base),
        _triple(np.ones(3) if law == FRESNEL else normal),
        # The tint of glass is that of both crossings of a closed body together.
        transmission=_triple(np.sqrt(plain) * through),
        highlight=(0.0, 0.0, 0.0),
        ior=material.ior,
        coated=True,
        roughness=alpha / np.sqrt(2),
        name=material.name,
    )
    picture = base.astype(np.float32) if image else None
    return Model(surface, law, alpha, _triple(dielectric), picture, share, metallic, alpha > BROAD and not through)


def _of_layers(material: Reflective) -> Model:
    """Line 9 of Miller & Hoffman with true rays where their model looks maps up."""
    parts: dict[str, Any] = {"bumps": material.bumps, "name": material.name}
    law, alpha = CONSTANT, 0.0
    for layer in material.layers:
        colour, weight = np.asarray(layer.colour, np.float64), layer.weight
        under = isinstance(weight, Complement)
        inner = weight.weight if isinstance(weight, Complement) else weight
        if (
            not isinstance(inner, Even | Fresnel | Schlick)
            or not isinstance(layer.grazing, Even)
            or layer.grazing.value != 0.0
        ):
            raise _unsupported(material, "its weights")
        even = np.asarray(inner.value) if isinstance(inner, Even) and not under else 1.0
        k = getattr(layer.lobe, "k", 1.0) * even
        if isinstance(layer.lobe, Lambert) and layer.towards is Towards.NORMAL and "diffuse" not in parts:
            parts["coated"] = under
            parts["diffuse"] = _triple(colour * k) if colour.ndim == 1 else (colour * k).astype(np.float32)
        elif isinstance(layer.lobe, Mirror) and layer.towards is Towards.REFRACTED and colour.ndim == 1:
            parts |= {"transmission": _triple(colour * k), "ior": layer.ior}
        elif layer.towards is Towards.REFLECTED and colour.ndim == 1 and "specular" not in parts:
            law, normal = _law(inner, parts)
            parts["specular"] = _triple(colour * k * (normal if law == SCHLICK else 1.0))
            alpha = float(getattr(layer.lobe, "alpha", 0.0))
            parts |= _glossiness(layer.lobe, alpha, colour * k * normal, material)
        else:
            raise _unsupported(material, "one of its layers")
    # Glass is a surface of two layers, of which one gets what the other leaves.
    parts.setdefault("coated", "transmission" in parts)
    return Model(WhittedMaterial(**parts), law, alpha)


def _law(weight: Weight, parts: dict[str, Any]) -> tuple[int, np.ndarray]:
    """How k_s varies, and what it is along the normal."""
    if isinstance(weight, Fresnel):
        parts.setdefault("ior", weight.ior)
        return FRESNEL, np.full(3, ((weight.ior - 1) / (weight.ior + 1)) ** 2)
    if isinstance(weight, Schlick):
        return SCHLICK, np.broadcast_to(np.asarray(weight.normal, np.float64), (3,))
    return CONSTANT, np.ones(3)


def _glossiness(lobe: Lobe | Reflectance, alpha: float, normal: np.ndarray, material: Reflective) -> dict[str, Any]:
    """The perturbation of normals that spreads rays as a lobe does, and the highlight of a lobe that has no facets."""
    if getattr(lobe, "varnish", 0.0):
        raise _unsupported(material, "a lobe with varnish")
    if isinstance(lobe, Mirror) or alpha > 0:
        return {"highlight": (0.0, 0.0, 0.0), "roughness": alpha / np.sqrt(2)}
    if isinstance(lobe, Phong | PhongReflectance) and lobe.n > 0:
        # cosⁿ of an angle twice the normal's has the width 1/√n, and about the halfway vector four times the exponent.
        highlight = _triple(normal * (lobe.n + 2) / 2)
        return {"roughness": 0.5 / np.sqrt(lobe.n), "exponent": 4 * lobe.n, "highlight": highlight}
    raise _unsupported(material, f"the lobe {type(lobe).__name__}")


def _unsupported(material: Reflective, what: str) -> UnsupportedScene:
    return UnsupportedScene(
        f"Whitted's model has no place for {what} in {material.name or 'a Reflective surface'!r}; "
        "use rl.Prefiltered (renderer prefiltered), or a mirror, glass, glossy or whitted material"
    )


def _triple(value: np.ndarray | float) -> Colour:
    r, g, b = np.broadcast_to(value, (3,))
    return float(r), float(g), float(b)


def _row(model: Model, pictures: list[np.ndarray], bumps: list[Bumps]) -> tuple[Any, ...]:
    """The fields of `Coefficients` for one material; its picture and its bumps are put behind the others."""
    m = model.material
    paint, picture, size = FLAT, -1, 1.0
    first = second = m.diffuse
    if isinstance(m.diffuse, Checks):
        paint, size, first, second = CHECKED, m.diffuse.size, m.diffuse.first, m.diffuse.second
    image = m.diffuse if model.picture is None else model.picture
    if isinstance(image, np.ndarray) and image.ndim == 3:
        # The row holds what multiplies the picture.
        paint, picture, first = PICTURE, len(pictures), (model.share,) * 3
        second = first
        pictures.append(image)
    which = -1
    if m.bumps is not None:
        which = len(bumps)
        bumps.append(m.bumps)
    none = (-1.0, -1.0, -1.0)
    coat = none if not m.coated else m.specular if model.coat is None else model.coat
    return (
        first, second, none if m.ambient is None else m.ambient, m.specular, m.transmission,
        m.specular if m.highlight is None else m.highlight, coat, m.exponent, m.ior, model.law, m.roughness,
        model.alpha, model.tint, model.picture is not None, model.everywhere, paint, picture, size, which,
        paint == PICTURE or isinstance(m.bumps, BumpMap),
    )  # fmt: skip


def _bump_tables(every: Sequence[Bumps], pictures: list[np.ndarray]) -> tuple[Pictures, BumpTable]:
    """Bump maps become pictures of their slopes, behind the others."""
    waves, first, last, height, picture = [np.zeros((0, 4))], [], [], [], []
    for bumps in every:
        first.append(sum(map(len, waves)))
        if isinstance(bumps, Wrinkles):
            numbers, phases, amplitude = bumps.components()
            waves.append(np.column_stack([numbers, phases]))
            height.append(amplitude)
            picture.append(-1)
        elif isinstance(bumps, BumpMap):
            slopes = bumps.slopes()
            picture.append(len(pictures))
            pictures.append(np.concatenate([slopes, np.zeros((*slopes.shape[:2], 1))], axis=-1))
            height.append(0.0)
        else:
            raise UnsupportedScene(
                f"Whitted's renderer knows Wrinkles and BumpMap, not {type(bumps).__name__}; use one of them"
            )
        last.append(sum(map(len, waves)))
    sizes = np.array([image.shape[:2] for image in pictures], np.int64).reshape(-1, 2)
    begin = np.concatenate([[0], np.cumsum(sizes.prod(axis=1))])[:-1].astype(np.int64)
    pixels = np.concatenate([np.zeros((0, 3)), *(image.reshape(-1, 3) for image in pictures)]).astype(np.float32)
    table = BumpTable(
        np.concatenate(waves), np.array(first, np.int64), np.array(last, np.int64), np.array(height, np.float64),
        np.array(picture, np.int64),
    )  # fmt: skip
    return Pictures(pixels, begin, sizes[:, 0].copy(), sizes[:, 1].copy()), table

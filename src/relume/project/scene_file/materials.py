"""The materials of a scene file: their tables, and the surfaces that these stand for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Discriminator, Field, Tag

from relume.light.reflection.brdf import GGX, Ward
from relume.light.reflection.lobes import GGXLobe, Phong, WardLobe
from relume.light.reflection.weights import Even, Fresnel, Schlick, Weight
from relume.project.mesh_tables import MaterialTable, warn_of_white_glass
from relume.project.scene_file.images import colour_of, naming, number_of, picture
from relume.project.scene_file.surfaces import MeasuredTable, WardTable
from relume.project.schema import Channels, GreyOrColour, Paint, Share, Table
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.bumps import BumpMap, Bumps, Wrinkles
from relume.scene.materials.materials import Colour, Diffuse, Material, is_image
from relume.scene.materials.materials import Ward as WardSurface
from relume.scene.materials.measured import MeasuredBRDF
from relume.scene.materials.reflective import Reflective, glass, glossy, mirror, retroreflector
from relume.scene.materials.whitted import Checks, WhittedMaterial
from relume.scene.shapes.shapes import AnyMaterial

WHITE: Colour = (1.0, 1.0, 1.0)
PAINTED = ("base_color", "emission")
"""What of a glTF material may be an image here."""


class PhongTable(Table):
    """Phong's highlights, with a share of clear varnish."""

    kind: Literal["phong"]
    n: float = 50.0
    varnish: float = 0.0


class FlatLobeTable(Table):
    """A microfacet lobe about the reflected direction, the same at every angle of view."""

    kind: Literal["ggx-lobe", "ward-lobe"]
    alpha: float


class FacetsTable(Table):
    """A whole microfacet BRDF, looked up by the angle of view too."""

    kind: Literal["ggx", "ward"]
    alpha: float


LobeTable = Annotated[PhongTable | FlatLobeTable, Field(discriminator="kind")]
ReflectanceTable = Annotated[PhongTable | FlatLobeTable | FacetsTable, Field(discriminator="kind")]


class EvenTable(Table):
    """The same share reflected at every angle."""

    kind: Literal["even"]
    value: Channels = 1.0


class SchlickTable(Table):
    """Schlick's approximation, by the reflectance along the normal."""

    kind: Literal["schlick"]
    normal: Channels = 0.04


class FresnelTable(Table):
    """The exact reflectance of a dielectric."""

    kind: Literal["fresnel"]
    ior: float = 1.5


WeightTable = Annotated[EvenTable | SchlickTable | FresnelTable, Field(discriminator="kind")]


class WrinklesTable(Table):
    """Irregular waves."""

    height: float = 0.002
    wavelength: float = 0.05
    seed: Annotated[int, Field(ge=0)] = 0


class BumpMapTable(Table):
    """An image of heights, from black at 0 to white at `height` metres."""

    map: str
    height: float


BumpsTable = Annotated[
    Annotated[WrinklesTable, Tag("of waves")] | Annotated[BumpMapTable, Tag("of an image")],
    Discriminator(lambda value: "of an image" if isinstance(value, dict) and "map" in value else "of waves"),
]


class MirrorTable(Table):
    """A perfect mirror."""

    kind: Literal["mirror"]
    colour: GreyOrColour = WHITE
    bumps: BumpsTable | None = None


class GlossyTable(Table):
    """Lambert below a specular lobe (Miller & Hoffman 1984, line 9)."""

    kind: Literal["glossy"]
    diffuse: Paint = (0.5, 0.5, 0.5)
    lobe: ReflectanceTable = PhongTable(kind="phong")
    weight: WeightTable = SchlickTable(kind="schlick")
    bumps: BumpsTable | None = None


class RetroreflectorTable(Table):
    """Light sent back where it came from."""

    kind: Literal["retroreflector"]
    colour: GreyOrColour = WHITE
    lobe: LobeTable = PhongTable(kind="phong")
    bumps: BumpsTable | None = None


class GlassTable(Table):
    """Refraction at a single surface below its reflection."""

    kind: Literal["glass"]
    ior: float = 1.5
    colour: GreyOrColour = WHITE
    bumps: BumpsTable | None = None


class DiffuseTable(Table):
    """A Lambert surface."""

    kind: Literal["diffuse"]
    reflectance: GreyOrColour


class PbrTable(MaterialTable):
    """glTF's metallic–roughness model, or a preset with changes, which may be a Ward surface."""

    kind: Literal["pbr"]
    base_color: Paint | None = None
    emission: Paint | None = None
    # A gloss map, and where it is metal: numbers, or images whose black is 0 and whose white is 1.
    roughness: Share | str | None = None
    metallic: Share | str | None = None

    def made(self, name: str, folder: Path, place: str) -> Material | WardSurface | MeasuredBRDF | ABCFacets:
        """The material; raises ValueError for what it has no field for."""
        painted = {key: paint for key in PAINTED if (paint := getattr(self, key)) is not None}
        images = [key for key in ("roughness", "metallic") if isinstance(getattr(self, key), str)]
        numbers = self.model_dump(exclude_none=True, exclude={"kind", *PAINTED, *images})
        material = MaterialTable(**numbers).apply(Material(), folder)
        if isinstance(material, Material):
            given = {key: number_of(getattr(self, key), folder, f"{place}.{key}") for key in images}
            given |= {key: colour_of(paint, folder, f"{place}.{key}") for key, paint in painted.items()}
            warn_of_white_glass(self, material, place)
            return replace(material, **given, name=name)
        if painted and isinstance(material, WardSurface):
            raise ValueError(f"{next(iter(painted))}: a Ward surface has none; give reflectance and diffuse")
        if painted or images:
            raise ValueError(f"{', '.join([*images, *painted])}: the preset has none; leave them out")
        return replace(material, name=name)


class ChecksTable(Table):
    """Cubes of two colours through space."""

    checks: tuple[GreyOrColour, GreyOrColour]
    size: float = 1.0


def _sort_of_paint(value: object) -> str:
    return "image" if isinstance(value, str) else "pattern" if isinstance(value, dict | ChecksTable) else "colour"


PatternedPaint = Annotated[
    Annotated[str, Tag("image")] | Annotated[ChecksTable, Tag("pattern")] | Annotated[GreyOrColour, Tag("colour")],
    Discriminator(_sort_of_paint),
]
"""An image's path, checks, a colour or a grey."""


class WhittedTable(Table):
    """The coefficients of Whitted (1980), eq. 1 and 2, with the defaults of `WhittedMaterial`."""

    kind: Literal["whitted"]
    diffuse: PatternedPaint | None = None
    specular: GreyOrColour | None = None
    transmission: GreyOrColour | None = None
    ambient: GreyOrColour | None = None
    highlight: GreyOrColour | None = None
    exponent: float | None = None
    ior: float | None = None
    fresnel: bool | None = None
    coated: bool | None = None
    roughness: float | None = None
    bumps: BumpsTable | None = None


SurfaceTable = Annotated[
    MirrorTable
    | GlossyTable
    | RetroreflectorTable
    | GlassTable
    | DiffuseTable
    | PbrTable
    | MeasuredTable
    | WardTable
    | WhittedTable,
    Field(discriminator="kind"),
]


def made(table: SurfaceTable, name: str, folder: Path, place: str) -> AnyMaterial:
    """The material that a table stands for, its images read; raises InvalidScene naming the key below `place`."""
    with naming(place):
        match table:
            case DiffuseTable():
                return Diffuse(table.reflectance)
            case PbrTable():
                return table.made(name, folder, place)
            case MeasuredTable():
                return table.made(name, folder)
            case WardTable():
                return table.made(name, folder, place)
            case MirrorTable():
                return mirror(table.colour, bumps=_bumps(table.bumps, folder, place), name=name)
            case GlassTable():
                return glass(table.ior, table.colour, bumps=_bumps(table.bumps, folder, place), name=name)
            case RetroreflectorTable():
                with naming(f"{place}.lobe"):
                    lobe = _lobe(table.lobe)
                return retroreflector(table.colour, lobe, bumps=_bumps(table.bumps, folder, place), name=name)
            case GlossyTable():
                with naming(f"{place}.lobe"):
                    specular = _lobe(table.lobe)
                with naming(f"{place}.weight"):
                    weight = _weight(table.weight)
                diffuse = colour_of(table.diffuse, folder, f"{place}.diffuse")
                bumps = _bumps(table.bumps, folder, place)
                return glossy(diffuse, specular, specular_weight=weight, bumps=bumps, name=name)
            case WhittedTable():
                given = table.model_dump(exclude_none=True, exclude={"kind", "diffuse", "bumps"})
                if table.diffuse is not None:
                    given["diffuse"] = _patterned(table.diffuse, folder, f"{place}.diffuse")
                return WhittedMaterial(**given, bumps=_bumps(table.bumps, folder, place), name=name)


def has_images(material: AnyMaterial) -> bool:
    """Whether the material needs texture coordinates."""
    if isinstance(material, WhittedMaterial):
        return isinstance(material.diffuse, np.ndarray) or isinstance(material.bumps, BumpMap)
    if isinstance(material, Reflective):
        images = [isinstance(layer.colour, np.ndarray) for layer in material.layers]
        return any(images) or isinstance(material.bumps, BumpMap)
    if isinstance(material, Material):
        return any(is_image(getattr(material, name)) for name in (*PAINTED, "metallic", "roughness"))
    fields = ("reflectance", "diffuse", "alpha_x", "alpha_y", "rotation")
    return isinstance(material, WardSurface) and any(is_image(getattr(material, field)) for field in fields)


def _lobe(table: PhongTable | FlatLobeTable | FacetsTable) -> Any:
    """The lobe, or the whole reflectance, that a table stands for."""
    if isinstance(table, PhongTable):
        return Phong(table.n, varnish=table.varnish)
    return {"ggx-lobe": GGXLobe, "ward-lobe": WardLobe, "ggx": GGX, "ward": Ward}[table.kind](table.alpha)


def _weight(table: EvenTable | SchlickTable | FresnelTable) -> Weight:
    if isinstance(table, EvenTable):
        return Even(table.value)
    return Schlick(table.normal) if isinstance(table, SchlickTable) else Fresnel(table.ior)


def _bumps(table: WrinklesTable | BumpMapTable | None, folder: Path, place: str) -> Bumps | None:
    if table is None:
        return None
    with naming(f"{place}.bumps"):
        if isinstance(table, WrinklesTable):
            return Wrinkles(table.height, table.wavelength, table.seed)
    with naming(f"{place}.bumps.map"):
        return BumpMap(table.height * picture(folder / table.map, encoded=True).mean(axis=-1))


def _patterned(paint: Colour | str | ChecksTable, folder: Path, place: str) -> Colour | np.ndarray | Checks:
    if not isinstance(paint, ChecksTable):
        return colour_of(paint, folder, place)
    with naming(place):
        return Checks(*paint.checks, paint.size)

"""The shot as a folder for Mitsuba 3: the scene that the path tracer renders, as XML, PLY and OpenEXR.

`place.xml` is the real place as the camera saw it, `shot.xml` that with the objects: the two renders whose difference
is added to the plate (Debevec 1998, §6).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np

from relume.errors import GatheredDoubts
from relume.export.lamps import figure, figures
from relume.export.mitsuba.lights import sphere
from relume.export.parts import physical
from relume.export.shot_lamps import undistorted, write_pictures
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.project.insertion.prepared import PreparedShot
from relume.renderers.mitsuba.materials import bsdf, interior, not_rendered
from relume.renderers.mitsuba.scene import scene_dictionary
from relume.scene.lights import SphereLight
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.materials import Material, Ward
from relume.scene.materials.measured import MeasuredBRDF
from relume.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class Bitmap:
    """An image (H, W, 1) or (H, W, 3), float32."""

    pixels: np.ndarray


@dataclass(frozen=True, eq=False)
class Transform:
    """A matrix (4, 4), world from object."""

    matrix: np.ndarray


@dataclass(frozen=True, eq=False)
class MeshWords:
    """Triangles: flat arrays by Mitsuba's names, and what hangs on the mesh by its names."""

    name: str
    parts: dict[str, Any]
    has_normals: bool
    has_texcoords: bool
    arrays: dict[str, np.ndarray] = field(default_factory=dict)


class Notebook:
    """What `scene_dictionary`, `bsdf` and `interior` ask of the module `mitsuba`, as values.

    It speaks for the scalar variant, for which every material is one of Mitsuba's own plugins and none of ours.
    """

    def variant(self) -> str:
        return "scalar_rgb"

    def Bitmap(self, pixels: np.ndarray) -> Bitmap:
        return Bitmap(pixels)

    def ScalarTransform4f(self, matrix: np.ndarray) -> Transform:
        return Transform(np.asarray(matrix, np.float64))

    def Properties(self) -> dict[str, Any]:
        return {}

    def load_dict(self, words: dict[str, Any]) -> dict[str, Any]:
        return words

    def Mesh(
        self,
        name: str,
        vertex_count: int,
        face_count: int,
        props: dict[str, Any] | None = None,
        has_vertex_normals: bool = False,
        has_vertex_texcoords: bool = False,
    ) -> MeshWords:
        return MeshWords(name, dict(props or {}), has_vertex_normals, has_vertex_texcoords)

    def traverse(self, mesh: MeshWords) -> dict[str, np.ndarray]:
        """Its arrays; a dictionary's `update` without arguments does what Mitsuba's needs: nothing."""
        return mesh.arrays


def ply(mesh: MeshWords) -> bytes:
    """The mesh as a binary PLY file (Turk 1994), with the properties by the names that Mitsuba's loader knows."""
    columns: Sequence[tuple[str, str, int]] = [("vertex_positions", "x y z", 3)]
    if mesh.has_normals:
        columns = [*columns, ("vertex_normals", "nx ny nz", 3)]
    if mesh.has_texcoords:
        columns = [*columns, ("vertex_texcoords", "u v", 2)]
    vertices = np.concatenate([mesh.arrays[key].reshape(-1, width) for key, _, width in columns], axis=1)
    faces = mesh.arrays["faces"].reshape(-1, 3)
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for _, names, _ in columns for name in names.split()]
    header += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    rows = np.empty(len(faces), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    rows["count"], rows["corners"] = 3, faces
    return "\n".join([*header, ""]).encode() + vertices.astype("<f4").tobytes() + rows.tobytes()


USE = """    mitsuba shot.xml    the place with the objects
    mitsuba place.xml   the place without them

With the same number of samples and the same seed, plate + (shot - place) is the composite where no object covers, and
shot where one does. -Dsamples=1024 and -Ddepth=6 set how long it renders."""

KINDS = {
    "bsdf": {
        "twosided", "diffuse", "principled", "principledthin", "conductor", "roughconductor", "dielectric",
        "roughdielectric", "thindielectric", "plastic", "roughplastic", "blendbsdf", "normalmap", "bumpmap", "mask",
    },
    "emitter": {"envmap", "area", "point", "directional", "constant"},
    "film": {"hdrfilm"},
    "integrator": {"path", "volpath"},
    "medium": {"homogeneous"},
    "phase": {"hg", "isotropic"},
    "rfilter": {"box", "gaussian", "tent"},
    "sampler": {"independent", "stratified", "multijitter"},
    "sensor": {"perspective", "thinlens"},
    "shape": {"rectangle", "sphere"},
    "texture": {"bitmap", "uniform"},
}  # fmt: skip
"""The XML's tag of each of Mitsuba's plugins that our scenes use."""
CLEAR = '        <bsdf type="null"/>\n'
"""The surface of a lamp: light goes through it."""
TAGS = {plugin: tag for tag, plugins in KINDS.items() for plugin in plugins}


def write(value: PreparedShot, folder: Path) -> tuple[str, ...]:
    """Write the files; what Mitsuba's own plugins do not hold."""
    value, notes = undistorted(value)
    scene, lost = _held(value.scene)
    lamps = tuple(light for light in scene.lights if isinstance(light, SphereLight))
    others = tuple(light for light in scene.lights if not isinstance(light, SphereLight))
    words, said = _words(replace(scene, lights=others), value)
    writer = _Writer(folder)
    first = len(scene.local)
    added = {f"shape_{index:04d}" for index in range(first, first + len(scene.objects))}
    place = [writer.element(key, each, 1) for key, each in words.items() if key != "type" and key not in added]
    for index, lamp in enumerate(lamps):
        place.append(sphere(f"lamp_{index:04d}", lamp.position, lamp.radius, lamp.radiance, CLEAR))
    objects = [writer.element(key, words[key], 1) for key in sorted(added)]
    place = [_render(value, volumes="homogeneous" in writer.plugins), *place]
    (folder / "place.xml").write_text(_scene(place), encoding="utf-8")
    (folder / "shot.xml").write_text(_scene(['    <include filename="place.xml"/>\n', *objects]), encoding="utf-8")
    write_pictures(value, folder)
    if lamps:
        notes = (*notes, "its lamps are spheres that the camera sees and that throw shadows")
    if "principled" in writer.plugins:
        notes = (
            *notes,
            "opaque surfaces that are no mirrors are Mitsuba's `principled`, which ours differs from a little",
        )
    return (*notes, *lost, *said)


def _words(scene: Scene, value: PreparedShot) -> tuple[dict[str, Any], tuple[str, ...]]:
    """The scene as `load_dict` takes it, bodies with what fills them, and notes on what no plugin holds."""
    with GatheredDoubts() as gathered:
        words = scene_dictionary(Notebook(), scene, value.camera)
        lost = []
        for index, shape in enumerate((*scene.local, *scene.objects)):
            material = shape.material
            if not isinstance(material, Material):
                continue
            lost += [f"{material.name or f'shape {index}'}: {each}" for each in _lost(material)]
            if material.medium is not None:
                entry = words[f"shape_{index:04d}"]
                parts = entry.parts if isinstance(entry, MeshWords) else entry
                parts["bsdf"], parts["interior"] = bsdf(Notebook(), material, media=True), interior(material)
    # What the renderer leaves out of materials is listed by `_lost`: here bodies are filled.
    others = [each.line for each in gathered.doubts if not each.line.startswith("not rendered of material")]
    return words, (*lost, *others)


def _lost(material: Material) -> list[str]:
    found = not_rendered(material, media=True, scalar=True)
    return [each.replace("the scalar variant has none", "Mitsuba's own plugins have none like ours") for each in found]


def _held(scene: Scene) -> tuple[Scene, tuple[str, ...]]:
    """The scene without what is ours alone, and notes on what came in its place."""
    notes: list[str] = []

    def held(shape: Any) -> Any:
        if not isinstance(shape.material, Ward | MeasuredBRDF | ABCFacets):
            return shape
        material, lost = physical(shape.material, shape.name)
        notes.extend(lost)
        return replace(shape, material=material)

    local, objects = tuple(map(held, scene.local)), tuple(map(held, scene.objects))
    return replace(scene, local=local, objects=objects), tuple(notes)


def _scene(elements: list[str]) -> str:
    head = "<!-- Written by relume: +Y is up, lengths are metres, images scene-linear Rec. 709. -->\n"
    return f'<?xml version="1.0" encoding="utf-8"?>\n{head}<scene version="3.0.0">\n{"".join(elements)}</scene>\n'


def _render(value: PreparedShot, *, volumes: bool) -> str:
    kind = "volpath" if volumes else "path"
    return (
        f'    <default name="samples" value="{value.samples}"/>\n'
        # Mitsuba counts the segments of a path, we its bounces.
        f'    <default name="depth" value="{value.depth + 1}"/>\n'
        f'    <integrator type="{kind}">\n'
        '        <integer name="max_depth" value="$depth"/>\n'
        "    </integrator>\n"
    )


class _Writer:
    """Elements of the XML; their images and meshes become files on the way."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.count = 0
        self.plugins: set[str] = set()

    def element(self, key: str, value: Any, level: int) -> str:
        """One value of a dictionary as Mitsuba's `load_dict` takes it, as an element."""
        space, name = "    " * level, quoteattr(key)
        if isinstance(value, MeshWords):
            return self.mesh(key, value, level)
        if isinstance(value, dict):
            if value["type"] == "rgb":
                colour = np.atleast_1d(np.asarray(value["value"], np.float64))
                return f'{space}<rgb name={name} value="{figures(tuple(map(float, colour)), ", ")}"/>\n'
            return self.plugin(key, value, level)
        if isinstance(value, Bitmap):
            return f'{space}<string name="filename" value="{self.image(value)}"/>\n'
        if isinstance(value, Transform):
            numbers = figures(tuple(map(float, value.matrix.ravel())))
            return f'{space}<transform name={name}>\n{space}    <matrix value="{numbers}"/>\n{space}</transform>\n'
        if isinstance(value, bool):
            return f'{space}<boolean name={name} value="{str(value).lower()}"/>\n'
        if isinstance(value, int):
            return f'{space}<integer name={name} value="{value}"/>\n'
        if isinstance(value, str):
            return f"{space}<string name={name} value={quoteattr(value)}/>\n"
        if isinstance(value, list | tuple):
            tag = "point" if key == "position" else "vector"
            return f'{space}<{tag} name={name} value="{figures(tuple(map(float, value)), ", ")}"/>\n'
        return f'{space}<float name={name} value="{figure(float(value))}"/>\n'

    def plugin(self, key: str, words: dict[str, Any], level: int) -> str:
        space, tag, kind = "    " * level, TAGS[words["type"]], words["type"]
        self.plugins.add(kind)
        # On the first level a name is an identity.
        label = f"id={quoteattr(key)}" if level == 1 else f"name={quoteattr(key)}"
        children = "".join(self.element(name, each, level + 1) for name, each in words.items() if name != "type")
        if tag == "sampler":
            children += f'{space}    <integer name="sample_count" value="$samples"/>\n'
        if not children:
            return f"{space}<{tag} type={quoteattr(kind)} {label}/>\n"
        return f"{space}<{tag} type={quoteattr(kind)} {label}>\n{children}{space}</{tag}>\n"

    def mesh(self, key: str, mesh: MeshWords, level: int) -> str:
        space = "    " * level
        (self.folder / f"{key}.ply").write_bytes(ply(mesh))
        children = "".join(self.element(name, each, level + 1) for name, each in mesh.parts.items())
        flat = "" if mesh.has_normals else f'{space}    <boolean name="face_normals" value="true"/>\n'
        return (
            f'{space}<shape type="ply" id={quoteattr(key)}>\n'
            f'{space}    <string name="filename" value={quoteattr(f"{key}.ply")}/>\n{flat}{children}{space}</shape>\n'
        )

    def image(self, bitmap: Bitmap) -> str:
        """Its file; an image of one channel is written as a grey one, of the same luminance."""
        name = f"image_{self.count:04d}.exr"
        self.count += 1
        pixels = np.broadcast_to(bitmap.pixels, (*bitmap.pixels.shape[:2], 3)).astype(np.float32)
        files.write(self.folder / name, RadianceMap(np.ascontiguousarray(pixels)))
        return name

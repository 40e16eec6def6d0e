"""The shapes of a scene as named meshes, with the materials that other programs have words for."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from relume.errors import UnsupportedScene
from relume.renderers.mitsuba.distant import Walls, walls
from relume.scene.materials.abc_facets import ABCFacets
from relume.scene.materials.materials import Diffuse, Material, Ward, mean_colour, mean_number
from relume.scene.materials.measured import MeasuredBRDF
from relume.scene.materials.reflective import Reflective
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.scene import Dome, Scene
from relume.scene.shapes.shapes import Mesh, Patches, Plane, Polygon, Shape, Sphere
from relume.scene.shapes.tessellation import tessellated, triangulated

SPHERE_ROWS = 64
"""Of triangles from pole to pole: a sphere's outline is followed to 0.0003 of its radius."""


@dataclass(frozen=True, eq=False)
class Part:
    """A mesh with a name of its own.

    name : letters, digits and underscores; no two parts have the same
    mesh : world coordinates, metres; its material is a Material or Diffuse
    real : whether it is a real surface of the local scene, which catches shadows and is seen in the plate alone
    """

    name: str
    mesh: Mesh
    real: bool

    @property
    def material(self) -> Material | Diffuse:
        """Of the mesh."""
        assert isinstance(self.mesh.material, Material | Diffuse)
        return self.mesh.material

    @property
    def named_mesh(self) -> Mesh:
        """The mesh and its material under the part's name."""
        material = replace(self.material, name=self.name) if isinstance(self.material, Material) else self.material
        return replace(self.mesh, name=self.name, material=material)


def parts_of(scene: Scene) -> tuple[tuple[Part, ...], tuple[str, ...]]:
    """Every shape of the scene, real surfaces first, and notes on what is only nearly the same.

    Planes without a size become squares of a kilometre, spheres and patches triangles. Raises UnsupportedScene for
    materials that are no physical ones.
    """
    found, notes = [], []
    for index, shape in enumerate((*scene.local, *scene.objects)):
        real = index < len(scene.local)
        mesh = _mesh(shape)
        material, note = physical(mesh.material, mesh.name)
        notes += note
        word = re.sub(r"[^A-Za-z0-9]+", "_", mesh.name).strip("_") or "mesh"
        number = index if real else index - len(scene.local)
        found.append(
            Part(f"{'real' if real else 'object'}_{number:02d}_{word}", replace(mesh, material=material), real)
        )
    return tuple(found), tuple(dict.fromkeys(notes))


def base_colour(material: Material | Diffuse) -> Any:
    """The colour or image (H, W, 3) of what the surface reflects."""
    return material.reflectance if isinstance(material, Diffuse) else material.base_color


def _mesh(shape: Shape) -> Mesh:
    if isinstance(shape, Plane):
        x, z = (length / 2 for length in shape.extent)
        y = shape.height
        corners = np.array([[-x, y, z], [x, y, z], [x, y, -z], [-x, y, -z]])
        uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
        faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
        return Mesh(corners.astype(np.float32), faces, shape.material, None, uv, "plane")
    if isinstance(shape, Sphere):
        return _sphere(shape)
    if isinstance(shape, Patches):
        return tessellated(shape)
    return triangulated(shape) if isinstance(shape, Polygon) else shape


def _sphere(sphere: Sphere) -> Mesh:
    """As a dome round its own middle is seen, turned inside out."""
    built: Walls = walls(Dome(sphere.radius, sphere.centre), sphere.centre, SPHERE_ROWS)
    outward = (built.vertices - np.array(sphere.centre)) / sphere.radius
    uv = built.uv * [1, -1] + [0, 1]
    return Mesh(
        built.vertices, built.faces[:, ::-1].copy(), sphere.material, outward.astype(np.float32),
        uv.astype(np.float32), sphere.name,
    )  # fmt: skip


def physical(material: Any, name: str) -> tuple[Material | Diffuse, list[str]]:
    """The material where other programs have it, else the nearest of metallic–roughness, and what that loses."""
    if isinstance(material, WhittedMaterial | Reflective):
        raise UnsupportedScene(
            f"{name}: other programs have no {type(material).__name__}; give it a diffuse or a pbr material"
        )
    if isinstance(material, MeasuredBRDF | ABCFacets):
        raise UnsupportedScene(
            f"{name}: other programs have no measured surface as {material.name!r} is; give it a diffuse or a pbr "
            "material"
        )
    if isinstance(material, Ward):
        # A rough metal of both colours: Ward's standard deviations are about the microfacets' widths α = roughness².
        glossy = mean_colour(material.reflectance)
        both = np.add(glossy, mean_colour(material.diffuse))
        metal = float(np.sum(glossy) / max(float(both.sum()), 1e-30))
        roughness = float(np.sqrt(np.sqrt(mean_number(material.alpha_x) * mean_number(material.alpha_y))))
        colour = mean_colour(np.minimum(both, 1))
        return Material(colour, metal, roughness, name=material.name), [
            f"{name}: Ward's surface is written as a rough metal of its colour, the same across and along"
        ]
    lost = []
    if isinstance(material, Material):
        if material.medium is not None and any(material.medium.scattering):
            lost.append(f"{name}: light that scatters inside it is left out; set the program's subsurface scattering")
        if material.metal is not None:
            lost.append(f"{name}: its metal by wavelength is written as its colour at normal incidence")
        if material.dispersion:
            lost.append(f"{name}: its dispersion is left out")
    return material, lost

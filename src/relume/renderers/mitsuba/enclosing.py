"""What lies inside what: lamps and cameras in bodies, whose paths would begin in the wrong medium, and fog's end."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from relume.errors import UnsupportedScene
from relume.renderers.mitsuba.materials import crossed_straight, filling
from relume.scene.lights import DistantLight, Light, PointLight, RectangleLight, SphereLight
from relume.scene.materials.materials import Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import AnyMaterial, Mesh, Patches, Plane, Shape, Sphere, bounding_sphere
from relume.scene.shapes.tessellation import tessellated

PLAIN_NAMES = {PointLight: "point of light", SphereLight: "sphere of light", RectangleLight: "rectangle of light"}


def surrounds(shape: Shape, point: Sequence[float] | np.ndarray) -> bool:
    """Whether a point lies inside a sphere, a mesh or patches: by the solid angle that the triangles fill about it.

    That of a triangle is by Van Oosterom and Strackee (1983); about a point inside a closed mesh they add up to 4π.
    """
    if isinstance(shape, Sphere):
        return float(np.linalg.norm(np.subtract(point, shape.centre))) < shape.radius
    if not isinstance(shape, Mesh | Patches):
        return False
    centre, radius = bounding_sphere(shape)
    if float(np.linalg.norm(np.subtract(point, centre))) > radius:
        return False
    mesh = tessellated(shape) if isinstance(shape, Patches) else shape
    corners = mesh.vertices[mesh.faces].astype(np.float64) - np.asarray(point, np.float64)
    a, b, c = np.moveaxis(corners, 1, 0)
    lengths = np.linalg.norm(corners, axis=-1)
    volume = (a * np.cross(b, c)).sum(-1)
    below = lengths.prod(-1) + (a * b).sum(-1) * lengths[:, 2]
    below += (b * c).sum(-1) * lengths[:, 0] + (c * a).sum(-1) * lengths[:, 1]
    return bool(abs(2 * np.arctan2(volume, below).sum()) > 2 * np.pi)


def lamp_in_a_body(lights: Sequence[Light], shapes: Iterable[Shape]) -> str | None:
    """In one line which lamp stands in what fills a body, whose light would begin outside; None where none does."""
    near = [light for light in lights if isinstance(light, PointLight | SphereLight | RectangleLight)]
    if not near:
        return None
    for shape in shapes:
        if filling(shape.material) is None or crossed_straight(shape.material) is not None:
            continue
        for light in near:
            if surrounds(shape, light.position):
                return (
                    f"the {PLAIN_NAMES[type(light)]} at {list(light.position)} stands inside "
                    f"{getattr(shape.material, 'name', '') or 'a body'!r}, which is filled; light from within is that "
                    "of a surface there whose material has an emission"
                )
    return None


def filled_with(light: Light | None, shapes: Iterable[Shape], numbers: Iterable[int], outside: int) -> int:
    """The number of what fills the place of a lamp: that of the smallest clear body about it.

    numbers : of what fills each shape; outside : of what lies between them, which light from afar comes through
    """
    if not isinstance(light, PointLight | SphereLight | RectangleLight):
        return outside
    about = [
        (bounding_sphere(shape)[1], number)
        for shape, number in zip(shapes, numbers, strict=True)
        if isinstance(shape, Sphere | Mesh | Patches) and _lets_in(shape.material) and surrounds(shape, light.position)
    ]
    return min(about)[1] if about else outside


def camera_in_a_body(position: np.ndarray, shapes: Iterable[Shape]) -> str | None:
    """In one line which body the camera stands in, where a scene has media; None where it stands in none."""
    for shape in shapes:
        if _lets_in(shape.material) and surrounds(shape, position):
            return (
                f"the camera stands inside {getattr(shape.material, 'name', '') or 'a body'!r}, and what fills the "
                "scene's bodies is traced from outside of them; move it out, or use [medium] for fog about it"
            )
    return None


def _lets_in(material: AnyMaterial) -> bool:
    """Whether light crosses the surface of a body into what fills it."""
    return isinstance(material, Material) and bool(np.any(material.through)) and not material.thin


def require_edges(scene: Scene) -> None:
    """Raises UnsupportedScene for fog over a plane without an edge under light from infinity, none of which arrives."""
    endless = any(isinstance(shape, Plane) and shape.size is None for shape in scene.local)
    far = np.any(scene.light.radiance) or any(isinstance(light, DistantLight) for light in scene.lights)
    if endless and far:
        raise UnsupportedScene(
            "the fog reaches as far as the shapes do, and over a plane without an edge no light from infinity gets "
            "through it; give the plane a size, or the light walls (distant)"
        )

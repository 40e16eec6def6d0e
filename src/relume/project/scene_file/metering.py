"""The film of a photographer with a light meter among a scene's objects: what exposes its developed pictures."""

from __future__ import annotations

import numpy as np

from relume.composite.surface.projection import triangles_of_shape
from relume.image.colour import luminance
from relume.scene.lights import AmbientLight, DistantLight, Light, RectangleLight, SphereLight
from relume.scene.materials.materials import Material, mean_colour
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane, Shape, Solid, bounds
from relume.virtual_camera.film.film import Film


def shines(shape: Shape) -> bool:
    """Whether a shape sends out light of its own."""
    return isinstance(shape.material, Material) and shape.material.emits


def metered_scene(scene: Scene) -> Film:
    """The film of a photographer with an incident light meter among the objects, the same for every frame of a movie.

    The mean radiance of the light map becomes ½, as `metered` has it, or a white card that faces each of the scene's
    other lights, and each surface that shines, becomes white, whichever takes less light: for one light of strength 1,
    of irradiance π, as Whitted's pictures have it, exposure 1. Exposure 1 too where nothing shines.
    """
    mean = float(luminance(scene.light.total())) / (4 * np.pi)
    shapes = (*scene.local, *scene.objects)
    dark: list[Solid] = [shape for shape in scene.objects if not shines(shape)]
    dark = dark or [shape for shape in shapes if not isinstance(shape, Plane) and not shines(shape)]
    low, high = bounds(dark)
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    card = mean + sum(_shown_by_white(light, middle, radius) for light in scene.lights)
    card += sum(_shown_by_glow(shape, middle) for shape in shapes if shines(shape))
    brightest = max(card, 2 * mean)
    return Film(1 / brightest) if 0 < brightest < np.inf else Film()


def _shown_by_white(light: Light, middle: np.ndarray, radius: float) -> float:
    """The luminance of a white card that faces a light; one within the objects is metered at their border."""
    if isinstance(light, AmbientLight):
        return _luminance(light.radiance)
    if isinstance(light, DistantLight):
        return _luminance(light.irradiance) / np.pi
    if isinstance(light, RectangleLight):
        across, up, _ = light.frame.T
        width, height = 0.5 * light.size[0] * across, 0.5 * light.size[1] * up
        corners = (
            np.asarray(light.position) - middle + [-width - height, width - height, width + height, height - width]
        )
        return _luminance(light.radiance) * _share_of_view(corners[[[0, 1, 2], [0, 2, 3]]])
    distance = max(float(np.linalg.norm(np.asarray(light.position) - middle)), radius)
    if isinstance(light, SphereLight):
        # What faces a sphere of light gets π L (r/d)²; on the sphere itself, and from within, π L.
        return _luminance(light.radiance) * min(light.radius / max(distance, light.radius), 1.0) ** 2
    share = float(light.falloff.at(np.array(distance))) if distance > 0 else np.inf
    return _luminance(light.intensity) * share / np.pi


def _luminance(colour: tuple[float, float, float]) -> float:
    return float(luminance(np.asarray(colour, np.float64)))


def _shown_by_glow(shape: Shape, middle: np.ndarray) -> float:
    """The luminance of a white card that faces a surface that shines: its own times its share of the card's view.

    Of a surface that shines unevenly the mean; what hides it from the card, itself too, is not looked at.
    """
    assert isinstance(shape.material, Material)
    mesh = triangles_of_shape(shape)
    corners = mesh.vertices[mesh.faces].astype(np.float64) - middle
    share = _share_of_view(corners)
    return _luminance(mean_colour(shape.material.emission)) * share


def _share_of_view(corners: np.ndarray) -> float:
    """The form factor from a card at the origin, turned to where most comes from, to triangles (N, 3, 3) facing it.

    Lambert's formula (1760): Σ γ g / 2π over edges, γ the angle of one as seen, g the normal of the plane through it.
    """
    # A triangle shines to where its corners go round counter-clockwise.
    facing = np.einsum("ij,ij->i", np.cross(corners[:, 0], corners[:, 1]), corners[:, 2]) < 0
    seen = corners[facing]
    following = np.roll(seen, -1, axis=1)
    normals = np.cross(following, seen)
    lengths = np.linalg.norm(normals, axis=-1)
    angles = np.arctan2(lengths, (seen * following).sum(-1))
    vector = (normals * (angles / np.maximum(lengths, 1e-300))[..., None]).sum(axis=(0, 1)) / (2 * np.pi)
    return float(np.linalg.norm(vector))

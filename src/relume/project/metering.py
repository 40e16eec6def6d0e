"""The film for a picture of a scene, from its lights alone, so that every frame of a movie gets the same."""

from __future__ import annotations

import numpy as np

from relume.image.colour import luminance
from relume.scene.lights import AmbientLight, DistantLight, Light, SphereLight
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import bounds
from relume.virtual_camera.film.film import Film


def metered_scene(scene: Scene) -> Film:
    """The film of a photographer with an incident light meter among the objects.

    The mean radiance of the light map becomes ½, as `metered` has it, or a white card that faces all of the scene's
    other lights becomes white, whichever takes less light: for one light of strength 1, of irradiance π, as Whitted's
    pictures have it, exposure 1. Exposure 1 too where nothing shines.
    """
    mean = float(luminance(scene.light.total())) / (4 * np.pi)
    low, high = bounds(scene.objects)
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    card = mean + sum(_shown_by_white(light, middle, radius) for light in scene.lights)
    brightest = max(card, 2 * mean)
    return Film(1 / brightest) if 0 < brightest < np.inf else Film()


def _shown_by_white(light: Light, middle: np.ndarray, radius: float) -> float:
    """The luminance of a white card that faces a light; one within the objects is metered at their border."""
    if isinstance(light, AmbientLight):
        return _luminance(light.radiance)
    if isinstance(light, DistantLight):
        return _luminance(light.irradiance) / np.pi
    distance = max(float(np.linalg.norm(np.asarray(light.position) - middle)), radius)
    if isinstance(light, SphereLight):
        # What faces a sphere of light gets π L (r/d)²; on the sphere itself, and from within, π L.
        return _luminance(light.radiance) * min(light.radius / max(distance, light.radius), 1.0) ** 2
    share = float(light.falloff.at(np.array(distance))) if distance > 0 else np.inf
    return _luminance(light.intensity) * share / np.pi


def _luminance(colour: tuple[float, float, float]) -> float:
    return float(luminance(np.asarray(colour, np.float64)))

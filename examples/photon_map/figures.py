"""The pictures of docs/how-to/natural-light/photon-map.md: `python examples/photon_map/figures.py [FOLDER] [SIZE]`.

Without a folder they go to docs/images. Five minutes on two cores.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

import relume as rl
from relume.renderers import PhotonMap, drawn_discs, drawn_photons

DARK = rl.EnvironmentMap(np.zeros((2, 4, 3), np.float32))
WHITE, GREY = rl.Diffuse((0.75, 0.75, 0.75)), rl.Diffuse((0.5, 0.5, 0.5))
RED, BLUE = rl.Diffuse((0.65, 0.08, 0.06)), rl.Diffuse((0.08, 0.12, 0.6))
GLASS = rl.Material(roughness=0.0, transmission=1.0, ior=1.5, name="glass")
MIRROR = rl.Material((0.95, 0.95, 0.95), metallic=1.0, roughness=0.0, name="mirror")


def wall(a: list[float], b: list[float], c: list[float], d: list[float], colour: rl.Diffuse) -> rl.scene.Polygon:
    """A rectangle, seen from where its corners go round counter-clockwise."""
    return rl.scene.Polygon(np.array([a, b, c, d], float), colour)


def box() -> rl.Scene:
    """A room of 2 m with a mirror ball and a glass ball under a lamp, as in Jensen's pictures."""
    room = (
        wall([-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1], WHITE),
        wall([-1, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2, 1], WHITE),
        wall([-1, 0, -1], [1, 0, -1], [1, 2, -1], [-1, 2, -1], WHITE),
        wall([-1, 0, 1], [-1, 0, -1], [-1, 2, -1], [-1, 2, 1], RED),
        wall([1, 0, -1], [1, 0, 1], [1, 2, 1], [1, 2, -1], BLUE),
    )
    balls = (rl.Sphere((-0.42, 0.4, -0.4), 0.4, MIRROR), rl.Sphere((0.42, 0.4, 0.25), 0.4, GLASS))
    lamp = rl.scene.RectangleLight(
        (0.0, 1.99, 0.0), (0.0, -1.0, 0.0), (0.6, 0.6), (12.0, 11.0, 9.0), up=(0.0, 0.0, 1.0)
    )
    return rl.Scene(DARK, room, balls, (lamp,))


def beam() -> rl.Scene:
    """A glass ball under a small lamp in smoke, which shows how the light runs together."""
    floor = wall([-1.5, 0, 1.5], [1.5, 0, 1.5], [1.5, 0, -1.5], [-1.5, 0, -1.5], GREY)
    ball = rl.Sphere((0.0, 1.2, 0.0), 0.3, GLASS)
    lamp = rl.scene.SphereLight((0.0, 2.4, 0.0), 0.03, (900.0, 800.0, 650.0))
    return rl.Scene(DARK, (floor,), (ball,), (lamp,), medium=rl.scene.Medium((0.02, 0.02, 0.02), (0.25, 0.25, 0.25)))


def shown(radiance: np.ndarray, white: float) -> np.ndarray:
    """Radiance as bytes of a display."""
    linear = np.clip(radiance / white, 0, 1)
    return np.round(255 * np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)).astype(
        "u1"
    )


def main(folder: Path, size: int) -> None:
    camera = rl.Camera.looking_at(
        np.array([0, 1, 3.6]), np.array([0, 0.95, 0]), width=size, height=size, focal_length=size * 1.2
    )
    scene = box()
    first = next(PhotonMap(photons=100_000, gather=0).steps(scene, camera))
    picture = PhotonMap(photons=50_000, passes=16).render(scene, camera).radiance
    truth = rl.Mitsuba(samples=512, depth=24).render(scene, camera).radiance
    photons = first.flight.surface.only(np.arange(len(first.flight.surface.power)) % 24 == 0)
    panels = [
        shown(drawn_photons(photons, scene, camera), 1.2),
        shown(drawn_discs(first, camera, every=size // 6), 1.5),
        shown(picture, 1.5),
        shown(truth, 1.5),
    ]
    rl.write(folder / "photon_map.jpg", rl.Photograph(np.concatenate(panels, axis=1), "photon map"))

    camera = rl.Camera.looking_at(
        np.array([0, 0.8, 3.6]), np.array([0, 0.8, 0]), width=size, height=size, focal_length=size * 1.15
    )
    scene = beam()
    *_, step = PhotonMap(photons=100_000, neighbours=30, passes=12, gather=2).steps(scene, camera)
    truth = rl.Mitsuba(samples=512, depth=24).render(scene, camera).radiance
    panels = [
        shown(drawn_photons(step.caustics.surface, replace(scene, objects=()), camera), 1.2),
        shown(step.render.radiance, 1.0),
    ]
    panels.append(shown(truth, 1.0))
    rl.write(folder / "photon_map_fog.jpg", rl.Photograph(np.concatenate(panels, axis=1), "photon map in fog"))


if __name__ == "__main__":
    where = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[2] / "docs" / "images"
    main(where, int(sys.argv[2]) if len(sys.argv) > 2 else 192)

"""How near two probes come to the truth between them, and what the rest is: `python benchmarks/several_probes.py`.

A room with a window in its wall and a lamp that hangs in it, by our own path tracer. Objects are lit by the nearest
probe alone, by it on the room's walls, by both probes joined, and by a probe that stood in the very place: what that
still gets wrong no interpolation can mend. The same room under another seed says how much of it all is noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

import relume as rl
from relume.composite.surface.projection import box_mesh
from relume.light.constellations.local_lamps import free_lamp
from relume.renderers.environment_probe import environment
from relume.scene.lights import RectangleLight, SphereLight
from relume.scene.scene import Infinite
from relume.scene.shapes.shapes import Solid

ROOM = rl.scene.Box((-2.0, -0.001, -1.5), (2.0, 2.6, 1.5))
LEFT, RIGHT, BETWEEN = (-1.0, 0.7, 0.4), (1.0, 0.7, 0.4), (0.0, 0.7, 0.4)
LAMP = (-0.2, 1.9, -0.5)
PAINT = rl.Diffuse((0.6, 0.55, 0.5))
FLOOR = rl.Plane(PAINT, (3.99, 2.99))
CAMERA = rl.Camera.looking_at(np.array([0, 0.9, 1.45]), np.array([0, 0.3, 0.3]), width=96, height=72, focal_length=90)
OBJECTS = (
    rl.Sphere((-0.25, 0.2, 0.35), 0.2, rl.Diffuse((0.7, 0.7, 0.7))),
    rl.Sphere((0.25, 0.2, 0.35), 0.2, rl.Material((0.2, 0.3, 0.6), roughness=0.35)),
    rl.Sphere((0.0, 0.75, 0.3), 0.15, rl.Material((0.9, 0.9, 0.9), metallic=1.0, roughness=0.2)),
)
SAMPLES, ROWS, CELL = 512, 96, 6
BLACK = rl.EnvironmentMap(np.zeros((4, 8, 3), np.float32))


def room(objects: Sequence[Solid] = ()) -> rl.Scene:
    """The true room."""
    walls = box_mesh((-2.0, 0.0, -1.5), (2.0, 2.6, 1.5), PAINT, "room")
    window = RectangleLight((1.99, 1.4, 0.2), (-1.0, 0.0, 0.0), (1.2, 1.0), (4.0, 5.0, 7.0))
    return rl.Scene(BLACK, (walls,), tuple(objects), (SphereLight(LAMP, 0.1, (60.0, 50.0, 40.0)), window))


def lit(light: rl.EnvironmentMap, probe: tuple[float, float, float], near: bool, lamps: Sequence[SphereLight] = ()):
    """The objects on the floor in a light from infinity, or on the walls."""
    distant = ROOM if near else Infinite()
    return rl.Scene(light, (FLOOR,), OBJECTS, tuple(lamps), distant, probe if near else (0.0, 0.0, 0.0))


def sphere(lamp) -> SphereLight:
    """A placed lamp as the sphere that gives its light."""
    radius = float(lamp.radii[0])
    return SphereLight(tuple(lamp.positions[0]), radius, tuple(lamp.intensity[0] / (np.pi * radius**2)))


def freed(light: rl.EnvironmentMap, at: tuple[float, float, float], where: Sequence[float] = LAMP):
    """A map without the lamp, and the lamp."""
    found = free_lamp(light, where, at)
    return found.rest, sphere(found.lamp)


def main() -> None:
    """Print how far off each light is, of the objects' pixels."""
    tracer = rl.Mitsuba(samples=64, depth=8)
    left, right, own = (
        environment(room(), at, tracer, size=ROWS, seed=i) for i, at in enumerate((LEFT, RIGHT, BETWEEN))
    )
    joined = rl.renderers.interpolate_probes(
        [rl.renderers.PlacedProbe(left, LEFT), rl.renderers.PlacedProbe(right, RIGHT)], BETWEEN, ROOM
    )
    scenes = {
        "the nearest alone": lit(left, LEFT, False),
        "the nearest on the walls": lit(left, LEFT, True),
        "both joined": (lambda found: lit(found[0], BETWEEN, True, [found[1]]))(
            freed(joined.light, BETWEEN, joined.lamps.positions[0])
        ),
        "one that stood there": (lambda found: lit(found[0], BETWEEN, True, [found[1]]))(freed(own, BETWEEN)),
        "the room, another seed": room(OBJECTS),
    }
    finer = rl.Mitsuba(samples=SAMPLES, depth=8)
    truth = rl.render(room(OBJECTS), CAMERA, finer, seed=100)
    on_them = truth.matte > 0.99
    which = {
        "all": on_them,
        **{
            name: on_them & (np.linalg.norm(off(each), axis=-1) < 1)
            for name, each in zip(("matte", "glossy", "metal"), OBJECTS, strict=True)
        },
    }
    shown = {
        name: rl.render(scene, CAMERA, finer, seed=index).radiance for index, (name, scene) in enumerate(scenes.items())
    }
    for against, right_one in (("the room", truth.radiance), ("one that stood there", shown["one that stood there"])):
        print(f"off {against}, share: means over {CELL}×{CELL} pixels".ljust(56), *(name.rjust(8) for name in which))
        for name, picture in shown.items():
            parts = [f"{apart(picture, right_one, mask):8.2%}" for mask in which.values()]
            print(name.ljust(56), *parts)


def apart(picture: np.ndarray, truth: np.ndarray, mask: np.ndarray) -> float:
    """Mean difference of cells that lie half on the objects, as a share of the mean; noise is averaged out in them."""
    height, width = mask.shape
    cells = (height // CELL, CELL, width // CELL, CELL)
    count = mask.reshape(cells).sum(axis=(1, 3))
    one, other = (
        (mask[..., None] * each).reshape(*cells, 3).sum(axis=(1, 3)) / np.maximum(count, 1)[..., None]
        for each in (picture, truth)
    )
    there = count >= CELL**2 / 2
    return float(np.abs(one - other)[there].mean() / other[there].mean())


def off(ball: rl.Sphere) -> np.ndarray:
    """How far each pixel's ray passes a ball's centre, in radii, as a vector (H, W, 3)."""
    way = np.array(ball.centre) - CAMERA.position
    rays = CAMERA.rays()
    return (way - (rays @ way)[..., None] * rays) / ball.radius


if __name__ == "__main__":
    main()

"""What objects change, estimated itself, has the mean of the difference of two path-traced pictures."""

import numpy as np
import pytest
import trimesh
from scipy import stats

from lights import constant
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.mitsuba.path_tracer import _mitsuba
from relume.renderers.mitsuba.scene import scene_dictionary
from relume.scene.cameras.camera import Camera
from relume.scene.lights import DistantLight, PointLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Box, Scene
from relume.scene.shapes.shapes import Mesh, Plane
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_points
from solids import built, quad, sphere

CAMERA = Camera.looking_at(np.array([0.3, 0.9, 2.2]), np.array([0, 0.25, 0]), width=48, height=32, focal_length=48)
ASIDE = Camera.looking_at(np.array([0.7, 0.9, 2.2]), np.array([0.55, 0.25, 0]), width=48, height=32, focal_length=60)
FLOOR = Plane(Diffuse((0.6, 0.5, 0.4)), (3.0, 3.0))
DARKNESS = constant(8, 0.0)
REPEATS = 32
"""Independent seeds of the plain pictures: their scatter is the error of their mean, whatever the seeds share."""


def light(width=0.4, strength=15.0):
    """A soft sky and one round lamp of about `width` radians."""
    directions = LatLong().directions(pixel_points(LatLong(), 64 if width > 0.2 else 256))
    x, y, z = np.moveaxis(directions, -1, 0)
    radiance = np.stack([0.6 + 0.4 * y, 0.6 + 0.3 * x, 0.7 - 0.3 * z], -1)
    radiance += strength * np.exp((directions @ normalised([-0.5, 0.7, 0.4]) - 1) / width**2)[..., None]
    return EnvironmentMap(radiance.astype(np.float32))


def ball(material, centre=(0, 0.301, 0), radius=0.3, fine=4):
    return sphere(material, centre=centre, radius=radius, fine=fine)


def box(material, low, high):
    return built(trimesh.creation.box(bounds=[low, high]), material)


def sheet(corners, material):
    return quad(corners, material, textured=True)


def rippled():
    body = trimesh.creation.icosphere(subdivisions=5)
    swell = 1 + 0.08 * np.sin(9 * body.vertices[:, 0]) * np.sin(9 * body.vertices[:, 1])
    body.vertices = 0.3 * body.vertices * swell[:, None] + [0, 0.34, 0]
    return built(body, Diffuse((0.3, 0.7, 0.5)))


CHEQUERED = np.kron(np.indices((6, 6)).sum(0) % 2, np.ones((4, 4)))[..., None] * [0.5, 0.3, 0.1] + [0.2, 0.3, 0.1]
FLAT = [[-1.5, 0, 1.5], [1.5, 0, 1.5], [1.5, 0, -1.5], [-1.5, 0, -1.5]]
TEXTURED = sheet(FLAT, Material(CHEQUERED.astype(np.float32), metallic=0.0, roughness=0.9))
WALL = sheet([[-1.5, 0, -0.5], [1.5, 0, -0.5], [1.5, 1.5, -0.5], [-1.5, 1.5, -0.5]], Diffuse((0.8, 0.2, 0.2)))
CORNER = Mesh(
    np.concatenate([TEXTURED.vertices, WALL.vertices]), np.concatenate([TEXTURED.faces, WALL.faces + 4]),
    Diffuse((0.7, 0.6, 0.5)),
)  # fmt: skip
SCREEN = sheet([[-0.5, 0, 0.6], [0.1, 0, 0.6], [0.1, 0.35, 0.6], [-0.5, 0.35, 0.6]], Diffuse((0.3, 0.3, 0.7)))
POLISHED = sheet(FLAT, Material((0.8, 0.8, 0.7), metallic=1.0, roughness=0.0))
GLOSSY = sheet(FLAT, Material((0.5, 0.4, 0.3), metallic=0.0, roughness=0.3))
GLASS, MIRROR = Material(roughness=0.0, transmission=1.0), Material((0.9, 0.9, 0.9), metallic=1.0, roughness=0.0)
GOLD = Material((1.0, 0.72, 0.32), metallic=1.0, roughness=0.4)
ROUGH_PANE = sheet(
    [[-0.6, 0, 0.6], [0.6, 0, 0.6], [0.6, 0.3, 0.6], [-0.6, 0.3, 0.6]], Material(roughness=0.6, transmission=1.0)
)
LOW = Camera.looking_at(np.array([0, 0.35, 4.0]), np.array([0, 0.1, 0.3]), width=48, height=32, focal_length=52)
ROOM = Box((-2.0, -0.5, -2.0), (2.0, 2.0, 3.0))

SCENES = {
    "diffuse": (Scene(light(), (FLOOR,), (ball(Diffuse((0.7, 0.7, 0.2))),)), CAMERA),
    "two planes": (Scene(light(), (FLOOR, WALL), (ball(Diffuse((0.2, 0.7, 0.3))),)), CAMERA),
    "glass": (Scene(light(), (FLOOR,), (ball(GLASS),)), CAMERA),
    "mirror": (Scene(light(), (FLOOR,), (ball(MIRROR),)), CAMERA),
    "rough gold": (Scene(light(), (FLOOR,), (box(GOLD, (-0.3, 0, -0.2), (0.3, 0.4, 0.2)),)), CAMERA),
    "several": (
        Scene(light(), (FLOOR,), (ball(GLASS, (-0.4, 0.301, 0)), ball(Diffuse((0.7, 0.2, 0.2)), (0.35, 0.301, -0.1)))),
        CAMERA,
    ),
    "textured floor": (Scene(light(), (TEXTURED,), (ball(Diffuse((0.7, 0.7, 0.7))),)), CAMERA),
    "glossy floor": (Scene(light(), (GLOSSY,), (ball(Diffuse((0.7, 0.7, 0.7))),)), CAMERA),
    "mirror floor": (Scene(light(), (POLISHED,), (ball(Diffuse((0.7, 0.2, 0.2))),)), CAMERA),
    "corner of one mesh": (Scene(light(), (CORNER,), (ball(Diffuse((0.2, 0.7, 0.3))),)), CAMERA),
    "room": (Scene(light(), (FLOOR,), (ball(Diffuse((0.7, 0.7, 0.7))),), distant=ROOM, probe=(0, 0.1, 0)), CAMERA),
    "sun": (Scene(light(0.02, 4000.0), (FLOOR,), (ball(Diffuse((0.7, 0.7, 0.2))),)), CAMERA),
    "outside the frame": (Scene(light(), (FLOOR,), (ball(Diffuse((0.7, 0.7, 0.2))),)), ASIDE),
    "many triangles": (Scene(light(), (FLOOR,), (rippled(),)), CAMERA),
    "behind a screen": (Scene(light(), (FLOOR, SCREEN), (ball(Diffuse((0.7, 0.7, 0.2))),)), CAMERA),
    # Wide bodies: from within the sphere about one, what is behind its middle hides light as well.
    "under a slab": (
        Scene(light(), (FLOOR,), (box(Diffuse((0.1, 0.1, 0.1)), (-2, 0.5, -2), (2, 0.6, 2)),)),
        LOW,
    ),
    "behind a rough pane": (Scene(light(), (FLOOR, ROUGH_PANE), (ball(Diffuse((0.05, 0.05, 0.05))),)), CAMERA),
    "point of light": (
        Scene(DARKNESS, (FLOOR,), (ball(Diffuse((0.7, 0.7, 0.2))),), (PointLight((-1, 2, 1), (9.0, 8.0, 7.0)),)),
        CAMERA,
    ),
    "parallel light": (
        # Plain path tracing finds no light without size in a mirror; test_differential_analytic.py has that.
        Scene(DARKNESS, (FLOOR, WALL), (ball(GOLD),), (DistantLight((-0.5, 1, 0.5), (2.0, 2.0, 2.0)),)),
        CAMERA,
    ),
}
FAST = ("two planes", "under a slab")


def plain(scene, camera, samples):
    """REPEATS pictures with the objects and as many of the difference with − without: each (REPEATS, H, W, 3)."""
    with _mitsuba(None, None) as mi:
        path = mi.load_dict({"type": "path", "max_depth": 13, "rr_depth": 8})
        worlds = [mi.load_dict(scene_dictionary(mi, each, camera)) for each in (scene, scene.without_objects())]

        def pictures(world):
            return np.stack(
                [np.array(mi.render(world, integrator=path, spp=samples, seed=9000 + n)) for n in range(REPEATS)]
            ).astype(np.float64)

        with_, without = map(pictures, worlds)
    return with_, with_ - without


@pytest.mark.parametrize("name", [n if n in FAST else pytest.param(n, marks=pytest.mark.slow) for n in SCENES])
def test_the_change_has_the_mean_of_plain_subtraction(name):
    scene, camera = SCENES[name]
    fast = name in FAST
    change = Differential(samples=256 if fast else 2048).change(scene, camera, seed=1)
    with_, difference = plain(scene, camera, 16 if fast else 256)
    beside, covered = change.matte == 0, change.matte == 1
    assert np.any(change.difference[beside] != 0)
    for mine, variance, theirs, where in (
        (change.difference, change.difference_variance, difference, beside),
        (change.objects, change.objects_variance, with_, covered),
    ):
        mean_agrees(mine, variance, theirs, where)
        pixels_agree(mine, variance, theirs, where)


def mean_agrees(mine, variance, theirs, where):
    """|z| ≤ 4 for the mean over `where`, channel by channel."""
    means = theirs[:, where].mean(1)
    error2 = means.var(0, ddof=1) / len(means) + variance[where].sum(0, dtype=np.float64) / where.sum() ** 2
    found, expected = mine[where].mean(0, dtype=np.float64), means.mean(0)
    assert np.all(np.abs(found - expected) <= 4 * np.sqrt(error2) + 1e-6), (
        f"{found}, expected {expected}, {error2**0.5}"
    )


def pixels_agree(mine, variance, theirs, where):
    """At least 99.75 % of the pixels within a limit that holds for all at 1 % (Šidák), and blocks of 8 × 8 within 5."""
    spread = theirs.var(0, ddof=1) / len(theirs) + variance
    # A variance that few paths happened to estimate far too low is brought up to a tenth of the picture's.
    spread = np.maximum(spread, 0.1 * spread[where].mean(0)) + 1e-12
    gap = np.where(where[..., None], mine - theirs.mean(0), 0.0)
    limit = stats.norm.isf((1 - 0.99 ** (1 / (3 * where.sum()))) / 2)
    within = np.abs(gap) <= limit * np.sqrt(spread)
    assert within[where].mean() >= 0.9975, f"{(~within).any(-1).sum()} pixels of {where.sum()} differ"
    rows, columns = where.shape[0] // 8, where.shape[1] // 8
    blocks = [np.where(where[..., None], a, 0).reshape(rows, 8, columns, 8, 3).sum((1, 3)) for a in (gap, spread)]
    assert np.abs(blocks[0] / np.sqrt(blocks[1] + 1e-12)).max() <= 5, "a region differs"

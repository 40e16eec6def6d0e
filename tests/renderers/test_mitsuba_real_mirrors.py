"""What objects change where real surfaces are smooth: the difference of two whole pictures."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from relume.renderers.mitsuba.differential import Differential
from relume.renderers.progressive.accumulation import pass_seed
from relume.scene.cameras.camera import Camera
from relume.scene.lights import DistantLight, PointLight, SphereLight
from relume.scene.materials.glasses import GLASSES
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import AnyMaterial, Plane, Polygon, Sphere
from relume.sphere.environment_map import EnvironmentMap

pytestmark = pytest.mark.usefixtures("mi")
BLACK = EnvironmentMap(np.zeros((4, 8, 3), np.float32))
FLOOR = Plane(Diffuse((0.7, 0.5, 0.3)), (4.0, 4.0))
MIRROR = Material((0.9, 0.8, 0.7), metallic=1.0, roughness=0.0, name="mirror")
GLASS = Material(roughness=0.0, transmission=1.0)
MATTE = Diffuse((0.3, 0.5, 0.7))
WALL = Polygon(np.array([[-1.2, 0.0, -0.9], [1.2, 0.0, -0.9], [1.2, 1.5, -0.9], [-1.2, 1.5, -0.9]]), MIRROR)
PANE = Sphere((-0.7, 0.35, 0.2), 0.3, GLASS)
POINT = PointLight((0.9, 1.4, 0.8), (6.0, 5.0, 4.0))
SUN = DistantLight((0.5, 1.0, 0.8), (3.0, 3.0, 3.0))
LAMP = SphereLight((0.9, 1.4, 0.8), 0.25, (30.0, 25.0, 20.0))
CAMERA = Camera.looking_at(np.array([0.3, 1.5, 1.7]), np.array([0.1, 0.25, -0.4]), width=16, height=14, focal_length=22)
PASSES = 12


def ball(material: AnyMaterial) -> Sphere:
    return Sphere((0.25, 0.3, -0.3), 0.22, material)


def both(scene: Scene, samples: int, whole: int, chance: bool = False, passes: int = PASSES) -> Compared:
    """The change of a scene, and the difference of two whole pictures, found by chance alone where `chance`."""
    from relume.renderers.mitsuba.transport.estimator import Estimator
    from relume.renderers.mitsuba.transport.plain import Plain

    made = Estimator(scene, CAMERA, 8)
    assert made.world.mirrors
    assert made.world.smooth
    plains = [Plain(each, CAMERA, 8) for each in (scene, scene.without_objects())]
    for plain in plains:
        if chance:
            plain.world.smooth = plain.lands = False
    ours, theirs, mattes = [], [], []
    for index in range(passes):
        planes = made.traced(samples, pass_seed(1, index))
        pictures = [plain.traced(whole, pass_seed(8 + n, index)) for n, plain in enumerate(plains)]
        ours.append(planes["objects"] + planes["difference"])
        covered = pictures[0]["matte"][..., None] == 1
        theirs.append(pictures[0]["radiance"] - np.where(covered, 0, pictures[1]["radiance"]))
        mattes.append(planes["matte"])
    matte = np.mean(mattes, axis=0)
    return Compared(np.stack(ours).astype(np.float64), np.stack(theirs).astype(np.float64), matte == 0, matte == 1)


@dataclass(frozen=True)
class Compared:
    """(passes, H, W, 3) of both, and the pixels beside the objects and on them."""

    ours: np.ndarray
    theirs: np.ndarray
    beside: np.ndarray
    covered: np.ndarray

    def require_alike(self, error: float) -> None:
        """The means agree within 4.5 of their errors, which are below `error` of the mean size; so do all pixels."""
        for where in (self.beside, self.covered):
            means = [found[:, where].mean((1, 2)) for found in (self.ours, self.theirs)]
            spread = np.hypot(*(m.std(ddof=1) / np.sqrt(len(m)) for m in means))
            size = np.abs(self.theirs.mean(0)[where]).mean()
            found, expected = (m.mean() for m in means)
            assert spread < error * size, (spread, size)
            assert abs(found - expected) < 4.5 * spread, (found, expected, spread)
            pixels = [each[:, where].mean(-1) for each in (self.ours, self.theirs)]
            noise = np.sqrt(sum(p.var(0, ddof=1) / len(p) for p in pixels))
            noise = np.maximum(noise, 0.3 * noise.mean())
            gap = np.abs(pixels[0].mean(0) - pixels[1].mean(0)) / noise
            # Of a dozen passes each or less, few of which hold what is rare.
            assert np.mean(gap < 3.5) > 0.97, gap


SCENES = {
    "matte, point": (MATTE, POINT),
    "matte, sun": (MATTE, SUN),
    "glass, point": (GLASS, POINT),
    "mirror, point": (MIRROR, POINT),
}


# slow: each 3 s and more; test_the_shadow_in_mirrored_light_is_that_of_the_lamps_image and
# test_of_an_endless_mirror_lamps_light_what_is_near go red for the same break.
FEWER = ("matte, point",)


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_the_change_is_the_difference_of_whole_pictures(name):
    material, lamp = SCENES[name]
    samples, error, passes = ((96, 768), 0.04, 8) if name in FEWER else ((384, 2048), 0.03, PASSES)
    both(Scene(BLACK, (FLOOR, WALL), (ball(material),), (lamp,)), *samples, passes=passes).require_alike(error)


@pytest.mark.slow
@pytest.mark.parametrize("material", [MATTE, GLASS], ids=["matte", "glass"])
def test_of_a_lamp_with_a_size_it_is_what_paths_find_by_chance(material):
    scene = Scene(BLACK, (FLOOR, WALL), (ball(material),), (LAMP,))
    both(scene, 1024, 8192, chance=True).require_alike(0.04)


def test_real_glass_sends_light_on_too():
    both(Scene(BLACK, (FLOOR, PANE), (ball(MATTE),), (POINT,)), 32, 128, passes=8).require_alike(0.03)


def test_the_shadow_in_mirrored_light_is_that_of_the_lamps_image():
    from relume.renderers.mitsuba.transport.estimator import Estimator

    # A ball on the way from the lamp's image behind the mirror to a place of the floor.
    image = np.array([POINT.position[0], POINT.position[1], -1.8 - POINT.position[2]])
    at = np.array([-0.05, 0.0, 0.45])
    way = image - at
    middle = at + 0.3 * way
    black = Sphere((middle[0], middle[1], middle[2]), 0.1, Diffuse((0.0, 0.0, 0.0)))
    camera = Camera.looking_at(np.array([-1.0, 1.0, 1.6]), at, width=4, height=4, focal_length=70)
    made = Estimator(Scene(BLACK, (FLOOR, WALL), (black,), (POINT,)), camera, 8)
    # Few of the rays from the lamp fall on so small a place: two million of them.
    light = np.mean([made.lit(1 << 18, seed)["difference"] for seed in range(4)], axis=(0, 1, 2))
    paths = made.of_pixels(np.arange(16), 4096, 3)["difference"].mean(0)
    rays = camera.rays_through(np.stack(np.meshgrid(*[(np.arange(80) + 0.5) / 20] * 2), axis=-1))
    ways = image - (camera.position - camera.position[1] / rays[..., 1:2] * rays)
    # All of it is in the shadow: the ball's middle is less than its radius from each of these ways to the image.
    away = np.linalg.norm(np.cross(ways, image - middle), axis=-1) / np.linalg.norm(ways, axis=-1)
    assert np.all(away < 0.1)
    mirrored = np.array(POINT.intensity) * MIRROR.base_color
    lit = np.array((0.7, 0.5, 0.3)) / np.pi * mirrored
    lit *= (ways[..., 1] / np.linalg.norm(ways, axis=-1) ** 3).mean()
    np.testing.assert_allclose(light + paths, -lit, rtol=0.02)
    np.testing.assert_allclose(lit, [0.039701, 0.021006, 0.008822], rtol=5e-3)


def test_objects_that_part_light_by_wavelength_change_as_much_of_what_is_kept_as_others():
    from relume.renderers.mitsuba.transport.estimator import Estimator

    def kept(material: AnyMaterial) -> tuple[float, float]:
        made = Estimator(Scene(BLACK, (FLOOR, WALL), (ball(material),), (POINT,)), CAMERA, 8)
        made.flooded(64, 1)
        both = made.world.landed_added, made.world.landed_taken
        return tuple(float(sum(np.array(channel).sum() for channel in each.flux)) for each in both)  # pyright: ignore

    np.testing.assert_allclose(kept(replace(GLASS, glass=GLASSES["N-BK7"])), kept(GLASS), rtol=0.03)


def test_what_no_object_changes_is_0_to_the_bit():
    below = Sphere((0.0, -1.0, 0.0), 0.3, GLASS)
    change = Differential(16).change(Scene(BLACK, (FLOOR, WALL), (below,), (POINT,)), CAMERA, seed=1)
    assert not np.any(change.difference)
    assert not np.any(change.objects)


def test_of_an_endless_mirror_lamps_light_what_is_near(mi):
    from relume.renderers.mitsuba.transport.estimator import Estimator

    # A dark ball, so that nothing is scattered twice.
    scene = Scene(BLACK, (Plane(MIRROR),), (ball(Diffuse((0.01, 0.01, 0.01))),), (SUN,))
    low = Camera.looking_at(
        np.array([0.25, 0.02, 0.6]), np.array([0.25, 0.3, -0.3]), width=8, height=8, focal_length=18
    )
    made = Estimator(scene, low, 8)
    ((_, centre, radius),) = made.world.clipped
    assert radius[0] == pytest.approx(16 * 0.22 + 2 * 0.3)
    np.testing.assert_allclose(np.array(centre).ravel(), [0.25, 0, -0.3], atol=1e-6)
    # Each place of the ball sees the sun's image below the floor, where the ball does not hide it.
    middle = np.array([0.25, 0.3, -0.3])
    rays = low.rays_through(np.stack(np.meshgrid(*[(np.arange(160) + 0.5) / 20] * 2), axis=-1))
    along, met = hit(low.position, rays, middle)
    place = low.position + along[..., None] * rays
    normal = (place - middle) / 0.22
    sun = np.array(SUN.towards) / np.linalg.norm(SUN.towards)
    image = sun * [1, -1, 1]
    floor = place - image * (place[..., 1:2] / image[1])
    lit = met & ~hit(floor, np.broadcast_to(sun, floor.shape), middle)[1]
    cosine = np.where(lit, np.maximum(normal @ image, 0), 0).mean()
    expected = cosine * np.array(MIRROR.base_color) * 3 * 0.01 / np.pi
    np.testing.assert_allclose(made.lit(1 << 18, 1)["objects"].mean((0, 1)), expected, rtol=0.02)


def hit(origin: np.ndarray, rays: np.ndarray, middle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far rays go to a ball of 0.22 m, and whether they meet it."""
    away = middle - origin
    along = (away * rays).sum(-1)
    square = 0.22**2 - (away**2).sum(-1) + along**2
    distance = along - np.sqrt(np.maximum(square, 0))
    return distance, (square > 0) & (distance > 0)

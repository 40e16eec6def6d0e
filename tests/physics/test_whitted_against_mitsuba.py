"""Whitted's renderer against Mitsuba where both are right: lights shining directly, perfect mirrors and clear glass.

Mitsuba traces rays and samples smooth dielectrics; a small integrator here follows them up to the first matte surface,
adds what the lights send there, and stops, as eq. 2 does. Goals G10 and G13 of the reliability note: pixel by pixel,
by blocks of pixels and by the picture's mean.
"""

import numpy as np
import pytest
import trimesh
from scipy import stats

from lights import sunny
from relume.renderers.mitsuba.path_tracer import _mitsuba
from relume.renderers.mitsuba.scene import scene_dictionary
from relume.renderers.whitted.whitted import Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.lights import DistantLight, PointLight
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Plane, Sphere
from relume.sphere.directions import look_at, rotation_about
from solids import built

EYE = np.array([0.4, 1.6, 3.6])
# Tilted: a level horizon would lie between two rows of Whitted's even grid all the way.
CAMERA = Camera(40, 32, 44.0, EYE, look_at(EYE, np.array([0, 0.45, 0])) @ rotation_about([0, 0, 1], 0.06))
DEPTH = 12
FINER = 32
"""Whitted's picture is the mean of so many squared rays, evenly over each pixel."""
PASSES = 64
LIGHTS = (
    PointLight((1.5, 3.0, 2.0), (9.0, 8.0, 7.0)),
    PointLight((-2.5, 2.0, 0.5), (2.0, 3.0, 5.0)),
    DistantLight((0.5, 1.0, 0.3), (0.6, 0.5, 0.4)),
)
FLOOR = Plane(Diffuse((0.6, 0.5, 0.35)))
WALL = Diffuse((0.3, 0.45, 0.6))
MIRROR = Material((0.9, 0.8, 0.7), metallic=1.0, roughness=0.0)
SILVER = Material((0.95, 0.95, 0.95), metallic=1.0, roughness=0.0)
GLASS = Material((1.0, 1.0, 1.0), transmission=1.0, roughness=0.0, ior=1.5)
GREEN = Material((0.4, 0.9, 0.5), transmission=1.0, roughness=0.0, ior=1.33)
DIAMOND = Material((1.0, 0.95, 0.9), transmission=1.0, roughness=0.0, ior=2.42)


def box(material, size, centre, turn=0.0) -> Mesh:
    body = trimesh.creation.box(size)
    body.vertices = body.vertices @ rotation_about([0.2, 1, 0.1], turn).T + np.asarray(centre)
    return built(body, material)


SCENES = {
    "matte": (Sphere((-0.5, 0.5, 0), 0.5, WALL), box(WALL, (0.6, 0.8, 0.5), (0.7, 0.4, 0.2), 0.5)),
    "mirrors": (
        Sphere((-0.6, 0.6, 0), 0.6, MIRROR),
        Sphere((0.7, 0.45, 0.3), 0.45, SILVER),
        box(SILVER, (2.4, 1.6, 0.1), (0.1, 0.9, -1.0), 0.2),
        Sphere((0.1, 0.25, 0.9), 0.25, WALL),
    ),
    "a glass ball": (Sphere((0, 0.7, 0.3), 0.6, GLASS), Sphere((-0.9, 0.4, -0.6), 0.4, WALL)),
    "a glass block": (box(GREEN, (0.9, 0.9, 0.9), (-0.2, 0.6, 0.2), 0.6), Sphere((0.8, 0.4, -0.6), 0.4, WALL)),
    "glasses and mirrors": (
        Sphere((-0.7, 0.5, 0.4), 0.45, DIAMOND),
        Sphere((0.55, 0.55, 0.7), 0.4, GLASS),
        box(GREEN, (0.5, 0.7, 0.4), (0.1, 0.5, -0.3), 0.9),
        Sphere((0.9, 0.6, -0.7), 0.6, MIRROR),
    ),
}
QUICK = "a glass ball"
EVERY = pytest.mark.parametrize(
    "name", [name if name == QUICK else pytest.param(name, marks=pytest.mark.slow) for name in SCENES]
)


def scene_of(name: str) -> Scene:
    return Scene(sunny(32), (FLOOR,), SCENES[name], LIGHTS)


def by_whitted(scene: Scene) -> np.ndarray:
    """Box-filtered pixels (H, W, 3), by an even grid of rays in each."""
    finer = CAMERA.resized(CAMERA.width * FINER, CAMERA.height * FINER)
    method = Whitted(depth=DEPTH, contribution=1e-7, antialiasing=None, constellation=0, clear_shadows=False)
    picture = method.render(scene, finer).radiance.astype(np.float64)
    return picture.reshape(CAMERA.height, FINER, CAMERA.width, FINER, 3).mean((1, 3))


def by_mitsuba(scene: Scene, samples: int) -> tuple[np.ndarray, np.ndarray]:
    """Box-filtered pixels (H, W, 3) by random rays, and the variance of each one's mean."""
    with _mitsuba(None, None) as mi:
        if mi.variant().startswith("scalar"):
            pytest.skip("Mitsuba's scalar variants have no integrators in Python; this test needs libLLVM or a GPU")
        world = mi.load_dict(scene_dictionary(mi, scene, CAMERA))
        integrator = direct_integrator(mi)
        renders = (mi.render(world, integrator=integrator, spp=samples // PASSES, seed=n) for n in range(PASSES))
        pictures = np.stack([np.array(picture) for picture in renders]).astype(np.float64)
    return pictures.mean(0), pictures.var(0, ddof=1) / PASSES


def direct_integrator(mi):
    """Follows mirrors and glass; at the first matte surface adds the lights but for the map, and ends."""
    import drjit as dr

    class Direct(mi.SamplingIntegrator):
        def sample(self, scene, sampler, ray, medium=None, active=True):
            def shaded(point, bsdf, matte):
                total = mi.Spectrum(0)
                for emitter in scene.emitters():
                    if not emitter.is_environment():
                        light, strength = emitter.sample_direction(point, mi.Point2f(0.5), matte)
                        reflected = bsdf.eval(mi.BSDFContext(), point, point.to_local(light.d), matte)
                        total[~scene.ray_test(point.spawn_ray_to(light.p), matte)] += strength * reflected
                return total

            def follow(active, level, sampler, ray, seen, throughput):
                point = scene.ray_intersect(ray, active)
                missed, met = active & ~point.is_valid(), active & point.is_valid()
                seen[missed] += throughput * scene.environment().eval(point, missed)
                bsdf = point.bsdf(ray)
                matte = met & mi.has_flag(bsdf.flags(), mi.BSDFFlags.Smooth)
                seen[matte] += throughput * shaded(point, bsdf, matte)
                active, level = met & ~matte & (level + 1 < DEPTH), level + 1
                chosen, weight = bsdf.sample(
                    mi.BSDFContext(), point, sampler.next_1d(active), sampler.next_2d(active), active
                )
                return active, level, sampler, point.spawn_ray(point.to_world(chosen.wo)), seen, throughput * weight

            # The sampler has to be in the state, or all nodes of a path get the same random numbers.
            state = (mi.Bool(active), mi.UInt32(0), sampler, mi.Ray3f(ray), mi.Spectrum(0), mi.Spectrum(1))
            seen = dr.while_loop(state, lambda active, *_: active, follow)[4]
            return seen, mi.Bool(True), []

        def to_string(self):
            return "Direct[]"

    return Direct(mi.Properties())


@EVERY
def test_whitted_equals_mitsuba(name, capsys):
    scene = scene_of(name)
    ours = by_whitted(scene)
    theirs, variance = by_mitsuba(scene, 1024 if name == QUICK else 4096)
    z = standardised(ours, theirs, variance)
    level = 1 - (1 - 0.01) ** (1 / (z.size * len(SCENES)))
    passed = np.abs(z) <= stats.t.isf(level / 2, PASSES - 1)
    block, mean = block_means(z), mean_z(ours, theirs, variance)
    with capsys.disabled():
        print(
            f"\n  {name}: {100 * passed.mean():.3f} % of pixels, largest |z| {np.abs(z).max():.2f}, "
            f"blocks {np.abs(block).max():.2f}, mean {np.abs(mean).max():.2f}, "
            f"means {ours.mean((0, 1))} {theirs.mean((0, 1))}",
            end="",
        )
    assert passed.mean() >= 0.9975
    assert np.abs(block).max() <= 5
    assert np.abs(mean).max() <= 4


def standardised(ours: np.ndarray, theirs: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Differences in standard errors; Whitted's picture has no noise. Rounding of float32 is left for both."""
    rounding = 1e-5 * np.maximum(theirs, 0.1 * theirs.mean())
    return (ours - theirs) / np.sqrt(variance + rounding**2)


def block_means(z: np.ndarray, size: int = 8) -> np.ndarray:
    """Mean of the pixels of each block, in standard errors of such a mean."""
    rows, columns = z.shape[0] // size, z.shape[1] // size
    return z.reshape(rows, size, columns, size, 3).mean((1, 3)) * size


def mean_z(ours: np.ndarray, theirs: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """The difference of the pictures' means in standard errors, channel by channel."""
    return (ours - theirs).sum((0, 1)) / np.sqrt(variance.sum((0, 1)))

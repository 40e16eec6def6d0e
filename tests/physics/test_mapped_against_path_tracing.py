"""Reflection maps against path tracing and against integrals, on convex objects: nothing else is what they claim.

Pictures are compared by means and by blocks of pixels, in which the path tracer's noise is smaller than the claim. The
tests print the mean error beside that of the usual two-dimensional approximation, in which a lobe seen along the normal
stands for all views (N = V = R).
"""

import numpy as np
import pytest
import trimesh

from lights import spread, sunny
from montecarlo import assert_mean_agrees
from relume.image.files import read_radiance
from relume.light.reflection.brdf import GGX, PhongReflectance, Ward
from relume.light.reflection.glossy import albedo
from relume.light.reflection.lobes import GGXLobe, Lobe, Phong, WardLobe
from relume.light.reflection.weights import ByAngle
from relume.renderers.mitsuba.path_tracer import Mitsuba, _mitsuba
from relume.renderers.mitsuba.scene import envmap_pixels, sensor
from relume.renderers.prefiltered.filters import Plain
from relume.renderers.prefiltered.prefiltered import Prefiltered, Shading
from relume.renderers.prefiltered.shading_inputs import GBuffer
from relume.renderers.renderer import render
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.materials.reflective import Layer, Reflective
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Sphere
from relume.sphere.directions import normalised, rotation_about
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong

CAMERA = Camera(32, 32, 119.0, np.array([0, 0, 8.0]), np.eye(3))
"""Sees a ball of radius 1 thirty pixels wide."""
BLOCK = 4
PASSES = 16
WHITE = Diffuse((1, 1, 1))
SKIES = ["synthetic", pytest.param("venice", marks=pytest.mark.slow)]
MANY = {"synthetic": 2048, "venice": 65536}
"""Rays a pixel: for the photographed sky, whose sun is small, as many as its noise needs."""


@pytest.fixture(scope="module")
def synthetic():
    return sunny(128)


@pytest.fixture(scope="module")
def venice(shared):
    return as_environment(read_radiance(shared / "data/hdri/three/venice_sunset_1k.hdr")).remapped(LatLong(), 256)


@pytest.fixture
def sky(request):
    return request.param, request.getfixturevalue(request.param)


def ball(material):
    return Sphere((0.0, 0.0, 0.0), 1.0, material)


def mapped(material, light, shape=ball):
    return Prefiltered().render(Scene(light, objects=(shape(material),)), CAMERA)


def conductor(light: EnvironmentMap, alpha: float, samples: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A ball of white GGX by Mitsuba's own `roughconductor`: radiance and the variance of each pixel's mean."""
    with _mitsuba(None, None) as mi:
        metal = {"type": "roughconductor", "distribution": "ggx", "alpha": alpha, "material": "none"}
        world = mi.load_dict(
            {
                "type": "scene",
                "sensor": sensor(mi, CAMERA),
                "light": {"type": "envmap", "bitmap": mi.Bitmap(envmap_pixels(light))},
                "ball": {"type": "sphere", "bsdf": metal | {"specular_reflectance": 1.0}},
                "integrator": {"type": "path", "max_depth": 2},
            }
        )
        pictures = np.stack(
            [np.array(mi.render(world, spp=samples // PASSES, seed=PASSES * seed + index)) for index in range(PASSES)]
        ).astype(np.float64)
    return pictures.mean(0), pictures.var(0, ddof=1) / PASSES


def blocks(values: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Sums over the masked pixels of each block, and their number, where at least half of it is masked."""
    rows, columns = mask.shape[0] // BLOCK, mask.shape[1] // BLOCK
    count = mask.reshape(rows, BLOCK, columns, BLOCK).sum((1, 3))
    sums = (values * mask[..., None]).reshape(rows, BLOCK, columns, BLOCK, 3).sum((1, 3))
    kept = count >= BLOCK**2 / 2
    return sums[kept], count[kept][:, None]


def mean_error(found: np.ndarray, truth: np.ndarray, variance: np.ndarray, mask: np.ndarray) -> tuple[float, float]:
    """Mean |error| of the blocks as a share of their mean, noise and all; and what noise alone would make it."""
    error, count = blocks(found - truth, mask)
    noise, _ = blocks(variance, mask)
    scale = truth[mask].mean()
    # The mean absolute value of a normal variable is √(2/π) of its standard deviation.
    return (
        float(np.abs(error / count).mean() / scale),
        float((np.sqrt(noise) / count).mean() * np.sqrt(2 / np.pi) / scale),
    )


def flat_ggx(alpha: float) -> Reflective:
    """The usual approximation: one lobe for all views, times what the surface reflects at each."""
    return flattened(GGXLobe(alpha), GGX(alpha))


def flattened(lobe: Lobe, brdf: GGX | Ward | PhongReflectance) -> Reflective:
    angles = np.minimum(np.linspace(0, np.pi / 2, 33), np.pi / 2 - 1e-3)
    return Reflective((Layer(lobe, weight=ByAngle(tuple(albedo(brdf, angle) for angle in angles))),))


def say(capsys, *cells):
    with capsys.disabled():
        print("\n  " + " | ".join(str(cell) for cell in cells), end="")


# --- Lambert ---------------------------------------------------------------------------------------------------------


def body(material):
    """A box of rounded edges, |x|⁴ + |y|⁴ + |z|⁴ = 1, a little turned, with its true normals."""
    unit = trimesh.creation.icosphere(subdivisions=5)
    vertices = unit.vertices / np.sum(unit.vertices**4, axis=-1, keepdims=True) ** 0.25
    turn = rotation_about([1, 2, 0.5], 0.6)
    points, normals = 0.75 * vertices @ turn.T, normalised(vertices**3) @ turn.T
    return Mesh(points.astype(np.float32), unit.faces.astype(np.int32), material, normals.astype(np.float32))


@pytest.mark.parametrize("sky", SKIES, indirect=True)
@pytest.mark.parametrize("shape", [ball, body], ids=["ball", "rounded box"])
def test_matte_surfaces_are_within_half_a_per_cent_of_path_tracing(sky, shape, capsys):
    name, light = sky
    ours = mapped(WHITE, light, shape)
    # One bounce is all there is on a convex body: deeper paths would start from within its facets.
    traced = render(Scene(light, objects=(shape(WHITE),)), CAMERA, Mitsuba(samples=MANY[name], depth=1), seed=3)
    inside = ours.matte == 1
    assert_mean_agrees(traced.radiance[inside], traced.variance[inside], ours.radiance[inside], near=0.002)
    error, noise = mean_error(ours.radiance, traced.radiance.astype(float), traced.variance.astype(float), inside)
    say(capsys, name, f"Lambert, {shape.__name__}", f"mean |error| {100 * error:.2f} %", f"noise {100 * noise:.2f} %")
    assert error < 0.005
    assert error - noise < 0.003


@pytest.mark.parametrize("sky", SKIES, indirect=True)
def test_a_ball_and_the_light_round_it_are_one_picture_with_path_tracings(sky):
    # Edges and background too: coverage, camera and the light's orientation.
    _, light = sky
    ours = mapped(WHITE, light)
    traced = render(Scene(light, objects=(ball(WHITE),)), CAMERA, Mitsuba(samples=1024, depth=1), seed=4)
    everywhere = np.ones_like(ours.matte, bool)
    error, noise = mean_error(ours.radiance, traced.radiance.astype(float), traced.variance.astype(float), everywhere)
    # Light behind is looked up once a pixel, and the hedge is noise.
    assert error < 0.02 + noise
    np.testing.assert_allclose(ours.matte, traced.matte, atol=0.25)  # 64 random rays
    assert ours.matte.sum() == pytest.approx(traced.matte.sum(), rel=3e-3)
    inside = ours.matte == 1
    # Means of random rays over a pixel, which at the rim spans a quarter of a metre.
    for plane, other in ((ours.depth, traced.depth), (ours.normal, traced.normal)):
        assert np.abs(plane - other)[inside].mean() < 0.005
        assert np.abs(plane - other)[inside].max() < 0.1


# --- GGX -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sky", SKIES, indirect=True)
# slow: a finer table for narrower lobes; by one code all meet the same integral, and that of 0.5 goes red for the same
# break, as does light/test_glossy.py::test_under_a_bare_sun_the_map_is_the_integral_within_a_per_cent.
@pytest.mark.parametrize(
    "alpha", [pytest.param(0.1, marks=pytest.mark.slow), pytest.param(0.25, marks=pytest.mark.slow), 0.5]
)
def test_white_ggx_is_within_a_per_cent_of_path_tracing(sky, alpha, capsys):
    name, light = sky
    ours, flat = mapped(Reflective((Layer(GGX(alpha)),)), light), mapped(flat_ggx(alpha), light)
    truth, variance = conductor(light, alpha, MANY[name], seed=5)
    inside = ours.matte == 1
    error, noise = mean_error(ours.radiance, truth, variance, inside)
    usual, _ = mean_error(flat.radiance, truth, variance, inside)
    say(
        capsys, name, f"GGX α = {alpha}", f"mean |error| {100 * error:.2f} %", f"noise {100 * noise:.2f} %",
        f"two-dimensional {100 * usual:.1f} %",
    )  # fmt: skip
    assert error < 0.01
    assert usual > 3 * error
    assert_mean_agrees(truth[inside], variance[inside], ours.radiance[inside], near=0.01)


# --- Phong and Ward, against integrals over the light's pixels -------------------------------------------------------


def seen_on_a_ball(count: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Normals and directions to the eye, evenly over a ball's picture, up to 87°."""
    random = np.random.default_rng(seed)
    radius, azimuth = np.sqrt(random.random(count)) * 0.9986, 2 * np.pi * random.random(count)
    normals = np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), np.sqrt(1 - radius**2)], -1)
    turn = rotation_about(spread(1, seed)[0], 2.0)
    return normals @ turn.T, np.broadcast_to(turn[:, 2], normals.shape)


def pixels_of(light: EnvironmentMap) -> tuple[np.ndarray, np.ndarray]:
    """Where the pixels point, and their radiance times solid angle."""
    rows = light.size
    v, u = np.meshgrid(np.arange(rows) + 0.5, np.arange(2 * rows) + 0.5, indexing="ij")
    directions = LatLong().directions(np.stack([u / (2 * rows), v / rows], -1)).reshape(-1, 3)
    return directions, (light.radiance * LatLong().solid_angles(rows)[..., None]).reshape(-1, 3).astype(float)


def shaded(material, light, normals, eyes):
    buffer = GBuffer(normals[None], eyes[None], np.zeros((1, len(normals)), int))
    return Shading.of([material], light, Plain()).shade(buffer)[0]


def share(found, truth):
    return float(np.abs(found - truth).mean() / truth.mean())


@pytest.mark.parametrize("sky", SKIES, indirect=True)
@pytest.mark.parametrize("n", [10, 50, 200])
def test_the_papers_phong_table_is_within_a_per_cent_of_its_integral(sky, n, capsys):
    name, light = sky
    normals, eyes = seen_on_a_ball(400)
    reflected = 2 * np.sum(normals * eyes, -1, keepdims=True) * normals - eyes
    directions, flux = pixels_of(light)
    truth = np.stack([(n + 1) / (2 * np.pi) * np.maximum(directions @ r, 0) ** n @ flux for r in reflected])
    error = share(shaded(Reflective((Layer(Phong(n)),)), light, normals, eyes), truth)
    say(capsys, name, f"Phong n = {n}, the paper's S", f"mean |error| {100 * error:.2f} %")
    assert error < 0.01


@pytest.mark.parametrize("sky", SKIES, indirect=True)
@pytest.mark.parametrize(
    ("brdf", "lobe"),
    [
        (PhongReflectance(10), Phong(10)),
        # PhongReflectance(10) and Ward say as much in each run.
        pytest.param(PhongReflectance(50), Phong(50), marks=pytest.mark.slow),
        pytest.param(PhongReflectance(200), Phong(200), marks=pytest.mark.slow),
        (Ward(0.2), WardLobe(0.2)),
    ],
    ids=["Phong 10", "Phong 50", "Phong 200", "Ward 0.2"],
)
def test_the_three_dimensional_map_is_within_a_per_cent_of_the_integral(sky, brdf, lobe, capsys):
    name, light = sky
    normals, eyes = seen_on_a_ball(120)
    directions, flux = pixels_of(light)
    truth = np.empty((len(normals), 3))
    for i, (normal, eye) in enumerate(zip(normals, eyes, strict=True)):
        cosine = normal @ eye
        across = normalised(eye - cosine * normal)
        local = np.stack([directions @ across, directions @ np.cross(normal, across), directions @ normal], -1)
        above = local[:, 2] > 0
        truth[i] = brdf(float(np.arccos(cosine)), local[above]) @ flux[above]
    error = share(shaded(Reflective((Layer(brdf),)), light, normals, eyes), truth)
    usual = share(shaded(flattened(lobe, brdf), light, normals, eyes), truth)
    width = f"n = {brdf.n}" if isinstance(brdf, PhongReflectance) else f"α = {brdf.alpha}"
    found = f"mean |error| {100 * error:.2f} %", f"two-dimensional {100 * usual:.1f} %"
    say(capsys, name, f"{brdf.name} {width}", *found)
    assert error < 0.01
    assert usual > 2 * error

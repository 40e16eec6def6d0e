"""Light balances: under constant light a surface shows what it reflects, neither more nor less."""

import numpy as np
import pytest

from lights import constant, of_directions
from montecarlo import assert_mean_agrees
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.renderer import render
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.directions import rotation_about
from solids import quad, sphere

LIGHT = np.array([1.0, 2.0, 0.5])
CONSTANT = constant(8, (1.0, 2.0, 0.5))
BALL_FILLS_VIEW = Camera(12, 12, 60.0, np.array([0, 0, 6.0]), np.eye(3))


def seen_on_a_sphere(material, samples=256):
    return render(Scene(CONSTANT, objects=(sphere(material),)), BALL_FILLS_VIEW, Mitsuba(samples=samples), seed=5)


@pytest.mark.parametrize("reflectance", [(0.8, 0.8, 0.8), (0.2, 0.5, 0.9), (0, 0, 0), (1, 1, 1)])
def test_a_diffuse_floor_under_constant_light_shows_its_reflectance(reflectance):
    camera = Camera.looking_at(np.array([0, 2.0, 3]), np.zeros(3), width=12, height=12, focal_length=20)
    seen = render(Scene(CONSTANT, local=(Plane(Diffuse(reflectance)),)), camera, Mitsuba(samples=256), seed=1)
    assert_mean_agrees(seen.radiance, seen.variance, LIGHT * reflectance)


def test_a_diffuse_sphere_in_the_open_shows_its_reflectance():
    seen = seen_on_a_sphere(Diffuse((0.2, 0.5, 0.8)))
    # Facets under smooth normals: a ray in twenty thousand starts below its own facet.
    assert_mean_agrees(seen.radiance, seen.variance, LIGHT * [0.2, 0.5, 0.8], near=2e-3)


def test_a_white_mirror_cannot_be_seen():
    seen = seen_on_a_sphere(Material(metallic=1.0, roughness=0.0))
    np.testing.assert_allclose(seen.radiance, np.broadcast_to(LIGHT, (12, 12, 3)), rtol=1e-5)


@pytest.mark.parametrize("ior", [1.33, 1.5, 2.42])
def test_clear_glass_cannot_be_seen(ior):
    seen = seen_on_a_sphere(Material(roughness=0.0, transmission=1.0, ior=ior))
    # Twelve bounces: what is reflected inside eleven times is lost, R¹¹ of little.
    assert_mean_agrees(seen.radiance, seen.variance, LIGHT, near=1e-3)


def test_coloured_glass_tints_light_once_for_both_crossings():
    seen = seen_on_a_sphere(Material((0.25, 1.0, 1.0), roughness=0.0, transmission=1.0))
    red, green = seen.radiance[5:7, 5:7, 0].mean() / LIGHT[0], seen.radiance[5:7, 5:7, 1].mean() / LIGHT[1]
    # At the middle, A23: R = 0.04 outside, 0.96² · 0.25 through both surfaces, and 4 % of that again from within.
    assert red == pytest.approx(0.04 + 0.96**2 * 0.25, abs=0.02)
    assert green == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize(
    ("material", "darkest", "brightest"),
    [
        # Single-scattering microfacets lose what bounces between facets: two thirds of it at full roughness.
        (Material(metallic=1.0, roughness=0.25), 0.97, 1.0),
        (Material(metallic=1.0, roughness=1.0), 0.3, 1.0),
        # Disney's diffuse lobe returns light towards where it came from and so gains a few per cent when rough.
        (Material(metallic=0.0, roughness=1.0), 0.95, 1.06),
        (Material(metallic=0.0, roughness=0.15), 0.85, 1.06),
        (Material(roughness=0.3, transmission=1.0), 0.9, 1.0),
        (Material(roughness=0.5, transmission=0.5), 0.7, 1.06),
    ],
    ids=["brushed metal", "rough metal", "chalk", "plastic", "frosted glass", "half glass"],
)
def test_white_materials_give_back_the_light_they_get_within_what_their_model_loses(material, darkest, brightest):
    seen = seen_on_a_sphere(material)
    share = seen.radiance.reshape(-1, 3).mean(0) / LIGHT
    error = np.sqrt(seen.variance.sum((0, 1))) / 144 / LIGHT
    assert np.all(share <= brightest + 4 * error)
    assert np.all(share >= darkest)


@pytest.mark.parametrize(
    ("height", "foot", "expected"), [(2.0, 0.0, 0.75), (1.0, 1.0, 0.646447)], ids=["below", "beside"]
)
def test_a_black_ball_takes_its_form_factor_from_the_floor(height, foot, expected):
    # A19: 1 − h r²/(h² + x²)^{3/2} for a ball of radius 1 at height h, at x from its foot.
    ball = sphere(Diffuse((0, 0, 0)), centre=(0, height, 0))
    target = np.array([foot, 0, 0])
    stand = (target[0] + 2.5, 0.5, 1.0) if foot else (0, 0.4, 4.0)
    camera = Camera.looking_at(np.array(stand), target, width=8, height=8, focal_length=800)
    seen = render(
        Scene(CONSTANT, local=(Plane(Diffuse((0.5, 0.5, 0.5))),), objects=(ball,)), camera, Mitsuba(samples=512), seed=3
    )
    assert not seen.matte.any()
    # 800 pixels of focal length: the footprint is a few centimetres; facets take a thousandth of the ball's disc.
    assert_mean_agrees(seen.radiance, seen.variance, 0.5 * LIGHT * expected, near=4e-3)


@pytest.mark.parametrize(("tilt", "expected"), [(0, 5.235988), (180, 1.047198), (90, np.pi)])
def test_a_renderer_and_irradiance_agree_on_light_that_brightens_upwards(tilt, expected):
    # A3 through the whole chain: a white floor, ceiling or wall is E/π. A square mesh stands for each.
    light = of_directions(lambda d: 1 + d[..., 1], 64)
    turn = rotation_about([0, 0, 1], np.radians(tilt))
    square = quad(np.array([[-1, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]]) @ turn.T, Diffuse((1, 1, 1)))
    normal = turn @ [0, 1, 0]
    assert light.irradiance(normal)[0] == pytest.approx(expected, rel=1e-3)
    camera = Camera.looking_at(normal * 3 + [0.3, 0.4, 2], np.zeros(3), width=8, height=8, focal_length=60)
    seen = render(Scene(light, objects=(square,)), camera, Mitsuba(samples=256), seed=7)
    assert_mean_agrees(seen.radiance, seen.variance, expected / np.pi, near=1e-3)


def test_a_metal_is_opaque_whatever_its_transmission():
    solid = seen_on_a_sphere(Material((0.9, 0.6, 0.3), metallic=1.0, roughness=0.3))
    clear = seen_on_a_sphere(Material((0.9, 0.6, 0.3), metallic=1.0, roughness=0.3, transmission=1.0))
    np.testing.assert_array_equal(clear.radiance, solid.radiance)

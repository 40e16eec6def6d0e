"""Every material under Whitted's model: no light made, little lost, and what the other renderers show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import relume as rl
from relume.light.reflection.weights import Even
from relume.scene.lights import DistantLight, PointLight, Unattenuated
from relume.scene.materials.reflective import glass, glossy, mirror, retroreflector
from relume.scene.materials.whitted import Checks, WhittedMaterial
from solids import grid_faces

FURNACE = rl.EnvironmentMap(np.ones((16, 32, 3), np.float32))
BLACK = rl.EnvironmentMap(np.zeros((4, 8, 3), np.float32))
CAMERA = rl.Camera.looking_at(np.array([0, 0, 5.0]), np.zeros(3), width=24, height=24, focal_length=50)
WHITE = (1.0, 1.0, 1.0)
HALF = (0.5, 0.5, 0.5)
RED = np.full((1, 1, 3), [0.8, 0.0, 0.0], np.float32)


def wall(half: float, z: float, material) -> rl.scene.Polygon:
    """A square that faces the camera."""
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]], float)
    return rl.scene.Polygon(corners, material)


def in_furnace(material, **settings) -> np.ndarray:
    """What a ball of a material shows under constant light of 1, without its rim: (N,)."""
    method = rl.Whitted(antialiasing=None, rays=64, depth=20, contribution=0.0001, **settings)
    picture = method.render(rl.Scene(FURNACE, objects=(rl.Sphere((0, 0, 0), 1.0, material),)), CAMERA)
    x, y = np.meshgrid(np.arange(24) - 11.5, np.arange(24) - 11.5)
    return picture.radiance[np.hypot(x, y) < 8, 0]


@pytest.mark.parametrize("metallic", [0.0, 0.25, 0.5, 1.0])
@pytest.mark.parametrize("roughness", [0.0, 0.3, 0.45, 0.55, 0.7, 1.0])
@pytest.mark.parametrize("transmission", [0.0, 0.5])
def test_no_material_makes_light_and_smooth_ones_lose_none(metallic, roughness, transmission):
    seen = in_furnace(rl.Material(WHITE, metallic, roughness, transmission))
    # A constellation of 64 lights says constant light to a few per cent; what diffuses inside a ball is lost.
    assert seen.mean() <= 1.02
    assert seen.max() <= 1.15
    if roughness == 0 and transmission == 0:
        assert seen.mean() > 0.97
    elif roughness < 0.6:
        assert seen.mean() > 0.75


def test_rough_white_metal_shows_what_a_single_bounce_of_ggx_leaves():
    """Mitsuba's roughconductor, separable Smith masking, 4096 rays: 0.87, 0.70 and 0.385 as means of the ball."""
    for roughness, mean in ((0.51, 0.87), (0.7, 0.70), (1.0, 0.385)):
        assert in_furnace(rl.Material(WHITE, 1.0, roughness)).mean() == pytest.approx(mean, abs=0.06)


def test_a_little_more_roughness_changes_a_metal_a_little():
    below, above = (in_furnace(rl.Material(WHITE, 1.0, roughness)).mean() for roughness in (0.499, 0.501))
    assert below == pytest.approx(above, abs=0.06)


def behind_a_pane(roughness: float) -> float:
    """The contrast of checks seen through a ball of frosted glass: standard deviation over mean."""
    checks = wall(4, -3, WhittedMaterial(ambient=None, diffuse=Checks(WHITE, (0.0, 0.0, 0.0), 0.5)))
    ball = rl.Sphere((0, 0, 0), 1.0, rl.Material(WHITE, 0.0, roughness, 1.0, ior=1.3))
    light = (rl.scene.DistantLight((0, 0, 1), WHITE),)
    method = rl.Whitted(antialiasing=None, rays=64, constellation=0)
    seen = method.render(rl.Scene(BLACK, objects=(checks, ball), lights=light), CAMERA).radiance[8:16, 8:16, 0]
    return float(seen.std() / seen.mean())


def test_frosted_glass_grows_more_frosted_and_never_clear_again():
    contrasts = [behind_a_pane(roughness) for roughness in (0.0, 0.3, 0.5, 0.52, 0.9)]
    assert contrasts[0] > 0.5
    assert contrasts[1] < contrasts[0]
    assert max(contrasts[2:]) < 0.5 * contrasts[0]


@pytest.mark.parametrize(
    "material",
    [
        rl.Material(RED, 1.0, 0.0),
        rl.Material(RED, 0.99, 0.3),
        rl.Material(RED, 1.0, 0.7),
        rl.Material(RED, 0.0, 0.0, 1.0),
        rl.Material(RED),
    ],
)
def test_an_image_of_one_colour_is_that_colour(material):
    plain = replace(material, base_color=(0.8, 0.0, 0.0))
    lights = (rl.scene.DistantLight((1, 1, 1), WHITE),)
    seen = [
        rl.Whitted(antialiasing=None)
        .render(rl.Scene(FURNACE, objects=(rl.Sphere((0, 0, 0), 1.0, m),), lights=lights), CAMERA)
        .radiance
        for m in (material, plain)
    ]
    np.testing.assert_allclose(*seen, rtol=1e-5, atol=1e-6)
    assert seen[0][12, 12, 0] > seen[0][12, 12, 1]


def test_ggx_under_one_light_is_the_microfacet_formula():
    """Along the normal with the light 60° off: D G F / (4 N·V) by hand (Walter et al. 2007)."""
    alpha, tilt = 0.36, np.radians(60)
    half = np.cos(tilt / 2)
    d = alpha**2 / (np.pi * (half**2 * (alpha**2 - 1) + 1) ** 2)

    def g1(c):
        return 2 * c / (c + np.sqrt(alpha**2 + (1 - alpha**2) * c**2))

    f = 0.9 + 0.1 * (1 - half) ** 5
    expected = d * g1(1.0) * g1(np.cos(tilt)) * f / 4
    floor = wall(1, 0, rl.Material((0.9, 0.9, 0.9), 1.0, 0.6))
    light = DistantLight((np.sin(tilt), 0, np.cos(tilt)), WHITE)
    camera = replace(CAMERA, width=1, height=1)
    picture = rl.Whitted(antialiasing=None).render(rl.Scene(BLACK, objects=(floor,), lights=(light,)), camera)
    assert picture.radiance[0, 0, 0] == pytest.approx(expected, rel=1e-5)


def test_the_materials_of_reflection_maps_mean_the_same():
    assert in_furnace(mirror((0.5, 0.5, 0.5))).mean() == pytest.approx(0.5, rel=1e-6)
    assert in_furnace(glass()).mean() == pytest.approx(1.0, abs=0.01)
    assert in_furnace(glossy((0.5, 0.5, 0.5))).mean() == pytest.approx(0.52, abs=0.03)
    assert in_furnace(glossy(WHITE, specular_weight=Even(0.3))).mean() == pytest.approx(1.0, abs=0.03)
    with pytest.raises(rl.errors.UnsupportedScene, match="no place for one of its layers in 'cat'"):
        in_furnace(retroreflector(name="cat"))


def test_faces_that_go_round_the_other_way_look_the_same():
    v, u = np.meshgrid(np.linspace(0, np.pi, 17), np.linspace(0, 2 * np.pi, 33), indexing="ij")
    points = np.stack([np.sin(v) * np.sin(u), np.cos(v), np.sin(v) * np.cos(u)], axis=-1).reshape(-1, 3)
    faces = 33 + grid_faces(14, 32)  # not those at the poles, which have no area
    material = rl.Material((0.8, 0.8, 0.8), roughness=1.0)
    shown = []
    for order in ([0, 1, 2], [0, 2, 1]):
        mesh = rl.Mesh(
            points.astype(np.float32), faces[:, order].astype(np.int32), material, normals=points.astype(np.float32)
        )
        scene = rl.Scene(FURNACE, objects=(mesh,), lights=(DistantLight((0, 0, 1), WHITE),))
        shown.append(rl.Whitted(antialiasing=None).render(scene, CAMERA).radiance)
    np.testing.assert_allclose(*shown, rtol=1e-4, atol=1e-5)


def test_a_lamp_on_a_ceiling_lights_all_of_the_floor():
    ceiling = rl.scene.Polygon(
        np.array([[-3.0, 2.0, -3], [3, 2.5, -3], [3, 2.5, 3], [-3, 2.0, 3]]), rl.Diffuse((0.5, 0.5, 0.5)), "ceiling"
    )
    floor = rl.Plane(rl.Diffuse((0.5, 0.5, 0.5)), (6, 6))
    lamp = PointLight((0.3, 2.275, 0.1), WHITE, Unattenuated())
    camera = rl.Camera.looking_at(np.array([0, 1.0, 2.5]), np.array([0, 0, 0.0]), width=30, height=20, focal_length=40)
    scene = rl.Scene(BLACK, (floor,), (ceiling,), (lamp,))
    picture = rl.Whitted(antialiasing=None, constellation=0).render(scene, camera)
    below = picture.matte == 0
    assert below.sum() > 400
    assert np.all(picture.radiance[below & (picture.depth > 0)] > 0)


def test_checks_on_a_wall_between_two_cubes_do_not_speckle():
    checks = wall(3, -2, WhittedMaterial(diffuse=Checks(WHITE, (0.1, 0.1, 0.1), 1.0)))
    scene = rl.Scene(BLACK, objects=(checks,), lights=(DistantLight((0, 0, 1), WHITE),))
    picture = rl.Whitted(antialiasing=None, constellation=0).render(scene, replace(CAMERA, focal_length=30)).radiance
    flips = np.sum(np.diff(picture[..., 0] > 0.2, axis=1)) + np.sum(np.diff(picture[..., 0] > 0.2, axis=0))
    assert flips < 300  # seven lines of 24 pixels each way


def test_a_coated_pane_dims_the_light_that_goes_through_it():
    pane = rl.scene.Polygon(
        np.array([[-2.0, 1, 2], [2, 1, 2], [2, 1, -2], [-2, 1, -2]]),
        WhittedMaterial(specular=(0.5, 0.5, 0.5), transmission=WHITE, coated=True, highlight=(0, 0, 0)),
    )
    floor = rl.Plane(rl.Diffuse(WHITE), (4, 4))
    camera = rl.Camera.looking_at(np.array([0, 0.6, 1.5]), np.zeros(3), width=1, height=1, focal_length=1)
    scene = rl.Scene(BLACK, (floor,), (pane,), (DistantLight((0, 1, 0), (np.pi, np.pi, np.pi)),))
    picture = rl.Whitted(antialiasing=None, constellation=0).render(scene, camera)
    assert picture.radiance[0, 0, 0] == pytest.approx(0.5, rel=1e-6)


def test_noise_that_nobody_measured_is_not_called_certainty():
    smooth, rough = (rl.Material(WHITE, 1.0, roughness) for roughness in (0.0, 0.3))
    for material, known in ((smooth, True), (rough, False)):
        scene = rl.Scene(FURNACE, objects=(rl.Sphere((0, 0, 0), 1.0, material),))
        variance = rl.Whitted(antialiasing=None).render(scene, CAMERA).variance
        assert np.all(variance == 0) if known else np.all(np.isnan(variance))


def test_an_eye_in_glass_is_reported_of_and_one_in_a_hollow_is_not():
    clear = WhittedMaterial(transmission=WHITE)
    ball = rl.Sphere((0, 0, 5), 2.0, clear, "ball")
    hollow = rl.Sphere((0, 0, 5), 1.0, replace(clear, ior=1 / 1.5), "hollow")
    with pytest.warns(UserWarning, match="the camera stands inside 'ball', which is transparent"):
        rl.Whitted().render(rl.Scene(FURNACE, objects=(ball,)), CAMERA)
    rl.Whitted().render(rl.Scene(FURNACE, objects=(ball, hollow)), CAMERA)


def test_triangles_without_area_are_reported():
    points = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], np.float32)
    mesh = rl.Mesh(points, np.array([[0, 1, 2], [0, 1, 3]], np.int32), rl.Diffuse((0.5, 0.5, 0.5)), name="sheet")
    with pytest.warns(UserWarning, match="1 of the 2 triangles of 'sheet' have no area"):
        rl.Whitted().render(rl.Scene(FURNACE, objects=(mesh,)), CAMERA)


def test_a_tree_without_end_is_cut_and_reported_of():
    pane = WhittedMaterial(specular=HALF, transmission=HALF, ior=1.0)
    panes = tuple(wall(9, z, pane) for z in np.linspace(-1, 0, 8))
    scene = rl.Scene(FURNACE, objects=panes)
    camera = replace(CAMERA, width=2, height=2)
    with pytest.warns(UserWarning, match="lower the depth or raise the contribution"):
        rl.Whitted(antialiasing=None, depth=60, contribution=0.0).render(scene, camera)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"depth": 2.5}, "depth is 2.5; expected a whole number from 1 to 1000"),
        ({"rays": 10**10}, "rays is 10000000000; expected a whole number from 1 to 65536"),
        ({"constellation": -1}, "constellation is -1"),
        ({"contribution": 1.0}, "contribution is 1.0"),
        ({"threads": 0}, "threads is 0"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings, words):
    with pytest.raises(ValueError, match=words):
        rl.Whitted(**settings)


def test_seeds_and_darkness_that_make_no_sense_are_refused():
    scene = rl.Scene(FURNACE, objects=(rl.Sphere((0, 0, 0), 1.0, rl.Diffuse(HALF)),))
    for seed in (-1, 2**70, 1.5):
        with pytest.raises(ValueError, match="expected a whole number from 0"):
            rl.Whitted().render(scene, CAMERA, seed=seed)  # pyright: ignore[reportArgumentType]
    with pytest.raises(rl.errors.UnsupportedScene, match="nothing shines in this scene"):
        rl.Whitted().render(replace(scene, light=BLACK), CAMERA)


def test_what_scattered_rays_find_is_lit_by_all_of_the_constellation_in_the_mean():
    """A rough mirror shows a ball as bright as a smooth one does, though each ray asks an eighth of the lights."""
    seen = {}
    for roughness in (0.0, 0.03):
        metal = wall(2, -1, WhittedMaterial(specular=WHITE, highlight=(0, 0, 0), roughness=roughness))
        # It stands behind the camera, and is seen in the mirror alone.
        ball = rl.Sphere((0, 0, 12), 5.0, rl.Diffuse(HALF))
        scene = rl.Scene(FURNACE, objects=(metal, ball))
        picture = rl.Whitted(antialiasing=None, rays=256).render(scene, replace(CAMERA, width=6, height=6))
        seen[roughness] = picture.radiance.mean()
    assert seen[0.03] == pytest.approx(seen[0.0], rel=0.03)

"""Whitted (1980), section by section: the renderer against numbers worked out by hand and against its slow twin."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import naive_whitted
import solids
from lights import constant, of_directions
from relume.renderers.whitted.antialiasing import Antialiasing
from relume.renderers.whitted.kernel_data import EYE, REFLECTED, REFRACTED, SHADOW
from relume.renderers.whitted.optics import perturbed
from relume.renderers.whitted.ray_tree import ray_tree
from relume.renderers.whitted.whitted import Whitted
from relume.scene.cameras.camera import Camera
from relume.scene.lights import AmbientLight, DistantLight, Linear, PointLight, SquareLaw, Unattenuated
from relume.scene.materials.bumps import BumpMap, Wrinkles
from relume.scene.materials.materials import Colour, Diffuse
from relume.scene.materials.whitted import Checks, WhittedMaterial
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Plane, Sphere
from relume.sphere.directions import normalised, rotation_about
from solo_ray import eye

UNIT = (np.pi, np.pi, np.pi)
"""The irradiance of the paper's light of strength 1."""
WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
DARKNESS = constant(8, 0.0)
EVEN = AmbientLight(WHITE)
UP = np.array([0.0, 1.0, 0.0])
POINTS = Whitted(antialiasing=None, constellation=0)


def grey(value):
    return (value, value, value)


def seen(scene, position, direction, method=POINTS):
    return method.render(scene, eye(position, direction)).radiance[0, 0].astype(float)


def facing(position, target, width, height, focal_length) -> Camera:
    place, centre = np.array(position, float), np.array(target, float)
    return Camera.looking_at(place, centre, width=width, height=height, focal_length=focal_length)


def facets(material, **given) -> Mesh:
    """A ball of triangles with smooth normals."""
    return replace(solids.sphere(Diffuse(WHITE), **given), material=material)


def towards(degrees):
    """Up, tilted by an angle towards +x."""
    return (float(np.sin(np.radians(degrees))), float(np.cos(np.radians(degrees))), 0.0)


# --- 1. Conventional models ------------------------------------------------------------------------------------------


def test_section_1_phongs_equation():
    # I_a + k_d N·L + k_s (N·L′)ⁿ: the viewer above, the light at 60°, so that L′ is at 30°.
    material = WhittedMaterial((0.5, 0.25, 0.0), ambient=grey(0.1), highlight=(0.4, 0.0, 0.2), exponent=10)
    lights = (AmbientLight(grey(0.2)), DistantLight(towards(60), UNIT))
    found = seen(Scene(DARKNESS, (Plane(material),), lights=lights), [0, 1, 0], -UP)
    np.testing.assert_allclose(found, [0.02 + 0.25 + 0.0949219, 0.02 + 0.125, 0.02 + 0.0474609], atol=1e-6)


def test_section_1_ambient_light_is_reflected_as_the_diffuse_colour_unless_said_otherwise():
    floor = Plane(WhittedMaterial((0.5, 0.25, 0.0)))
    scene = Scene(DARKNESS, (floor,), lights=(AmbientLight((0.2, 0.4, 0.6)), AmbientLight(grey(0.2))))
    np.testing.assert_allclose(seen(scene, [0, 1, 0], -UP), [0.2, 0.15, 0.0], rtol=1e-6)


@pytest.mark.parametrize("angle", [0, 30, 75])
def test_section_1_the_diffuse_part_goes_by_lamberts_cosine_from_wherever_it_is_seen(angle):
    scene = Scene(DARKNESS, (Plane(WhittedMaterial(grey(0.8))),), lights=(DistantLight(towards(angle), (np.pi, 1, 2)),))
    for view in (-UP, [1, -0.5, 0.2], [-1, -0.2, -0.9]):
        expected = 0.8 * np.cos(np.radians(angle)) * np.array([1, 1 / np.pi, 2 / np.pi])
        np.testing.assert_allclose(seen(scene, [0, 1, 0], view), expected, rtol=1e-6)


def test_section_1_the_glossier_the_narrower_the_highlight():
    def highlight(angle, exponent):
        material = WhittedMaterial(highlight=WHITE, exponent=exponent)
        scene = Scene(DARKNESS, (Plane(material),), lights=(DistantLight(towards(angle), UNIT),))
        return seen(scene, [0, 1, 0], -UP)[0]

    # At half the angle the cosine is 0.9659258; along the mirror's direction every exponent shows the whole light.
    for exponent, expected in ((1, 0.9659258), (50, 0.1766772), (400, 9.4954e-7)):
        assert highlight(30, exponent) == pytest.approx(expected, rel=1e-4)
        assert highlight(0, exponent) == pytest.approx(1, rel=1e-6)


def test_section_1_lights_add_up():
    scene = mixture(1)
    scene = replace(scene, light=DARKNESS)
    camera = facing([0.3, 1.8, 4], [0, 0.5, 0], 20, 15, 20)
    method = replace(POINTS, contribution=0.0)
    parts = [method.render(replace(scene, lights=(light,)), camera).radiance for light in scene.lights]
    np.testing.assert_allclose(np.sum(parts, 0), method.render(scene, camera).radiance, rtol=1e-5)


@pytest.mark.parametrize("light", [DistantLight((0.0, -1, 0.2), UNIT), PointLight((0.0, -1, 0), UNIT)])
def test_section_1_a_light_on_the_other_side_adds_nothing(light):
    material = WhittedMaterial(grey(0.5), highlight=WHITE, exponent=1)
    scene = Scene(DARKNESS, (Plane(material),), lights=(light,))
    assert np.all(seen(scene, [0, 1, 0], [0.3, -1, 0]) == 0)
    # A surface has two sides, and the normal is turned to the one that is seen (§2).
    assert np.all(seen(scene, [0, -2, 0.1], UP) > 0)


def test_section_1_shadow_is_what_the_viewer_sees_and_the_light_does_not():
    ball = Sphere((0.0, 2.0, 0.0), 0.5, WhittedMaterial(grey(0.1)))
    lamp = PointLight((0.0, 4.0, 0.0), UNIT, Unattenuated())
    scene = Scene(DARKNESS, (Plane(WhittedMaterial(grey(0.5))),), (ball,), (lamp, AmbientLight(grey(0.1))))
    # Tangents from the lamp touch the ball at asin(¼): its shadow on the floor has the radius 4/√15 = 1.0327956.
    for x, lit in ((0.0, False), (1.0327, False), (1.0329, True)):
        expected = 0.05 + 0.5 * 4 / np.hypot(4, x) * lit
        np.testing.assert_allclose(seen(scene, [x, 0.2, 0.9], [0, -0.2, -0.9]), expected, rtol=1e-6)


def test_section_1_what_lies_behind_a_light_throws_no_shadow():
    lamp = PointLight((0.0, 1.0, 0.0), UNIT)
    ball = Sphere((0.0, 2.0, 0.0), 0.5, WhittedMaterial())
    scene = Scene(DARKNESS, (Plane(WhittedMaterial(grey(0.5))),), (ball,), (lamp,))
    np.testing.assert_allclose(seen(scene, [0, 0.5, 0], -UP), 0.5, rtol=1e-6)


def test_section_1_what_lies_behind_a_light_throws_no_shadow_through_glass_either():
    lamp = PointLight((0.0, 2.0, 0.0), UNIT)
    pane = WhittedMaterial(transmission=grey(0.5))
    objects = (Sphere((0.0, 1.0, 0.0), 0.2, pane), Sphere((0.0, 2.6, 0.0), 0.5, WhittedMaterial()))
    scene = Scene(DARKNESS, (Plane(WhittedMaterial(grey(0.5))),), objects, (lamp,))
    np.testing.assert_allclose(seen(scene, [0.5, 0.3, 0], [-0.5, -0.3, 0]), 0.5 * 0.25 / 4, rtol=1e-6)


@pytest.mark.parametrize(("light", "lit"), [(10, True), (80, True), (-35, False), (-80, False), (100, False)])
def test_section_1_a_smooth_mesh_is_lit_where_both_its_facet_and_its_normal_face_the_light(light, lit):
    # A flat facet whose normal says that it is tilted by 60° towards +x.
    vertices, tilted = np.array([[-1, 0, 1], [1, 0, 1], [0, 0, -1]], "f4"), np.array([towards(60)] * 3, "f4")
    material = WhittedMaterial(grey(0.5), highlight=WHITE, exponent=1)
    mesh = Mesh(vertices, np.array([[0, 1, 2]], np.int32), material, tilted)
    scene = Scene(DARKNESS, objects=(mesh,), lights=(DistantLight(towards(light), UNIT),))
    found = seen(scene, [0.2, 1, 0], [-0.2, -1, 0])[0]
    halfway = normalised(np.array(towards(light)) + normalised([0.2, 1, 0]))
    shine = max(float(halfway @ towards(60)), 0)
    assert found == pytest.approx((0.5 * np.cos(np.radians(60 - light)) + shine) * lit, rel=1e-5)


@pytest.mark.parametrize(
    ("falloff", "share"), [(Unattenuated(), 1), (Linear(8.0), 0.75), (Linear(1.5), 0), (SquareLaw(), 0.25)]
)
def test_section_1_lights_fall_with_distance_as_they_are_reported(falloff, share):
    lamp = PointLight((0.0, 2.0, 0.0), UNIT, falloff)
    scene = Scene(DARKNESS, (Plane(WhittedMaterial(grey(0.8))),), lights=(lamp,))
    np.testing.assert_allclose(seen(scene, [0, 1, 0], -UP), 0.8 * share, rtol=1e-6)


# --- 2. Improved model -----------------------------------------------------------------------------------------------


def colour(random, most) -> Colour:
    r, g, b = random.uniform(0, most, 3)
    return float(r), float(g), float(b)


def surface(random) -> WhittedMaterial:
    """Anything that eq. 2 can say, matte or shining or clear; coefficients stay below 1 together."""
    kind = random.integers(4)
    paint = [
        colour(random, 0.3),
        Checks(colour(random, 0.3), colour(random, 0.3), random.uniform(0.1, 0.5)),
        (0.3 * random.random((3, 4, 3))).astype(np.float32),
    ][random.integers(3)]
    return WhittedMaterial(
        paint,
        specular=colour(random, 0.35) if kind != 1 else BLACK,
        transmission=colour(random, 0.35) if kind >= 2 else BLACK,
        ambient=None if random.integers(2) else colour(random, 0.3),
        highlight=None if random.integers(2) else colour(random, 0.5),
        exponent=random.uniform(1, 80),
        ior=random.uniform(0.6, 2.4),
        fresnel=bool(random.integers(2)),
        coated=bool(random.integers(2)),
    )


def mixture(seed) -> Scene:
    """Spheres, planes, a box and a smooth mesh of random materials under every kind of light."""
    random = np.random.default_rng(seed)

    def place():
        return random.uniform(-1, 1, 3) * [1.5, 0.5, 1.5] + [0, 0.6, 0]

    body, turn = trimesh.creation.box(random.uniform(0.3, 1, 3)), rotation_about(random.normal(size=3), 1.0)
    vertices = (body.vertices @ turn.T + place()).astype(np.float32)
    uv = random.random((8, 2)).astype(np.float32)
    objects = [Sphere(tuple(place()), random.uniform(0.2, 0.6), surface(random)) for _ in range(4)]
    objects += [Mesh(vertices, body.faces.astype(np.int32), surface(random), uv=uv)]
    objects += [facets(surface(random), centre=tuple(place()), radius=0.4, fine=2)]
    lights = [
        PointLight(tuple(random.uniform([-3, 1, -3], [3, 7, 3])), colour(random, 9), falloff)
        for falloff in (Unattenuated(), Linear(random.uniform(3, 9)), SquareLaw())
    ]
    lights += [DistantLight(tuple(random.normal(size=3)), colour(random, 2)), AmbientLight(colour(random, 0.5))]
    slope = random.uniform(-0.5, 0.5, 3)
    sky = of_directions(lambda d: 1 + d @ slope, 16)
    return Scene(sky, (Plane(surface(random)), Plane(surface(random), (4.0, 4.0), -1.5)), tuple(objects), tuple(lights))


def ways_of_rendering(seed) -> Whitted:
    random = np.random.default_rng(1000 + seed)
    return Whitted(
        depth=int(random.integers(1, 8)),
        contribution=float(random.choice([0, 1e-3, 0.03])),
        attenuation=[Unattenuated(), Linear(6.0), SquareLaw()][seed % 3],
        antialiasing=None,
        constellation=5 * (seed % 2),
        clear_shadows=bool(random.integers(2)),
        background=bool(random.integers(2)),
    )


CAMERA = facing([0.3, 2.4, 4.6], [0, 0.4, 0], 48, 36, 52)


def agrees_with_twin(scene, method, count, seed=0) -> float:
    """Hold some of the pixels against the slow twin; the share of those on objects."""
    fast = method.render(scene, CAMERA)
    random = np.random.default_rng(seed)
    rows, columns = random.integers(CAMERA.height, size=count), random.integers(CAMERA.width, size=count)
    rays = CAMERA.rays()
    slow = np.stack(
        [naive_whitted.radiance(scene, CAMERA.position, rays[at], method) for at in zip(rows, columns, strict=True)]
    )
    found = fast.radiance[rows, columns]
    differs = np.abs(found - slow).max(-1) > 1e-5 * (slow.max(-1) + 0.1 * slow.mean())
    # Where a smooth mesh's normal is turned from the viewer the twin takes it as it is.
    assert differs.mean() <= 0.01, f"pixels {rows[differs]}, {columns[differs]}: {found[differs]}, not {slow[differs]}"
    return float(fast.matte[rows, columns].mean())


@pytest.mark.parametrize("seed", range(8))
def test_section_2_equation_2_with_every_kind_of_surface_light_and_setting(seed):
    assert agrees_with_twin(mixture(seed), ways_of_rendering(seed), 100) > 0.05


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 160))
def test_section_2_equation_2_with_many_more_of_them(seed):
    agrees_with_twin(mixture(seed), ways_of_rendering(seed), 400)


def test_section_2_the_three_terms_of_equation_2():
    # Light of 1 from above, 0.5 from below: S and T of a clear plane.
    radiance = np.ones((64, 128, 3), np.float32)
    radiance[32:] = 0.5
    material = WhittedMaterial((0.2, 0.1, 0), (0.1, 0.2, 0.4), (0.7, 0.5, 0.4), highlight=BLACK)
    scene = Scene(replace(DARKNESS, radiance=radiance), (Plane(material),), lights=(DistantLight(towards(60), UNIT),))
    found = seen(scene, [0, 1, 0], [0.4, -1, 0.1])
    np.testing.assert_allclose(found, [0.1 + 0.1 + 0.35, 0.05 + 0.2 + 0.25, 0.4 + 0.2], rtol=1e-6)


@pytest.mark.parametrize(("depth", "expected"), [(1, 0.1), (2, 0.15), (3, 0.175), (8, 0.19921875), (60, 0.2)])
def test_section_2_a_branch_of_infinite_depth_is_truncated(depth, expected):
    # Between two mirrors: 0.1 + 0.5 · 0.1 + 0.25 · 0.1 + …
    mirror = WhittedMaterial(specular=grey(0.5), ambient=grey(0.1))
    scene = Scene(DARKNESS, (Plane(mirror), Plane(mirror, height=2.0)), lights=(EVEN,))
    method = replace(POINTS, depth=depth, contribution=0.0)
    np.testing.assert_allclose(seen(scene, [0, 1, 0], [0.1, -1, 0], method), expected, rtol=1e-6)


@pytest.mark.parametrize(("contribution", "expected"), [(0.6, 0.1), (0.5, 0.15), (0.2, 0.175), (0.125, 0.1875)])
def test_section_2_branches_that_carry_too_little_are_cut_off(contribution, expected):
    mirror = WhittedMaterial(specular=(0.5, 0.5, 0.1), ambient=grey(0.1))
    scene = Scene(DARKNESS, (Plane(mirror), Plane(mirror, height=2.0)), lights=(EVEN,))
    method = replace(POINTS, depth=60, contribution=contribution)
    # The largest channel decides.
    assert seen(scene, [0, 1, 0], [0.1, -1, 0], method)[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("attenuation", "height", "share"),
    [
        (Unattenuated(), 3.0, 1), (Linear(10.0), 3.0, 0.7), (Linear(2.0), 3.0, 0), (SquareLaw(), 3.0, 1 / 9),
        (SquareLaw(), 0.5, 1),
    ],
)  # fmt: skip
def test_section_2_intensities_fall_with_the_distance_between_nodes(attenuation, height, share):
    glow = WhittedMaterial(ambient=WHITE)
    scene = Scene(DARKNESS, (Plane(WhittedMaterial(specular=grey(0.5))), Plane(glow, height=height)), lights=(EVEN,))
    method = replace(POINTS, attenuation=attenuation)
    np.testing.assert_allclose(seen(scene, [0, height / 3, 0], -UP, method), 0.5 * share, rtol=1e-6)
    # Between the viewer and the root it does not, whatever the distance; nor does light from outside the scene.
    np.testing.assert_allclose(seen(scene, [0, height / 3, 0], UP, method), 1, rtol=1e-6)
    sky = Scene(constant(8), (Plane(WhittedMaterial(specular=grey(0.5))),))
    np.testing.assert_allclose(seen(sky, [0, 40, 0], -UP, method), 0.5, rtol=1e-6)


@pytest.mark.parametrize(
    ("material", "share"),
    [
        (WhittedMaterial(transmission=(0.8, 0.5, 0)), (0.64, 0.25, 0)),
        (WhittedMaterial(transmission=(0.8, 0.5, 0), fresnel=True), (0.64 * 0.96**2, 0.25 * 0.96**2, 0)),
        (WhittedMaterial(specular=(1, 1, 1)), (0, 0, 0)),
    ],
)
def test_section_2_shadows_of_clear_things_are_dimmed_light(material, share):
    ball = Sphere((0.0, 2.0, 0.0), 0.5, material)
    scene = Scene(DARKNESS, (Plane(WhittedMaterial(grey(0.5))),), (ball,), (DistantLight((0.0, 1, 0), UNIT),))
    np.testing.assert_allclose(seen(scene, [0, 0.5, 0], -UP), 0.5 * np.array(share), rtol=1e-6)
    full = replace(POINTS, clear_shadows=False)
    assert np.all(seen(scene, [0, 0.5, 0], -UP, full) == 0)


def test_section_2_the_index_is_turned_round_on_leaving():
    # Through the middle of a ball of any index nothing is bent; off the middle, in and out are bent the same way.
    for ior in (0.7, 1.0, 1.6):
        ball = Sphere((0.0, 0.0, 0.0), 1.0, WhittedMaterial(transmission=WHITE, ior=ior))
        prepared = POINTS.prepared(Scene(constant(8), objects=(ball,)))
        for height in (0.0, 0.5):
            tree = ray_tree(prepared, eye([0, height, 4], [0, 0, -1]), (0.5, 0.5))
            directions = normalised(tree.end - tree.start)
            first, second = (np.arctan2(-d[1], -d[2]) for d in directions[1:])
            assert second == pytest.approx(2 * first, abs=1e-12)
            assert first == pytest.approx(np.arcsin(height) - np.arcsin(height / ior), abs=1e-12)


def test_section_2_the_tree_of_figure_3():
    # A clear ball before a mirror, one light: each node sends S, T and L, as far as there is anything to carry.
    ball = Sphere((0.0, 1.0, 0.0), 0.5, WhittedMaterial(grey(0.1), grey(0.2), grey(0.7)))
    mirror = WhittedMaterial(grey(0.3), grey(0.5))
    scene = Scene(constant(8), (Plane(mirror),), (ball,), (DistantLight((0.3, 1, 0.5), UNIT),))
    method, camera = replace(POINTS, depth=4, contribution=0.0), eye([0, 1.3, 3], [0.02, -0.1, -1])
    tree = ray_tree(method.prepared(scene), camera, (0.5, 0.5))
    assert tree.kind[0] == EYE and tree.parent[0] == -1 and np.all(tree.parent[1:] < np.arange(1, len(tree.kind)))
    for node in np.flatnonzero((tree.shape >= 0) & (tree.kind != SHADOW)):
        children = tree.children(int(node))
        np.testing.assert_allclose(tree.start[children], np.broadcast_to(tree.end[node], (len(children), 3)))
        kinds = sorted(k for k in tree.kind[children] if k != SHADOW)
        material = (mirror, ball.material)[tree.shape[node]]
        assert kinds in ([], [REFLECTED], [REFLECTED, REFRACTED] if max(material.transmission) else [REFLECTED])
        for kind, coefficient in ((REFLECTED, material.specular), (REFRACTED, material.transmission)):
            for child in children[tree.kind[children] == kind]:
                np.testing.assert_allclose(tree.weight[child], tree.weight[node] * coefficient, rtol=1e-12)
    np.testing.assert_allclose(tree.intensity[0], seen(scene, camera.position, -camera.rotation[:, 2], method))
    np.testing.assert_allclose(tree.sent.sum(0), tree.intensity[0], rtol=1e-12)
    slow = naive_whitted.radiance(scene, camera.position, -camera.rotation[:, 2], method)
    np.testing.assert_allclose(tree.intensity[0], slow, rtol=1e-6)


# --- 2. Improved model: the random perturbation ----------------------------------------------------------------------


@pytest.mark.parametrize("normal", [(0.0, 1.0, 0.0), (0.6, 0.0, -0.8), (0.0, 0.0, -1.0)])
def test_section_2_facets_are_turned_by_random_slopes_of_one_variance(normal):
    count, deviation = 20000, 0.2
    facets = np.array([perturbed(normal, deviation, k, count, np.uint64(7)) for k in range(count)])
    np.testing.assert_allclose(np.linalg.norm(facets, axis=1), 1, rtol=1e-12)
    along = normalised(np.cross(normal, [0.3, 0.5, 0.7]))
    slopes = facets @ np.stack([along, np.cross(normal, along)], axis=1) / (facets @ normal)[:, None]
    np.testing.assert_allclose(slopes.mean(0), 0, atol=0.005)
    np.testing.assert_allclose(np.cov(slopes.T), deviation**2 * np.eye(2), atol=0.02 * deviation**2)
    assert np.mean(slopes**4) == pytest.approx(3 * deviation**4, rel=0.05)  # as of a normal distribution


@pytest.mark.parametrize("clear", [False, True], ids=["glossy", "frosted"])
@pytest.mark.parametrize("roughness", [0.02, 0.1, 0.2])
def test_section_2_glossy_and_frosted_surfaces_spread_what_they_show(clear, roughness):
    # A lamp in the map where the smooth surface shows it; the mean over slopes by Gauss and Hermite.
    incoming, ior = normalised([0.5, -1, 0.2]), 1.5

    def bend(normal) -> np.ndarray:
        there = naive_whitted.refracted(incoming, normal, ior) if clear else naive_whitted.reflected(incoming, normal)
        assert there is not None
        return there

    middle = bend(UP)
    lamp = of_directions(lambda d: np.exp((d @ middle - 1) / 0.02), 256)
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    weights = weights / weights.sum()
    slopes = np.stack(np.meshgrid(nodes, nodes), -1).reshape(-1, 2) * roughness
    share = np.outer(weights, weights).ravel()
    kept = share > 1e-9
    facets = normalised(np.column_stack([slopes[:, 0], np.ones(len(slopes)), slopes[:, 1]]))[kept]
    directions = np.stack([bend(facet) for facet in facets])
    expected = lamp.lookup(directions)[:, 0] @ share[kept] / share[kept].sum()

    material = WhittedMaterial(transmission=WHITE) if clear else WhittedMaterial(specular=WHITE)
    scene = Scene(lamp, (Plane(replace(material, ior=ior, roughness=roughness)),))
    found = seen(scene, -2 * incoming, incoming, replace(POINTS, rays=4096))[0]
    assert found == pytest.approx(expected, rel=0.01)
    assert expected < 0.998  # of the 1 that the smooth surface shows


def test_section_2_a_lights_own_reflection_is_phongs_and_is_not_perturbed():
    smooth = WhittedMaterial(specular=grey(0.5), exponent=20)
    lamp = DistantLight(towards(20), UNIT)
    plain, rough = (Scene(DARKNESS, (Plane(replace(smooth, roughness=r)),), lights=(lamp,)) for r in (0.0, 0.3))
    np.testing.assert_array_equal(seen(plain, [0, 1, 0], -UP), seen(rough, [0, 1, 0], -UP))
    np.testing.assert_allclose(seen(plain, [0, 1, 0], -UP), 0.5 * np.cos(np.radians(10)) ** 20, rtol=1e-6)


def test_section_2_perturbations_are_the_same_for_a_seed_and_others_for_another():
    scene = mixture(3)
    objects = tuple(replace(o, material=replace(o.material, roughness=0.1)) for o in scene.objects)
    scene, method = replace(scene, objects=objects), replace(POINTS, rays=3)
    one, again, other = (method.render(scene, CAMERA, seed=seed).radiance for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert np.mean(one != other) > 0.02
    assert one.mean() == pytest.approx(other.mean(), rel=0.01)


# --- 3. Visible surface processor ------------------------------------------------------------------------------------


def test_section_3_what_is_behind_the_viewer_is_seen_in_mirrors():
    # "Clipping and eliminating backfacing surface elements are not applicable."
    glow = WhittedMaterial(ambient=WHITE)
    scene = Scene(
        DARKNESS, (Plane(WhittedMaterial(specular=grey(0.5))),), (Sphere((0.0, 3.0, 0.0), 0.5, glow),), (EVEN,)
    )
    np.testing.assert_allclose(seen(scene, [0, 1, 0], -UP), 0.5, rtol=1e-6)


def test_section_3_what_another_object_hides_is_seen_in_mirrors():
    hidden, screen = WhittedMaterial(ambient=(1, 0, 0)), WhittedMaterial()
    objects = (Sphere((0.0, 1.0, -4.0), 0.5, hidden), Sphere((0.0, 1.0, -2.0), 0.5, screen))
    scene = Scene(DARKNESS, (Plane(WhittedMaterial(specular=WHITE)),), objects, (EVEN,))
    assert np.all(seen(scene, [0, 1, 0], [0, 0, -1]) == 0)
    np.testing.assert_allclose(seen(scene, [0, 1, 0], [0, -2, -4]), [1, 0, 0], rtol=1e-6)


def test_section_3_faces_are_seen_from_behind():
    inside = facets(WhittedMaterial(grey(0.5)), radius=3.0)
    scene = Scene(DARKNESS, objects=(inside,), lights=(PointLight((0.0, 0.0, 0.0), UNIT),))
    np.testing.assert_allclose(seen(scene, [0.1, 0, 0], [0, 0.3, 1]), 0.5 / 9, rtol=0.01)


def quad(material, turn=0.0) -> Mesh:
    """A square of 2 m about the origin, facing +z."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) @ rotation_about([0, 0, 1], turn).T
    return solids.quad(corners, material)


FRONT = Camera(32, 24, 40.0, np.array([0.1, 0.05, 4.0]), np.eye(3))


def test_section_3_a_pixel_is_the_mean_of_its_four_corners_where_they_are_nearly_equal():
    # Brightness that is linear over the picture: the mean of corners is the middle, with one ray for each corner.
    ramp = of_directions(lambda d: 2 + 0.1 * d[..., 0], 128)
    scene = Scene(ramp, objects=(Sphere((0.0, 0.0, 9.0), 1.0, WhittedMaterial()),))
    smooth = Whitted(constellation=0).render(scene, FRONT)
    np.testing.assert_allclose(smooth.radiance, POINTS.render(scene, FRONT).radiance, rtol=1e-4)
    # The last row and column of pixels pay for the border's corners too.
    assert smooth.rays is not None and np.all(smooth.rays[:-1, :-1] == 1)
    assert smooth.rays.sum() == (FRONT.width + 1) * (FRONT.height + 1)


def test_section_3_a_scene_of_nothing_shows_the_light():
    scene = Scene(constant(8, (0.1, 0.2, 0.3)))
    for method in (POINTS, Whitted()):
        found = method.render(scene, FRONT)
        np.testing.assert_allclose(found.radiance, np.broadcast_to([0.1, 0.2, 0.3], (24, 32, 3)), rtol=1e-6)
        assert np.all(found.matte == 0) and np.all(found.depth == 0)


SQUARE_ALONE = Scene(DARKNESS, objects=(quad(WhittedMaterial(ambient=WHITE), 0.3),), lights=(EVEN,))


@pytest.fixture(scope="module")
def area() -> np.ndarray:
    """What each pixel shows of it on average."""
    fine = 64
    finer = Camera(32 * fine, 24 * fine, 40.0 * fine, FRONT.position, FRONT.rotation)
    return POINTS.render(SQUARE_ALONE, finer).radiance.reshape(24, fine, 32, fine, 3).mean((1, 3))


@pytest.mark.parametrize(("subdivisions", "error"), [(0, 0.5), (2, 0.08), (4, 0.02), (6, 0.005)])
def test_section_3_in_the_limit_it_is_area_sampling(area, subdivisions, error):
    scene = SQUARE_ALONE
    found = Whitted(antialiasing=Antialiasing(subdivisions), constellation=0).render(scene, FRONT)
    assert np.abs(found.radiance - area).max() < error
    np.testing.assert_allclose(found.matte, found.radiance[..., 0], atol=1e-6)
    # Only where there is an edge.
    edge = (area[..., 0] > 0.01) & (area[..., 0] < 0.99)
    assert found.rays is not None
    assert found.rays[edge].mean() >= 1.9**subdivisions
    assert found.rays[~edge].mean() < 2 + 0.5 * subdivisions


def test_section_3_textures_are_filtered_too():
    floor = Plane(WhittedMaterial(BLACK, ambient=None, highlight=BLACK))
    checked = replace(floor, material=WhittedMaterial(Checks(WHITE, BLACK, 0.25)))
    camera = facing([0, 1, 0], [0.3, 0, -2], 32, 24, 30)
    scene = Scene(DARKNESS, (checked,), lights=(EVEN,))
    fine = 32
    finer = Camera(32 * fine, 24 * fine, 30.0 * fine, camera.position, camera.rotation)
    area = POINTS.render(scene, finer).radiance.reshape(24, fine, 32, fine, 3).mean((1, 3))
    errors = [
        np.abs(Whitted(antialiasing=how, constellation=0).render(scene, camera).radiance - area)[8:].mean()
        for how in (None, Antialiasing(2), Antialiasing(4))
    ]
    assert errors[1] < 0.25 * errors[0] and errors[2] < 0.25 * errors[1]


@pytest.mark.parametrize("radius", [0.03, 0.2, 0.6])
def test_section_3_small_objects_are_not_lost(radius):
    # Pixels; between the corners of squares, where no ray of theirs goes.
    random, glow = np.random.default_rng(4), WhittedMaterial(ambient=WHITE)
    places = random.uniform(2, 14, (40, 2))
    camera = Camera(16, 16, 1000.0, np.zeros(3), np.eye(3))
    found = []
    for x, y in places:
        ball = Sphere(((x - 8) / 100, (8 - y) / 100, -10.0), radius / 100, glow)
        picture = Whitted(constellation=0).render(Scene(DARKNESS, objects=(ball,), lights=(EVEN,)), camera)
        found.append(picture.radiance[..., 0].sum())
    assert min(found) > 0
    np.testing.assert_allclose(np.mean(found), np.pi * radius**2, rtol=0.1)


# --- 4. Results ------------------------------------------------------------------------------------------------------


def test_section_4_figure_6_is_wrinkled_as_blinn_wrote():
    wrinkles = Wrinkles(0.01, 0.2, seed=3)
    ball = Sphere((0.0, 0.0, 0.0), 1.0, WhittedMaterial(grey(0.5), bumps=wrinkles))
    camera = Camera(40, 30, 90.0, np.array([0, 0, 5.0]), np.eye(3))
    found = POINTS.render(Scene(DARKNESS, objects=(ball,), lights=(DistantLight((0.0, 0, 1), UNIT),)), camera)
    shown = found.matte == 1
    points = camera.position + found.depth[shown][:, None] * camera.rays()[shown]
    nothing = np.zeros_like(points)
    normals = wrinkles.turned(normalised(points), points, nothing[:, :2], nothing, nothing)
    seen_well = np.sum(normals * -camera.rays()[shown], -1) > 0.05
    np.testing.assert_allclose(found.normal[shown][seen_well], normals[seen_well], atol=2e-5)
    np.testing.assert_allclose(
        found.radiance[shown][seen_well, 0], 0.5 * np.maximum(normals[seen_well, 2], 0), atol=2e-5
    )


def test_section_4_a_bump_map_turns_normals_as_elsewhere():
    random = np.random.default_rng(2)
    bumps = BumpMap(0.05 * random.random((6, 9)))
    floor = Plane(WhittedMaterial(grey(0.5), bumps=bumps), size=(2.0, 3.0))
    camera = facing([0.1, 3, 0.8], [0, 0, 0], 30, 30, 50)
    found = POINTS.render(Scene(DARKNESS, (floor,), lights=(EVEN,)), camera)
    on = found.depth > 0
    points = camera.position + found.depth[on][:, None] * camera.rays()[on]
    uv = np.column_stack([0.5 + points[:, 0] / 2, 0.5 - points[:, 2] / 3])
    u, v, n = (np.broadcast_to(d, points.shape) for d in ([2.0, 0, 0], [0, 0, -3.0], UP))
    # The depth is float32, and the slopes are 0.05 of a metre to a ninth of the surface.
    np.testing.assert_allclose(found.normal[on], bumps.turned(n, points, uv, u, v), atol=1e-4)


def test_section_4_figure_7_shows_the_floor_upside_down_in_the_ball():
    ball = Sphere((0.0, 1.0, 0.0), 0.8, WhittedMaterial(transmission=WHITE, ior=1.5))
    floor = Plane(WhittedMaterial(Checks((1, 1, 0), (1, 0, 0), 0.5)))
    scene = Scene(constant(8, (0.2, 0.3, 0.9)), (floor,), (ball,), (EVEN,))
    # Above its middle the ball shows the floor, which is yellow and red, and below it the blue sky.
    upper, lower = (seen(scene, [0, 1, 5], [0, slope, -1]) for slope in (0.08, -0.08))
    assert upper[2] == 0 and upper[0] == pytest.approx(1, rel=1e-6)
    np.testing.assert_allclose(lower, [0.2, 0.3, 0.9], rtol=1e-6)


def test_section_4_an_animated_sequence_needs_its_scene_made_ready_once():
    scene, method = mixture(5), Whitted(constellation=0)
    prepared = method.prepared(scene)
    for x in (-0.5, 0.5):
        camera = facing([x, 2, 4.5], [0, 0.4, 0], 24, 18, 26)
        np.testing.assert_array_equal(prepared.render(camera).radiance, method.render(scene, camera).radiance)


def test_section_4_the_map_lights_diffuse_surfaces_only_as_a_constellation():
    # The paper's model "does not provide for diffuse reflection from distributed light sources".
    scene = Scene(constant(32), (Plane(WhittedMaterial(grey(0.5)), (2.0, 2.0)),))
    assert np.all(seen(scene, [0, 1, 0], -UP) == 0)
    lit = seen(scene, [0, 1, 0], -UP, replace(POINTS, constellation=256))
    np.testing.assert_allclose(lit, 0.5, rtol=0.01)  # ρL


def test_whole_numbers_need_no_kernel_of_their_own():
    """Numba compiles for each type that it is called with; for the trees of rays that is 20 seconds."""
    scene = Scene(DARKNESS, (Plane(WhittedMaterial(grey(0.8))),), lights=(EVEN,))
    camera = eye([0, 1, 0], [0, -1, 0])
    methods = POINTS, replace(POINTS, contribution=0, attenuation=Linear(6))
    given = [method.prepared(scene).settings(camera, 0) for method in methods]
    assert [type(number) for number in given[0]] == [type(number) for number in given[1]]

"""Known truths of ray optics, through Whitted's renderer: rows A15, A17 and A21–A26 of the reliability note.

Directions and points are those of the nodes of a pixel's tree, radiances those of pictures of one pixel. What the model
leaves out: radiance inside glass, which physics scales by n² until it leaves (A25), and polarisation (A24).
"""

import numpy as np
import pytest
import trimesh

from angles import degrees_between
from lights import constant, of_directions
from relume.renderers.whitted.kernel_data import REFLECTED, REFRACTED
from relume.renderers.whitted.optics import fresnel, reflected, refracted
from relume.renderers.whitted.ray_tree import ray_tree
from relume.renderers.whitted.whitted import Whitted
from relume.scene.lights import PointLight
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Mesh, Plane, Sphere
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from solids import built
from solo_ray import eye

WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
UP = np.array([0.0, 1.0, 0.0])
SKY = constant(8)
ABOVE, BELOW = (of_directions(lambda d, s=side: (s * d[..., 1] > 0) * 1.0, 64) for side in (1, -1))
"""1 from one side of the horizon, 0 from the other."""
DEEP = Whitted(depth=400, contribution=0.0, antialiasing=None, constellation=0)


def clear(ior: float) -> WhittedMaterial:
    """Lets everything through, and bends it."""
    return WhittedMaterial(transmission=WHITE, ior=ior)


def glass(ior: float) -> WhittedMaterial:
    """Reflects and lets through by Fresnel's law, and loses nothing."""
    return WhittedMaterial(specular=WHITE, transmission=WHITE, ior=ior, fresnel=True)


def slab(material: WhittedMaterial, thickness: float = 1.0) -> Mesh:
    """So wide that no ray here reaches its edges; its lower side is at y = 0."""
    return built(trimesh.creation.box(bounds=[(-1000, 0, -1000), (1000, thickness, 1000)]), material)


def downwards(degrees: float) -> np.ndarray:
    """A direction at this angle to straight down."""
    return np.array([np.sin(np.radians(degrees)), -np.cos(np.radians(degrees)), 0.0])


def tree_of(shape, position, direction, method=DEEP):
    return ray_tree(method.prepared(Scene(SKY, objects=(shape,))), eye(position, direction), (0.5, 0.5))


def path(shape, position, direction) -> tuple[np.ndarray, np.ndarray]:
    """Where the transmitted rays begin and unit directions, one after the other, the eye's first."""
    tree = tree_of(shape, position, direction)
    return tree.start, normalised(tree.end - tree.start)


def seen(shape, light, position, direction, method=DEEP) -> float:
    """The radiance of one ray."""
    objects, local = ((shape,), ()) if not isinstance(shape, Plane) else ((), (shape,))
    return float(method.render(Scene(light, local, objects), eye(position, direction)).radiance[0, 0, 1])


# --- A21: Snell's law ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ior", "angle", "expected"),
    [
        (1.5, 30, 19.471221), (1.5, 45, 28.125506), (1.5, 60, 35.264390),
        (1.33, 30, 22.082413), (1.33, 45, 32.117631), (1.33, 60, 40.628131),
    ],
)  # fmt: skip
def test_a21_light_is_bent_by_snells_law_and_back(ior, angle, expected):
    _, directions = path(slab(clear(ior)), [0, 2, 0], downwards(angle))
    assert degrees_between(directions[1], -UP) == pytest.approx(expected, abs=6e-7)
    assert np.sin(np.radians(degrees_between(directions[1], -UP))) == pytest.approx(
        np.sin(np.radians(angle)) / ior, rel=1e-12
    )
    # In the plane of incidence, and out again as it came in.
    assert directions[1][2] == 0
    np.testing.assert_allclose(directions[2], downwards(angle), atol=1e-12)


def test_a21_reflection_leaves_at_the_angle_it_came_in_whatever_the_plane():
    random = np.random.default_rng(0)
    for _ in range(20):
        normal, incoming = normalised(random.normal(size=(2, 3)))
        normal = normal if normal @ incoming < 0 else -normal
        outgoing = np.array(reflected(tuple(incoming), tuple(normal)))
        np.testing.assert_allclose(outgoing, incoming - 2 * (incoming @ normal) * normal, atol=1e-13)
        under = np.array(refracted(tuple(incoming), tuple(normal), 1.4))
        np.testing.assert_allclose(np.cross(under, normal) * 1.4, np.cross(incoming, normal), atol=1e-13)
        assert under @ normal < 0 and np.linalg.norm(under) == pytest.approx(1, rel=1e-13)


# --- A22: total internal reflection, Brewster's angle ----------------------------------------------------------------


@pytest.mark.parametrize(("ior", "critical"), [(1.33, 48.7535), (1.5, 41.8103), (2.42, 24.4075)])
def test_a22_nothing_gets_out_beyond_the_critical_angle(ior, critical):
    exact = np.degrees(np.arcsin(1 / ior))
    assert exact == pytest.approx(critical, abs=6e-5)
    water = Plane(clear(ior))
    for angle, expected in ((exact - 1e-6, 1.0), (exact + 1e-6, 0.0)):
        # From below, where the index is turned round; T is assumed to be zero (§2).
        assert seen(water, SKY, [0, -1, 0], -downwards(angle)) == expected
        out = refracted(tuple(-downwards(angle)), (0.0, -1.0, 0.0), 1 / ior)
        assert (out == (0.0, 0.0, 0.0)) == (expected == 0)


@pytest.mark.parametrize("angle", [45.0, 60.0, 85.0])
def test_a22_with_fresnels_law_the_surface_is_a_perfect_mirror_beyond_the_critical_angle(angle):
    # Lit from below only: what a diver sees beyond Snell's window is the deep.
    assert seen(Plane(glass(1.5)), BELOW, [0, -1, 0], -downwards(angle)) == 1
    assert fresnel(float(np.cos(np.radians(angle))), 1 / 1.5) == 1


def test_a22_without_fresnels_law_total_reflection_keeps_k_s():
    surface = Plane(WhittedMaterial(specular=(0.3, 0.3, 0.3), transmission=(0.7, 0.7, 0.7)))
    assert seen(surface, BELOW, [0, -1, 0], -downwards(60)) == pytest.approx(0.3, rel=1e-6)


@pytest.mark.parametrize(("ior", "brewster"), [(1.33, 53.0612), (1.5, 56.3099), (2.42, 67.5485)])
def test_a22_at_brewsters_angle_one_polarisation_is_not_reflected(ior, brewster):
    exact = np.degrees(np.arctan(ior))
    assert exact == pytest.approx(brewster, abs=6e-5)
    tree = tree_of(slab(glass(ior)), [0, 2, 0], downwards(exact), Whitted(2, 0.0, antialiasing=None, constellation=0))
    directions = normalised(tree.end - tree.start)
    (back,), (through,) = directions[tree.kind == REFLECTED], directions[tree.kind == REFRACTED]
    assert back @ through == pytest.approx(0, abs=1e-12)
    # Half of the light, the one polarisation, by sin²(i − t); of the other nothing.
    half = 0.5 * ((ior**2 - 1) / (ior**2 + 1)) ** 2
    assert fresnel(float(np.cos(np.radians(exact))), ior) == pytest.approx(half, rel=1e-10)


# --- A23: Fresnel's law ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("ior", "angle", "expected"),
    [
        (1.33, 0, 0.020059), (1.5, 0, 0.04), (2, 0, 0.111111), (2.42, 0, 0.172395),
        (1.5, 30, 0.041523), (1.5, 45, 0.050240), (1.5, 60, 0.089187), (1.5, 75, 0.253061), (1.5, 85, 0.612800),
    ],
)  # fmt: skip
def test_a23_a_dielectric_reflects_by_fresnels_law(ior, angle, expected):
    varnish = Plane(WhittedMaterial(specular=WHITE, ior=ior, fresnel=True))
    assert seen(varnish, SKY, [0, 1, 0], downwards(angle + 1e-9)) == pytest.approx(expected, abs=6e-7)
    # Lit from below, through the surface, comes the rest.
    assert seen(Plane(glass(ior)), BELOW, [0, 1, 0], downwards(angle)) == pytest.approx(1 - expected, abs=1.2e-6)


@pytest.mark.parametrize("angle", [10.0, 60.0])
def test_a23_an_opaque_surface_reflects_alike_on_both_sides(angle):
    varnish = Plane(WhittedMaterial(specular=WHITE, ior=1.5, fresnel=True))
    above, below = (seen(varnish, SKY, [0, y, 0], y * downwards(angle)) for y in (1, -1))
    assert below == pytest.approx(above, rel=1e-6)


def test_a23_its_mean_over_directions_from_outside_and_inside():
    nodes, weights = np.polynomial.legendre.leggauss(200)
    share, weights = (nodes + 1) / 2, weights / 2

    def mean(ior: float) -> float:
        # Below the critical cosine all is reflected; from there the law rises like a root, which the square takes out.
        critical = np.sqrt(max(1 - ior**2, 0))
        cosines = critical + (1 - critical) * share**2
        steps = 2 * (1 - critical) * share * weights
        return critical**2 + sum(2 * c * w * fresnel(float(c), ior) for c, w in zip(cosines, steps, strict=True))

    assert mean(1.5) == pytest.approx(0.0917780, abs=1e-6)
    # What gets out is what gets in, by n² fewer directions: 1 − (1 − 0.0917780)/1.5². (The note has 0.5963819.)
    assert mean(1 / 1.5) == pytest.approx(0.5963458, abs=1e-6)


@pytest.mark.parametrize("angle", [0.0, 20.0, 50.0, 80.0])
def test_a23_is_the_same_from_either_side_of_one_ray(angle):
    inside = np.arcsin(np.sin(np.radians(angle)) / 1.5)
    outer, inner = fresnel(float(np.cos(np.radians(angle))), 1.5), fresnel(float(np.cos(inside)), 1 / 1.5)
    assert outer == pytest.approx(inner, rel=1e-12)


# --- A24: a slab of lossless glass -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("angle", "expected"), [(0, 0.0769231), (45, 0.0956732), (60, 0.1637675)])
def test_a24_a_slab_reflects_2r_over_1_plus_r(angle, expected):
    # R is the mean of both polarisations at every surface, as in any renderer of unpolarised light; where each is
    # followed for itself the slab reflects 0.0926557 at 45° and 0.1518716 at 60°.
    pane = slab(glass(1.5))
    assert seen(pane, ABOVE, [0, 2, 0], downwards(angle)) == pytest.approx(expected, abs=1e-6)
    assert seen(pane, BELOW, [0, 2, 0], downwards(angle)) == pytest.approx(1 - expected, abs=1e-6)


def test_a24_truncated_trees_lose_what_their_missing_branches_carry():
    # R + R(1 − R)² with one reflection at the other side, and so on: a factor R² less for each pair of nodes more.
    r = 0.04
    for depth, expected in ((1, 0), (2, r), (3, r), (4, r + r * (1 - r) ** 2), (6, r + r * (1 - r) ** 2 * (1 + r**2))):
        method = Whitted(depth, 0.0, antialiasing=None, constellation=0)
        assert seen(slab(glass(1.5)), ABOVE, [0, 2, 0], -UP, method) == pytest.approx(expected, rel=1e-6, abs=1e-9)


# --- A25, A26: shapes of glass ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("angle", "expected"), [(30, 0.193814), (45, 0.329142), (60, 0.512472)])
def test_a25_a_slab_shifts_rays_and_does_not_turn_them(angle, expected):
    begins, directions = path(slab(clear(1.5)), [0, 2, 0], downwards(angle))
    assert len(begins) == 3
    shift = np.linalg.norm(np.cross(begins[2] - begins[0], directions[2]))
    assert shift == pytest.approx(expected, abs=6e-7)
    i, t = np.radians(angle), np.arcsin(np.sin(np.radians(angle)) / 1.5)
    assert shift == pytest.approx(np.sin(i) * (1 - np.cos(i) / (1.5 * np.cos(t))), rel=1e-12)
    np.testing.assert_allclose(directions[2], directions[0], atol=1e-12)


def test_a25_radiance_in_glass_is_not_scaled_by_the_square_of_its_index():
    # The paper's T is what comes out on the other side, times k_t; the n² of physics is gone again behind the glass.
    tree = tree_of(slab(clear(1.5)), [0, 2, 0], downwards(30))
    np.testing.assert_allclose(tree.intensity, 1, rtol=1e-6)


@pytest.mark.parametrize("height", [1e-4, 0.1, 0.3, 0.6])
def test_a26_a_ball_lens_brings_rays_to_its_focus(height):
    begins, directions = path(Sphere((0.0, 0.0, 0.0), 1.0, clear(1.5)), [0, height, 5], [0, 0, -1])
    assert len(begins) == 3
    # Where the last ray meets the axis. It is turned by twice i − t, and as far from the centre as the first.
    along = begins[2] - begins[2][1] / directions[2][1] * directions[2]
    i, t = np.arcsin(height), np.arcsin(height / 1.5)
    assert -along[2] == pytest.approx(height / np.sin(2 * (i - t)), rel=1e-10)
    if height < 1e-3:
        assert -along[2] == pytest.approx(1.5, rel=1e-6)  # nR/2(n−1)


def test_a26_through_a_lens_the_world_is_upside_down():
    # Brighter upwards; the lens of a glass ball turns that round, within the cone that its focus gathers.
    ramp = np.linspace(2, 0, 64, dtype=np.float32)[:, None, None] * np.ones((64, 128, 3), np.float32)
    ball = Sphere((0.0, 0.0, 0.0), 1.0, clear(1.5))
    low, high = (seen(ball, EnvironmentMap(ramp), [0, h, 5], [0, 0, -1]) for h in (-0.5, 0.5))
    assert low > 1.2 and high < 0.8


@pytest.mark.parametrize(("ior", "turned"), [(1.5, True), (1.33, False)])
def test_a22_a_prism_of_glass_turns_light_round_a_corner_and_one_of_water_does_not(ior, turned):
    # A right angle at the origin; the long side faces −x −y and is met at 45°, beyond the critical angle of 41.8°.
    corners = np.array([[0, 0, z] for z in (-1, 1)] + [[-1, 0, z] for z in (-1, 1)] + [[0, -1, z] for z in (-1, 1)])
    hull = trimesh.convex.convex_hull(corners)
    prism = built(hull, glass(ior))
    sky = np.zeros((64, 128, 3), np.float32)
    sky[:, :] = [1, 0, 1]
    sky[26:38, 90:102, 1] = 1  # green from +x
    lit = seen(prism, EnvironmentMap(sky), [-0.4, 2, 0.1], -UP)
    # In and out through the short sides along the normal, 0.96 each, and the echoes between them.
    assert lit == pytest.approx(0.9230769, abs=1e-5) if turned else lit < 0.2


# --- A15, A17: light itself ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("height", "across"), [(1.0, 0.0), (2.0, 0.0), (2.0, 1.5), (0.5, 3.0)])
def test_a15_a_point_of_light_falls_with_the_cosine_and_the_square_of_distance(height, across):
    lamp = PointLight((across, height, 0.0), (np.pi, np.pi, np.pi))
    scene = Scene(constant(8, 0.0), (Plane(WhittedMaterial((0.5, 0.5, 0.5))),), lights=(lamp,))
    found = DEEP.render(scene, eye([0, 1, 0], -UP)).radiance[0, 0, 1]
    distance = np.hypot(height, across)
    assert found == pytest.approx(0.5 * height / distance**3, rel=1e-6)


@pytest.mark.parametrize("ior", [1.33, 1.5, 2.42])
@pytest.mark.parametrize("height", [0.0, 0.3, 0.7, 0.9])
def test_a17_lossless_glass_and_mirrors_vanish_in_even_light(ior, height):
    for material in (glass(ior), clear(ior), WhittedMaterial(specular=WHITE)):
        ball = Sphere((0.0, 0.0, 0.0), 1.0, material)
        assert seen(ball, SKY, [0, height, 5], [0, 0, -1]) == pytest.approx(1, rel=2e-6)

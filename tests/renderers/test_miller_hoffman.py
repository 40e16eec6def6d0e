"""Miller & Hoffman (1984), "Illumination and Reflection Maps", section by section: the paper's words as tests."""

import numpy as np
import pytest

import naive
import solids
from lights import constant, of_directions, spiky, spread, sunny
from quads import around, filtered, supersampled
from relume.light.reflection.brdf import GGX, PhongReflectance
from relume.light.reflection.lobes import VARNISH, Lambert, Mirror, Phong, SelfLuminous
from relume.light.reflection.reflection_map import Normalisation, reflection_map
from relume.light.reflection.weights import Complement, Even, Fresnel, Schlick
from relume.renderers.prefiltered.filters import Mip, Plain, Preintegrated, Quadrilateral, Subdivision
from relume.renderers.prefiltered.prefiltered import Prefiltered, Shading
from relume.renderers.prefiltered.shading_inputs import GBuffer
from relume.scene.cameras.camera import Camera
from relume.scene.materials.reflective import Layer, Reflective, Towards, glass, glossy, mirror, retroreflector
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Sphere
from relume.sphere.directions import normalised, rotation_about
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import Strip, face_solid_angles
from relume.sphere.mappings.discs import MirrorBall
from relume.sphere.mappings.mapping import LatLong, pixel_directions, pixel_points


def surfaces(count=400, seed=0, least=0.05):
    """Normals N and directions E to the eye on the side they can be seen from, each (count, 3)."""
    random = np.random.default_rng(seed)
    normals, sideways = spread(count, seed), spread(count, seed + 1)
    sideways = normalised(sideways - np.sum(sideways * normals, -1, keepdims=True) * normals)
    cosine = random.uniform(least, 1, (count, 1))
    return normals, cosine * normals + np.sqrt(1 - cosine**2) * sideways


def shaded(material, light, normals, eyes, filter=Plain()):
    """The intensities (N, 3) that the renderer gives these surfaces."""
    buffer = GBuffer(normals[None], eyes[None], np.zeros((1, len(normals)), int))
    return Shading.of([material], light, filter).shade(buffer)[0]


def dot(a, b):
    return np.sum(a * b, axis=-1, keepdims=True)


def weight_of(weight, cosine):
    """W(E·N) as a column for each channel."""
    values = weight(cosine[:, 0])
    return values if values.ndim == 2 else values[:, None]


# --- 3. shading by reflection maps -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("w_d", "w_s"),
    [
        (Even(1.0), Even(0.3)),
        (Even((0.2, 0.4, 0.8)), Even((0.9, 0.6, 0.3))),
        (Complement(Schlick(0.04)), Schlick(0.04)),
        (Complement(Fresnel(1.5)), Fresnel(1.5)),
        (Even(0.0), Schlick((0.9, 0.6, 0.3))),
    ],
    ids=["constants", "coloured", "Schlick", "Fresnel", "a metal"],
)
def test_section_3_line_9_adds_the_weighted_look_ups_of_N_and_R(w_d, w_s):
    light, (N, E) = spiky(32), surfaces()
    D, S = reflection_map(light, Lambert()), reflection_map(light, Phong(20))
    R = 2 * dot(E, N) * N - E
    intensity = weight_of(w_d, dot(E, N)) * D.lookup(N) + weight_of(w_s, dot(E, N)) * S.lookup(R)
    layers = (Layer(Lambert(), Towards.NORMAL, w_d), Layer(Phong(20), Towards.REFLECTED, w_s))
    # Directions become indices to 4e-7 rad, weights are tabulated at a thousand cosines.
    np.testing.assert_allclose(shaded(Reflective(layers), light, N, E), intensity, rtol=2e-4, atol=1e-4)


def test_section_3_the_reflected_direction_is_the_eyes_mirrored_at_the_normal():
    # Lines 6 to 8, seen in a mirror of a light that says its direction.
    N, E = surfaces()
    found = []
    for axis in np.eye(3):
        light = of_directions(lambda d, axis=axis: 1.5 + d @ axis, 512)
        found.append(shaded(mirror(), light, N, E)[:, 0] - 1.5)
    found = np.stack(found, -1)
    np.testing.assert_allclose(dot(found, N), dot(E, N), atol=2e-4)  # as steep
    np.testing.assert_allclose(np.cross(found, N), -np.cross(E, N), atol=2e-4)  # to the other side, in the same plane


def test_section_3_the_object_may_turn_about_itself_and_the_camera_is_free_to_move():
    # Lines 4 to 9 for two frames: what a ball shows depends on where the camera is, not on how the ball was turned.
    light = sunny(64)
    prepared = Prefiltered(Plain()).prepared(Scene(light, objects=(Sphere((0, 0, 0), 1.0, glossy((0.3, 0.2, 0.1))),)))
    cameras = [
        Camera.looking_at(np.array(p), np.zeros(3), width=32, height=32, focal_length=100)
        for p in ((0, 1, 6), (6, 2, 1))
    ]
    first, second = (prepared.render(camera).radiance for camera in cameras)
    assert np.abs(first - second).max() > 0.1
    turned = prepared.render(cameras[0], turn=rotation_about([1, 2, 3], 1.0)).radiance
    np.testing.assert_allclose(turned, first, rtol=2e-3, atol=2e-3)


# --- 4. data representation and spherical mappings -------------------------------------------------------------------


def test_section_4_1_the_area_of_a_cubes_sample_falls_towards_its_corners():
    # The paper says 1 + u² + v² = 1/z²; the solid angle itself goes as its power 3/2 (A31).
    size = 64
    v, u = np.meshgrid(*[(np.arange(size) + 0.5) / size * 2 - 1] * 2, indexing="ij")
    np.testing.assert_allclose(face_solid_angles(size) * (1 + u**2 + v**2) ** 1.5 * (size / 2) ** 2, 1, rtol=3e-4)
    assert 6 * face_solid_angles(size).sum() == pytest.approx(4 * np.pi, rel=1e-12)


def test_section_4_2_the_normal_of_a_mirrored_sphere_is_projected_onto_its_photograph():
    # u = x and v = y of the normal, seen from far away on +Z.
    R = spread(500)
    R = R[R[:, 2] > -0.99]
    N = normalised(R + np.array([0, 0, 1]))
    np.testing.assert_allclose(MirrorBall().image_points(R), 0.5 + N[:, :2] * [0.5, -0.5], atol=1e-9)


def test_section_4_3_polar_coordinates_are_longitude_and_latitude():
    directions = spread(500)
    u, v = np.moveaxis(LatLong().image_points(directions), -1, 0)
    np.testing.assert_allclose(v * np.pi, np.arccos(directions[:, 1]), atol=1e-12)  # arccos y
    # The paper's longitude arctan(x, z) grows from +Z; ours has −Z in the middle and grows to the right, seen from
    # inside: half a turn less the paper's.
    paper = np.arctan2(directions[:, 0], directions[:, 2])
    ours = 2 * np.pi * (u - 0.5)
    np.testing.assert_allclose(np.exp(1j * ours), np.exp(1j * (np.pi - paper)), atol=1e-9)


def test_section_4_3_the_area_of_a_sample_is_proportional_to_the_sine_of_its_latitude():
    rows = 128
    v = np.pi * (np.arange(rows) + 0.5) / rows
    areas = LatLong().solid_angles(rows)
    assert areas.sum() == pytest.approx(4 * np.pi, rel=1e-12)
    np.testing.assert_allclose(areas / np.sin(v)[:, None], (np.pi / rows) ** 2, rtol=1e-4)


@pytest.mark.parametrize("towards", [Towards.NORMAL, Towards.REFLECTED, Towards.VIEWER])
@pytest.mark.parametrize("path", ["over the poles", "round the seam", "near a pole"])
def test_section_4_3_adjacent_directions_are_adjacent_indices_over_seam_and_poles(path, towards):
    # Half a step on: at a pole itself every longitude is right.
    turn = (np.linspace(0, 2 * np.pi, 8001) + np.pi / 8000)[:, None]
    start, other = {
        "over the poles": ([0, 1, 0], [0.3, 0, 0.95]),
        "round the seam": ([0, 0, 1], [1, 0, 0]),
        "near a pole": ([0.02, 1, 0], [0, 0.002, 1]),
    }[path]
    start = normalised(start)
    other = normalised(np.array(other) - np.dot(other, start) * start)
    directions = np.cos(turn) * start + np.sin(turn) * other
    light = spiky(16)
    seen = shaded(Reflective((Layer(Mirror(), towards),)), light, directions, directions)
    np.testing.assert_allclose(seen, light.lookup(directions), rtol=1e-3, atol=1e-3)
    # Steps of a thousandth of a radian, or of a twenty-fifth round the pole, in entries of a fifth.
    allowed = 0.12 if path == "near a pole" else 0.03
    assert np.abs(np.diff(seen, axis=0)).max() < allowed * light.radiance.max()


# --- 5. creating the illumination map --------------------------------------------------------------------------------


def test_section_5_1_a_photograph_of_a_mirrored_sphere_is_the_environment():
    light = of_directions(lambda d: 2 + d @ [0.5, 1, 0.3] + (d @ [0.6, 0, 0.8]) ** 3, 256)
    size, distance = 256, 1e4
    # "A moderately long focal length lens should be used to minimize the effects of perspective."
    camera = Camera(size, size, size / 2 * distance, np.array([0, 0, distance]), np.eye(3))
    ball = Sphere((0.0, 0.0, 0.0), 1.0, mirror())
    photograph = Prefiltered(background=False).render(Scene(light, objects=(ball,)), camera)
    found = EnvironmentMap(photograph.radiance, MirrorBall())
    directions = spread(500)
    directions = directions[directions[:, 2] > -0.9]  # "there can be much distortion near the edges"
    np.testing.assert_allclose(found.lookup(directions), light.lookup(directions), rtol=0.01)


def test_section_5_2_six_views_of_a_luminous_patch_light_a_surface_as_the_patch_does():
    # A lamp of 2 m × 2 m, 1 m above: A13, form factor 0.5541264. Six pictures on the faces of a cube.
    glowing = Reflective((Layer(SelfLuminous(), Towards.NORMAL, Even(5.0)),))
    lamp = solids.quad([[-1, 1, -1], [1, 1, -1], [1, 1, 1], [-1, 1, 1]], glowing)
    prepared = Prefiltered(background=False).prepared(Scene(constant(64), objects=(lamp,)))
    size = 64
    middles = np.split(pixel_directions(Strip(), size), 6, axis=1)
    faces = np.empty((6, size, size, 3), np.float32)
    for face, forward in enumerate(np.repeat(np.eye(3), 2, axis=0) * np.array([1, -1] * 3)[:, None]):
        up = np.array([0, 0, 1]) if forward[1] else np.array([0, 1, 0])
        rotation = np.stack([np.cross(forward, up), up, -forward], axis=1)
        camera = Camera(size, size, size / 2, np.zeros(3), rotation)
        picture = prepared.render(camera).radiance
        column, row = np.moveaxis(camera.project(middles[face]), -1, 0)
        faces[face] = picture[row.astype(int), column.astype(int)]
    directions = LatLong().directions(pixel_points(LatLong(), 128))
    strip = EnvironmentMap(np.concatenate(list(faces), axis=1), Strip())
    light = EnvironmentMap(strip.lookup(directions).astype(np.float32))
    D = reflection_map(light, Lambert(), 64)
    assert D.lookup(np.array([0.0, 1, 0]))[0] == pytest.approx(5 * 0.5541264, rel=0.01)
    assert D.lookup(np.array([0.0, -1, 0]))[0] == pytest.approx(0, abs=1e-3)
    # S: ∫ (n+1)/2π cosⁿθ over the patch, dω = dA cos θ / r².
    place = (np.arange(400) + 0.5) / 200 - 1
    x, z = np.meshgrid(place, place)
    cosine = 1 / np.sqrt(1 + x**2 + z**2)
    for n in (1, 10, 50):
        expected = 5 * np.mean((n + 1) / (2 * np.pi) * cosine ** (n + 3)) * 4
        S = reflection_map(light, Phong(n))
        assert S.lookup(np.array([0.0, 1, 0]))[0] == pytest.approx(expected, rel=0.01)


def test_section_5_2_a_point_source_adds_its_energy_over_the_square_of_its_distance():
    # "For each point source, determine its direction and add the energy divided by distance squared."
    rows, row, column, energy, distance = 64, 20, 75, 30.0, 2.5
    radiance = np.zeros((rows, 2 * rows, 3), np.float32)
    radiance[row, column] += energy / distance**2 / LatLong().solid_angles(rows)[row, column]
    light = EnvironmentMap(radiance)
    L = LatLong().directions(np.array([(column + 0.5) / (2 * rows), (row + 0.5) / rows]))
    N = spread(300)
    cosine = np.maximum(N @ L, 0)
    D = reflection_map(light, Lambert(), 128)
    np.testing.assert_allclose(
        D.lookup(N)[:, 0], energy / distance**2 * cosine / np.pi, atol=6e-3
    )  # A15; bilinear over the kink at 0
    S = reflection_map(light, Phong(20), 256)
    expected = energy / distance**2 * 21 / (2 * np.pi) * cosine**20
    np.testing.assert_allclose(S.lookup(N)[:, 0], expected, atol=2e-3 * expected.max())


# --- 6. convolution --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("lobe", "f"),
    [
        (Lambert(0.7), lambda x: 0.7 * x * (x > 0)),
        (SelfLuminous(0.7), lambda x: 0.7 + 0 * x),
        (Phong(6, 0.7), lambda x: 0.7 * np.maximum(x, 0) ** 6),
    ],
    ids=["6.1 Lambert", "6.1 self-luminous", "6.2 Phong"],
)
def test_section_6_a_table_is_the_sum_of_light_times_area_times_f_over_4_pi(lobe, f):
    light = spiky(16)
    expected = naive.reflection_sums(light.radiance, f, 9) / (4 * np.pi)
    found = reflection_map(light, lobe, 9, Normalisation.PAPER).table
    np.testing.assert_allclose(found, expected, rtol=1e-3)


def test_section_6_1_the_lambert_table_of_36_by_72_is_adequate():
    light, N = sunny(128), spread(2000)
    truth = reflection_map(light, Lambert(), 512).lookup(N)
    assert reflection_map(light, Lambert()).table.shape == (36, 72, 3)
    found = shaded(Reflective((Layer(Lambert(), Towards.NORMAL),)), light, N, N)
    assert np.abs(found - truth).max() < 5e-3 * truth.max()


def test_section_6_2_varnish_adds_half_of_the_mirrors_map():
    light, (N, E) = sunny(32), surfaces(100)
    coat, plain, chrome = (
        shaded(Reflective((Layer(lobe),)), light, N, E) for lobe in (Phong(8, varnish=VARNISH), Phong(8), Mirror())
    )
    np.testing.assert_allclose(coat, plain + 0.5 * chrome, rtol=0.01, atol=0.01)


# --- 7. intensity calculation ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("weight", "degrees", "expected"),
    [
        (Schlick(0.04), [0, 60, 80], [0.04, 0.04 + 0.96 * 0.5**5, 0.04 + 0.96 * (1 - np.cos(np.radians(80))) ** 5]),
        (Fresnel(1.5), [0, 30, 45, 60, 75, 85], [0.04, 0.041523, 0.050240, 0.089187, 0.253061, 0.612800]),  # A23
        (Even(0.37), [0, 60, 80], [0.37, 0.37, 0.37]),
    ],
    ids=["Schlick", "Fresnel", "constant"],
)
def test_section_7_surfaces_are_more_specular_at_low_viewing_angles_as_W_says(weight, degrees, expected):
    angles = np.radians(degrees)
    N = np.broadcast_to([0.0, 1, 0], (len(angles), 3))
    E = np.stack([np.sin(angles), np.cos(angles), 0 * angles], -1)
    # A mirror under constant light of 1 shows W_s; W_d takes what it leaves.
    seen = shaded(Reflective((Layer(Mirror(), weight=weight),)), constant(8), N, E)
    np.testing.assert_allclose(seen[:, 0], expected, rtol=1e-4)
    whole = shaded(glossy((1, 1, 1), Mirror(), specular_weight=weight), constant(128), N, E)
    np.testing.assert_allclose(whole, 1, rtol=1e-4)


def test_section_7_1_bilinear_interpolation_takes_away_the_quantisation():
    light, (N, E) = sunny(64), surfaces(3000)
    truth = reflection_map(light, Phong(8), 512).lookup(2 * dot(E, N) * N - E)
    coarse = reflection_map(light, Phong(8), 32)
    points = LatLong().image_points(2 * dot(E, N) * N - E)
    nearest = coarse.table[(points[:, 1] * 32).astype(int), (points[:, 0] * 64).astype(int)]
    table = EnvironmentMap(coarse.table)
    bilinear = shaded(mirror(), table, N, E)  # a mirror's map is the map it is given
    scale = truth.mean()
    assert np.abs(nearest - truth).mean() > 0.02 * scale
    assert np.abs(bilinear - truth).mean() < 0.1 * np.abs(nearest - truth).mean()


# --- 8. antialiasing -------------------------------------------------------------------------------------------------


def test_section_8_1_corners_on_the_same_or_adjacent_entries_give_their_average():
    light, quads = spiky(32), around(spread(200), 0.09)  # an entry is 0.098 wide
    expected = light.lookup(quads).mean(1)
    np.testing.assert_allclose(filtered(Subdivision(), light, quads), expected, rtol=1e-3, atol=1e-3)


def test_section_8_1_recursive_subdivision_is_a_box_filter():
    light = spiky(32)
    for width in (0.4, 1.0):
        quads = around(spread(200), width, 0.5 * width, 0.3)
        truth = supersampled(light, quads, 64)
        error = np.abs(filtered(Subdivision(), light, quads) - truth).mean()
        assert error < 0.03 * truth.mean()
        assert np.abs(filtered(Plain(), light, quads) - truth).mean() > 10 * error


def test_section_8_2_the_area_spanned_by_the_reflected_corners_is_averaged():
    # Truth: the mean over the entries whose direction lies on the inner side of all four edges.
    light = spiky(64)
    quads = around(normalised(spread(100) * [1, 0.3, 1]), 0.5, 0.3, 0.4)
    directions, flux = naive.latlong_pixels(light.radiance)
    areas = LatLong().solid_angles(64).reshape(-1)
    seen = filtered(Quadrilateral(), light, quads)
    expected = np.empty_like(seen)
    for i, quad in enumerate(quads):
        sides = directions @ np.cross(quad, np.roll(quad, -1, axis=0)).T
        inside = np.all(sides > 0, axis=1) | (np.all(sides < 0, axis=1) & (directions @ quad.mean(0) > 0))
        expected[i] = flux[inside].sum(0) / areas[inside].sum()
    # Its edges are straight in the table, not on the sphere: entries at the rim differ.
    assert np.abs(seen - expected).mean() < 0.05 * expected.mean()
    assert seen.mean() == pytest.approx(expected.mean(), rel=5e-3)


def test_section_8_3_the_pre_integrated_table_holds_sums_whose_differences_are_rectangles():
    light = spiky(16)
    sums = Preintegrated().prepared(light.radiance).sums
    flux = light.radiance * LatLong().solid_angles(16)[..., None]
    np.testing.assert_allclose(sums[-1, -1], flux.sum((0, 1)), rtol=1e-6)
    top, bottom, left, right = 3, 9, 20, 27
    inside = sums[bottom, right] - sums[top, right] - sums[bottom, left] + sums[top, left]
    np.testing.assert_allclose(inside, flux[top:bottom, left:right].sum((0, 1)), rtol=1e-6)
    assert sums.dtype == np.float64  # "the highest value times the number of pixels in the map"


def test_section_8_3_a_rectangle_blurs_less_than_a_prefiltered_map():
    # A pixel eight times as long as high is its rectangle; MIP takes a square of its longer side.
    light, middles = spiky(128), normalised(spread(400) * [1, 0.2, 1])
    # Level, so that the rectangle is the pixel.
    east = normalised(np.cross([0, 1, 0], middles))
    right, down = 0.2 * east, -0.025 * np.cross(middles, east)
    corners = [middles + a * right + b * down for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    quads = normalised(np.stack(corners, axis=1))
    truth = supersampled(light, quads)
    errors = [np.abs(filtered(f, light, quads) - truth).mean() for f in (Preintegrated(), Mip())]
    assert errors[0] < 0.5 * errors[1]


# --- 9. generalising the reflection table ----------------------------------------------------------------------------


def test_section_9_retro_reflection_is_looked_up_by_the_viewing_direction():
    light, (N, E) = spiky(32), surfaces()
    seen = shaded(retroreflector((0.9, 0.5, 0.1), Phong(30)), light, N, E)
    expected = reflection_map(light, Phong(30)).lookup(E) * [0.9, 0.5, 0.1]
    np.testing.assert_allclose(seen, expected, rtol=2e-4, atol=1e-4)
    # The normal does not matter.
    np.testing.assert_allclose(shaded(retroreflector((0.9, 0.5, 0.1), Phong(30)), light, E, E), seen, rtol=1e-5)


@pytest.mark.parametrize(
    ("ior", "angles"),
    [
        (1.5, {30: 19.471221, 45: 28.125506, 60: 35.264390}),  # A21
        (1.33, {30: 22.082413, 45: 32.117631, 60: 40.628131}),
        (0.8, {30: 38.682187, 45: 62.114498}),  # asin(sin i / 0.8)
        (1.0, {30: 30.0, 60: 60.0}),
    ],
)
def test_section_9_refraction_is_looked_up_by_snells_direction(ior, angles):
    incidence, bent = np.radians(list(angles)), np.radians(list(angles.values()))
    E = np.stack([np.sin(incidence), np.cos(incidence), 0 * incidence], -1)
    N = np.broadcast_to([0.0, 1, 0], E.shape)
    # On through the surface, to the side away from the eye.
    onward = np.stack([-np.sin(bent), -np.cos(bent), 0 * bent], -1)
    light = spiky(64)
    through = Reflective((Layer(Mirror(), Towards.REFRACTED, ior=ior),))
    for turn in (np.eye(3), rotation_about([1, 2, 3], 1.1)):
        seen = shaded(through, light, N @ turn.T, E @ turn.T)
        np.testing.assert_allclose(seen, light.lookup(onward @ turn.T), rtol=1e-3, atol=1e-3)


def test_section_9_beyond_the_critical_angle_all_light_is_reflected():
    # From within glass: ior = 1/1.5, critical at 41.8103° (A22).
    angles = np.radians([42.0, 60.0, 85.0])
    E = np.stack([np.sin(angles), np.cos(angles), 0 * angles], -1)
    N = np.broadcast_to([0.0, 1, 0], E.shape)
    light = spiky(64)
    R = E * [-1, 1, 1]
    within = 1 / 1.5
    for material in (Reflective((Layer(Mirror(), Towards.REFRACTED, ior=within),)), glass(within)):
        np.testing.assert_allclose(shaded(material, light, N, E), light.lookup(R), rtol=2e-3, atol=1e-3)
    # Up to it, light still comes from the other side.
    E = np.array([[np.sin(np.radians(angle)), np.cos(np.radians(angle)), 0] for angle in (40.0, 43.0)])
    below = of_directions(lambda d: (d[..., 1] < 0).astype(float), 64)
    before, after = shaded(glass(within), below, N[:2], E)[:, 0]
    assert before == pytest.approx(1 - Fresnel(within)(np.cos(np.radians(40.0))), rel=1e-3)
    assert after < 1e-3


@pytest.mark.parametrize("brdf", [GGX(0.4), PhongReflectance(30)], ids=["GGX", "Phong"])
def test_section_9_the_three_dimensional_map_gives_what_a_brdf_reflects_to_every_eye(brdf):
    light, (N, E) = sunny(48), surfaces(20, least=0.1)
    directions, flux = naive.latlong_pixels(light.radiance)
    slow = naive.ggx if isinstance(brdf, GGX) else naive.phong
    width = brdf.alpha if isinstance(brdf, GGX) else brdf.n
    expected = np.empty((len(N), 3))
    for i in range(len(N)):
        expected[i] = np.array([slow(width, N[i], E[i], L) for L in directions]) @ flux
    seen = shaded(Reflective((Layer(brdf),)), light, N, E)
    assert np.abs(seen - expected).mean() < 0.01 * expected.mean()
    # The two-dimensional map, by R alone, does not know the eye.
    flat = shaded(Reflective((Layer(Phong(30)),)), light, N, E) if isinstance(brdf, PhongReflectance) else None
    if flat is not None:
        assert np.abs(flat - expected).mean() > 5 * np.abs(seen - expected).mean()

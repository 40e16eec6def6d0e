"""The gloss of a surface from two views: a table of known gloss, and a probe that saw it, give it back."""

from dataclasses import replace

import numpy as np
import pytest

from relume.composite.surface import projection
from relume.composite.surface.gloss import FittedGloss, Gloss, fit_gloss, glossy
from relume.composite.surface.projection import box_mesh, shining
from relume.composite.surface.recovery import Recovery
from relume.composite.surface.reflectance import recover_reflectance
from relume.composite.surface.two_views import ViewOfProbe, common_points
from relume.image.radiance import RadianceMap
from relume.renderers.mitsuba.lobes import Arriving, arriving, ready
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Box, Scene
from relume.scene.shapes.shapes import Mesh, Plane
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

WIDTH, HEIGHT = 96, 64
CAMERA = Camera.looking_at(
    np.array([0.25, 0.55, 1.15]), np.zeros(3), width=WIDTH, height=HEIGHT, focal_length=110.0
)  # fmt: skip
TABLE = Plane(Diffuse((0.5, 0.5, 0.5)), (1.7, 1.0))
ROOM = Box((-2.5, -0.75, -2.0), (2.5, 1.95, 2.0))
PROBE = (0.0, 0.05, 0.0)
TRUE = Gloss(0.05, 0.35)
ROWS = 64
VIEW = ViewOfProbe(np.ones((ROWS, 2 * ROWS), np.float32), 0.05)
USABLE = np.zeros((HEIGHT, WIDTH), bool)
USABLE[2:-2, 2:-2] = True
PATTERN = np.where(np.random.default_rng(3).random((10, 17, 1)) < 0.5, [0.5, 0.3, 0.2], [0.35, 0.22, 0.15])
"""Of the table: two albedos in squares of 10 cm."""


def surroundings() -> np.ndarray:
    """A room with a window to the left and behind the probe."""
    directions = pixel_directions(LatLong(), ROWS)
    light = 0.5 + 0.3 * directions[..., :1] * [0.5, 0.2, -0.3] + 0.2 * directions[..., 1:2]
    window = (directions[..., 0] < -0.5) & (np.abs(directions[..., 1] - 0.3) < 0.15) & (directions[..., 2] < 0.4)
    return np.where(window[..., None], [6.0, 7.0, 9.0], light).astype(np.float32)


def on_table(place: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays (N, 3) meet the table, and which do."""
    with np.errstate(divide="ignore", invalid="ignore"):
        points = place + (-place[1] / rays[:, 1])[:, None] * rays
    met = (rays[:, 1] < 0) & (np.abs(points[:, 0]) < 0.85) & (np.abs(points[:, 2]) < 0.5)
    return points[met], met


def sent(points: np.ndarray, place: np.ndarray, real: Scene, seeds: range) -> np.ndarray:
    """What points of the true table send to a place: sums over drawn directions, with little noise."""
    normals = np.broadcast_to([0.0, 1.0, 0.0], points.shape)
    scene = ready(real)
    drawn = [arriving(scene, points, normals, place, seed=seed) for seed in seeds]
    gloss, base = np.mean([light.gloss_and_base(glossy((1.0, 1.0, 1.0), TRUE)) for light in drawn], axis=0)
    row, column = ((points[:, 2] + 0.5) * 10).astype(int), ((points[:, 0] / 1.7 + 0.5) * 17).astype(int)
    return gloss + PATTERN[row, column] * base


@pytest.fixture(scope="module")
def taken() -> tuple[RadianceMap, Scene]:
    return taken_in(ROOM)


def taken_in(room: Box) -> tuple[RadianceMap, Scene]:
    """The photograph, and the scene whose light shows the table below the horizon as a probe would see it.

    room : what there is really; the scene takes it for `ROOM`
    """
    light = surroundings()
    real = Scene(EnvironmentMap(light), (TABLE,), distant=room, probe=PROBE)
    plate = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
    points, met = on_table(np.array(CAMERA.position), CAMERA.rays().reshape(-1, 3))
    plate.reshape(-1, 3)[met] = sent(points, np.array(CAMERA.position), real, range(100, 101))
    seen = light.copy()
    # Steeper than 22° below the horizon lies what is not compared: 0.12 m round the foot of the ball.
    directions = pixel_directions(LatLong(), ROWS)[:40]
    points, met = on_table(np.array(PROBE), directions.reshape(-1, 3))
    seen[:40].reshape(-1, 3)[met] = sent(points, np.array(PROBE), real, range(200, 206))
    return RadianceMap(plate), Scene(EnvironmentMap(seen), (TABLE,), distant=ROOM, probe=PROBE)


def test_two_views_give_the_gloss_back_within_its_error(taken):
    plate, scene = taken
    found = fit_gloss(plate, CAMERA, scene, 0, USABLE, VIEW)
    assert found.views == 2 and found.points > 200 and found.notes == ()
    assert_true_within(found)


def assert_true_within(found: FittedGloss, errors: float = 2.5) -> None:
    assert abs(found.gloss.f0 - TRUE.f0) < errors * found.f0_error
    assert abs(found.gloss.roughness - TRUE.roughness) < errors * found.roughness_error
    # A light that is known to 3 % as a whole is worth 0.012 of F₀ here, however well the pictures agree.
    assert found.f0_error < 0.015 and found.roughness_error < 0.02


def test_a_window_nearer_than_the_model_has_it_makes_the_errors_wide():
    """It is mirrored elsewhere than foreseen. Believed, its mirror image is 0.05 of roughness off, 3.6 errors."""
    plate, scene = taken_in(Box((-0.95, *ROOM.low[1:]), ROOM.high))
    found = fit_gloss(plate, CAMERA, scene, 0, USABLE, VIEW)
    assert found.views == 2
    assert abs(found.gloss.f0 - TRUE.f0) < 2.5 * found.f0_error
    assert abs(found.gloss.roughness - TRUE.roughness) < 2.5 * found.roughness_error


def test_places_whose_pixels_mix_the_table_with_the_floor_are_not_compared():
    """An even table before a floor that shines: all that is compared shows the table's radiance and nothing else."""
    light = np.full((8 * ROWS, 16 * ROWS, 3), 5.0, np.float32)
    _, met = on_table(np.array(PROBE), pixel_directions(LatLong(), 8 * ROWS).reshape(-1, 3))
    light.reshape(-1, 3)[met] = 0.2
    seen = light.reshape(ROWS, 8, 2 * ROWS, 8, 3).mean((1, 3))
    scene = Scene(EnvironmentMap(seen), (TABLE,), distant=ROOM, probe=PROBE)
    plate = RadianceMap(np.full((HEIGHT, WIDTH, 3), 0.2, np.float32))
    shared = common_points(plate, CAMERA, scene, 0, USABLE, VIEW)
    assert len(shared.points) > 200
    assert shared.probe == pytest.approx(np.full_like(shared.probe, 0.2), rel=1e-5)
    foot = np.linalg.norm(shared.points[:, [0, 2]], axis=-1)
    assert foot.min() > 0.15 and shared.points[:, 1] == pytest.approx(0, abs=1e-3)


def test_places_near_a_ball_are_those_that_its_surface_mirrors():
    """A table whose radiance rises across it, in a ball seen from far in front; some places lie 3 to 8 radii away."""

    def shown(points: np.ndarray) -> np.ndarray:
        x, z = np.clip(points[..., 0], -1, 1), np.clip(points[..., 2], -1, 1)
        return np.repeat((1.5 + 0.8 * x + 0.6 * z)[..., None], 3, axis=-1)

    radius, nearness = 0.05, 0.03
    directions = pixel_directions(LatLong(), 4 * ROWS)
    # Where a ball mirrors a direction towards z: half-way between the two, as rays leave its surface.
    ways, to_camera = directions, np.array([0.0, 0.0, 1.0])
    for _ in range(8):
        mirrored = ways + to_camera
        mirrored /= np.maximum(np.linalg.norm(mirrored, axis=-1, keepdims=True), 1e-9)
        ways = directions - nearness * mirrored
        ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    places = np.array(PROBE) + radius * mirrored
    reach = places[..., 1] / np.maximum(-ways[..., 1], 0.01)
    light = EnvironmentMap(shown(places + reach[..., None] * ways).astype(np.float32))
    scene = Scene(light, (TABLE,), distant=ROOM, probe=PROBE)
    points, met = on_table(np.array(CAMERA.position), CAMERA.rays().reshape(-1, 3))
    plate = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
    plate.reshape(-1, 3)[met] = shown(points)
    coarse = mirrored.reshape(ROWS, 4, 2 * ROWS, 4, 3).mean((1, 3)).astype(np.float32)
    view = ViewOfProbe(VIEW.confidence, radius, coarse, nearness)
    off = []
    for each in (view, VIEW):
        shared = common_points(RadianceMap(plate), CAMERA, scene, 0, USABLE, each)
        assert len(shared.points) > 200
        assert shared.plate[:, 0] == pytest.approx(shown(shared.points)[:, 0], rel=0.02)
        off.append(np.abs(shared.probe / shared.plate - 1))
    assert np.median(off[0]) < 0.003 < 0.01 < np.median(off[1])
    assert np.linalg.norm(shared.seen_from - PROBE, axis=-1) == pytest.approx(0, abs=1e-9)


# By columns of a photograph four times as fine as is looked at: brighter to the right, in stripes that average to 1.
STRIPES = (0.5 + 3 * np.arange(WIDTH) / WIDTH) * np.where(np.arange(WIDTH) % 4 == 0, 2.5, 0.5)


@pytest.mark.parametrize("columns", [np.full(WIDTH, 2.0), STRIPES], ids=["even", "striped"])
def test_a_wall_beside_a_table_shines_on_it_as_the_photograph_shows_it(monkeypatch, columns):
    """A wall in a dark place, against the sum over its pieces (L cos θ cos θ' dA / r²)."""
    monkeypatch.setattr(projection, "COARSE", WIDTH // 4)
    wall = box_mesh((-0.85, 0.0, -0.52), (0.85, 1.0, -0.5), Diffuse((0.5, 0.5, 0.5)))
    radiance = np.empty((HEIGHT, WIDTH, 3), np.float32)
    radiance[:] = columns[:, None]
    parts = np.where(np.arange(HEIGHT)[:, None] < 20, 1, 0) + np.zeros((1, WIDTH), int)
    dark = EnvironmentMap(np.zeros((8, 16, 3), np.float32))
    local = shining([TABLE, wall], 0, CAMERA, radiance, parts)
    assert local[0] is TABLE and len(local) > 2
    points = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, -0.3], [-0.5, 0.0, 0.3]])
    normals = np.broadcast_to([0.0, 1.0, 0.0], points.shape)
    scene = Scene(dark, tuple(local), distant=ROOM, probe=PROBE)
    lit = ready(scene)
    drawn = [arriving(lit, points, normals, np.array(CAMERA.position), seed=seed) for seed in range(12)]
    seen = np.mean([each.reflected(Diffuse((1.0, 1.0, 1.0)))[:, 0] for each in drawn], axis=0)
    x, y = np.meshgrid(np.linspace(-0.85, 0.85, 401), np.linspace(0, 1, 401))
    towards = np.stack([x, y, np.full_like(x, -0.5)], axis=-1)[None] - points[:, None, None]
    square = (towards**2).sum(-1)
    piece = (0.85 * 2 / 400) * (1 / 400)
    # What the photograph shows of it, averaged over the stripes, and the median where it shows nothing.
    at, seen_there = CAMERA.project(np.stack([x, y, np.full_like(x, -0.5)], axis=-1)), np.zeros(x.shape, bool)
    seen_there[:] = (at >= 0).all(-1) & (at[..., 0] < WIDTH) & (at[..., 1] < HEIGHT)
    means = columns.reshape(-1, 4).mean(1)
    sent_there = np.interp(at[..., 0], 4 * np.arange(WIDTH // 4) + 2, means)
    sent_there = np.where(seen_there, sent_there, np.median(columns))
    assert seen_there.mean() > 0.2
    expected = (sent_there * towards[..., 1] * -towards[..., 2] / square**2).sum((1, 2)) * piece / np.pi
    assert seen == pytest.approx(expected, rel=0.08)


@pytest.mark.slow
def test_pictures_of_a_path_tracer_give_the_gloss_back():
    """The same table and room, photographed by Mitsuba: what the pictures hold besides the sums' model is noise."""
    light = surroundings()
    x, z = 0.85, 0.5
    corners = np.array([[-x, 0, -z], [-x, 0, z], [x, 0, z], [x, 0, -z]], np.float32)
    uv = np.array([[0, 1], [0, 0], [1, 0], [1, 1]], np.float32)
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    table = Mesh(corners, faces, glossy(PATTERN.astype(np.float32), TRUE), None, uv)
    real = Scene(EnvironmentMap(light), (table,), distant=ROOM, probe=PROBE)
    plate = Mitsuba(samples=1024, depth=1).render(real, CAMERA, seed=5).radiance
    seen, directions = light.copy(), pixel_directions(LatLong(), ROWS)
    for turn in range(4):
        angle = np.pi / 2 * turn
        ahead = np.add(PROBE, (np.sin(angle), -0.25, -np.cos(angle)))
        face = Camera.looking_at(np.array(PROBE), ahead, width=128, height=40, focal_length=60.0)
        picture = Mitsuba(samples=1024, depth=1).render(real, face, seed=9 + turn)
        at = face.project(np.array(PROBE) + directions)
        nearest = np.round(np.arctan2(directions[..., 0], -directions[..., 2]) / (np.pi / 2)) % 4 == turn
        with np.errstate(invalid="ignore"):
            inside = nearest & (directions[..., 1] < 0) & np.all((at > 1) & (at < [127, 39]), axis=-1)
        column, row = np.nan_to_num(at[inside]).T.astype(int)
        hit = picture.depth[row, column] > 0
        seen[tuple(axis[hit] for axis in np.nonzero(inside))] = picture.radiance[row, column][hit]
    scene = Scene(EnvironmentMap(seen), (TABLE,), distant=ROOM, probe=PROBE)
    assert_true_within(fit_gloss(RadianceMap(plate), CAMERA, scene, 0, USABLE, VIEW))


@pytest.mark.slow
def test_the_photograph_alone_says_less_and_says_so(taken):
    plate, scene = taken
    usable = USABLE.copy()
    usable[:20] = False
    alone = fit_gloss(plate, CAMERA, scene, 0, usable, None)
    assert alone.views == 1 and any("photograph alone" in note for note in alone.notes)
    assert abs(alone.gloss.f0 - TRUE.f0) < 2.5 * alone.f0_error
    assert abs(alone.gloss.roughness - TRUE.roughness) < 2.5 * alone.roughness_error


@pytest.mark.slow
def test_what_arrives_is_what_the_path_tracer_sees(taken):
    """The sums over kept directions, beside renders of the same table: from the camera, and grazing from the probe."""
    _, scene = taken
    even = glossy((0.4, 0.3, 0.2), TRUE)
    local = scene.with_local([Plane(even, TABLE.extent)])
    grazing = Camera.looking_at(np.array(PROBE), np.array([-1.0, -0.15, 0.0]), width=64, height=40, focal_length=60.0)
    for camera, rows in ((CAMERA, slice(25, 60, 4)), (grazing, slice(24, 38, 2))):
        picture = Mitsuba(samples=2048, depth=1).render(local, camera, seed=2).radiance
        place, chosen = np.array(camera.position), camera.rays()[rows, 4:-4:4].reshape(-1, 3)
        points, met = on_table(place, chosen)
        normals = np.broadcast_to([0.0, 1.0, 0.0], points.shape)
        # Eight draws: one alone has some 10 % of noise a point.
        lit = ready(scene)
        summed = np.mean([arriving(lit, points, normals, place, seed=s).reflected(even) for s in range(8)], axis=0)
        ratio = summed / picture[rows, 4:-4:4].reshape(-1, 3)[met]
        assert len(points) > 80
        assert np.abs(ratio.mean(0) - 1).max() < 0.02 and np.percentile(np.abs(ratio - 1), 90) < 0.1


@pytest.mark.slow
def test_a_gloss_is_taken_out_before_the_albedo(taken):
    plate, scene = taken
    said = recover_reflectance(plate, CAMERA, scene, [Recovery(gloss=TRUE)], renderer=Mitsuba(samples=256, depth=2))
    points, met = on_table(np.array(CAMERA.position), CAMERA.rays().reshape(-1, 3))
    truth = PATTERN[((points[:, 2] + 0.5) * 10).astype(int), ((points[:, 0] / 1.7 + 0.5) * 17).astype(int)]
    near = points[:, 2] > -0.4  # the outline is not trusted
    truth, ratio = truth[near], (said.albedo.reshape(-1, 3)[met] / truth)[near]
    assert len(ratio) > 2000
    for patches in (truth[:, 0] > 0.4, truth[:, 0] < 0.4):
        assert np.median(ratio[patches], axis=0) == pytest.approx(np.ones(3), rel=0.03)
    assert said.surfaces[0].gloss == TRUE and said.surfaces[0].fitted is None


def test_a_gloss_beyond_all_light_is_refused():
    with pytest.raises(ValueError, match="expected 0 to 1"):
        Gloss(1.2, 0.5)


def test_a_light_that_is_a_little_too_bright_stays_within_the_errors(taken):
    """Three per cent of the table's light look like gloss; the error says so, and what is usual holds it back."""
    plate, scene = taken
    brighter = EnvironmentMap((1.03 * scene.light.radiance).astype(np.float32))
    found = fit_gloss(plate, CAMERA, replace(scene, light=brighter), 0, USABLE, VIEW)
    assert abs(found.gloss.f0 - TRUE.f0) < 2.5 * found.f0_error
    assert abs(found.gloss.f0 - TRUE.f0) < 0.03


def test_what_a_matte_surface_sends_is_the_sum_over_each_points_own_directions() -> None:
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(2, 21, 3)).astype(np.float32)
    directions[..., 2] = np.abs(directions[..., 2]) + 0.1
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    # Three points of seven directions; the light differs by point, direction and channel.
    weight = rng.random((21, 3)).astype(np.float32)
    albedo = np.array([0.2, 0.5, 0.8])
    sent = Arriving(directions[0], directions[1], weight, 3).reflected(Diffuse(tuple(albedo)))
    each = albedo / np.pi * directions[1][:, 2:] * weight.astype(np.float64)
    assert sent.dtype == np.float64
    np.testing.assert_allclose(sent, each.reshape(3, 7, 3).sum(1), rtol=1e-6)

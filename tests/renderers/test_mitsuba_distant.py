"""The distant scene on walls: what Mitsuba's path tracer sees and what arrives, beside sums over the map itself."""

import numpy as np
import pytest

from relume.renderers.mitsuba.distant import walls
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.scene import Box, Distant, Dome, Enclosure, Scene
from relume.scene.shapes.shapes import Plane, Sphere
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from solids import quad

PROBE = (0.3, 0.4, -0.2)
ROOM = Box((-2.0, -0.5, -1.5), (2.0, 2.0, 1.5))
DOME = Dome(3.0, (0.2, 0.0, 0.1))
PROBE_FOOT = (0.3, 0.0, -0.2)
ROWS = 64


def lamp_and_window() -> EnvironmentMap:
    """A dim room, a window of 0.4 by 0.3 rad and a lamp of a few pixels that sends about as much."""
    radiance = np.full((ROWS, 2 * ROWS, 3), 0.3, np.float32)
    radiance[20:26, 30:38] = (4.0, 6.0, 9.0)
    radiance[9:11, 85:87] = (200.0, 150.0, 60.0)
    return EnvironmentMap(radiance)


def summed(light: EnvironmentMap, distant: Box | Dome, probe: tuple, point: np.ndarray, subdivision: int = 6):
    """The irradiance (3,) of an upward surface at `point`: all walls' patches, each seen by the probe's pixel.

    An area dA at distance t that the probe sees under dω is t² dω / cos θ_probe; from the point it is
    dA cos θ / r². So dω′ = dω · (t²/cos θ_p) · (cos θ / r²), both angles at the wall.
    """
    fine = LatLong()
    directions = pixel_directions(fine, light.size * subdivision).reshape(-1, 3)
    solid = fine.solid_angles(light.size * subdivision).reshape(-1)
    seen = light.lookup(directions)
    origin = np.array(probe)
    walls_at = origin + distant.distances(origin, directions)[:, None] * directions
    if isinstance(distant, Dome):
        normal = (np.array(distant.centre) - walls_at) / distant.radius
    else:
        gap = np.stack([walls_at - np.array(distant.low), np.array(distant.high) - walls_at])
        side, axis = np.unravel_index(gap.transpose(1, 0, 2).reshape(len(gap[0]), -1).argmin(1), (2, 3))
        normal = np.eye(3)[axis] * np.where(side == 0, 1, -1)[:, None]
    way = walls_at - point
    far = np.linalg.norm(way, axis=-1)
    way = way / far[:, None]
    reach = np.linalg.norm(walls_at - origin, axis=-1)
    turned = solid * reach**2 / -(normal * directions).sum(-1) * -(normal * way).sum(-1) / far**2
    return np.einsum("nc,n,n->c", seen, turned, np.maximum(way[:, 1], 0))


def arriving(scene_light: EnvironmentMap, distant: Distant, point: np.ndarray, samples: int = 4096) -> np.ndarray:
    """What Mitsuba finds there: π times the radiance of a small white surface."""
    x, y, z = point
    half = 1e-3
    corners = [[x - half, y, z - half], [x - half, y, z + half], [x + half, y, z + half], [x + half, y, z - half]]
    patch = quad(corners, Diffuse((1.0, 1.0, 1.0)))
    camera = Camera.looking_at(point + np.array([0.0, 0.3, 0.02]), point, width=2, height=2, focal_length=4000.0)
    scene = Scene(scene_light, (patch,), distant=distant, probe=PROBE)
    return np.pi * Mitsuba(samples=samples, depth=1).render(scene, camera).radiance.mean((0, 1))


@pytest.mark.parametrize(
    ("distant", "point"),
    [
        pytest.param(ROOM, PROBE_FOOT, id="box-below-the-probe", marks=pytest.mark.slow),
        pytest.param(ROOM, (-1.2, 0.3, 0.9), id="box-off-the-probe"),
        pytest.param(ROOM, (1.5, 0.1, -1.0), id="box-at-a-corner"),
        pytest.param(DOME, PROBE_FOOT, id="dome-below-the-probe", marks=pytest.mark.slow),
        pytest.param(DOME, (-1.2, 0.3, 0.9), id="dome-off-the-probe"),
        pytest.param(DOME, (1.5, 0.1, -1.0), id="dome-at-its-side", marks=pytest.mark.slow),
    ],
)
def test_irradiance_is_that_of_the_walls_the_probe_saw(distant, point):
    light = lamp_and_window()
    truth = summed(light, distant, PROBE, np.array(point))
    assert arriving(light, distant, np.array(point)) == pytest.approx(truth, rel=0.01)


def test_the_probe_sees_its_own_map_and_another_place_sees_it_shifted():
    directions = pixel_directions(LatLong(), ROWS)
    light = EnvironmentMap((1 + 0.8 * directions).astype(np.float32))
    camera = Camera(24, 16, 12.0, np.array(PROBE), np.eye(3))
    render = Mitsuba(samples=64, depth=1).render(Scene(light, distant=ROOM, probe=PROBE), camera)
    rays = camera.rays()
    assert render.radiance == pytest.approx(light.lookup(rays), rel=0.01)
    # The walls are no surfaces of the scene.
    assert np.all(render.depth == 0) and np.all(render.albedo == 0)

    moved = Camera(24, 16, 12.0, np.array([-0.7, 0.6, 0.3]), np.eye(3))
    shown = Mitsuba(samples=64, depth=1).render(Scene(light, distant=ROOM, probe=PROBE), moved).radiance
    ends = moved.position + ROOM.distances(moved.position, rays)[..., None] * rays
    away = ends - np.array(PROBE)
    expected = light.lookup(away / np.linalg.norm(away, axis=-1, keepdims=True))
    assert shown == pytest.approx(expected, rel=0.01)
    assert np.median(np.abs(shown / light.lookup(rays) - 1)) > 0.1  # which light at infinity would show


def cuboid(low, high) -> tuple[np.ndarray, np.ndarray]:
    """Corners (8, 3) and faces (12, 3); the last two faces are those at the highest z."""
    corners = np.array(np.meshgrid(*zip(low, high, strict=True), indexing="ij"), np.float32).reshape(3, -1).T
    quads = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    return corners, np.array([f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))], np.int32)


def test_an_enclosure_of_the_rooms_own_shape_is_the_room():
    built, (corners, faces) = walls(ROOM, PROBE, 16), cuboid(ROOM.low, ROOM.high)
    assert walls(Enclosure(corners, faces), PROBE, 16).vertices == pytest.approx(built.vertices, abs=1e-5)
    with pytest.raises(ValueError, match="open"):
        walls(Enclosure(corners, faces[:-2]), (1.9, 0.4, -0.2), 16)


def test_walls_enclose_all_and_face_the_probe():
    built = walls(Dome(2.0), (0.0, 0.5, 0.0), 64)
    a, b, c = np.moveaxis(built.vertices[built.faces].astype(np.float64), 1, 0)
    normal = np.cross(b - a, c - a)
    assert np.linalg.norm(normal, axis=-1).sum() / 2 == pytest.approx(4 * np.pi * 4, rel=2e-3)
    assert np.all((normal * (np.array([0.0, 0.5, 0.0]) - a)).sum(-1) > 0)
    assert built.uv.min() == 0 and np.all(built.uv[built.faces].max(1) <= 1 + 1e-6)


def test_what_stands_outside_is_refused():
    light = lamp_and_window()
    with pytest.raises(ValueError, match=r"the probe at .* is outside"):
        walls(ROOM, (0.0, 3.0, 0.0))
    camera = Camera(4, 4, 4.0, np.zeros(3), np.eye(3))
    far = Sphere((1.9, 0.5, 0.0), 0.2, Diffuse((0.5, 0.5, 0.5)), "globe")
    with pytest.raises(ValueError, match="'globe' reaches out of the distant scene"):
        Mitsuba(samples=4).render(Scene(light, (), (far,), distant=ROOM), camera)
    floor = Plane(Diffuse((0.5, 0.5, 0.5)))
    assert Mitsuba(samples=4).render(Scene(light, (floor,), distant=ROOM), camera).radiance.shape == (4, 4, 3)


def test_a_wall_that_hides_another_is_reported():
    corners, faces = cuboid((-2, -2, -2), (2, 2, 2))
    pillar = 0.2 * corners * [1, 9, 1] + [1.0, 0, 0]
    both = Enclosure(np.concatenate([corners, pillar]).astype(np.float32), np.concatenate([faces, faces + 8]))
    with pytest.warns(UserWarning, match="hidden from the probe"):
        walls(both, (0.0, 0.0, 0.0), 32)

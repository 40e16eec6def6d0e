"""The gloss of a surface from two views: a table of known gloss, and a probe that saw it, give it back."""

import numpy as np
import pytest

from relume.composite.gloss import FittedGloss, Gloss, ViewOfProbe, fit_gloss, glossy
from relume.composite.reflectance import Wanted, recover
from relume.image.radiance import RadianceMap
from relume.render.mitsuba import Mitsuba
from relume.render.mitsuba_lobes import arriving
from relume.scene.camera import Camera
from relume.scene.distant import Box
from relume.scene.materials import Diffuse
from relume.scene.scene import Scene
from relume.scene.shapes import Mesh, Plane
from relume.sphere.illumination import IlluminationMap
from relume.sphere.mappings import LatLong, pixel_directions

CAMERA = Camera.looking_at(np.array([0.25, 0.55, 1.15]), np.zeros(3), width=192, height=128, focal_length=220.0)
pytestmark = pytest.mark.slow
TABLE = Plane(Diffuse((0.5, 0.5, 0.5)), (1.7, 1.0))
ROOM = Box((-2.5, -0.75, -2.0), (2.5, 1.95, 2.0))
PROBE = (0.0, 0.05, 0.0)
TRUE = Gloss(0.05, 0.35)
ROWS = 64


def surroundings() -> np.ndarray:
    """A room with a window to the left and behind the probe."""
    directions = pixel_directions(LatLong(), ROWS)
    light = 0.5 + 0.3 * directions[..., :1] * [0.5, 0.2, -0.3] + 0.2 * directions[..., 1:2]
    window = (directions[..., 0] < -0.5) & (np.abs(directions[..., 1] - 0.3) < 0.15) & (directions[..., 2] < 0.4)
    return np.where(window[..., None], [6.0, 7.0, 9.0], light).astype(np.float32)


def table(gloss: Gloss) -> Mesh:
    """With a pattern of two albedos."""
    random = np.random.default_rng(3)
    image = np.where(random.random((10, 17, 1)) < 0.5, [0.5, 0.3, 0.2], [0.35, 0.22, 0.15]).astype(np.float32)
    x, z = 0.85, 0.5
    vertices = np.array([[-x, 0, z], [x, 0, z], [x, 0, -z], [-x, 0, -z]], np.float32)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), glossy(image, gloss), None, uv)


@pytest.fixture(scope="module")
def taken() -> tuple[RadianceMap, Scene]:
    """The photograph, and the scene whose light shows the table below the horizon as a probe would see it."""
    light = surroundings()
    real = Scene(IlluminationMap(light), (table(TRUE),), distant=ROOM, probe=PROBE)
    plate = Mitsuba(samples=64, depth=2).render(real, CAMERA, seed=5).radiance
    # Four faces of a cube look down on the table from the probe's place; each pixel of the map takes its own.
    directions = pixel_directions(LatLong(), ROWS)
    seen = light.copy()
    for turn in range(4):
        angle = np.pi / 2 * turn
        forward = np.array([np.sin(angle), -0.35, -np.cos(angle)])
        face = Camera.looking_at(np.array(PROBE), np.array(PROBE) + forward, width=128, height=96, focal_length=60.0)
        picture = Mitsuba(samples=64, depth=2).render(real, face, seed=9 + turn)
        at = face.project(np.array(PROBE) + directions)
        nearest = np.round(np.arctan2(directions[..., 0], -directions[..., 2]) / (np.pi / 2)) % 4 == turn
        with np.errstate(invalid="ignore"):
            inside = nearest & (directions[..., 1] < 0) & np.all((at > 1) & (at < [127, 95]), axis=-1)
        x, y = np.nan_to_num(at[inside]).T.astype(int)
        hit = picture.depth[y, x] > 0
        rows, columns = np.nonzero(inside)
        seen[rows[hit], columns[hit]] = picture.radiance[y[hit], x[hit]]
    return RadianceMap(plate), Scene(IlluminationMap(seen), (TABLE,), distant=ROOM, probe=PROBE)


@pytest.fixture(scope="module")
def found(taken: tuple[RadianceMap, Scene]) -> FittedGloss:
    plate, scene = taken
    view = ViewOfProbe(np.ones((ROWS, 2 * ROWS), np.float32), 0.05)
    usable = np.zeros((128, 192), bool)
    usable[3:-3, 3:-3] = True
    return fit_gloss(plate, CAMERA, scene, 0, usable, view)


def test_two_views_give_the_roughness_back_within_its_error(found: FittedGloss):
    assert found.views == 2 and found.points > 200 and found.notes == ()
    assert abs(found.gloss.roughness - TRUE.roughness) < 2.5 * found.roughness_error
    assert found.f0_error < 0.02 and found.roughness_error < 0.03


@pytest.mark.xfail(strict=True, reason="F0 comes out at 0.031 ± 0.006 where it is 0.05; the cause is not known")
def test_two_views_give_the_reflectance_along_the_normal_back_within_its_error(found: FittedGloss):
    assert abs(found.gloss.f0 - TRUE.f0) < 2.5 * found.f0_error


def test_the_photograph_alone_says_less_and_says_so(taken):
    plate, scene = taken
    usable = np.zeros((128, 192), bool)
    usable[40:-3, 3:-3] = True
    alone = fit_gloss(plate, CAMERA, scene, 0, usable, None)
    assert alone.views == 1 and any("photograph alone" in note for note in alone.notes)
    assert abs(alone.gloss.f0 - TRUE.f0) < 2.5 * alone.f0_error
    assert abs(alone.gloss.roughness - TRUE.roughness) < 2.5 * alone.roughness_error


def test_what_arrives_is_what_the_path_tracer_sees(taken):
    """The sums over kept directions, beside a render of the same table."""
    _, scene = taken
    even = glossy((0.4, 0.3, 0.2), TRUE)
    flat = Mesh(*_rectangle(), even)
    picture = Mitsuba(samples=256, depth=1).render(scene.with_local([flat]), CAMERA, seed=2).radiance
    rows, columns = np.mgrid[50:120:10, 20:180:10]
    rays = CAMERA.rays()[rows, columns].reshape(-1, 3)
    points = CAMERA.position + (-CAMERA.position[1] / rays[:, 1])[:, None] * rays
    normals = np.broadcast_to([0.0, 1.0, 0.0], points.shape)
    sent = arriving(scene, points, normals, np.array(CAMERA.position)).reflected(even)
    ratio = sent / picture[rows, columns].reshape(-1, 3)
    assert np.abs(ratio.mean(0) - 1).max() < 0.01 and np.percentile(np.abs(ratio - 1), 90) < 0.1


def test_a_gloss_is_taken_out_before_the_albedo(taken):
    plate, scene = taken
    told = recover(plate, CAMERA, scene, [Wanted(gloss=TRUE)], renderer=Mitsuba(samples=64, depth=2))
    values = told.albedo[50:120, 20:180].reshape(-1, 3)
    high, low = np.percentile(values, 90, axis=0), np.percentile(values, 10, axis=0)
    assert high == pytest.approx([0.5, 0.3, 0.2], rel=0.05) and low == pytest.approx([0.35, 0.22, 0.15], rel=0.05)
    assert told.surfaces[0].gloss == TRUE and told.surfaces[0].fitted is None


def test_a_gloss_beyond_all_light_is_refused():
    with pytest.raises(ValueError, match="expected 0 to 1"):
        Gloss(1.2, 0.5)


def _rectangle() -> tuple[np.ndarray, np.ndarray]:
    x, z = 0.85, 0.5
    vertices = np.array([[-x, 0, z], [x, 0, z], [x, 0, -z], [-x, 0, -z]], np.float32)
    return vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32)

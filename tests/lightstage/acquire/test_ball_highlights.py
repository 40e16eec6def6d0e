"""Where a mirrored ball shows a lamp, and where the lamp stands: by construction, and in the published sets."""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

from angles import degrees_between
from relume.errors import BallNotFound
from relume.image.files import read_photograph
from relume.lightstage.acquire.ball_highlights import (
    BallReadings,
    MirrorBall,
    find_highlight,
    light_places,
    outline_of_mask,
    read_ball,
    unit_mean,
)
from relume.lightstage.acquire.ball_search import find_ball
from relume.lightstage.acquire.light_files import read_directions
from relume.probe.ball.silhouette import Outline, outline_of_circle
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised, rotation_about

OLAT = Path(__file__).resolve().parents[4] / "shared" / "data" / "olat"
CIRCLE = outline_of_circle(60.0, 50.0, 40.0)


def spot(x: float, y: float, width: float, peak: float = 1.0, shape: tuple[int, int] = (100, 120)) -> np.ndarray:
    rows, columns = np.indices(shape) + 0.5
    light = peak * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / (2 * width**2))
    return np.repeat(light[..., None], 3, axis=2)


def seen_from(camera: Camera, centre: np.ndarray, radius: float) -> Outline:
    """The rim of a ball, by its tangent rays, as a camera sees it."""
    away = camera.position - centre
    distance = float(np.linalg.norm(away))
    axis = away / distance
    side = normalised(np.cross(axis, [0.3, 0.5, 0.1]))
    turns = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ring = np.cos(turns)[:, None] * side + np.sin(turns)[:, None] * np.cross(axis, side)
    sine = radius / distance
    rim = camera.project(centre + radius * (sine * axis + np.sqrt(1 - sine**2) * ring))
    return Outline(rim, (float(rim[:, 0].mean()), float(rim[:, 1].mean())), float(np.ptp(rim[:, 0]) / 2), 1.0)


def mirrored(camera: Camera, centre: np.ndarray, radius: float, light: np.ndarray) -> np.ndarray:
    """Fermat: of all points on the ball, light takes the one by which its way to the camera is shortest."""

    def way(angles: np.ndarray) -> float:
        point = centre + radius * np.array(
            [np.sin(angles[0]) * np.cos(angles[1]), np.cos(angles[0]), np.sin(angles[0]) * np.sin(angles[1])]
        )
        return float(np.linalg.norm(point - camera.position) + np.linalg.norm(point - light))

    half = normalised(normalised(camera.position - centre) + normalised(light - centre))
    start = [np.arccos(half[1]), np.arctan2(half[2], half[0])]
    a, b = minimize(way, start, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-15}).x
    return centre + radius * np.array([np.sin(a) * np.cos(b), np.cos(a), np.sin(a) * np.sin(b)])


def test_a_highlight_at_half_a_radius_is_a_light_at_sixty_degrees() -> None:
    ball = MirrorBall(CIRCLE)
    _, directions = ball.reflections(
        np.array([[60.0, 50.0], [80.0, 50.0], [60.0, 50 - 40 * np.sqrt(0.5)], [101.0, 50]])
    )
    np.testing.assert_allclose(directions[0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(directions[1], [np.sqrt(0.75), 0, 0.5], atol=1e-12)
    np.testing.assert_allclose(directions[2], [0, 1, 0], atol=1e-12)
    assert np.isnan(directions[3]).all()


def test_a_perspective_ball_mirrors_the_lamp_by_the_shortest_way() -> None:
    rotation = rotation_about([0.2, 1.0, 0.1], 0.4)
    camera = Camera(900, 700, 1000.0, np.array([1.0, 0.5, 2.0]), rotation, centre=(430.0, 365.0))
    centre, radius = camera.position + rotation @ np.array([0.1, -0.08, -0.6]), 0.05
    ball = MirrorBall(seen_from(camera, centre, radius), camera, radius)
    np.testing.assert_allclose(ball.centre, centre, atol=1e-6)
    for offset in ([0.4, 1.0, 0.3], [-1.0, 0.2, 0.8], [0.7, -0.5, -0.2]):
        light = centre + np.array(offset)
        point = mirrored(camera, centre, radius, light)
        places, directions = ball.reflections(camera.project(point)[None])
        np.testing.assert_allclose(places[0], point, atol=1e-6)
        assert degrees_between(directions[0], normalised(light - point)) < 0.01


def test_a_saturated_lamp_is_where_its_plateau_is() -> None:
    picture = np.minimum(spot(71.3, 38.6, 3.0, 50.0), 1.0)
    assert find_highlight(picture, CIRCLE) == pytest.approx((71.3, 38.6), abs=0.1)


def test_neither_glare_nor_lit_surroundings_pull_at_the_lamp() -> None:
    picture = spot(71.3, 38.6, 2.0) + 0.2 * spot(40.0, 60.0, 12.0) + 0.6 * spot(75.0, 45.0, 2.0)
    assert find_highlight(picture, CIRCLE) == pytest.approx((71.3, 38.6), abs=0.15)


def test_a_spark_and_what_is_beside_the_ball_are_not_the_lamp() -> None:
    picture = np.minimum(spot(71.3, 38.6, 3.0, 5.0), 1.0) + 5 * spot(112.0, 90.0, 3.0)
    picture[60, 50] = 1.0
    assert find_highlight(picture, CIRCLE) == pytest.approx((71.3, 38.6), abs=0.1)


def test_a_ball_without_lamp_is_reported() -> None:
    for picture in (np.zeros((100, 120, 3)), np.full((100, 120, 3), 0.3)):
        with pytest.raises(BallNotFound, match=r"b\.png: the ball shows no lamp"):
            read_ball([picture], MirrorBall(CIRCLE), ["b.png"])
    with pytest.raises(BallNotFound, match="not in a picture of 120×100"):
        find_highlight(spot(10, 10, 2), outline_of_circle(300, 300, 20))


def test_a_mask_shows_the_ball_though_its_foot_is_hidden() -> None:
    rows, columns = np.indices((100, 120)) + 0.5
    disc = np.hypot(columns - 60.4, rows - 48.8) < 37.3
    whole = outline_of_mask(disc)
    assert (*whole.centre, whole.radius) == pytest.approx((60.4, 48.8, 37.3), abs=0.1)
    hidden = outline_of_mask(np.repeat((disc & (rows < 76))[..., None], 3, axis=2).astype(np.uint8) * 255)
    assert (*hidden.centre, hidden.radius) == pytest.approx((60.4, 48.8, 37.3), abs=0.3)
    with pytest.raises(BallNotFound, match="black all over"):
        outline_of_mask(np.zeros((10, 10)))


def published(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """The directions found in one ball's pictures, and those published for it; its circle's y runs upwards."""
    x, y, radius = np.loadtxt(folder / "circle_data.txt")
    pictures = [read_photograph(folder / f"Image_{i:02d}.JPG").pixels / 255 for i in range(1, 21)]
    ball = MirrorBall(outline_of_circle(x, pictures[0].shape[0] - y, radius))
    return read_ball(pictures, ball).directions, read_directions(folder / "light_directions.txt")


@pytest.mark.slow
@pytest.mark.parametrize("thing", ["cat", "frog"])
def test_two_balls_give_the_published_directions_within_two_degrees(thing: str) -> None:
    folder = OLAT / "gray_balls_psdata" / thing
    if not folder.is_dir():
        pytest.skip("the real sets are not beside the repository")
    for name in ("LightProbe-1", "LightProbe-2"):
        found, said = published(folder / name)
        assert degrees_between(found, said).max() < 2


@pytest.fixture(scope="module")
def chrome() -> list[np.ndarray]:
    if not OLAT.is_dir():
        pytest.skip("the real sets are not beside the repository")
    return [read_photograph(OLAT / "uw_psm" / "chrome" / f"chrome.{i}.png").pixels / 255 for i in range(12)]


@pytest.fixture(scope="module")
def chrome_directions(chrome: list[np.ndarray]) -> np.ndarray:
    mask = read_photograph(OLAT / "uw_psm" / "chrome" / "chrome.mask.png").pixels
    return read_ball(chrome, MirrorBall(outline_of_mask(mask))).directions


def shading_error(direction: np.ndarray, light: int) -> float:
    """How far the matte gray ball is from n·l, as a share, with its brightness free."""
    outline = outline_of_mask(read_photograph(OLAT / "uw_psm" / "gray" / "gray.mask.png").pixels)
    seen = read_photograph(OLAT / "uw_psm" / "gray" / f"gray.{light}.png").pixels[..., 1] / 255
    rows, columns = np.indices(seen.shape) + 0.5
    across = np.stack([columns - outline.centre[0], outline.centre[1] - rows], axis=-1) / outline.radius
    square = (across**2).sum(axis=-1)
    inside = square < 0.95**2
    normals = np.concatenate([across, np.sqrt(np.maximum(1 - square, 0))[..., None]], axis=-1)[inside]
    shading = np.maximum(normals @ direction, 0)
    brightness = (shading @ seen[inside]) / (shading @ shading)
    return float(np.linalg.norm(seen[inside] - brightness * shading) / np.linalg.norm(seen[inside]))


def test_where_the_chrome_ball_and_the_usual_reference_differ_the_gray_ball_sides_with_the_chrome_ball(
    chrome_directions: np.ndarray,
) -> None:
    said = read_directions(OLAT / "uw_psm" / "lights.txt")
    apart = degrees_between(chrome_directions, said)
    differing = np.flatnonzero(apart > 2)
    assert list(differing) == [0, 1, 6, 7, 8, 9]
    assert apart[[2, 3, 4, 5, 10, 11]].max() < 2
    for light in map(int, differing):
        assert shading_error(chrome_directions[light], light) < shading_error(said[light], light)


def test_the_chrome_ball_is_found_without_its_mask(chrome: list[np.ndarray], chrome_directions: np.ndarray) -> None:
    found = read_ball(chrome, MirrorBall(find_ball(chrome, "chrome")))
    assert degrees_between(found.directions, chrome_directions).max() < 1.5


def test_the_mean_of_balls_is_a_unit_direction() -> None:
    readings = [read_ball([spot(x, 38.6, 2.0)], MirrorBall(CIRCLE)) for x in (60.0, 70.0)]
    mean = unit_mean(readings)
    assert np.linalg.norm(mean) == pytest.approx(1)
    np.testing.assert_allclose(np.cross(mean[0], readings[0].directions[0] + readings[1].directions[0]), 0, atol=1e-12)


LIGHTS = np.array([[0.5, 1.0, 0.8], [-0.7, 0.3, 0.9]])
BALLS = [np.array([-0.2, 0.0, 0.0]), np.array([0.25, 0.05, 0.0]), np.array([0.0, -0.2, 0.1])]


def readings(places: np.ndarray, lights: np.ndarray) -> BallReadings:
    on_ball = np.repeat(places[None], len(lights), axis=0)
    return BallReadings(on_ball, normalised(lights - on_ball))


def test_rays_that_meet_give_the_place() -> None:
    positions, distances = light_places([readings(ball, LIGHTS) for ball in BALLS], ["a", "b"])
    np.testing.assert_allclose(positions, LIGHTS, atol=1e-12)
    np.testing.assert_allclose(distances, 0, atol=1e-12)


def test_the_residual_is_the_distance_to_rays_that_pass_each_other() -> None:
    first = BallReadings(np.array([[0.0, -1, 0.01]]), np.array([[0.0, 1, 0]]))
    second = BallReadings(np.array([[-1.0, 0, -0.01]]), np.array([[1.0, 0, 0]]))
    positions, distances = light_places([first, second], ["a"])
    np.testing.assert_allclose(positions, [[0, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(distances, [0.01])


def test_parallel_rays_are_reported_by_name() -> None:
    far = np.array([[0.0, 0.0, 1000.0], [0.5, 1.0, 0.8]])
    with pytest.warns(UserWarning, match="b.png: the balls' rays are parallel within half a degree"):
        light_places([readings(ball, far) for ball in BALLS], ["b.png", "c.png"])


def test_rays_that_run_apart_are_refused() -> None:
    swapped = [BallReadings(ball[None], normalised(-(LIGHTS[:1] - ball[None]))) for ball in BALLS]
    with pytest.raises(ValueError, match="a: the balls' rays run apart"):
        light_places(swapped, ["a"])

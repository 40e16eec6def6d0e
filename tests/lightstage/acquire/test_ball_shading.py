"""Where a lamp stands by how a matte ball is shaded: by construction, and on a real one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from angles import degrees_between
from relume.image.files import read_photograph
from relume.lightstage.acquire.ball_highlights import MirrorBall, outline_of_mask, read_ball
from relume.lightstage.acquire.ball_shading import read_shading
from relume.probe.ball.silhouette import Outline, outline_of_circle
from relume.scene.cameras.camera import Camera
from relume.sphere.directions import normalised

OLAT = Path(__file__).resolve().parents[4] / "shared" / "data" / "olat" / "uw_psm"
BALL = MirrorBall(outline_of_circle(60.0, 50.0, 40.0))
LIGHTS = normalised([[0.3, 0.5, 0.8], [-0.9, 0.1, 0.3], [0.0, -0.7, 0.7]])


def shaded(ball: MirrorBall, light: np.ndarray, shape: tuple[int, int] = (100, 120)) -> np.ndarray:
    """A Lambertian ball, (H, W, 3), 0 beside it."""
    x, y = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    normals = ball.normals(np.stack([x, y], axis=-1).reshape(-1, 2)).reshape(*shape, 3)
    value = 0.7 * np.maximum(np.nan_to_num(normals) @ light, 0)
    return np.repeat(value[..., None], 3, axis=-1)


@pytest.mark.parametrize("light", LIGHTS)
def test_the_shading_of_a_matte_ball_is_explained_by_the_lamp_s_direction(light) -> None:
    towards, share = read_shading(shaded(BALL, light), BALL)
    # Points lie anywhere within their pixels.
    assert degrees_between(towards, light) < 0.5 and share > 0.99


def test_a_glint_a_stain_and_a_shadow_do_not_move_the_lamp() -> None:
    picture = shaded(BALL, LIGHTS[0])
    picture[28:36, 66:74] = 4.0
    picture[48:60, 60:72] *= 0.5
    picture[20:40, 34:48] = 0.02
    towards, _ = read_shading(picture, BALL)
    assert degrees_between(towards, LIGHTS[0]) < 1.5


def test_a_ball_before_a_near_camera_has_the_normals_that_it_shows() -> None:
    camera = Camera(120, 100, 150.0, np.zeros(3), np.eye(3))
    centre = np.array([0.35, -0.2, -1.0])
    distance = float(np.linalg.norm(centre))
    axis, sine = centre / distance, 0.25 / distance
    side = normalised(np.cross(axis, [0.0, 1.0, 0.0]))
    turns = np.linspace(0, 2 * np.pi, 90, endpoint=False)[:, None]
    rim = camera.project(
        np.sqrt(1 - sine**2) * axis + sine * (np.cos(turns) * side + np.sin(turns) * np.cross(axis, side))
    )
    middle = (rim.max(axis=0) + rim.min(axis=0)) / 2
    outline = Outline(rim, (float(middle[0]), float(middle[1])), float(np.ptp(rim[:, 0]) / 2), 1.0)
    near, far = MirrorBall(outline, camera, 0.25), MirrorBall(outline)
    picture = shaded(near, LIGHTS[0])
    assert degrees_between(read_shading(picture, near)[0], LIGHTS[0]) < 0.7
    assert degrees_between(read_shading(picture, far)[0], LIGHTS[0]) > 5


def test_a_mirrored_ball_and_a_black_picture_are_not_explained() -> None:
    rows, columns = np.indices((100, 120)) + 0.5
    lamp = 0.05 + 5 * np.exp(-((columns - 70) ** 2 + (rows - 40) ** 2) / 20)
    assert read_shading(np.repeat(lamp[..., None], 3, axis=-1), BALL)[1] < 0.3
    assert read_shading(np.zeros((100, 120, 3)), BALL)[1] == 0


def test_a_real_matte_ball_shows_the_lamps_where_the_mirrored_one_does() -> None:
    if not OLAT.is_dir():
        pytest.skip("the real sets are not beside the repository")

    def ball(name: str) -> tuple[MirrorBall, list[np.ndarray]]:
        outline = outline_of_mask(read_photograph(OLAT / name / f"{name}.mask.png").pixels)
        pictures = [read_photograph(OLAT / name / f"{name}.{i}.png").pixels / 255 for i in range(12)]
        return MirrorBall(outline), pictures

    mirror, shown = ball("chrome")
    matte, pictures = ball("gray")
    found = [read_shading(picture, matte) for picture in pictures]
    apart = degrees_between(np.array([towards for towards, _ in found]), read_ball(shown, mirror).directions)
    assert np.median(apart) < 2.1 and apart.max() < 6.5
    assert min(share for _, share in found) > 0.9
    assert max(read_shading(picture, mirror)[1] for picture in shown) < 0.1

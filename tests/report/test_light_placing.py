"""Lights that are placed by what shall mirror them, and how they stand beside the measured light."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import relume as rl
from relume.project.shot_file.added_lights import AddedLight
from small_shot import TEXT, camera, write_small_shot

CENTRE, RADIUS = np.array([0.0, 0.05, 0.0]), 0.05
ROOM = 'distant = { shape = "box", low = [-2, -1, -2], high = [2, 2, 2] }\nprobe = [0.1, 0.2, 0.3]\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small shot with a fine sphere that has normals of its own, of chrome."""
    place = write_small_shot(tmp_path_factory.mktemp("mirrored")).parent
    ball = trimesh.creation.icosphere(5, RADIUS)
    ball = trimesh.Trimesh(ball.vertices + CENTRE, ball.faces, vertex_normals=ball.vertices / RADIUS, process=False)
    content: Any = ball.export(file_type="glb", include_normals=True)
    (place / "objects" / "ball.glb").write_bytes(content)
    return place


def shot(folder: Path, light: str = "", objects: str = "") -> rl.Shot:
    path = folder / "shot.toml"
    text = TEXT.replace("scale = 1.0\n", f"scale = 1.0\n{light}")
    path.write_text(text.replace('ball.glb"\n', f'ball.glb"\n{objects}'), encoding="utf-8")
    return rl.read_shot(path)


def mirrored(x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
    """Where the small shot's camera sees the ball through a pixel, and the direction mirrored there."""
    lens = camera()
    ray = lens.rays_through(np.array([[x, y]]))[0]
    ray = ray / np.linalg.norm(ray)
    away = lens.position - CENTRE
    along = away @ ray
    point = lens.position + (-along - np.sqrt(along**2 - away @ away + RADIUS**2)) * ray
    normal = (point - CENTRE) / RADIUS
    return point, ray - 2 * (ray @ normal) * normal


@pytest.mark.parametrize("by", [(0, 0), (4, -3), (-5, 2)])
def test_a_pixel_of_a_ball_mirrors_the_direction_that_geometry_gives(folder: Path, by: tuple[float, float]):
    x, y = camera().project(CENTRE) + np.array(by)
    point, direction = mirrored(float(x), float(y))
    found = rl.report.mirrored_light(shot(folder), camera(), float(x), float(y))
    assert found is not None and found.point == pytest.approx(point, abs=2e-5)
    assert np.degrees(np.linalg.norm(np.array(found.direction) - direction)) < 0.1
    # In a room it is the wall's direction from the probe.
    near = rl.report.mirrored_light(shot(folder, ROOM), camera(), float(x), float(y))
    wall = point + float(rl.scene.Box((-2, -1, -2), (2, 2, 2)).distances(point, direction)) * direction
    expected = (wall - [0.1, 0.2, 0.3]) / np.linalg.norm(wall - [0.1, 0.2, 0.3])
    assert near is not None and np.degrees(np.linalg.norm(np.array(near.direction) - expected)) < 0.1


def test_beside_the_objects_there_is_nothing_to_mirror_a_light(folder: Path):
    assert rl.report.mirrored_light(shot(folder), camera(), 5, 5) is None


@pytest.mark.parametrize("size", [0.5, 4.0, 60.0])
def test_an_added_light_gives_its_irradiance_and_leaves_the_rest_alone(size: float):
    bare = rl.EnvironmentMap(np.full((64, 128, 3), 0.2, np.float32))
    towards = np.array([0.3, 0.8, -0.5]) / np.linalg.norm([0.3, 0.8, -0.5])
    lit = AddedLight(direction=(3.0, 8.0, -5.0), irradiance=(2.0, 1.0, 0.5), size=size).shining_in(bare)
    assert lit.irradiance(towards) - bare.irradiance(towards) == pytest.approx([2.0, 1.0, 0.5], rel=1e-5)
    changed = (lit.radiance != bare.radiance).any(-1)
    away = rl.mappings.pixel_directions(lit.mapping, 64)[changed] @ towards
    assert np.degrees(np.arccos(away.min())) < size / 2 + 4
    off = AddedLight(direction=(0, 1, 0), irradiance=(1.0, 1.0, 1.0), on=False)
    assert off.irradiance == (1.0, 1.0, 1.0)


def test_the_composite_shows_the_light_where_it_was_asked_for(folder: Path, tmp_path: Path):
    x, y = (int(each) for each in camera().project(CENTRE) + np.array([-4, -3]))
    chrome = "material = { base_color = [1, 1, 1], metallic = 1.0, roughness = 0.0 }\n"
    where = rl.report.mirrored_light(shot(folder), camera(), x + 0.5, y + 0.5)
    assert where is not None
    pictures = []
    for on in ("false", "true"):
        light = f"added = [{{ direction = {list(where.direction)}, irradiance = 1.0, size = 60, on = {on} }}]\n"
        rl.insert(shot(folder, light, chrome), tmp_path / on)
        pictures.append(rl.read_radiance(tmp_path / on / "composite.exr").radiance.astype(np.float64))
    more = (pictures[1] - pictures[0]).mean(-1)
    ball = np.hypot(*(np.mgrid[:128, :192][::-1] - (camera().project(CENTRE) - 0.5)[:, None, None])) < 9
    rows, columns = np.nonzero(ball & (more > 0.5 * more[y, x]))
    assert np.hypot(rows.mean() - y, columns.mean() - x) <= 1
    # A disc of 60° has a radiance of E/(π sin² 30°), and a mirror shows it.
    assert more[y, x] == pytest.approx(1 / (np.pi * np.sin(np.radians(30)) ** 2), rel=0.02)
    plate = rl.read_radiance(folder / "plate.exr").radiance
    assert np.array_equal(pictures[1][:10].astype(np.float32), plate[:10])


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ("{ direction = [0, 0, 0], irradiance = 1 }", "light.added.0.direction"),
        ("{ direction = [0, 1, 0], irradiance = -1 }", "light.added.0.irradiance"),
        ("{ direction = [0, 1, 0] }", "light.added.0.irradiance: missing"),
    ],
)
def test_an_added_light_that_is_none_is_one_line(folder: Path, entry: str, says: str):
    with pytest.raises(rl.errors.InvalidShot, match=says):
        shot(folder, f"added = [{entry}]\n")

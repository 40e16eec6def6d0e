"""Figure 9 of Debevec & Malik 1997: blur of radiance keeps the saturated cores that blur of a photograph loses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from relume.image.files import read_radiance
from relume.image.response import Response
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong
from relume.sphere.mappings.perspective import perspective_view
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.lens.motion.path import TurningCamera
from relume.virtual_camera.lens.motion.straight import StraightMotion
from relume.virtual_camera.view import View
from synthetic import VirtualCamera

FIELD, SIZE = np.radians(50), (180, 120)
FOCAL_LENGTH = SIZE[0] / 2 / np.tan(FIELD / 2)
SATURATED = 0.98
PIXELS = 37
"""The length of the figure's blur."""


def church() -> EnvironmentMap:
    """Dark stones, and windows up to 600 times brighter."""
    stones = 0.05 + 0.1 * np.random.default_rng(3).random((64, 128, 1))
    light = np.repeat(np.repeat(stones, 8, 0), 8, 1) * np.ones(3)
    windows = (
        (230, 500, 24, 6, 60),
        (262, 540, 10, 10, 20),
        (200, 460, 6, 20, 40),
        (270, 470, 3, 3, 90),
        (210, 560, 30, 4, 30),
    )
    for top, left, high, wide, radiance in windows:
        light[top : top + high, left : left + wide] = radiance
    return EnvironmentMap(light.astype(np.float32), LatLong())


def experiment(light: EnvironmentMap, facing: np.ndarray, turn: np.ndarray, film: Film, views: int) -> dict[str, float]:
    """The saturated area of the blurred radiance, the blurred photograph and a straight blur, relative to the truth's.

    turn : (3,) rotation vector of the camera during the exposure
    """
    view = View(FOCAL_LENGTH)
    sharp = perspective_view(light, facing, FIELD, SIZE).radiance
    truth = np.zeros(sharp.shape)
    for time in (np.arange(views) + 0.5) / views - 0.5:
        rotation = facing @ Rotation.from_rotvec(time * turn).as_matrix()
        truth += perspective_view(light, rotation, FIELD, SIZE).radiance / views
    camera = TurningCamera(turn[1], turn[0], turn[2])
    seen = camera.coverage(sharp.shape[:2], view) > 0.999

    def area(values: np.ndarray) -> float:
        return float(np.mean((values > SATURATED)[seen]))

    photograph = (film.pixel_values(sharp) / 255).astype(np.float32)
    whole = area(film.pixel_values(truth) / 255)
    assert whole > 0.03
    return {
        "radiance": area(film.pixel_values(camera.apply(sharp, view)) / 255) / whole,
        "photograph": area(camera.apply(photograph, view)) / whole,
        "straight": area(film.pixel_values(StraightMotion(PIXELS).apply(sharp, view)) / 255) / whole,
    }


def film_of(camera: VirtualCamera, exposure: float) -> Film:
    """A film of a camera's own curve."""
    return Film(exposure, Response(camera.log_exposure(), np.ones(3)))


def test_radiance_blurred_then_photographed_saturates_where_a_moving_camera_does():
    turn = np.array([0.0, PIXELS / FOCAL_LENGTH, 0.0])
    areas = experiment(church(), np.eye(3), turn, Film(), views=50)
    assert areas["radiance"] == pytest.approx(1, abs=0.05)
    assert areas["photograph"] < 0.2


def test_so_it_does_along_an_arc_where_a_straight_line_does_not():
    turn = np.array([0.05, PIXELS / FOCAL_LENGTH, 0.2])
    areas = experiment(church(), np.eye(3), turn, film_of(VirtualCamera(), 0.7), views=50)
    assert areas["radiance"] == pytest.approx(1, abs=0.05)
    assert areas["photograph"] < 0.2
    assert abs(areas["straight"] - 1) > 0.06


@pytest.mark.parametrize("name", ["grace", "ennis"])
def test_so_it_does_in_probes_with_bright_windows(shared: Path, name: str):
    light = as_environment(read_radiance(shared / "data" / "probes" / "latlong_small" / f"{name}.hdr"), LatLong())
    row, column, _ = np.unravel_index(np.argmax(light.radiance), light.radiance.shape)
    height, width = light.radiance.shape[:2]
    up, left = np.pi / 2 - (row + 0.5) / height * np.pi, np.pi - (column + 0.5) / width * 2 * np.pi
    facing = (Rotation.from_rotvec([0, left, 0]) * Rotation.from_rotvec([up, 0, 0])).as_matrix()
    film = Film(0.5 / float(np.percentile(light.radiance, 90)))
    areas = experiment(light, facing, np.array([0.0, PIXELS / FOCAL_LENGTH, 0.0]), film, views=40)
    assert areas["radiance"] == pytest.approx(1, abs=0.05)
    assert areas["photograph"] < 0.9

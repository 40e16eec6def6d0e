"""A lamp that goes round: where it is in each frame, and how that is found."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from relume.errors import InvalidStage, UnreadableFile
from relume.image import files
from relume.image.files.video import Movie
from relume.image.photograph import Photograph
from relume.lightstage.acquire.ball_highlights import MirrorBall
from relume.lightstage.acquire.read_stage import open_pictures
from relume.lightstage.acquire.rotating_arm import (
    RotatingArm,
    SteadyRotation,
    fit_rings,
    fit_rotation,
    frame_paths,
    lamp_directions,
    stage_of_frames,
    unpack_video,
    video_frames,
)
from relume.probe.ball.silhouette import outline_of_circle


def still(frames_a_turn: float, start: float = 0.0, **options: object) -> RotatingArm:
    """One whose frames show the lamp where it is at their beginning."""
    return RotatingArm(SteadyRotation(1 / frames_a_turn, start + 0.25), **options)  # type: ignore[arg-type]


def test_a_quarter_turn_brings_the_lamp_from_the_front_to_the_right() -> None:
    course = still(8, rings=2, first_inclination=np.pi / 2, step=np.pi / 4)
    directions = course.directions(np.array([0, 2, 4, 6, 8, 16, -1]))
    np.testing.assert_allclose(directions[:4], [[0, 0, 1], [1, 0, 0], [0, 0, -1], [-1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(directions[4], [0, -np.sqrt(0.5), np.sqrt(0.5)], atol=1e-12)
    assert np.isnan(directions[5:]).all()


def test_the_other_sense_is_the_mirror_image() -> None:
    frames = np.arange(16)
    one, other = (still(8, rings=2, clockwise=sense).directions(frames) for sense in (False, True))
    np.testing.assert_allclose(other, one * [-1, 1, 1], atol=1e-12)


def test_the_lamp_is_where_the_middle_of_the_exposure_finds_it() -> None:
    half_open = RotatingArm(SteadyRotation(1 / 8), rings=1, first_inclination=np.pi / 2)
    azimuth = 2 * np.pi * 0.25 / 8
    np.testing.assert_allclose(
        half_open.directions(np.array([0.0])), [[np.sin(azimuth), 0, np.cos(azimuth)]], atol=1e-12
    )


def test_the_paper_s_stage_has_72_frames_a_turn_and_64_columns_of_32_rings() -> None:
    course = RotatingArm(SteadyRotation(25 / 60 / 30, 10.0))
    frames, lights = course.grid_lights(64, 10 + 72 * 32 + 5)
    assert lights.grid == (32, 64) and len(lights) == 2048
    assert lights.names[0] == f"frame_{frames[0]:06d}"
    inclination = np.arccos(lights.directions[:, 1]).reshape(32, 64)
    np.testing.assert_allclose(inclination[5], 5.5 * np.pi / 32, atol=1e-9)
    azimuth = np.arctan2(lights.directions[:, 0], lights.directions[:, 2]).reshape(32, 64) % (2 * np.pi)
    wanted = (np.arange(64) + 0.5) / 64 * 2 * np.pi
    assert np.abs(azimuth[7] - wanted).max() <= np.pi / 72 + 1e-9


def test_a_film_that_is_too_short_or_too_fast_is_refused() -> None:
    with pytest.raises(InvalidStage, match=r"revolutions 0\.00 to 1\.88, not the 4 rings"):
        still(8, rings=4).grid_lights(8, 16)
    with pytest.raises(InvalidStage, match=r"8\.0 frames a turn are fewer than 12 columns"):
        still(8, rings=2).grid_lights(12, 18)
    with pytest.raises(ValueError, match="turn slower"):
        SteadyRotation(0.7)


@pytest.mark.parametrize("clockwise", [False, True])
def test_the_turning_is_found_from_what_the_ball_shows(clockwise: bool) -> None:
    course = RotatingArm(
        SteadyRotation(1 / 47.3, 21.7), rings=9, first_inclination=0.2, step=0.3, start_azimuth=0.5, clockwise=clockwise
    )
    generator = np.random.default_rng(3)
    shown = course.directions(np.arange(460))
    shown += generator.normal(0, 0.01, shown.shape)
    shown[generator.random(460) < 0.3] = np.nan
    wrong = generator.choice(460, 20)
    shown[wrong] = generator.normal(0, 1, (20, 3))
    shown /= np.linalg.norm(shown, axis=1, keepdims=True)
    rotation = fit_rotation(shown[22:], start_azimuth=0.5, clockwise=clockwise)
    assert 1 / rotation.revolutions_per_frame == pytest.approx(47.3, abs=0.05)
    assert (rotation.start + 22 - 21.7 + 20) % 47.3 - 20 == pytest.approx(0, abs=0.3)
    first, step = fit_rings(shown, SteadyRotation(1 / 47.3, 21.7))
    assert (first, step) == (pytest.approx(0.2, abs=0.02), pytest.approx(0.3, abs=0.005))


def test_frames_in_which_the_ball_shows_no_lamp_are_gaps() -> None:
    rows, columns = np.indices((60, 60)) + 0.5
    ball = MirrorBall(outline_of_circle(30.0, 30.0, 20.0))
    lit = np.where(np.hypot(columns - 40, rows - 30) < 2, 250, 3)[..., None].repeat(3, axis=2).astype(np.uint8)
    directions = lamp_directions([lit, np.full_like(lit, 3)], ball)
    np.testing.assert_allclose(directions[0], [np.sqrt(0.75), 0, 0.5], atol=1e-6)
    assert np.isnan(directions[1]).all()


def test_what_does_not_turn_is_reported() -> None:
    random = np.random.default_rng(1).normal(0, 1, (100, 3))
    with pytest.raises(InvalidStage, match="no steady rotation"):
        fit_rotation(random / np.linalg.norm(random, axis=1, keepdims=True))
    with pytest.raises(InvalidStage, match="seen in 0 frames"):
        fit_rotation(np.full((100, 3), np.nan))


def frame(index: int) -> np.ndarray:
    return np.full((32, 48, 3), 40 + 10 * index, np.uint8)


def test_a_video_becomes_a_stage(tmp_path: Path) -> None:
    pytest.importorskip("av")
    with Movie(tmp_path / "spin.mp4", 30) as movie:
        for index in range(16):
            movie.add(frame(index))
    course = still(8, rings=2, first_inclination=0.5, step=1.0)
    field = open_pictures(unpack_video(tmp_path / "spin.mp4", tmp_path, partial(course.grid_lights, 4)), tmp_path)
    assert field.lights.grid == (2, 4) and field.shape == (32, 48)
    assert field.lights.names[0] == "frame_000001"
    seen = field.block(slice(0, 8), slice(0, 1))[:, 0, 0, 1]
    numbers = np.array([int(name[-6:]) for name in field.lights.names])
    values = (40 + 10 * numbers) / 255
    np.testing.assert_allclose(seen, ((values + 0.055) / 1.055) ** 2.4, atol=0.03)
    np.testing.assert_allclose(field.lights.directions, course.directions(numbers), atol=1e-12)


def test_a_folder_of_frames_is_a_stage_as_it_lies(tmp_path: Path) -> None:
    for index in range(16):
        files.write(tmp_path / f"f{index}.png", Photograph(frame(index)))
    paths = frame_paths(tmp_path)
    assert [path.name for path in paths[9:11]] == ["f9.png", "f10.png"]
    assert len(open_pictures(stage_of_frames(paths, partial(still(8, rings=2).grid_lights, 8)), tmp_path).lights) == 16
    with pytest.raises(InvalidStage, match="no frames"):
        (tmp_path / "empty").mkdir()
        frame_paths(tmp_path / "empty")


def test_what_is_no_video_is_reported_in_one_line(tmp_path: Path) -> None:
    pytest.importorskip("av")
    (tmp_path / "x.mp4").write_bytes(b"no video" * 20)
    for name in ("x.mp4", "missing.mp4"):
        with pytest.raises(UnreadableFile, match="cannot be read as a video") as caught:
            next(video_frames(tmp_path / name))
        assert "\n" not in str(caught.value)

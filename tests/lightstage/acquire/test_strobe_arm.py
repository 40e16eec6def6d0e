"""An arm of strobes that turns once: where each flash of its film came from."""

from pathlib import Path

import numpy as np
import pytest

import relume as rl
from relume.errors import InvalidStage
from relume.image import files
from relume.image.photograph import Photograph
from relume.lightstage.acquire.strobe_arm import StrobeArm
from relume.lightstage.field.field import whole


def test_frames_run_along_the_arm_first() -> None:
    frames, lights = StrobeArm(2, 4, start=3, drift=0).grid_lights(11)
    # Upper ring first: its flashes are every second frame of the film.
    assert frames.tolist() == [3, 5, 7, 9, 4, 6, 8, 10]
    assert lights.grid == (2, 4) and lights.names[0] == "frame_000003"
    s = np.sqrt(0.5)
    np.testing.assert_allclose(
        lights.directions[:5], [[0, s, s], [s, s, 0], [0, s, -s], [-s, s, 0], [0, -s, s]], atol=1e-12
    )


def test_an_arm_that_turns_steadily_is_farther_at_its_last_lamp() -> None:
    arm = StrobeArm(4, 8, azimuth=0.3, clockwise=True)
    x, y, z = arm.directions().T
    azimuth = np.unwrap(np.arctan2(x, z))
    # One thirty-second of a turn a flash, without a stop, the other way round.
    np.testing.assert_allclose(azimuth, 0.3 - 2 * np.pi * np.arange(32) / 32, atol=1e-12)
    np.testing.assert_allclose(np.arccos(y[:4]), np.pi * np.array([1, 3, 5, 7]) / 8)


def test_strobes_that_flash_upwards_are_the_same_lights() -> None:
    down, up = StrobeArm(3, 4, drift=0), StrobeArm(3, 4, drift=0, upwards=True)
    np.testing.assert_allclose(up.grid_lights(12)[1].directions, down.grid_lights(12)[1].directions, atol=1e-12)
    assert up.grid_lights(12)[0][:4].tolist() == [2, 5, 8, 11]


def test_a_film_that_lacks_flashes_is_refused_and_one_that_goes_on_is_told() -> None:
    with pytest.raises(InvalidStage, match="holds 3 sequences of 30 lamps and 5 more frames from frame 5, not the 4"):
        StrobeArm(30, 4, start=5).grid_lights(100)
    with pytest.warns(UserWarning, match="goes on for 7 frames"):
        StrobeArm(2, 4).grid_lights(15)
    with pytest.raises(ValueError, match="drift 2"):
        StrobeArm(2, 4, drift=2)


def test_a_folder_of_flashes_becomes_a_stage(tmp_path: Path) -> None:
    arm = StrobeArm(4, 6, start=1)
    film = tmp_path / "film"
    film.mkdir()
    # Each frame is even, as bright as the lamp is near +Z.
    shown = np.concatenate([[0.0], 0.5 + 0.4 * arm.directions()[:, 2]])
    for number, value in enumerate(shown):
        pixels = np.full((4, 4, 3), round(255 * value), np.uint8)
        files.write(film / f"f{number}.png", Photograph(pixels, "f"))
    known = rl.lightstage.Corrections(noise=rl.lightstage.Noise(1e-6))
    settings = rl.lightstage.ImportSettings(film=arm, encoding="linear", corrections=known)
    done = rl.lightstage.import_stage(film, tmp_path / "stage.zarr", settings)
    assert done.lights == 24 and done.field is not None
    field = rl.lightstage.read_stage(tmp_path / "stage.zarr")
    assert field.lights.grid == (4, 6)
    np.testing.assert_allclose(whole(field)[:, 0, 0, 1], 0.5 + 0.4 * field.lights.directions[:, 2], atol=3e-3)

"""examples/films/interface: its files are read, and the robot shows the light of its moment."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import relume as rl
from relume.image.files import read_photograph, write
from relume.project.scene_file.rendering import render_scene

EXAMPLE = Path(__file__).parents[2] / "examples" / "films" / "interface"


@pytest.fixture
def film(tmp_path: Path) -> Path:
    """The example with small maps: even grey, and a lamp ahead of the robot that is red, then blue."""
    folder = tmp_path / "interface"
    shutil.copytree(EXAMPLE, folder, ignore=shutil.ignore_patterns("probe", "out"))
    (folder / "probe").mkdir(exist_ok=True)
    for frame in range(1, 38):
        radiance = np.full((16, 32, 3), 0.2, np.float32)
        radiance[5:11, :5] = radiance[5:11, -5:] = (2, 0, 0) if frame < 14 else (0, 0, 2)
        write(folder / "probe" / f"map_{frame:04d}.hdr", rl.as_radiance_map(rl.EnvironmentMap(radiance)))
    return folder


def test_the_robot_shows_the_light_of_its_moment(film: Path):
    read = rl.read_scene(film / "scene.toml", size=(80, 60))
    for frame, brighter, darker in ((10, 0, 2), (60, 2, 0)):
        out = film / f"{frame}.png"
        with pytest.warns(UserWarning, match="no shadows"):
            render_scene(read, out, rl.RenderSettings(renderer="prefiltered", frames=str(frame)))
        # The robot's head, left of the middle of the picture and above.
        head = read_photograph(out).pixels[8:22, 32:48].astype(float)
        assert head[..., brighter].mean() > 1.3 * head[..., darker].mean()


def test_the_room_moves_as_long_as_the_film(film: Path):
    room, scene = (rl.read_scene(film / name) for name in ("room.toml", "scene.toml"))
    assert room.sequence is not None and scene.sequence is not None and scene.sequence.maps is not None
    assert len(scene.sequence.maps.paths) == len(room.sequence.table.frames)
    pictures = scene.sequence.table
    assert scene.sequence.maps.seconds == pytest.approx((len(pictures.frames) - 1) / pictures.rate)
    there, back = (room.at_frame(frame)[0].objects[8] for frame in (14, 37))
    assert isinstance(there, rl.Sphere) and isinstance(back, rl.Sphere)
    # Her head at the kiss is nearer to the robot's than its own radius and hers, and far away at the end.
    assert np.linalg.norm(np.subtract(there.centre, (0, 1.22, 0))) < 0.4
    assert back.centre[2] > 3


def test_the_bodies_are_what_their_script_makes():
    import runpy

    made = runpy.run_path(str(EXAMPLE / "models.py"))
    for name, profile in made["PARTS"].items():
        assert (EXAMPLE / name).read_text(encoding="utf-8") == made["turned"](profile)

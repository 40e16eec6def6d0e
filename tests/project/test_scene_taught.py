"""Scene files by the renderers for teaching: the measured Cornell box, what they take and what they refuse."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import relume as rl
from command_line import refused, reported
from cornell_box import cornell_box, cornell_camera
from relume.renderers.diffuse.scenes import DiffuseScene

BOX = Path(__file__).parents[2] / "examples" / "cornell_box" / "measured.toml"
CORNER = """
[camera]
position = [1, 1, 3]
target = [0, 0.5, 0]
field_of_view = 40
size = [8, 8]
[materials.grey]
kind = "diffuse"
reflectance = 0.6
[materials.red]
kind = "diffuse"
reflectance = [0.8, 0.1, 0.1]
[materials.lamp]
kind = "pbr"
specular = 0
emission = [5, 5, 5]
[[objects]]
polygon = [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]
material = "grey"
[[objects]]
polygon = [[-1, 0, -1], [-1, 2, -1], [-1, 2, 1], [-1, 0, 1]]
material = "red"
[[objects]]
polygon = [[-0.5, 2, -0.5], [0.5, 2, -0.5], [0.5, 2, 0.5], [-0.5, 2, 0.5]]
material = "lamp"
"""


def test_the_scene_file_is_the_published_box():
    read, camera = rl.read_scene(BOX), cornell_camera(32)
    np.testing.assert_allclose(read.camera.focal_length / read.camera.width, 35 / 25, rtol=1e-4)
    rays = camera.rays().reshape(-1, 3)
    origins = np.tile(camera.position, (len(rays), 1))
    file, made = (DiffuseScene.of(scene, "the test").look(origins, rays) for scene in (read.scene, cornell_box()))
    assert made.hit.sum() > 900
    np.testing.assert_allclose(file.distance, made.distance, rtol=1e-5)
    np.testing.assert_allclose(file.reflectance, made.reflectance)
    np.testing.assert_allclose(file.emission, made.emission)


def test_a_picture_by_name_shows_emission_and_colours(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    (tmp_path / "corner.toml").write_text(CORNER, encoding="utf-8")
    means = []
    for name in ("radiosity", "irradiance-cache"):
        out = tmp_path / "corner.hdr"
        command = ["render", tmp_path / "corner.toml", "--renderer", name, "--samples", 9, "--seed", 3, "-o", out]
        assert reported(command, capsys)["renderer"] == name
        seen = rl.read_radiance(out).radiance
        assert seen.shape == (8, 8, 3)
        assert seen[-1, :, 0].mean() > 1.05 * seen[-1, :, 1].mean() > 0
        means.append(seen[4:].mean())
    np.testing.assert_allclose(means[0], means[1], rtol=0.15)


def test_they_are_chosen_by_nothing_but_their_name():
    read = rl.read_scene(BOX)
    for settings in (rl.RenderSettings(samples=4), rl.RenderSettings(seed=1), rl.RenderSettings()):
        made = rl.render_scene(read, "box.exr", settings, dry_run=True)
        assert made.renderer == "mitsuba"


def test_other_renderers_settings_and_other_scenes_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "box.exr"
    line = refused(["render", BOX, "--renderer", "radiosity", "--rays", 4, "-o", out], capsys)
    assert "rays is for the renderer whitted" in line
    settings = rl.RenderSettings(renderer="radiosity")
    with pytest.raises(ValueError, match="radiosity has no parts for workers"):
        rl.render_scene(rl.read_scene(BOX), out, settings, cluster="local:2")
    shiny = tmp_path / "shiny.toml"
    shiny.write_text(BOX.read_text(encoding="utf-8").replace("specular = 0 ", "specular = 1 "), encoding="utf-8")
    for name in ("radiosity", "irradiance-cache"):
        line = refused(["render", shiny, "--renderer", name, "--size", "8x8", "-o", out], capsys)
        assert "'lamp' has specular reflection" in line
    assert not out.exists()


def test_frames_of_a_turntable_are_made_one_by_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    scene = tmp_path / "ball.toml"
    scene.write_text(
        """
[camera]
position = [0, 1, 4]
target = [0, 0.5, 0]
field_of_view = 40
size = [8, 8]
[[lights]]
kind = "distant"
towards = [1, 2, 1]
irradiance = 3.0
[materials.clay]
kind = "diffuse"
reflectance = 0.5
[[objects]]
polygon = [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]]
material = "clay"
[[objects]]
sphere = { centre = [0.6, 0.5, 0], radius = 0.5 }
material = "clay"
""",
        encoding="utf-8",
    )
    out = tmp_path / "frames"
    command = ["render", scene, "--renderer", "irradiance-cache", "--frames", 2, "--motion", "turntable", "-o", out]
    reported(command, capsys)
    first, second = (rl.read_photograph(out / f"frame_{n:04d}.png").pixels for n in (1, 2))
    assert np.any(first != second)

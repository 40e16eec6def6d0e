"""What an insertion is said to take before it is begun, and a disk that has no room for it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from relume.cli import main
from relume.errors import OutputNotWritten
from relume.image.files import write
from relume.image.radiance import RadianceMap
from relume.project import forecast as forecasting
from relume.project.forecast import DISK, forecast, require_room
from relume.project.insertion import insert as inserting
from relume.project.insertion import render_tiles
from relume.project.shot_file.objects import placed_meshes
from relume.project.shot_file.shot import read_shot
from relume.scene.cameras.camera import Camera

ROOM = Path(__file__).parents[2] / "examples" / "room"


def test_the_rays_are_those_that_are_traced(tmp_path, monkeypatch):
    samples = 32
    for name, value in {"VIEWED": 1350, "SIDE": 48, "BORDER": 4, "PILOT": 1500}.items():
        monkeypatch.setattr(render_tiles, name, value)
    monkeypatch.setattr(forecasting, "PROBE", 1500)
    write(tmp_path / "plate.exr", RadianceMap(np.full((60, 90, 3), 0.3, np.float32)))
    write(tmp_path / "light.exr", RadianceMap(np.ones((16, 32, 3), np.float32), attributes={"mapping": "latlong"}))
    path = tmp_path / "shot.toml"
    path.write_text(
        '[plate]\nphotographs = "plate.exr"\n[camera]\nfocal_length = 110\n'
        "pose = { position = [0.2, 0.6, 1.0], look_at = [0.2, 0.0, 0.1] }\n"
        '[light]\nmap = "light.exr"\n[[local]]\nshape = "plane"\nsize = [1.0, 1.0]\nreflectance = [0.3, 0.3, 0.3]\n'
        f'[match]\nsharpness = false\ngrain = false\n[[objects]]\nmesh = "{ROOM}/objects/cube_gold.glb"\n'
        f"[render]\nsamples = {samples}\npreview = false\n"
    )
    shot = read_shot(path)
    done = inserting.insert(shot, tmp_path / "out")
    expected = forecast(shot, done.camera, placed_meshes(shot))
    assert expected is not None and expected.total == pytest.approx(expected.rays * 5400)
    # The result counts whole rays, rounded up.
    assert expected.rays == pytest.approx(done.change.samples, rel=0.25, abs=1.0)
    assert expected.rays < samples and expected.seconds > 25 and expected.disk == pytest.approx(DISK * 5400)


def test_a_picture_that_is_looked_at_pixel_by_pixel_gets_the_rays_it_asks_for(monkeypatch):
    monkeypatch.setattr(forecasting, "PROBE", 2000)
    shot = read_shot(ROOM / "shot.toml")
    camera = Camera.looking_at(np.array([0.25, 0.55, 1.15]), np.zeros(3), width=768, height=512, focal_length=1000)
    expected = forecast(shot, camera, placed_meshes(shot))
    assert expected is not None and expected.rays == 64
    assert expected.total == 64 * 768 * 512 and 1e9 < expected.memory < 1.5e9


def test_a_disk_without_room_is_said_before_anything_is_done(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(forecasting, "disk_usage", lambda folder: SimpleNamespace(free=100_000_000))
    monkeypatch.setattr(inserting, "calibrate", lambda *_: pytest.fail("work was begun"))
    out = tmp_path / "new" / "out"
    assert main(["insert", str(ROOM / "shot.toml"), "-o", str(out)]) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{out}: a plate of 0.393 megapixels needs up to 0.17 GB there while it is worked on" in line
    assert "and 0.1 GB are free; make room, or choose another -o" in line
    assert not out.exists()


def test_what_an_earlier_run_left_counts_as_room(tmp_path, monkeypatch):
    monkeypatch.setattr(forecasting, "disk_usage", lambda folder: SimpleNamespace(free=DISK * 1000 - 100))
    with pytest.raises(OutputNotWritten, match="make room"):
        require_room(tmp_path, 1000)
    (tmp_path / "stages").mkdir()
    (tmp_path / "stages" / "render.npz").write_bytes(bytes(100))
    require_room(tmp_path, 1000)

"""What an insertion is said to take before it is begun, and a disk that has no room for it."""

from __future__ import annotations

import time
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
from relume.renderers.mitsuba import differential
from relume.renderers.mitsuba.differential import Differential
from relume.scene.cameras.camera import Camera

ROOM = Path(__file__).parents[2] / "examples" / "room"
LARGE = [
    *((render_tiles, name, value) for name, value in {"VIEWED": 1350, "SIDE": 48, "BORDER": 4, "PILOT": 1500}.items()),
    (forecasting, "PROBE", 1500),
]
SPREAD = [(differential, "SPREAD_RAYS", 5400)]
"""So that so small a plate is rendered as a large one, and as one whose rays are spread."""


@pytest.mark.parametrize(("samples", "limits"), [(32, LARGE), (128, SPREAD)], ids=["in tiles", "spread by noise"])
def test_the_rays_are_those_that_are_traced(tmp_path, monkeypatch, samples, limits):
    for module, name, value in limits:
        monkeypatch.setattr(module, name, value)
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


def test_a_picture_that_is_looked_at_pixel_by_pixel_gets_the_rays_that_its_noise_asks_for(monkeypatch):
    monkeypatch.setattr(forecasting, "PROBE", 50_000)
    shot, meshes = read_shot(ROOM / "shot.toml"), placed_meshes(read_shot(ROOM / "shot.toml"))
    camera = Camera.looking_at(np.array([0.25, 0.55, 1.15]), np.zeros(3), width=768, height=512, focal_length=1000)
    expected = forecast(shot, camera, meshes)
    assert expected is not None and 16 < expected.rays < 56
    assert expected.total == pytest.approx(expected.rays * 768 * 512) and 1e9 < expected.memory < 1.5e9
    # Too small to be spread, or a noise that may need all of them.
    small = forecast(shot, camera.resized(192, 128), meshes)
    noisy = forecast(shot.model_copy(update={"render": shot.render.model_copy(update={"noise": 0.01})}), camera, meshes)
    assert small is not None and small.rays == 64 and noisy is not None and expected.rays < noisy.rays <= 64
    # What moves while the shutter is open: each pass sees another moment.
    film = shot.model_copy(update={"sequence": SimpleNamespace(shutter=(-0.25, 0.25))})
    blurred = forecast(film, camera, meshes)
    assert blurred is not None and blurred.rays == 64


def test_the_time_is_that_of_the_small_renders_rays(monkeypatch):
    """All of its passes come at once: between the first and the last there is no time."""
    monkeypatch.setattr(forecasting, "PROBE", 20_000)
    shot, spent, change = read_shot(ROOM / "shot.toml"), [], Differential.change

    def timed(self, scene, camera, **given):
        begun = time.perf_counter()
        made = change(self, scene, camera, **given)
        spent.append((time.perf_counter() - begun) / (made.samples * camera.width * camera.height))
        return made

    monkeypatch.setattr(Differential, "change", timed)
    camera = Camera.looking_at(np.array([0.25, 0.55, 1.15]), np.zeros(3), width=768, height=512, focal_length=1000)
    expected = forecast(shot, camera, placed_meshes(shot))
    assert expected is not None
    tracing = expected.seconds - forecasting.START - forecasting.A_MEGAPIXEL * 0.768 * 0.512
    assert 0.1 * spent[-1] < tracing / expected.total < spent[-1]


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

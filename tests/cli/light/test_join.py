"""`relume edit --over`: one environment map over another, and what is refused."""

from dataclasses import replace

import numpy as np

from command_line import refused, reported
from relume.image.files import read_radiance, write
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap


def test_over_puts_another_map_under_the_horizon(tmp_path, capsys):
    for name, value in (("sky", 3.0), ("ground", 1.0)):
        write(tmp_path / f"{name}.exr", as_radiance_map(EnvironmentMap(np.full((16, 32, 3), value, np.float32))))
    out = tmp_path / "whole.exr"
    words = ["edit", tmp_path / "sky.exr", "--over", tmp_path / "ground.exr", "-o", out]
    facts = reported([*words, "--horizon", "0", "--soft", "0"], capsys)
    assert facts["edits"] == ["over ground.exr, above 0°, soft over 0°"]
    found = read_radiance(out).radiance
    np.testing.assert_array_equal(found[:8], 3)
    np.testing.assert_array_equal(found[8:], 1)


def test_over_refuses_what_contradicts_itself(tmp_path, capsys):
    light = as_radiance_map(EnvironmentMap(np.ones((16, 32, 3), np.float32)))
    write(tmp_path / "sky.exr", light)
    write(tmp_path / "calibrated.exr", replace(light, unit="cd/m²"))
    words = ["edit", tmp_path / "sky.exr", "-o", tmp_path / "out.exr"]
    assert "give --over MAP too" in refused([*words, "--horizon", "3"], capsys)
    both = ["--over", tmp_path / "sky.exr", "--mask", tmp_path / "sky.exr", "--horizon", "3"]
    assert "give one" in refused([*words, *both], capsys)
    assert "no such file" in refused([*words, "--over", tmp_path / "none.exr"], capsys)
    assert "join: one map is in relative" in refused([*words, "--over", tmp_path / "calibrated.exr"], capsys)
    assert not (tmp_path / "out.exr").exists()

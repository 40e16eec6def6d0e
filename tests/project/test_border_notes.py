"""`insert` says where a real surface should reach further: a cube near the end of its table."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relume.image.files import write
from relume.image.radiance import RadianceMap
from relume.project.insertion.insert import insert
from relume.renderers.mitsuba.differential import Differential
from relume.report.write_report import write_report
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from toml_files import shot_of

CUBE = Path(__file__).parents[2] / "examples/room/objects/cube_gold.glb"
SHOT = f"""
[plate]
photographs = "plate.exr"
[camera]
pose = {{ position = [0, 1.5, 0.6], look_at = [0, 0, 0] }}
focal_length = 110
[light]
map = "light.exr"
[match]
sharpness = false
grain = false
[[objects]]
mesh = "{CUBE}"
size = 0.25
translate = [-0.15, 0, 0]
[render]
preview = false
[[local]]
shape = "plane"
size = """


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path / "plate.exr", RadianceMap(np.full((96, 144, 3), 0.4, np.float32)))
    write(tmp_path / "light.exr", as_radiance_map(EnvironmentMap(np.ones((8, 16, 3), np.float32))))
    return tmp_path


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_table_that_ends_beside_a_cube_is_named_in_notes_and_report(folder):
    renderer = Differential(samples=32, depth=3)
    result = insert(shot_of(folder, SHOT + "[0.9, 1.2]\n"), folder / "short", renderer=renderer)
    lines = [line for line in result.notes if "border of local surface 1" in line]
    assert any("m wider there" in line and "[[local]]" in line for line in lines)
    write_report(result, folder / "report.html")
    assert "border of local surface 1" in (folder / "report.html").read_text(encoding="utf-8")
    wide = insert(shot_of(folder, SHOT + "[8.0, 8.0]\n"), folder / "wide", renderer=renderer)
    assert not any("border of local surface" in line for line in wide.notes)

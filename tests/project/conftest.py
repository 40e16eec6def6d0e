"""The example room, inserted once with the fake renderer: everything but light transport is real.

The table's reflectance is given: the fake lights no surface, so nothing can be recovered by it.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from relume.project.insertion.insert import insert
from relume.project.insertion.outcome import Inserted
from relume.project.shot_file.shot import read_shot
from relume.renderers.renderer import ConstantRenderer
from relume.report.write_report import write_report

ROOM = Path(__file__).parents[2] / "examples" / "room"
RIM = (320.0, 320.0, 296.255)
"""Of the ball in its photographs: 5960.26 pixels of focal length, √(20.144² − 1) radii away."""


def copy_of_room(folder: Path) -> Path:
    """The shot file of a copy of the room, with nothing to be found that other tests find.

    Not denoised, as the fake has no noise; its table's reflectance and the balls' rims are given, and of each ball
    four photographs as they lie.
    """
    shutil.copytree(ROOM, folder)
    shot = folder / "shot.toml"
    plate, render = shot.read_text().split("[render]")
    # A small light, and nothing of the plate's look measured: each job would take seconds for either.
    plate = plate.replace("[light]", "[match]\ngrain = false\nsharpness = 0.4\n\n[light]\nsize = 128")
    known = f"rim = {list(RIM)}, align = false, deghost = false, "
    plate = plate.replace('0/*.jpg"], camera = [', f'0/IMG_000[1357].jpg"], {known}camera = [')
    assert plate.count(known) == 2
    plate = plate.replace('reflectance = "recover"\ngloss = "recover"', "reflectance = [0.4, 0.3, 0.2]")
    assert 'recover"' not in plate
    shot.write_text(plate + "[render]" + render.replace("denoise = true", "denoise = false"))
    return shot


@pytest.fixture(scope="session")
def room(tmp_path_factory: pytest.TempPathFactory) -> tuple[Inserted, Path]:
    """The outcome and its folder."""
    folder = tmp_path_factory.mktemp("room")
    out = folder / "out"
    result = insert(read_shot(copy_of_room(folder / "room")), out, renderer=ConstantRenderer((3.0, 2.0, 1.0)))
    write_report(result, out)
    return result, out


@pytest.fixture
def copied_room(room: tuple[Inserted, Path], tmp_path: Path) -> tuple[Path, Path]:
    """A shot file that may be changed, and an output folder that already holds the kept stages."""
    shot = copy_of_room(tmp_path / "room")
    out = tmp_path / "out"
    shutil.copytree(room[1], out)
    return shot, out

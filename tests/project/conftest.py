"""The example room, inserted once with the fake renderer at half its width: everything but light transport is real.

The table's reflectance is given: the fake lights no surface, so nothing can be recovered by it.
"""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from half_room import RIM, write_half_room
from relume.project.insertion.insert import insert
from relume.project.insertion.outcome import Inserted
from relume.project.shot_file.shot import read_shot
from relume.renderers.renderer import ConstantRenderer
from relume.report.write_report import write_report


def copy_of_room(source: Path, folder: Path) -> Path:
    """The shot file of a copy of the room, with nothing to be found that other tests find.

    Not denoised, as the fake has no noise; its table's reflectance and the balls' rims are given, and of each ball
    four photographs as they lie.
    """
    shutil.copytree(source, folder)
    shot = folder / "shot.toml"
    plate, render = shot.read_text().split("[render]")
    # A small light, and nothing of the plate's look measured: each job would take seconds for either.
    plate = plate.replace("[light]", "[match]\ngrain = false\nsharpness = 0.4\n\n[light]\nsize = 128")
    known = f"rim = {[each / 2 for each in RIM]}, align = false, deghost = false, "
    plate = plate.replace('0/*.jpg"], camera = [', f'0/IMG_000[1357].jpg"], {known}camera = [')
    assert plate.count(known) == 2
    plate = plate.replace('reflectance = "recover"\ngloss = "recover"', "reflectance = [0.4, 0.3, 0.2]")
    assert 'recover"' not in plate
    shot.write_text(plate + "[render]" + render.replace("denoise = true", "denoise = false"))
    return shot


@pytest.fixture(scope="session")
def half_room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example room, its photographs at half their width; nothing in it may be changed."""
    folder = tmp_path_factory.mktemp("half") / "room"
    write_half_room(folder)
    return folder


@pytest.fixture(scope="session")
def room(tmp_path_factory: pytest.TempPathFactory, half_room: Path) -> tuple[Inserted, Path]:
    """The outcome and its folder."""
    folder = tmp_path_factory.mktemp("room")
    out = folder / "out"
    shot = read_shot(copy_of_room(half_room, folder / "room"))
    result = insert(shot, out, renderer=ConstantRenderer((3.0, 2.0, 1.0)))
    write_report(result, out)
    return result, out


@pytest.fixture
def copied_room(room: tuple[Inserted, Path], half_room: Path, tmp_path: Path) -> tuple[Path, Path]:
    """A shot file that may be changed, and an output folder that already holds the kept stages."""
    shot = copy_of_room(half_room, tmp_path / "room")
    out = tmp_path / "out"
    shutil.copytree(room[1], out)
    return shot, out

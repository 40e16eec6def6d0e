"""The README's program runs as it stands, and the long one of docs/how-to/python.md with fewer rays and pixels."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import relume as rl
from half_room import smaller

REPOSITORY = Path(__file__).parents[1]


def block(page: str, after: str = "") -> str:
    """The first program on a page after a heading."""
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    code = re.search(r"```python\n(.*?)```", text[text.index(after) :], re.S)
    assert code is not None
    return code[1]


def test_the_readme_s_program_measures_the_light(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(block("README.md"), "README.md", "exec"), {})
    light = rl.read_environment("light.exr")
    # The window is before the camera's left shoulder, the bulb above the table: both are far brighter than the rest.
    assert light.radiance.max() > 500 * np.median(light.radiance)
    assert light.irradiance(np.array([0.0, 1.0, 0.0]))[0] > light.irradiance(np.array([0.0, -1.0, 0.0]))[0]


def half_the_room(folder: Path) -> None:
    """The example's photographs at half their width, of the ball every second one, and the object."""
    room = REPOSITORY / "examples" / "room"
    for path in (*room.glob("plate/*.jpg"), *room.glob("ball_0/*[13579].jpg"), room / "plate_grid.jpg"):
        copy = folder / path.relative_to(REPOSITORY)
        copy.parent.mkdir(parents=True, exist_ok=True)
        smaller(path, copy, 2)
    objects = folder / "examples" / "room" / "objects"
    objects.mkdir()
    shutil.copy(room / "objects" / "suzanne_plastic.glb", objects)


def test_the_chain_puts_an_object_into_the_photograph(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    half_the_room(tmp_path)
    program = block("docs/how-to/python.md", "## The whole chain, step by step").replace("samples=64", "samples=4")
    monkeypatch.chdir(tmp_path)
    exec(compile(program, "python.md", "exec"), {})
    picture = rl.read_photograph("suzanne.png").pixels.astype(int)
    plate = rl.read_photograph("examples/room/plate/IMG_0003.jpg").pixels.astype(int)
    changed = np.abs(picture - plate).max(-1) > 12
    assert 0.01 < changed.mean() < 0.15
    # The object is green.
    assert (picture[changed][:, 1] > picture[changed][:, 0]).mean() > 0.3


def test_every_file_the_readme_names_is_there() -> None:
    text = (REPOSITORY / "README.md").read_text()
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (REPOSITORY / link).exists(), link

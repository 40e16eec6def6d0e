"""The README's program runs as it stands, with fewer rays."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import relume as rl

REPOSITORY = Path(__file__).parents[1]


def test_the_chain_in_the_readme_puts_an_object_into_the_photograph(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    code = re.search(r"```python\n(.*?)```", (REPOSITORY / "README.md").read_text(), re.S)
    assert code is not None
    program = code[1].replace("samples=64", "samples=4").replace('"suzanne.png"', repr(str(tmp_path / "suzanne.png")))
    monkeypatch.chdir(REPOSITORY)
    exec(compile(program, "README.md", "exec"), {})
    picture = rl.read_photograph(tmp_path / "suzanne.png").pixels.astype(int)
    plate = rl.read_photograph(REPOSITORY / "examples/room/plate/IMG_0003.jpg").pixels.astype(int)
    changed = np.abs(picture - plate).max(-1) > 12
    assert 0.01 < changed.mean() < 0.15
    # The object is green.
    assert (picture[changed][:, 1] > picture[changed][:, 0]).mean() > 0.3


def test_every_file_the_readme_names_is_there() -> None:
    text = (REPOSITORY / "README.md").read_text()
    for link in re.findall(r"\]\(([^)#:]+)\)", text):
        assert (REPOSITORY / link).exists(), link

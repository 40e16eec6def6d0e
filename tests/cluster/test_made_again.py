"""What was made of files is made again where anything that it was made from changed, and read no oftener than needed."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import relume as rl
from relume.cluster.file_tasks import FileTask
from small_brackets import write_brackets


@pytest.fixture(params=["merge", "probe"])
def remade(request, tmp_path, monkeypatch) -> Callable[[], list[bool]]:
    """Make everything of a folder of two brackets, each listed; whether each was kept from before."""
    write_brackets(tmp_path / "in", 2)

    def unwrapped(task: FileTask) -> dict[str, Any]:
        task.targets[0].write_bytes(b"a map")
        return {}

    # Which photographs show a ball is of no account here.
    monkeypatch.setattr(importlib.import_module("relume.probe.probe_each"), "_probed", unwrapped)
    each: Any = rl.capture.merge_each if request.param == "merge" else rl.probe.probe_each

    def make() -> list[bool]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return [made.kept for made in each([tmp_path / "in"], tmp_path / "out")]

    return make


def test_a_corrected_list_of_exposures_makes_anew_what_it_is_beside(remade, tmp_path):
    listed = tmp_path / "in" / "room_0001" / "exposures.csv"
    assert remade() == [False, False]
    assert remade() == [True, True]
    listed.write_text("frame_0.png 1/256\nframe_1.png 1/32\nframe_2.png 1/4\n")
    assert remade() == [False, True]
    before = _seen(tmp_path)
    listed.write_text("frame_0.png 1/128\nframe_1.png 1/16\nframe_2.png 1/2\n")
    assert remade() == [False, True]
    after = _seen(tmp_path)
    if before and after:
        np.testing.assert_allclose(before / after, 2.0, rtol=1e-3)
    assert remade() == [True, True]
    listed.unlink()
    assert remade() == [False, True]


def _seen(folder: Path) -> float | None:
    """The mean radiance of the map of the first bracket; None where it is no map."""
    path = folder / "out" / "room_0001-frame_0-frame_2.exr"
    return float(rl.read_radiance(path).radiance.mean()) if path.exists() else None

"""Warnings point at the line that called relume, and those of a job that failed are not lost."""

from __future__ import annotations

import warnings
from pathlib import Path

import imagecodecs
import numpy as np
import pytest

from relume.capture.brackets.merging import merge_brackets
from relume.errors import Doubt, DoubtWarning, GatheredDoubts, NotABracket, RelumeError, doubt_of, warn
from relume.image.files import write
from relume.image.radiance import RadianceMap
from relume.probe.ball.probing import probe_ball
from relume.probe.ball.view_files import BallPhotographs
from relume.project.insertion.insert import insert
from relume.report.shot_check import check_shot
from toml_files import shot_of

SHOT = """
[plate]
photographs = "*.png"
[camera]
pose = { position = [0.2, 0.5, 1.2], look_at = [0, 0, 0] }
[light]
map = "missing.exr"
"""


def test_a_warning_from_deep_inside_points_at_the_callers_line(tmp_path: Path) -> None:
    variance = np.ones((2, 2, 3), np.float32)
    with pytest.warns(UserWarning, match=r"\.exr keeps") as caught:
        write(tmp_path / "a.hdr", RadianceMap(variance, variance=variance))
    assert {each.filename for each in caught} == {__file__}


def test_what_a_job_warned_of_is_a_doubt_and_no_warning() -> None:
    with GatheredDoubts() as gathered:
        warn("the lamp is white", 0.1)
        warnings.warn("a library's own", UserWarning, stacklevel=1)
    assert gathered.doubts == (Doubt("the lamp is white", 0.1), Doubt("a library's own"))


def test_what_a_failed_job_warned_of_is_said_before_its_error() -> None:
    with pytest.warns(DoubtWarning) as caught, pytest.raises(NotABracket, match="no exposure"):
        with GatheredDoubts():
            warn("the little one")
            warn("the lamp is white", 0.1)
            raise NotABracket("no exposure")
    assert [doubt_of(each.message) for each in caught] == [Doubt("the lamp is white", 0.1), Doubt("the little one")]
    assert {each.filename for each in caught} == {__file__}


def test_where_warnings_are_errors_a_failed_job_raises_its_own() -> None:
    with pytest.raises(NotABracket, match="no exposure"), GatheredDoubts():
        warn("the lamp is white", 0.1)
        raise NotABracket("no exposure")


def test_merge_probe_and_insert_that_fail_say_what_they_warned_of(tmp_path: Path) -> None:
    for name in ("a", "b"):
        pixels = np.full((16, 16, 4), 128, np.uint8)
        (tmp_path / f"{name}.png").write_bytes(imagecodecs.png_encode(pixels))
    with pytest.warns(DoubtWarning, match="alpha is left out"), pytest.raises(NotABracket):
        merge_brackets([tmp_path / "a.png", tmp_path / "b.png"])
    with pytest.warns(DoubtWarning, match="alpha is left out"), pytest.raises(NotABracket):
        probe_ball([BallPhotographs((tmp_path / "a.png", tmp_path / "b.png"))])
    shot = shot_of(tmp_path, SHOT)
    for job in (lambda: insert(shot, tmp_path / "out"), lambda: check_shot(shot)):
        with pytest.warns(DoubtWarning, match="alpha is left out"), pytest.raises(RelumeError):
            job()

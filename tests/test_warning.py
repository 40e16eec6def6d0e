"""Warnings point at the line that called relume."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from relume.image.files import write
from relume.image.radiance import RadianceMap


def test_a_warning_from_deep_inside_points_at_the_callers_line(tmp_path: Path) -> None:
    variance = np.ones((2, 2, 3), np.float32)
    with pytest.warns(UserWarning, match=r"\.exr keeps") as caught:
        write(tmp_path / "a.hdr", RadianceMap(variance, variance=variance))
    assert {each.filename for each in caught} == {__file__}

"""Writing the pictures of a scene's motion: what goes wrong on the way to one names it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from relume.errors import UnsupportedScene
from relume.project.scene_file.pictures import write_frames
from relume.renderers.results import Render
from relume.virtual_camera.film.film import Film


def pictures() -> Iterator[Render]:
    """One picture, and then an error."""
    grey, flat = np.full((4, 6, 3), 0.2, np.float32), np.ones((4, 6), np.float32)
    yield Render(grey, grey, flat, flat, grey, grey)
    raise UnsupportedScene("no light is there")


@pytest.mark.parametrize("out", ["frames", "turn.mp4"])
def test_an_error_on_the_way_to_a_picture_names_its_frame(out, tmp_path: Path):
    with pytest.raises(UnsupportedScene, match=r"^frame 2: no light is there$"):
        write_frames(tmp_path / out, pictures(), Film(), "relative")
    assert (tmp_path / "frames" / "frame_0001.png").exists() == (out == "frames")
    assert not (tmp_path / "turn.mp4").exists()

"""Writing the pictures of a scene's motion: what goes wrong on the way to one names it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from relume.errors import UnsupportedScene
from relume.project.scene_file.frame_plan import FramePlan
from relume.project.scene_file.pictures import make_frames
from relume.renderers.results import Render
from relume.virtual_camera.film.film import Film


@dataclass(frozen=True, eq=False)
class OneAndAnError:
    """The pictures of a motion of which only the first can be made."""

    plan: FramePlan = FramePlan((1, 2), (1, 2), None, 2)
    name: str = "whitted"

    def key(self, number: int, written_with: object) -> str:
        return f"{number}"

    def made(self, report: object, only: Sequence[int], watch: object = None) -> Iterator[Render]:
        grey, flat = np.full((4, 6, 3), 0.2, np.float32), np.ones((4, 6), np.float32)
        for number in only:
            if number > 1:
                raise UnsupportedScene("no light is there")
            yield Render(grey, grey, flat, flat, grey, grey)


@pytest.mark.parametrize("plan", [FramePlan((1, 2), (1, 2), None, 2), FramePlan((1, 2), (1, 2))])
def test_an_error_on_the_way_to_a_picture_names_its_frame(plan: FramePlan, tmp_path: Path):
    with pytest.raises(UnsupportedScene, match=r"^frame 2: no light is there$"):
        make_frames(tmp_path, OneAndAnError(plan), ".png", Film(), "relative")  # pyright: ignore[reportArgumentType]
    assert (tmp_path / "frame_0001.png").exists() and not (tmp_path / "frame_0002.png").exists()

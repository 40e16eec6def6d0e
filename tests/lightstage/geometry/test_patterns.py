"""What a projector shows, and the files of it."""

from __future__ import annotations

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.image import files
from relume.lightstage.geometry.patterns import ProjectorPatterns, read_projector_patterns, write_patterns

SMALL = ProjectorPatterns(40, 20, period=8, steps=4)


def test_the_pictures_are_those_that_are_named():
    assert SMALL.names == (
        *("white", "black", "gray_x0", "gray_x1", "gray_x2", "gray_x3", "gray_y0", "gray_y1", "gray_y2"),
        *("phase_x0", "phase_x1", "phase_x2", "phase_x3", "phase_y0", "phase_y1", "phase_y2", "phase_y3"),
    )
    assert tuple(name for name, _ in SMALL.pictures()) == SMALL.names
    assert all(picture.shape == (20, 40) for _, picture in SMALL.pictures())


def test_gray_code_numbers_the_half_periods():
    shown = dict(SMALL.pictures())
    bits = np.stack([shown[f"gray_x{level}"][0] for level in range(4)]).astype(int)
    codes = np.array([8, 4, 2, 1]) @ bits
    # The printed Gray code of 0 … 9, each half a period of four pixels wide.
    assert codes.tolist() == np.repeat([0, 1, 3, 2, 6, 7, 5, 4, 12, 13], 4).tolist()


def test_cosines_are_shifted_by_a_step_of_the_period():
    shown = dict(SMALL.pictures())
    assert np.allclose(shown["phase_y0"][:3, 0], [0.5 + 0.5 * np.cos(np.pi / 8 * odd) for odd in (1, 3, 5)])
    assert np.allclose(shown["phase_y1"][2:, 5], shown["phase_y0"][:-2, 7])


def test_files_hold_the_light_on_the_srgb_curve(tmp_path):
    written = write_patterns(tmp_path / "shown", SMALL)
    assert len(written) == 18 and all(path.is_file() for path in written)
    # Light of 0.691 and 0.309, as IEC 61966-2-1 encodes it.
    codes = files.read_photograph(tmp_path / "shown" / "phase_x0.png").pixels
    assert abs(int(codes[0, 1, 0]) - 217) <= 1 and abs(int(codes[0, 2, 0]) - 150) <= 1
    assert read_projector_patterns(tmp_path / "shown") == SMALL


def test_what_no_projector_shows_is_refused(tmp_path):
    for wrong, line in (
        ({"period": 5}, "even number"),
        ({"steps": 3}, "4 or more"),
        ({"width": 8}, "more than a period"),
    ):
        with pytest.raises(ValueError, match=line):
            ProjectorPatterns(**{"width": 40, "height": 20, "period": 8, "steps": 4, **wrong})
    with pytest.raises(UnreadableFile, match=r"projector.json: is missing; copy it"):
        read_projector_patterns(tmp_path)
    (tmp_path / "projector.json").write_text('{"width": 40, "wide": 3}')
    with pytest.raises(UnreadableFile, match="does not describe patterns"):
        read_projector_patterns(tmp_path)

"""A rig found from photographs of a board, against the one that they were made with."""

from __future__ import annotations

import numpy as np
import pytest

from relume.errors import GridNotFound
from relume.lightstage.geometry.calibration import calibrate_rig
from relume.lightstage.geometry.patterns import ProjectorPatterns
from relume.lightstage.geometry.rig import read_rig, write_rig
from structured_light import SQUARE, SQUARES, Shooting, as_photographs, boards, rig

RIG = rig(280, 210, distance=0.84, target=np.zeros(3), slant=np.radians(20), field=0.36)
PATTERNS = ProjectorPatterns(320, 240)
SHOOTING = Shooting(exposure=0.9)


@pytest.fixture(scope="module")
def photographs():
    return [as_photographs(each, PATTERNS) for each in boards(RIG, PATTERNS, np.zeros(3), 4, SHOOTING)]


@pytest.fixture(scope="module")
def found(photographs):
    return calibrate_rig(photographs, squares=SQUARES, square=SQUARE)


def test_the_rig_is_the_one_that_photographed(found, tmp_path):
    assert found.residual is not None and max(found.residual) < 0.35
    for seen, true in ((found.camera, RIG.camera), (found.projector, RIG.projector)):
        assert seen.focal_length == pytest.approx(true.focal_length, rel=0.01)
    # As well as it says: four boards at 20° and pictures of 280 pixels do not know it better.
    assert found.focal_deviation is not None and 0.0005 < min(found.focal_deviation) < max(found.focal_deviation) < 0.01
    off = [found.camera.focal_length / RIG.camera.focal_length - 1]
    off.append(found.projector.focal_length / RIG.projector.focal_length - 1)
    assert np.all(np.abs(off) < 3 * np.array(found.focal_deviation))
    assert found.facts()["focal lengths, and so the distance, known within, %"] == pytest.approx(
        [100 * each for each in found.focal_deviation], rel=0.1
    )
    write_rig(tmp_path / "rig.json", found)
    assert read_rig(tmp_path / "rig.json").focal_deviation == found.focal_deviation
    # In the camera's own frame, and so the triangle between the two.
    own = found.placed(RIG.camera).projector
    assert np.linalg.norm(own.position - RIG.projector.position) < 0.003
    assert np.abs(own.rotation - RIG.projector.rotation).max() < np.radians(0.6)


def test_too_few_boards_and_other_boards_are_refused(photographs):
    with pytest.raises(ValueError, match="needs 3 boards, each at another slant, better ten; 2 given"):
        calibrate_rig(photographs[:2], squares=SQUARES, square=SQUARE)
    with pytest.raises(ValueError, match="a board of 9×7 squares of 0 m"):
        calibrate_rig(photographs, squares=SQUARES, square=0)
    with pytest.raises(GridNotFound, match="board 1: no board of 12×5 squares found"):
        calibrate_rig(photographs, squares=(12, 5), square=SQUARE)


def test_boards_of_another_size_or_under_other_patterns_are_refused(photographs):
    first = photographs[0]
    smaller = type(first)(PATTERNS, first.pictures[:, :200], first.clipped[:200], first.colour[:200])
    with pytest.raises(ValueError, match=r"board 3: photographs of 280×200 pixels under .*, but board 1 of 280×210"):
        calibrate_rig([*photographs[:2], smaller], squares=SQUARES, square=SQUARE)
    other = type(first)(ProjectorPatterns(318, 240), first.pictures, first.clipped, first.colour)
    with pytest.raises(ValueError, match=r"board 2: .* patterns of 318×240, .*, but board 1 of .* 320×240"):
        calibrate_rig([first, other, photographs[2]], squares=SQUARES, square=SQUARE)


def test_the_lenses_have_one_term_of_distortion(found):
    for each in (found.camera, found.projector):
        assert each.distortion is not None and each.distortion.k1 != 0
        assert each.distortion == type(each.distortion)(each.distortion.k1)


def test_a_board_in_the_projectors_shade_is_told(photographs):
    first = photographs[0]
    # The cosines reach the left third alone, as where something stands before the projector while they are shown.
    pictures = first.pictures.copy()
    shifted = [PATTERNS.names.index(name) for name in PATTERNS.names if name.startswith("phase")]
    pictures[np.ix_(shifted, range(210), range(95, 280))] = 0.5 * (first["white"] + first["black"])[:, 95:]
    hidden = type(first)(PATTERNS, pictures, first.clipped, first.colour)
    with pytest.raises(
        GridNotFound, match=r"board 1: the projector's patterns are lost in shade, or too dark, at \d+%"
    ):
        calibrate_rig([hidden, *photographs[1:]], squares=SQUARES, square=SQUARE)

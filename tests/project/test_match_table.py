"""The table [match] of a shot file."""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from relume.capture.lens.vignetting import Vignetting
from relume.capture.response.camera_profile import CameraProfile, write_profile
from relume.errors import InvalidShot
from relume.image.response import Response
from relume.project.shot_file.match_table import MatchTable


def test_without_a_table_grain_and_sharpness_are_matched_and_a_pinhole_adds_up():
    table = MatchTable()
    assert table.grain is True and table.sharpness is True and table.vignetting is False
    assert table.mode == "additive" and table.occluder is None and table.aperture is None and table.focus is None


@pytest.mark.parametrize(
    "wanted",
    [
        {"sharpness": 0.6, "vignetting": [-0.3, 0.1], "mode": "ratio", "occluder": "front.png"},
        {"grain": False, "sharpness": False, "vignetting": "cos4"},
        {"aperture": "exif", "focus": 1.2},
        {"aperture": 0.025, "focus": 1.2, "seed": 3},
    ],
)
def test_what_is_given_is_kept(wanted):
    table = MatchTable.model_validate(wanted)
    assert table.model_dump(include=set(wanted)) == wanted


@pytest.mark.parametrize(
    "wrong",
    [
        {"grane": True},
        {"aperture": 0.02},
        {"focus": 1.0},
        {"aperture": -1, "focus": 1},
        {"mode": "screen"},
        {"vignetting": True},
        {"sharpness": -0.5},
    ],
)
def test_what_makes_no_sense_is_refused(wrong):
    with pytest.raises(ValidationError):
        MatchTable.model_validate(wrong)


def test_the_fall_off_is_given_or_of_the_lens_or_from_a_profile(tmp_path):
    response = Response(np.tile(np.linspace(-5, 1, 256), (3, 1)), np.ones(3))
    measured = Vignetting((-0.2, 0.05), (0.49, 0.5))
    write_profile(tmp_path / "camera.json", CameraProfile("A", response, vignetting=measured.to_dict()))

    def found(value: object) -> Vignetting | None:
        return MatchTable.model_validate({"vignetting": value}).vignetting_in(tmp_path, 800.0, (600, 400))

    assert found(False) is None
    assert found([-0.3, 0.1]) == Vignetting((-0.3, 0.1))
    assert found("camera.json") == measured
    # cos⁴ of the angle to the corner, whose tangent is √(300² + 200²) / 800.
    lens = found("cos4")
    assert lens is not None and 1 + sum(lens.coefficients) == pytest.approx((1 + 130_000 / 640_000) ** -2, abs=1e-5)


@pytest.mark.parametrize("name, said", [("bare.json", "bare.json holds no fall-off"), ("none.json", "none.json")])
def test_a_profile_without_a_fall_off_is_refused_in_one_line(tmp_path, name, said):
    response = Response(np.tile(np.linspace(-5, 1, 256), (3, 1)), np.ones(3))
    write_profile(tmp_path / "bare.json", CameraProfile("A", response))
    with pytest.raises(InvalidShot, match=f"^match.vignetting: .*{said}") as refusal:
        MatchTable(vignetting=name).vignetting_in(Path(tmp_path), 800.0, (600, 400))
    assert "\n" not in str(refusal.value)

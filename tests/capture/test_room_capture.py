"""The virtual shoot measured whole, against the radiance photographed: cd/m² by a spot meter, hand-held or not."""

import json

import numpy as np
import pytest

from relume.capture.brackets.merging import merge_brackets
from relume.capture.brackets.result import MergedBracket
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import read_bracket
from relume.capture.scale.absolute import scale_from_spot
from relume.image import files


def measured(shared, folder: str) -> tuple[MergedBracket, dict]:
    """A bracket of the room with the spot meter's reading; the facts beside it."""
    room = shared / "shoots" / "room"
    facts = json.loads((room / "truth" / "shoot.json").read_text())
    (x, y), reading = facts["spot_meter"]["pixel_xy"], facts["spot_meter"]["luminance_cd_m2"]
    settings = MergeSettings(scale=lambda picture, *_: scale_from_spot(picture, x, y, reading))
    bracket = read_bracket(sorted((room / folder).glob("*.jpg")))
    return merge_brackets(bracket, settings=settings).brackets[0], facts


def test_a_spot_metered_plate_is_in_candelas(shared):
    found, _ = measured(shared, "plate")
    truth = files.read_radiance(shared / "shoots/room/truth/plate.exr")
    assert found.picture.unit == truth.unit == "cd/m²"
    ratio = found.picture.radiance / truth.radiance
    # The spot is a disc of pixels and the reading one pixel's: 1 % of scale. Colours: a third of a percent.
    assert np.median(ratio, axis=(0, 1)) == pytest.approx([1, 1, 1], abs=0.012)
    assert np.ptp(np.median(ratio, axis=(0, 1))) < 0.006
    assert np.median(np.abs(np.log(ratio / np.median(ratio, axis=(0, 1))))) < 0.007
    assert found.aligned is not None and not found.aligned.moved
    assert found.deghosted is not None and not found.deghosted.ghosts.any()
    assert not [doubt for doubt in found.doubts if doubt.degraded]


def test_the_hand_s_motion_is_found(shared):
    found, facts = measured(shared, "plate_handheld")
    assert found.aligned is not None
    photographs, motions = found.aligned.bracket.photographs, found.aligned.motions
    width, height = photographs[0].size
    corners = np.array([[x * width / 2, y * height / 2] for x in (-1, 1) for y in (-1, 1)])

    def recorded(name: str, places: np.ndarray) -> np.ndarray:
        """Where a place of the unmoved picture is in a photograph, as the shoot's own record has it."""
        motion = next(m for m in facts["handheld_motion"] if name.endswith(m["photograph"]))
        cosine, sine = np.cos(-motion["rotation_rad"]), np.sin(-motion["rotation_rad"])
        moved = places @ np.array([[cosine, -sine], [sine, cosine]]).T
        return moved - [motion["dx_px"], motion["dy_px"]]

    # The record is against the shoot's unmoved picture, ours against the reference: compare where both lead.
    reference = photographs[found.aligned.reference].name
    errors = [
        np.linalg.norm(motion.apply(recorded(reference, corners)) - recorded(photograph.name, corners), axis=1).max()
        for photograph, motion in zip(photographs, motions, strict=True)
    ]
    assert max(errors) < 0.1, errors

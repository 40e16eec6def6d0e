"""Frames whose automatic white balance differs are brought to one white before they are merged."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from relume.capture.brackets.merging import merge_brackets
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.white_balance import of_one_white
from relume.image.photograph import Exposure, Settings
from shoots import exposed, textured

WARM = np.array([1.45, 1.0, 0.7])
"""The white of the two longest frames beside that of the others."""
EXPOSURES = [Exposure(2.0**stop) for stop in (-9, -7.5, -6, -4.5, -3)]
PLAIN = MergeSettings(align=False, deghost=False)


def bracket(white: np.ndarray, automatic: bool | None) -> Bracket:
    scene = textured(240, 160)
    frames = [*exposed(scene, EXPOSURES[:3], prefix="a"), *exposed(scene * white, EXPOSURES[3:], prefix="b")]
    settings = Settings(automatic_white=automatic)
    return Bracket(tuple(replace(frame, settings=settings) for frame in frames))


def test_what_automatic_white_balance_did_is_undone() -> None:
    fixed = bracket(np.ones(3), False)
    changed = bracket(WARM, True)
    with pytest.warns(
        UserWarning, match=r"^b0\.png and 1 more: automatic white balance moved colours by up to 1\.\d st"
    ):
        found = of_one_white(changed)
    assert found.photographs[2] is changed.photographs[2]
    # The colour of the longest frame beside the same frame's without the change.
    for index in (3, 4):
        was, now, then = (each.photographs[index].pixels.astype(float) for each in (changed, found, fixed))
        seen = np.all((then > 40) & (then < 215), axis=-1)
        before, after = (np.median((each / then)[seen], axis=0) for each in (was, now))
        assert np.ptp(np.log(before)) > 0.2
        assert np.ptp(np.log(after)) < 0.2 * np.ptp(np.log(before))


def test_a_merge_has_one_white_and_says_so_once() -> None:
    truth = merge_brackets(bracket(np.ones(3), False), settings=PLAIN).picture.radiance
    result = merge_brackets(bracket(WARM, True), settings=PLAIN)
    assert sum("automatic white balance" in line for line in (*result.messages, *result.notes, *result.warnings)) <= 2
    assert not any("its colours differ" in line for line in result.warnings)
    spoilt = merge_brackets(bracket(WARM, None), settings=PLAIN).picture.radiance
    errors = []
    for radiance in (result.picture.radiance, spoilt):
        ratio = np.log(radiance / truth)
        errors.append(np.median(np.abs(ratio - ratio.mean(-1, keepdims=True))))
    assert errors[0] < 0.4 * errors[1]


def test_frames_that_agree_or_were_set_by_hand_are_left() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for each in (bracket(np.ones(3), True), bracket(WARM, False), bracket(WARM, None)):
            assert of_one_white(each) is each


def test_white_and_black_stay() -> None:
    changed = bracket(WARM, True)
    with pytest.warns(UserWarning, match="automatic white balance"):
        found = of_one_white(changed)
    for was, now in zip(changed.photographs, found.photographs, strict=True):
        assert np.all(now.pixels[was.pixels == 255] == 255)
        assert np.all(now.pixels[was.pixels == 0] == 0)

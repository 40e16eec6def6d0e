"""Places of the projector in photographs of a slanted wall, whose places are known, and what is not believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.errors import UnreadableFile
from relume.lightstage.geometry.decoding import DecodingSettings, decoded_places
from relume.lightstage.geometry.pattern_photographs import PatternPhotographs, read_pattern_photographs
from relume.lightstage.geometry.patterns import ProjectorPatterns
from structured_light import ALBEDO, Seen, Shooting, as_photographs, pictures, write_photographs

PATTERNS = ProjectorPatterns(320, 240)
SIZE = (60, 80)


def wall(rays: int = 1) -> Seen:
    """A wall of which pixel (i, j) shows projector place (70.3 + 2.13 j + 0.31 i, 91.7 + 1.1 i − 0.2 j)."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    places = np.stack([70.3 + 2.13 * columns + 0.31 * rows, 91.7 + 1.1 * rows - 0.2 * columns], axis=-1)
    return Seen(places.reshape(-1, 2), np.ones(rows.size), SIZE, rays)


def shot(shooting: Shooting = Shooting(exposure=0.8), seed: int = 0) -> PatternPhotographs:
    return as_photographs(pictures(wall(), PATTERNS, shooting, seed), PATTERNS)


def test_places_are_those_that_are_seen():
    found = decoded_places(shot())
    off = found.places - wall().places.reshape(*SIZE, 2)
    assert found.known.mean() > 0.99
    assert np.abs(off[found.known]).max() < 0.1  # of a projector pixel; a wrong period would be off by 16
    assert np.sqrt(np.mean(off[found.known] ** 2)) < 0.025


def test_deviations_are_those_of_repeated_photographs():
    several = [decoded_places(shot(Shooting(exposure=0.8, noise=(0.01, 0.01)), seed)) for seed in range(12)]
    seen = np.nanstd([each.places for each in several], axis=0, ddof=1)
    said = np.nanmean([each.deviation for each in several], axis=0)
    assert np.sqrt(np.mean(seen**2)) == pytest.approx(np.sqrt(np.mean(said**2)), rel=0.1)


@pytest.mark.parametrize("scattered", [0.0, 0.3, 0.6])
def test_the_direct_share_is_what_is_not_scattered(scattered):
    found = decoded_places(shot(Shooting(exposure=0.8, scattered=scattered, blur=0.01)))
    assert np.median(found.direct) == pytest.approx(1 - scattered, abs=0.02)


def test_scattered_light_is_not_believed():
    muddy = shot(Shooting(exposure=0.8, scattered=0.85))
    with pytest.raises(ValueError, match=r"read on 0\.0% of the picture: 0% lies in shade"):
        decoded_places(muddy)
    assert decoded_places(muddy, DecodingSettings(least_direct=0.05)).known.mean() > 0.9


def test_shade_is_no_place():
    seen = wall()
    light = seen.light.reshape(SIZE).copy()
    light[:, :30] = 0
    found = decoded_places(
        as_photographs(pictures(replace(seen, light=light.ravel()), PATTERNS, Shooting(exposure=0.8)), PATTERNS)
    )
    assert not found.known[:, :30].any() and found.known[:, 31:].mean() > 0.99
    assert not found.reached[:, :30].any()


def test_saturated_pixels_are_left_out_and_told(tmp_path):
    write_photographs(tmp_path, pictures(wall(), PATTERNS, Shooting(exposure=1.3)), PATTERNS)
    with (
        pytest.warns(UserWarning, match="100% of what the projector lights is saturated"),
        pytest.raises(ValueError, match="100% is saturated"),
    ):
        decoded_places(read_pattern_photographs(tmp_path))


def test_a_folder_is_read_as_its_photographs_are(tmp_path):
    exposures = pictures(wall(), PATTERNS, Shooting(exposure=0.8))
    write_photographs(tmp_path, exposures, PATTERNS)
    read, known = read_pattern_photographs(tmp_path), as_photographs(exposures, PATTERNS)
    assert np.allclose(read.pictures, known.pictures, atol=1e-6) and not read.clipped.any()
    # White light adds 0.8 of the albedo, of which red is 1.
    assert np.median(read.colour, axis=(0, 1)) == pytest.approx(0.8 * ALBEDO / ALBEDO.max(), rel=0.02)


def test_missing_photographs_are_counted_and_named(tmp_path):
    exposures = pictures(wall(), PATTERNS, Shooting(exposure=0.8))
    write_photographs(tmp_path, exposures, PATTERNS, leave_out=("gray_x3", "phase_y1"))
    with pytest.raises(UnreadableFile, match=r"2 of 29 photographs are missing, first of 'gray_x3'"):
        read_pattern_photographs(tmp_path)


def test_a_pattern_that_was_not_shown_is_named(tmp_path):
    exposures = pictures(wall(), PATTERNS, Shooting(exposure=0.8))
    exposures[PATTERNS.names.index("phase_x3")] = exposures[1]
    write_photographs(tmp_path, exposures, PATTERNS)
    with pytest.raises(UnreadableFile, match=r"phase_x3.png: the pattern is not seen: .*% of white's light"):
        read_pattern_photographs(tmp_path)


def test_a_projector_lost_in_the_rooms_light_is_told(tmp_path):
    write_photographs(tmp_path, pictures(wall(), PATTERNS, Shooting(exposure=0.02, room=40)), PATTERNS)
    with pytest.raises(UnreadableFile, match="lost in the room's; darken the room"):
        read_pattern_photographs(tmp_path)

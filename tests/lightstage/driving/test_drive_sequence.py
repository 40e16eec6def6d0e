"""A stage driven by a sequence of maps: one table, steady, and what it cannot show told once."""

import numpy as np
import pytest

from relume.lightstage.driving.drive_sequence import drive_sequence, write_drive_sequence
from relume.lightstage.driving.driving import LampPrimaries, drive
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions

STAGE = StageLights.towards(even_directions(24))


def glow(azimuth: float, strength: float = 4.0) -> EnvironmentMap:
    """An even sky with a wide glow on the horizon."""
    towards = pixel_directions(LatLong(), 16)
    cosine = towards @ [np.sin(azimuth), 0.0, -np.cos(azimuth)]
    return EnvironmentMap((0.2 + strength * np.exp(4 * (cosine[..., None] - 1)) * [1, 0.8, 0.5]).astype(np.float32))


def test_each_frame_is_the_map_s_own_drive_and_still_light_is_still_to_the_bit():
    maps = [glow(0.3), glow(0.3), glow(0.5)]
    sequence = drive_sequence(STAGE, maps)
    assert sequence.intensities.shape == (3, 24, 3)
    assert np.array_equal(sequence.intensities[0], sequence.intensities[1])
    for frame, light in zip(sequence.frames, maps, strict=True):
        assert np.array_equal(frame.intensities, drive(STAGE, light).intensities)
    assert drive_sequence(STAGE, [glow(0.3)] * 4).flicker == 0


def test_a_glow_that_turns_evenly_drives_the_lamps_evenly_and_smoothing_calms_maps_that_flicker():
    turning = drive_sequence(STAGE, [glow(0.02 * number) for number in range(8)])
    assert turning.flicker < 0.002
    flickering = [glow(0.0, 4 * (1 + 0.05 * (-1) ** number)) for number in range(12)]
    plain, calm = (drive_sequence(STAGE, flickering, smoothing=width) for width in (0.0, 1.5))
    # The glow goes up and down by a tenth; second differences are 4 × 5 % of its share of the light.
    assert 0.15 < plain.flicker < 0.21 and calm.flicker < plain.flicker / 20
    np.testing.assert_allclose(calm.intensities.sum(), plain.intensities.sum(), rtol=0.01)


def test_lamps_at_their_maximum_are_told_once_by_name():
    lamps = LampPrimaries.rgb(maximum=1.0)
    with pytest.warns(UserWarning) as told:
        sequence = drive_sequence(STAGE, [glow(0.0, 0.1), glow(0.0, 8.0), glow(0.0, 6.0)], lamps)
    assert len(told) == 1 and "in 2 of 3 frames, first in 2, lamps" in str(told[0].message)
    brightest = STAGE.names[int(np.argmin(STAGE.directions[:, 2]))]
    assert sequence.clipped[brightest] == 2 and sequence.intensities.max() <= 1
    assert sequence.headroom == sequence.frames[1].headroom < 1


def test_the_table_has_a_line_a_frame_and_light_in_shares_of_the_maximum(tmp_path):
    lamps = LampPrimaries.rgb(maximum=10.0)
    sequence = drive_sequence(STAGE, [glow(0.0), glow(0.1)], lamps)
    write_drive_sequence(tmp_path / "t.csv", sequence)
    lines = (tmp_path / "t.csv").read_text().splitlines()
    assert lines[0] == "frame,light,red,green,blue" and len(lines) == 1 + 2 * 24
    frame, light, *numbers = lines[25].split(",")
    assert (frame, light) == ("2", STAGE.names[0])
    np.testing.assert_allclose([float(each) for each in numbers], sequence.intensities[1, 0] / 10, rtol=1e-8)


def test_what_cannot_be_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no maps"):
        drive_sequence(STAGE, [])
    with pytest.raises(ValueError, match="smoothing is -1"):
        drive_sequence(STAGE, [glow(0)], smoothing=-1)
    with pytest.raises(ValueError, match=r"written to \.csv"):
        write_drive_sequence(tmp_path / "t.json", drive_sequence(STAGE, [glow(0)]))

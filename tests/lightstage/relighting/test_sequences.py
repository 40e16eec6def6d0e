from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from relume.lightstage.field.field import Noise, Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.relighting import pictures_at_once, weighted_sum, weighted_sums

GENERATOR = np.random.default_rng(4)
COUNT = 9
LIGHTS = StageLights.towards(GENERATOR.normal(size=(COUNT, 3)))
FIELD = Pictures(GENERATOR.random((COUNT, 20, 30, 3), np.float32), LIGHTS, noise=Noise(1e-4, 1e-3))
LIGHT = GENERATOR.random((7, COUNT, 3))


@dataclass(frozen=True, eq=False)
class Counted:
    """A field that counts how many of its values were asked for."""

    of: Pictures
    asked: list[int] = field(default_factory=list)

    @property
    def lights(self):
        return self.of.lights

    @property
    def shape(self):
        return self.of.shape

    @property
    def camera(self):
        return None

    @property
    def noise(self):
        return self.of.noise

    def block(self, lights, rows):
        found = self.of.block(lights, rows)
        self.asked.append(found.size)
        return found


def test_each_picture_has_the_bytes_it_has_alone():
    for picture, irradiances in zip(weighted_sums(FIELD, LIGHT), LIGHT, strict=True):
        alone = weighted_sum(FIELD, irradiances)
        np.testing.assert_array_equal(picture.radiance, alone.radiance)
        np.testing.assert_array_equal(picture.variance, alone.variance)


def test_all_pictures_are_made_in_one_pass_over_the_field():
    counted = Counted(FIELD)
    assert len(list(weighted_sums(counted, LIGHT))) == 7
    assert sum(counted.asked) == FIELD.values.size


def test_where_memory_is_short_the_field_is_read_again_and_nothing_changes():
    counted, memory = Counted(FIELD), 300_000
    assert pictures_at_once(counted, memory) == 3
    told: list[float] = []
    found = list(weighted_sums(counted, LIGHT, memory=memory, progress=told.append))
    assert sum(counted.asked) == 3 * FIELD.values.size
    assert told == sorted(told) and told[-1] == 1
    for picture, whole in zip(found, weighted_sums(FIELD, LIGHT), strict=True):
        np.testing.assert_array_equal(picture.radiance, whole.radiance)


def test_a_wrong_light_is_refused_before_the_first_picture():
    with pytest.raises(ValueError, match=r"\(pictures, 9 lights, 3\)"):
        weighted_sums(FIELD, LIGHT[0])
    broken = LIGHT.copy()
    broken[6, 2] = np.inf
    with pytest.raises(ValueError, match='"2" is not a finite number'):
        weighted_sums(FIELD, broken)

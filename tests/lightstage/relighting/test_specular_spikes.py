"""Pixels that are spikes, relit without light below 0."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from relume.image.radiance import RadianceMap
from relume.lightstage.field.field import Derived, Noise, Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import Barycentric, Smooth
from relume.lightstage.relighting.relighting import weighted_sum
from relume.lightstage.relighting.specular_spikes import (
    find_spikes,
    relight_spiky,
    relight_spiky_sequence,
    share_below,
    spiky_and_mirror_pixels,
)
from relume.lightstage.relighting.voronoi_cells import even_directions

LIGHTS = StageLights.towards(even_directions(60))
RNG = np.random.default_rng(0)
MATTE = np.maximum(LIGHTS.directions @ np.array([0.6, 0.0, 0.8]), 0)
VALUES = np.repeat(np.repeat(MATTE[:, None, None], 4, axis=1), 5, axis=2)[..., None] * np.array([0.5, 0.3, 0.2])
MIRRORS = np.zeros((4, 5), bool)
MIRRORS[1, 2] = MIRRORS[3, 0] = True
VALUES[:, MIRRORS] = 0
VALUES[[[17], [40]], MIRRORS.nonzero()[0][:, None], MIRRORS.nonzero()[1][:, None]] = 30.0
FIELD = Pictures(VALUES.astype(np.float32), LIGHTS, noise=Noise(1e-4, 1e-3))


def shared(power: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    towards = even_directions(len(power))
    return Smooth().gathered(LIGHTS, towards, power), Barycentric().gathered(LIGHTS, towards, power)


def variance_of(picture: RadianceMap) -> np.ndarray:
    assert picture.variance is not None
    return picture.variance


@dataclass(frozen=True)
class Piecewise(Derived):
    """The field, read in blocks."""

    field: Pictures = FIELD
    chunks: tuple[int, int] = (7, 2)

    def block(self, lights: slice, rows: slice) -> np.ndarray:
        return self.field.block(lights, rows)


def test_mirrors_are_spikes_and_matte_surfaces_are_not() -> None:
    spiky, mirrors = spiky_and_mirror_pixels(FIELD.values.reshape(60, -1, 3), LIGHTS)
    assert spiky.reshape(4, 5).tolist() == MIRRORS.tolist()
    assert mirrors.tolist() == spiky.tolist()
    three = np.zeros((60, 1, 3), np.float32)
    three[[3, 9, 20], 0] = [[1.0], [0.8], [0.8]]
    assert [each.tolist() for each in spiky_and_mirror_pixels(three, LIGHTS)] == [[True], [False]]
    peak, mean = np.array([[8.1, 0, 0], [7.9, 0, 0], [0, 0, 0]]), np.array([[1.0, 0, 0], [1, 0, 0], [0, 0, 0]])
    assert find_spikes(peak, mean).tolist() == [True, False, False]


def test_spikes_take_the_sum_that_is_never_below_zero_and_the_rest_the_smooth_one() -> None:
    power = np.zeros((500, 3))
    # From where the mirrors' own lights have the least smooth shares.
    least = Smooth().weights(LIGHTS, even_directions(500))[:, [17, 40]].argmin(axis=0)
    power[least] = [[1.0, 2, 3], [3, 2, 1]]
    smooth, barycentric = shared(power)
    picture, first = relight_spiky(FIELD, smooth, barycentric), weighted_sum(FIELD, smooth)
    pictures = (picture, first, weighted_sum(FIELD, barycentric))
    for found, one, other in ([each.radiance for each in pictures], [variance_of(each) for each in pictures]):
        np.testing.assert_array_equal(found[MIRRORS], other[MIRRORS])
        np.testing.assert_array_equal(found[~MIRRORS], one[~MIRRORS])
    assert first.radiance[MIRRORS].min() < -0.1
    assert picture.radiance.min() >= 0


def test_the_picture_is_linear_in_the_light() -> None:
    power = RNG.random((2, 500, 3))
    one, other, both = (relight_spiky(FIELD, *shared(each)).radiance for each in (*power, 2 * power[0] + power[1]))
    np.testing.assert_allclose(both, 2 * one + other, rtol=1e-5)


def test_blocks_threads_and_passes_do_not_change_a_byte() -> None:
    pairs = [shared(each) for each in RNG.random((7, 100, 3))]
    smooth, barycentric = (np.stack(each) for each in zip(*pairs, strict=True))
    single = [relight_spiky(FIELD, *pair, threads=1) for pair in pairs]
    for memory in (24_000, 60_000, 1 << 30):
        for found, expected in zip(
            relight_spiky_sequence(Piecewise(), smooth, barycentric, memory=memory), single, strict=True
        ):
            assert found.radiance.tobytes() == expected.radiance.tobytes()
            assert variance_of(found).tobytes() == variance_of(expected).tobytes()


def test_encoded_fields_find_the_same_spikes() -> None:
    scale = np.linspace(0.1, 0.2, 60).astype(np.float32)
    codes = np.round(FIELD.values / scale[:, None, None, None]).clip(0, 255).astype(np.uint8)
    field = Pictures(codes, LIGHTS, scale=scale)
    smooth, barycentric = shared(RNG.random((50, 3)))
    expected = np.where(
        MIRRORS[..., None], weighted_sum(field, barycentric).radiance, weighted_sum(field, smooth).radiance
    )
    np.testing.assert_array_equal(relight_spiky(field, smooth, barycentric).radiance, expected)


def test_progress_ends_with_one() -> None:
    said: list[float] = []
    pairs = [shared(each) for each in RNG.random((3, 100, 3))]
    list(
        relight_spiky_sequence(
            Piecewise(), *(np.stack(e) for e in zip(*pairs, strict=True)), memory=24_000, progress=said.append
        )
    )
    assert said == sorted(said) and said[-1] == pytest.approx(1)


def test_what_is_below_zero_is_reported_once_and_left() -> None:
    smooth, barycentric = np.ones((60, 3)), np.ones((60, 3))
    smooth[np.argmax(MATTE)] = -60.0
    with pytest.warns(UserWarning, match=r"90% of the picture's pixels are below 0") as said:
        pictures = list(relight_spiky_sequence(FIELD, np.stack([smooth] * 3), np.stack([barycentric] * 3)))
    assert len(said) == 1 and len(pictures) == 3
    np.testing.assert_array_equal(pictures[0].radiance[~MIRRORS], weighted_sum(FIELD, smooth).radiance[~MIRRORS])
    faint = np.ones((10, 10, 3))
    faint[0, 0] = -5e-4
    assert share_below(faint) == 0
    faint[0, 0] = -2e-3
    assert share_below(faint) == 0.01


def test_wrong_calls_are_refused() -> None:
    with pytest.raises(ValueError, match="irradiances are"):
        relight_spiky(FIELD, np.ones((59, 3)), np.ones((60, 3)))
    with pytest.raises(ValueError, match=r"irradiances are .2, 60, 3. and .3, 60, 3."):
        relight_spiky_sequence(FIELD, np.ones((2, 60, 3)), np.ones((3, 60, 3)))
    with pytest.raises(ValueError, match="is not a finite number"):
        relight_spiky_sequence(FIELD, np.full((1, 60, 3), np.nan), np.ones((1, 60, 3)))

"""Which pixels speak for the response: every value, the whole image, flat places, none beside white."""

from dataclasses import replace

import numpy as np
import pytest

from relume.capture.exposure.bracket import Bracket
from relume.capture.response.calibration import recover_response
from relume.capture.response.sampling import _choose_pixels, _Grid, observations, still_values
from relume.image.photograph import Exposure, Photograph
from synthetic import NOISELESS, wide_scene


def bracket_of(*pictures: np.ndarray) -> Bracket:
    """Grey pictures (H, W) as photographs, each exposed twice as long as the one before."""
    return Bracket(
        tuple(
            Photograph(np.repeat(p[..., None], 3, 2).astype(np.uint8), f"{i}.png", Exposure(2.0**i))
            for i, p in enumerate(pictures)
        )
    )


def test_every_range_of_values_is_met_in_every_photograph_that_has_it(bracket):
    for channel in range(3):
        chosen = _choose_pixels(bracket, channel)
        for photograph in bracket.photographs:
            there = photograph.pixels[..., channel].ravel()
            there = there[(there > 0) & (there < 255)]
            found = photograph.pixels[..., channel].ravel()[chosen]
            missing = set(there // 16) - set(found[(found > 0) & (found < 255)] // 16)
            assert not missing


def test_the_whole_image_is_sampled(bracket):
    rows, columns = np.divmod(_choose_pixels(bracket, 1), 192)
    counts, _, _ = np.histogram2d(rows, columns, bins=(8, 12), range=((0, 128), (0, 192)))
    assert counts.min() > 0
    # No twelfth of the width gets more than a few times its share.
    assert counts.sum(0).max() < 3 * counts.sum() / 12


def test_of_all_pixels_only_a_share_is_taken(bracket):
    chosen = _choose_pixels(bracket, 0)
    assert len(np.unique(chosen)) == len(chosen)
    assert 500 < len(chosen) < 0.5 * 128 * 192


def test_of_each_tile_the_flattest_place_is_taken():
    # 96 pixels make 24 tiles of 4. In each a flat square of 3×3 holds 102; 101 and 103 alternate round it.
    y, x = np.mgrid[:96, :96]
    picture = np.where((x + y) % 2, 101, 103)
    picture[(x % 4 < 3) & (y % 4 < 3)] = 102
    rows, columns = np.divmod(_choose_pixels(bracket_of(picture, picture), 0), 96)
    assert len(rows) == 576
    inner = (rows >= 4) & (columns >= 4)  # beyond the border the picture is its own mirror image, and flat
    assert np.all(rows[inner] % 4 == 1) and np.all(columns[inner] % 4 == 1)


def test_rough_places_are_not_believed():
    y, x = np.mgrid[:96, :96]
    picture = np.where(x < 48, 100, 120 + 20 * ((x + y) % 2))
    values, _ = observations(bracket_of(picture, picture), 0)
    assert len(values) > 200 and set(np.unique(values)) == {100}


def test_a_value_at_an_edge_is_not_believed():
    picture = np.full((64, 64), 60.0)
    picture[:, 32:] = 180.0
    values, _ = observations(bracket_of(picture, picture), 0)
    assert set(np.unique(values)) == {60, 180}
    stripes = np.where(np.arange(64) % 2, 60.0, 180.0) * np.ones((64, 1))
    values, _ = observations(bracket_of(stripes, stripes), 0)
    assert len(values) == 0


def test_neighbours_of_saturated_pixels_are_not_believed():
    # 130 within four pixels of the white square, as JPEG smears it over its blocks; 100 beyond.
    picture = np.full((96, 96), 100.0)
    picture[36:60, 36:60] = 130.0
    picture[40:56, 40:56] = 255.0
    bracket = bracket_of(picture, picture)
    assert np.any(bracket.photographs[0].pixels[..., 0].ravel()[_choose_pixels(bracket, 0)] == 130)
    values, _ = observations(bracket, 0)
    assert len(values) > 100 and set(np.unique(values)) == {100}


def test_a_pixel_that_one_photograph_saw_alone_is_left_out():
    bracket = bracket_of(np.full((32, 32), 100.0), np.full((32, 32), 255.0))
    values, log_times = observations(bracket, 2)
    assert values.shape == (0, 2) and log_times == pytest.approx([0, np.log(2)])


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (5, 1), (1, 30), (3, 3), (30, 2)])
def test_tiny_images_are_sampled_too(size):
    height, width = size
    scene = np.full((height, width, 3), 0.2)
    bracket = NOISELESS.bracket(scene, [0.25, 0.5, 1.0])
    for channel in range(3):
        chosen = _choose_pixels(bracket, channel)
        assert len(chosen) > 0 and chosen.max() < width * height
        values, log_times = observations(bracket, channel)
        assert values.shape[1] == len(log_times) == 3


def test_a_thumbnail_gives_a_response():
    # 384 pixels, and three stops over 24 columns, so that neighbours are alike.
    camera = NOISELESS
    curve = recover_response(camera.bracket(wide_scene(24, 16, stops=3.0))).response.log_exposure
    error = (curve - camera.log_exposure())[:, 20:236]
    assert np.median(np.abs(error - np.median(error, axis=1, keepdims=True))) < 0.01


def test_pixels_outside_the_picture_are_not_sampled():
    picture = np.full((96, 96), 100.0)
    picture[:, 48:] = 180.0
    outside = np.zeros((96, 96), bool)
    outside[:, 48:] = True
    inside = bracket_of(picture, picture)
    assert set(np.unique(observations(inside, 0).values)) == {100, 180}
    masked = Bracket(tuple(replace(p, outside=outside) for p in inside.photographs))
    assert set(np.unique(observations(masked, 0).values)) == {100}
    assert set(np.unique(still_values(masked, 0).values)) == {100}
    # Outside in one photograph alone, a place says of the others only, and of one other nothing.
    once = Bracket((replace(inside.photographs[0], outside=outside), inside.photographs[1]))
    assert set(np.unique(observations(once, 0).values)) == {100}


def test_large_photographs_are_sampled_on_a_grid_over_all_of_them():
    y, x = np.mgrid[:900, :1200]
    chosen = _choose_pixels(bracket_of(40 + x / 8, 40 + y / 8), 1)
    rows, columns = np.divmod(chosen, 1200)
    counts, _, _ = np.histogram2d(rows, columns, bins=(6, 8), range=((0, 900), (0, 1200)))
    assert counts.min() > 0
    # An odd step meets every place of JPEG's blocks.
    grid = _Grid(1200, 900, 40_000)
    assert grid.step == 5 and 30_000 < len(grid) < 50_000
    assert len(np.unique(grid.columns % 8)) == 8 and len(np.unique(grid.rows % 8)) == 8

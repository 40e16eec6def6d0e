"""What stands for the background behind near things."""

import numpy as np

from relume.virtual_camera.lens.disocclusion import hidden_background, unmixed


def grey(values):
    return np.repeat(np.asarray(values, np.float32)[..., None], 3, axis=2)


def test_behind_an_edge_lies_the_background_mirrored_in_it():
    # Columns 0 to 9 are near (radius −4), 10 to 19 far (radius 2): background is 10 + its column.
    radius = np.where(np.arange(20) < 10, -4, 2)[None].repeat(5, 0).astype(np.float32)
    light = grey(np.arange(20)[None].repeat(5, 0))
    behind, _ = hidden_background(light, radius)
    assert (behind[:, 10:] == -1).all()
    # Reached are 4 + 2 + 1 pixels from the nearest background; beyond, nothing can come to be seen.
    assert (behind[2, :3] == -1).all() and (behind[2, 3:10] >= 0).all()
    # One pixel before the edge: of columns 11, 13 and 14 the one of middle luminance.
    assert behind[2, 9] == 2 * 20 + 13
    assert behind[2, 5] == 2 * 20 + 15  # 5 pixels before: 10 + 2.67 → 13, 10 + 5.33 → 15, 10 + 8 → 18


def test_an_edge_is_open_as_far_as_its_own_discs_reach():
    radius = np.where(np.arange(20) < 10, -4, 2)[None].repeat(5, 0).astype(np.float32)
    _, opening = hidden_background(grey(np.ones((5, 20))), radius)
    # From column 10 on there is background: 4 + 1 pixels before it.
    assert opening[2].tolist() == [False] * 5 + [True] * 5 + [False] * 10


def test_pixels_between_both_sides_of_an_edge_go_to_the_near_one():
    radius = np.array([[-4, -4, -4, -1.5, 2, 2, 2.5, 3, 3]], np.float32).repeat(3, 0)
    assert unmixed(radius)[1].tolist() == [-4, -4, -4, -4, 2, 2, 2.5, 3, 3]


def test_a_lamp_beside_the_edge_is_not_seen_twice():
    radius = np.where(np.arange(20) < 10, -4, 2)[None].repeat(9, 0).astype(np.float32)
    light = np.ones((9, 20), np.float32)
    light[4, 13] = 1e6
    behind, _ = hidden_background(grey(light), radius)
    assert grey(light)[..., 0].ravel()[behind[behind >= 0]].max() == 1


def test_slanted_surfaces_hide_nothing():
    radius = np.linspace(-20, 20, 60)[None].repeat(8, 0).astype(np.float32)
    assert (hidden_background(grey(np.ones((8, 60))), radius)[0] == -1).all()


def test_of_two_backgrounds_each_near_thing_takes_one_that_is_behind_it():
    radius = np.full((40, 40), 6, np.float32)
    radius[:, :25] = 0
    radius[10:30, 10:30] = -6
    behind, _ = hidden_background(grey(np.ones((40, 40))), radius)
    found = behind >= 0
    assert found[10:30, 10:30].any() and found[:, 20:25].any()
    assert (radius.ravel()[behind[found]] > radius[found] + 1).all()
    assert (radius.ravel()[behind[15:25, 11]] == 0).all() and (radius.ravel()[behind[15:25, 28]] == 6).all()


def test_nearest_background_is_found_all_round():
    # A disc before a wall: wherever the background is within reach, something stands behind.
    y, x = np.mgrid[:61, :61] - 30
    radius = np.where(np.hypot(x, y) < 20, -5, 3).astype(np.float32)
    behind, _ = hidden_background(grey(np.ones((61, 61))), radius)
    inside, distance = np.hypot(x, y) < 20, 20 - np.hypot(x, y)
    assert (behind[inside & (distance < 7)] >= 0).all()
    assert (behind[inside & (distance > 9.5)] == -1).all()

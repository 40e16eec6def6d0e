"""Moving frames: against closed forms, a slow twin, and what happens at clipped edges and borders."""

from __future__ import annotations

import numpy as np
import pytest

from relume.capture.alignment.clipped_blocks import BLOCK, MIXED
from relume.capture.alignment.warping import Motion, move
from relume.capture.alignment.warping_kernel import _move
from relume.image.photograph import Exposure, Photograph

WIDTH, HEIGHT = 90, 64
EXPOSURE = Exposure(0.5, 8.0, 200.0, "EXIF")


def photograph(pixels: np.ndarray, outside: np.ndarray | None = None) -> Photograph:
    return Photograph(pixels, "frame.jpg", EXPOSURE, "a camera", 1000.0, outside)


def waves(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """A smooth picture (…, 3) of pixel positions, between 40 and 200."""
    return np.stack([120 + 40 * np.sin(0.11 * x + p) + 38 * np.cos(0.13 * y - 0.05 * x * p) for p in (0, 1, 2)], -1)


def fetched(motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Column and row in the frame of every pixel of the reference, by the convention in words."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    right, down = x + 0.5 - WIDTH / 2, y + 0.5 - HEIGHT / 2
    column = np.cos(motion.angle) * right - np.sin(motion.angle) * down + motion.dx + WIDTH / 2 - 0.5
    row = np.sin(motion.angle) * right + np.cos(motion.angle) * down + motion.dy + HEIGHT / 2 - 0.5
    return column, row


def leant_on(place: float) -> list[int]:
    """The pixels along one axis that a value there leans on: four, or the one that is hit."""
    nearest, before = round(place), int(np.floor(place))
    return [nearest] if abs(place - nearest) < 1e-3 else list(range(before - 1, before + 3))


def catmull_rom(pixels: np.ndarray, column: float, row: float) -> np.ndarray:
    """The slow twin: sixteen pixels at one position."""
    weights = []
    for place in (column, row):
        f = place - np.floor(place)
        weights.append(
            0.5 * np.array([-f + 2 * f**2 - f**3, 2 - 5 * f**2 + 3 * f**3, f + 4 * f**2 - 3 * f**3, f**3 - f**2])
        )
    rows = np.clip(np.arange(-1, 3) + int(np.floor(row)), 0, HEIGHT - 1)
    columns = np.clip(np.arange(-1, 3) + int(np.floor(column)), 0, WIDTH - 1)
    return np.einsum("j,i,jic->c", weights[1], weights[0], pixels[np.ix_(rows, columns)].astype(float))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize(
    "motion",
    [Motion(3.3, -2.6), Motion(0.0, 0.5), Motion(-7.25, 4.1, 0.05), Motion(0.4, 0.2, -0.3), Motion(-0.01, 0, 1e-4)],
)
def test_a_smooth_picture_is_found_where_the_motion_says(motion: Motion, dtype: type) -> None:
    scale = np.iinfo(dtype).max / 255
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    moved = move(photograph(np.rint(waves(x, y) * scale).astype(dtype)), motion)
    column, row = fetched(motion)
    beyond = (column < -0.02) | (row < -0.02) | (column > WIDTH - 0.98) | (row > HEIGHT - 0.98)
    assert moved.outside is not None
    np.testing.assert_array_equal(moved.outside, beyond)
    inner = (column > 2) & (row > 2) & (column < WIDTH - 3) & (row < HEIGHT - 3)
    # Rounding before and after, and what a cubic misses of a wave of 48 pixels.
    miss = np.abs(moved.pixels - waves(column, row) * scale)[inner]
    assert inner.sum() > 2000 and miss.max() < 1.2 * scale and miss.mean() < 0.45 * scale


@pytest.mark.parametrize("motion", [Motion(3.3, -2.6), Motion(-7.25, 4.1, 0.0005)])
def test_it_is_catmull_rom(motion: Motion) -> None:
    # Without a turn the two passes are the sixteen products themselves; with one of 0.03° hardly another thing.
    pixels = np.random.default_rng(0).integers(90, 160, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    moved = move(photograph(pixels), motion)
    column, row = fetched(motion)
    assert moved.outside is not None
    for y, x in np.random.default_rng(1).integers(0, (HEIGHT, WIDTH), (300, 2)):
        if not moved.outside[y, x]:
            expected = catmull_rom(pixels, float(column[y, x]), float(row[y, x]))
            assert np.abs(moved.pixels[y, x] - expected).max() < (0.51 if motion.angle == 0 else 1.0)


def test_whole_pixels_are_copied() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    moved = move(photograph(pixels), Motion(5.0, -3.0))
    np.testing.assert_array_equal(moved.pixels[3:, :-5], pixels[:-3, 5:])
    assert moved.outside is not None
    assert moved.outside[:3].all() and moved.outside[:, -5:].all() and not moved.outside[3:, :-5].any()
    assert (moved.exposure, moved.name, moved.camera, moved.focal_length) == (EXPOSURE, "frame.jpg", "a camera", 1000.0)


def test_no_motion_gives_the_same_object() -> None:
    frame = photograph(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    assert move(frame, Motion()) is frame


@pytest.mark.parametrize("motion", [Motion(0.5, 0.0), Motion(0.3, 0.7), Motion(0.2, 0.4, 0.02)])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_clipped_edges_stay_clipped(motion: Motion, dtype: type) -> None:
    most = np.iinfo(dtype).max
    x = np.broadcast_to(np.arange(WIDTH), (HEIGHT, WIDTH))
    # White, then a mid-tone, then black.
    pixels = np.where(x < 30, most, np.where(x < 60, most // 2, 0)).astype(dtype)
    moved = move(photograph(np.repeat(pixels[..., None], 3, axis=2)), motion).pixels
    values, counts = np.unique(moved, return_counts=True)
    # No tone between those there were, but for the overshoot of a sixteenth beside a step into black, and where a
    # white pixel is leant on by less than a fortieth.
    assert values[0] == 0 and values[-1] == most
    middle = values[1:-1].astype(float)
    assert middle.min() >= 0.97 * (most // 2) and middle.max() <= 1.15 * (most // 2) and counts.min() > 0
    column, _ = fetched(motion)
    assert (moved[column < 29.9] == most).all() and (moved[column > 60.1] == 0).all()
    assert (moved[(column > 32) & (column < 58)] == most // 2).all()


def test_a_value_of_the_top_two_per_cent_is_saturated() -> None:
    pixels = np.full((HEIGHT, WIDTH, 3), 100, np.uint8)
    pixels[30, 40], pixels[30, 60] = 249, 250
    moved = move(photograph(pixels), Motion(0.5, 0.5)).pixels
    assert 100 < moved[30, 40].min() and moved[30, 40].max() < 200
    assert (moved[29:31, 59:61] == 255).all()


@pytest.mark.parametrize("motion", [Motion(0.3, 0.4), Motion(-2.4, 1.45), Motion(0.3, -0.3), Motion(0.3, 0.2, 0.01)])
def test_beside_white_the_nearest_pixel_is_taken_whole_where_that_is_asked(motion: Motion) -> None:
    pixels = np.full((HEIGHT, WIDTH, 3), (20, 30, 50), np.uint8)
    pixels[30:33, 40:43] = (200, 255, 255)
    leant = move(photograph(pixels), motion).pixels
    moved = move(photograph(pixels), motion, whole_beside_white=True).pixels
    # A lamp stays as large as it is, and what lies beside it as dark, in all channels.
    assert (leant[..., 1] == 255).sum() >= 25
    assert (moved[..., 1] == 255).sum() == 9
    column, row = (np.rint(each[moved[..., 1] == 255]).astype(int) for each in fetched(motion))
    assert (pixels[row, column, 1] == 255).all()
    colours = {tuple(colour) for colour in moved.reshape(-1, 3).tolist()}
    assert {colour for colour in colours if max(colour) >= 250} == {(200, 255, 255)}
    assert (np.abs(moved.astype(int) - (20, 30, 50)).max(axis=2) <= 3).sum() == moved[..., 0].size - 9


def test_what_is_not_clipped_does_not_become_clipped() -> None:
    # Checks of 1 and 249: interpolation overshoots both ends.
    pixels = np.full((HEIGHT, WIDTH, 3), 1, np.uint8)
    pixels[:, 40:] = 249
    moved = move(photograph(pixels), Motion(0.4, 0.4)).pixels
    assert moved.min() == 1 and moved.max() == 249


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("motion", [Motion(3.3, -2.6), Motion(-70.25, 4.1, 0.03), Motion(40.6, 1.5, -0.2)])
def test_what_a_block_holds_changes_no_value(motion: Motion, dtype: type) -> None:
    # Eight blocks a row: of mid-tones, of white alone, of black alone, and some that hold two of these.
    most, generator = np.iinfo(dtype).max, np.random.default_rng(5)
    pixels = generator.integers(most // 100, most // 10 * 9, (60, 500, 3)).astype(dtype)
    pixels[:, 150:330], pixels[20:, 360:] = generator.integers(most - most // 80, most, (60, 180, 3)), 0
    pixels[::7, ::83], pixels[::5, 64] = most, most
    moved = move(photograph(pixels), motion).pixels
    cosine, sine = np.cos(motion.angle), np.sin(motion.angle)
    corner = np.array([0.5 - 250, 0.5 - 30])
    limits, columns = (np.float32(np.ceil(0.98 * most)), np.float32(most)), (np.arange(1524) // 3).astype(np.float32)
    held, tried = np.full((60, -(-1500 // BLOCK)), MIXED), np.empty(pixels.size, dtype)
    _move(pixels.ravel(), held, cosine, sine, *motion.apply(corner) - corner, *limits, 0, 60, columns, tried)
    assert len(np.unique(moved)) > 200 and (moved == most).mean() > 0.2 and (moved == 0).mean() > 0.05
    np.testing.assert_array_equal(moved.ravel(), tried)


def test_what_leans_on_outside_is_outside() -> None:
    pixels = np.full((HEIGHT, WIDTH, 3), 100, np.uint8)
    border = np.zeros((HEIGHT, WIDTH), bool)
    border[:, :10] = True
    pixels[border] = (0, 0, 255)
    moved = move(photograph(pixels, border), Motion(-2.5, 0.0))
    assert moved.outside is not None
    column, _ = fetched(Motion(-2.5, 0.0))
    np.testing.assert_array_equal(moved.outside, (column < 11))
    assert (moved.pixels[~moved.outside] == 100).all()
    copied = move(photograph(pixels, border), Motion(-2.0, 0.0))
    assert copied.outside is not None
    np.testing.assert_array_equal(copied.outside, np.broadcast_to(np.arange(WIDTH) < 12, (HEIGHT, WIDTH)))
    turned = move(photograph(pixels, border), Motion(-2.5, 0.3, 0.05))
    assert turned.outside is not None and (turned.pixels[~turned.outside] == 100).all()


@pytest.mark.parametrize("motion", [Motion(30.3, -6.4), Motion(-70.25, 4.1, 0.03), Motion(40.6, 1.55, -0.2)])
def test_outside_is_what_one_of_sixteen_pixels_says(motion: Motion) -> None:
    generator = np.random.default_rng(4)
    before = generator.random((60, 400)) < 0.004
    before[:, 300:] = False
    before[25:35, 150:230] = True
    moved = move(photograph(np.full((60, 400, 3), 100, np.uint8), before), motion).outside
    assert moved is not None and 0.1 < moved.mean() < 0.9
    cosine, sine, slant = np.cos(motion.angle), np.sin(motion.angle), np.tan(motion.angle)
    for y in range(60):
        for x in range(400):
            right, down = x + 0.5 - 200, y + 0.5 - 30
            column = cosine * right - sine * down + motion.dx + 199.5
            row = sine * right + cosine * down + motion.dy + 29.5
            expected = not (-0.02 <= column <= 399.02 and -0.02 <= row <= 59.02)
            for u in leant_on(column):
                rows = np.clip(leant_on(row + (u - column) * slant), 0, 59)
                expected |= bool(before[rows, min(max(u, 0), 399)].any())
            assert moved[y, x] == expected, (x, y)


def test_a_frame_moved_out_of_sight_is_all_outside() -> None:
    frame = photograph(np.full((HEIGHT, WIDTH, 3), 100, np.uint8))
    for motion in (Motion(95.5, 0), Motion(1e6, 0), Motion(0, -70.25), Motion(0, 64)):
        moved = move(frame, motion)
        assert moved.outside is not None and moved.outside.all()


@pytest.mark.parametrize("motion", [Motion(170.5, 3.0), Motion(-170.5, 3.0), Motion(-100.25, 70.5)])
def test_beyond_the_border_lies_the_nearest_pixel(motion: Motion) -> None:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    moved = move(photograph(np.stack([y, x, x + y], axis=-1).astype(np.uint8) + np.uint8(30)), motion)
    column, row = (np.clip(each, 0, n - 1) for each, n in zip(fetched(motion), (WIDTH, HEIGHT), strict=True))
    assert np.abs(moved.pixels - (np.stack([row, column, row + column], axis=-1) + 30)).max() < 1.01


@pytest.mark.parametrize("motion", [Motion(np.nan, 0), Motion(0, np.inf), Motion(0, 0, 0.5)])
def test_a_motion_no_hand_makes_is_refused(motion: Motion) -> None:
    with pytest.raises(ValueError, match="within ±20°"):
        move(photograph(np.zeros((HEIGHT, WIDTH, 3), np.uint8)), motion)


def test_the_displacement_is_the_root_mean_square_over_the_picture() -> None:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    motion = Motion(1.5, -0.7, 0.04)
    column, row = fetched(motion)
    expected = np.sqrt(((column - x) ** 2 + (row - y) ** 2).mean())
    assert motion.displacement((WIDTH, HEIGHT)) == pytest.approx(expected, rel=1e-3)
    assert Motion(3.0, 4.0).displacement((WIDTH, HEIGHT)) == 5.0


def test_a_positive_angle_turns_clockwise_as_seen() -> None:
    # What the reference shows right of the middle lies lower in a frame turned clockwise; y points down.
    np.testing.assert_allclose(Motion(0, 0, np.pi / 2).apply(np.array([1.0, 0.0])), [0.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(Motion(2, 3, 0).apply(np.array([1.0, 0.0])), [3.0, 3.0])

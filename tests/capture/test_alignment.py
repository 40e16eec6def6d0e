"""Aligning brackets: the convention, what stays untouched, what cannot be reported, and the loops' slow twins."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import map_coordinates, rotate

from handheld import luminance, stack
from relume.capture.alignment import pyramid
from relume.capture.alignment.alignment import _needed, align
from relume.capture.alignment.estimate import Estimate
from relume.capture.alignment.warping import Motion
from relume.capture.exposure.bracket import Bracket
from relume.capture.merging import merge
from relume.capture.response.calibration import recover_response
from relume.image import files
from relume.image.photograph import Exposure, Photograph
from synthetic import VirtualCamera

CAMERA = VirtualCamera(electrons=8000.0, read_noise=5.0)
WIDTH, HEIGHT = 420, 300
SECONDS = (0.02, 0.07, 0.25)


@pytest.fixture(scope="module")
def wide() -> np.ndarray:
    """A coloured scene (600, 720, 3), larger than a frame; its tones fit the exposures."""
    light = luminance(500, 380, np.random.default_rng(3), fine=1)[:600, :720]
    return light[..., None] / np.median(light) * np.array([1.1, 1.0, 0.8])


def seen(wide: np.ndarray, dx: int = 0, dy: int = 0) -> np.ndarray:
    """What a frame sees whose picture of the reference's scene lies shifted by (dx, dy) whole pixels."""
    return wide[150 - dy : 150 - dy + HEIGHT, 150 - dx : 150 - dx + WIDTH]


def shifted(wide: np.ndarray, shifts: list[tuple[int, int]], seconds=SECONDS) -> Bracket:
    return Bracket(
        tuple(
            CAMERA.photograph(seen(wide, *shift), Exposure(t), name=f"frame_{i}.jpg", seed=i)
            for i, (shift, t) in enumerate(zip(shifts, seconds, strict=True))
        )
    )


def test_a_tripods_bracket_is_unchanged_bit_for_bit(wide: np.ndarray) -> None:
    bracket = shifted(wide, [(0, 0)] * 3)
    aligned = align(bracket)
    assert not aligned.moved and aligned.motions == (Motion(),) * 3
    for before, after in zip(bracket.photographs, aligned.bracket.photographs, strict=True):
        assert after is before


def test_what_the_reference_shows_is_found_shifted_right_and_down(wide: np.ndarray) -> None:
    aligned = align(shifted(wide, [(30, -11), (0, 0), (-4, 64)]))
    assert aligned.reference == 1 and aligned.motions[1] == Motion()
    for motion, (dx, dy) in zip((aligned.motions[0], aligned.motions[2]), ((30, -11), (-4, 64)), strict=True):
        assert motion.dx == pytest.approx(dx, abs=0.06) and motion.dy == pytest.approx(dy, abs=0.06)
        assert motion.angle == pytest.approx(0, abs=2e-4)
    assert all(error < 0.25 for error in aligned.errors) and min(aligned.agreements) > 0.6


def test_a_frame_turned_clockwise_has_a_positive_angle(wide: np.ndarray) -> None:
    # SciPy's positive angles turn the first axis towards the second: down towards right, counter-clockwise as seen.
    turned = np.maximum(rotate(wide, -3.0, axes=(0, 1), reshape=False, order=3, mode="mirror"), 0)
    middle = slice(300 - HEIGHT // 2, 300 + HEIGHT // 2), slice(360 - WIDTH // 2, 360 + WIDTH // 2)
    frames = [wide[middle], turned[middle], wide[middle]]
    bracket = Bracket(
        tuple(CAMERA.photograph(f, Exposure(t), seed=i) for i, (f, t) in enumerate(zip(frames, SECONDS, strict=True)))
    )
    aligned = align(bracket)
    relative = aligned.motions[1].angle - aligned.motions[0].angle
    # Whether SciPy's turn is clockwise is seen from a point right of the middle, not taken from words.
    dot = np.zeros((601, 721))
    dot[295:306, 595:606] = 1
    row = np.average(np.arange(601), weights=rotate(dot, -3.0, reshape=False, order=1).sum(1))
    assert np.sign(relative) == np.sign(row - 300)
    assert abs(relative) == pytest.approx(np.radians(3.0), abs=4e-4)


def test_without_rotation_only_shifts_are_found() -> None:
    held = stack(11, size=(480, 360), frames=3)
    aligned = align(held.bracket, rotation=False)
    assert all(motion.angle == 0 for motion in aligned.motions) and aligned.moved


def test_frames_lie_on_the_reference_afterwards() -> None:
    held = stack(12, size=(480, 360), frames=3)
    aligned = align(held.bracket)
    photographs = aligned.bracket.photographs
    again = align(aligned.bracket)
    assert aligned.moved and not again.moved
    for index, photograph in enumerate(photographs):
        if index == aligned.reference:
            assert photograph.outside is None
        else:
            assert photograph.outside is not None and 0 < photograph.outside.mean() < 0.5
        assert photograph.exposure is held.bracket.photographs[index].exposure


def test_sixteen_bits_are_aligned_like_eight() -> None:
    held = stack(13, size=(480, 360), frames=3)
    fine = Bracket(tuple(replace(p, pixels=p.pixels.astype(np.uint16) * 257) for p in held.bracket.photographs))
    coarse, precise = align(held.bracket), align(fine)
    assert precise.bracket.photographs[0].pixels.dtype == np.uint16
    for a, b in zip(coarse.motions, precise.motions, strict=True):
        assert (a.dx, a.dy, a.angle) == pytest.approx((b.dx, b.dy, b.angle), abs=0.01)


def test_pixels_outside_the_picture_do_not_count(wide: np.ndarray) -> None:
    bracket = shifted(wide, [(5, 2), (0, 0), (-3, 4)])
    frames = []
    for index, photograph in enumerate(bracket.photographs):
        # Borders with a pattern that stays where it is: they would say that nothing moved.
        outside = np.zeros((HEIGHT, WIDTH), bool)
        outside[: 60 + index], outside[:, : 70 - index] = True, True
        pixels = photograph.pixels.copy()
        y, x = np.mgrid[:HEIGHT, :WIDTH]
        pixels[outside] = np.where((x // 8 + y // 8) % 2, 40, 200)[outside][:, None]
        frames.append(replace(photograph, pixels=pixels, outside=outside))
    aligned = align(Bracket(tuple(frames)))
    for motion, (dx, dy) in zip(aligned.motions, [(5, 2), (0, 0), (-3, 4)], strict=True):
        assert (motion.dx, motion.dy) == pytest.approx((dx, dy), abs=0.08)
    last = aligned.bracket.photographs[-1].outside
    assert last is not None and frames[-1].outside is not None and last.sum() > frames[-1].outside.sum()


def test_a_black_frame_keeps_its_neighbours_motion(wide: np.ndarray) -> None:
    bracket = shifted(wide, [(7, 3), (7, 3), (0, 0)], (1e-6, 0.07, 0.1))
    with pytest.warns(UserWarning, match=r"frame_0\.jpg: too little in common"):
        aligned = align(bracket)
    assert aligned.motions[0] == aligned.motions[1] != aligned.motions[2]
    assert aligned.errors[0] == np.inf and aligned.errors[1] < 0.2


def test_a_frame_of_another_scene_is_warned_of(wide: np.ndarray) -> None:
    other = luminance(500, 380, np.random.default_rng(4), fine=1)[..., None] * np.ones(3)
    stranger = CAMERA.photograph(seen(other / np.median(other)), Exposure(0.25), name="other.jpg", seed=9)
    bracket = Bracket((*shifted(wide, [(6, 0), (0, 0), (-6, 0)], (0.04, 0.07, 0.12)).photographs, stranger))
    with pytest.warns(UserWarning, match=r"^other\.jpg: too little in common") as said:
        aligned = align(bracket)
    assert len(said) == 1 and aligned.errors[-1] == np.inf


@pytest.mark.parametrize("value", [0, 128, 255])
def test_frames_without_features_stay(value: int) -> None:
    pixels = np.full((100, 120, 3), value, np.uint8)
    bracket = Bracket(tuple(Photograph(pixels, f"{i}.jpg", Exposure(2.0**i)) for i in range(3)))
    assert not align(bracket).moved


def test_one_photograph_is_aligned_with_itself() -> None:
    bracket = Bracket((Photograph(np.zeros((8, 9, 3), np.uint8), exposure=Exposure(1.0)),))
    aligned = align(bracket)
    assert aligned.bracket is bracket and aligned.motions == (Motion(),)


def test_tiny_pictures_do_not_break_it() -> None:
    generator = np.random.default_rng(0)
    for shape in ((1, 1, 3), (3, 200, 3), (12, 9, 3)):
        frames = tuple(
            Photograph(generator.integers(0, 256, shape).astype(np.uint8), f"{i}.jpg", Exposure(2.0**i))
            for i in range(2)
        )
        with warnings.catch_warnings(record=True):
            warnings.simplefilter("always")
            assert len(align(Bracket(frames)).motions) == 2


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_the_reduction_is_the_mean_of_green_where_nothing_is_clipped(dtype: type, monkeypatch) -> None:
    monkeypatch.setattr(pyramid, "LONGEST", 14)  # a third of the picture
    most = int(np.iinfo(dtype).max)
    pixels = np.random.default_rng(0).integers(0, most + 1, (32, 41, 3)).astype(dtype)
    pixels[9:15, 9:30] = most // 10 * 9
    (level,) = pyramid.pyramid(Photograph(pixels[:, ::-1]))
    blocks = pixels[:30, :1:-1, 1].reshape(10, 3, 13, 3).swapaxes(1, 2).reshape(10, 13, 9)
    np.testing.assert_allclose(level.values, blocks.mean(-1) * 255 / most, rtol=1e-6)
    clipped = (blocks.min(-1) <= most * pyramid.LOW) | (blocks.max(-1) >= most * pyramid.HIGH)
    np.testing.assert_array_equal(level.valid == 0, clipped)
    assert 0.1 < level.valid.mean() < 0.9 and level.inside.all() and level.scale == 3


def test_levels_are_halved_where_three_of_four_pixels_are_valid_and_all_inside() -> None:
    generator = np.random.default_rng(6)
    values = (generator.random((21, 34)) * 255).astype(np.float32)
    valid, inside = ((generator.random((21, 34)) > 0.2).astype(np.uint8) for _ in range(2))
    half = pyramid._halved(pyramid.Level(values, valid, inside, 3, (102, 63)))
    quads = [a[:20].reshape(10, 2, 17, 2).swapaxes(1, 2).reshape(10, 17, 4) for a in (values, valid, inside)]
    np.testing.assert_allclose(half.values, quads[0].mean(-1), rtol=1e-6)
    np.testing.assert_array_equal(half.valid, quads[1].sum(-1) >= 3)
    np.testing.assert_array_equal(half.inside, quads[2].min(-1))
    assert (half.scale, half.size) == (6, (102, 63))


def test_features_are_the_steepest_sound_pixels() -> None:
    from relume.capture.alignment.kernel import _features

    generator = np.random.default_rng(1)
    values = generator.random((20, 27)).astype(np.float32) * 100
    valid = (generator.random((20, 27)) > 0.15).astype(np.uint8)
    places, found = np.empty((100, 2), np.int32), np.empty((100, 3), np.float32)
    count = _features(values, valid, 5, 10.0, places, found)
    expected = []
    for top in range(1, 19, 5):
        for left in range(1, 26, 5):
            best = (10.0, -1, -1)
            for y in range(top, min(top + 5, 19)):
                for x in range(left, min(left + 5, 26)):
                    across = (float(values[y, x + 1]) - float(values[y, x - 1])) / 2
                    down = (float(values[y + 1, x]) - float(values[y - 1, x])) / 2
                    if valid[y - 1 : y + 2, x - 1 : x + 2].all():
                        best = max(best, (np.hypot(across, down), y, x))
            if best[1] > 0:
                expected.append(best[1:])
    np.testing.assert_array_equal(places[:count], expected)
    rows, columns = np.array(expected).T
    np.testing.assert_allclose(found[:count, 0], values[rows, columns])
    np.testing.assert_allclose(found[:count, 1], (values[rows, columns + 1] - values[rows, columns - 1]) / 2)
    np.testing.assert_allclose(found[:count, 2], (values[rows + 1, columns] - values[rows - 1, columns]) / 2)


def test_values_and_gradients_are_looked_up_as_the_picture_is() -> None:
    from relume.capture.alignment.kernel import _look_up

    y, x = np.mgrid[:30, :40]
    values, valid = (100 + 2.0 * x - 3.0 * y + 0.05 * x * x).astype(np.float32), np.ones((30, 40), np.uint8)
    valid[10, 20] = 0
    generator = np.random.default_rng(2)
    column, row = generator.uniform(0, 39, 400), generator.uniform(0, 29, 400)
    looked = np.empty((400, 4))
    _look_up(values, valid, column, row, 0, 400, looked)
    sound = (column >= 1) & (row >= 1) & (column < 38) & (row < 28)
    sound &= ~((abs(np.floor(column) - 19.5) <= 2) & (abs(np.floor(row) - 9.5) <= 2))
    np.testing.assert_array_equal(looked[:, 3] == 1, sound)
    # Catmull–Rom repeats parabolas; their slope too.
    expected = np.stack([100 + 2 * column - 3 * row + 0.05 * column**2, 2 + 0.1 * column, -3 + 0 * row], axis=-1)
    np.testing.assert_allclose(looked[sound, :3], expected[sound], atol=1e-4)


def test_features_are_matched_as_numpy_does_it() -> None:
    from relume.capture.alignment.kernel import _match

    generator = np.random.default_rng(7)
    # Rising, with a flat part and one that is steep.
    table = np.interp(np.arange(-4, 260.25, 0.25), [-4, 60, 90, 150, 260], [0, 80, 80.5, 240, 255])
    values, positions = generator.uniform(0, 255, 500), generator.normal(0, 900, (500, 2))
    gradients, back = generator.normal(0, 9, (500, 2)), Motion(31.5, -7.25, 0.02)
    placed, edges, written = np.zeros((503, 2)), np.zeros((503, 2)), np.zeros((2, 503))
    turn = np.cos(back.angle), np.sin(back.angle), back.dx, back.dy
    count = _match(table, values, positions, gradients, 4.0, 247.0, *turn, 3, placed, *written, edges)
    below = ((values + 4) * 4).astype(int)
    targets = table[below] + ((values + 4) * 4 - below) * (table[below + 1] - table[below])
    slopes = (table[below + 16] - table[below - 16]) / 8
    usable = (targets > 4) & (targets < 247) & (slopes > 0.05)
    assert count == 3 + usable.sum() and 100 < usable.sum() < 480
    np.testing.assert_array_equal(placed[3:count], back.apply(positions[usable]))
    np.testing.assert_array_equal(written[:, 3:count], [targets[usable], 1 / (1 + slopes[usable] ** 2)])
    np.testing.assert_array_equal(edges[3:count], gradients[usable])
    assert not placed[:3].any() and not placed[count:].any()


def test_pixels_that_both_frames_show_are_paired_where_the_motion_says() -> None:
    from relume.capture.alignment.kernel import _in_both

    y, x = np.mgrid[:40, :50]
    fixed, moving = (x + 100 * y).astype(np.float32), (1000 + x + 100 * y).astype(np.float32)
    inside = (x < 45).astype(np.uint8), (y > 3).astype(np.uint8)
    ours, theirs = np.empty((2, 14 * 17), np.float32)
    across, down = np.array([5.3, 0.9, -0.2]), np.array([-6.1, 0.2, 0.9])
    count = _in_both(fixed, inside[0], moving, inside[1], 3, across, down, ours, theirs)
    pairs = []
    for row in range(0, 40, 3):
        for column in range(0, 50, 3):
            at = round(5.3 + 0.9 * column - 0.2 * row), round(-6.1 + 0.2 * column + 0.9 * row)
            if 0 <= at[0] < 50 and 3 < at[1] < 40 and column < 45:
                pairs.append((column + 100 * row, 1000 + at[0] + 100 * at[1]))
    assert 50 < len(pairs) < 200
    np.testing.assert_array_equal(np.stack([ours, theirs], axis=-1)[:count], pairs)


@pytest.mark.parametrize("parameters", [2, 3])
def test_steps_follow_the_change_of_values_with_the_motion(parameters: int) -> None:
    from relume.capture.alignment.kernel import _differentiate, _place, _whiten

    generator = np.random.default_rng(8)
    positions, targets, weights = generator.normal(0, 900, (300, 2)), *generator.uniform(0.2, 200, (2, 300))
    seen = generator.normal(100, 40, (300, 4))
    seen[:, 3] = generator.random(300) > 0.3
    sound, motion, (x, y) = seen[:, 3] == 1, Motion(20.0, -11.0, 0.015), np.empty((2, 300))
    turned = np.cos(motion.angle), np.sin(motion.angle), motion.dx, motion.dy
    _place(positions, *turned, 4000, 3000, 6, x, y)
    placed = motion.apply(positions)
    np.testing.assert_array_equal([x, y], np.add(placed, (2000, 1500)).T / 6 - 0.5)
    residual, whitened, jacobian, weighted = (
        np.empty(300),
        np.empty(300),
        np.empty((300, 3)),
        np.empty((300, parameters)),
    )
    count = _whiten(seen, targets, weights, whitened)
    _differentiate(
        seen, whitened, (positions, targets, weights), *turned, 6, 2500.0, 90.0, residual, jacobian, weighted
    )
    missed = seen[sound, 0] - targets[sound]
    slopes, arm = seen[sound, 1:3] / 6, placed[sound] - (motion.dx, motion.dy)
    expected = np.column_stack([slopes, (slopes[:, 1] * arm[:, 0] - slopes[:, 0] * arm[:, 1]) / 2500])
    trust = weights[sound] / (1 + (missed * np.sqrt(weights[sound]) / 90) ** 2) ** 2
    assert count == sound.sum()
    np.testing.assert_array_equal(whitened[:count], missed * np.sqrt(weights[sound]))
    np.testing.assert_array_equal(residual[:count], missed)
    np.testing.assert_array_equal(jacobian[:count], expected)
    np.testing.assert_array_equal(weighted[:count], (expected * trust[:, None])[:, :parameters])


def test_agreement_is_the_mean_cosine_between_the_gradients_seen() -> None:
    from relume.capture.alignment.kernel import _agreement

    generator = np.random.default_rng(9)
    seen, own = generator.normal(0, 20, (200, 4)), generator.normal(5, 20, (200, 2))
    seen[:, 1:3] += own
    seen[:, 3], seen[0, 1:3] = generator.random(200) > 0.4, 0
    sound = seen[:, 3] == 1
    products, lengths = (own * seen[:, 1:3]).sum(1), np.hypot(*own.T) * np.hypot(*seen[:, 1:3].T)
    expected = np.mean((products / np.maximum(lengths, 1e-9))[sound])
    assert _agreement(seen, own) == pytest.approx(expected, abs=1e-12) and 0.2 < expected < 0.9


def street(shared: Path, times: dict[str, float]) -> Bracket:
    folder = shared / "data/brackets/handheld_street"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # their colour profile
        frames = {name: files.read_photograph(folder / name) for name in times}
    return Bracket(tuple(replace(frames[name], exposure=Exposure(t)) for name, t in times.items()))


def test_the_street_held_by_hand(shared: Path) -> None:
    bracket = street(shared, {"IMG_4210.jpg": 1 / 320, "IMG_4209.jpg": 1 / 80, "IMG_4211.jpg": 1 / 20})
    aligned = align(bracket)
    assert aligned.moved and max(aligned.errors) < 0.1

    def doubt(given: Bracket) -> float:
        """How much the photographs disagree about radiance, by the response's own misfit."""
        return float(recover_response(given).residual.mean())

    assert doubt(aligned.bracket) < 0.6 * doubt(bracket)
    assert merge(aligned.bracket, recover_response(aligned.bracket).response).radiance.shape == (1080, 720, 3)


def test_an_independent_reading_of_the_street(shared: Path) -> None:
    """The motions found move points of one frame onto the same points of another: their gradients line up."""
    bracket = street(shared, {"IMG_4210.jpg": 1.0, "IMG_4209.jpg": 4.0})
    aligned = align(bracket)
    own, other = (p.pixels[..., 1].astype(float) for p in bracket.photographs)
    fixed, moving = (own, other) if aligned.reference == 0 else (other, own)
    motion = aligned.motions[1 - aligned.reference]
    height, width = fixed.shape
    y, x = np.mgrid[60 : height - 60, 60 : width - 60]
    around = np.stack([x + 0.5 - width / 2, y + 0.5 - height / 2], axis=-1)

    def likeness(motion: Motion) -> float:
        places = motion.apply(around)
        read = map_coordinates(moving, [places[..., 1] + height / 2 - 0.5, places[..., 0] + width / 2 - 0.5], order=3)
        edges = [np.array(np.gradient(picture)) for picture in (read, fixed[60 : height - 60, 60 : width - 60])]
        return float((edges[0] * edges[1]).sum() / np.sqrt((edges[0] ** 2).sum() * (edges[1] ** 2).sum()))

    best = likeness(motion)
    for change in ((0.3, 0, 0), (-0.3, 0, 0), (0, 0.3, 0), (0, -0.3, 0), (0, 0, 1e-3), (0, 0, -1e-3)):
        assert likeness(Motion(motion.dx + change[0], motion.dy + change[1], motion.angle + change[2])) < best


def test_less_than_an_eighth_of_a_pixel_or_twice_the_error_is_left_alone() -> None:
    def needed(dx: float, error: float) -> Motion:
        return _needed(Estimate(Motion(dx), error, 1.0), (WIDTH, HEIGHT))

    assert needed(0.12, 0.01) == Motion() and needed(0.13, 0.01) == Motion(0.13)
    assert needed(0.19, 0.1) == Motion() and needed(0.21, 0.1) == Motion(0.21)
    # A neighbour's motion, kept in whole pixels where nothing was reported.
    assert needed(2.6, np.inf) == Motion(3.0) and needed(0.4, np.inf) == Motion()

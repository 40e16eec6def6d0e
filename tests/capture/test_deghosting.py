"""Deghosting: what stands still is left as it is, what moved comes from one instant, no pixel loses its last frame."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from moving_scenes import CAMERA, MovingScene, background, known_response, moving_scene
from relume.capture.brackets.merging import merge_brackets
from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.capture.ghosts.deghosting import Consistency, Deghosted, deghost
from relume.capture.ghosts.kernel import consensus, disagreement, square_bounds
from relume.capture.ghosts.levels import Scale, _offset, corrections
from relume.capture.ghosts.regions import Regions, excluded_frames, moving_regions
from relume.capture.merging import merge
from relume.capture.response.calibration import recover_response
from relume.errors import NotABracket
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import SATURATED
from relume.image.response import Response
from relume.report.capture_report import clipped_facts

RESPONSE = known_response()
SECONDS = (0.01, 0.04, 0.16)


def plain_scene(shape: tuple[int, int] = (96, 128)) -> np.ndarray:
    """Background of 6 stops, in the middle of what the three exposures of SECONDS hold."""
    return background(np.random.default_rng(3), shape, 6.0).astype(np.float32) / 3


def with_block(scene: np.ndarray, left: int, radiance: float, *, top: int = 30, size: int = 24) -> np.ndarray:
    scene = scene.copy()
    scene[top : top + size, left : left + size] = radiance
    return scene


def require_unchanged(result: Deghosted, bracket: Bracket) -> None:
    assert all(a is b for a, b in zip(result.bracket.photographs, bracket.photographs, strict=True))
    assert not result.ghosts.any() and np.all(result.sources == -1) and np.all(result.shares == 0)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("quality", [None, 85], ids=["sensor noise", "JPEG"])
def test_a_static_scene_is_left_as_it_is(seed, quality):
    scene = moving_scene(seed, leaves=seed % 2 == 1, shape=(240, 360)).static()
    bracket = scene.bracket(quality=quality, seed=seed)
    require_unchanged(deghost(bracket, RESPONSE), bracket)


def test_saturated_and_black_places_stay():
    scene = plain_scene()
    scene[:30, :40], scene[60:, 90:] = 5e3, 1e-5
    bracket = MovingScene("ends", (scene,) * 3, SECONDS).bracket()
    assert (bracket.photographs[0].pixels[:30, :40] == 255).all()
    assert (bracket.photographs[2].pixels[70:, 100:] < 20).all()
    require_unchanged(deghost(bracket, RESPONSE), bracket)


@pytest.mark.parametrize("wrong", [0.3, 0.8, 1.26])
def test_wrong_times_and_a_wrong_response_are_no_motion(wrong):
    scene = MovingScene("still", (plain_scene(),) * 3, SECONDS)
    bracket = scene.bracket()
    frames = list(bracket.photographs)
    frames[1] = replace(frames[1], exposure=Exposure(SECONDS[1] * wrong))
    bracket = Bracket(tuple(frames))
    # A power that is 3 % off, and a toe that bends too much.
    curve = 1.03 * RESPONSE.log_exposure - 0.3 * np.exp(-np.arange(256) / 15.0)
    require_unchanged(deghost(bracket, Response(curve, RESPONSE.noise)), bracket)


def test_a_knee_and_a_floor_that_the_response_does_not_know_are_no_motion():
    bracket = MovingScene("still", (plain_scene((192, 256)) * 3,) * 3, SECONDS).bracket()
    for frame in bracket.photographs:
        values = frame.pixels.astype(np.float64)
        values = np.where(values > 205, 205 + (values - 205) * 0.5, np.maximum(values, 16 + 0.05 * values))
        frame.pixels[:] = np.rint(values)
    require_unchanged(deghost(bracket, RESPONSE), bracket)


@pytest.mark.parametrize("radiance", [0.08, 8.0], ids=["dark", "bright"])
@pytest.mark.parametrize("wrong", [1.0, 0.8], ids=["right times", "a wrong time"])
def test_what_moved_is_taken_from_one_instant(radiance, wrong):
    still = np.full((96, 128, 3), 1.0, np.float32) * (1 + 0.2 * np.sin(np.arange(128) / 9.0))[None, :, None]
    still = still.astype(np.float32)
    instants = tuple(with_block(still, left, radiance) for left in (10, 50, 90))
    bracket = MovingScene("block", instants, (0.1, 0.2, 0.4)).bracket()
    frames = list(bracket.photographs)
    frames[2] = replace(frames[2], exposure=Exposure(0.4 * wrong))
    result = deghost(Bracket(tuple(frames)), RESPONSE)
    # Every block, and no more than three squares around it.
    for left in (10, 50, 90):
        assert result.ghosts[30:54, left : left + 24].all()
        assert not result.ghosts[:, left + 31 : left + 33].any()
    assert not result.ghosts[:22].any() and not result.ghosts[62:].any()
    source = result.reference
    assert set(np.unique(result.sources)) == {-1, source}
    timed = zip(result.bracket.photographs, (0.1, 0.2, 0.4), strict=True)
    taken = merge(Bracket(tuple(replace(p, exposure=Exposure(t)) for p, t in timed)), RESPONSE)
    error = np.abs(np.log(taken.radiance / instants[source]))
    assert np.percentile(error[result.ghosts], 99) < 0.25 and np.median(error[result.ghosts]) < 0.05
    plain = np.abs(np.log(merge(bracket, RESPONSE).radiance / instants[source]))
    assert np.percentile(plain[result.ghosts], 80) > 0.3


def test_a_bright_thing_before_a_saturated_sky_is_taken_from_a_frame_that_shows_it():
    # The longest frame shows nothing but white there: no instant can be had from it.
    sky = plain_scene() * 0.1
    sky[:60] = 60.0
    instants = tuple(with_block(sky, left, 30.0, top=15) for left in (10, 50, 90))
    result = deghost(MovingScene("sky", instants, (0.005, 0.012, 0.32)).bracket(), RESPONSE)
    assert result.reference < 2 and set(np.unique(result.sources)) == {-1, result.reference}
    taken = merge(result.bracket, RESPONSE)
    assert taken.clipped is not None and not taken.clipped[15:39].any()
    error = np.abs(np.log(taken.radiance / instants[result.reference]))[10:45]
    assert np.median(error) < 0.05 and np.percentile(error, 98) < 0.3


def test_every_pixel_keeps_a_frame_that_shows_it():
    for seed in range(3):
        bracket = moving_scene(seed, shape=(160, 240)).bracket()
        frames = list(bracket.photographs)
        for index, frame in enumerate(frames):
            outside = np.zeros((160, 240), bool)
            outside[:, : 20 * index], outside[: 10 * index] = True, True
            frames[index] = replace(frame, outside=outside)
        result = deghost(Bracket(tuple(frames)), RESPONSE)
        lost = np.stack([p.outside for p in result.bracket.photographs if p.outside is not None])
        before = np.stack([p.outside for p in frames if p.outside is not None])
        assert result.ghosts.any() and not lost.all(0).any()
        np.testing.assert_array_equal(lost & before, before)
        np.testing.assert_array_equal((lost & ~before).any(0) | before.any(0), result.ghosts | before.any(0))


def test_what_is_outside_in_a_frame_says_nothing():
    still = plain_scene()
    bracket = MovingScene("border", (still,) * 3, SECONDS).bracket()
    border = np.zeros((96, 128), bool)
    border[:, :30] = True
    bracket.photographs[1].pixels[border] = (0, 0, 255)
    ghosts = deghost(bracket, RESPONSE).ghosts
    assert ghosts[:, :30].mean() > 0.9 and not ghosts[:, 40:].any()
    marked = Bracket((bracket.photographs[0], replace(bracket.photographs[1], outside=border), bracket.photographs[2]))
    require_unchanged(deghost(marked, RESPONSE), marked)


def test_sixteen_bits_are_compared_as_well_as_eight():
    curve = np.log((np.arange(65536) + 0.5) / 65535)
    response = Response(np.stack([curve] * 3), np.full(3, 20.0))
    generator, still = np.random.default_rng(16), np.full((96, 128, 3), 1.0, np.float32)

    def frames(places: tuple[int, int, int]) -> Bracket:
        photographs = []
        for left, seconds in zip(places, SECONDS, strict=True):
            values = 65535 * with_block(still, left, 0.1) * seconds + generator.normal(0, 20, still.shape)
            pixels = np.clip(values, 0, 65535).astype(np.uint16)
            photographs.append(Photograph(pixels, f"{left}.tif", Exposure(seconds)))
        return Bracket(tuple(photographs))

    unmoved = frames((50, 50, 50))
    require_unchanged(deghost(unmoved, response), unmoved)
    moved = deghost(frames((10, 50, 90)), response)
    assert moved.ghosts[30:54, [10, 50, 90]].all() and moved.ghosts.mean() < 0.3


def test_one_photograph_and_equal_exposures():
    one = Bracket((CAMERA.photograph(plain_scene(), Exposure(0.04)),))
    require_unchanged(deghost(one, RESPONSE), one)
    still = plain_scene()
    twice = MovingScene("twice", (still, with_block(still, 40, 9.0)), (0.04, 0.04)).bracket()
    result = deghost(twice, RESPONSE)
    assert result.ghosts[30:54, 40:64].mean() > 0.95 and sorted(np.round(result.shares, 3))[0] == 0


def test_a_response_of_another_depth_is_refused():
    bracket = MovingScene("depth", (plain_scene(),) * 3, SECONDS).bracket()
    curve = np.log((np.arange(65536) + 0.5) / 65535)
    with pytest.raises(NotABracket, match=r"256 values and a response of 65536"):
        deghost(bracket, Response(np.stack([curve] * 3), np.full(3, 20.0)))


def bounds_of(photograph: Photograph, side: int, shift: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    curve = np.exp((np.arange(256) - 255.0) / 50)
    bounds, middle, measured = square_bounds(
        (photograph,),
        np.stack([curve] * 3).astype(np.float32),
        np.full((3, 256), 0.03, np.float32),
        np.array([[6, 249]] * 3),
        np.log([2.0]),
        side=side,
        shift=shift,
        crosstalk=0.0,
    )
    return bounds[0], middle[0], measured[0]


def test_the_bounds_of_a_square_by_hand():
    pixels = np.full((2, 6, 3), 105, np.uint8)
    pixels[:, 4:] = 155
    pixels[0, 0, 1], pixels[:, 4, 2] = 3, 255
    bounds, middle, measured = bounds_of(Photograph(pixels), 2, 0.5)
    # 105 is e⁻³, 155 is e⁻²; a quarter of the square beside the edge may be exchanged; noise is 0.03, the time 2.
    dark, bright = math.exp(-3), math.exp(-2)
    at = -math.log(2.0)
    assert bounds[:, 0, 0, 0] == pytest.approx([-3 + at - 0.03, -3 + at + 0.03], abs=1e-5)
    gain = math.log(dark + 0.25 * (bright - dark))
    assert bounds[:, 0, 1, 0] == pytest.approx([-3 + at - 0.03, gain + at + 0.03], abs=1e-5)
    loss = math.log(bright - 0.25 * (bright - dark))
    assert bounds[:, 0, 2, 0] == pytest.approx([loss + at - 0.03, -2 + at + 0.03], abs=1e-5)
    # One black pixel of four holds from nothing to the black end; a white one any amount.
    black = math.exp(-249 / 50)
    assert bounds[0, 0, 0, 1] == pytest.approx(math.log(0.5 * dark) + at - 0.03, abs=1e-5)
    assert bounds[1, 0, 0, 1] == pytest.approx(math.log(dark + black) + at + 0.03, abs=1e-5)
    assert bounds[1, 0, 2, 2] == np.inf and np.isfinite(bounds[0, 0, 2, 2])
    assert middle[0, :, 0].tolist() == [105, 105, 155] and measured.tolist() == [[False, True, False]]


def test_disagreement_is_the_widest_gap_in_any_channel():
    generator = np.random.default_rng(5)
    low = generator.normal(0, 1, (4, 5, 6, 3))
    bounds = np.stack([low, low + generator.uniform(0, 1, low.shape)], axis=1).astype(np.float32)
    bounds[0, 1, :2], bounds[3, 0, 3:] = np.inf, -np.inf
    middle = generator.integers(0, 256, (4, 5, 6, 3)).astype(np.uint8)
    tables = generator.normal(0, 0.3, (4, 2, 3, 256)).astype(np.float32)
    said = bounds.copy()
    apart = disagreement(said, middle, tables)
    for i in range(5):
        for j in range(6):
            gaps = []
            for c in range(3):
                lows = [bounds[p, 0, i, j, c] + tables[p, 0, c, middle[p, i, j, c]] for p in range(4)]
                ups = [bounds[p, 1, i, j, c] + tables[p, 1, c, middle[p, i, j, c]] for p in range(4)]
                assert said[2, 0, i, j, c] == pytest.approx(lows[2])
                gaps.append(max(lows) - min(ups))
            assert apart[i, j] == pytest.approx(max(gaps), abs=1e-5)


def test_consensus_is_the_largest_party_that_agrees_with_the_source():
    def agreeing(*intervals: tuple[float, float]) -> tuple[list[bool], bool]:
        bounds = np.repeat(np.array(intervals, np.float32)[:, :, None, None], 3, axis=3)
        agree, unsure = np.empty((len(intervals), 1), bool), np.empty(1, bool)
        consensus(bounds, np.arange(len(intervals)), agree, unsure)
        return agree[:, 0].tolist(), bool(unsure[0])

    assert agreeing((0, 1), (0.5, 2), (0.9, 3)) == ([True, True, True], False)
    assert agreeing((0, 1), (2, 3), (0.9, 3)) == ([True, False, True], False)
    # The source is white from 1 on: one frame shows a passer-by, two the wall.
    assert agreeing((1, np.inf), (4, 5), (2, 3), (2.5, 3.5)) == ([True, False, True, True], True)
    assert agreeing((1, np.inf), (0, 0.5)) == ([True, False], False)


def test_the_only_frame_that_shows_a_place_is_kept_beside_what_moved_in_it():
    bounds = np.empty((2, 2, 12, 12, 3), np.float32)
    bounds[:, 0], bounds[:, 1] = 0.0, 1.0
    bounds[1, :, 4:8, 4:8] += 3.0
    bounds[0, 0, 3, :], bounds[0, 1, 3, :] = -np.inf, np.inf  # outside the first frame
    measured = np.ones((2, 12, 12), bool)
    measured[0, 3], measured[1, :3], measured[1, 8:] = False, False, False
    labels = np.zeros((12, 12), np.int32)
    labels[2:10, 2:10] = 1
    measured[1, 3] = False
    excluded, sources, reference = excluded_frames(Regions(labels, 1), bounds, measured, np.array([0.0, 1.0]))
    assert reference == 0
    np.testing.assert_array_equal(sources, np.where(labels > 0, 0, -1))
    expected = np.zeros((12, 12), bool)
    expected[4:9, 3:9] = True  # grown by one, but for the row that only this frame shows
    np.testing.assert_array_equal(excluded[1], expected)
    assert not excluded[0].any()


def test_what_dark_values_say_against_the_longer_frame_counts_from_above_only():
    # Two frames a factor of 4 apart through a straight curve; nothing in the shorter one is darker than 60.
    curve = np.stack([(np.arange(256) - 255.0) / 30] * 3)
    scale, generator = Scale(curve, np.array([[6, 249]] * 3)), np.random.default_rng(9)
    log_times = np.array([0.0, math.log(4.0)])
    radiance = generator.uniform(curve[0, 10], curve[0, 200], (20_000, 1)) * np.ones(3)
    values = np.stack([np.interp(radiance - math.log(4.0) + t, curve[0], np.arange(256.0)) for t in log_times])
    values[0] = np.maximum(values[0], 60)
    middle = np.rint(values).astype(np.uint8)
    said = curve[0][middle] - log_times[:, None, None]
    tables = corrections(np.stack([said - 0.02, said + 0.02], axis=1), middle, log_times, scale, 1, slack=0.05)
    assert np.all(tables[0, 0, :, :55] == -np.inf) and np.all(np.isfinite(tables[0, 0, :, 80:]))
    assert np.all(np.isfinite(tables[0, 1])) and np.all(np.isfinite(tables[1]))
    np.testing.assert_allclose(tables[1, :, :, 100], [[-0.05] * 3, [0.05] * 3], atol=1e-6)


def test_noise_and_lines_are_no_regions():
    apart = np.full((40, 60), -0.1)
    apart[5, 5], apart[10, 10:40] = 5.0, 5.0  # a hot square; an edge out of register
    apart[20:30, 10:20] = 0.05  # wide but faint
    assert moving_regions(apart, contrast=0.2, reach=3).count == 0
    apart[25:27, 14:16] = 0.4
    regions = moving_regions(apart, contrast=0.2, reach=3)
    assert regions.count == 1
    expected = np.zeros((40, 60), bool)
    expected[18:32, 8:22] = True
    np.testing.assert_array_equal(regions.labels == 1, expected)
    # Close together is one region, far apart two.
    apart[20:30, 27:30] = apart[20:30, 45:50] = 0.5
    assert moving_regions(apart, contrast=0.2, reach=3).count == 2


def test_the_method_s_limits_are_what_it_tolerates():
    still = np.full((64, 96, 3), 1.0, np.float32)
    scene = MovingScene("faint", (still, with_block(still, 30, 1.5), still), (0.1, 0.2, 0.4))
    bracket = scene.bracket()
    assert deghost(bracket, RESPONSE, method=Consistency(contrast=0.05)).ghosts[35:50, 35:50].all()
    require_unchanged(deghost(bracket, RESPONSE, method=Consistency(slack=0.3)), bracket)


def real(folder: Path) -> tuple[Bracket, Response]:
    paths = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".jpg")
    bracket = read_bracket(paths)
    return bracket, recover_response(bracket).response


# slow: test_a_static_scene_is_left_as_it_is goes red for the same break, of real photographs
# test_people_in_a_real_hall_are_found, whose ceiling stands still.
@pytest.mark.slow
def test_a_real_room_on_a_tripod_is_all_but_untouched(shared):
    result = deghost(*real(shared / "data" / "brackets" / "window"))
    # A quarter of a percent: the edges of a lamp's shade, on which two frames are out of register.
    assert result.ghosts.mean() < 0.006


def test_people_in_a_real_hall_are_found(shared):
    bracket, response = real(shared / "data" / "brackets" / "ghost_hall")
    result = deghost(bracket, response)
    assert 0.005 < result.ghosts.mean() < 0.04
    # Who walks past the platform on the right; the ceiling and the tree stand still.
    assert result.ghosts[430:480, 685:735].mean() > 0.5
    assert not result.ghosts[:120].any()
    # One moment, but for what is white in it.
    counts = np.sort(np.unique(result.sources[430:480, 685:735], return_counts=True)[1])
    assert counts[-2:].sum() > 0.95 * counts.sum()


def test_a_lamp_that_moved_is_not_lost_to_the_wall_behind_it():
    # Where it was when two frames were taken it is white in both; the shortest shows the dark wall there.
    still = np.full((96, 128, 3), 0.03, np.float32)
    instants = tuple(with_block(still, left, 40.0, size=16) for left in (20, 80, 80))
    bracket = MovingScene("lamp", instants, (0.02, 0.08, 0.32)).bracket()
    taken = merge(deghost(bracket, RESPONSE).bracket, RESPONSE)
    assert taken.clipped is not None
    assert np.all(taken.clipped[32:44, 82:94] == SATURATED) and taken.radiance[32:44, 82:94].min() > 10
    found = merge_brackets(bracket, profile=RESPONSE).bracket
    assert set(found.clipping.moved) == {"frame_2.jpg"} and found.clipping.moved["frame_2.jpg"] > 140
    words = dict(clipped_facts(found.clipping, "relative"))
    assert "in frame_2.jpg" in words["of them where something moved, white in the one that counts"]


def test_squares_white_in_all_that_is_kept_come_from_the_longest_frame_that_measures_them():
    bounds = np.empty((3, 2, 4, 4, 3), np.float32)
    bounds[:, 0], bounds[:, 1] = 0.0, 1.0
    bounds[2, 0], bounds[2, 1] = 2.0, np.inf  # white everywhere
    bounds[0, 0, 0], bounds[0, 1, 0] = -np.inf, -5.0  # black
    bounds[1, 1, 1] = np.inf
    bounds[:2, :, 3] -= 2.0  # plainly darker: another thing
    labels = np.ones((4, 4), np.int32)
    measured = np.zeros((3, 4, 4), bool)
    measured[2] = True  # as if it were, so that it is the reference
    excluded, sources, reference = excluded_frames(Regions(labels, 1), bounds, measured, np.array([0.0, 1.0, 2.0]))
    assert reference == 2
    # The middle frame where it is clear, the shortest where only it is.
    np.testing.assert_array_equal(sources, np.repeat([[1], [0], [1], [2]], 4, axis=1))
    np.testing.assert_array_equal(np.argmin(excluded, axis=0), sources)
    assert np.all(excluded.sum(0) == 2)


def test_frames_are_put_on_one_scale_by_what_is_known_best():
    width, apart = np.repeat([0.0, 1.0], [40, 60]), np.repeat([0.1, 0.5], [40, 60])
    frame = np.stack([-width / 2, width / 2])[..., None]
    where = [np.ones(100, bool)]
    assert _offset(frame, frame + apart[:, None], where) == pytest.approx(0.1)
    assert _offset(0 * frame, 0 * frame + apart[:, None], where) == pytest.approx(0.5)

"""Merging camera raws: as exact as photons allow, drawn to neither side, and honest about what it does not know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from dng_files import RGGB, sensed, write_dng
from relume.capture.raw.kernel import Frame, accumulate, concluded
from relume.capture.raw.merging import RawCalibration, calibrate_raw, merge_raw
from relume.capture.raw.sensor import Sensor, SensorNoise, fitted_noise, noise_between, noise_within
from relume.errors import NotABracket, UnreadableFile
from relume.image.files import read_raw
from relume.image.photograph import Exposure, RawPhotograph
from relume.image.radiance import BLACK, SATURATED

ELECTRONS, READ = 20_000.0, 3.0
NOISE = SensorNoise(1 / ELECTRONS, READ / ELECTRONS)
SENSOR = Sensor((512.0, 512.0, 512.0, 512.0), 16383.0, 1.0, NOISE)
DEVIATION = float(np.sqrt(NOISE.shot + NOISE.read**2))
"""Of the signal at white."""
SECONDS = (0.25, 1.0, 4.0)
SIZE = (320, 320)
Y, X = np.mgrid[: SIZE[0], : SIZE[1]]


def mosaic_merge(
    radiance: np.ndarray,
    seconds: Sequence[float] = SECONDS,
    *,
    seed: int = 0,
    electrons: float = ELECTRONS,
    read: float = READ,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radiance, variance and mask of the photosites themselves, exposures and noise known."""
    sums, shorter = np.zeros((4, *radiance.shape), np.float32), None
    for index, t in enumerate(seconds):
        values = sensed(radiance, t, electrons=electrons, read_noise=read, seed=100 * seed + index)
        frame = Frame(values, np.full((2, 2), 512.0), 16383.0, t, (1 / electrons, read / electrons), 1.0)
        accumulate(sums, frame, shorter)
        shorter = frame
    return concluded(sums, np.full((2, 2), 512.0))


def information(
    radiance: np.ndarray, seconds: Sequence[float] = SECONDS, electrons: float = ELECTRONS, read: float = READ
) -> np.ndarray:
    """One over the Cramér–Rao bound: Σ t² / variance of the signal over the frames that are not saturated."""
    total = np.zeros(radiance.shape)
    for t in seconds:
        variance = radiance * t / electrons + (read / electrons) ** 2 + (1 / (16383 - 512)) ** 2 / 12
        total += np.where(radiance * t < 1 - 5 * DEVIATION, t**2 / variance, 0)
    return total


def raws(
    radiance: np.ndarray, seconds: Sequence[float] = SECONDS, *, electrons: float = ELECTRONS
) -> list[RawPhotograph]:
    """A bracket of a camera whose colours are Rec. 709, in a RGGB mosaic of the same radiance in all channels."""
    return [
        RawPhotograph(
            sensed(radiance, t, seed=index, electrons=electrons), np.array(RGGB), np.full((2, 2), 512.0), 16383.0,
            np.eye(3), np.ones(3), name=f"frame_{index}.dng", exposure=Exposure(t),
        )
        for index, t in enumerate(seconds)
    ]  # fmt: skip


def known(photographs: Sequence[RawPhotograph], saturation: float = 1.0) -> RawCalibration:
    exposures = tuple(raw.exposure for raw in photographs if raw.exposure)
    factors = np.array([exposure.factor for exposure in exposures])
    return RawCalibration(
        tuple(raw.name for raw in photographs), exposures, factors, NOISE, saturation, np.zeros(len(factors)), SENSOR
    )


FIELDS = {
    "dim, below the read noise": np.full(SIZE, 1e-4),
    "dark": np.full(SIZE, 2e-3),
    "all frames": np.full(SIZE, 0.1),
    "one frame saturated": np.full(SIZE, 0.5),
    "two frames saturated": np.full(SIZE, 2.0),
    "textured": 0.25 * (1 + 0.6 * np.sin(X / 9) * np.cos(Y / 7)),
    "every level": 2.0 ** (X / 40 - 7),
    "edges": np.where((X // 20 + Y // 13) % 2, 0.05, 0.6),
}


@pytest.mark.parametrize("field", FIELDS)
def test_the_variance_is_within_a_twentieth_of_the_cramer_rao_bound(field):
    radiance = FIELDS[field]
    merged, variance, clipped = mosaic_merge(radiance)
    assert not clipped.any()
    normalised = (merged - radiance) * np.sqrt(information(radiance))
    assert normalised.var() <= 1.05  # 10⁵ photosites: ± 0.005 of chance
    # And the variance plane says so: each is as uncertain as it claims.
    claimed = ((merged - radiance) / np.sqrt(variance)).var()
    assert claimed == pytest.approx(1, abs=0.1)


# A frame saturates in the middle of each of these, in units of its noise; the frame two stops up is already.
NEAR_SATURATION = {
    f"{steps:+g} deviations from saturation": np.full(SIZE, 1 + steps * DEVIATION)
    for steps in (-20, -9, -7, -6, -5, -4, -3, -2, -1, 0, 1, 3)
}


@pytest.mark.parametrize("field", [*FIELDS, *NEAR_SATURATION])
def test_nothing_draws_the_mean_to_one_side(field):
    radiance = (FIELDS | NEAR_SATURATION)[field]
    merged, _, clipped = mosaic_merge(radiance, seed=1)
    assert not clipped.any()
    error = (merged - radiance) * np.sqrt(information(radiance))
    assert abs(error.mean()) <= 4 * error.std() / np.sqrt(error.size)


def test_photon_noise_alone_is_merged_as_the_sum_of_values_over_the_sum_of_times():
    radiance, seconds = np.full(SIZE, 0.2), (0.5, 1.0, 2.0)
    merged, variance, _ = mosaic_merge(radiance, seconds, read=0.0)
    bound = 0.2 / (ELECTRONS * sum(seconds))
    assert merged.var() <= 1.05 * bound
    assert variance.mean() == pytest.approx(bound, rel=0.02)
    values = [sensed(radiance, t, read_noise=0.0, seed=index) for index, t in enumerate(seconds)]
    pooled = sum((v - 512.0) / (16383 - 512) for v in values) / sum(seconds)
    # The weights come from eight neighbours each, so the two differ by a small part of their own noise.
    assert np.std(merged - pooled) < 0.02 * np.sqrt(bound)


def test_values_below_black_are_kept_so_that_the_dark_is_not_lifted():
    merged, variance, clipped = mosaic_merge(np.zeros(SIZE))
    assert not clipped.any()
    assert (merged < 0).mean() == pytest.approx(0.5, abs=0.02)
    assert abs(merged.mean()) <= 4 * merged.std() / np.sqrt(merged.size)
    assert variance.mean() == pytest.approx(merged.var(), rel=0.1)


def test_what_every_frame_saturates_is_bounded_by_the_shortest_and_what_none_shows_by_the_noise():
    radiance = np.full((40, 40), 0.1)
    radiance[:, 20:] = 9.0  # 0.25 s saturates at 4
    merged, variance, clipped = mosaic_merge(radiance)
    assert (clipped[:, 20:] == SATURATED).all()
    np.testing.assert_allclose(merged[:, 20:], 4.0, rtol=1e-6)
    assert np.isinf(variance[:, 20:]).all()
    assert not clipped[:, :20].any()
    # A camera that subtracts black itself writes 0 for all that lies below.
    sums, none = np.zeros((4, 12, 12), np.float32), np.zeros((12, 12), np.uint16)
    accumulate(sums, Frame(none, np.zeros((2, 2)), 16383.0, 2.0, (NOISE.shot, NOISE.read), 1.0), None)
    merged, variance, clipped = concluded(sums, np.zeros((2, 2)))
    assert (clipped == BLACK).all()
    # Two deviations: of eight empty neighbours' eighth of an electron, read noise and rounding, at 2 s.
    np.testing.assert_allclose(merged, 2 * np.sqrt(NOISE.read**2 + 1 / 12 / 16383**2) / 2, rtol=1e-5)
    assert np.isinf(variance).all()


def test_kernel_and_slow_twin_agree():
    generator = np.random.default_rng(4)
    radiance = 0.4 * np.exp(generator.normal(0, 1.2, (14, 16)))
    black, levels = np.array([[500.0, 510], [520, 530]]), (1 / 5000, 6 / 5000)
    frames = [Frame(sensed(radiance, t, black=515, seed=9), black, 16000.0, t, levels, 0.98) for t in (0.3, 1.1, 3.0)]
    sums, shorter = np.zeros((4, 14, 16), np.float32), None
    for frame in frames:
        accumulate(sums, frame, shorter)
        shorter = frame
    merged, variance, clipped = concluded(sums, black)
    deviation = np.sqrt(levels[0] * 0.98 + levels[1] ** 2)

    expected, parts = merged.astype(float).copy(), np.full((14, 16, 2), np.inf)

    def signal_around(frame: Frame, y: int, x: int) -> float:
        padded = np.pad(frame.mosaic.astype(float), 2, mode="reflect")[y : y + 5 : 2, x : x + 5 : 2]
        level = black[y % 2, x % 2]
        return ((padded.sum() - padded[1, 1]) / 8 - level) / (16000 - level)

    for y in range(14):
        for x in range(16):
            level, terms = black[y % 2, x % 2], []
            for index, frame in enumerate(frames):
                own, around = (frame.mosaic[y, x] - level) / (16000 - level), signal_around(frame, y, x)
                before = frames[max(index - 1, 0)]
                foreseen = signal_around(before, y, x) * frame.factor / before.factor
                near = own > 0.98 - 14 * deviation and max(around, foreseen) > 0.98 - 5 * deviation
                if own >= 0.98 * (1 - 1e-6) or near:
                    continue
                fixed = levels[1] ** 2 + 1 / 12 / (16000 - level) ** 2
                weight = frame.factor**2 / (fixed + levels[0] * (max(around, 0) + levels[0] / 8))
                terms.append((weight, own / frame.factor, levels[0] / frame.factor, fixed / frame.factor**2))
            if not terms:
                assert clipped[y, x] == SATURATED
                assert merged[y, x] == pytest.approx((frames[0].mosaic[y, x] - level) / (16000 - level) / 0.3, rel=1e-5)
                continue
            w, value, shot, read = np.array(terms).T
            mean = (w * value).sum() / w.sum()
            assert clipped[y, x] == 0
            assert merged[y, x] == pytest.approx(mean, rel=1e-5)
            expected[y, x], parts[y, x] = mean, np.array([(w**2 * shot).sum(), (w**2 * read).sum()]) / w.sum() ** 2
    assert 0 < (clipped == SATURATED).mean() < 0.5
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(expected, 2, mode="reflect"), (5, 5))[..., ::2, ::2]
    smooth = windows.mean((-1, -2))
    of_smooth = parts[..., 0] * np.maximum(smooth, 0) + parts[..., 1]
    of_own = parts[..., 0] * np.maximum(expected, 0) + parts[..., 1]
    alike = (expected - smooth) ** 2 <= 9 * of_smooth
    np.testing.assert_allclose(variance, np.where(alike, of_smooth, of_own), rtol=1e-3)


# From files to a picture


@pytest.fixture(scope="module")
def scene() -> np.ndarray:
    return 2.0 ** (X / 32 - 8) * (1 + 0.3 * np.sin(Y / 11))


@pytest.fixture(scope="module")
def bracket(scene) -> list[RawPhotograph]:
    return raws(scene, (1 / 16, 1 / 4, 1, 4))


def test_a_bracket_merges_to_the_radiance_it_came_from(scene, bracket):
    merged = merge_raw(bracket, calibration=known(bracket))
    assert merged.unit == "relative"
    assert merged.variance is not None and merged.clipped is not None and not merged.clipped.any()
    residual = (merged.radiance - scene[..., None]) / np.sqrt(merged.variance)
    # Interpolation smooths a photosite's width of the texture here and there, which no variance knows.
    assert residual.var() == pytest.approx(1, abs=0.1)


def test_a_good_sensors_bracket_is_within_half_a_percent_and_its_mean_within_a_thousandth(scene):
    photographs = raws(scene, (1 / 16, 1 / 4, 1, 4), electrons=60_000.0)
    merged = merge_raw(photographs)
    relative = (merged.radiance / scene[..., None] - 1)[scene > 0.05]
    assert np.median(np.abs(relative)) <= 0.005
    assert abs(relative.mean()) <= 0.001


def test_the_order_of_the_files_does_not_matter(bracket):
    mixed = [bracket[i] for i in (2, 0, 3, 1)]
    first, second = merge_raw(bracket), merge_raw(mixed)
    np.testing.assert_array_equal(first.radiance, second.radiance)
    np.testing.assert_array_equal(first.variance, second.variance)


def test_noise_is_measured_in_the_photographs_themselves(bracket):
    found = calibrate_raw(bracket).noise
    assert 1 / found.shot == pytest.approx(ELECTRONS, rel=0.03)
    assert found.read * ELECTRONS == pytest.approx(READ, rel=0.1)
    alone = calibrate_raw(bracket[2:3]).noise
    assert 1 / alone.shot == pytest.approx(ELECTRONS, rel=0.06)
    assert alone.read * ELECTRONS == pytest.approx(READ, rel=0.5)
    given = SensorNoise(1e-4, 1e-3)
    assert calibrate_raw(bracket, sensor=replace(SENSOR, noise=given)).noise == given


def test_what_moved_between_two_frames_is_not_taken_for_noise(scene):
    still = raws(scene, (1, 4))
    moved = [still[0], replace(still[1], mosaic=still[1].mosaic.copy())]
    moved[1].mosaic[100:160, 40:200] = sensed(2 * scene[100:160, 40:200], 4, seed=3)
    found = calibrate_raw(moved).noise
    assert 1 / found.shot == pytest.approx(ELECTRONS, rel=0.1)


def test_noise_formulas_hold_for_known_levels():
    generator = np.random.default_rng(8)
    level = np.repeat(np.linspace(0.002, 0.15, 20), 2000)
    first, second = (
        generator.poisson(level * t * ELECTRONS) / ELECTRONS + generator.normal(0, NOISE.read, level.size)
        for t in (1, 3)
    )
    rows = noise_between(first, second, 3.0, 1.0)
    assert len(rows) == 24
    # var(second − 3 first) = shot (3 L + 9 L) + read² (1 + 9), and 4 L is the level of the sum.
    np.testing.assert_allclose(rows[:, 1], 10.0)
    np.testing.assert_allclose(rows[:, 2], NOISE.shot * rows[:, 0] + 10 * NOISE.read**2, rtol=0.2)
    assert rows[-1, 0] == pytest.approx(3 * 4 * 0.15, rel=0.05)
    smooth = generator.poisson(np.tile(np.linspace(0.1, 0.7, 400), (200, 1)) * ELECTRONS) / ELECTRONS
    np.testing.assert_allclose(noise_within(smooth)[:, 2], 6 * NOISE.shot * noise_within(smooth)[:, 0] / 6, rtol=0.2)
    assert fitted_noise(np.zeros((0, 4)), 100) is None


def test_noise_goes_with_the_gain():
    at_800 = SensorNoise(1 / 20_000, 2e-4, 100).at(800)
    assert (at_800.shot, at_800.read, at_800.iso) == (8 / 20_000, 1.6e-3, 800)
    assert at_800.at(None) == at_800
    with pytest.raises(ValueError, match="not negative"):
        SensorNoise(-1, 0)


def test_times_that_are_only_nominal_are_refined_to_half_a_percent(scene):
    true = np.array([1 / 32, 1 / 8, 1 / 2, 2.0])
    said = np.array([1 / 30, 1 / 8, 1 / 2, 2.0])
    photographs = [replace(raw, exposure=Exposure(t)) for raw, t in zip(raws(scene, true.tolist()), said, strict=True)]
    refined = calibrate_raw(photographs).factors
    np.testing.assert_allclose(refined[1:] / refined[:-1], true[1:] / true[:-1], rtol=0.001)
    assert np.log(refined).mean() == pytest.approx(np.log(said).mean())
    np.testing.assert_array_equal(calibrate_raw(photographs, refine_exposures=False).factors, said)


def test_an_exposure_wrong_by_a_third_of_a_stop_is_reported_by_name(scene):
    said = (1 / 4, 2 ** (1 / 3), 4.0)
    photographs = [replace(raw, exposure=Exposure(t)) for raw, t in zip(raws(scene), said, strict=True)]
    with pytest.warns(UserWarning, match=r"frame_\d.dng: it got .* times the light of frame_\d.dng") as reported_of:
        refined = calibrate_raw(photographs).factors
    assert len(reported_of) == 2  # it lies between two neighbours
    np.testing.assert_allclose(refined[1:] / refined[:-1], 4, rtol=0.001)


def test_a_sensor_that_saturates_below_its_white_is_seen_to(scene):
    photographs = raws(scene, (1 / 16, 1 / 4, 1, 4))
    level = 14_000
    cut = [replace(raw, mosaic=np.minimum(raw.mosaic, level)) for raw in photographs]
    with pytest.warns(UserWarning, match=r"^frame_2\.dng: saturated at 85% of the white"):
        calibration = calibrate_raw(cut)
    assert calibration.saturation == pytest.approx((level - 512) / (16383 - 512), abs=1e-4)
    merged = merge_raw(cut, calibration=calibration)
    bright = scene > 0.05
    assert abs(np.mean(merged.radiance[bright] / scene[bright][:, None] - 1)) <= 0.001


def test_sensitivity_and_aperture_count(scene):
    # ISO 400 at f/2: the factor is 1 s · 4 / 4, and a quarter of the electrons make white.
    at_100, at_400 = raws(scene, (1.0,))[0], raws(scene, (1.0,), electrons=ELECTRONS / 4)[0]
    mixed = [
        replace(at_100, exposure=Exposure(4.0, 2.0, 100)),
        replace(at_400, exposure=Exposure(1.0, 2.0, 400), name="b"),
    ]
    merged = merge_raw(mixed, calibration=calibrate_raw(mixed, sensor=SENSOR))
    unsaturated = scene < 0.9
    assert merged.variance is not None
    # 20,000 and 5,000 electrons at white count together.
    expected = scene[unsaturated] / (1.25 * ELECTRONS)
    greens = merged.variance[..., 1][unsaturated]
    own = ((Y + X) % 2 == 1)[unsaturated] & (scene[unsaturated] > 0.05)
    np.testing.assert_allclose(np.median(greens[own] / expected[own]), 1, atol=0.03)


def colourful(balance: Sequence[float], matrix: np.ndarray) -> list[RawPhotograph]:
    site = np.array(RGGB)[Y % 2, X % 2]
    camera = np.linalg.solve(matrix, [0.5, 0.4, 0.3]) / balance
    photographs = raws(camera[site], (0.5, 1.0))
    return [replace(raw, matrix=matrix, daylight=np.array(balance)) for raw in photographs]


def test_balance_and_matrix_make_rec_709_of_camera_colours():
    matrix = np.array([[1.7, -0.8, 0.1], [-0.2, 1.6, -0.4], [0.0, -0.5, 1.5]])
    photographs = colourful([2.0, 1.0, 1.5], matrix)
    merged = merge_raw(photographs, calibration=known(photographs))
    assert merged.variance is not None
    np.testing.assert_allclose(merged.radiance.mean((0, 1)), [0.5, 0.4, 0.3], rtol=1e-3)
    residual = (merged.radiance - np.array([0.5, 0.4, 0.3], np.float32)) / np.sqrt(merged.variance)
    np.testing.assert_allclose(residual.var((0, 1)), 1, atol=0.1)
    neutral = merge_raw(photographs, calibration=known(photographs), balance=[1, 1, 1])
    assert neutral.radiance[..., 0].mean() < 0.9 * merged.radiance[..., 0].mean()
    with pytest.raises(ValueError, match="three positive multipliers"):
        merge_raw(photographs, balance=[1, 0, 1])


def test_files_merge_like_the_raws_read_from_them(tmp_path, scene):
    seconds = (1 / 16, 1 / 4, 1.0)
    paths = [
        write_dng(tmp_path / f"{i}.dng", sensed(scene, t, seed=i), seconds=t, f_number=1.0)
        for i, t in enumerate(seconds)
    ]
    merged = merge_raw(paths)
    again = merge_raw([read_raw(path) for path in paths])
    np.testing.assert_array_equal(merged.radiance, again.radiance)
    timed = merge_raw(paths, times=[2 * t for t in seconds])
    np.testing.assert_allclose(timed.radiance, merged.radiance / 2, rtol=1e-3, atol=1e-5)
    # Seen by that camera, equal values are not white: green is its most sensitive channel.
    ratio = read_raw(paths[0]).daylight
    assert merged.radiance[..., 0].mean() > merged.radiance[..., 1].mean()
    assert ratio[0] > ratio[1] == 1


def test_the_colour_chart_has_its_colours(shared):
    path = shared / "data/formats/raw/colorchart.dng"
    raw = read_raw(path)
    merged = merge_raw([path], times=[1 / 60], balance=raw.as_shot)
    assert merged.size == (1734, 1156)
    assert merged.clipped is not None and not merged.clipped.any()

    def patch(x: int, y: int) -> np.ndarray:
        return merged.radiance[y - 8 : y + 8, x - 8 : x + 8].mean((0, 1))

    # ColorChecker Classic: third row blue, green, red, yellow, magenta, cyan; fourth white to black.
    blue, green, red, yellow = (patch(x, 825) for x in (705, 817, 925, 1035))
    assert (blue.argmax(), green.argmax(), red.argmax(), yellow.argmin()) == (2, 1, 0, 2)
    assert red[0] > 4 * red[1] and yellow[1] > 2 * yellow[2]
    greys = [patch(x, 930)[1] for x in (703, 812, 922, 1035, 1148, 1258)]
    assert greys == sorted(greys, reverse=True)
    # Its white has nine tenths, its third grey a little over a third of the light (X-Rite: 90 %, 36 %).
    assert greys[2] / greys[0] == pytest.approx(0.4, abs=0.08)


# What cannot be merged


def test_bad_input_is_refused_in_one_line_that_names_the_file(tmp_path, bracket):
    with pytest.raises(NotABracket, match="name at least one file"):
        merge_raw([])
    with pytest.raises(NotABracket, match="2 times were given for 4"):
        merge_raw(bracket, times=[1, 2])
    without = [bracket[0], replace(bracket[1], exposure=None)]
    with pytest.raises(NotABracket, match=r"frame_1.dng: no exposure time in its EXIF"):
        merge_raw(without)
    half = [replace(bracket[0], exposure=Exposure(1, 2.0, 100)), bracket[1]]
    with pytest.raises(NotABracket, match=r"frame_1.dng: no f_number"):
        merge_raw(half)
    for change, words in (
        ({"camera": "Other"}, "its camera is Other"),
        ({"mosaic": bracket[1].mosaic[:100]}, "its size is 320×100"),
        ({"pattern": np.array([[2, 1], [1, 0]])}, "its filter pattern"),
    ):
        with pytest.raises(NotABracket, match=rf"frame_1\.dng: {words}"):
            merge_raw([bracket[0], replace(bracket[1], **change)])
    (tmp_path / "a.dng").write_bytes(b"II*\0")
    with pytest.raises(UnreadableFile, match=r"a\.dng"):
        merge_raw([tmp_path / "a.dng"])
    with pytest.raises(ValueError, match="calibration is of 4 photographs"):
        merge_raw(bracket[:2], calibration=known(bracket))


def test_nothing_but_black_or_white_is_no_bracket():
    dark = raws(np.zeros(SIZE))
    with pytest.raises(NotABracket, match="black in every photograph"):
        merge_raw(dark, calibration=known(dark))
    bright = raws(np.full(SIZE, 50.0))
    with pytest.raises(NotABracket, match="saturated in every photograph; add shorter"):
        merge_raw(bright, calibration=known(bright))

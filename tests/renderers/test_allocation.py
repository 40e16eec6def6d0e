"""Which pixels the next rays go to, and sums of passes that did not trace all of them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from relume.renderers.mitsuba import differential
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.progressive.accumulation import RenderSession, accumulate, pass_seed
from relume.renderers.progressive.allocation import Neediest, _expected_of, _of_others, weighed_variance
from relume.renderers.progressive.convergence import LIGHT as LIGHT_OF
from relume.renderers.progressive.convergence import Sums
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap
from solids import sphere

HEIGHT, WIDTH = 60, 72
PLATE = np.ones((HEIGHT, WIDTH, 3))
NOISY = np.zeros((HEIGHT, WIDTH), bool)
NOISY[8:24, 8:24] = True
STILL = np.zeros((HEIGHT, WIDTH), bool)
STILL[:, 52:] = True
"""Where nothing changes at all."""
FAR = np.s_[40:, :36], np.s_[:, 68:]
"""So far from the square, and from all that changes, that no estimate is shared with it."""


def trace(seed: int, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """A change whose noise is ten times as strong in a square, and none at the right."""
    rng = np.random.default_rng(seed)
    strength = np.where(NOISY, 0.5, 0.05)[..., None] * ~STILL[..., None]
    difference = strength * (rng.standard_normal(PLATE.shape) - 0.5)
    where = 1.0 if chosen is None else chosen[..., None]
    nothing = np.zeros_like(PLATE)
    return {"objects": nothing, "difference": where * difference, "matte": nothing[..., 0]}


def test_sums_of_passes_over_some_pixels_are_those_of_each_pixels_own_passes():
    planned = np.random.default_rng(1).integers(2, 5, (HEIGHT, WIDTH), dtype=np.int32)
    sums, values = Sums(), [[[] for _ in range(WIDTH)] for _ in range(HEIGHT)]
    for index in range(4):
        mask = planned > index
        planes = trace(pass_seed(5, index), mask)
        sums = sums.plus(planes, ("difference",), None if index < 2 else planned)
        for row, column in np.argwhere(mask):
            values[row][column].append(planes["difference"][row, column])
    mean = np.array([[np.mean(each, axis=0) for each in row] for row in values])
    variance = np.array([[np.var(each, axis=0, ddof=1) / len(each) for each in row] for row in values])
    assert sums.mean("difference") == pytest.approx(mean, rel=1e-12, abs=1e-15)
    assert sums.variance("difference") == pytest.approx(variance, rel=1e-9, abs=1e-15)
    again = Sums.from_planes(sums.planes(), sums.passes)
    assert again.counts is not None and np.array_equal(again.counts, planned)
    assert np.array_equal(again.mean("matte"), sums.mean("matte"))


def test_light_that_every_pass_follows_counts_everywhere():
    """Whichever pixels a pass traced: its mean is that of all passes, and so is its part of the variance."""
    rng = np.random.default_rng(2)
    planned = rng.integers(2, 7, (HEIGHT, WIDTH), dtype=np.int32)
    sums, lights, own = Sums(), [], np.zeros(PLATE.shape)
    for index in range(6):
        planes = trace(pass_seed(5, index), planned > index)
        lights.append(rng.random(PLATE.shape))
        sums = sums.plus({**planes, LIGHT_OF + "difference": lights[-1]}, ("difference",), planned)
        own = own + planes["difference"]
    expected = own / planned[..., None] + np.mean(lights, axis=0)
    assert sums.mean("difference") == pytest.approx(expected, rel=1e-12)
    of_light = np.var(lights, axis=0, ddof=1) / 6
    assert sums.variance("difference") - sums.own_variance("difference") == pytest.approx(of_light, rel=1e-6, abs=1e-12)
    again = Sums.from_planes(sums.planes(), sums.passes)
    assert np.array_equal(again.mean("difference"), sums.mean("difference"))


def test_two_passes_in_a_row_trace_the_same_pixels():
    traced = []

    def noted(seed: int, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        traced.append(chosen)
        return trace(seed, chosen)

    accumulate(noted, passes=9, plan=Neediest(PLATE, 3, 20))
    assert all(each is None for each in traced[:3])
    assert [np.array_equal(*pair) for pair in pairwise(traced[3:])] == [True, False, True, False, True]


def test_the_first_passes_trace_all_and_the_others_the_noisiest_pixels():
    pick = Neediest(PLATE, 8, 10)
    assert pick(accumulate(trace, passes=7)) is None
    planned = pick(accumulate(trace, passes=8))
    assert planned is not None and (planned[NOISY] > 8).all()
    assert (planned[FAR[0]] == 8).all() and (planned[FAR[1]] == 8).all()


def test_a_forecast_is_what_is_traced():
    """Of the same noise, where some pixels would have more passes than there are, and some need none."""
    plan = Neediest(PLATE, 4, 12, as_good_as=1000)
    even = accumulate(trace, passes=4)
    seen = weighed_variance(PLATE + even.mean("difference"), even.variance("difference"))
    traced = accumulate(trace, passes=30, plan=plan)
    assert traced.counts is not None and traced.planned is not None and traced.planned.max() > 30
    assert plan.expected(seen, 30) == pytest.approx(traced.counts.mean(), rel=1e-12)


def test_noise_of_light_that_every_pass_follows_asks_for_no_rays():
    plan, without, light = Neediest(PLATE, 8, 20), Sums(), Sums()
    noise = np.random.default_rng(3).standard_normal(PLATE.shape)
    for index in range(8):
        planes = trace(pass_seed(5, index))
        without = without.plus({**planes, LIGHT_OF + "difference": 0 * noise})
        light = light.plus({**planes, LIGHT_OF + "difference": noise * (-1) ** index})
    planned, expected = plan(light), plan(without)
    assert planned is not None and expected is not None and np.array_equal(planned, expected)


def test_passes_end_up_spread_as_the_standard_deviations_within_the_budget():
    sums = accumulate(trace, passes=400, plan=Neediest(PLATE, 8, 40))
    assert sums.counts is not None and sums.passes < 400
    inside, outside = sums.counts[12:20, 12:20].mean(), sums.counts[FAR[0]].mean()
    # In proportion it would be ten to one, but for what the estimates of few passes err.
    assert inside / outside == pytest.approx(10, rel=0.25)
    assert (sums.counts[FAR[1]] == 8).all()
    assert 39 < sums.counts.mean() <= 40.5


def test_so_many_passes_are_traced_as_are_as_good_as_even_ones():
    """Spread as the standard deviations (Σσ)² / (N Σσ²) of the passes are enough; the error is what was asked for."""
    errors, means = [], []
    for seed in range(6):
        sums = accumulate(trace, passes=1000, seed=seed, plan=Neediest(PLATE, 8, 1000, as_good_as=60))
        assert sums.counts is not None and sums.passes < 1000
        truth = -0.5 * np.where(NOISY, 0.5, 0.05)[..., None] * ~STILL[..., None]
        errors.append(weighed_variance(PLATE + truth, np.square(sums.mean("difference") - truth)).mean())
        means.append(sums.counts.mean())
    of_one = weighed_variance(PLATE + truth, np.square(2 * truth) * PLATE)
    # Pixels about the square are given as many as it, and make the rest a little better than asked.
    assert 0.75 < np.mean(errors) / (of_one.mean() / 60) < 1.05
    deviation = np.sqrt(of_one)
    share = deviation.sum() ** 2 / deviation.size / of_one.sum()
    assert 60 * share < np.mean(means) < 1.9 * 60 * share < 30


def test_no_more_than_the_budget_is_traced_where_that_is_not_enough():
    sums = accumulate(trace, passes=1000, plan=Neediest(PLATE, 4, 12, as_good_as=1000))
    assert sums.counts is not None and 11.5 < sums.counts.mean() <= 12.5
    assert sums.counts[12:20, 12:20].min() > 60


def test_where_nothing_changes_the_first_passes_are_all():
    def nothing(seed: int, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        return {"objects": 0 * PLATE, "difference": 0 * PLATE, "matte": 0 * PLATE[..., 0]}

    for enough in (None, 20.0):
        assert accumulate(nothing, passes=30, plan=Neediest(PLATE, 3, 10, enough)).passes == 3


@pytest.mark.parametrize("where", ["plate", "passes"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_pixel_that_is_not_finite_leaves_the_others_their_passes(where, value):
    """In the mean radiance it ended the render after the first passes, and said nothing."""
    plate = PLATE.copy()

    def spoilt(seed: int, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        planes = trace(seed, chosen)
        planes["difference"][2, 28] = value if where == "passes" else 0
        return planes

    if where == "plate":
        plate[2, 28] = value
    with np.errstate(invalid="ignore"):
        sums = accumulate(spoilt, passes=400, plan=Neediest(plate, 8, 40))
    expected = accumulate(trace, passes=400, plan=Neediest(PLATE, 8, 40))
    assert sums.counts is not None and expected.counts is not None
    assert sums.counts.mean() == pytest.approx(expected.counts.mean(), rel=0.02)
    assert sums.counts[NOISY].mean() == pytest.approx(expected.counts[NOISY].mean(), rel=0.02)


def test_a_mirror_in_the_light_of_its_neighbour_counts_by_what_the_eye_sees():
    """The same noise on a bright plate is a smaller share of it, and is looked at later."""
    bright = np.where(np.arange(WIDTH)[None, :, None] < WIDTH // 2, 20.0, 1.0) * PLATE

    def even(seed: int, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        rng = np.random.default_rng(seed)
        nothing = np.zeros_like(PLATE)
        return {"objects": nothing, "difference": rng.standard_normal(PLATE.shape), "matte": nothing[..., 0]}

    planned = Neediest(bright, 8, 10)(accumulate(even, passes=8))
    assert planned is not None and (planned[:, 40:] > 8).all() and (planned[:, :16] == 8).all()


def test_a_pixel_has_no_say_in_how_often_it_is_traced():
    """Of rare bright paths one that met none has too low a mean and a variance; left for that, it would stay too dark.

    With its own variance in the choice the mean of skewed noise was 0.5 % too low.
    """
    plan = Neediest(PLATE, 8, 20)
    sums = accumulate(trace, passes=8)
    planned = plan(sums)
    assert planned is not None
    for row, column in np.argwhere((planned == 8) & ~STILL)[::20]:
        squares = {name: plane.copy() for name, plane in sums.squares.items()}
        squares["difference"][row, column] *= 1000
        again = plan(replace(sums, squares=squares))
        assert again is not None and again[row, column] == 8
        assert (again[max(row - 3, 0) : row + 4, max(column - 3, 0) : column + 4] > 8).sum() > 10


@pytest.mark.parametrize("shape", [(60, 72), (20, 25), (5, 4)])
def test_a_pixels_light_says_nothing_of_what_is_expected_of_its_own_variance(shape):
    """Not by way of what its neighbours are believed either: bright ones came out up to 1.6 % too bright."""
    rng = np.random.default_rng(4)
    variance = np.where(rng.random(shape) < 0.02, 100.0, rng.gamma(0.5, 0.2, shape))
    expected = _expected_of(variance)
    for row, column in rng.integers(0, shape, (30, 2)):
        met = variance.copy()
        met[row, column] = 10_000
        assert _expected_of(met)[row, column] == pytest.approx(expected[row, column], rel=1e-9)
        assert not np.array_equal(_expected_of(met), expected)


def test_light_that_is_met_seldom_is_as_bright_as_by_even_rays_and_hardly_noisier():
    """One value in 250 holds all of it. Chosen anew after each pass it came out a third too dark, for pixels whose
    neighbours met none early were left; by squares of seven pixels alone its errors were three times as large."""
    big, rare = np.zeros((48, 64, 3)), 1 / 250

    def seldom(seed: int, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        rng = np.random.default_rng(seed)
        met = (rng.random(big.shape[:2]) < rare)[..., None] * np.full(3, 1 / rare)
        where = 1.0 if chosen is None else chosen[..., None]
        return {"objects": where * met, "difference": 0 * big, "matte": big[..., 0]}

    means, squares, counts = [], [], []
    for seed in range(60):
        sums = accumulate(seldom, passes=20, seed=seed, plan=Neediest(big + 1, 2, 8, as_good_as=24))
        means.append(sums.mean("objects").mean())
        squares.append(np.square(sums.mean("objects") - 1).mean())
        counts.append(sums.counts)
    error = np.std(means) / np.sqrt(len(means))
    assert error < 0.02 and np.mean(means) == pytest.approx(1, abs=4 * error)
    assert np.mean(squares) < 1.5 / rare / np.mean(counts)


LIGHT = EnvironmentMap(np.random.default_rng(1).random((8, 16, 3)).astype(np.float32) ** 4)
BALL = sphere(Material((0.9, 0.9, 0.9), metallic=1.0, roughness=0.0), centre=(0.0, 1.0, 0.0), fine=2)
SCENE = Scene(LIGHT, (Plane(Diffuse((0.6, 0.5, 0.4))),), (BALL,))
CAMERA = Camera.looking_at(np.array([0, 2.0, 6]), np.array([0, 0.5, 0]), width=24, height=20, focal_length=26)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """So small a picture has its rays spread too."""
    monkeypatch.setattr(differential, "SPREAD_RAYS", 400)


def test_spread_rays_have_the_mean_of_even_ones(few, monkeypatch):
    spread = [Differential(samples=128).change(SCENE, CAMERA, seed=seed) for seed in range(3)]
    monkeypatch.undo()
    even = [Differential(samples=128).change(SCENE, CAMERA, seed=seed) for seed in range(10, 13)]
    assert all(change.passes > 16 for change in spread) and all(change.passes == 8 for change in even)
    for plane in ("objects", "difference"):
        sums = [np.array([getattr(c, plane).sum(dtype=np.float64) for c in each]) for each in (spread, even)]
        errors = [np.sqrt(np.mean([getattr(c, f"{plane}_variance").sum(dtype=np.float64) for c in each]) / 3)
                  for each in (spread, even)]  # fmt: skip
        assert abs(sums[0].mean() - sums[1].mean()) < 4 * np.hypot(*errors), plane
    # That is what they are for: half of the rays at least go where they are needed.
    noise = [np.mean([np.sqrt(c.objects_variance + c.difference_variance).mean() for c in each])
             for each in (spread, even)]  # fmt: skip
    assert noise[0] < noise[1]


def test_spread_rays_are_the_same_on_any_threads_and_after_an_interruption(few, tmp_path):
    class Stopped(Exception):
        pass

    def cancel(share: float) -> None:
        if share >= 0.7:
            raise Stopped

    render = Differential(samples=128, threads=1)
    straight = render.change(SCENE, CAMERA, seed=3)
    assert straight.passes > 16
    watch = RenderSession(tmp_path / "render.passes")
    with pytest.raises(Stopped):
        Differential(samples=128, threads=2).change(SCENE, CAMERA, seed=3, watch=watch, progress=cancel)
    assert watch.checkpoint is not None and watch.checkpoint.exists()
    resumed = Differential(samples=128, threads=3).change(SCENE, CAMERA, seed=3, watch=watch)
    for plane in ("objects", "difference", "matte", "objects_variance", "difference_variance"):
        assert np.array_equal(getattr(straight, plane), getattr(resumed, plane)), plane


def test_a_quarter_of_many_samples_is_even_and_all_of_few_or_of_a_small_picture():
    def spread(full: int, samples: int, width: int, height: int) -> tuple[int, int]:
        return differential._spread_of(full, samples, CAMERA.resized(width, height))

    assert spread(8, 8, 768, 512) == (2, 20)
    assert spread(32, 10, 768, 512) == (4, 80)
    # Two rays a pass: eight of them, for two passes would have four.
    assert spread(10, 2, 1024, 1024) == (4, 25)
    assert spread(8, 8, 256, 171) == (8, 8) and spread(7, 9, 768, 512) == (7, 7)


def test_a_picture_of_little_noise_has_fewer_rays_and_one_with_a_noise_asked_for_has_all(few):
    """The ball is a tenth of the picture; with `noise` the samples may all be needed."""
    far = Camera.looking_at(np.array([0, 2.0, 12]), np.array([0, 0.5, 0]), width=96, height=80, focal_length=60)
    change = Differential(samples=128).change(SCENE, far, seed=2)
    assert 32 <= change.samples < 100
    with pytest.warns(UserWarning, match="was not reached"):
        whole = Differential(samples=128, noise=1e-6).change(SCENE, far, seed=2)
    assert change.samples < whole.samples <= 130
    assert whole.objects_variance.mean() < change.objects_variance.mean()


def test_a_render_of_another_plate_is_not_gone_on_with():
    """The plate says which pixels are the neediest, so the pixels depend on it."""
    one, other = (
        Differential(samples=128)._key(SCENE, CAMERA, 3, plate, None, np.zeros(1))
        for plate in (np.ones((20, 24, 3)), np.full((20, 24, 3), 2.0))
    )
    assert {name for name in one if one[name] != other[name]} == {"plate"}


def test_a_pixel_has_the_same_numbers_whichever_others_are_traced_with_it(mi, monkeypatch):
    from relume.renderers.mitsuba.transport import estimator, passes

    chosen = np.random.default_rng(2).random((CAMERA.height, CAMERA.width)) < 0.3
    made = estimator.Estimator(SCENE, CAMERA, 4)
    all_of_them, some = made.traced(4, 9), made.traced(4, 9, chosen)
    monkeypatch.setattr(passes, "BAND", 400)
    in_batches = made.traced(4, 9)
    for name, plane in all_of_them.items():
        where = chosen if plane.ndim == 2 else chosen[..., None]
        assert np.array_equal(some[name], plane * where), name
        assert np.array_equal(in_batches[name], plane), name


def test_passes_that_are_traced_at_once_have_the_bits_of_each_alone(mi):
    from relume.renderers.mitsuba.transport.estimator import Estimator

    made = Estimator(SCENE, CAMERA, 4)
    seeds = [9, 4_000_000_000, 77]
    for seed, planes in zip(seeds, made.traced_together(4, seeds), strict=True):
        alone = made.traced(4, seed)
        assert alone.keys() == planes.keys()
        assert all(np.array_equal(alone[name], planes[name]) for name in alone)


GLASS = sphere(Material((1.0, 1.0, 1.0), transmission=1.0, roughness=0.0), centre=(0.0, 0.6, 0.0), fine=2)


def test_light_kept_apart_is_that_of_the_whole_picture_whichever_pixels_are_traced(mi):
    from relume.renderers.mitsuba.transport.estimator import Estimator

    lamp = np.zeros((8, 16, 3), np.float32)
    lamp[1, 3] = 100
    made = Estimator(replace(SCENE, light=EnvironmentMap(lamp), objects=(GLASS,)), CAMERA, 4)
    chosen = np.zeros((CAMERA.height, CAMERA.width), bool)
    chosen[:10] = True
    some, joined = made.traced(16, 9, chosen, apart=True), made.traced(16, 9)
    light = some[LIGHT_OF + "difference"]
    assert light[10:].sum() > 0 and not some["difference"][10:].any()
    # Half as many rays of light, and the same light.
    own = made.traced(16, 9, apart=True)["difference"]
    many = [made.lit(4096, seed, apart)["difference"].sum((0, 1)) for seed, apart in ((1, True), (2, False))]
    np.testing.assert_allclose(*many, rtol=0.05)
    assert np.abs(own - joined["difference"]).max() > 0


def test_spread_rays_that_light_is_kept_apart_of_have_the_mean_of_even_ones(few, monkeypatch):
    lamp = np.zeros((8, 16, 3), np.float32)
    lamp[1, 3] = 100
    scene = replace(SCENE, light=EnvironmentMap(lamp + 0.2), objects=(GLASS,))
    spread = [Differential(samples=128).change(scene, CAMERA, seed=seed) for seed in range(4)]
    monkeypatch.undo()
    even = [Differential(samples=128).change(scene, CAMERA, seed=seed) for seed in range(10, 14)]
    for plane in ("objects", "difference"):
        sums = [np.array([getattr(c, plane).sum(dtype=np.float64) for c in each]) for each in (spread, even)]
        errors = [np.sqrt(np.mean([getattr(c, f"{plane}_variance").sum(dtype=np.float64) for c in each]) / 4)
                  for each in (spread, even)]  # fmt: skip
        assert abs(sums[0].mean() - sums[1].mean()) < 4 * np.hypot(*errors), plane


@pytest.mark.parametrize("size", [(30, 41), (1, 1), (5, 2)])
@pytest.mark.parametrize("but", [1, 3])
def test_others_are_those_of_a_pixels_square_as_far_as_the_picture_goes(size, but):
    values = np.random.default_rng(7).random(size)
    rows, columns = np.indices(size)
    means = _of_others(values, 7, but)
    for row, column in np.ndindex(size):
        away = np.maximum(abs(rows - row), abs(columns - column))
        others = values[(away <= 3) & (away > but // 2)]
        assert means[row, column] == pytest.approx(others.mean() if others.size else 0, rel=1e-9, abs=1e-12)


def test_the_weighed_variance_is_that_of_all_channels():
    random = np.random.default_rng(7)
    picture, variance = random.normal(size=(20, 30, 3)), random.random((20, 30, 3))
    radiance = np.maximum(picture, 0).sum(-1)
    expected = variance.sum(-1) / (radiance + radiance.mean()) ** 2
    assert np.array_equal(weighed_variance(picture, variance), expected)

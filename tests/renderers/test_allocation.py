"""Which pixels the next rays go to, and sums of passes that did not trace all of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from relume.renderers.mitsuba import differential
from relume.renderers.mitsuba.differential import Differential
from relume.renderers.progressive.accumulation import RenderSession, accumulate, pass_seed
from relume.renderers.progressive.allocation import Neediest
from relume.renderers.progressive.convergence import Sums
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap
from solids import sphere

HEIGHT, WIDTH = 24, 32
PLATE = np.ones((HEIGHT, WIDTH, 3))
NOISY = np.zeros((HEIGHT, WIDTH), bool)
NOISY[8:16, 8:16] = True
STILL = np.zeros((HEIGHT, WIDTH), bool)
STILL[:, 26:] = True
"""Where nothing changes at all."""


def trace(seed: int, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """A change whose noise is ten times as strong in a square, and none at the right."""
    rng = np.random.default_rng(seed)
    strength = np.where(NOISY, 0.5, 0.05)[..., None] * ~STILL[..., None]
    difference = strength * (rng.standard_normal(PLATE.shape) - 0.5)
    where = 1.0 if chosen is None else chosen[..., None]
    nothing = np.zeros_like(PLATE)
    return {"objects": nothing, "difference": where * difference, "matte": nothing[..., 0]}


def test_sums_of_passes_over_some_pixels_are_those_of_each_pixels_own_passes():
    rng = np.random.default_rng(1)
    masks = [None, None, rng.random((HEIGHT, WIDTH)) < 0.5, rng.random((HEIGHT, WIDTH)) < 0.3]
    sums, values = Sums(), [[[] for _ in range(WIDTH)] for _ in range(HEIGHT)]
    for index, mask in enumerate(masks):
        planes = trace(pass_seed(5, index), mask)
        sums = sums.plus(planes, ("difference",), mask)
        for row, column in np.argwhere(np.ones((HEIGHT, WIDTH), bool) if mask is None else mask):
            values[row][column].append(planes["difference"][row, column])
    mean = np.array([[np.mean(each, axis=0) for each in row] for row in values])
    variance = np.array([[np.var(each, axis=0, ddof=1) / len(each) for each in row] for row in values])
    assert sums.mean("difference") == pytest.approx(mean, rel=1e-12, abs=1e-15)
    assert sums.variance("difference") == pytest.approx(variance, rel=1e-9, abs=1e-15)
    again = Sums.from_planes(sums.planes(), sums.passes)
    assert again.counts is not None
    assert np.array_equal(again.counts, [[len(each) for each in row] for row in values])
    assert np.array_equal(again.mean("matte"), sums.mean("matte"))


def test_the_first_passes_trace_all_and_the_others_the_noisiest_pixels():
    pick = Neediest(PLATE, 8, 0.25)
    assert pick(accumulate(trace, passes=7)) is None
    sums = accumulate(trace, passes=8)
    chosen = pick(sums)
    # Estimates are shared over seven pixels, so those around the square are taken with it.
    assert chosen is not None and chosen[NOISY].all() and not chosen[STILL].any()
    assert chosen.mean() == pytest.approx(0.25, abs=0.02)


def test_passes_end_up_spread_as_the_standard_deviations():
    sums = accumulate(trace, passes=200, choose=Neediest(PLATE, 8, 0.25))
    assert sums.counts is not None
    inside, outside = sums.counts[10:14, 10:14].mean(), sums.counts[:4, :20].mean()
    # In proportion it would be ten to one, but for the eight that all have, and no pixel is in more than each pass.
    assert inside > 0.9 * 200 and 8 <= outside < 60
    assert (sums.counts[:, 30:] == 8).all()


def test_a_mirror_in_the_light_of_its_neighbour_counts_by_what_the_eye_sees():
    """The same noise on a bright plate is a smaller share of it, and is looked at later."""
    bright = np.where(np.arange(WIDTH)[None, :, None] < WIDTH // 2, 20.0, 1.0) * PLATE

    def even(seed: int, chosen: np.ndarray | None = None) -> dict[str, np.ndarray]:
        rng = np.random.default_rng(seed)
        nothing = np.zeros_like(PLATE)
        return {"objects": nothing, "difference": rng.standard_normal(PLATE.shape), "matte": nothing[..., 0]}

    chosen = Neediest(bright, 8, 0.4)(accumulate(even, passes=8))
    assert chosen is not None and chosen[:, 20:].mean() > 0.7 and chosen[:, :12].mean() == 0


def test_a_pixel_has_no_say_in_how_often_it_is_traced():
    """Of rare bright paths one that met none has too low a mean and a variance; left for that, it would stay too dark.

    With its own variance in the choice the mean of skewed noise was 0.5 % too low.
    """
    pick, sums = Neediest(PLATE, 8, 0.25), accumulate(trace, passes=40, choose=Neediest(PLATE, 8, 0.25))
    chosen = pick(sums)
    assert chosen is not None
    for row, column in np.argwhere(~chosen & ~STILL)[::20]:
        squares = {name: plane.copy() for name, plane in sums.squares.items()}
        squares["difference"][row, column] *= 1000
        again = pick(replace(sums, squares=squares))
        assert again is not None and not again[row, column] and again.sum() > 0
        assert again[max(row - 3, 0) : row + 4, max(column - 3, 0) : column + 4].sum() > 10


LIGHT = EnvironmentMap(np.random.default_rng(1).random((8, 16, 3)).astype(np.float32) ** 4)
BALL = sphere(Material((0.9, 0.9, 0.9), metallic=1.0, roughness=0.0), centre=(0.0, 1.0, 0.0), fine=2)
SCENE = Scene(LIGHT, (Plane(Diffuse((0.6, 0.5, 0.4))),), (BALL,))
CAMERA = Camera.looking_at(np.array([0, 2.0, 6]), np.array([0, 0.5, 0]), width=24, height=20, focal_length=26)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """So small a picture has its rays spread too."""
    monkeypatch.setattr(differential, "CHOSEN_RAYS", 400)


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

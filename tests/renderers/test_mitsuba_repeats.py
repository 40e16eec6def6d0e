"""Same seed, same pixels; what is reported as noise is the noise; what objects do not touch stays to the bit."""

import numpy as np
import pytest

from montecarlo import assert_renders_agree
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.renderer import render
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Scene
from relume.scene.shapes.shapes import Plane
from relume.sphere.environment_map import EnvironmentMap
from solids import sphere

LIGHT = EnvironmentMap(np.random.default_rng(1).random((8, 16, 3)).astype(np.float32) ** 4)
FLOOR = Plane(Diffuse((0.6, 0.5, 0.4)))
BALL = sphere(Material((0.9, 0.3, 0.1), roughness=0.3), centre=(0.0, 1.0, 0.0), fine=2)
CAMERA = Camera.looking_at(np.array([0, 2.0, 6]), np.array([0, 0.5, 0]), width=24, height=20, focal_length=26)
SCENE = Scene(LIGHT, local=(FLOOR,), objects=(BALL,))
PLANES = ("radiance", "variance", "matte", "depth", "normal", "albedo")


def same(one, other):
    return [plane for plane in PLANES if not np.array_equal(getattr(one, plane), getattr(other, plane))]


def test_the_same_seed_gives_the_same_pixels():
    one, other = (render(SCENE, CAMERA, Mitsuba(samples=40), seed=11) for _ in range(2))
    assert same(one, other) == []


def test_another_seed_gives_other_pixels_of_the_same_picture():
    one, other = (render(SCENE, CAMERA, Mitsuba(samples=64), seed=seed) for seed in (1, 2))
    assert not np.array_equal(one.radiance, other.radiance)
    assert_renders_agree(one, other)


@pytest.mark.parametrize("samples", [40, pytest.param(250, marks=pytest.mark.slow)])
def test_the_number_of_threads_changes_no_pixel(samples):
    renders = [render(SCENE, CAMERA, Mitsuba(samples=samples, threads=n), seed=4) for n in (1, 2, 5)]
    assert [same(renders[0], other) for other in renders[1:]] == [[], []]


def test_the_number_of_threads_is_as_before_afterwards():
    render(SCENE, CAMERA, Mitsuba(samples=2))
    import drjit

    before = drjit.thread_count()
    render(SCENE, CAMERA, Mitsuba(samples=2, threads=before + 2))
    assert drjit.thread_count() == before


def test_pixels_far_from_the_objects_are_equal_to_the_bit_with_and_without_them():
    # A ball of 16 cm lies 6 m from a camera that sees floor and sky: few paths ever meet it.
    pebble = sphere(Material((0.9, 0.3, 0.1)), centre=(0.0, 0.08, 0.0), radius=0.08, fine=2)
    with_, without = (render(s, CAMERA, Mitsuba(samples=32), seed=2) for s in (SCENE, SCENE.without_objects()))
    sky = with_.depth == 0
    assert sky.any()
    assert np.array_equal(with_.radiance[sky], without.radiance[sky])
    small = render(Scene(LIGHT, (FLOOR,), (pebble,)), CAMERA, Mitsuba(samples=32), seed=2)
    unchanged = np.all(small.radiance == without.radiance, axis=-1)
    assert np.mean(unchanged) > 0.9
    assert small.matte.any()


def test_adding_no_object_changes_no_bit():
    one, other = (
        render(s, CAMERA, Mitsuba(samples=32), seed=2) for s in (SCENE.without_objects(), Scene(LIGHT, (FLOOR,)))
    )
    assert same(one, other) == []


@pytest.mark.parametrize("samples", [16, pytest.param(96, marks=pytest.mark.slow)])
def test_the_variance_reported_is_the_scatter_of_independent_renders(samples):
    # A render costs its start more than its rays: few large pictures hold as many squares as many small ones.
    renders = [render(SCENE, CAMERA, Mitsuba(samples=samples), seed=seed) for seed in range(8)]
    reported = np.mean([r.variance.astype(np.float64) for r in renders], axis=0)
    scatter = np.var([r.radiance.astype(np.float64) for r in renders], axis=0, ddof=1)
    # Seven degrees of freedom in each of 480 pixels: 2/√(7·480) = 3.5 %, twice that for tails and correlated channels.
    assert reported.mean() == pytest.approx(scatter.mean(), rel=0.15)


def test_the_variance_of_a_lone_render_is_steady_enough_to_test_pixels_with():
    # Two passes would leave it one degree of freedom, and every tenth pixel a hundredth of its variance.
    picture = render(SCENE.without_objects(), CAMERA, Mitsuba(samples=128), seed=6)
    floor = picture.depth > 0
    variance = picture.variance[floor][:, 1]
    assert np.quantile(variance, 0.1) > 0.1 * np.median(variance)


def test_four_times_the_samples_leave_at_most_a_quarter_of_the_variance():
    few, many = (render(SCENE, CAMERA, Mitsuba(samples=n), seed=8).variance.mean() for n in (64, 256))
    assert many < 0.3 * few  # a quarter, and a fifth on top for the noise of the estimates; strata do better


@pytest.mark.parametrize("samples", [2, 3, 5, 17, 40, 100])
def test_no_more_rays_are_traced_than_asked_for(samples):
    traced = render(SCENE, CAMERA, Mitsuba(samples=samples)).samples
    assert 0.5 * samples <= traced <= samples


def test_a_noise_target_stops_early_and_is_met():
    target = 0.05
    picture = render(SCENE, CAMERA, Mitsuba(samples=4096, noise=target), seed=1)
    assert picture.samples < 4096
    truth = render(SCENE, CAMERA, Mitsuba(samples=512), seed=2).radiance
    error = np.abs(picture.radiance - truth).mean() / truth.mean()
    assert error < 1.1 * target  # |error| is 0.8 standard errors on average, and the truth has noise of its own


def test_a_noise_target_that_cannot_be_met_traces_all_samples():
    full, aimed = (render(SCENE, CAMERA, Mitsuba(samples=64, noise=n), seed=1) for n in (None, 1e-6))
    assert full.samples == aimed.samples
    assert np.array_equal(full.radiance, aimed.radiance)


def test_progress_rises_to_one():
    said = []
    render(SCENE, CAMERA, Mitsuba(samples=64), progress=said.append)
    assert said == sorted(said)
    assert said[0] > 0
    assert said[-1] == 1.0


def test_the_scalar_variant_makes_the_same_picture():
    small = Camera(12, 10, 13.0, CAMERA.position, CAMERA.rotation)
    fast = render(SCENE, small, Mitsuba(samples=128), seed=1)
    slow = render(SCENE, small, Mitsuba(samples=64, variant="scalar_rgb"), seed=2)
    assert_renders_agree(fast, slow)
    np.testing.assert_allclose(slow.matte, fast.matte, atol=0.3)  # 4.5 standard errors of two coverages from 64 rays
    np.testing.assert_allclose(slow.matte.sum(), fast.matte.sum(), rtol=0.05)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        ({"samples": 1}, "samples 1"),
        ({"depth": 0}, "depth 0"),
        ({"noise": 0.0}, "noise 0.0"),
        ({"threads": 0}, "threads is 0"),
    ],
)
def test_settings_that_cannot_be_are_refused_with_what_was_expected(settings, named):
    with pytest.raises(ValueError, match=f"{named}.*expected at least"):
        Mitsuba(**settings)

"""What a few lights on one side do not show: a fit of each pixel, and no seam where it takes over."""

from __future__ import annotations

import warnings
import weakref
from pathlib import Path

import numpy as np
import pytest

from relume.image.files import read_photograph
from relume.lightstage.acquire.ball_highlights import MirrorBall, outline_of_mask, read_ball
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting import diffuse_fit
from relume.lightstage.relighting.diffuse_fit import DiffuseFit, fit_diffuse, fitted, needs_fit, strengths_of
from relume.lightstage.relighting.interpolation import NearestLight, Remainder, lights_width
from relume.lightstage.relighting.relight import (
    RelightSettings,
    SubjectMesh,
    relight,
    relight_per_pixel,
    relight_sequence,
)
from relume.lightstage.relighting.stage_lighting import StageLighting
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.scene.lights import DistantLight
from relume.scene.materials.materials import Diffuse
from relume.sphere.directions import normalised
from relume.sphere.environment_map import EnvironmentMap
from small_stages import ALBEDO, camera, lit, normals
from solids import sphere

OLAT = Path(__file__).resolve().parents[4] / "shared" / "data" / "olat" / "uw_psm"
EVEN = even_directions(60)
DOME = StageLights.towards(EVEN[EVEN[:, 2] > 0.45])
BALL = Pictures(np.stack([lit(direction) for direction in DOME.directions]), DOME)
BETWEEN = even_directions(301)
LOW = normalised([0.9, 0.1, 0.05])
"""From beside the camera's subject, 25 degrees beyond the dome's lights."""
EVENLY = np.array([[1.0], [0.0], [0.0]]) * np.ones(3)
pytestmark = pytest.mark.filterwarnings("ignore:.*(where the stage has no lights|below 0):UserWarning")


def lamp(towards: np.ndarray, strength: float = 1.0) -> StageLighting:
    x, y, z = towards.tolist()
    return StageLighting(lamps=(DistantLight((x, y, z), (strength, strength, strength)),))


def error(picture: np.ndarray, truth: np.ndarray) -> float:
    return float(np.abs(picture - truth).sum() / truth.sum())


@pytest.mark.parametrize(("directions", "constant"), [(EVEN, 0.05), (DOME.directions, 0.0)])
def test_a_lambertian_pixel_is_found_though_some_lights_are_shadowed_or_mirrored(directions, constant) -> None:
    facing = normalised(np.random.default_rng(1).normal(size=(50, 3)) + np.array([0, 0, 2]))
    values = 0.4 * np.maximum(directions @ facing.T, 0) + constant
    values[2::15], values[5] = 0.0, 3.0
    lobes, constants, colours = fitted(values[..., None] * np.array([1.5, 0.9, 0.6]), directions)
    plain = np.linalg.lstsq(directions, values, rcond=None)[0].T
    off, plainly_off = (np.median(np.linalg.norm(each - 0.4 * facing, axis=1)) for each in (lobes, plain))
    assert off < 0.01 < 0.1 < plainly_off
    np.testing.assert_allclose(np.median(constants), constant, atol=0.005)
    np.testing.assert_allclose(colours, np.broadcast_to([1.5, 0.9, 0.6], (50, 3)), rtol=1e-5)


def test_where_one_light_more_is_seen_the_constant_hardly_changes() -> None:
    # Pixels from one that faces all of the dome to one that does not see a light of it.
    turns = np.linspace(0, 1.0, 200)
    facing = np.stack([np.sin(turns), np.zeros_like(turns), np.cos(turns)], axis=-1)
    values = 0.4 * np.maximum(DOME.directions @ facing.T, 0) + 0.05
    constants = fitted(np.repeat(values[..., None], 3, axis=-1), DOME.directions)[1]
    assert constants[0] == 0 and np.abs(np.diff(constants)).max() < 0.02


def test_a_pixel_that_shows_every_light_alike_is_a_constant() -> None:
    lobes, constants, _ = fitted(np.full((len(EVEN), 1, 3), 0.3), EVEN)
    np.testing.assert_allclose(constants, 0.3, rtol=1e-4)
    assert np.linalg.norm(lobes) < 1e-3


def test_the_fit_under_light_from_everywhere_is_pi_times_the_lobe_and_four_pi_times_the_constant() -> None:
    fit = DiffuseFit(
        np.array([[[0.0, 0.2, 0.0]]], np.float32), np.array([[0.1]], np.float32), np.ones((1, 1, 3), np.float32),
        EVENLY * np.ones((2, 1, 1)),
    )  # fmt: skip
    everywhere = StageLighting((EnvironmentMap(np.ones((64, 128, 3), np.float32)),))
    light = everywhere.directed(2000)
    np.testing.assert_allclose(fit.lit(light.directions, light.irradiances), np.pi * 0.2 + 4 * np.pi * 0.1, rtol=2e-3)
    np.testing.assert_allclose(fit.lit(np.array([[0, 0.6, 0.8]]), np.array([[1.0, 2, 3]])), [[[0.22, 0.44, 0.66]]])


def test_a_light_of_a_dome_gives_its_own_picture() -> None:
    for light in (0, 7):
        found = relight(BALL, lamp(DOME.directions[light], 2.0)).radiance
        np.testing.assert_allclose(found, 2 * BALL.values[light], atol=1e-5)


def test_how_strongly_each_light_shone_is_found_and_its_neighbours_believe_less_of_it(monkeypatch) -> None:
    strengths = 1 + 0.12 * np.random.default_rng(3).uniform(-1, 1, (len(DOME), 3))
    uneven = Pictures((BALL.values * strengths[:, None, None]).astype(np.float32), DOME)
    # Strengths that go from one side of the dome to the other are shading to the fit, and stay in it.
    found = fit_diffuse(uneven, 1 << 30).strengths
    assert np.std(found[:, 0] - strengths) < 0.03 < 0.06 < np.std(strengths)
    # They bend the fit a little: less than half of what they differ by looks like a slope.
    assert np.abs(found[:, 1:]).max() < 0.06
    np.testing.assert_allclose(relight(uneven, lamp(DOME.directions[7])).radiance, uneven.values[7], atol=1e-5)

    def errors() -> np.ndarray:
        gaps = [normalised(DOME.directions[i] + DOME.directions[j]) for i, j in ((0, 1), (3, 4), (7, 8))]
        return np.array([error(relight(uneven, lamp(gap)).radiance, strengths.mean() * lit(gap)) for gap in gaps])

    found = errors()
    monkeypatch.setattr(diffuse_fit, "strengths_of", lambda values, *_: EVENLY * np.ones((len(values), 1, 1)))
    assert (found < 0.92 * errors()).all()


def test_a_lamp_that_lights_one_side_more_is_known_and_its_neighbours_stay_even(monkeypatch) -> None:
    height, width = BALL.shape
    right = ((np.arange(width) + 0.5) / width * 2 - 1) * (width / max(height, width))
    uneven = BALL.values.copy()
    # The eighth lamp is aimed to the right: ± 30 % over half the picture.
    uneven[7] *= (1 + 0.3 * right)[None, :, None].astype(np.float32)
    field = Pictures(uneven, DOME)
    slopes = fit_diffuse(field, 1 << 30).strengths[:, 1:]
    # Of 0.3 a share of about 3 in 4 is believed to be the lamp's own (`_OWN`).
    np.testing.assert_allclose(slopes[7, 0], 0.75 * 0.3, atol=0.03)
    assert np.abs(np.delete(slopes, 7, axis=0)).max() < 0.05 and np.abs(slopes[7, 1]).max() < 0.05
    np.testing.assert_allclose(relight(field, lamp(DOME.directions[7])).radiance, uneven[7], atol=1e-5)

    gap, original = normalised(DOME.directions[7] + DOME.directions[8]), strengths_of
    found = error(relight(field, lamp(gap)).radiance, lit(gap))

    def level(*given: np.ndarray) -> np.ndarray:
        return original(*given) * np.array([1.0, 0.0, 0.0])[None, :, None]

    monkeypatch.setattr(diffuse_fit, "strengths_of", level)
    assert found < 0.7 * error(relight(field, lamp(gap)).radiance, lit(gap))


def test_a_light_whose_pixels_do_not_agree_has_no_strength() -> None:
    facing = normalised(np.random.default_rng(1).normal(size=(400, 3)) + np.array([0, 0, 2]))
    values = np.repeat(0.4 * np.maximum(DOME.directions @ facing.T, 0)[..., None], 3, axis=-1)
    # Half of what the fit says is lit lies in a shadow under the sixth light.
    values[5, ::2] = 0
    fit = fitted(values, DOME.directions)
    right = np.random.default_rng(2).uniform(-1, 1, 400)
    found = strengths_of(values, DOME.directions, *fit, np.stack([np.ones(400), right, right[::-1]], axis=-1))
    np.testing.assert_allclose(found - EVENLY, 0, atol=0.15)
    np.testing.assert_allclose(np.delete(found, 5, axis=0) - EVENLY, 0, atol=0.02)


def test_beyond_the_lights_a_matte_ball_is_shaded_as_it_is() -> None:
    found, truth = relight(BALL, lamp(LOW)).radiance, lit(LOW)
    nearest = relight(BALL, lamp(LOW), settings=RelightSettings(nearest=True)).radiance
    assert error(found, truth) < 0.03 < 0.4 < error(nearest, truth)


def test_a_light_that_moves_across_the_rim_of_the_lights_leaves_no_seam() -> None:
    turns = np.radians(np.arange(0.0, 130.0, 0.5))
    path = np.stack([np.sin(turns), np.zeros_like(turns), np.cos(turns)], axis=-1)
    frames = relight_sequence(BALL, [lamp(towards) for towards in path])
    means = np.array([frame.radiance.mean() for frame in frames])
    steps = np.abs(np.diff(means))
    # A ball that is lit from ever farther round darkens by less than its brightness times the step of 0.0087.
    assert steps.max() < 0.012 * means.max()
    assert np.abs(np.diff(means, 2)).max() < 0.002 * means.max()


def test_pictures_add_as_lights_do() -> None:
    one, other = lamp(LOW, 0.7), lamp(normalised([0.2, 0.4, 1.0]), 1.9)
    both = StageLighting(lamps=(*one.lamps, *other.lamps))
    apart = relight(BALL, one).radiance + relight(BALL, other).radiance
    np.testing.assert_allclose(relight(BALL, both).radiance, apart, atol=1e-6)


def test_sequences_and_labels_show_what_single_pictures_do() -> None:
    lights = [lamp(LOW), lamp(normalised([-0.3, 0.8, 0.4])), StageLighting((EnvironmentMap(np.ones((8, 16, 3), "f")),))]
    alone = [relight(BALL, light).radiance for light in lights]
    for frame, picture in zip(relight_sequence(BALL, lights), alone, strict=True):
        np.testing.assert_array_equal(frame.radiance, picture)
    labels = np.random.default_rng(2).integers(0, 3, BALL.shape)
    chosen = np.choose(labels[..., None], alone)
    np.testing.assert_allclose(relight_per_pixel(BALL, labels, lights).radiance, chosen, atol=1e-6)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        small = list(relight_sequence(BALL, lights, RelightSettings(compression="cosine")))
    assert error(small[0].radiance, alone[0]) < 0.05


def test_the_fit_does_not_depend_on_memory() -> None:
    whole, bands = fit_diffuse(BALL, 1 << 30), fit_diffuse(BALL, 1 << 17)
    for name in ("lobes", "constants", "colours", "strengths"):
        np.testing.assert_allclose(getattr(bands, name), getattr(whole, name), atol=1e-6)
    seen = normals(camera()).any(axis=-1)
    middle = tuple(np.array(BALL.shape) // 2)
    np.testing.assert_allclose(np.linalg.norm(whole.lobes[middle]), ALBEDO.mean() / np.pi, rtol=0.02)
    np.testing.assert_allclose(whole.colours[seen].mean(axis=0), ALBEDO / ALBEDO.mean(), rtol=1e-3)


def test_no_band_outlives_its_turn(monkeypatch: pytest.MonkeyPatch) -> None:
    bands: list[weakref.ref[np.ndarray]] = []
    alive: list[int] = []

    def block(self: Pictures, lights: slice, rows: slice) -> np.ndarray:
        alive.append(sum(each() is not None for each in bands))
        read = original(self, lights, rows).copy()
        bands.append(weakref.ref(read))
        return read

    original = type(BALL).block
    monkeypatch.setattr(type(BALL), "block", block)
    fit_diffuse(BALL, 1 << 17)
    assert len(bands) >= 3
    assert max(alive) <= 1  # the one before, until it is replaced


def test_remainders_are_the_lights_own_and_nothing_far_from_all() -> None:
    by = Remainder()
    np.testing.assert_allclose(by.weights(DOME, DOME.directions), np.eye(len(DOME)), atol=1e-6)
    behind = np.array([[0.0, 0.0, -1.0]])
    assert np.abs(by.weights(DOME, behind)).sum() < 0.1
    power = np.random.default_rng(0).random((301, 3))
    np.testing.assert_allclose(by.gathered(DOME, BETWEEN, power), by.weights(DOME, BETWEEN).T @ power, atol=1e-9)
    assert np.abs(by.weights(DOME, BETWEEN)).sum(axis=1).max() < 2


def test_lights_on_one_side_are_as_far_apart_as_they_are_all_around() -> None:
    # Seven lights within 20°: their cells fill the sphere.
    turns = np.arange(6) * np.pi / 3
    ring = np.stack([np.sin(0.3) * np.cos(turns), np.sin(0.3) * np.sin(turns), np.full(6, np.cos(0.3))], axis=-1)
    few = StageLights.towards(np.concatenate([ring, [[0.0, 0, 1]]]))
    assert lights_width(few) < 0.8 < float(np.sqrt(np.median(few.solid_angles)))
    full = StageLights.towards(even_directions(300))
    assert lights_width(full) == float(np.sqrt(np.median(full.solid_angles)))


def test_the_fit_is_for_few_lights_and_for_lights_on_one_side() -> None:
    assert needs_fit(DOME) and needs_fit(StageLights.towards(EVEN))
    many = even_directions(300)
    assert not needs_fit(StageLights.towards(many)) and needs_fit(StageLights.towards(many[many[:, 2] > 0]))


@pytest.mark.parametrize(("name", "limit"), [("gray", 0.06), ("cat", 0.08)])
def test_the_outermost_light_of_a_real_set_is_no_worse_than_the_nearest_photograph_and_a_fit(name, limit) -> None:
    if not OLAT.is_dir():
        pytest.skip("the real sets are not beside the repository")
    chrome = [read_photograph(OLAT / "chrome" / f"chrome.{i}.png").pixels / 255 for i in range(12)]
    mask = read_photograph(OLAT / "chrome" / "chrome.mask.png").pixels
    directions = read_ball(chrome, MirrorBall(outline_of_mask(mask))).directions
    pictures = np.stack([read_photograph(OLAT / name / f"{name}.{i}.png").pixels for i in range(12)])[:, ::2, ::2] / 255
    subject = read_photograph(OLAT / name / f"{name}.mask.png").pixels[::2, ::2, 0] > 127
    # The first light stands 15 degrees outside the others.
    lights, truth = StageLights.towards(directions[1:]), pictures[0][subject]
    found = relight(Pictures(pictures[1:].astype(np.float32), lights), lamp(directions[0])).radiance[subject]
    nearest = pictures[1:][NearestLight().weights(lights, directions[:1])[0].argmax()][subject]
    plain = np.maximum(
        np.einsum("n,npc->pc", directions[0] @ np.linalg.pinv(lights.directions), pictures[1:, subject]), 0
    )
    assert error(found, truth) < min(limit, error(nearest, truth), error(plain, truth))


def test_where_a_mesh_cannot_be_used_the_warning_names_the_fit() -> None:
    mesh = sphere(Diffuse((0.5, 0.5, 0.5)), centre=(0.0, 0.0, 0.0), fine=1)
    with pytest.warns(UserWarning) as said:
        relight(BALL, lamp(normalised([0.5, 0.2, -0.8])), mesh=SubjectMesh((mesh,), required=False))
    lines = [str(each.message) for each in said]
    assert any("is not used: the stage has no camera" in line for line in lines)
    assert any("a matte surface fitted to each pixel gives it instead" in line for line in lines)

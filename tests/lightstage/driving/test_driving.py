"""A stage driven by a map: what it must give back exactly, and what it must say."""

import json
import warnings

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from relume.errors import OutputNotWritten
from relume.lightstage.driving.drive_file import drive_as_csv, drive_as_json, write_drive
from relume.lightstage.driving.driving import Drive, LampPrimaries, bounded_least_squares, drive
from relume.lightstage.driving.subjects import MeasuredSubject, SurfaceSubject
from relume.lightstage.field.field import Pictures
from relume.lightstage.field.lights import StageLights
from relume.lightstage.relighting.interpolation import NearestLight
from relume.lightstage.relighting.stage_lighting import irradiances
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from written_by_stages import read_drive

EVEN = StageLights.towards(even_directions(80))
UNIFORM = EnvironmentMap(np.ones((32, 64, 3), np.float32))


def lit_pixels(count: int = 12, rows: int = 32) -> tuple[StageLights, EnvironmentMap, np.ndarray]:
    """A stage, a map that is black but where its lights stand, and the irradiance of each."""
    random = np.random.default_rng(9)
    row, column = np.linspace(2, rows - 3, count).astype(int), random.permutation(2 * rows)[:count]
    radiance = np.zeros((rows, 2 * rows, 3), np.float32)
    radiance[row, column] = random.uniform(0.5, 4, (count, 3))
    lights = StageLights.towards(pixel_directions(LatLong(), rows)[row, column])
    return lights, EnvironmentMap(radiance), radiance[row, column] * LatLong().solid_angles(rows)[row, column][:, None]


def seen(drive: Drive, normals: np.ndarray) -> np.ndarray:
    """Irradiance on normals, by the definition."""
    return np.maximum(normals @ drive.lights.directions.T, 0) @ drive.irradiances


def smooth_map() -> EnvironmentMap:
    """A sky that is blue and brighter above, over a dark ground, with a warm glow."""
    towards = pixel_directions(LatLong(), 32)
    sky = 0.2 + np.maximum(towards[..., 1:2], 0) * [0.5, 0.8, 1.4]
    glow = np.exp(6 * (towards @ [0.8, 0.0, -0.6] - 1))[..., None] * [6.0, 4.0, 2.0]
    return EnvironmentMap((sky + glow).astype(np.float32))


@pytest.mark.parametrize("subject", [SurfaceSubject(), SurfaceSubject.glossy(0.8)])
def test_a_map_of_the_stages_own_lights_comes_back(subject):
    lights, light, irradiance = lit_pixels()
    result = drive(lights, light, subject=subject)
    np.testing.assert_allclose(result.intensities, irradiance, rtol=1e-4)
    assert result.clipped == 0 and result.residual.max() < 1e-4


def test_a_uniform_map_takes_weights_like_solid_angles_and_irradiance_within_a_percent():
    result = drive(EVEN, UNIFORM)
    assert np.all(np.abs(result.intensities[:, 0] / EVEN.solid_angles - 1) < 0.35)
    normals = even_directions(500)
    # Constant radiance 1 gives π on every normal.
    assert np.abs(seen(result, normals) / np.pi - 1).max() < 0.01
    np.testing.assert_allclose(result.irradiances.sum(axis=0), 4 * np.pi, rtol=0.01)


def test_a_drive_lights_a_matte_subject_better_than_the_cells_of_the_map():
    light, normals = smooth_map(), even_directions(300)
    truth = light.irradiance(normals)
    ours = drive(EVEN, light)
    plain = Drive(EVEN, LampPrimaries.rgb(), irradiances(EVEN, light, NearestLight()), np.zeros(3))

    def error(which):
        return np.sqrt(np.mean((seen(which, normals) - truth) ** 2) / np.mean(truth**2))

    assert error(ours) < 0.01 and error(ours) < 0.6 * error(plain)
    # The root of the mean square over all channels and normals, by the light of each channel.
    shares = np.mean(truth**2, axis=0)
    expected = np.sqrt((ours.residual**2 * shares).sum() / shares.sum())
    np.testing.assert_allclose(error(ours), expected, rtol=0.03)


def test_what_is_seen_counts_by_its_solid_angle():
    weights = SurfaceSubject().weights
    towards = pixel_directions(LatLong(), SurfaceSubject().rows).reshape(-1, 3)
    assert weights.sum() == pytest.approx(1)
    # The mean of y² over the sphere is a third.
    assert weights @ towards[:, 1] ** 2 == pytest.approx(1 / 3, rel=5e-3)


def test_cell_sums_hold_all_the_light():
    light = smooth_map()
    np.testing.assert_allclose(irradiances(EVEN, light, NearestLight()).sum(axis=0), light.total(), rtol=1e-12)


def test_bounded_least_squares_finds_what_scipy_finds():
    random = np.random.default_rng(2)
    matrix, wanted = random.normal(size=(60, 25)), random.normal(size=60) * 3
    ours = bounded_least_squares(matrix.T @ matrix, matrix.T @ wanted, 0.4, np.zeros(25))
    theirs = lsq_linear(matrix, wanted, (0, 0.4), method="bvls", tol=1e-14).x
    assert (theirs == 0).sum() > 3 and (theirs > 0.399).sum() > 1
    np.testing.assert_allclose(ours, theirs, atol=1e-7)


def test_a_level_out_of_reach_is_reported_with_the_level_that_can_be_had():
    lights, light, irradiance = lit_pixels()
    with pytest.warns(UserWarning, match="at their maximum"):
        result = drive(lights, light, LampPrimaries.rgb(maximum=irradiance.max() / 4))
    assert result.headroom == pytest.approx(0.25, rel=1e-3)
    assert result.clipped > 0 and result.intensities.max() == pytest.approx(irradiance.max() / 4)
    darker = EnvironmentMap(light.radiance * np.float32(result.headroom * 0.999))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        faithful = drive(lights, darker, LampPrimaries.rgb(maximum=irradiance.max() / 4))
    assert faithful.clipped == 0 and faithful.residual.max() < 1e-3


def test_white_lamps_are_reported_to_miss_a_coloured_map():
    with pytest.warns(UserWarning, match="colours that no mix of white"):
        result = drive(EVEN, smooth_map(), LampPrimaries.white())
    assert result.beyond_gamut > 0.1
    assert np.ptp(result.irradiances, axis=1).max() == 0


def test_four_primaries_make_what_three_make():
    lamps = LampPrimaries(
        ("red", "green", "blue", "white"), np.array([[0.9, 0.1, 0], [0.1, 0.9, 0.1], [0, 0.1, 0.9], [0.8, 0.7, 0.6]])
    )
    result = drive(EVEN, smooth_map(), lamps)
    assert result.intensities.shape == (80, 4) and result.intensities.min() >= 0
    assert result.residual.max() < 0.01 and result.beyond_gamut < 1e-9


def test_a_colour_outside_the_primaries_is_measured():
    lamps = LampPrimaries(("red", "green"), np.array([[1.0, 0, 0], [0, 1.0, 0]]))
    # Of (3, 0, 4) red reaches 3, and 4 of a length of 5 are missed.
    assert lamps.beyond_gamut([[3.0, 0, 4.0]], [1.0]) == pytest.approx(0.8)
    assert lamps.nearest([3.0, 2.0, 4.0]).tolist() == pytest.approx([3.0, 2.0])


def test_a_given_subject_looks_as_its_own_field_says():
    random = np.random.default_rng(4)
    field = Pictures(random.uniform(0, 1, (80, 6, 7, 3)).astype(np.float32), EVEN)
    light = smooth_map()
    result = drive(EVEN, light, subject=MeasuredSubject(field, by=NearestLight()))
    # The field's lights are the stage's: each stands for its own cell.
    np.testing.assert_allclose(result.intensities, irradiances(EVEN, light, NearestLight()), rtol=1e-6)
    assert result.residual.max() < 1e-6


def test_a_smooth_subject_is_reported_between_the_lights_of_its_field():
    axes = even_directions(40)

    def pictures(directions):
        values = (1 + axes @ directions.T) ** 2
        return values.T.reshape(-1, 5, 8, 1).repeat(3, axis=-1).astype(np.float32)

    lamps = StageLights.towards(-even_directions(30))
    shown = MeasuredSubject(Pictures(pictures(EVEN.directions), EVEN)).lit_by(lamps)
    truth = pictures(lamps.directions).reshape(30, 40, 3).transpose(1, 0, 2)
    assert np.abs(shown - truth).mean() / truth.mean() < 0.01


def test_a_given_subject_is_matched_by_a_stage_of_fewer_lights():
    # A matte sphere, seen from +Z.
    towards = np.stack(np.meshgrid(np.linspace(-0.9, 0.9, 12), np.linspace(0.9, -0.9, 12)), axis=-1)
    normals = np.concatenate([towards, np.sqrt(np.maximum(1 - (towards**2).sum(-1, keepdims=True), 0))], axis=-1)
    values = np.maximum(np.einsum("hwk,nk->nhw", normals, EVEN.directions), 0)[..., None].repeat(3, -1)
    mask = (towards**2).sum(-1) < 1
    subject = MeasuredSubject(Pictures(values.astype(np.float32), EVEN), mask, pixels=60)
    result = drive(StageLights.towards(even_directions(30)), smooth_map(), subject=subject)
    assert subject.weights.shape == (60,) and subject.weights.sum() == pytest.approx(1)
    assert result.residual.max() < 0.03


def test_a_black_map_leaves_all_lamps_dark():
    result = drive(EVEN, EnvironmentMap(np.zeros((16, 32, 3), np.float32)), LampPrimaries.rgb(1.0))
    assert result.intensities.max() == 0 and result.headroom == np.inf and result.residual.max() == 0


def some_drive() -> Drive:
    lamps = LampPrimaries(("warm", "cold"), np.array([[1.0, 0.8, 0.5], [0.5, 0.8, 1.0]]), maximum=4.0)
    lights = StageLights.towards(
        np.array([[0, 2.0, 0], [0, 0, 1.0], [1.0, 0, 0], [-1, -1, -1]]), ('a, "b"', "c", "ü", "d")
    )
    return Drive(
        lights, lamps, np.array([[0, 1], [2, 3], [4, 0.125], [1 / 3, 0]]), np.array([0.1, 0, 0.2]), 1, 0.5, 0.02
    )


def test_settings_come_back_from_json_exactly(tmp_path):
    write_drive(tmp_path / "a.json", some_drive())
    back = read_drive(tmp_path / "a.json")
    assert back.intensities.tolist() == some_drive().intensities.tolist()
    assert back.lights.names == some_drive().lights.names and back.primaries.names == ("warm", "cold")
    assert back.primaries.maximum == 4.0 and (back.headroom, back.clipped, back.beyond_gamut) == (0.5, 1, 0.02)
    np.testing.assert_allclose(back.lights.directions, some_drive().lights.directions, atol=1e-15)


def test_csv_holds_a_line_a_light_and_shares_of_the_maximum(tmp_path):
    lines = drive_as_csv(some_drive()).splitlines()
    assert lines[:3] == ["light,x,y,z,warm,cold", '"a, ""b""",0,1,0,0,0.25', "c,0,0,1,0.5,0.75"]
    write_drive(tmp_path / "a.csv", some_drive())
    back = read_drive(tmp_path / "a.csv", some_drive().primaries)
    np.testing.assert_allclose(back.intensities, some_drive().intensities, rtol=1e-8)


def test_an_unlimited_drive_is_json_without_infinities():
    unlimited = Drive(EVEN, LampPrimaries.rgb(), np.ones((80, 3)), np.zeros(3))
    document = json.loads(drive_as_json(unlimited), parse_constant=lambda word: pytest.fail(word))
    assert document["maximum"] is None and document["lights"][0]["intensities"] == {"red": 1, "green": 1, "blue": 1}


def test_a_folder_that_is_a_file_and_another_suffix_are_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputNotWritten) as caught:
        write_drive(tmp_path / "file" / "a.json", some_drive())
    assert "\n" not in str(caught.value) and "a.json" in str(caught.value)
    with pytest.raises(ValueError, match=r"written to \.json or \.csv"):
        write_drive(tmp_path / "a.txt", some_drive())


@pytest.mark.parametrize(
    "make",
    [
        lambda: LampPrimaries((), np.zeros((0, 3))),
        lambda: LampPrimaries.rgb(0),
        lambda: LampPrimaries(("a",), np.zeros((1, 3))),
        lambda: SurfaceSubject.glossy(0),
        lambda: drive(EVEN, UNIFORM, closeness=0),
    ],
)
def test_impossible_stages_and_subjects_are_refused(make):
    with pytest.raises(ValueError, match="expected"):
        make()

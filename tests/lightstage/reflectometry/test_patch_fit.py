"""A virtual patch of skin under a turning lamp: what is recovered of its numbers, and its separated parts."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from command_line import refused, reported
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.light.reflection.weights import Fresnel
from relume.lightstage.reflectometry.patch_files import read_patch
from relume.lightstage.reflectometry.patch_fit import PatchReflectance, fit_patch, separate_patch
from relume.lightstage.reflectometry.patch_samples import PatchSamples
from relume.report.materials import patch_report

LIGHT = np.ones(3) / np.sqrt(3)
TRUTH = PatchReflectance(np.array([0.52, 0.3, 0.21]), -0.22, 0.35, np.radians(16), np.zeros(6), 0.0, LIGHT)
VIEWS = np.radians([-75, -60, -45, -22.5, 0, 22.5, 45, 60, 75])
LAMPS = np.radians(np.linspace(-85, 85, 64))


def measured(noise: float = 0.01, seed: int = 0, truth: PatchReflectance = TRUTH) -> PatchSamples:
    """The turning stage's 64 lamps and 9 views, with noise of this share of each value and a floor."""
    incidence, viewing = (each.ravel() for each in np.meshgrid(LAMPS, VIEWS))
    dark = PatchSamples(incidence, viewing, np.zeros((len(incidence), 3)), np.ones((len(incidence), 3)))
    exact = truth.diffuse_part(incidence, viewing) + truth.specular_part(dark.light, dark.view)
    deviation = np.hypot(noise * exact, 0.1 * noise * exact.max())
    values = exact + deviation * np.random.default_rng(seed).standard_normal(exact.shape)
    return PatchSamples(incidence, viewing, values, deviation)


def test_the_lobe_is_the_printed_one():
    # Light and view along the normal: P G F / 4 with P = 1/(π m²) for a narrow lobe, G = 1, F = (0.4/2.4)².
    narrow = PatchReflectance(TRUTH.albedo, 0.0, 1.0, 0.05, np.zeros(6), 0.0, LIGHT)
    found = narrow.specular_part(np.array([[0, 0, 1.0]]), np.array([[0, 0, 1.0]]))
    assert found[0] == pytest.approx(1 / (np.pi * 0.05**2) * (0.4 / 2.4) ** 2 / 4, rel=0.01)
    # Mirrored at 60°: G = 1 where the grooves do not reach, and 1/cos 60° more than along the normal, by Fresnel's F.
    aslant = np.array([[np.sin(1.047), 0, np.cos(1.047)]])
    ratio = narrow.specular_part(aslant * [-1, 1, 1], aslant)[0, 0] / found[0, 0]
    assert ratio == pytest.approx(Fresnel(1.4)(np.cos(1.047)) / Fresnel(1.4)(np.array(1.0)) / np.cos(1.047), rel=0.01)


@pytest.mark.parametrize("seed", [0, 1, pytest.param(2, marks=pytest.mark.slow)])  # slow: the others go red alike
def test_numbers_are_recovered_within_five_per_cent(seed):
    found = fit_patch(measured(0.01, seed))
    assert found.albedo == pytest.approx(TRUTH.albedo, rel=0.02)
    assert found.ramp == pytest.approx(TRUTH.ramp, rel=0.05)
    assert found.specular == pytest.approx(TRUTH.specular, rel=0.03)
    assert found.roughness == pytest.approx(TRUTH.roughness, rel=0.02)
    truth = np.array([*TRUTH.albedo, TRUTH.ramp, TRUTH.specular, TRUTH.roughness])
    off = np.array([*found.albedo, found.ramp, found.specular, found.roughness]) - truth
    assert np.abs(off / found.deviation).max() < 4 and np.all(found.deviation < 0.05 * np.abs(truth))


def numbers_of(patch: PatchReflectance) -> np.ndarray:
    return np.array([*patch.albedo, patch.ramp, patch.specular, patch.roughness])


def least_deviations(samples: PatchSamples) -> np.ndarray:
    """Cramér and Rao's bound of the six numbers, from their slopes at the truth: what no unbiased estimator beats."""
    truth, slopes = numbers_of(TRUTH), []
    for step in 1e-5 * np.eye(6):
        ends = []
        for numbers in (truth + step, truth - step):
            end, share, roughness = (float(each) for each in numbers[3:])
            patch = PatchReflectance(numbers[:3], end, share, roughness, np.zeros(6), 0.0, LIGHT)
            ends.append(
                patch.diffuse_part(samples.incidence, samples.viewing)
                + patch.specular_part(samples.light, samples.view)
            )
        slopes.append(((ends[0] - ends[1]) / 2e-5 / samples.deviation).ravel())
    return np.sqrt(np.diag(np.linalg.inv(np.array(slopes) @ np.array(slopes).T)))


def test_no_estimator_does_better_and_deviations_are_those_of_repeated_measurements():
    several = [fit_patch(measured(0.02, seed)) for seed in range(8)]
    numbers = np.array([numbers_of(each) for each in several])
    said = np.mean([each.deviation for each in several], axis=0)
    ratios = numbers.std(axis=0, ddof=1) / said
    assert 0.7 < np.sqrt(np.mean(ratios**2)) < 1.5
    bound = least_deviations(measured(0.02))
    off = np.sqrt(np.mean((numbers - numbers_of(TRUTH)) ** 2, axis=0))
    assert np.sqrt(np.mean((off / bound) ** 2)) < 1.25 and said == pytest.approx(bound, rel=0.15)
    # The ramp is the faintest: with 2 % of noise on each channel by itself, two deviations of it are 5 %, not less.
    shares = bound / np.abs(numbers_of(TRUTH))
    assert shares[3] == pytest.approx(0.0247, rel=0.03) and np.delete(shares, 3).max() < 0.008


def test_a_lamp_that_flickers_says_nothing_of_colour():
    # 3 % of each sample, alike in its channels, and 0.3 % of each: the ratios are good, and the ramp is in them.
    found = []
    for seed in range(4):
        samples, generator = measured(0.003, seed), np.random.default_rng([seed, 1])
        flicker = 1 + 0.03 * generator.standard_normal((len(samples.values), 1))
        deviation = np.hypot(samples.deviation, 0.03 * np.abs(samples.values) + 1e-6)
        found.append(fit_patch(replace(samples, values=samples.values * flicker, deviation=deviation)))
    off = np.array([numbers_of(each) for each in found]) / numbers_of(TRUTH) - 1
    spread = np.sqrt(np.mean(off**2, axis=0))
    assert spread[3] < 0.012 and spread.max() < 0.012  # 0.6 % measured; 2.3 % where each channel stood for itself


def test_parts_sum_to_the_samples_and_are_those_of_the_patch():
    samples = measured(0.003)
    parts = separate_patch(samples)
    assert parts.separable and np.allclose(parts.diffuse + parts.specular, samples.values)
    specular = TRUTH.specular_part(samples.light, samples.view)
    off = np.sqrt(np.mean((parts.specular - specular) ** 2)) / np.sqrt(np.mean(specular**2))
    assert off < 0.15


def test_a_grey_patch_is_fitted_without_colour():
    grey = PatchReflectance(np.full(3, 0.3), 0.0, 0.35, np.radians(16), np.zeros(6), 0.0, LIGHT)
    samples = measured(0.01, truth=grey)
    assert not separate_patch(samples).separable
    found = fit_patch(samples)
    assert found.albedo == pytest.approx(grey.albedo, rel=0.02) and found.specular == pytest.approx(0.35, rel=0.05)


def test_samples_without_a_highlight_are_refused():
    matte = PatchReflectance(TRUTH.albedo, -0.2, 1e-9, 0.3, np.zeros(6), 0.0, LIGHT)
    with pytest.raises(ValueError, match="show no highlight"):
        fit_patch(measured(1e-4, truth=matte))


def test_samples_that_cannot_be_are_refused():
    samples = measured()
    with pytest.raises(ValueError, match="12 samples of the patch; a fit needs 20"):
        PatchSamples(samples.incidence[:12], samples.viewing[:12], samples.values[:12], samples.deviation[:12])
    with pytest.raises(ValueError, match="1 angles of viewing are 90°"):
        PatchSamples(samples.incidence, np.r_[1.6, samples.viewing[1:]], samples.values, samples.deviation)


def write_patch(folder: Path, samples: PatchSamples, every: int = 1) -> None:
    """A folder of small pictures, each with the patch in its middle, of a lamp of irradiance 2."""
    entries, generator = [], np.random.default_rng(2)
    for place in range(0, len(samples.values), every):
        picture = np.full((8, 10, 3), 0.01, np.float32)
        picture[3:5, 2:7] = 2 * samples.values[place] * (1 + 0.01 * generator.standard_normal((2, 5, 1)))
        files.write(folder / f"{place:03d}.exr", RadianceMap(picture))
        angles = np.degrees([samples.incidence[place], samples.viewing[place]])
        entries.append({"file": f"{place:03d}.exr", "incidence": angles[0], "view": angles[1]})
    table = {"irradiance": 2.0, "area": [2, 3, 5, 2], "pictures": entries}
    (folder / "patch.json").write_text(json.dumps(table))


def test_the_command_fits_and_plots(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(patch_report, "TRIED", 100)  # the drawn reference alone gets noisier
    write_patch(tmp_path, measured(0.002), 3)
    told = reported(["stage", "reflectometry", tmp_path, "-o", tmp_path / "patch.html"], capsys)
    assert told["albedo"] == pytest.approx(TRUTH.albedo, rel=0.03)
    assert told["roughness, degrees"][0] == pytest.approx(16, rel=0.05)
    page = (tmp_path / "patch.html").read_text()
    assert page.count("<img") == 2 and "Hanrahan" in page


def test_a_folder_without_sense_is_one_line(tmp_path, capsys):
    assert "patch.json: is missing" in refused(["stage", "reflectometry", tmp_path, "-o", tmp_path / "a.html"], capsys)
    write_patch(tmp_path, measured(), 3)
    table = json.loads((tmp_path / "patch.json").read_text())
    for change, line in (
        ({"area": [8, 3, 5, 2]}, r"the area \[8, 3, 5, 2\] is not within its 10×8 pixels"),
        ({"pictures": table["pictures"][:7]}, "7 samples of the patch; a fit needs 20"),
        ({"irradiance": 0}, "irradiance: expected one number above 0"),
        ({"pictures": [{"file": "000.exr"}]}, r"pictures\.0\.incidence: missing; .*pictures\.0\.view: missing"),
        ({"area": None}, r'no "area" of all, nor of 000\.exr, .* and 186 more; give the patch as \[left'),
    ):
        (tmp_path / "patch.json").write_text(json.dumps({**table, **change}))
        with pytest.raises(UnreadableFile, match=line) as said:
            read_patch(tmp_path)
        assert "\n" not in str(said.value)


def test_all_that_is_wrong_in_the_list_is_named_at_once(tmp_path):
    write_patch(tmp_path, measured(), 3)
    table = json.loads((tmp_path / "patch.json").read_text())
    first, second, *others = table["pictures"]
    del first["view"]
    second["incidense"], others[0]["incidence"], table["irradiance"] = second.pop("incidence"), 95, [1, 2]
    (tmp_path / "patch.json").write_text(json.dumps({**table, "lamp": 1}))
    with pytest.raises(UnreadableFile) as said:
        read_patch(tmp_path)
    assert str(said.value) == (
        f"{tmp_path / 'patch.json'}: irradiance: expected one number above 0, or three (got [1, 2]); "
        "pictures.0.view: missing; the list of photographs must have it; "
        "pictures.1.incidence: missing; the list of photographs must have it; "
        "pictures.1.incidense: unknown key; did you mean incidence?; "
        "pictures.2.incidence: input should be less than 90 (got 95); lamp: unknown key; remove it or see the docs"
    )
    for each in table["pictures"]:
        each["incidence"] = "steep"
    (tmp_path / "patch.json").write_text(json.dumps(table))
    with pytest.raises(UnreadableFile, match=r"; and 18\d more$"):
        read_patch(tmp_path)
    (tmp_path / "patch.json").write_text("[1]")
    with pytest.raises(UnreadableFile, match=r"patch.json: input should be a table \(got \[1\]\)$"):
        read_patch(tmp_path)


def test_a_saturated_patch_names_its_photographs(tmp_path):
    samples = measured()
    write_patch(tmp_path, samples, 3)
    table = json.loads((tmp_path / "patch.json").read_text())
    picture = np.full((8, 10, 3), 90, np.uint8)
    # White beside the patch is no matter.
    picture[0, 0] = 255
    files.write(tmp_path / "even.png", Photograph(picture))
    picture[3, 2] = 255
    for name in ("hot.png", "hotter.png"):
        files.write(tmp_path / name, Photograph(picture))
    for place, name in ((0, "even.png"), (3, "hot.png"), (9, "hotter.png")):
        table["pictures"][place]["file"] = name
    (tmp_path / "patch.json").write_text(json.dumps(table))
    with pytest.raises(UnreadableFile) as said:
        read_patch(tmp_path)
    expected = f"{tmp_path}: the patch is saturated in hot.png, hotter.png; expose shorter, all of them alike"
    assert str(said.value) == expected

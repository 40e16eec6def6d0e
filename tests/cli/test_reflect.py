"""`relume reflect`: what it writes, read back from the files, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import lights
from command_line import printed, refused, reported
from lights import stored
from relume.image.files import read_layers, read_photograph, read_radiance, write
from relume.image.files.textures.ktx2 import read_cube
from relume.image.radiance import RadianceMap
from relume.light.reflection.brdf import GGX, PhongReflectance, Ward
from relume.light.reflection.glossy import glossy_map
from relume.light.reflection.lobes import Phong
from relume.light.reflection.reflection_map import reflection_map
from relume.light.reflection.storage import as_layers, glossy_from_layers
from relume.light.reflection.weights import Schlick
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.cubes import Strip
from relume.sphere.mip_cube import faces_of, mirrored_strip


def made(words: Sequence[object], capsys: pytest.CaptureFixture[str]) -> dict:
    return reported(["reflect", *words], capsys)


@pytest.mark.parametrize(
    ("normalisation", "diffuse", "specular"),
    [("radiometric", 1.0, 1.0), ("paper", 0.25, 0.5 / 51), ("sum", np.pi, 2 * np.pi / 51)],
)
def test_constant_light_gives_the_constants_of_each_normalisation(normalisation, diffuse, specular, tmp_path, capsys):
    out = tmp_path / "made"
    report = made([stored(tmp_path, lights.constant(256)), "-o", str(out), "--normalisation", normalisation], capsys)
    assert report["written"] == [str(out / name) for name in ("diffuse.exr", "specular.exr", "harmonics.json")]
    assert sorted(p.name for p in out.iterdir()) == ["diffuse.exr", "harmonics.json", "specular.exr"]
    assert report["normalisation"] == normalisation and report["error bound"]["diffuse"] == 0
    assert report["mean of D, radiometric"] == pytest.approx([1, 1, 1], rel=1e-3)
    assert report["irradiance from above"] == pytest.approx([np.pi] * 3, rel=1e-3)
    for name, size, value in (("diffuse", (72, 36), diffuse), ("specular", (512, 256), specular)):
        picture = read_radiance(out / f"{name}.exr")
        assert picture.size == size
        np.testing.assert_allclose(picture.radiance, value, rtol=1e-3)
        assert picture.attributes["normalisation"] == normalisation
    assert json.loads((out / "harmonics.json").read_text())["terms"]


def test_tables_hold_what_the_library_computes_and_say_what_they_are(tmp_path, capsys):
    light, out = lights.sunny(32), tmp_path / "made"
    words = ["self-luminous", "lambert", "mirror", "phong:50", "phong:50.0", "varnish:10", "ggx:0.3", "ward:0.25"]
    report = made([stored(tmp_path, light), "-o", str(out), "--rows", "16", *[f"--lobe={w}" for w in words]], capsys)
    assert [Path(p).name for p in report["written"]] == [
        "diffuse_self_luminous.exr", "diffuse_lambert.exr", "specular_mirror.exr", "specular_phong_50.exr",
        "specular_varnish_10.exr", "specular_ggx_0.3.exr", "specular_ward_0.25.exr", "harmonics.json",
    ]  # fmt: skip
    for name, lobe in (("phong_50", Phong(50)), ("varnish_10", Phong(10, varnish=0.5))):
        picture, table = read_radiance(out / f"specular_{name}.exr"), reflection_map(light, lobe, 16)
        np.testing.assert_array_equal(as_environment(picture).radiance, table.table)
        attributes = picture.attributes
        assert (attributes["lobe"], float(attributes["n"]), float(attributes["varnish"])) == (
            "phong", lobe.n, lobe.varnish
        )  # fmt: skip
        assert float(attributes["error_bound"]) == report["error bound"][f"specular_{name}"] == table.error_bound
        assert attributes["unit"] == picture.unit == "relative"


def test_a_calibrated_map_keeps_its_unit_and_a_sum_is_no_radiance(tmp_path, capsys):
    light = EnvironmentMap(lights.constant(32, 100.0).radiance, unit="cd/m²")
    words = [stored(tmp_path, light), "--lobe", "lambert", "-o"]
    made([*words, str(tmp_path / "a")], capsys)
    made([*words, str(tmp_path / "b"), "--normalisation", "sum"], capsys)
    radiance, summed = (read_radiance(tmp_path / folder / "diffuse_lambert.exr") for folder in "ab")
    assert (radiance.unit, radiance.attributes["unit"]) == ("cd/m²", "cd/m²")
    assert (summed.unit, summed.attributes["unit"]) == ("relative", "cd/m²·sr")
    np.testing.assert_allclose(summed.radiance, 100 * np.pi, rtol=1e-3)


@pytest.mark.parametrize(
    ("word", "brdf"), [("ggx:0.5", GGX(0.5)), ("ward:0.4", Ward(0.4)), ("phong:8", PhongReflectance(8.0))]
)
def test_a_three_dimensional_map_is_the_same_when_read_back(word, brdf, tmp_path, capsys):
    light, out = lights.sunny(32), tmp_path / "made"
    report = made([stored(tmp_path, light), "-o", str(out), "--brdf", word, "--rows", "8"], capsys)
    file = out / f"glossy_{word.replace(':', '_')}.exr"
    assert report["written"] == [str(file), str(out / "harmonics.json")]
    layers = read_layers(file)
    assert {"view_00_k0", "view_07_k1_cos", "view_23_k5_sin"} <= layers.keys()
    with pytest.warns(UserWarning, match="left out: the parts view_00_k1_cos"):
        attributes = read_radiance(file).attributes
    again, table = glossy_from_layers(layers, attributes), glossy_map(light, brdf, 8)
    assert (again.brdf, again.unit) == (brdf, "relative")
    for field in ("tables", "tilts", "albedos"):
        np.testing.assert_array_equal(getattr(again, field), getattr(table, field))
    towards = lights.spread(20)
    np.testing.assert_array_equal(again.lookup(towards, towards[::-1]), table.lookup(towards, towards[::-1]))


def test_a_three_dimensional_map_that_is_not_whole_is_refused():
    light = lights.constant(16)
    layers, attributes = as_layers(glossy_map(light, GGX(0.5), 4, views=2, azimuths=1))
    assert list(layers) == [f"view_{v:02d}_{k}" for v in (0, 1) for k in ("k0", "k1_cos", "k1_sin")]
    with pytest.raises(ValueError, match="view_01_k1_sin"):
        glossy_from_layers({k: v for k, v in layers.items() if k != "view_01_k1_sin"}, attributes)
    with pytest.raises(ValueError, match="tilts"):
        glossy_from_layers(layers, {k: v for k, v in attributes.items() if k != "tilts"})
    with pytest.raises(ValueError, match="2 tilts, 1 albedos"):
        glossy_from_layers(layers, attributes | {"albedos": "1.0"})
    with pytest.raises(ValueError, match="Fresnel"):
        as_layers(glossy_map(light, GGX(0.5, Schlick(0.04)), 4, views=2, azimuths=0))


def strip_of(faces: np.ndarray) -> EnvironmentMap:
    return EnvironmentMap(np.concatenate(list(faces), axis=1), Strip())


def test_cubes_hold_the_light_its_diffuse_map_and_ggx_by_roughness(tmp_path, capsys):
    light, out = lights.sunny(32), tmp_path / "made"
    path = stored(tmp_path, light)
    report = made([path, "-o", str(out), "--cube", "16"], capsys)
    assert {Path(p).name for p in report["written"]} >= {"light.ktx2", "diffuse.ktx2", "specular.ktx2"}
    cubes = {name: read_cube(out / f"{name}.ktx2") for name in ("light", "diffuse", "specular")}
    for levels in cubes.values():
        assert [len(level[0]) for level in levels] == [16, 8, 4, 2, 1]
        for level in levels:
            np.testing.assert_allclose(strip_of(level).total(), light.total(), rtol=5e-3)
    np.testing.assert_array_equal(cubes["specular"][0], cubes["light"][0])
    up = np.array([0.0, 1, 0])
    np.testing.assert_allclose(strip_of(cubes["diffuse"][0]).lookup(up), light.irradiance(up) / np.pi, rtol=0.02)
    contrast = [level.max() / level.min() for level in cubes["specular"][:4]]
    assert contrast == sorted(contrast, reverse=True)

    words = [path, "-o", str(out), "--lobe", "lambert", "--cube", "16", "--mirror", "x"]
    assert str(out / "diffuse_lambert.ktx2") in made(words, capsys)["written"]
    mirrored = mirrored_strip(strip_of(cubes["light"][0]), "x")
    np.testing.assert_array_equal(read_cube(out / "light.ktx2")[0], faces_of(mirrored))


def test_constant_light_stays_what_it_is_at_every_roughness(tmp_path, capsys):
    made([stored(tmp_path, lights.constant(16)), "-o", str(tmp_path), "--cube", "8", "--cube-format", "hdr"], capsys)
    for level, size in enumerate((8, 4, 2, 1)):
        strip = read_radiance(tmp_path / f"specular_{level}.hdr")
        assert strip.size == (size, 6 * size)
        np.testing.assert_allclose(strip.radiance, 1, rtol=1 / 256)


def test_a_dry_run_writes_nothing_and_says_what_it_would(tmp_path, capsys):
    path, out = stored(tmp_path, lights.constant(8)), tmp_path / "made"
    words = [path, "-o", str(out), "--cube", "4", "--cube-format", "hdr", "--brdf", "ggx:0.5", "--lobe", "lambert"]
    would = made([*words, "--sheet", "--dry-run"], capsys)["would write"]
    assert not out.exists()
    assert [Path(p).name for p in would] == [
        "diffuse_lambert.exr", "glossy_ggx_0.5.exr", "harmonics.json", "light_0.hdr", "light_1.hdr", "light_2.hdr",
        "diffuse_lambert_0.hdr", "diffuse_lambert_1.hdr", "diffuse_lambert_2.hdr", "sheet.png",
    ]  # fmt: skip
    assert made([*words, "--rows", "8"], capsys)["written"] == would[:-1]


def test_quiet_says_nothing_and_other_normalisations_leave_glossy_maps_with_a_note(tmp_path, capsys):
    words = ["reflect", stored(tmp_path, lights.constant(8)), "-o", str(tmp_path), "--brdf", "ggx:0.5", "--rows", "4"]
    captured = printed([*words, "--normalisation", "sum", "-q"], capsys)
    assert captured.out == captured.err == ""
    captured = printed([*words, "--normalisation", "sum"], capsys)
    assert "the normalisation is for lobes" in captured.err and "irradiance from above" in captured.out


def test_the_sheet_is_written_where_it_is_asked_for(tmp_path, capsys, monkeypatch):
    from relume.renderers.prefiltered import contact_sheet as sheet

    monkeypatch.setattr(sheet, "SURFACES", sheet.SURFACES[:2])
    path = stored(tmp_path, lights.sunny(16))
    words = [path, "-o", str(tmp_path / "made"), "--lobe", "lambert", "--rows", "4"]
    assert str(tmp_path / "made" / "sheet.png") in made([*words, "--sheet"], capsys)["written"]
    made([*words, "--sheet", str(tmp_path / "bright.png"), "--exposure", "-2"], capsys)
    usual, dark = read_photograph(tmp_path / "made" / "sheet.png"), read_photograph(tmp_path / "bright.png")
    assert usual.pixels.shape == dark.pixels.shape
    assert usual.pixels.mean() > dark.pixels.mean() + 5


@pytest.mark.parametrize(
    ("words", "report"),
    [
        (["--lobe", "fong:3"], "choose one of lambert, self-luminous, mirror, phong:N"),
        (["--lobe", "phong"], 'needs a number after "phong:"'),
        (["--lobe", "phong:many"], "needs a number"),
        (["--lobe", "phong:-1"], "phong:-1: n of phong is -1.0; expected a glossiness of 0 or more"),
        (["--lobe", "phong:nan"], "expected a glossiness"),
        (["--lobe", "ggx:0"], "alpha of ggx is 0.0"),
        (["--brdf", "lambert"], "choose one of ggx:ALPHA, ward:ALPHA, phong:N"),
        (["--brdf", "ward:2"], "alpha of ward is 2.0"),
        (["--rows", "0"], "rows are 0; give 1 to"),
        (["--rows", "1", "--brdf", "ggx:1"], "rows are 1; give 2 to"),
        (["--rows", "1000000"], "rows are 1000000"),
        (["--cube", "100"], "a power of two"),
        (["--cube", "0"], "a power of two"),
        (["--cube", "8", "--normalisation", "paper"], "engines expect radiance"),
        (["--mirror", "x"], "no cube is asked for"),
        (["--exposure", "1"], "--sheet"),
        (["--sheet", "a.exr"], ".png"),
        (["--normalisation", "mean"], "normalisation"),
    ],
)
def test_wrong_words_are_refused_in_one_line(words, report, tmp_path, capsys):
    path = stored(tmp_path, lights.constant(4))
    assert report in refused(["reflect", path, "-o", str(tmp_path / "made"), *words], capsys)
    assert not (tmp_path / "made").exists()


def test_bad_maps_are_refused_in_one_line_that_counts(tmp_path, capsys):
    out = ["-o", str(tmp_path / "made")]
    radiance = lights.constant(8).radiance.copy()
    radiance[1, 1:4], radiance[2, 5, 0], radiance[3, :2, 2] = np.nan, np.inf, -0.5
    write(tmp_path / "odd.exr", RadianceMap(radiance))
    line = refused(["reflect", str(tmp_path / "odd.exr"), *out], capsys)
    assert "odd.exr: 4 pixels are NaN or infinite and 2 negative" in line and "paint over" in line
    write(tmp_path / "wide.exr", RadianceMap(np.ones((8, 9, 3), np.float32)))
    assert "wide.exr: a map of 9×8 pixels" in refused(["reflect", str(tmp_path / "wide.exr"), *out], capsys)
    assert "none.exr: no such file" in refused(["reflect", str(tmp_path / "none.exr"), *out], capsys)
    whole = Path(stored(tmp_path, lights.spiky(16))).read_bytes()
    (tmp_path / "torn.exr").write_bytes(whole[: len(whole) // 2])
    assert "torn.exr: damaged" in refused(["reflect", str(tmp_path / "torn.exr"), *out], capsys)
    (tmp_path / "empty").mkdir()
    assert "empty: no such maps" in refused(["reflect", str(tmp_path / "empty"), *out], capsys)
    assert not (tmp_path / "made").exists()


def test_outputs_that_cannot_be_written_exit_with_3(tmp_path, capsys):
    path = stored(tmp_path, lights.constant(4))
    (tmp_path / "file").write_text("")
    for dry in ([], ["--dry-run"]):
        assert "a file, not a folder" in refused(["reflect", path, "-o", str(tmp_path / "file"), *dry], capsys, 3)
    assert "made a folder" in refused(["reflect", path, "-o", str(tmp_path / "file" / "in")], capsys, 3)
    words = [path, "-o", str(tmp_path / "made"), "--sheet", str(tmp_path / "no" / "a.png")]
    assert "no folder" in refused(["reflect", *words], capsys, 3)
    (tmp_path / "made" / "diffuse.exr").mkdir(parents=True)
    assert "diffuse.exr: cannot be written" in refused(["reflect", path, "-o", str(tmp_path / "made")], capsys, 3)
    assert [p.name for p in (tmp_path / "made").iterdir()] == ["diffuse.exr"]

"""`relume convert` and `relume info --draw`: what they write, read back from the files, and what they refuse."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from angles import degrees_between
from command_line import printed, refused, reported
from lights import NAMED, stored, sunny
from relume.cli import main
from relume.image.files import read_photograph, read_radiance, write
from relume.image.photograph import Photograph
from relume.image.radiance import SATURATED, RadianceMap
from relume.sphere.directions import normalised, rotation_about
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong

SUN = normalised([0.7, 0.3, -0.65])


def made(words: Sequence[object], capsys: pytest.CaptureFixture[str], code: int = 0) -> dict:
    return reported(["convert", *words], capsys, code)


@pytest.mark.parametrize("name", [name for name in NAMED if name != "latlong"])
def test_light_goes_to_every_mapping_and_back_with_its_energy(name, tmp_path, capsys):
    light, there, back = sunny(48), str(tmp_path / "there.exr"), str(tmp_path / "back.exr")
    report = made([stored(tmp_path, light), "-o", there, "--to", name], capsys)
    assert report["mapping"] == name == read_radiance(there).attributes["mapping"]
    made([there, "-o", back, "--to", "latlong", "--size", "48"], capsys)
    again = as_environment(read_radiance(back))
    assert isinstance(again.mapping, LatLong)
    np.testing.assert_allclose(again.total(), light.total(), rtol=1e-3)
    for normal in np.concatenate([np.eye(3), -np.eye(3)]):
        np.testing.assert_allclose(again.irradiance(normal), light.irradiance(normal), rtol=0.02)


def test_six_faces_are_written_and_read_in_opengls_order(tmp_path, capsys):
    light = sunny(48)
    report = made([stored(tmp_path, light), "-o", str(tmp_path / "cube.exr"), "--to", "faces", "--size", "32"], capsys)
    names = [Path(path).name for path in report["written"]]
    assert names == [f"cube_{word}.exr" for word in ("px", "nx", "py", "ny", "pz", "nz")]
    assert read_radiance(report["written"][2]).size == (32, 32)
    assert read_radiance(report["written"][2]).radiance.mean() > read_radiance(report["written"][3]).radiance.mean()
    made([*report["written"], "-o", str(tmp_path / "back.exr"), "--to", "latlong", "--size", "48"], capsys)
    again = as_environment(read_radiance(tmp_path / "back.exr"))
    np.testing.assert_allclose(again.total(), light.total(), rtol=1e-3)
    assert degrees_between(brightest(again), SUN) < 4


def test_faces_whose_names_say_another_order_are_noted(tmp_path, capsys):
    cube = [stored(tmp_path, sunny(48)), "-o", str(tmp_path / "cube.exr"), "--to", "faces", "--size", "16"]
    names = [Path(path) for path in made(cube, capsys)["written"]]
    words = ["-o", str(tmp_path / "back.exr"), "--to", "latlong", "--size", "48"]
    assert "names end in" not in printed(["convert", *map(str, names), *words], capsys).err
    noted = printed(["convert", *map(str, sorted(names)), *words], capsys).err  # as a shell gives cube_*.exr
    assert "names end in nx ny nz px py pz, but they are taken as px nx py ny pz nz" in noted


def test_faces_for_engines_that_negate_an_axis_show_the_same_light(tmp_path, capsys):
    source, out = stored(tmp_path, sunny(48)), str(tmp_path / "back.exr")
    plain = made([source, "-o", str(tmp_path / "gl.exr"), "--to", "faces", "--size", "32"], capsys)["written"]
    words = [source, "-o", tmp_path / "three.exr", "--to", "faces", "--size", "32", "--mirror", "x"]
    three = made(words, capsys)["written"]
    # An unmirrored view of +X has −Z at its left: such an engine's px is our −X face, report the other way round.
    np.testing.assert_array_equal(read_radiance(three[0]).radiance, read_radiance(plain[1]).radiance[:, ::-1])
    made([*three, "-o", out, "--to", "latlong", "--size", "48", "--mirror", "x"], capsys)
    made([*plain, "-o", str(tmp_path / "plain.exr"), "--to", "latlong", "--size", "48"], capsys)
    np.testing.assert_array_equal(read_radiance(out).radiance, read_radiance(tmp_path / "plain.exr").radiance)
    # Files that know their axis need no option, and one that is given counts more than what they know.
    made([*three, "-o", out, "--to", "latlong", "--size", "48"], capsys)
    known = read_radiance(out).radiance
    np.testing.assert_array_equal(known, read_radiance(tmp_path / "plain.exr").radiance)
    made([*three, "-o", out, "--to", "latlong", "--size", "48", "--mirror", "z"], capsys)
    assert not np.allclose(read_radiance(out).radiance, known, rtol=0.1)
    assert "--mirror is for six faces" in refused(["convert", source, "-o", out, "--mirror", "x"], capsys)


def brightest(light: EnvironmentMap) -> np.ndarray:
    row, column = np.unravel_index(light.radiance.sum(2).argmax(), light.radiance.shape[:2])
    return LatLong().directions(np.array([(column + 0.5) / light.radiance.shape[1], (row + 0.5) / light.size]))


@pytest.mark.parametrize(
    ("turn", "rotation"),
    [
        ("90", rotation_about([0, 1, 0], np.pi / 2)),
        ("0,30", rotation_about([1, 0, 0], np.pi / 6)),
        ("-40,0,20", rotation_about([0, 1, 0], -np.radians(40)) @ rotation_about([0, 0, 1], np.radians(20))),
    ],
)
def test_a_turn_moves_the_sun_as_the_help_says(turn, rotation, tmp_path, capsys):
    light = sunny(64, sun=400)
    made([stored(tmp_path, light), "-o", str(tmp_path / "turned.exr"), "--rotate", turn], capsys)
    turned = as_environment(read_radiance(tmp_path / "turned.exr"))
    assert degrees_between(brightest(turned), rotation @ SUN) < 4


def test_the_audit_is_of_the_file_as_written(tmp_path, capsys):
    report = made([stored(tmp_path, sunny(32)), "-o", str(tmp_path / "out.hdr")], capsys)
    assert report["after"]["total"] == pytest.approx(report["before"]["total"], rel=4e-3)
    assert report["after"]["total"] != report["before"]["total"]  # RGBE rounds
    assert report["before"]["irradiance"].keys() == {"+X", "-X", "+Y", "-Y", "+Z", "-Z"}


def test_what_was_clipped_stays_marked(tmp_path, capsys):
    light = sunny(32)
    clipped = np.where(light.radiance[..., 0] > 10, SATURATED, 0).astype(np.uint8)
    source = stored(tmp_path, EnvironmentMap(light.radiance, clipped=clipped))
    report = made([source, "-o", str(tmp_path / "out.exr"), "--to", "angular"], capsys)
    assert 0 < report["before"]["clipped sr"] < 2 * report["after"]["clipped sr"] < 8 * report["before"]["clipped sr"]


def test_a_fisheye_says_what_it_leaves_out(tmp_path, capsys):
    out = tmp_path / "eye.exr"
    assert main(["convert", stored(tmp_path, sunny(48)), "-o", str(out), "--to", "fisheye:equisolid:180"]) == 0
    assert "shows 6.28 of the sphere's 12.6 sr" in capsys.readouterr().err
    assert read_radiance(out).attributes["mapping"] == "fisheye:equisolid:180"


def test_a_map_for_another_program_comes_back_as_it_was(tmp_path, capsys):
    light = sunny(48)
    made([stored(tmp_path, light), "-o", str(tmp_path / "blender.exr"), "--for", "blender", "--size", "48"], capsys)
    laid = read_radiance(tmp_path / "blender.exr")
    assert np.any(laid.radiance != light.radiance) and laid.attributes["orientation"] == "blender"
    np.testing.assert_array_equal(as_environment(laid).radiance, light.radiance)


def test_a_view_is_cropped_and_put_back(tmp_path, capsys):
    light = sunny(96)
    source, view = stored(tmp_path, light), str(tmp_path / "view.exr")
    report = made([source, "-o", view, "--view", "45,10", "--field", "60", "--pixels", "160x120"], capsys)
    assert report["size"] == [160, 120]
    picture = read_radiance(view)
    painted = RadianceMap(np.full_like(picture.radiance, 2.0), None, None, picture.unit, picture.attributes)
    write(tmp_path / "painted.exr", painted)
    made([source, "-o", str(tmp_path / "out.exr"), "--put", str(tmp_path / "painted.exr")], capsys)
    out = as_environment(read_radiance(tmp_path / "out.exr"))
    ahead = rotation_about([0, 1, 0], -np.radians(45)) @ rotation_about([1, 0, 0], np.radians(10)) @ [0, 0, -1]
    np.testing.assert_allclose(out.lookup(ahead), 2.0, rtol=1e-5)
    np.testing.assert_array_equal(out.lookup(-ahead), light.lookup(-ahead))


def painting(folder: Path) -> str:
    pixels = np.full((16, 32, 3), 128, np.uint8)
    pixels[4, 20] = 255
    write(folder / "painting.png", Photograph(pixels, "painting"))
    mask = np.zeros((16, 32, 3), np.uint8)
    mask[4, 20] = 255
    write(folder / "mask.png", Photograph(mask, "mask"))
    return str(folder / "painting.png")


def test_a_painting_needs_its_gamma_and_gets_its_suns(tmp_path, capsys):
    source, out = painting(tmp_path), str(tmp_path / "out.exr")
    assert "--gamma 2.2" in refused(["convert", source, "-o", out], capsys)
    made([source, "-o", out, "--gamma", "2.2", "--exposure", "1", "--hot", f"{tmp_path / 'mask.png'}=10"], capsys)
    picture = read_radiance(out).radiance
    np.testing.assert_allclose(picture[0, 0], 2 * (128 / 255) ** 2.2, rtol=1e-6)
    np.testing.assert_allclose(picture[4, 20], 2048, rtol=1e-6)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--to", "mercator"], '--to: there is no mapping "mercator"'),
        (["--to", "angular", "--for", "usd"], "leave --to out"),
        (["--for", "maya"], '"maya"'),
        (["--rotate", "north"], '--rotate: "north" is not of the form'),
        (["--size", "0"], "size is 0"),
        (["--to", "cross", "--size", "100"], "a cross map of 100 rows; expected a multiple of 3"),
        (["--hot", "a.png=3"], "give --gamma too"),
        (["--view", "0", "--to", "ball"], "leave --to"),
        (["--view", "0", "--rotate", "90"], "leave --to, --for, --rotate"),
        (["--field", "60"], "--field and --pixels are for --view"),
        (["--from", "angular"], "24×12 pixels, but in the mapping angular 12 rows are 12 wide"),
        (["--gamma", "2.2", "--hot", "sun.png"], "not of the form MASK=STOPS"),
    ],
)
def test_wrong_words_are_refused_in_one_line(words, message, tmp_path, capsys):
    out = tmp_path / "out.exr"
    assert message in refused(["convert", stored(tmp_path, sunny(12)), "-o", str(out), *words], capsys)
    assert not out.exists()


def test_maps_that_are_no_light_are_refused_with_what_is_wrong(tmp_path, capsys):
    odd, out = np.ones((12, 30, 3), np.float32), str(tmp_path / "out.exr")
    write(tmp_path / "odd.exr", RadianceMap(odd))
    line = refused(["convert", tmp_path / "odd.exr", "-o", out, "--to", "angular"], capsys)
    assert "30×12 pixels does not say its mapping" in line
    dark = sunny(12).radiance.copy()
    dark[2, 3, 1], dark[4, 5] = -0.5, np.nan
    write(tmp_path / "dark.exr", RadianceMap(dark))
    line = refused(["convert", tmp_path / "dark.exr", "-o", out, "--to", "angular"], capsys)
    assert "1 pixels are NaN or infinite and 1 negative" in line
    faces = [stored(tmp_path, sunny(12), f"{index}.exr") for index in range(6)]
    assert "six squares of one size" in refused(["convert", *faces, "-o", out], capsys)
    assert "2 files; give one map" in refused(["convert", *faces[:2], "-o", out], capsys)


def test_a_dry_run_names_the_files_and_writes_none(tmp_path, capsys):
    report = made([stored(tmp_path, sunny(12)), "-o", str(tmp_path / "o.exr"), "--to", "faces", "--dry-run"], capsys)
    assert len(report["would write"]) == 6 and not list(tmp_path.glob("o_*"))


def test_info_draws_a_map_with_its_axes(tmp_path, capsys):
    out = tmp_path / "map.png"
    printed(["info", stored(tmp_path, sunny(32)), "--draw", str(out)], capsys)
    dark, middle, light = (part.mean() for part in reversed(np.array_split(read_photograph(out).pixels[50:], 3)))
    assert dark < middle < light
    assert "one map" in refused(["info", str(out), str(out), "--draw", str(out)], capsys)


def test_the_labelled_probe_is_written_for_any_program(tmp_path, capsys):
    made(["--labelled", "-o", str(tmp_path / "axes.exr"), "--for", "blender", "--size", "64"], capsys)
    assert read_radiance(tmp_path / "axes.exr").attributes["orientation"] == "blender"
    assert "--labelled" in refused(["convert", "-o", str(tmp_path / "no.exr")], capsys)


def test_an_audit_is_read_line_by_line(tmp_path, capsys):
    lines = printed(["convert", stored(tmp_path, sunny(32)), "-o", str(tmp_path / "out.hdr")], capsys).out.splitlines()
    assert max(map(len, lines)) < 120 + len(str(tmp_path))
    assert [line.split()[0] for line in lines if line.startswith("      ")] == ["+X", "-X", "+Y", "-Y", "+Z", "-Z"] * 2

"""`relume lights`: what it writes, read back from the files, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lights
from command_line import printed, refused, reported
from lights import stored
from relume.cli import main
from relume.image.files import read_photograph, read_radiance, write
from relume.image.radiance import SATURATED, RadianceMap
from relume.light.constellations.constellation import constellation
from relume.light.constellations.k_means import KMeans
from relume.light.constellations.placement import placed_in_box
from relume.light.constellations.rectangles import VarianceMinimisation
from relume.renderers.environment_probe import Arrival, splatted
from relume.sphere.directions import rotation_about
from relume.sphere.environment_files import as_environment, as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.names import mapping_named


def made(words: Sequence[object], capsys: pytest.CaptureFixture[str]) -> dict:
    return reported(["lights", *words], capsys)


def read(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Directions and irradiance in a JSON file."""
    written = json.loads(path.read_text())["lights"]
    return np.array([each["direction"] for each in written]), np.array([each["irradiance"] for each in written])


@pytest.mark.parametrize(
    ("word", "method"), [("median-cut", None), ("variance", VarianceMinimisation()), ("k-means", KMeans())]
)
def test_the_file_holds_the_constellation(word, method, tmp_path, capsys):
    light, out = lights.sunny(32), tmp_path / "made.json"
    report = made([stored(tmp_path, light), "-o", str(out), "--count", "12", "--method", word], capsys)
    expected = constellation(light, 12, method)
    directions, irradiance = read(out)
    np.testing.assert_allclose(directions, expected.directions, atol=1e-8)
    np.testing.assert_allclose(irradiance, expected.irradiance, rtol=1e-8)
    assert (report["written"], report["lights"], report["method"], report["unit"]) == ([str(out)], 12, word, "relative")
    assert report["total of the map"] == report["total of the lights"]
    assert report["total of the map"] == pytest.approx(light.total(), rel=1e-5)
    error = report["irradiance error, of the mean"]
    assert 0 < error["mean"] < error["largest"] < 0.4
    written = json.loads(out.read_text())
    assert (written["unit"], written["background"]) == ("relative", None)
    assert "angle" not in written["lights"][0]


def test_there_are_64_lights_unless_given_and_lux_where_the_map_is_calibrated(tmp_path, capsys):
    light = EnvironmentMap(lights.sunny(32).radiance, unit="cd/m²")
    report = made([stored(tmp_path, light), "-o", str(tmp_path / "made.json")], capsys)
    assert (report["lights"], report["unit"]) == (64, "cd/m²")
    assert json.loads((tmp_path / "made.json").read_text())["unit"] == "cd/m²"


def test_every_format_is_chosen_by_its_suffix_or_by_name(tmp_path, capsys):
    light = stored(tmp_path, lights.sunny(32))
    names = ["a.json", "a.usda", "a.gltf", "a.py", "a.rad", "a.xml"]
    words = [word for name in names for word in ("-o", str(tmp_path / name))]
    assert made([light, *words, "--count", "3"], capsys)["written"] == [str(tmp_path / name) for name in names]
    starts = ["{", "#usda", "{", '"""', "#", "<"]
    for name, start in zip(names, starts, strict=True):
        assert (tmp_path / name).read_text().startswith(start), name
    made([light, "-o", str(tmp_path / "b.txt"), "--format", "usd", "--count", "3"], capsys)
    assert (tmp_path / "b.txt").read_text() == (tmp_path / "a.usda").read_text()


def test_lights_and_residual_are_the_map(tmp_path, capsys):
    light, out, rest = lights.sunny(64, 400), tmp_path / "made.json", tmp_path / "maps" / "rest.exr"
    rest.parent.mkdir()
    words = [stored(tmp_path, light), "-o", out, "--count", "9", "--residual", rest, "--contrast", "3"]
    report = made(words, capsys)
    residual = as_environment(read_radiance(rest))
    _, irradiance = read(out)
    np.testing.assert_allclose(irradiance.sum(0) + residual.total(), light.total(), rtol=1e-8)
    luminance = residual.radiance @ [0.2126, 0.7152, 0.0722]
    assert luminance.max() == pytest.approx(3 * luminance.ravel() @ residual_areas(residual) / (4 * np.pi), rel=1e-5)
    assert json.loads(out.read_text())["background"] == "maps/rest.exr"
    assert report["total of the residual"] == pytest.approx(residual.total(), rel=1e-5)
    assert report["lights"] == 9


def residual_areas(residual: EnvironmentMap) -> np.ndarray:
    return residual.mapping.solid_angles(residual.size).ravel()


def test_a_sun_is_a_light_and_the_map_without_it(tmp_path, capsys):
    light, out, rest = lights.lone(64, 20, 77, 1e4, dark=1.0), tmp_path / "made.json", tmp_path / "rest.exr"
    report = made([stored(tmp_path, light), "-o", str(out), "--residual", str(rest), "--sun"], capsys)
    directions, irradiance = read(out)
    assert len(directions) == 1
    np.testing.assert_allclose(read_radiance(rest).radiance, 1.0, rtol=1e-6)
    np.testing.assert_allclose(irradiance[0] + as_environment(read_radiance(rest)).total(), light.total(), rtol=1e-8)
    assert report["suns"][0]["height"] == pytest.approx(90 - 20.5 * 180 / 64, abs=0.01)
    assert report["suns"][0]["to the right"] == pytest.approx((77.5 / 128 - 0.5) * 360, abs=0.01)
    angle = json.loads(out.read_text())["lights"][0]["angle"]
    assert np.degrees(angle) == pytest.approx(report["suns"][0]["diameter"], rel=1e-2)
    assert 2 < report["suns"][0]["diameter"] < 4  # a pixel of 2.8°


def test_a_sun_and_a_constellation_of_the_rest_carry_everything(tmp_path, capsys):
    light, out = lights.lone(64, 20, 77, 1e4, dark=1.0), tmp_path / "made.json"
    words = [stored(tmp_path, light), "--sun", "1", "--count", "9", "-o", out]
    report = made(words, capsys)
    _, irradiance = read(out)
    assert len(irradiance) == report["lights"] == 9
    np.testing.assert_allclose(irradiance.sum(0), light.total(), rtol=1e-8)
    assert [each["angle"] > 0 for each in json.loads(out.read_text())["lights"]] == [True] + [False] * 8
    made([*words, "--soft"], capsys)
    assert all(each["angle"] > 0 for each in json.loads(out.read_text())["lights"])
    # Even light has no other key.
    assert made([*words, "--residual", tmp_path / "r.exr"], capsys)["lights"] == 1


def test_fewer_suns_than_asked_are_noted(tmp_path, capsys):
    words = [stored(tmp_path, lights.lone(64, 20, 77, 1e4, dark=1.0)), "-o", str(tmp_path / "made.json")]
    assert "1 stand out" in printed(["lights", *words, "--sun", "3"], capsys).err


def test_a_clipped_sun_is_written_and_doubted(tmp_path, capsys):
    light = lights.lone(64, 20, 77, 1e4, dark=1.0)
    clipped = np.zeros((64, 128), np.uint8)
    clipped[20, 77] = SATURATED
    source, out = stored(tmp_path, EnvironmentMap(light.radiance, clipped=clipped)), tmp_path / "made.json"
    for words, doubt in (
        ([source, "--sun"], "the sun is clipped, its light a lower bound"),
        ([source], "lights there are weaker"),
        ([source, "--residual", str(tmp_path / "rest.exr")], "lights there are weaker"),
    ):
        out.unlink(missing_ok=True)
        captured = printed(["lights", *words, "-o", str(out)], capsys, 4)
        assert captured.err.count("1 pixels are clipped") == 1 and doubt in captured.err
        assert "total of the lights" in captured.out and len(read(out)[0]) == (1 if "--residual" in words else 64)
        assert doubt in printed(["lights", *words, "-o", str(out), "--accept"], capsys).err


def test_a_probe_is_read_in_the_mapping_given_and_its_residual_is_lat_long(tmp_path, capsys):
    probe = lights.sunny(64, 400).remapped(mapping_named("angular"), 64)
    write(tmp_path / "probe.exr", RadianceMap(probe.radiance))
    words = [str(tmp_path / "probe.exr"), "-o", str(tmp_path / "made.json"), "--count", "8"]
    assert "does not say its mapping" in refused(["lights", *words], capsys)
    report = made([*words, "--from", "angular"], capsys)
    assert report["total of the lights"] == pytest.approx(probe.total(), rel=1e-5)
    words = ["lights", *words, "--from", "angular", "--residual", tmp_path / "rest.exr"]
    assert "resampled to lat-long" in printed(words, capsys).err
    assert read_radiance(tmp_path / "rest.exr").attributes["mapping"] == "latlong"


def test_the_residual_of_a_cube_is_as_fine_as_it(tmp_path, capsys):
    strip = lights.sunny(64, 400).remapped(mapping_named("strip"), 32)
    words = [stored(tmp_path, strip), "-o", str(tmp_path / "made.json"), "--residual", str(tmp_path / "rest.exr")]
    assert main(["lights", *words]) == 0
    rest = as_environment(read_radiance(tmp_path / "rest.exr"))
    # 6·32² pixels on the sphere are 2·55.4².
    assert rest.radiance.shape == (56, 112, 3)


def test_the_picture_shows_map_borders_and_lights(tmp_path, capsys):
    light, out = lights.lone(32, 10, 20, 1e3, dark=1.0), tmp_path / "made.png"
    words = [stored(tmp_path, light), "-o", str(tmp_path / "made.json"), "--count", "2", "--picture", str(out)]
    assert str(out) in made(words, capsys)["written"]
    pixels = read_photograph(out).pixels.astype(int)
    assert pixels.shape[1] == 1600
    high = 800  # of the map; its caption is above
    page = pixels[-high:]
    cyan = (page[..., 0] < 60) & (page[..., 1] > 200) & (page[..., 2] > 200)
    assert 100 < cyan.sum() < 20000
    for u, v in light.mapping.image_points(constellation(light, 2).directions):
        row, column = round(v * 800), round(u * 1600)
        near = page[row - 3 : row + 4, column - 3 : column + 4]
        assert np.any((near[..., 0] > 150) & (near[..., 1] < 80))  # a cross on each light
    # The even map is middle grey.
    assert np.median(page) == pytest.approx(118, abs=4)


def test_a_dry_run_writes_nothing(tmp_path, capsys):
    out, drawn = tmp_path / "made.json", tmp_path / "a.png"
    report = made([stored(tmp_path, lights.sunny(16)), "-o", out, "--picture", drawn, "--dry-run"], capsys)
    assert report["would write"] == [str(out), str(drawn)]
    assert [path.name for path in tmp_path.iterdir()] == ["light.exr"]


@pytest.mark.parametrize(
    ("words", "report"),
    [
        (["-o", "a.obj"], "must end in .json or .usda or .gltf or .py or .rad or .xml"),
        (["-o", "a.json", "-o", "a.json"], "named twice"),
        (["-o", "a.json", "-o", "a.rad", "--format", "usd"], "format usd is for a single file"),
        (["-o", "a.json", "--count", "0"], "for --count"),
        (["-o", "a.json", "--sun", "0"], "suns are 0"),
        (["-o", "a.json", "--sun", "1", "--count", "1"], "leaves no light for the rest"),
        (["-o", "a.json", "--contrast", "3"], "needs a residual map"),
        (["-o", "a.json", "--residual", "r.exr", "--contrast", "-1"], "contrast is -1"),
        (["-o", "a.json", "--residual", "r.png"], "--residual r.png: the file must end in .exr or .hdr"),
        (["-o", "a.rad", "--residual", "r.exr"], "radiance reads .hdr backgrounds only"),
        (["-o", "a.json", "--picture", "r.exr"], "--picture r.exr: the file must end in .png"),
        (["-o", "a.json", "--from", "mercator"], "--from: "),
        (["-o", "a.json", "--sun"], "no sun stands out"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(words, report, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    stored(tmp_path, lights.constant(16), "even.exr")
    assert report in refused(["lights", "even.exr", *words], capsys)
    assert [path.name for path in tmp_path.iterdir()] == ["even.exr"]


def test_what_is_no_light_is_refused_with_its_pixels_counted(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    radiance = lights.constant(16).radiance
    radiance[3, 4:9] = -1
    write(Path("ringing.exr"), RadianceMap(radiance))
    line = refused(["lights", "ringing.exr", "-o", "a.json"], capsys)
    assert "ringing.exr: 5 pixels are negative, which is not light" in line and "--clamp sets" in line
    noted = printed(["lights", "ringing.exr", "-o", "a.json", "--clamp"], capsys).err
    assert "5 pixels were negative, the lowest -1; they are set to 0" in noted
    radiance[0, 0] = np.nan
    write(Path("holes.exr"), RadianceMap(radiance))
    line = refused(["lights", "holes.exr", "-o", "b.json", "--clamp"], capsys)
    assert "1 pixels are NaN or infinite and 5 negative" in line and "--clamp" not in line
    write(Path("black.exr"), as_radiance_map(lights.constant(16, 0.0)))
    assert "black.exr: black all over" in refused(["lights", "black.exr", "-o", "b.json"], capsys)
    assert "no such file" in refused(["lights", "none.exr", "-o", "b.json"], capsys)
    assert "no folder" in refused(["lights", "ringing.exr", "-o", "none/b.json"], capsys, 3)
    assert not Path("b.json").exists()


# Lights that have a place

LAMPS = np.array([[1.5, 2.4, -1.8], [-1.7, 2.2, -0.4], [0.4, 1.9, 1.9]])
SHINE = np.array([[9.0, 8, 6], [5, 5.5, 7], [4, 3, 2]])
PROBES = {"0,1.1,0": np.array([0, 1.1, 0]), "-0.9,1,-0.5": np.array([-0.9, 1, -0.5])}


def lamps_seen(place: np.ndarray, size: int = 128, lamps: Sequence[int] = (0, 1, 2)) -> EnvironmentMap:
    """Points of light, each over four pixels, before a dim wall."""
    ways = LAMPS[list(lamps)] - place
    square = np.sum(ways**2, axis=-1, keepdims=True)
    arrivals = zip(ways / np.sqrt(square), SHINE[list(lamps)] / square, strict=True)
    seen = splatted([Arrival(way, irradiance) for way, irradiance in arrivals], size=size)
    return replace(seen, radiance=seen.radiance + np.float32(0.05))


def in_places(folder: Path, **second) -> list[str]:
    """The words for two maps of the lamps."""
    (at, first), (other_at, other) = PROBES.items()
    one, two = stored(folder, lamps_seen(first)), stored(folder, lamps_seen(other, **second), "second.exr")
    return [one, "--at", at, "--second", two, "--second-at", other_at]


def test_lights_stand_on_the_walls_of_a_box(tmp_path, capsys):
    light, out = lights.sunny(32), tmp_path / "made.json"
    words = [stored(tmp_path, light), "--count", "12", "-o", str(out), "--at", "0,1,0", "--box", "-2,0,-3,2,2.5,3"]
    report = made(words, capsys)
    points = json.loads(out.read_text())["points"]
    expected = placed_in_box(constellation(light, 12), (0, 1, 0), ((-2, 0, -3), (2, 2.5, 3))).points
    np.testing.assert_allclose([each["position"] for each in points], expected.positions, atol=1e-8)
    np.testing.assert_allclose([each["intensity"] for each in points], expected.intensity, rtol=1e-8)
    assert "radius" not in points[0] and json.loads(out.read_text())["lights"] == []
    assert (report["lights"], report["placed"]) == (12, 12)
    assert report["total of the lights"] == report["total of the map"]
    report = made([*words, "--distant", "0", "--distant", "3"], capsys)
    assert report["placed"] == 10 and report["total of the lights"] == report["total of the map"]
    directions, irradiance = read(out)
    np.testing.assert_allclose(directions, constellation(light, 12).directions[[0, 3]], atol=1e-8)
    np.testing.assert_allclose(irradiance, constellation(light, 12).irradiance[[0, 3]], rtol=1e-8)


def test_a_sun_on_a_wall_is_as_wide_as_it_looked(tmp_path, capsys):
    light, out = lights.lone(64, 20, 77, 1e4, dark=1.0), tmp_path / "made.json"
    words = [stored(tmp_path, light), "--sun", "1", "--count", "9", "-o", str(out), "--at", "0,1,0"]
    report = made([*words, "--box", "-2,0,-3,2,2.5,3"], capsys)
    points = json.loads(out.read_text())["points"]
    reach = float(np.linalg.norm(np.subtract(points[0]["position"], (0, 1, 0))))
    assert points[0]["radius"] == pytest.approx(reach * np.sin(np.radians(report["suns"][0]["diameter"] / 2)), rel=1e-2)
    assert [each["radius"] for each in points[1:]] == [0] * 8


def test_lamps_that_two_maps_see_stand_where_they_are(tmp_path, capsys):
    out = tmp_path / "made.json"
    words = [*in_places(tmp_path), "--sun", "3", "--count", "9", "-o", str(out), "-o", str(tmp_path / "made.rad")]
    report = made(words, capsys)
    points = json.loads(out.read_text())["points"]
    for point in points:
        number = int(np.argmin(np.linalg.norm(LAMPS - point["position"], axis=-1)))
        assert point["position"] == pytest.approx(LAMPS[number], abs=0.03)
        assert point["intensity"] == pytest.approx(SHINE[number], rel=0.03)
    assert (report["placed"], report["far"], report["unmatched"]) == (3, 0, {"first": 0, "second": 0})
    for lamp, point in zip(report["lamps"], points, strict=True):
        assert lamp["position"] == pytest.approx(point["position"], rel=1e-3)
    assert report["total of the lights"] == pytest.approx(report["total of the map"], rel=0.02)
    assert len(json.loads(out.read_text())["lights"]) == 6  # the walls
    assert (tmp_path / "made.rad").read_text().count("sphere point_") == 3


def test_a_lamp_that_the_second_map_lacks_stays_distant(tmp_path, capsys):
    out = tmp_path / "made.json"
    words = [*in_places(tmp_path, lamps=(0, 1)), "--sun", "3", "-o", str(out), "--residual", str(tmp_path / "r.exr")]
    assert "1 lamps of the first map and 0 of the second have no partner" in printed(["lights", *words], capsys).err
    directions, irradiance = read(out)
    assert len(directions) == 1 and len(json.loads(out.read_text())["points"]) == 2
    way = LAMPS[2] - PROBES["0,1.1,0"]
    np.testing.assert_allclose(directions[0], way / np.linalg.norm(way), atol=0.01)
    np.testing.assert_allclose(irradiance[0], SHINE[2] / (way @ way), rtol=0.01)


@pytest.mark.parametrize(
    ("words", "report"),
    [
        (["--box", "-1,0,-1,1,2,1"], "--box is for lights that have a place; say where the map was taken with --at"),
        (["--second", "even.exr"], "--second is for lights that have a place"),
        (["--at", "0,1,0"], "by a room's --box or by a --second map; give one"),
        (["--at", "0,1", "--box", "-1,0,-1,1,2,1"], '--at: "0,1" is not of the form'),
        (["--at", "0,1,0", "--box", "-1,0,-1,1,2"], '--box: "-1,0,-1,1,2" is not of the form'),
        (["--at", "0,3,0", "--box", "-1,0,-1,1,2,1"], "the probe at [0.0, 3.0, 0.0] is not inside the box"),
        (["--at", "0,1,0", "--box", "-1,0,-1,1,2,1", "--distant", "64"], "distant lights are [64]"),
        (["--at", "0,1,0", "--second", "even.exr", "--sun", "2"], "--second and --second-at belong together"),
        (["--at", "0,1,0", "--second", "even.exr", "--second-at", "1,1,0"], "how many to look for"),
        (["--at", "0,1,0", "--second", "even.exr", "--second-at", "0,1,0", "--sun"], "stood apart"),
        (["--at", "0,1,0", "--second", "none.exr", "--second-at", "1,1,0", "--sun"], "none.exr: no such file"),
        (
            ["--at", "0,1,0", "--second", "even.exr", "--second-at", "1,1,0", "--sun", "--distant", "0"],
            "--distant is for --box",
        ),
        (["--at", "0,1.1,0", "--second", "even.exr", "--second-at", "1,1,0", "--sun"], "even.exr: no sun stands out"),
        (["--at", "0,1.1,0", "--second", "lux.exr", "--second-at", "1,1,0", "--sun"], "calibrate both or neither"),
        (
            ["--at", "0,1.1,0", "--second", "turned.exr", "--second-at", "1,1,0", "--sun", "2"],
            "turned.exr: none of 2 and 2 lamps match",
        ),
    ],
)
def test_places_that_cannot_be_are_refused_in_one_line(words, report, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    light = lamps_seen(PROBES["0,1.1,0"], 64)
    stored(tmp_path, light)
    stored(tmp_path, light.rotated(rotation_about((1, 1, 0), 2)), "turned.exr")
    stored(tmp_path, lights.constant(16), "even.exr")
    stored(tmp_path, EnvironmentMap(lights.constant(16).radiance, unit="cd/m²"), "lux.exr")
    assert report in refused(["lights", "light.exr", "-o", "a.json", *words], capsys)
    assert not (tmp_path / "a.json").exists()


def test_a_folder_of_maps_becomes_a_file_of_the_same_lights_for_each(tmp_path, capsys):
    maps, out = tmp_path / "maps", tmp_path / "lights.json"
    maps.mkdir()
    for number, brighter in enumerate((1, 2)):
        write(maps / f"map_{number}.exr", RadianceMap(brighter * lights.spiky(16).radiance.astype(np.float32)))
    facts = made([maps, "-o", out, "--count", 6], capsys)
    assert (facts["maps"], facts["lights"]) == (2, 6)
    (towards, first), (later, second) = (read(tmp_path / f"lights_00000{number}.json") for number in (1, 2))
    assert not out.exists()
    # Light for light: the map only became twice as bright.
    np.testing.assert_allclose(later, towards, atol=0.02)
    np.testing.assert_allclose(second, 2 * first, rtol=0.05)
    assert "of a single map" in refused(["lights", maps, "-o", out, "--sun"], capsys)
    assert "of a single map" in refused(["lights", maps, "-o", out, "--picture", tmp_path / "a.png"], capsys)

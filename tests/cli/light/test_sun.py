"""`relume sun`: a clipped sun given back by a grey ball or a chart, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from command_line import printed, refused, reported
from lights import sunny
from relume.cli import main
from relume.image.files import read_radiance, write
from relume.image.radiance import BLACK, OUTSIDE, SATURATED, RadianceMap
from relume.sphere.directions import normalised
from relume.sphere.environment_files import as_environment, as_radiance_map
from relume.sphere.environment_map import EnvironmentMap

TRUTH = sunny(64, sun=4000)
PATCHES = {
    "30,30,8=0.9": (0.7, 0.3, -0.65),
    "70,30,8=0.5,0.4,0.3": (0, 1, 0),
    "30,70,8=0.2": (1, 0.2, 0),
    "70,70,8=0.6": (-0.7, 0, 0.6),
}


def scene(folder: Path, brighter: float = 1.0) -> tuple[str, list[str]]:
    """The clipped map, and a chart whose four patches face four ways, the last away from the sun, as options."""
    write(folder / "map.exr", as_radiance_map(EnvironmentMap(np.minimum(TRUTH.radiance, 20))))
    chart = np.zeros((100, 100, 3), np.float32)
    options = ["--chart", str(folder / "chart.exr")]
    for word, normal in PATCHES.items():
        place, reflectance = word.split("=")
        x, y, _ = map(int, place.split(","))
        irradiance = TRUTH.irradiance(normalised(normal))
        chart[y - 10 : y + 10, x - 10 : x + 10] = (
            brighter * irradiance * np.array(reflectance.split(","), float) / np.pi
        )
        options += ["--patch", f"{word}@{','.join(map(str, normal))}"]
    write(folder / "chart.exr", RadianceMap(chart))
    return str(folder / "map.exr"), options


def test_a_chart_gives_the_sun_back_and_the_file_says_so(tmp_path, capsys):
    source, options = scene(tmp_path)
    out = tmp_path / "out.exr"
    report = reported(["sun", source, "-o", str(out), *options, "--level", "19.9"], capsys)
    written = read_radiance(out)
    for normal in (*PATCHES.values(), (0.2, 0.5, -0.9)):
        there = as_environment(written).irradiance(normalised(normal))
        np.testing.assert_allclose(there, TRUTH.irradiance(normalised(normal)), rtol=0.02)
    assert min(report["sources"][0]["factor"]) > 1.5
    assert written.attributes["sun_recovered"].startswith("from ")
    assert report["after"]["total"][0] > 1.2 * report["before"]["total"][0]


def test_a_chart_that_is_brighter_everywhere_is_doubtful(tmp_path, capsys):
    source, options = scene(tmp_path, brighter=2.5)
    out = tmp_path / "out.exr"
    words = ["sun", source, "-o", str(out), *options, "--level", "19.9"]
    assert "is the reflectance right" in printed(words, capsys, 4).err and out.is_file()
    assert main([*words, "--accept"]) == 0


def test_a_patch_that_was_not_measured_is_not_believed(tmp_path, capsys):
    source, options = scene(tmp_path)
    picture, chart, out = read_radiance(tmp_path / "chart.exr"), tmp_path / "chart.exr", tmp_path / "out.exr"
    words = ["sun", source, "-o", str(out), *options, "--level", "19.9"]
    unclipped = reported(words, capsys)["sources"]
    for code in (SATURATED, BLACK, OUTSIDE):
        clipped = np.zeros((100, 100), np.uint8)
        clipped[20:30, 20:40] = code
        write(chart, replace(picture, clipped=clipped))
        line = refused(words, capsys)
        assert "at (30, 30) of radius 8" in line and "104 of its 208 pixels are saturated, black or not seen" in line
    # One pixel of dust is left out.
    clipped = np.zeros((100, 100), np.uint8)
    clipped[30, 30] = SATURATED
    dusty = picture.radiance.copy()
    dusty[30, 30] = 1e6
    write(chart, replace(picture, radiance=dusty, clipped=clipped))
    assert reported(words, capsys)["sources"] == unclipped


def test_black_patches_and_bad_normals_are_refused(tmp_path, capsys):
    source, options = scene(tmp_path)
    words = ["sun", source, "-o", str(tmp_path / "out.exr"), *options[:2], "--level", "19.9", "--patch"]
    assert "at (50, 50) of radius 6: black all over" in refused([*words, "50,50,6=0.9@0,1,0"], capsys)
    assert "a normal is a direction" in refused([*words, "30,30,8=0.9@0,0,0"], capsys)
    assert "is not of the form" in refused([*words, "30,30,8=0.9@nan,1,0"], capsys)
    assert "reaches out of" in refused([*words, "5,30,8=0.9@0,1,0"], capsys)
    assert "reaches out of" in refused([*words, "70,95,8=0.9@0,1,0"], capsys)


def test_a_camera_may_stand_at_negative_places(tmp_path, capsys):
    source, _ = scene(tmp_path)
    write(tmp_path / "flat.exr", RadianceMap(np.ones((60, 80, 3), np.float32)))
    words = ["sun", source, "-o", str(tmp_path / "out.exr"), "--grey-ball", str(tmp_path / "flat.exr")]
    words += ["--albedo", "0.18", "--camera", "-1,0.2,0"]
    printed([*words, "--pick", "-5,30,20", "--dry-run"], capsys)
    assert "ball found" in refused(words, capsys)


def test_wrong_words_are_refused_in_one_line(tmp_path, capsys):
    source, options = scene(tmp_path)
    out = str(tmp_path / "out.exr")
    assert "--grey-ball with --albedo, or --chart" in refused(["sun", source, "-o", out], capsys)
    assert "needs its --albedo" in refused(["sun", source, "-o", out, "--grey-ball", source], capsys)
    assert "needs a --patch" in refused(["sun", source, "-o", out, *options[:2]], capsys)
    wrong = [*options[:2], "--patch", "30,30,8=white"]
    assert "not of the form X,Y,RADIUS=REFLECTANCE@NX,NY,NZ" in refused(["sun", source, "-o", out, *wrong], capsys)
    beside = [*options[:2], "--patch", "900,30,8=0.9@0,1,0"]
    assert "fewer than four pixels" in refused(["sun", source, "-o", out, *beside], capsys)
    write(tmp_path / "flat.exr", RadianceMap(np.ones((60, 80, 3), np.float32)))
    flat = ["--grey-ball", str(tmp_path / "flat.exr"), "--albedo", "0.18"]
    assert "ball found" in refused(["sun", source, "-o", out, *flat], capsys)

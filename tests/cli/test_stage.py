"""`relume stage`: importing, relighting, looking, and what is refused, on a ball whose pictures are known."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

from command_line import printed, refused, reported
from relume.cli import main
from relume.image.files import read_layers, read_photograph, read_radiance, write
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.lightstage.relighting.voronoi_cells import even_directions
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap
from small_stages import ALBEDO, LIGHTS, SIZE, lit, normals, write_stage


@pytest.fixture(scope="module")
def stage(tmp_path_factory) -> Path:
    return write_stage(tmp_path_factory.mktemp("stage") / "ball")


@pytest.fixture(scope="module")
def even(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("light") / "even.exr"
    write(path, as_radiance_map(EnvironmentMap(np.ones((32, 64, 3), np.float32))))
    return path


@pytest.fixture(scope="module")
def lamp(tmp_path_factory) -> Path:
    radiance = np.full((32, 64, 3), 0.2, np.float32)
    radiance[4:8, 10:20] = 20
    path = tmp_path_factory.mktemp("lamp") / "lamp.exr"
    write(path, as_radiance_map(EnvironmentMap(radiance)))
    return path


def test_a_ball_under_even_light_shows_its_albedo(stage, even, tmp_path):
    assert main(["stage", "relight", str(stage), "--light", str(even), "-o", str(tmp_path / "a.exr")]) == 0
    seen = read_radiance(tmp_path / "a.exr").radiance[SIZE[1] // 2, SIZE[0] // 2]
    # 24 lights sample the cosine lobe coarsely.
    np.testing.assert_allclose(seen, ALBEDO, rtol=0.05)


def test_a_light_of_the_stage_gives_its_own_picture(stage, tmp_path):
    towards = ",".join(str(v) for v in even_directions(LIGHTS)[4])
    assert main(["stage", "relight", str(stage), "--direction", f"{towards}=2", "-o", str(tmp_path / "a.exr")]) == 0
    expected = 2 * lit(even_directions(LIGHTS)[4])
    np.testing.assert_allclose(read_radiance(tmp_path / "a.exr").radiance, expected, atol=1e-5)


def test_lights_given_together_are_summed(stage, even, tmp_path):
    pictures = []
    for options in (["--light", str(even)], ["--lamp", "0,2,1=3"], ["--light", str(even), "--lamp", "0,2,1=3"]):
        assert main(["stage", "relight", str(stage), *options, "-o", str(tmp_path / "a.exr")]) == 0
        pictures.append(read_radiance(tmp_path / "a.exr").radiance)
    np.testing.assert_allclose(pictures[2], pictures[0] + pictures[1], atol=1e-6)


def test_a_store_relights_as_its_folder_does(stage, tmp_path, capsys):
    pytest.importorskip("zarr", reason="stores need the extra lightstage")
    store = tmp_path / "ball.zarr"
    assert main(["stage", "import", str(stage), "-o", str(store), "--dtype", "float"]) == 0
    for source, name in ((stage, "a.exr"), (store, "b.exr")):
        assert main(["stage", "relight", str(source), "--direction", "1,1,2", "-o", str(tmp_path / name)]) == 0
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_a_card_in_the_pictures_takes_the_lights_differences_out(stage, tmp_path):
    pytest.importorskip("zarr", reason="stores need the extra lightstage")
    uneven = tmp_path / "uneven"
    uneven.mkdir()
    text = json.loads((stage / "stage.json").read_text())
    colours = np.random.default_rng(2).uniform(0.5, 2, (LIGHTS, 3)).astype(np.float32)
    for light, colour in zip(text["lights"], colours, strict=True):
        picture = read_radiance(stage / light["file"]).radiance * colour
        # A white card that faces the camera, in the upper left corner.
        picture[:4, :4] = max(light["direction"][2], 0) / np.pi * colour
        write(uneven / light["file"], RadianceMap(picture.astype(np.float32)))
    (uneven / "stage.json").write_text(json.dumps(text))
    store = tmp_path / "even.zarr"
    command = ["stage", "import", str(uneven), "-o", str(store), "--target", "0,0,4,4=1", "--dtype", "float"]
    assert main(command) == 0
    index = int(np.argmax([light["direction"][2] for light in text["lights"]]))
    towards = ",".join(str(v) for v in text["lights"][index]["direction"])
    assert main(["stage", "relight", str(store), "--direction", towards, "-o", str(tmp_path / "a.exr")]) == 0
    seen = read_radiance(tmp_path / "a.exr").radiance
    expected = lit(np.array(text["lights"][index]["direction"]))
    ball = normals().any(axis=-1)
    np.testing.assert_allclose(seen[ball].mean(axis=0), expected[ball].mean(axis=0), rtol=0.01)


def test_frames_turn_the_light_right_handed(stage, tmp_path):
    radiance = np.full((32, 64, 3), 0.01, np.float32)
    radiance[14:18, 30:34] = 50  # ahead of the camera, behind the ball
    write(tmp_path / "lamp.exr", as_radiance_map(EnvironmentMap(radiance)))
    command = ["stage", "relight", str(stage), "--light", str(tmp_path / "lamp.exr"), "--frames", "4"]
    assert main([*command, "-o", str(tmp_path / "turn")]) == 0
    left = read_radiance(tmp_path / "turn" / "frame_0002.exr").radiance
    front = read_radiance(tmp_path / "turn" / "frame_0003.exr").radiance
    right = read_radiance(tmp_path / "turn" / "frame_0004.exr").radiance
    half = SIZE[0] // 2
    assert left[:, :half].mean() > 3 * left[:, half:].mean()
    assert right[:, half:].mean() > 3 * right[:, :half].mean()
    assert front.mean() > left.mean()


def test_inspect_says_what_there_is_and_draws_a_page(stage, even, tmp_path, capsys):
    assert reported(["stage", "inspect", str(stage)], capsys)["lights"] == LIGHTS
    out = tmp_path / "report"
    assert main(["stage", "inspect", str(stage), "-o", str(out), "--light", str(even), "--functions", "3x4"]) == 0
    assert "Turn the light" in (out / "report.html").read_text("utf-8")
    assert (out / "mosaic.exr").is_file()


def test_separate_maps_the_balls_normals_and_albedo(stage, tmp_path):
    assert main(["stage", "separate", str(stage), "-o", str(tmp_path / "maps")]) == 0
    layers = read_layers(tmp_path / "maps" / "maps.exr")
    middle = SIZE[1] // 2, SIZE[0] // 2
    np.testing.assert_allclose(layers["albedo"][middle], ALBEDO, rtol=0.05)
    np.testing.assert_allclose(layers["normal"][middle], normals()[middle], atol=0.05)
    assert read_photograph(tmp_path / "maps" / "normal.png").pixels.shape == (SIZE[1], SIZE[0], 3)


def test_drive_writes_a_line_for_every_lamp(stage, even, tmp_path):
    assert main(["stage", "drive", str(stage), "--light", str(even), "-o", str(tmp_path / "drive.csv")]) == 0
    lines = [line for line in (tmp_path / "drive.csv").read_text("utf-8").splitlines() if line[:1] != "#"]
    assert len(lines) == LIGHTS + 1


def test_export_writes_what_museums_read(stage, tmp_path, capsys):
    assert "behind the subject" in printed(["stage", "export", str(stage), "-o", str(tmp_path / "rti")], capsys).err
    assert (tmp_path / "rti" / "stage.ptm").read_bytes().startswith(b"PTM_1.2")
    assert (tmp_path / "rti" / "stage.rti").is_file()
    assert main(["stage", "relight", str(tmp_path / "rti"), "--direction", "0,0,1", "-o", str(tmp_path / "a.png")]) == 0


def test_clothe_tints_what_white_adds_to_black(tmp_path):
    black, white = np.full((9, 8, 3), 0.1, np.float32), np.full((9, 8, 3), 0.9, np.float32)
    for name, picture in (("black", black), ("white", white)):
        write(tmp_path / f"{name}.exr", RadianceMap(picture))
    command = ["stage", "clothe", str(tmp_path / "black.exr"), str(tmp_path / "white.exr"), "--albedo", "0.4,0.2,0.6"]
    options = ["--white-albedo", "0.8", "--black-albedo", "0", "-o", str(tmp_path / "a.exr")]
    assert main([*command, *options]) == 0
    np.testing.assert_allclose(read_radiance(tmp_path / "a.exr").radiance[4, 4], [0.5, 0.3, 0.7], rtol=1e-6)


def test_clothe_makes_a_store_of_two_stages_that_is_relit(stage, tmp_path):
    pytest.importorskip("zarr", reason="stores need the extra lightstage")
    black = tmp_path / "black"
    black.mkdir()
    (black / "stage.json").write_bytes((stage / "stage.json").read_bytes())
    for path in stage.glob("*.exr"):
        write(black / path.name, RadianceMap(read_radiance(path).radiance * np.float32(0.5)))
    command = ["stage", "clothe", str(black), str(stage), "--albedo", "0.4,0.2,0.8", "--white-albedo", "0.8"]
    assert main([*command, "--black-albedo", "0", "-o", str(tmp_path / "a.zarr")]) == 0
    towards = ",".join(str(v) for v in even_directions(LIGHTS)[4])
    command = ["stage", "relight", str(tmp_path / "a.zarr"), "--direction", towards, "-o", str(tmp_path / "a.exr")]
    assert main(command) == 0
    # Tints of 1/2, 1/4 and 1 between half the light and all of it.
    expected = lit(even_directions(LIGHTS)[4]) * [0.75, 0.625, 1.0]
    np.testing.assert_allclose(read_radiance(tmp_path / "a.exr").radiance, expected, rtol=2e-3, atol=1e-5)


def test_clothe_refuses_a_stage_beside_a_picture(stage, even, tmp_path, capsys):
    command = ["stage", "clothe", stage / "stage.json", even, "--albedo", "0.4", "-o", tmp_path / "a.exr"]
    assert "two stages, or two radiance maps" in refused(command, capsys)


def test_labels_choose_the_light_of_each_pixel(stage, even, lamp, tmp_path):
    grey = np.full((SIZE[1], SIZE[0], 3), 60, np.uint8)
    grey[:, SIZE[0] // 2 :] = 200
    write(tmp_path / "leaves.png", Photograph(grey))
    both = ["--light", str(even), "--light", str(lamp), "--labels", str(tmp_path / "leaves.png")]
    pictures = []
    for options in (["--light", str(even)], ["--light", str(lamp)], both):
        assert main(["stage", "relight", str(stage), *options, "-o", str(tmp_path / "a.exr")]) == 0
        pictures.append(read_radiance(tmp_path / "a.exr").radiance)
    first, second, seen = pictures
    assert np.abs(first - second).max() > 0.1
    np.testing.assert_allclose(seen, np.where(grey < 100, first, second), rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("way", ["cosine", "low-rank"])
def test_compressed_frames_differ_by_no_more_than_is_said(way, stage, lamp, tmp_path, capsys):
    turn = ["stage", "relight", str(stage), "--light", str(lamp), "--frames", "3"]
    assert main([*turn, "-o", str(tmp_path / "exact")]) == 0
    line = printed([*turn, "--compressed", way, "-o", str(tmp_path / "small")], capsys).err
    everywhere, one = (float(share) / 100 for share in re.findall(r"([\d.]+)% under", line))
    assert everywhere < 0.02
    for index in range(1, 4):
        name = f"frame_{index:04d}.exr"
        exact, small = (read_radiance(tmp_path / place / name).radiance for place in ("exact", "small"))
        error = np.linalg.norm(small - exact) / np.linalg.norm(exact)
        assert 0 < error < min(one, 0.05)


def test_a_dry_run_says_memory_and_time_and_writes_nothing(stage, even, tmp_path, capsys):
    command = ["stage", "relight", str(stage), "--light", str(even), "-o", str(tmp_path / "a.exr")]
    facts = reported([*command, "--dry-run"], capsys)
    assert facts["lights"] == LIGHTS and "memory" in facts and "seconds, about" in facts
    assert not (tmp_path / "a.exr").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "no light"),
        (["--direction", "0,0,0"], "points somewhere"),
        (["--direction", "up"], "--direction"),
        (["--lamp", "0,0,1=a"], "--lamp"),
        (["--light", "nothing.exr"], "no such file"),
        (["--direction", "0,1,0", "--frames", "8"], "--light alone"),
        (["--direction", "0,1,0", "--labels", "leaves.png"], "--labels chooses"),
        (["--direction", "0,1,0", "--compressed", "cosine"], "for sequences"),
        (["--direction", "0,1,0", "--max-memory", "much"], "--max-memory"),
        (["--direction", "0,1,0", "--size", "200"], "--size"),
        (["--direction", "0,1,0", "--camera", "left"], 'camera "left"'),
    ],
)
def test_relight_refuses_in_one_line(stage, options, said, tmp_path, capsys):
    out = tmp_path / ("turn" if "--frames" in options else "a.exr")
    assert said in refused(["stage", "relight", str(stage), *options, "-o", str(out)], capsys)
    assert not out.exists()


def test_a_new_view_has_a_size_and_its_light_another(stage, tmp_path, capsys):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    command = ["stage", "view", stage, "--mesh", tmp_path / "a.obj", "--position", "1,0,4", "--lamp", "0,2,2"]
    command += ["-o", tmp_path / "a.exr", "--dry-run"]
    assert reported(command, capsys)["size"] == list(SIZE)
    assert reported([*command, "--picture-size", "40x30", "--size", "5"], capsys)["size"] == [40, 30]
    assert "--size is 200" in refused([*command, "--size", "200"], capsys)
    assert "--size" in refused([*command, "--size", "40x30"], capsys)


def test_what_no_camera_saw_is_said_once(stage, tmp_path, capsys):
    trimesh.creation.icosphere(3).export(tmp_path / "ball.obj")
    command = ["stage", "view", stage, "--mesh", tmp_path / "ball.obj", "--lamp", "0,2,2", "-o", tmp_path / "a.exr"]
    for position in ("4,0,0", "1,0,4"):  # much of the ball, and a little
        assert printed([*command, "--position", position], capsys).err.count("of what the new view shows") == 1


def broken(folder: Path, what: str) -> Path:
    """A stage with one thing wrong."""
    write_stage(folder, 6)
    text = json.loads((folder / "stage.json").read_text())
    if what == "missing":
        (folder / "light_03.exr").unlink()
    elif what == "two sizes":
        write(folder / "light_03.exr", RadianceMap(np.ones((9, 9, 3), np.float32)))
    elif what == "no direction":
        del text["lights"][2]["direction"]
    elif what == "dark":
        write(folder / "light_03.exr", RadianceMap(np.zeros((SIZE[1], SIZE[0], 3), np.float32)))
    elif what == "negative":
        write(folder / "light_03.exr", RadianceMap(np.full((SIZE[1], SIZE[0], 3), -1, np.float32)))
    elif what == "twice":
        text["lights"][1]["direction"] = text["lights"][2]["direction"]
    elif what == "none":
        (folder / "stage.json").unlink()
        return folder
    (folder / "stage.json").write_text(json.dumps(text))
    return folder


@pytest.mark.parametrize(
    ("what", "said"),
    [
        ("missing", "light_03.exr"),
        ("two sizes", "9×9"),
        ("no direction", "direction"),
        ("dark", "light_03.exr"),
        ("negative", "negative"),
        ("twice", "one direction"),
        ("none", "add stage.json or an .lp"),
    ],
)
def test_a_stage_with_something_wrong_is_refused_in_one_line(what, said, tmp_path, capsys):
    command = ["stage", "relight", str(broken(tmp_path / "bad", what)), "--direction", "0,0,1"]
    assert said in refused([*command, "-o", str(tmp_path / "a.exr")], capsys)
    assert not (tmp_path / "a.exr").exists()


def test_a_command_that_is_none_is_refused_in_one_line(capsys):
    assert "relume stage --help" in refused(["stage", "relit"], capsys)


def test_a_folder_of_maps_drives_a_stage_by_a_table(stage, tmp_path, capsys):
    maps = tmp_path / "maps"
    maps.mkdir()
    for number in range(3):
        light = EnvironmentMap(np.full((8, 16, 3), 1 + number, np.float32))
        write(maps / f"m_{number}.exr", as_radiance_map(light))
    command = ["stage", "drive", str(stage), "--light", str(maps), "--json"]
    assert main([*command, "-o", str(tmp_path / "t.csv")]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["frames"] == 3 and facts["headroom"] is None
    lines = (tmp_path / "t.csv").read_text().splitlines()
    assert lines[0] == "frame,light,red,green,blue" and len(lines) == 1 + 3 * facts["lights"]
    assert main([*command, "-o", str(tmp_path / "t.json")]) == 2
    single = ["stage", "drive", str(stage), "--light", str(maps / "m_0.exr"), "-o", str(tmp_path / "s.csv")]
    assert main([*single, "--smoothing", "2"]) == 2 and not (tmp_path / "s.csv").exists()


def test_a_strobe_film_is_relit(tmp_path, capsys):
    (tmp_path / "film").mkdir()
    (tmp_path / "lamps.txt").write_text("0 0 1\n1 0 1\n-1 0 1\n0 1 1\n")
    for number in range(12):
        pixels = np.full((24, 24, 3), 0.2 + 0.1 * (number % 4), np.float32)
        write(tmp_path / "film" / f"f{number}.exr", RadianceMap(pixels))
    command = ["stage", "perform", str(tmp_path / "film"), "--lamps", str(tmp_path / "lamps.txt"), "--nearest"]
    command += ["--direction", "1,0,1", "--json"]
    assert main([*command, "-o", str(tmp_path / "out")]) == 0
    assert json.loads(capsys.readouterr().out)["pictures"] == 6
    np.testing.assert_allclose(read_radiance(tmp_path / "out" / "frame_0003.exr").radiance, 0.3, rtol=1e-3)
    (tmp_path / "maps").mkdir()
    for number in range(5):
        light = EnvironmentMap(np.full((8, 16, 3), 1 + number, np.float32))
        write(tmp_path / "maps" / f"m_{number}.exr", as_radiance_map(light))
    changing = [*command[:-3], "--json", "--light", str(tmp_path / "maps"), "-o", str(tmp_path / "b")]
    assert main(changing) == 2
    assert "5 lights for the 6 frames" in capsys.readouterr().err and not (tmp_path / "b").exists()
    assert main([*command, "-o", str(tmp_path / "b"), "--film-start", "1"]) == 2
    assert "2.75 periods of 4" in capsys.readouterr().err and not (tmp_path / "b").exists()

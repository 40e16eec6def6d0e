"""`relume probe`: every form of input, what it writes, and one line for whatever cannot be."""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from command_line import printed, refused, reported
from relume.cli import main
from relume.errors import WRONG, warn
from relume.image.colour import encode_srgb
from relume.image.files import read_layers, read_photograph, read_radiance, write
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import OUTSIDE, SATURATED, RadianceMap
from relume.probe.ball.blending import Probe
from relume.probe.ball.probing import BallProbe, rim_doubts
from relume.probe.ball.silhouette import outline_of_circle
from relume.probe.ball.unwrapping import BallView, unwrap_ball
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, pixel_directions
from synthetic import CENTRE, lobes, photograph_ball

FRONT, SIDE = np.array([0.0, 0.17, 1.0]), np.array([1.0, 0.17, 0.0])
PLACE = ["--camera", "0,0.12,1", "--radius", "0.05", "--size", "48"]
RIM = ["--pick", "70,70,62.63", "--pick-exactly"]
"""Of the balls in `folder`, for what is not about how they are found: the search takes longer than all else."""


def ball(camera: np.ndarray, light=lobes, **more: Any) -> RadianceMap:
    size: dict[str, Any] = {"width": 140, "height": 140, "focal_length": 1260.0} | more
    return photograph_ball(light, camera, **size)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Radiance maps front.exr and side.exr, each in a folder as well, a photograph, and pictures that cannot be."""
    made = tmp_path_factory.mktemp("balls")
    for name, camera in (("front", FRONT), ("side", SIDE)):
        picture = ball(camera)
        write(made / f"{name}.exr", picture)
        (made / name).mkdir()
        write(made / name / "map.exr", picture)
    front = ball(FRONT).radiance
    write(made / "front.png", Photograph(np.rint(255 * encode_srgb(np.clip(front, 0, 1))).astype(np.uint8)))
    write(made / "empty.exr", RadianceMap(np.full((120, 120, 3), 0.3, np.float32)))
    write(made / "cut.exr", RadianceMap(np.ascontiguousarray(front[:, 32:])))
    write(made / "two.exr", RadianceMap(np.concatenate([front, front], axis=1)))
    (made / "nothing").mkdir()
    return made


def test_a_lone_view_writes_its_confidence_and_marks_what_it_did_not_see(folder, tmp_path, capsys):
    out = tmp_path / "lone.exr"
    facts = reported(["probe", str(folder / "front.exr"), "-o", str(out), *PLACE], capsys)
    layers = read_layers(out)
    assert set(layers) == {"radiance", "clipped", "confidence"}
    found = read_radiance(out)
    assert found.attributes["mapping"] == "latlong" and found.clipped is not None
    unseen = found.clipped == OUTSIDE
    assert unseen.any() and np.all(layers["confidence"][unseen] == 0) and layers["confidence"].max() <= 1
    assert facts["unseen sr"] > 0.1
    assert facts["balls"][0]["radius"] == pytest.approx(62.63, abs=0.15)


def test_folders_are_views_whose_turns_are_found(folder, tmp_path, capsys):
    out = tmp_path / "both.exr"
    facts = reported(
        ["probe", str(folder / "front"), str(folder / "side"), "-o", str(out), *PLACE, *RIM, *RIM[:2]], capsys
    )
    assert facts["camera places given"] is False
    # A quarter of a pixel of this ball of 63 turns what it mirrors by 0.5°; finer ones are in the probe's own tests.
    assert [float(turn.rstrip("°")) for turn in facts["turns found"]] == pytest.approx([0, 90], abs=0.6)
    assert "unseen sr" not in facts


@pytest.mark.slow
def test_turns_are_reported_in_degrees_and_views_by_pattern(folder, tmp_path, capsys):
    views = ["--view", str(folder / "fron?.exr"), "--view", str(folder / "side.exr")]
    out = tmp_path / "dim.hdr"
    facts = reported(["probe", *views, "--turn", "0,90", "-o", str(out), *PLACE], capsys)
    assert facts["camera places given"] is True
    assert float(facts["turned by registration"][1].rstrip("°")) < 0.6  # as above
    second = ["probe", str(folder / "front.exr"), "--second", str(folder / "side.exr"), "--second-camera", "1,0.12,0"]
    again = reported([*second, "-o", str(out), *PLACE], capsys)
    assert again["total"] == pytest.approx(facts["total"], rel=1e-3)


@pytest.mark.slow
def test_a_turn_misreported_is_doubtful_and_written(folder, tmp_path, capsys):
    words = ["probe", str(folder / "front.exr"), str(folder / "side.exr"), "--turn", "0,140", *PLACE]
    out = tmp_path / "doubtful.exr"
    line = printed([*words, "-o", str(out), "-q"], capsys, 4).err
    assert "view 2 of the ball does not fit the first one" in line and out.is_file()
    assert "registration turned it by" in line and "--camera X,Y,Z" in line and "without --turn" in line
    assert main([*words, "-o", str(out), "-q", "--accept"]) == 0


def test_one_photograph_is_light_as_far_as_it_is_not_clipped(folder, tmp_path, capsys):
    out = tmp_path / "single.exr"
    # A third of what it shows is white: that light is a lower bound, which makes it wrong and not a little worse.
    said = printed(["probe", str(folder / "front.png"), "-o", str(out), *PLACE, *RIM], capsys, 4).err
    assert "one photograph, assumed to be sRGB" in said and "saturated in every photograph" in said
    found, whole = read_radiance(out), tmp_path / "whole.exr"
    assert main(["probe", str(folder / "front.exr"), "-o", str(whole), *PLACE, *RIM, "-q"]) == 0
    true = read_radiance(whole)
    assert found.clipped is not None and np.any(found.clipped == SATURATED)
    measured = (found.clipped == 0) & (true.radiance.max(-1) < 0.8) & (true.radiance.min(-1) > 0.1)
    assert measured.mean() > 0.2
    np.testing.assert_allclose(found.radiance[measured], true.radiance[measured], rtol=0.05)


def test_the_reflectance_is_divided_out(folder, tmp_path, capsys):
    words = ["probe", str(folder / "front.exr"), "-o", str(tmp_path / "out.exr"), *PLACE, *RIM]
    plain = reported(words, capsys)
    half = reported([*words, "--reflectance", "0.5", "--no-fresnel"], capsys)
    rising = reported([*words, "--reflectance", "0.5"], capsys)
    assert half["total"] == pytest.approx([2 * t for t in plain["total"]], rel=1e-3)
    assert plain["total"][0] < rising["total"][0] < half["total"][0]


def test_a_ball_may_be_picked(folder, tmp_path, capsys):
    words = ["probe", str(folder / "cut.exr"), "-o", str(tmp_path / "out.exr"), *PLACE]
    assert "cuts off" in refused(words, capsys)
    exact = reported([*words, "--pick", "38,70,63", "--pick-exactly"], capsys)
    assert exact["balls"][0] | {"radii away": 0} == {"x": 38.0, "y": 70.0, "radius": 63.0, "radii away": 0}
    points = reported([*words, "--pick", "100.6,70,38,7.4,38,132.6"], capsys)
    assert points["balls"][0]["x"] == pytest.approx(38, abs=0.3)
    assert points["balls"][0]["radius"] == pytest.approx(62.63, abs=0.3)


def test_an_unknown_distance_is_reported(folder, tmp_path, capsys):
    words = ["probe", str(folder / "front.exr"), "-o", str(tmp_path / "out.exr"), "--size", "16", *RIM]
    assert "distance in ball radii is unknown; 20 are taken" in printed(words, capsys).err
    said = printed([*words, "--radius", "0.05", "--distance", "0.5"], capsys)
    assert "is unknown" not in said.err and "radii away 10" in said.out


def test_the_rim_is_drawn_on_every_view(folder, tmp_path, capsys):
    drawn = tmp_path / "rim.png"
    words = ["probe", str(folder / "front.exr"), "-o", str(tmp_path / "out.exr"), *PLACE]
    facts = reported([*words, "--picture", str(drawn)], capsys)
    assert facts["picture"] == str(drawn)
    pixels = read_photograph(drawn).pixels.astype(int)
    # The rim's blue-green; nothing of the ball is of it. 690 pixels show the whole picture of 140 by 140.
    rim = (pixels[..., 2] - pixels[..., 0] > 200) & (pixels[..., 1] > 200)
    assert rim.sum() > 1000
    rows, columns = np.nonzero(rim)
    assert np.ptp(rows) == pytest.approx(np.ptp(columns), abs=4)
    assert np.ptp(rows) == pytest.approx(690 * 2 * 62.63 / 140, rel=0.02)


def test_a_rim_that_may_be_another_is_doubtful(folder, tmp_path, capsys):
    # A bright curve inside the rim, round most of it, as walls and lamps draw it.
    picture = ball(FRONT)
    y, x = np.mgrid[:140, :140] + 0.5
    inner = np.abs(np.hypot(x - 70, y - 71) - 59.5) < 1
    light = np.where(inner[..., None], 3 * picture.radiance, picture.radiance).astype(np.float32)
    write(tmp_path / "banded.exr", RadianceMap(light))
    words = ["probe", str(tmp_path / "banded.exr"), "-o", str(tmp_path / "out.exr"), *PLACE]
    line = printed([*words, "-q"], capsys, 4).err
    assert "is seen about as well" in line and "--picture" in line and "--pick" in line
    assert main([*words, "-q", "--pick", "70,70,63"]) == 0


def test_rims_that_are_much_alike_are_a_small_doubt():
    def rival(x: float, y: float, radius: float) -> float:
        outline = replace(outline_of_circle(70, 70, 60), rivals=((x, y, radius),))
        (doubt,) = rim_doubts(cast(BallView, SimpleNamespace(outline=outline)), "ball.jpg")
        return doubt.effect or 0.0

    assert rival(71.2, 70.0, 60.0) == pytest.approx(2 * 0.02)
    assert rival(70.0, 70.0, 58.8) == pytest.approx(2 * 0.02, rel=0.02)
    assert rival(70.0, 72.0, 60.0) == WRONG
    assert rival(70.0, 70.0, 45.0) == pytest.approx(0.5)


def test_a_small_rim_of_which_little_is_seen_is_a_doubt_unless_it_was_picked():
    def doubts(radius: float, coverage: float, picked: bool = False):
        outline = replace(outline_of_circle(20, 20, radius), coverage=coverage)
        return rim_doubts(cast(BallView, SimpleNamespace(outline=outline)), "ball.jpg", picked=picked)

    (doubt,) = doubts(19.1, 0.38)
    assert doubt.effect == WRONG and "no more than 38 % of so small a rim is seen" in doubt.line
    assert doubts(19.1, 0.53) == doubts(30, 0.38) == doubts(19.1, 0.38, picked=True) == []
    # A rival beside it, which makes little of a doubt, does not hide this one.
    near = replace(outline_of_circle(20, 20, 19.1), coverage=0.38, rivals=((20.2, 20.0, 19.1),))
    effects = [each.effect for each in rim_doubts(cast(BallView, SimpleNamespace(outline=near)), "ball.jpg")]
    assert effects == [pytest.approx(2 * 0.2 / 19.1), WRONG]


def test_of_a_rim_of_which_little_is_seen_the_farthest_rival_counts():
    rivals = ((71.2, 70.0, 60.0), (70.0, 70.0, 45.0))
    outline = replace(outline_of_circle(70, 70, 60), coverage=0.38, rivals=rivals)
    (doubt,) = rim_doubts(cast(BallView, SimpleNamespace(outline=outline)), "ball.jpg")
    assert doubt.effect == pytest.approx(0.5) and "70.0,70.0,45.0 is seen about as well" in doubt.line
    seen = cast(BallView, SimpleNamespace(outline=replace(outline, coverage=0.6)))
    assert rim_doubts(seen, "ball.jpg")[0].effect == pytest.approx(2 * 0.02)


def test_a_ball_that_only_a_very_small_picture_shows_is_a_doubt_unless_it_was_picked():
    outline = replace(outline_of_circle(70, 70, 60), roughly=True)
    view = cast(BallView, SimpleNamespace(outline=outline))
    (doubt,) = rim_doubts(view, "ball.jpg")
    assert doubt.effect == WRONG and "it may be another thing; look at it with --picture" in doubt.line
    assert rim_doubts(view, "ball.jpg", picked=True) == []


def test_every_ball_has_a_line_and_machines_a_list():
    outline = outline_of_circle(70, 70, 62.63)
    views = [
        unwrap_ball(ball(FRONT), camera=FRONT, centre=CENTRE, focal_length=1260.0, outline=outline) for _ in range(2)
    ]
    light = EnvironmentMap(np.ones((8, 16, 3), np.float32))
    probe = Probe(light, (0.0, 0.0), 0.0, 0.0, np.ones((8, 16), np.float32), gains=(1.0, 1.0))
    found = BallProbe(probe, tuple(views), ("a", "b"), True, (), ())
    shown = found.facts(listed=False)
    assert shown["ball 1"]["radius"] == shown["ball 2"]["radius"] == 62.63 and "balls" not in shown
    assert len(found.facts()["balls"]) == 2


def test_the_energy_of_a_dim_map_is_reported_in_six_digits(folder, tmp_path, capsys):
    write(tmp_path / "dim.exr", RadianceMap(ball(FRONT).radiance * np.float32(1e-7)))
    dim = ["probe", str(tmp_path / "dim.exr"), "-o", str(tmp_path / "out.exr"), *PLACE, *RIM]
    facts = reported(dim, capsys)
    bright = reported(["probe", str(folder / "front.exr"), *dim[2:]], capsys)
    assert facts["total"] == pytest.approx([1e-7 * value for value in bright["total"]], rel=1e-4)
    assert facts["irradiance"]["+Y"][0] > 0


def test_saturated_is_one_number_with_the_marks_of_the_map(folder, tmp_path, capsys):
    out = tmp_path / "single.exr"
    facts = reported(["probe", str(folder / "front.png"), "-o", str(out), *PLACE, *RIM, "--accept"], capsys)
    assert any(line.endswith("[about 40 % of the light]") for line in facts["doubts"])
    found = read_radiance(out)
    assert found.clipped is not None
    marked = LatLong().solid_angles(48)[found.clipped == SATURATED].sum()
    assert facts["clipped sr"] == pytest.approx(marked, rel=1e-3)


def test_a_camera_to_the_left_is_reported_as_it_is_written(folder, tmp_path, capsys):
    words = ["probe", str(folder / "front.exr"), "-o", str(tmp_path / "out.exr"), "--radius", "0.05", "--size", "16"]
    reported([*words, "--camera", "-1,0.12,0", *RIM], capsys)
    reported([*words, "--camera", "0,0.12,1", "--pick", "-1,70,140,70,70,132.6", "--pick-exactly"], capsys)


def test_a_pick_that_meets_no_rim_is_taken_with_a_note(folder, tmp_path, capsys):
    words = ["probe", str(folder / "front.exr"), "-o", str(tmp_path / "out.exr"), *PLACE, "--pick", "30,32,12"]
    said = printed([*words, "--json"], capsys)
    assert "no rim is seen near what was picked, x,y,radius 30,32,12, so it was taken as it is" in said.err
    assert json.loads(said.out)["balls"][0] | {"radii away": 0} == {"x": 30, "y": 32, "radius": 12, "radii away": 0}


@pytest.mark.parametrize(
    "name, why, circles",
    [
        ("two.exr", "two.exr: two balls, at x,y,radius", 2),
        ("cut.exr", "cut.exr: the picture's edge cuts off", 1),
        ("empty.exr", "empty.exr: no mirrored ball found", 0),
    ],
)
def test_a_refusal_draws_what_may_be_picked(name, why, circles, folder, tmp_path, capsys):
    drawn, out = tmp_path / "seen.png", tmp_path / "out.exr"
    line = refused(["probe", str(folder / name), "-o", str(out), *PLACE, "--picture", str(drawn)], capsys)
    assert why in line and line.count("--pick ") == circles and not out.exists()
    pixels = read_photograph(drawn).pixels.astype(int)
    assert ((pixels[..., 2] - pixels[..., 0] > 200) & (pixels[..., 1] > 200)).any() == (circles > 0)


def crops(folder: Path, second=lobes) -> list[str]:
    """Two exposures of the ball as crops of different sizes, the second of another place if asked."""
    names = []
    for index, (light, seconds, edge) in enumerate(((lobes, 1 / 10, 0), (second, 1 / 40, 6))):
        picture = ball(FRONT, light).radiance[edge // 2 :, edge:]
        light_there = np.clip(picture * seconds * 10, 0, 1)
        name = folder / f"crop_{index}.png"
        write(name, Photograph(np.rint(255 * encode_srgb(light_there)).astype(np.uint8), exposure=Exposure(seconds)))
        names.append(str(name))
    return names


def test_crops_of_different_sizes_are_laid_on_one_another_where_they_are_picked_too(tmp_path, capsys):
    words = ["probe", *crops(tmp_path), "--times", "1/10,1/40", "-o", str(tmp_path / "out.exr"), *PLACE, "--accept"]
    picked = reported([*words, "--pick", "71.5,69,61.5"], capsys)
    assert picked["balls"][0]["radius"] == pytest.approx(62.6, abs=0.5)
    # In the middle of the first, which is whole. Crops whose ball is searched for: tests/project/test_single_plate.py.
    assert picked["balls"][0]["x"] == pytest.approx(70, abs=0.3)


def test_crops_of_different_balls_are_refused(tmp_path, capsys):
    def elsewhere(directions: np.ndarray) -> np.ndarray:
        x, y, z = np.moveaxis(directions, -1, 0)
        light = 0.5 + 0.45 * np.sin(9 * x + 2) * np.cos(8 * y) + 4 * ((np.abs(x) < 0.1) & (z > 0)) + 0.3 * (y < -0.2)
        return light[..., None] * np.ones(3)

    words = ["probe", *crops(tmp_path, elsewhere), "--times", "1/10,1/40", "-o", str(tmp_path / "out.exr"), *PLACE]
    assert "does not show the same ball and place as" in refused(words, capsys)


@pytest.mark.parametrize(
    "words, line",
    [
        pytest.param(["missing.exr"], "missing.exr: no such file", id="no file"),
        pytest.param(["nothing"], "no photograph is in this folder", id="an empty folder"),
        pytest.param(["front.exr", "--turn", "0,90"], "2 angles for 1 views", id="too many turns"),
        pytest.param(["front.exr", "--turn", "east"], '"east" is not of the form', id="no angle"),
        pytest.param(
            ["front.exr", "--reflectance", "1.4"], "reflectance is three values above 0", id="too bright a ball"
        ),
        pytest.param(["front.exr", "--pick", "1,2"], "is not a rim", id="half a pick"),
        pytest.param(["front.exr", "--pick", "auto", "--pick", "auto"], "--pick: 2 are given for 1 view", id="picks"),
        pytest.param(["front.exr", "--pick", "520,20,15"], "lies outside the picture of 140×140", id="a pick outside"),
        pytest.param(["front.exr", "--picture", "rim.jpg"], "--picture rim.jpg: the file must end in", id="no .png"),
        pytest.param(["front.exr", "--distance", "0"], "distance is 0", id="no distance"),
        pytest.param(["front.exr", "--camera", "0,0,0"], "is the ball's centre", id="a camera in the ball"),
        pytest.param(["front.exr", "--size", "1"], "size is 1", id="no size"),
        pytest.param(["front.exr", "side.exr", "--second", "side.exr"], "--second is the other of two", id="second"),
        pytest.param(["--view", "no*.exr"], "no file fits it as a pattern", id="an empty pattern"),
        pytest.param([], "no photographs were given", id="nothing"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(words, line, folder, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    out = tmp_path / "out.exr"
    assert line in refused(["probe", *words, "-o", str(out), "-q"], capsys)
    assert not out.exists()


def test_times_are_read_from_names_and_stages_are_printed(tmp_path, capsys):
    light = ball(FRONT).radiance
    light = light * (0.9 / np.quantile(light, 0.99))
    words = ["probe", "--picture", str(tmp_path / "rim.png"), "-o", str(tmp_path / "map.exr"), *PLACE, *RIM, "--accept"]
    for seconds in (1, 4, 16):
        values = np.rint(255 * encode_srgb(np.clip(light * seconds / 4, 0, 1))).astype(np.uint8)
        name = "1_1.png" if seconds == 1 else f"{seconds}_1.png"
        write(tmp_path / name, Photograph(values))
        words.insert(1, str(tmp_path / name))
    said = printed([*words, "--times-from-names", "-v"], capsys)
    # Every stage begins and ends, in the order of the work.
    for stage in ("read", "response", "merge", "ball", "unwrap"):
        assert f"relume: {stage} …" in said.err and f"relume: {stage}: " in said.err, stage
    assert said.err.index("relume: read …") < said.err.index("relume: ball …") < said.err.index("relume: unwrap: ")
    # Names say what times given say.
    found, times = read_radiance(tmp_path / "map.exr").radiance, ["--times", "16,4,1"]
    reported([*words, *times], capsys)
    np.testing.assert_array_equal(read_radiance(tmp_path / "map.exr").radiance, found)
    assert "choose one of the two" in refused([*words, *times, "--times-from-names"], capsys)


def test_a_dry_run_names_the_views(folder, tmp_path, capsys):
    words = ["probe", str(folder / "front"), str(folder / "side"), "-o", str(tmp_path / "out.exr"), "--dry-run"]
    facts = reported(words, capsys)
    assert facts["views"] == ["map.exr", "map.exr"] and "registration" in str(facts["their cameras"])
    assert list(tmp_path.iterdir()) == []


def test_a_dry_run_says_what_it_was_warned_of(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(import_module("relume.cli.probe"), "require_files", lambda _: warn("the profile is old"))
    words = ["probe", str(folder / "front"), "-o", str(tmp_path / "out.exr"), "--dry-run"]
    assert "note: the profile is old" in printed(words, capsys).err


def test_a_film_becomes_a_folder_of_maps(tmp_path, capsys):
    pytest.importorskip("av")
    from probe_films import filmed, place_light, write_video

    light = place_light(0)(pixel_directions(LatLong(), 64)) / 600
    film = write_video(tmp_path / "around.mkv", [filmed(light * 2.0 ** -(3 * (k % 2)), seed=k) for k in range(4)])
    words = ["probe", film, "--spherical", "--size", "32", "-o", tmp_path / "maps"]
    facts = reported([*words, "--stops", "0,3"], capsys)
    assert (facts["frames"], facts["exposures repeat after"], facts["latency, frames"]) == (4, 2, 2)
    assert [path.name for path in sorted((tmp_path / "maps").iterdir())] == [f"map_00000{k}.exr" for k in (1, 2, 3, 4)]
    assert read_radiance(tmp_path / "maps" / "map_000001.exr").radiance.shape == (32, 64, 3)
    assert "holds files already" in refused(words, capsys, code=3)
    pytest.importorskip("zarr")
    words[-1] = tmp_path / "maps.zarr"
    assert reported([*words, "--dry-run"], capsys)["would write"] == str(tmp_path / "maps.zarr")
    assert reported([*words, "--stops", "0,3"], capsys)["written"] == str(tmp_path / "maps.zarr")
    assert (tmp_path / "maps.zarr" / "radiance" / "3.0.0.0").is_file()
    assert "--each is for photographs" in refused([*words, "--each"], capsys)

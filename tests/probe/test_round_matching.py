"""Fisheyes whose turns are not known: cut from a map by known turns, which are found again."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from command_line import refused, reported
from panoramas import patchwork
from relume.errors import DoubtWarning, NotAPanorama
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.probe.panorama.views import orientation
from relume.probe.round_matching import orient_round_views, round_features
from relume.probe.round_views import FisheyeLens, ParabolicMirror, RoundView, join_round_views
from relume.sphere.directions import rotation_about, rotation_angle
from relume.sphere.environment_files import read_environment
from relume.sphere.environment_map import EnvironmentMap

SIDE, RIM = 320, 156.0
TURNS = [np.eye(3), orientation(*np.radians([121, 4, -6])), orientation(*np.radians([-117, -5, 9]))]


@cache
def patches() -> EnvironmentMap:
    return patchwork()


@pytest.fixture
def light() -> EnvironmentMap:
    return patches()


def round_view(light: EnvironmentMap, turn: np.ndarray, lens, *, gain: float = 1.0, noise: float = 0.01) -> RoundView:
    """What a lens at the light's centre draws, four look-ups a pixel, with noise; its turn is not told."""
    places = (np.arange(2 * SIDE) + 0.5) / 2
    x, down = np.meshgrid((places - SIDE / 2) / RIM, (places - SIDE / 2) / RIM)
    radius = np.hypot(x, down)
    angle = lens.angle(radius)
    side = np.sin(angle) / radius
    depth = -1 if lens.ahead else 1
    ways = np.stack([x * side, -down * side, depth * np.cos(angle)], axis=-1)
    seen, within = np.zeros((2 * SIDE, 2 * SIDE, 3)), radius < 1
    seen[within] = light.lookup(ways[within] @ turn.T)
    picture = gain * seen.reshape(SIDE, 2, SIDE, 2, 3).mean((1, 3))
    picture *= 1 + noise * np.random.default_rng(round(1e6 * gain)).normal(size=picture.shape)
    return RoundView(RadianceMap(np.maximum(picture, 0).astype("f4")), lens, (SIDE / 2, SIDE / 2), RIM, np.eye(3))


@cache
def three_views() -> tuple[RoundView, ...]:
    """Views of 190°, by the turns of the test."""
    return tuple(round_view(patches(), turn, FisheyeLens(np.radians(190))) for turn in TURNS)


def off(found, turns=TURNS) -> np.ndarray:
    """Degrees by which each view's turn beside the first is wrong."""
    return np.degrees([rotation_angle(turn.T @ view.rotation) for turn, view in zip(turns, found.views, strict=True)])


@pytest.mark.parametrize(
    "lens",
    [
        # slow: test_the_command_joins_fisheyes goes red for the same break, of its gains [lens1].
        pytest.param(FisheyeLens(np.radians(190)), id="lens0", marks=pytest.mark.slow),
        pytest.param(FisheyeLens(np.radians(185), equisolid=True), id="lens1"),
    ],
)
def test_three_fisheyes_are_turned_as_they_were(light, lens):
    views = [round_view(light, turn, lens, gain=gain) for turn, gain in zip(TURNS, (1, 1.4, 0.8), strict=True)]
    found = orient_round_views(views)
    assert off(found).max() < 0.1  # 0.03° measured
    assert found.error < np.radians(0.15) and found.matches.min() > 50
    assert found.deviations[0] == 0 and np.all(found.deviations[1:] < np.radians(0.05))
    first, second = found.views[:2]
    assert isinstance(first.lens, FisheyeLens) and first.lens.field == pytest.approx(lens.field, rel=3e-3)
    assert second.lens == first.lens
    # And so the map is the light, in the first view's brightness.
    probe = join_round_views(found.views, 96)
    share = probe.light.radiance / light.remapped(light.mapping, 96).radiance
    assert np.median(share) == pytest.approx(1, abs=0.03) and probe.gains == pytest.approx([1, 1 / 1.4, 1.25], rel=0.02)


def test_the_first_view_keeps_its_frame(light):
    lens, up = FisheyeLens(np.radians(200)), rotation_about(np.array([1.0, 0, 0]), 0.5)
    views = [round_view(light, up @ turn, lens) for turn in TURNS[:2]]
    found = orient_round_views([replace(views[0], rotation=up), views[1]])
    assert np.array_equal(found.views[0].rotation, up)
    assert off(found, [up @ turn for turn in TURNS[:2]]).max() < 0.1


def test_a_field_that_was_rounded_is_found():
    """185° for 190° would turn views of 120° by 3°."""
    told = [replace(view, lens=FisheyeLens(np.radians(185))) for view in three_views()]
    found = orient_round_views(told)
    assert isinstance(found.views[0].lens, FisheyeLens)
    assert np.degrees(found.views[0].lens.field) == pytest.approx(190, abs=0.5) and off(found).max() < 0.1


def test_a_field_far_from_the_one_given_is_doubted_then_refused():
    for told, found in ((178, r"fit a field of 1(89|90)\.?\d*°, not the 178° given; check it"), (60, "")):
        views = [replace(view, lens=FisheyeLens(np.radians(told))) for view in three_views()[:2]]
        if found:
            with pytest.warns(DoubtWarning, match=found):
                orient_round_views(views)
        else:
            with pytest.raises(
                NotAPanorama, match=r"a field of [\d.]+°, not the 60° given; give the angle .* within 15 %"
            ):
                orient_round_views(views)


def test_rotations_that_are_known_stay_and_are_doubted_where_matches_contradict(light):
    right = [replace(view, rotation=turn) for view, turn in zip(three_views(), TURNS, strict=True)]
    wrong = [right[0], replace(right[1], rotation=orientation(*np.radians([125, 4, -6]))), three_views()[2]]
    with pytest.warns(DoubtWarning) as said:
        found = orient_round_views(wrong, known=[True, True, False])
    assert re.match(r"view 2: .* with view 1 .* turned by (3\.9|4|4\.1)° otherwise than given", str(said[0].message))
    assert all(np.array_equal(a.rotation, b.rotation) for a, b in zip(found.views[:2], wrong[:2], strict=True))
    # A view without features has its turn from what is known, and none is doubted.
    flat = replace(right[2], picture=RadianceMap(np.full((SIDE, SIDE, 3), 0.5, "f4")))
    found = orient_round_views([flat, three_views()[1], right[0]], known=[True, False, True])
    assert off(found, [TURNS[2], TURNS[1], TURNS[0]]).max() < 0.1
    assert found.matches[0] == 0 and found.deviations[1] > 0 == found.deviations[0]
    with pytest.raises(NotAPanorama, match=r"^view 1: too little in common with view 2 and what is joined to it"):
        orient_round_views([flat, right[0], right[1]], known=[False, True, True])
    with pytest.raises(ValueError, match="of one at least, not of all"):
        orient_round_views(right, known=[True] * 3)


def test_mirrors_show_the_world_the_other_way_round_and_are_turned_all_the_same(light):
    turns = [np.eye(3), orientation(*np.radians([70, 10, 5]))]
    found = orient_round_views([round_view(light, turn, ParabolicMirror(np.radians(200))) for turn in turns])
    assert off(found, turns).max() < 0.1


def test_features_lie_in_the_directions_that_show_them(light):
    # Of the same view turned by a quarter about its axis, the same features a quarter on.
    lens = FisheyeLens(np.radians(180))
    plain = round_features(round_view(light, np.eye(3), lens, noise=0))
    assert len(plain.points) > 300 and np.allclose(np.linalg.norm(plain.points, axis=-1), 1)
    angles = np.arctan2(np.hypot(plain.points[:, 0], plain.points[:, 1]), -plain.points[:, 2])
    assert angles.max() < np.radians(90) and np.mean(angles > np.radians(70)) > 0.1


def test_what_has_nothing_in_common_is_refused_by_name(light):
    lens = FisheyeLens(np.radians(150))
    back = orientation(np.pi)
    views = [replace(round_view(light, turn, lens), name=name) for turn, name in ((np.eye(3), "a"), (back, "b"))]
    with pytest.raises(NotAPanorama, match=r"^b: too little in common with a .* overlap by 15° or more"):
        orient_round_views(views)
    with pytest.raises(NotAPanorama, match="1 round views; their turns are found from two or more"):
        orient_round_views(views[:1])


def test_a_lens_of_another_law_is_doubted():
    views = three_views()
    # An equidistant lens taken for an equisolid one: no field bends one into the other.
    wrong = FisheyeLens(np.radians(190), equisolid=True)
    with pytest.warns(DoubtWarning, match=r"differs by 0\.\d+°; check the lens's field and its rim"):
        orient_round_views([replace(view, lens=wrong) for view in views])


def test_two_fisheyes_back_to_back_in_a_real_place(shared):
    turns = [np.eye(3), orientation(*np.radians([178, 3, -4]))]
    quarry = read_environment(shared / "data/hdri/three/quarry_01_1k.hdr")
    found = orient_round_views([round_view(quarry, turn, FisheyeLens(np.radians(200))) for turn in turns])
    assert off(found, turns).max() < 0.1


# slow: what the command reads of a table, test_the_command_joins_fisheyes shows, what is made of it,
# test_rotations_that_are_known_stay_and_are_doubted_where_matches_contradict.
@pytest.mark.slow
def test_the_command_turns_all_by_a_table_of_one(tmp_path, capsys):
    paths = [tmp_path / f"{index}.exr" for index in range(3)]
    for path, view in zip(paths, three_views(), strict=True):
        files.write(path, view.picture)
    (tmp_path / "turns.csv").write_text("name,yaw,pitch,roll\n1.exr,31,4,-6\n")
    told = reported(["panorama", *paths, "--rim", f"{SIDE / 2},{SIDE / 2},{RIM}", "--size", "96", "--fisheye", "190",
                     "--orientations", tmp_path / "turns.csv", "-o", tmp_path / "map.exr"], capsys)  # fmt: skip
    assert told["views"][0]["yaw"] == pytest.approx(-90, abs=0.1)


ROWS = 2 * int(np.ceil(RIM * 180 / 190))


def test_the_command_joins_fisheyes(light, tmp_path, capsys):
    paths = [tmp_path / f"{index}.exr" for index in range(3)]
    for path, view in zip(paths, three_views(), strict=True):
        files.write(path, view.picture)
    out, rim = tmp_path / "map.exr", f"{SIDE / 2},{SIDE / 2},{RIM}"
    command = ["panorama", *paths, "--rim", rim, "--size", "96", "-o", out]
    assert "--rim is for --fisheye" in refused(command, capsys)
    told = reported([*command, "--fisheye", "188"], capsys)
    assert [view["yaw"] for view in told["views"]] == pytest.approx([0, 121, -117], abs=0.1)
    assert [view["roll"] for view in told["views"]] == pytest.approx([0, -6, 9], abs=0.1)
    assert float(told["field"].removesuffix("°")) == pytest.approx(190, abs=0.5)
    share = read_environment(out).radiance / light.remapped(light.mapping, 96).radiance
    assert np.median(share) == pytest.approx(1, abs=0.03)
    (tmp_path / "turns.csv").write_text("name,yaw,pitch,roll\n0.exr,0,0,0\n1.exr,125,4,-6\n")
    told = reported([*command, "--fisheye", "190", "--orientations", tmp_path / "turns.csv"], capsys)
    assert [view["yaw"] for view in told["views"][:2]] == [0, 125]
    # All of them: nothing is matched.
    table = "".join(f"{i}.exr,{yaw},{pitch},{roll}\n" for i, (yaw, pitch, roll) in enumerate([(0, 0, 0), (121, 4, -6)]))
    (tmp_path / "turns.csv").write_text("name,yaw,pitch,roll\n" + table + "2.exr,-117,-5,9\n")
    told = reported([*command, "--fisheye", "190", "--orientations", tmp_path / "turns.csv"], capsys)
    assert told["matches agree within"] is None and "matches" not in told["views"][0]
    for useless in (["--field", "80"], ["--no-level"], ["--no-distortion"], ["--match"]):
        assert "--fisheye has no use for" in refused([*command, "--fisheye", "190", *useless], capsys)
    # As fine as the views: 2 · 156 pixels are 190°, so 180° are 295.6 rows of the lens that was given so.
    told = reported(["panorama", *paths, "--fisheye", "190", "--rim", rim, "--orientations", tmp_path / "turns.csv",
                     "-o", out], capsys)  # fmt: skip
    assert told["size"] == f"{2 * ROWS}×{ROWS}"
    slip = ["panorama", *paths, "--rim", "21,22,3", "--fisheye", "190", "-o", out]
    assert "0.exr: a rim of radius 3 in 320×320 pixels is less than 10% of the picture across" in refused(slip, capsys)
    assert "the rim's middle 900, 160 is not within" in refused(
        ["panorama", *paths, "--rim", "900,160,156", "--fisheye", "190", "-o", out], capsys
    )

"""Marks beside what was found: their distances from the edges, and what may be marked before anything is found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import place_shoot
import relume as rl
from relume.errors import InvalidPlace
from relume.scene.places.marked import place_marks


def place_file(folder: Path, text: str) -> Path:
    path = folder / "place.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_distances_of_a_photograph_s_marks_have_its_root_mean_square(tmp_path: Path):
    path = place_file(tmp_path, place_shoot.toml(noise=0.5))
    place = rl.model_place(path, out=path)
    for photograph in place.photographs:
        own = np.concatenate([mark.distances for mark in place.marks if mark.photograph == photograph.name])
        assert len(own) == photograph.marks
        assert np.sqrt(np.mean(own**2)) == pytest.approx(photograph.residual, rel=1e-6)
    # Read again they are the same, of the marks as the file has them now.
    again = rl.scene.read_place(path)
    for one, other in zip(place.marks, again.marks, strict=True):
        assert (one.photograph, one.block, one.edge) == (other.photograph, other.block, other.edge)
        assert other.distances == pytest.approx(one.distances, abs=1e-6)


def test_a_mark_that_is_moved_lies_as_far_off_as_it_was_moved(tmp_path: Path):
    path = place_file(tmp_path, place_shoot.toml(noise=0.0))
    rl.model_place(path, out=path)
    place = rl.scene.read_place(path)
    mark = next(mark for mark in place.marks if mark.block == "tower" and mark.edge == "front_top")
    (ax, ay), (bx, by) = mark.points
    aside = 3 * np.array([-(by - ay), bx - ax]) / np.hypot(bx - ax, by - ay)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace(str(mark.points.tolist()), str((mark.points + aside).tolist())), encoding="utf-8")
    moved = next(
        each for each in rl.scene.read_place(path).marks
        if (each.photograph, each.block, each.edge) == (mark.photograph, "tower", "front_top")
    )  # fmt: skip
    assert moved.distances == pytest.approx([3, 3], abs=1e-3)


def test_a_corner_lies_off_by_its_whole_distance_and_a_lens_bends_nothing_of_it(tmp_path: Path):
    camera = place_shoot.CAMERAS[0]
    bent = rl.scene.Distortion(k1=-0.08)
    corner = np.array([4.0, 9.0, 0.7 + 1.75])
    seen = rl.Camera(
        camera.width, camera.height, camera.focal_length, camera.position, camera.rotation, distortion=bent
    ).project(corner)
    place = rl.model_place(place_file(tmp_path, place_shoot.toml(noise=0.0)))
    photograph = place.photographs[0]
    lens = rl.Camera(
        camera.width, camera.height, photograph.camera.focal_length, photograph.camera.position,
        photograph.camera.rotation, distortion=bent,
    )  # fmt: skip
    tables = place_shoot.tables(0.0, marks={"photo0": {"tower": {"front_left_top": [tuple(seen)]}}})
    (mark,) = place_marks(tables, place.blocks, [replace(photograph, camera=lens)])
    assert mark.distances == pytest.approx([0], abs=1e-4)
    straight = camera.project(corner) + np.array([3.0, 4.0])
    tables = place_shoot.tables(0.0, marks={"photo0": {"tower": {"front_left_top": [tuple(straight)]}}})
    (mark,) = place_marks(tables, place.blocks, [photograph])
    assert mark.distances == pytest.approx([5], abs=1e-4)


def test_a_point_of_a_ring_is_measured_to_the_ring(tmp_path: Path):
    chapel = Path(__file__).parents[3] / "examples" / "places" / "chapel.toml"
    place = rl.model_place(chapel)
    rings = [mark for mark in place.marks if mark.block == "well"]
    assert len(rings) == 8
    for mark in rings:
        assert mark.distances.shape == (len(mark.points),) and mark.distances.max() < 2.5  # half a pixel of noise


def test_bodies_are_known_before_anything_is_found_and_faults_are_named(tmp_path: Path):
    text = place_shoot.toml()
    bodies = rl.scene.read_place_bodies(place_file(tmp_path, text))
    assert list(bodies) == ["house", "roof", "tower", "annex"]
    assert "ridge" in bodies["roof"].edges and "front_left_top" in bodies["house"].corners
    assert rl.scene.BLOCK_KINDS[0] == "box" and "revolution" in rl.scene.BLOCK_KINDS
    for old, new, line in (
        ("front_top = ", "frontt_top = ", "did you mean front_top"),
        ("on = 'house'", "on = 'hous'", "no block above it 'hous'; did you mean house"),
        ("left = 'house.right'", "left = 'house.ridge'", "side along that axis"),
    ):
        with pytest.raises(InvalidPlace, match=line):
            rl.scene.read_place_bodies(place_file(tmp_path, text.replace(old, new, 1)))
    length = '[[lengths]]\nbetween = ["house.front_left_top", "house.frnt_right_top"]\nmetres = 8.0\n'
    with pytest.raises(InvalidPlace, match=r"lengths\.0\.between: no corner of a box 'frnt_right_top'"):
        rl.scene.read_place_bodies(place_file(tmp_path, text + length))

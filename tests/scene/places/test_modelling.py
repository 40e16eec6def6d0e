"""Places from marked edges: how near sizes and cameras come, what the deviations say, and what is refused."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import place_shoot
import relume as rl
from place_shoot import BLOCKS, CAMERAS, SIZE, TRUTH
from relume.errors import InvalidPlace, UnreadableFile
from relume.scene.places.photographs import PhotographFacts
from relume.scene.places.reading import read_shapes
from relume.scene.places.solving import Solution, solved
from relume.sphere.directions import rotation_angle

OTHER = {"front": "back", "back": "front"}
FACTS = tuple(PhotographFacts(SIZE) for _ in CAMERAS)


def place_file(folder: Path, text: str | None = None) -> Path:
    path = folder / "marks.toml"
    path.write_text(place_shoot.toml() if text is None else text, encoding="utf-8")
    return path


def size_errors(found: Solution) -> np.ndarray:
    """Of every size sought, as a share of it."""
    names = found.fit.model.lengths
    pairs = [(v, TRUTH[n]) for v, n in zip(found.values, names, strict=False) if n[:2] in ("wi", "he", "de")]
    return np.array([value / truth - 1 for value, truth in pairs])


def test_sizes_and_cameras_from_five_photographs_marked_with_half_a_pixel_of_noise():
    found = solved(place_shoot.tables(0.5, seed=0), FACTS)
    assert np.abs(size_errors(found)).max() < 0.005
    turns = [rotation_angle(r.T @ c.rotation) for r, c in zip(found.fit.rotations(found.values), CAMERAS, strict=True)]
    assert np.degrees(max(turns)) < 0.2
    _, positions, focal = found.fit.cameras(found.values)
    assert np.abs(positions - [c.position for c in CAMERAS]).max() < 0.1
    assert focal == pytest.approx([c.focal_length for c in CAMERAS], rel=0.01)
    assert found.doubts == ()


def test_without_noise_the_place_is_exact():
    found = solved(place_shoot.tables(0.0), FACTS)
    assert np.abs(size_errors(found)).max() < 1e-7
    assert found.chi_square < 1e-10
    turn = found.fit.angles(found.values)[found.fit.model.blocks[3].turn]
    assert np.degrees(turn) == pytest.approx(25.0, abs=1e-6)


@pytest.mark.slow
def test_the_covariance_is_the_spread_over_fifty_markings():
    lengths, squares, chi, worst, turned = 12, [], [], [], []
    for seed in range(50):
        found = solved(place_shoot.tables(0.5, seed), FACTS)
        off = found.values[:lengths] - [TRUTH[name] for name in found.fit.model.lengths]
        squares.append(off @ np.linalg.solve(found.covariance[:lengths, :lengths], off))
        chi.append(found.chi_square / found.freedom)
        worst.append(np.abs(size_errors(found)).max())
        rotations = found.fit.rotations(found.values)
        turned.append(max(rotation_angle(r.T @ c.rotation) for r, c in zip(rotations, CAMERAS, strict=True)))
    # Of χ² with 600 degrees of freedom the deviation is 6 %, of 50 sums of some 212 squares 1.4 %.
    assert np.mean(squares) / lengths == pytest.approx(1.0, abs=0.18)
    assert np.mean(chi) == pytest.approx(1.0, abs=0.06)
    assert np.quantile(worst, 0.9) < 0.005
    assert np.degrees(max(turned)) < 0.2


def test_the_jacobian_is_the_slope_of_the_errors():
    tables = place_shoot.tables(
        0.5, lengths=[{"between": ["house.front_left_top", "annex.back_left_bottom"], "metres": 6.0, "deviation": 2.0}]
    )
    corner = tuple(CAMERAS[0].project(np.array([4, 9, 0.7 + 1.75])) + np.array([2.0, -1.0]))
    marked = {**tables.marks["photo0"], "tower": {**tables.marks["photo0"]["tower"], "front_left_top": (corner,)}}
    tables = tables.model_copy(update={"marks": {**tables.marks, "photo0": marked}})
    found = solved(tables, tuple(PhotographFacts(SIZE, 1400.0) for _ in CAMERAS))
    values = found.values + 0.01 * np.random.default_rng(1).normal(size=len(found.values))
    steps = 1e-6 * np.eye(len(values))
    slopes = np.stack([(found.fit.errors(values + s) - found.fit.errors(values - s)) / 2e-6 for s in steps], axis=1)
    assert found.fit.jacobian(values) == pytest.approx(slopes, rel=1e-5, abs=1e-5 * np.abs(slopes).max())


def bound_of(found: Solution) -> np.ndarray:
    """(9,) of each size sought the Cramér–Rao bound of its deviation, as a share: no estimator has less."""
    slope = found.fit.jacobian(found.values)
    deviations = np.sqrt(np.diag(np.linalg.inv(slope.T @ slope)))
    names = found.fit.model.lengths
    return np.array([d / TRUTH[n] for d, n in zip(deviations, names, strict=False) if n[:2] in ("wi", "he", "de")])


def test_marks_that_are_the_ends_of_their_edges_say_more():
    exact = solved(place_shoot.tables(0.0, ends=True), FACTS)
    assert np.abs(size_errors(exact)).max() < 1e-7 and len(exact.fit.marks.photograph) == 0
    assert len(exact.fit.marks.corner_photograph) == 260
    lines, ends = (bound_of(solved(place_shoot.tables(0.0, ends=each), FACTS)) for each in (False, True))
    assert np.all(ends < 0.72 * lines)
    # The worst size, of the annex that stands apart: 0.19 % by where edges run, 0.11 % by where they end too.
    assert lines.max() == pytest.approx(0.0019, abs=5e-5) and ends.max() == pytest.approx(0.00106, abs=3e-5)
    errors = np.array([size_errors(solved(place_shoot.tables(0.5, seed, ends=True), FACTS)) for seed in range(4)])
    assert np.abs(errors).max() < 0.004
    assert np.sqrt(np.mean((errors / ends) ** 2)) == pytest.approx(1, abs=0.25)


def test_an_end_that_is_hidden_stays_a_point_on_its_edge():
    tables = place_shoot.tables(0.0)
    marked = {name: dict(of) for name, of in tables.marks["photo0"].items()}
    one, other = (np.array(point) for point in marked["tower"]["front_left"])
    marked["tower"]["front_left"] = (tuple((0.7 * one + 0.3 * other).tolist()), tuple(other.tolist()))
    tables = tables.model_copy(update={"ends": True, "marks": {**tables.marks, "photo0": marked}})
    found = solved(tables, FACTS)
    assert np.abs(size_errors(found)).max() < 1e-7
    assert found.fit.marks.labels[0] == "tower.front_left in 'photo0'" and len(found.fit.marks.photograph) == 1


def test_curves_keep_their_marks_where_edges_end(tmp_path: Path):
    chapel = Path(__file__).parents[3] / "examples" / "places" / "chapel.toml"
    (tmp_path / "place.toml").write_text("ends = true\n" + chapel.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "photographs").symlink_to(chapel.parent / "photographs")
    # Its marks stop a fiftieth of each edge before the end: that they are no ends is seen.
    with pytest.warns(UserWarning, match=r"lies 5\.\d pixels from the edge"):
        place = rl.model_place(tmp_path / "place.toml")
    plain = rl.model_place(chapel)
    assert place.chi_square / place.freedom > 1.5 * plain.chi_square / plain.freedom
    assert place.block("well").size[0] == pytest.approx(2.5, rel=0.05)


@pytest.mark.slow
def test_the_worst_size_of_fifty_markings_is_what_the_bound_allows():
    for ends, worst, median in ((False, 0.0065, 0.0019), (True, 0.0035, 0.0012)):
        off = [np.abs(size_errors(solved(place_shoot.tables(0.5, s, ends=ends), FACTS))) for s in range(50)]
        exact = solved(place_shoot.tables(0.0, ends=ends), FACTS)
        # The estimator reaches the bound: errors over it have a mean square of one.
        assert np.mean((np.array(off) / bound_of(exact)) ** 2) == pytest.approx(1, abs=0.2)
        each = np.max(off, axis=1)
        assert each.max() < worst and np.median(each) == pytest.approx(median, abs=0.0003)


def test_a_place_is_written_and_read_again(tmp_path):
    marks = place_file(tmp_path)
    place = rl.model_place(marks, out=tmp_path / "place.toml", export=tmp_path / "place.glb")
    again = rl.scene.read_place(tmp_path / "place.toml")
    assert [mesh.name for mesh in again.meshes()] == ["house", "roof", "tower", "annex"]
    for one, other in zip(place.meshes(), again.meshes(), strict=True):
        assert other.vertices == pytest.approx(one.vertices, abs=1e-6)
    for one, other in zip(place.photographs, again.photographs, strict=True):
        assert other.camera.position == pytest.approx(one.camera.position)
        assert other.camera.rotation == pytest.approx(one.camera.rotation)
        assert other.camera.focal_length == one.camera.focal_length
        assert (other.name, other.file, other.marks) == (one.name, one.file, one.marks)
    assert {mesh.name for mesh in rl.read_meshes(tmp_path / "place.glb")} == {"house", "roof", "tower", "annex"}
    # Its marks are kept, so that it can be found again, and is the same text then.
    rl.model_place(tmp_path / "place.toml", out=tmp_path / "again.toml")
    assert (tmp_path / "again.toml").read_text() == (tmp_path / "place.toml").read_text()


def test_a_place_file_gives_meshes_and_cameras_to_what_reads_those(tmp_path):
    place = rl.model_place(place_file(tmp_path), out=tmp_path / "place.toml")
    (mesh,) = read_shapes(tmp_path / "place.toml")
    assert mesh.name == "place"
    triangles = [part.vertices[part.faces] for part in place.meshes()]
    assert mesh.vertices[mesh.faces] == pytest.approx(np.concatenate(triangles), abs=1e-6)
    camera = rl.read_camera(tmp_path / "place.toml", 800, 600, name="photo1")  # the picture at half its size
    assert camera.position == pytest.approx(place.photograph("photo1").camera.position)
    assert camera.focal_length == pytest.approx(place.photograph("photo1").camera.focal_length / 2)
    with pytest.raises(UnreadableFile, match=r"holds 'photo0', 'photo1', .*; give the name of one"):
        rl.read_camera(tmp_path / "place.toml", 800, 600)
    with pytest.raises(UnreadableFile, match=r"holds 'photo0', 'photo1', "):
        rl.read_camera(tmp_path / "place.toml", 800, 600, name="photo9")
    with pytest.raises(UnreadableFile, match="made for a picture of 1600×1200, not 800×800"):
        rl.read_camera(tmp_path / "place.toml", 800, 800, name="photo1")


def test_the_blocks_stand_where_they_truly_stand(tmp_path):
    place = rl.model_place(place_file(tmp_path, place_shoot.toml(noise=0.0)))
    assert place.block("tower").corners["front_left_top"] == pytest.approx([4, 9, 0.7 + 1.75], abs=1e-6)
    assert place.block("roof").edges["ridge"] == pytest.approx(np.array([[-4, 7.5, 0], [4, 7.5, 0]]), abs=1e-6)
    assert place.block("house").mesh.vertices.min(0) == pytest.approx([-4, 0, -3], abs=1e-6)
    for mesh in place.meshes():  # outward: the volume is positive
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(float), 1, 0)
        assert np.sum(a * np.cross(b, c)) > 0
    facts = place.facts()["blocks"]
    assert isinstance(facts, dict) and facts["house"]["width"] == "8 m"  # was given: no deviation
    assert facts["roof"]["height"].startswith("2.5 m ±")


def test_sizes_of_which_nothing_is_marked_are_named(tmp_path):
    text = re.sub(r"(?m)^(front|back|left|right)_top = .*\n", "", place_shoot.toml())
    text = re.sub(r"(?m)^(front|back)_(left|right) = .*\n", "", text)
    with pytest.raises(InvalidPlace, match="height of block 'tower' is not determined: mark an edge at the top or"):
        rl.model_place(place_file(tmp_path, text))


def test_a_photograph_of_another_place_is_named(tmp_path):
    marked = place_shoot.marks(0.5, 0)
    random = np.random.default_rng(5)
    other = {
        block: {edge: (np.array(points) + random.normal(0, 120, (2, 2))).tolist() for edge, points in edges.items()}
        for block, edges in marked["photo3"].items()
    }
    with pytest.raises(InvalidPlace, match="'photo3' does not agree with the others"):
        rl.model_place(place_file(tmp_path, place_shoot.toml(photo3=other)))


def test_sides_that_are_swapped_throughout_are_named(tmp_path):
    text = re.sub(r"(?m)^(left|right)_bottom = .*\n", "", place_shoot.toml())
    text = re.sub(r"\b(front|back)_(bottom|top|left|right) =", lambda m: f"{OTHER[m[1]]}_{m[2]} =", text)
    with pytest.raises(InvalidPlace, match=r"marks\.toml: block 'house' came out inside out, 8 × 5 × -\d"):
        rl.model_place(place_file(tmp_path, text))


@pytest.mark.parametrize("off", [9.0, 300.0])
def test_a_mark_on_the_wrong_edge_is_named_and_hurts_little(tmp_path, off):
    marked = place_shoot.marks(0.5, 0)["photo1"]
    points = np.array(marked["house"]["front_top"]) + np.array([0, off])
    marked["house"]["front_top"] = points.tolist()
    with pytest.warns(UserWarning, match=r"mark house\.front_top in 'photo1' lies [\d.]+ pixels from the edge"):
        place = rl.model_place(place_file(tmp_path, place_shoot.toml(photo1=marked)))
    assert place.block("house").size == pytest.approx([8, 5, 6], rel=0.005)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("width = 8.0\n", "", "nothing sets the scale; give one size in metres"),
        (
            "front_top = [",
            "front_tob = [",
            "marks.photo0.house.front_tob: no edge or corner of a box 'front_tob'; did you",
        ),
        ("on = 'house'", "on = 'hause'", "blocks.roof.on: no block above it 'hause'; did you mean house"),
        ("width = 'house.width'", "width = 'house.wide'", "blocks.roof.width: no size 'wide'; did you mean width"),
        ("left = 'house.right'", "left = 'house.front'", "blocks.tower.left: no side along that axis 'front'"),
        ("kind = 'box'\nturn", "kind = 'wall'\ndepth = 2.0\nturn", "blocks.annex.depth: a wall has none; leave it out"),
        ("[marks.photo1.house]", "[marks.photo7.house]", "marks.photo7: no photograph 'photo7'; did you mean photo"),
        ("kind = 'roof'", "kind = 'rof'", "kind"),
        ("width = 8.0", "width = -8.0", "width is -8"),
        ("left = 'house.right'", "left = 1.0\nright = 2.0", "both left and right; give one of them"),
        ("size = [1600, 1200]", "sizes = [1600, 1200]", "photographs.0.sizes: unknown key; did you mean size"),
    ],
)
def test_what_a_place_file_gets_wrong_is_one_line_that_names_it(tmp_path, old, new, message):
    text = place_shoot.toml()
    assert old in text
    with pytest.raises(InvalidPlace, match=re.escape(message)) as error:
        rl.model_place(place_file(tmp_path, text.replace(old, new, 1)))
    assert "\n" not in str(error.value) and "marks.toml" in str(error.value)


def test_a_photograph_without_marks_or_with_too_few_is_named(tmp_path):
    with pytest.raises(InvalidPlace, match="photograph 'photo2' has no marked edges"):
        rl.model_place(place_file(tmp_path, place_shoot.toml(photo2={})))
    one = {"house": {"front_top": place_shoot.marks(0, 0)["photo2"]["house"]["front_top"]}}
    with pytest.raises(InvalidPlace, match="photograph 'photo2' shows edges along x of the axes only"):
        rl.model_place(place_file(tmp_path, place_shoot.toml(photo2=one)))
    few = place_shoot.marks(0, 0)["photo2"]["house"]
    few = {"house": {edge: few[edge] for edge in ("front_top", "front_bottom", "front_left")}}
    with pytest.raises(InvalidPlace, match=r"camera 'photo2' is not determined: .*mark more edges in that photograph"):
        rl.model_place(place_file(tmp_path, place_shoot.toml(photo2=few)))


def test_a_measured_distance_sets_the_scale(tmp_path):
    blocks = [{key: value for key, value in BLOCKS[0].items() if key != "width"}, *BLOCKS[1:]]
    text = place_shoot.toml(0.0, blocks=blocks)
    text += '\n[[lengths]]\nbetween = ["house.front_left_bottom", "house.front_right_top"]\nmetres = 9.433981\n'
    place = rl.model_place(place_file(tmp_path, text))  # √(8² + 5²)
    assert place.block("house").size == pytest.approx([8, 5, 6], rel=1e-5)


def test_a_solved_place_goes_beside_the_file_that_names_its_photographs(tmp_path):
    (tmp_path / "other").mkdir()
    with pytest.raises(ValueError, match="write it into"):
        rl.model_place(place_file(tmp_path), out=tmp_path / "other" / "place.toml")
    with pytest.raises(InvalidPlace, match="nothing was found in it yet"):
        rl.scene.read_place(place_file(tmp_path))

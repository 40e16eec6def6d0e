"""Bodies, and what constraints make of blocks."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from relume.scene.cameras.camera import Camera
from relume.scene.places.bodies import BODIES, Body, revolved
from relume.scene.places.photographs import PhotographFacts
from relume.scene.places.place_tables import BlockTable, PlaceTables
from relume.scene.places.quantities import modelled
from relume.scene.places.solving import solved

VOLUMES = {"box": 1, "roof": 1 / 2, "gable": 1 / 2, "wedge": 1 / 2, "pyramid": 1 / 3, "arch": np.pi / 4}


def volume(body: Body) -> float:
    """By the divergence theorem: positive where faces look outward."""
    a, b, c = np.moveaxis(body.vertices[body.triangles], 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6)


@pytest.mark.parametrize("kind", VOLUMES)
def test_a_body_is_closed_and_its_faces_look_outward(kind):
    body = BODIES[kind]
    assert volume(body) == pytest.approx(VOLUMES[kind], rel=1e-3)
    pairs = [pair for ring in body.faces for pair in zip(ring, ring[1:] + ring[:1], strict=True)]
    assert len(set(pairs)) == len(pairs)
    assert {(b, a) for a, b in pairs} == set(pairs)  # each side once either way
    assert body.vertices.min() == 0 and body.vertices.max() == 1
    sides = {frozenset(pair) for pair in pairs}
    assert all(frozenset(pair) in sides for edge in body.edges.values() for pair in pairwise(edge))


def test_names_lie_where_they_say():
    box = BODIES["box"]
    assert box.vertices[box.corners["front_left_top"]].tolist() == [0, 1, 1]
    assert box.vertices[list(box.edges["right_bottom"])][:, [0, 1]].tolist() == [[1, 0], [1, 0]]
    assert BODIES["wedge"].vertices[BODIES["wedge"].corners["back_right_top"]].tolist() == [1, 1, 0]
    wall = BODIES["wall"]
    a, b, c = wall.vertices[wall.triangles[0]]
    assert np.cross(b - a, c - a).tolist() == [0, 0, 1]


def test_a_revolution_turns_its_profile():
    assert volume(revolved([(1, 0), (1, 1)])) == pytest.approx(np.pi / 4, rel=1e-3)
    assert volume(revolved([(1, 0), (0, 1)])) == pytest.approx(np.pi / 12, rel=1e-3)
    vase = revolved([(0.5, 0), (1, 0.25), (1, 1)])
    assert set(vase.edges) == {"ring_0", "ring_1", "ring_2", "bottom", "top"}
    assert vase.vertices[vase.edges["ring_1"][0]].tolist() == [1.0, 0.25, 0.5]
    with pytest.raises(ValueError, match="profile goes from height 0 up to height 1"):
        revolved([(2, 0), (1, 1)])


def sides(blocks: list[dict[str, Any]], values: dict[str, float]) -> dict[str, np.ndarray]:
    """(2, 3) low and high corner of every block, in its own frame."""
    model = modelled([BlockTable(**block) for block in blocks])
    assert set(model.lengths) == set(values)
    one = np.array([1.0, *(values[name] for name in model.lengths)])
    found = {}
    for block in model.blocks:
        low, size = (np.array([model.row(q) @ one for q in three]) for three in (block.low, block.size))
        found[block.name] = np.stack([low, low + size])
    return found


HALL: dict[str, Any] = {"name": "hall", "kind": "box", "width": 6.0, "height": 4.0, "depth": 10.0}


def test_blocks_stand_on_are_aligned_with_and_mirror_others():
    blocks = [
        HALL,
        {"name": "porch", "kind": "box", "back": "hall.front", "depth": 2.0, "height": 1.0, "width": "hall.height"},
        {"name": "spire", "kind": "pyramid", "on": "hall", "width": "hall.width", "depth": "hall.width",
         "front": "hall.front", "centre_x": "hall.centre_x"},
        {"name": "left_wing", "kind": "box", "right": "hall.left", "depth": 3.0, "height": "hall.height"},
        {"name": "right_wing", "kind": "box", "mirrored": {"of": "left_wing", "across": "hall.centre_x"}},
        {"name": "door", "kind": "wall", "front": "porch.front", "bottom": 0.0, "width": 1.0, "height": 2.0,
         "centre_x": 0.5},
    ]  # fmt: skip
    values = {"x of block 'porch'": 1.0, "height of block 'spire'": 5.0, "width of block 'left_wing'": 2.5,
              "z of block 'left_wing'": -2.0}  # fmt: skip
    found = sides(blocks, values)
    assert found["hall"].tolist() == [[-3, 0, -5], [3, 4, 5]]
    assert found["porch"].tolist() == [[-1, 0, 5], [3, 1, 7]]
    assert found["spire"].tolist() == [[-3, 4, -1], [3, 9, 5]]
    assert found["left_wing"].tolist() == [[-5.5, 0, -3.5], [-3, 4, -0.5]]
    assert found["right_wing"].tolist() == [[3, 0, -3.5], [5.5, 4, -0.5]]
    assert found["door"].tolist() == [[0, 0, 7], [1, 2, 7]]


@pytest.mark.parametrize(
    ("block", "message"),
    [
        ({"kind": "box", "turn": 30.0, "left": "hall.right"}, "hall is turned otherwise, so that nothing aligns"),
        ({"kind": "box", "turn": "hal"}, "no block above it 'hal'; did you mean hall"),
        ({"kind": "roof", "mirrored": {"of": "hall", "across": "hall.left"}}, "of another kind or turned otherwise"),
        ({"kind": "box", "mirrored": {"of": "hall", "across": "hall.top"}}, "expected an upright plane like"),
        ({"kind": "box", "width": 2.0, "mirrored": {"of": "hall", "across": "hall.left"}}, "its width is that of hall"),
        ({"kind": "revolution", "depth": 1.0}, "a revolution is as deep as it is wide"),
        ({"kind": "revolution", "profile": [[1, 0]]}, "profile goes from height 0"),
    ],
)
def test_constraints_that_cannot_be_are_refused(block, message):
    with pytest.raises(ValueError, match=message):
        modelled([BlockTable(**HALL), BlockTable(name="other", **block)])


def test_round_edges_are_found_from_points_on_them():
    blocks = [
        {"name": "base", "kind": "box", "width": 4.0},
        {"name": "drum", "kind": "revolution", "on": "base", "centre_x": "base.centre_x", "centre_z": "base.centre_z"},
        {"name": "vault", "kind": "arch", "left": "base.right", "depth": "base.depth", "centre_z": "base.centre_z"},
    ]
    truth = {
        "height of block 'base'": 1.5, "depth of block 'base'": 5.0, "width of block 'drum'": 3.0,
        "height of block 'drum'": 2.0, "width of block 'vault'": 2.5, "height of block 'vault'": 2.0,
    }  # fmt: skip
    size = (1200, 900)
    cameras = [
        Camera.looking_at(np.array(position), np.array([1.0, 1.5, 0]), width=1200, height=900, focal_length=1000)
        for position in ((6.0, 5.0, 11.0), (-7.0, 6.0, 9.0), (9.0, 4.0, -8.0))
    ]
    model = modelled([BlockTable(**block) for block in blocks])
    one = np.array([1.0, *(truth[name] for name in model.lengths)])
    marks: dict[str, Any] = {}
    for number, camera in enumerate(cameras):
        marks[f"p{number}"] = {}
        for index, block in enumerate(model.blocks):
            shown = {edge: camera.project(model.points(index, ring) @ one) for edge, ring in block.body.edges.items()}
            # Of a curve points that are not its own corners.
            marks[f"p{number}"][block.name] = {
                edge: (points if len(points) == 2 else 0.5 * (points[1:-1:7] + points[2::7])).tolist()
                for edge, points in shown.items()
            }
    photographs = [{"name": f"p{k}", "file": "none.jpg", "focal_length": 1000.0} for k in range(3)]
    tables = PlaceTables.model_validate({"photographs": photographs, "blocks": blocks, "marks": marks})
    found = solved(tables, tuple(PhotographFacts(size) for _ in cameras))
    assert found.values[: len(truth)] == pytest.approx([truth[name] for name in model.lengths], rel=1e-3)
    assert max(np.abs(found.residuals)) < 0.2


@pytest.mark.parametrize("seed", range(4))
def test_a_round_block_far_from_all_others_is_found(seed):
    blocks = [{"name": "hall", "kind": "box", "depth": 14.0}, {"name": "well", "kind": "revolution"}]
    truth = {"width of block 'hall'": 7.0, "height of block 'hall'": 8.0, "width of block 'well'": 2.5,
             "height of block 'well'": 1.2, "x of block 'well'": -8.0, "z of block 'well'": 12.0}  # fmt: skip
    cameras = [
        Camera.looking_at(np.array(position), np.array([0.0, 4.0, 4.0]), width=1200, height=900, focal_length=900)
        for position in ((-22.0, 4.0, 32.0), (18.0, 2.5, 34.0), (4.0, 14.0, 38.0))
    ]
    model, random = modelled([BlockTable(**block) for block in blocks]), np.random.default_rng(seed)
    one = np.array([1.0, *(truth[name] for name in model.lengths)])
    marks: dict[str, Any] = {}
    for number, camera in enumerate(cameras):
        marks[f"p{number}"] = {}
        for index, block in enumerate(model.blocks):
            # Every eighth point of a ring's side that faces the camera: what the well itself hides is not marked.
            edges = {}
            for name, ring in block.body.edges.items():
                points = model.points(index, ring if len(ring) == 2 else ring[:-1:8]) @ one
                if len(ring) > 2:
                    near = (points - points.mean(0)) @ (camera.position - points.mean(0)) > 0
                    points = points[near]
                edges[name] = (camera.project(points) + random.normal(0, 0.5, (len(points), 2))).tolist()
            marks[f"p{number}"][block.name] = edges
    photographs = [{"name": f"p{k}", "file": "none.jpg"} for k in range(3)]
    tables = PlaceTables.model_validate({"photographs": photographs, "blocks": blocks, "marks": marks})
    found = solved(tables, tuple(PhotographFacts((1200, 900)) for _ in cameras))
    assert found.values[: len(truth)] == pytest.approx([truth[name] for name in model.lengths], rel=0.03)
    assert found.chi_square < 1.5 * found.freedom

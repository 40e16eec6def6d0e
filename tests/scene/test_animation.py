"""Animated glTF files, written here by hand from the specification."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gltf_files import CORNERS, Channels, animated, as_glb
from relume.errors import UnreadableFile
from relume.scene.gltf.animation import read_animation
from relume.scene.motion.animation import Animation, posed
from relume.scene.shapes.meshes import read_meshes

HALF = np.sqrt(0.5)
TURN = [[0, 0, 0, 1], [0, HALF, 0, HALF], [0, 1, 0, 0]]  # none, a quarter and half a turn about +Y
NODES: list[dict[str, Any]] = [
    {"name": "arm", "translation": [0, 0, 5], "children": [1]},
    {"name": "square", "mesh": 0, "translation": [2, 0, 0]},
]


def written(folder: Path, *args: Any, **kwargs: Any) -> Path:
    path = folder / "moving.glb"
    path.write_bytes(as_glb(*animated(*args, nodes=NODES, **kwargs)))
    return path


def motion_in(path: Path) -> Animation:
    motion = read_animation(path)
    assert motion is not None
    return motion


def vertices(path: Path, time: float) -> np.ndarray:
    (mesh,) = posed(read_meshes(path), motion_in(path), time)
    return mesh.vertices


def corners_at(x: float, y: float, z: float) -> np.ndarray:
    return CORNERS + np.array([x, y, z])


SWING: Channels = [(0, "rotation", [1, 2, 3], TURN, "LINEAR")]


def test_a_node_carries_those_that_hang_on_it(tmp_path):
    path = written(tmp_path, SWING)
    # The arm stands at z = 5 and holds the square 2 m along its x; a turn about +Y takes +X to −Z.
    assert vertices(path, 0.0) == pytest.approx(corners_at(2, 0, 5))
    quarter = np.stack([CORNERS[:, 2], CORNERS[:, 1], -CORNERS[:, 0] - 2 + 5], axis=-1)
    assert vertices(path, 2.0) == pytest.approx(quarter, abs=1e-6)
    assert vertices(path, 99.0) == pytest.approx(CORNERS * [-1, 1, -1] + [-2, 0, 5], abs=1e-6)
    between = Rotation.from_rotvec([0, np.radians(22.5), 0]).apply(corners_at(2, 0, 0)) + np.array([0, 0, 5])
    assert vertices(path, 1.25) == pytest.approx(between, abs=1e-6)


def test_steps_cubics_and_scales(tmp_path):
    steps = written(tmp_path, [(1, "translation", [0, 1], [[0, 0, 0], [0, 9, 0]], "STEP")])
    assert vertices(steps, 0.9) == pytest.approx(corners_at(0, 0, 5))
    assert vertices(steps, 1.0) == pytest.approx(corners_at(0, 9, 5))
    # In slope, value, out slope for each key: from 0 to 1 in 2 s with slopes 0, so that a quarter of the time makes
    # 3/16 − 2/64 of the way.
    keys = [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 0]]
    cubic = written(tmp_path, [(1, "translation", [0, 2], keys, "CUBICSPLINE")])
    assert vertices(cubic, 0.5) == pytest.approx(corners_at(0, 3 / 16 - 2 / 64, 5))
    # The slope that a key is left with is its third, that it is reached with its first: here 2 a second, and 1.
    keys = [[0, 9, 0], [0, 0, 0], [0, 2, 0], [0, 1, 0], [0, 1, 0], [0, 9, 0]]
    sloped = written(tmp_path, [(1, "translation", [0, 2], keys, "CUBICSPLINE")])
    height = 3 / 16 - 2 / 64 + 2 * 2 * (1 / 4 - 2 / 16 + 1 / 64) + 2 * (1 / 64 - 1 / 16)
    assert vertices(sloped, 0.5) == pytest.approx(corners_at(0, height, 5))
    scale = written(tmp_path, [(1, "scale", [0, 1], [[1, 1, 1], [3, 1, 1]], "LINEAR")])
    assert vertices(scale, 0.5) == pytest.approx(CORNERS * [2, 1, 1] + [2, 0, 5])


def test_keys_of_whole_numbers_are_shares(tmp_path):
    path = written(tmp_path, SWING, short=True)
    quarter = np.stack([CORNERS[:, 2], CORNERS[:, 1], -CORNERS[:, 0] - 2 + 5], axis=-1)
    assert vertices(path, 2.0) == pytest.approx(quarter, abs=1e-3)


def test_a_mesh_scaled_to_nothing_is_not_there(tmp_path):
    path = written(tmp_path, [(1, "scale", [0, 1], [[1, 1, 1], [0, 0, 0]], "STEP")])
    motion = motion_in(path)
    assert len(posed(read_meshes(path), motion, 0.5)) == 1 and posed(read_meshes(path), motion, 1.0) == ()


def test_a_mirrored_mesh_keeps_its_faces_outward_and_normals_turn_along(tmp_path):
    path = written(tmp_path, [(1, "scale", [0, 1], [[1, 1, 1], [-1, 1, 1]], "STEP")])
    motion = motion_in(path)
    rest = replace(read_meshes(path)[0], normals=np.tile(np.array([0.6, 0, 0.8], np.float32), (4, 1)))
    (mesh,) = posed((rest,), motion, 1.0)
    a, b, c = mesh.vertices[mesh.faces[0]]
    assert np.cross(b - a, c - a)[2] > 0
    assert mesh.normals is not None
    assert np.allclose(mesh.normals[0], [-0.6, 0, 0.8])


def test_what_does_not_move_is_the_same_to_the_bit(tmp_path):
    path = written(tmp_path, SWING)
    motion, meshes = motion_in(path), read_meshes(path)
    assert posed(meshes, motion, 0.3)[0] is meshes[0]


def test_a_buffer_beside_the_file_or_inside_its_text(tmp_path):
    header, blob = animated(SWING, NODES)
    expected = vertices(written(tmp_path, SWING), 1.6)
    for uri in ("keys%20of.bin", "data:application/octet-stream;base64," + base64.b64encode(blob).decode()):
        (tmp_path / "keys of.bin").write_bytes(blob)
        header["buffers"][0]["uri"] = uri
        path = tmp_path / "moving.gltf"
        path.write_text(json.dumps(header))
        (rest,) = read_meshes(tmp_path / "moving.glb")
        assert np.array_equal(posed((rest,), motion_in(path), 1.6)[0].vertices, expected)


def test_files_without_motion_have_none(tmp_path, shared):
    assert read_animation(shared / "data" / "meshes" / "gltf" / "Box.glb") is None
    assert read_animation(tmp_path / "thing.obj") is None


def test_what_is_not_rendered_is_said(tmp_path):
    header, blob = animated(SWING, NODES)
    header["nodes"] = [{**NODES[0], "skin": 0}, NODES[1]]
    animation = header["animations"][0]
    animation["channels"].append({"sampler": 0, "target": {"node": 1, "path": "weights"}})
    header["animations"].append({"name": "walk", "samplers": [], "channels": []})
    path = tmp_path / "lost.glb"
    path.write_bytes(as_glb(header, blob))
    with pytest.warns(UserWarning, match="not rendered of its motion: the animation 'walk', morph targets, skins"):
        read_animation(path)


@pytest.mark.parametrize("change", ["cut", "node", "loop", "kind", "sparse", "falling", "text"])
def test_a_damaged_file_is_reported_in_one_line(tmp_path, change):
    header, blob = animated(SWING, NODES)
    if change == "cut":
        blob = blob[:70]
    if change == "node":
        header["animations"][0]["channels"][0]["sampler"] = 7
    if change == "loop":
        header["nodes"] = [NODES[0], {**NODES[1], "children": [0]}]
    if change == "kind":
        header["animations"][0]["samplers"][0]["interpolation"] = "BOUNCE"
    if change == "sparse":
        header["accessors"][3]["sparse"] = {}
    if change == "falling":
        header, blob = animated([(0, "rotation", [1, 3, 2], TURN, "LINEAR")], NODES)
    path = tmp_path / "bad.glb"
    path.write_bytes(b"glTF no" if change == "text" else as_glb(header, blob))
    with pytest.raises(UnreadableFile, match=r"bad.glb: .+ \(.+\); export it again") as caught:
        read_animation(path)
    assert "\n" not in str(caught.value)


def test_two_nodes_of_one_name_are_kept_apart_or_refused(tmp_path):
    path = written(tmp_path, SWING)
    motion = motion_in(path)
    two = replace(motion, nodes=(*motion.nodes, motion.nodes[1]))
    with pytest.raises(ValueError, match=r"2 nodes go by the name of the mesh 'square'; give each node a name"):
        posed(read_meshes(path), two, 1.0)
    part = replace(read_meshes(path)[0], name="square_a81f02")  # how the parts of one mesh are named
    assert posed((part,), motion, 2.0)[0].vertices == pytest.approx(vertices(path, 2.0))

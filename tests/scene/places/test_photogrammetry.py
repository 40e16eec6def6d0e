"""Cameras and points of COLMAP, Meshroom, OpenMVG and glTF, in metres, +Y up, as OpenCV projects them."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import trimesh

import relume as rl
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.photograph import Photograph
from relume.scene.places.photogrammetry.reading import KnownDistance

CAMERAS = """# Camera list with one line of data per camera:
1 SIMPLE_PINHOLE 800 600 1000 400 300
2 PINHOLE 800 600 1000 1000 410 290
3 SIMPLE_RADIAL 800 600 1000 400 300 -0.05
4 RADIAL 800 600 1000 400 300 -0.05 0.01
5 OPENCV 800 600 1000 1000 405 298 -0.05 0.01 0.001 -0.002
"""
# A camera at the origin; one turned by 90° about y; the same a unit beside it; then as those.
IMAGES = """# Image list with two lines of data per image:
1 1 0 0 0 0 0 0 1 first view.jpg

2 0.7071067811865476 0 0.7071067811865476 0 0 0 0 2 b.jpg
10.0 20.0 7 30.0 40.0 -1
3 1 0 0 0 -3 0 0 3 c.jpg

4 1 0 0 0 0 -4 0 4 d.jpg

5 1 0 0 0 0.5 0.25 1 5 e.jpg

"""
POINTS = """# 3D point list
7 0.1 0.2 5.0 255 0 0 0.5 1 0 2 0
9 0.1 0.2 7.0 255 0 0 0.5
"""
SEEN = np.array([[0.3, -0.2, 4.0], [-0.5, 0.4, 6.0], [0.8, 0.6, 5.0]])
"""Points of the model's frame, x right and y down, before its first camera."""


def text_model(folder: Path, cameras: str = CAMERAS) -> Path:
    folder.mkdir(exist_ok=True)
    for name, text in (("cameras", cameras), ("images", IMAGES), ("points3D", POINTS)):
        (folder / f"{name}.txt").write_text(text)
    return folder


def binary_model(folder: Path) -> Path:
    """The same by COLMAP's description of its binary files."""
    folder.mkdir()
    numbers = {"SIMPLE_PINHOLE": 0, "PINHOLE": 1, "SIMPLE_RADIAL": 2, "RADIAL": 3, "OPENCV": 4}
    rows = [line.split() for line in CAMERAS.splitlines()[1:]]
    data = struct.pack("<Q", len(rows))
    for number, model, width, height, *given in rows:
        data += struct.pack("<IiQQ", int(number), numbers[model], int(width), int(height))
        data += struct.pack(f"<{len(given)}d", *map(float, given))
    (folder / "cameras.bin").write_bytes(data)
    lines = IMAGES.splitlines()[1:]
    data = struct.pack("<Q", len(lines) // 2)
    for line, points in zip(lines[::2], lines[1::2], strict=True):
        number, *pose, lens, name = line.split(maxsplit=9)
        data += struct.pack("<I7dI", int(number), *map(float, pose), int(lens)) + name.encode() + b"\0"
        words = points.split()
        data += struct.pack("<Q", len(words) // 3)
        for x, y, point in zip(words[::3], words[1::3], words[2::3], strict=True):
            data += struct.pack("<ddq", float(x), float(y), int(point))
    (folder / "images.bin").write_bytes(data)
    data = struct.pack("<Q", 2)
    for number, z, track in ((7, 5.0, [(1, 0), (2, 0)]), (9, 7.0, [])):
        data += struct.pack("<Q3d3BdQ", number, 0.1, 0.2, z, 255, 0, 0, 0.5, len(track))
        data += b"".join(struct.pack("<II", *each) for each in track)
    (folder / "points3D.bin").write_bytes(data)
    return folder


@pytest.mark.parametrize("written", [text_model, binary_model])
def test_a_model_of_colmap_is_read(tmp_path, written):
    place = rl.scene.read_photogrammetry(written(tmp_path / "sparse"), scale=2.0)
    assert [each.name for each in place.photographs] == ["first view.jpg", "b.jpg", "c.jpg", "d.jpg", "e.jpg"]
    assert place.photographs[0].file == tmp_path / "sparse" / "first view.jpg"
    first, second, third, fourth, _ = (each.camera for each in place.photographs)
    # The first camera looks along COLMAP's +Z with y down, which is our −Z with +Y up.
    assert first.rotation == pytest.approx(np.eye(3))
    assert (first.width, first.height, first.focal_length, first.principal_point) == (800, 600, 1000, (400, 300))
    # 0.707, 0, 0.707, 0: from the world's z to the camera's x, so that it looks along the world's −x, our −X.
    assert -second.rotation[:, 2] == pytest.approx([-1, 0, 0])
    assert second.principal_point == (410, 290)
    assert third.position == pytest.approx([6, 0, 0])  # three units of two metres to the right
    assert fourth.position == pytest.approx([0, -8, 0])  # four units down
    assert place.points == pytest.approx(np.array([[0.2, -0.4, -10], [0.2, -0.4, -14]]))
    assert place.meshes() == () and np.isnan(place.photographs[0].deviation.position)


def test_lenses_of_colmap_project_as_opencv_does(tmp_path):
    place = rl.scene.read_photogrammetry(text_model(tmp_path / "sparse"), scale=2.0)
    middle, terms = (405.0, 298.0), np.array([-0.05, 0.01, 0.001, -0.002])
    matrix = np.array([[1000, 0, middle[0]], [0, 1000, middle[1]], [0, 0, 1.0]])
    shown, _ = cv2.projectPoints(SEEN, np.zeros(3), np.array([0.5, 0.25, 1.0]), matrix, terms)
    ours = place.photograph("e.jpg").camera.project(2 * SEEN * [1, -1, -1])
    assert ours == pytest.approx(shown[:, 0], abs=1e-9)
    assert place.photograph("d.jpg").camera.distortion == rl.scene.Distortion(-0.05, 0.01)
    assert place.photograph("c.jpg").camera.distortion == rl.scene.Distortion(-0.05)
    assert place.photograph("b.jpg").camera.distortion is None


def test_the_scale_comes_from_a_distance_between_cameras_or_points(tmp_path):
    model = text_model(tmp_path / "sparse")
    for start, end, metres in (("first view.jpg", "c", 1.5), (7, 9, 1.0), ("7", "9", 1.0), ((0, 0, 0), (0, 3, 0), 1.5)):
        place = rl.scene.read_photogrammetry(model, scale=KnownDistance(start, end, metres))
        assert place.photograph("c.jpg").camera.position == pytest.approx([1.5, 0, 0])
    for start, end, message in (
        ("c.jpg", "z.jpg", "no camera of a photograph 'z.jpg'; it holds first view.jpg, b.jpg"),
        (7, 8, "no point 8; it holds 2 points"),
        ("c.jpg", "c", "are the same place"),
    ):
        with pytest.raises(ValueError, match=message):
            rl.scene.read_photogrammetry(model, scale=KnownDistance(start, end, 1.0))
    with pytest.raises(ValueError, match="photogrammetry has no scale; give the metres of one unit, or a distance"):
        rl.scene.read_photogrammetry(model)
    with pytest.raises(ValueError, match="expected a number above 0"):
        rl.scene.read_photogrammetry(model, scale=-1.0)


def test_what_points_up_and_a_mesh_are_carried_with_the_cameras(tmp_path):
    model = text_model(tmp_path / "sparse")
    trimesh.Trimesh([[0, 0, 1], [1, 0, 1], [0, 0, 2]], [[0, 1, 2]]).export(tmp_path / "mesh.ply")
    place = rl.scene.read_photogrammetry(model, scale=2.0, up=(0, 0, 1), mesh=tmp_path / "mesh.ply")
    (mesh,) = place.meshes()
    assert mesh.vertices[:, 1] == pytest.approx([2, 2, 4])  # z is up
    # What a camera shows of it is the same whichever way is up.
    plain = rl.scene.read_photogrammetry(model, scale=2.0, mesh=tmp_path / "mesh.ply")
    for one, other in zip(place.photographs, plain.photographs, strict=True):
        expected = other.camera.project(plain.meshes()[0].vertices)
        assert one.camera.project(mesh.vertices) == pytest.approx(expected, nan_ok=True)
    assert np.linalg.det(place.photographs[0].camera.rotation) == pytest.approx(1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "SIMPLE_PINHOLE 800 600 1000 400 300",
            "OPENCV_FISHEYE 800 600 1 1 4 3 0 0 0 0",
            "is a OPENCV_FISHEYE; SIMPLE",
        ),
        ("PINHOLE 800 600 1000 1000", "PINHOLE 800 600 1000 1100", "pixels are not square"),
        ("SIMPLE_PINHOLE 800 600 1000 400 300", "SIMPLE_PINHOLE 800 600 1000", "1 parameters; a SIMPLE_PINHOLE has 3"),
        ("1 SIMPLE_PINHOLE", "6 SIMPLE_PINHOLE", "names camera 1, which is not there"),
    ],
)
def test_cameras_that_are_not_read_are_refused(tmp_path, old, new, message):
    with pytest.raises(UnreadableFile, match=message):
        rl.scene.read_photogrammetry(text_model(tmp_path / "sparse", CAMERAS.replace(old, new, 1)), scale=1.0)


def test_a_damaged_model_is_refused(tmp_path):
    model = binary_model(tmp_path / "sparse")
    for name in ("cameras", "images", "points3D"):
        path = model / f"{name}.bin"
        whole = path.read_bytes()
        path.write_bytes(whole[:-5])
        with pytest.raises(UnreadableFile, match="not a readable COLMAP model"):
            rl.scene.read_photogrammetry(model, scale=1.0)
        path.write_bytes(b"\xff" * 8 + whole[8:])
        with pytest.raises(UnreadableFile, match="claims"):
            rl.scene.read_photogrammetry(model, scale=1.0)
        path.write_bytes(whole)
    # The number of the first point, which is beyond what numbers of points can be.
    whole = (model / "points3D.bin").read_bytes()
    (model / "points3D.bin").write_bytes(whole[:8] + b"\xff" * 8 + whole[16:])
    with pytest.raises(UnreadableFile, match="not a readable COLMAP model"):
        rl.scene.read_photogrammetry(model, scale=1.0)
    with pytest.raises(UnreadableFile, match="no COLMAP model"):
        rl.scene.read_photogrammetry(tmp_path, scale=1.0)


ROTATION = np.array([[0.8, 0.0, -0.6], [0.0, 1.0, 0.0], [0.6, 0.0, 0.8]])
"""Camera from world; not its own transpose."""


def alicevision(version: list[str], principal: list[str], lens: dict[str, Any]) -> dict[str, Any]:
    return {
        "version": version,
        "views": [
            {"viewId": "11", "poseId": "11", "intrinsicId": "5", "path": "/far/away/a.jpg", "width": "800",
             "height": "600"},
            {"viewId": "12", "poseId": "12", "intrinsicId": "5", "path": "/far/away/lost.jpg", "width": "800",
             "height": "600"},
        ],
        "intrinsics": [{"intrinsicId": "5", "width": "800", "height": "600", "type": "radial3",
                        "principalPoint": principal, "distortionParams": ["-0.05", "0.01", "0.002"], **lens}],
        "poses": [{"poseId": "11", "pose": {"transform": {
            # By columns.
            "rotation": [str(value) for value in ROTATION.T.reshape(-1)], "center": ["1", "2", "-3"]}}}],
        "structure": [{"landmarkId": "3", "X": ["0.5", "0.25", "4"]}],
    }  # fmt: skip


def openmvg() -> dict[str, Any]:
    def wrapped(data: dict[str, Any]) -> dict[str, Any]:
        return {"ptr_wrapper": {"id": 1, "data": data}}

    lens = {"width": 800, "height": 600, "focal_length": 1000.0, "principal_point": [405.0, 298.0]}
    view = {"filename": "a.jpg", "width": 800, "height": 600, "id_view": 0, "id_intrinsic": 0, "id_pose": 0}
    return {
        "views": [{"key": 0, "value": wrapped(view)}],
        "intrinsics": [{"key": 0, "value": wrapped({**lens, "disto_k3": [-0.05, 0.01, 0.002]})}],
        "extrinsics": [{"key": 0, "value": {"rotation": ROTATION.tolist(), "center": [1.0, 2.0, -3.0]}}],
        "structure": [{"key": 3, "value": {"X": [0.5, 0.25, 4.0], "observations": []}}],
    }


@pytest.mark.parametrize(
    "found",
    [
        openmvg(),
        alicevision(["1", "2", "1"], ["5", "-2"], {"pxFocalLength": ["1000", "1000"]}),
        alicevision(["1", "2", "6"], ["5", "-2"], {"focalLength": "45", "sensorWidth": "36", "pixelRatio": "1"}),
        alicevision(["1", "0", "0"], ["405", "298"], {"pxFocalLength": "1000"}),
    ],
)
def test_models_of_openmvg_and_meshroom_project_as_opencv_does(tmp_path, found):
    path = tmp_path / "sfm.json"
    path.write_text(json.dumps(found))
    place = rl.scene.read_photogrammetry(path, scale=2.0)
    (photograph,) = place.photographs  # the other one has no pose
    assert (photograph.name, photograph.file) == ("a.jpg", tmp_path / "a.jpg")
    assert photograph.camera.position == pytest.approx([2, -4, 6])
    assert place.points == pytest.approx(np.array([[1, -0.5, -8]]))
    matrix = np.array([[1000, 0, 405], [0, 1000, 298], [0, 0, 1.0]])
    turned, _ = cv2.Rodrigues(ROTATION)
    moved = -ROTATION @ np.array([1.0, 2.0, -3.0])
    world = (SEEN - moved) @ ROTATION  # before the camera
    shown, _ = cv2.projectPoints(world, turned, moved, matrix, np.array([-0.05, 0.01, 0, 0, 0.002]))
    assert photograph.camera.project(2 * world * [1, -1, -1]) == pytest.approx(shown[:, 0], abs=1e-9)


def test_a_pose_that_mirrors_is_refused(tmp_path):
    path = tmp_path / "sfm.json"
    mirrored = alicevision(["1", "2", "6"], ["5", "-2"], {"pxFocalLength": "1000"})
    turned = (ROTATION.T * [1, 1, -1]).reshape(-1)
    mirrored["poses"][0]["pose"]["transform"]["rotation"] = [str(value) for value in turned]
    other = openmvg()
    other["extrinsics"][0]["value"]["rotation"] = (ROTATION * [[1], [-1], [1]]).tolist()
    for found in (mirrored, other):
        path.write_text(json.dumps(found))
        with pytest.raises(UnreadableFile, match="a pose's rotation mirrors the place"):
            rl.scene.read_photogrammetry(path, scale=1.0)


def test_json_that_is_no_model_is_refused(tmp_path):
    path = tmp_path / "sfm.json"
    endless = openmvg()
    endless["structure"][0]["key"] = 10**30
    for text, message in (
        ("{", "no model of Meshroom or OpenMVG"),
        ("[]", "no model of Meshroom or OpenMVG"),
        ('{"views": [], "intrinsics": []}', "holds no photograph with a pose"),
        (json.dumps(endless), "no model of Meshroom or OpenMVG"),
        (
            json.dumps(alicevision(["1", "2", "6"], ["0", "0"], {"pxFocalLength": "9", "type": "fisheye4"})),
            "of type fish",
        ),
    ):
        path.write_text(text)
        with pytest.raises(UnreadableFile, match=message):
            rl.scene.read_photogrammetry(path, scale=1.0)
    with pytest.raises(UnreadableFile, match="no such model"):
        rl.scene.read_photogrammetry(tmp_path / "none.json", scale=1.0)


def test_cameras_of_gltf_are_named_as_the_photographs(tmp_path):
    header = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"name": "a", "camera": 0, "translation": [1, 2, 3]}, {"name": "b", "camera": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 2 * np.arctan(0.5), "znear": 0.1}}],
    }  # fmt: skip
    (tmp_path / "views.gltf").write_text(json.dumps(header))
    (tmp_path / "pictures").mkdir()
    for name in ("a.png", "b.png"):
        files.write(tmp_path / "pictures" / name, Photograph(np.zeros((30, 40, 3), np.uint8)))
    place = rl.scene.read_photogrammetry(tmp_path / "views.gltf", photographs=tmp_path / "pictures")
    camera = place.photograph("a.png").camera  # in metres, +Y up already
    assert camera.position == pytest.approx([1, 2, 3]) and camera.rotation == pytest.approx(np.eye(3))
    assert (camera.width, camera.height, camera.focal_length) == (40, 30, pytest.approx(30))
    (tmp_path / "pictures" / "b.png").unlink()
    with pytest.raises(UnreadableFile, match="camera 'b' has no photograph in"):
        rl.scene.read_photogrammetry(tmp_path / "views.gltf", photographs=tmp_path / "pictures")


def test_a_place_file_can_name_photogrammetry(tmp_path):
    model = text_model(tmp_path / "sparse")
    trimesh.Trimesh([[0, 0, 1], [1, 0, 1], [0, 0, 2]], [[0, 1, 2]]).export(tmp_path / "mesh.ply")
    known = KnownDistance("first view.jpg", 7, 10.0)
    begun = rl.scene.new_place_file(model, tmp_path / "p.toml", scale=known, up=(0, 0, 1), mesh=tmp_path / "mesh.ply")
    assert (begun.photographs, begun.points, begun.meshes, begun.solved) == (5, 2, 1, True)
    place = rl.scene.read_place(tmp_path / "p.toml")
    whole = rl.scene.read_photogrammetry(model, scale=known, up=(0, 0, 1), mesh=tmp_path / "mesh.ply")
    assert place.points == pytest.approx(whole.points)
    assert place.meshes()[0].vertices == pytest.approx(whole.meshes()[0].vertices)
    camera = rl.read_camera(tmp_path / "p.toml", 400, 300, name="c.jpg")
    assert camera.position == pytest.approx(whole.photograph("c.jpg").camera.position)
    assert rl.model_place(tmp_path / "p.toml", export=tmp_path / "p.glb").points == pytest.approx(place.points)
    assert (tmp_path / "p.glb").is_file()
    with pytest.raises(ValueError, match="there is nothing to find"):
        rl.model_place(tmp_path / "p.toml", out=tmp_path / "q.toml")
    with pytest.raises(ValueError, match="has no scale"):
        rl.scene.new_place_file(model, tmp_path / "r.toml")
    assert not (tmp_path / "r.toml").exists()

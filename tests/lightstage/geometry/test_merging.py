"""Scans from several sides made one surface: a ball's radius and the stage's head as truth."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from command_line import refused, reported
from relume.lightstage.geometry.merging import MergedScan, MergingSettings, merge_scans
from relume.lightstage.geometry.patterns import ProjectorPatterns
from relume.lightstage.geometry.rig import ScannerRig, write_rig
from relume.lightstage.geometry.scan import Scan, scan
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.meshes import read_meshes
from structured_light import HEAD, Shooting, ball, head_of_stage, photographed, pictures, rig, sight, write_photographs

pytest.importorskip("skimage", reason="several views need scikit-image")
PATTERNS = ProjectorPatterns(320, 240)
SHOOTING = Shooting(exposure=0.9)
RADIUS = 0.09


def around(first: ScannerRig, turn: float) -> ScannerRig:
    """The rig walked round the target by an angle, radians."""
    sine, cosine = np.sin(turn), np.cos(turn)
    place = np.array([sine, 0, cosine]) * np.linalg.norm(first.camera.position)
    focal = first.camera.focal_length
    return first.placed(
        Camera.looking_at(place, np.zeros(3), width=first.camera.width, height=first.camera.height, focal_length=focal)
    )


def scans_of(shapes, first: ScannerRig, turns: tuple[float, ...], shooting: Shooting = SHOOTING) -> list[Scan]:
    rigs = [around(first, np.radians(turn)) for turn in turns]
    return [scan(photographed(shapes, each, PATTERNS, shooting, seed=i), each) for i, each in enumerate(rigs)]


SMALL = rig(120, 90, distance=0.84, target=np.zeros(3), slant=0.35, field=0.3)


def test_a_ball_from_three_sides_is_one_closed_surface():
    scans = scans_of([ball(RADIUS)], SMALL, (0, 120, 240))
    found = merge_scans(scans)
    distance = np.linalg.norm(found.mesh.vertices, axis=1)
    assert 1e3 * np.sqrt(np.mean((distance - RADIUS) ** 2)) < 0.2
    # All round: seen from above every side has its share; one scan sees less than half.
    side = np.arctan2(found.mesh.vertices[:, 0], found.mesh.vertices[:, 2])
    assert np.histogram(side, 12, (-np.pi, np.pi))[0].min() > 0.5 * len(side) / 12
    # Faces and normals look outward, and neighbours share their vertices.
    corners = found.mesh.vertices[found.mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert (np.einsum("nk,nk->n", across, corners.mean(axis=1)) > 0).mean() > 0.999
    assert found.mesh.normals is not None
    assert np.median(np.einsum("nk,nk->n", found.mesh.normals, found.mesh.vertices) / distance) > 0.99
    assert np.isclose(found.cell, 0.3 / 120, rtol=0.1) and 0 < found.apart < 0.5e-3
    assert found.facts()["vertices"] == len(distance)


def test_two_views_are_quieter_than_one():
    noisy = Shooting(exposure=0.9, noise=(0.02, 0.02))
    scans = scans_of([ball(RADIUS)], SMALL, (0, 10), noisy)
    spread = [np.std(np.linalg.norm(each.surface[each.kept], axis=1)) for each in scans]
    merged = merge_scans(scans).mesh.vertices
    assert np.std(np.linalg.norm(merged, axis=1)) < 0.75 * min(spread)


def test_scans_that_stand_wrong_are_told():
    scans = scans_of([ball(RADIUS)], SMALL, (0, 20))
    step = np.array([0, 0, 0.007])
    moved = replace(scans[1].rig.camera, position=scans[1].rig.camera.position + step)
    wrong = replace(scans[1], surface=scans[1].surface + step, rig=replace(scans[1].rig, camera=moved))
    with pytest.warns(UserWarning, match="the scans contradict each other by [2-6]"):
        merge_scans([scans[0], wrong])
    with pytest.raises(ValueError, match="1 scans; give two or more"):
        merge_scans(scans[:1])
    with pytest.raises(ValueError, match="does not fit into memory; give a larger cell"):
        merge_scans(scans, MergingSettings(cell=1e-5))


@pytest.mark.skipif(not HEAD.is_dir(), reason="needs the light stage in shared/stages")
def test_the_head_from_three_sides():
    head = head_of_stage()
    first = rig(200, 150, distance=0.84, target=np.zeros(3), slant=np.radians(20), field=0.36)
    found = merge_scans(scans_of(head, first, (-50, 0, 50)))
    assert isinstance(found, MergedScan)
    # From 5 mm before each vertex back along its normal, where the true surface is.
    assert found.mesh.normals is not None
    before = (found.mesh.vertices + 0.005 * found.mesh.normals).astype(np.float64)
    off = np.array(RayCaster.of(head).nearest(before, -found.mesh.normals.astype(np.float64)).distance) - 0.005
    near = np.abs(off) < 0.003
    assert near.mean() > 0.99
    assert 1e3 * np.sqrt(np.mean(off[near] ** 2)) < 0.15  # 0.12 mm measured


def test_the_command_merges_the_cameras_of_a_stage(tmp_path, capsys):
    names, cameras = [], {}
    for turn in (0, 90):
        own = around(SMALL, np.radians(turn))
        folder = tmp_path / str(turn)
        folder.mkdir()
        write_photographs(folder, pictures(sight([ball(RADIUS)], own), PATTERNS, SHOOTING), PATTERNS)
        place = {"position": own.camera.position.tolist(), "look_at": [0, 0, 0], "hfov_deg": 20}
        names, cameras = [*names, folder], {**cameras, f"at {turn}": place}
    # The second camera took no pictures under the stage's lights.
    light = {"files": {"at 0": "0/white.png"}, "direction": [0, 0, 1]}
    (tmp_path / "stage.json").write_text(json.dumps({"lights": [light], "cameras": cameras}))
    write_rig(tmp_path / "rig.json", SMALL)
    out = tmp_path / "ball.glb"
    command = ["stage", "scan", *names, "--rig", tmp_path / "rig.json", "--stage", tmp_path, "-o", out]
    assert "several folders of photographs: give --stage, and --camera for each" in refused(command, capsys)
    assert "2 folders of photographs, but 1 --camera" in refused([*command, "--camera", "at 0"], capsys)
    command += ["--camera", "at 0", "--camera", "at 90"]
    told = reported([*command, "--no-register"], capsys)
    (mesh,) = read_meshes(out)
    assert told["vertices"] == len(mesh.vertices)
    assert np.sqrt(np.mean((np.linalg.norm(mesh.vertices, axis=1) - RADIUS) ** 2)) < 3e-4

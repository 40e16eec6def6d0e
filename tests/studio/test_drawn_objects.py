"""Objects as they are drawn while they are dragged: few triangles that look like many; and a worker's interruption."""

from __future__ import annotations

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
import trimesh

import relume as rl

for needed in ("starlette", "tomlkit", "fast_simplification"):
    pytest.importorskip(needed, reason="the extra studio is not installed")


def mesh_of(body: trimesh.Trimesh, normals: np.ndarray | None) -> rl.Mesh:
    return rl.Mesh(np.asarray(body.vertices), np.asarray(body.faces), rl.scene.PRESETS["porcelain"], normals=normals)


def test_a_fine_ball_of_few_triangles_is_round_and_shaded_smoothly():
    from relume.studio.shots.objects import drawn_triangles

    body = trimesh.creation.icosphere(5, 0.1)
    corners, normals = drawn_triangles(mesh_of(body, np.asarray(body.vertex_normals)), 2500)
    assert len(body.faces) == 20480 and 2400 <= len(corners) <= 2500
    radii = np.linalg.norm(corners, axis=-1)
    assert radii.min() > 0.099 and radii.max() < 0.101
    # At each corner the normal is the ball's own there, within what the nearest vertex is away.
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-6)
    assert (normals * corners / radii[..., None]).sum(-1).min() > np.cos(np.radians(3))
    # Nothing is missing: the triangles' own area is the ball's.
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert 0.5 * np.linalg.norm(across, axis=-1).sum() == pytest.approx(4 * np.pi * 0.1**2, rel=0.01)


@pytest.mark.parametrize("given", [True, False], ids=["normals", "no normals"])
def test_a_fine_box_keeps_its_edges(given: bool):
    from relume.studio.shots.objects import drawn_triangles

    body = trimesh.creation.box((0.2, 0.1, 0.3))
    for _ in range(6):
        body = body.subdivide()
    # Each side has vertices of its own, as meshes with sharp edges have.
    flat = np.repeat(np.asarray(body.face_normals), 3, axis=0)
    apart = np.arange(3 * len(body.faces)).reshape(-1, 3)
    loose = trimesh.Trimesh(np.asarray(body.triangles).reshape(-1, 3), apart, process=False)
    corners, normals = drawn_triangles(mesh_of(loose, flat if given else None), 1000)
    assert len(loose.faces) == 49152 and len(corners) <= 1000
    assert corners.reshape(-1, 3).max(0) == pytest.approx([0.1, 0.05, 0.15], abs=1e-5)
    assert corners.reshape(-1, 3).min(0) == pytest.approx([-0.1, -0.05, -0.15], abs=1e-5)
    # Every triangle lies in a side, and its corners are lit as that side is.
    assert np.sort(np.abs(normals), axis=-1)[..., -1].min() > 0.999
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(across, axis=-1)
    fits = (normals * (across / np.maximum(area, 1e-12)[:, None])[:, None]).sum(-1)
    assert fits[area > 1e-7].min() > 0.999
    assert 0.5 * area.sum() == pytest.approx(2 * (0.2 * 0.1 + 0.2 * 0.3 + 0.1 * 0.3), rel=1e-3)


def test_a_mesh_of_few_triangles_stays_as_it_is():
    from relume.studio.shots.objects import drawn_triangles

    body = trimesh.creation.icosphere(1, 0.1)
    corners, _ = drawn_triangles(mesh_of(body, None), 2500)
    assert np.array_equal(corners, body.triangles)


def test_meshes_asked_for_at_once_are_not_mixed_up():
    from relume.studio.shots.objects import drawn_triangles

    radii = (0.1, 0.2, 0.3, 0.4)
    balls = [mesh_of(trimesh.creation.icosphere(5, radius), None) for radius in radii]
    with ThreadPoolExecutor(4) as threads:
        for _ in range(3):
            drawn = threads.map(drawn_triangles, balls, 4 * [2500])
            for radius, (corners, _) in zip(radii, drawn, strict=True):
                np.testing.assert_allclose(np.linalg.norm(corners, axis=-1), radius, rtol=0.01)


INTERRUPTED = """
import importlib, signal, sys, time
from relume.studio.shots.worker import stop_where_modules_are_whole
signal.signal(signal.SIGINT, stop_where_modules_are_whole)
signal.signal(signal.SIGALRM, lambda number, frame: signal.raise_signal(signal.SIGINT))
sys.path.insert(0, sys.argv[1])
try:
    importlib.import_module("halfway")
    print("whole" if sys.modules["halfway"].whole else "", flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    print("stopped", "halfway" in sys.modules)
"""


@pytest.mark.skipif(not hasattr(__import__("signal"), "setitimer"), reason="this system has no timers of signals")
def test_an_interruption_waits_until_a_module_is_whole(tmp_path: Path):
    (tmp_path / "halfway.py").write_text("import signal\nsignal.raise_signal(signal.SIGINT)\nwhole = True\n")
    said = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, str(tmp_path)], capture_output=True, text=True, timeout=50,
        env={"PYTHONPATH": ":".join(sys.path), "PATH": ""},
    )  # fmt: skip
    assert said.stdout.split() == ["whole", "stopped", "True"], said.stderr

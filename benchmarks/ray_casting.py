"""Rays on one core: ours against Embree's (through `embreex`, where it is installed), few triangles against many, and
how long the tree takes."""

from __future__ import annotations

import importlib
import statistics
import time
from collections.abc import Callable

import numpy as np

from relume.render.raycast import RayCaster
from relume.render.raycast_surface import Surfaces
from relume.scene.camera import Camera
from relume.scene.materials import Diffuse
from relume.scene.shapes import Mesh

ROUNDS = 9
EYE = np.array([0.0, 0.6, 3.0])


def dented_ball(rows: int) -> Mesh:
    """A ball with dents, of 4·rows² − 4·rows triangles."""
    v, u = np.meshgrid(np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, 2 * rows + 1), indexing="ij")
    radius = 1 + 0.1 * np.sin(7 * np.cos(v)) * np.sin(v) * np.cos(8 * u)
    points = radius[..., None] * np.stack([np.sin(v) * np.sin(u), np.cos(v), np.sin(v) * np.cos(u)], axis=-1)
    corner = (np.arange(rows)[:, None] * (2 * rows + 1) + np.arange(2 * rows)).ravel()
    below = corner + 2 * rows + 1
    upper, lower = np.stack([corner, below, corner + 1], -1), np.stack([corner + 1, below, below + 1], -1)
    # At the poles one of each pair has no area.
    faces = np.concatenate([upper[: -2 * rows], lower[2 * rows :]])
    order = np.random.default_rng(0).permutation(len(faces))
    return Mesh(points.reshape(-1, 3).astype(np.float32), faces[order].astype(np.int32), Diffuse((0.5, 0.5, 0.5)))


def seconds(work: Callable[[], object]) -> float:
    """The median time of several runs after a first."""
    times = []
    for _ in range(ROUNDS + 1):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return statistics.median(times[1:])


def embree_seconds(mesh: Mesh, directions: np.ndarray) -> tuple[float, int] | None:
    """Embree's time for the same rays, one by one, and how many hit; None where it is not installed."""
    try:
        construction = importlib.import_module("embreex.mesh_construction")
        scenes = importlib.import_module("embreex.rtcore_scene")
    except ImportError:
        return None
    scene = scenes.EmbreeScene()
    construction.TriangleMesh(scene, mesh.vertices[mesh.faces])
    rays = np.tile(EYE.astype(np.float32), (len(directions), 1)), directions.astype(np.float32)
    return seconds(lambda: scene.run(*rays)), int(np.sum(scene.run(*rays) >= 0))


if __name__ == "__main__":
    camera = Camera.looking_at(EYE, np.zeros(3), width=640, height=480, focal_length=600)
    directions = camera.rays().reshape(-1, 3)
    count, of_size = len(directions), {}
    for rows in (50, 159, 501):
        mesh = dented_ball(rows)
        RayCaster.of([dented_ball(4)]).nearest(EYE, directions[:1])  # compiles
        start = time.perf_counter()
        caster = RayCaster.of([mesh])
        built = time.perf_counter() - start
        of_size[rows] = seconds(lambda caster=caster: caster.nearest(EYE, directions, threads=1))
        rate = count / of_size[rows] / 1e6
        limit = " (limit 4 s)" if rows == 501 else ""
        print(f"{rate:6.2f} Mrays/s  {len(mesh.faces)} triangles; tree built in {built:.2f} s{limit}")
        if rows != 159:
            continue
        hits = caster.nearest(EYE, directions)
        met = int(np.sum(hits.shape >= 0))
        rate = count / seconds(lambda caster=caster: caster.occluded(EYE, directions, threads=1)) / 1e6
        print(f"{rate:6.2f} Mrays/s  the same, whether anything is met; {met / count:.0%} of the rays do")
        surfaces = Surfaces.of([mesh])
        each = seconds(lambda surfaces=surfaces, hits=hits: surfaces.at(EYE, directions, hits, threads=1)) / met
        print(f"{each * 1e9:6.0f} ns       point, normals and derivatives of a hit (limit 100 ns)")
        peer = embree_seconds(mesh, directions)
        if peer is None:
            print("embreex is not installed: no comparison with Embree")
        else:
            print(f"{count / peer[0] / 1e6:6.2f} Mrays/s  Embree, single precision; {peer[1] - met:+d} hits")
            print(f"{peer[0] / of_size[rows]:6.2f} ×        ours to Embree's (goal 0.3 ×)")
    print(f"{of_size[501] / of_size[50]:6.2f} ×        time of a million triangles to ten thousand's (limit 3 ×)")

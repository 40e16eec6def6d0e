"""Rays on one core: ours against Embree's (through `embreex`, where it is installed), few triangles against many, how
long the tree takes; and bicubic patches against as many triangles as show the same."""

from __future__ import annotations

import importlib
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from measured import Rows, asked

from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.shapes.shapes import Mesh, Patches, read_patches
from relume.scene.shapes.tessellation import tessellated
from relume.sphere.directions import rotation_about

ROUNDS = 9
EYE = np.array([0.0, 0.6, 3.0])
TEAPOT_EYE = np.array([1.0, 4.5, 8.0])
FOOTPRINT = 2e-5
"""Radians: a fiftieth of a pixel of these pictures."""
TEAPOT = Path(__file__).resolve().parents[1] / "examples" / "whitted" / "teapot.bpt"


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
    options = asked(__doc__).parse_args()
    rows_of_table = Rows(options.rows)
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
        note = f"tree built in {built:.2f} s, limit 4 s for a million"
        rows_of_table.value(f"rays on one core, {len(mesh.faces)} triangles", rate, "Mrays/s", note=note)
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
            rows_of_table.value(
                f"the same, ours to Embree's, {len(mesh.faces)} triangles", peer[0] / of_size[rows], "×",
                limit="≥ 0.3", ours=of_size[rows], peer="Embree, single precision", theirs=peer[0],
            )  # fmt: skip
    rows_of_table.value("rays, a million triangles against ten thousand", of_size[501] / of_size[50], "×", limit="≤ 3")
    if options.quick:
        raise SystemExit

    upright = rotation_about(np.array([1.0, 0.0, 0.0]), -np.pi / 2)  # published Z up
    teapot = Patches(read_patches(TEAPOT) @ upright.T, Diffuse((0.5, 0.5, 0.5)), "teapot")
    camera = Camera.looking_at(TEAPOT_EYE, np.array([0.2, 1.4, 0.0]), width=640, height=480, focal_length=950)
    directions = camera.rays().reshape(-1, 3)
    start = time.perf_counter()
    patches, surfaces = RayCaster.of([teapot]), Surfaces.of([teapot])
    built = time.perf_counter() - start
    hits = patches.nearest(TEAPOT_EYE, directions, footprint=FOOTPRINT)
    met = int(np.sum(hits.shape >= 0))
    patched = seconds(lambda: patches.nearest(TEAPOT_EYE, directions, footprint=FOOTPRINT, threads=1))
    note = f"{met / count:.0%} of the rays hit"
    rows_of_table.value("rays, the teapot's 32 patches", count / patched / 1e6, "Mrays/s", limit="≥ 1.5", note=note)
    print(f"{built:6.2f} s        to split it into {len(patches.geometry.form)} leaves and build their tree")
    each = seconds(lambda: surfaces.at(TEAPOT_EYE, directions, hits, threads=1)) / met
    print(f"{each * 1e9:6.0f} ns       point, normals and derivatives of a hit on it")
    mesh = tessellated(teapot)
    triangles = RayCaster.of([mesh])
    meshed = seconds(lambda: triangles.nearest(TEAPOT_EYE, directions, threads=1))
    print(f"{patched / meshed:6.2f} ×        time of the patches to that of {len(mesh.faces)} triangles")

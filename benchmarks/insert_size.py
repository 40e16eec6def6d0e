"""What an object of 1.9 million triangles costs beside one of 20 thousand, and the room at full size.

    python benchmarks/insert_size.py [--quick]

The first: one diffuse ball on the table of examples/room, at 384×256; the second: all five objects at 768×512; with
`--quick` a third as wide, fewer turns and 16 rays a pixel. Seconds of the second call, kernels already compiled,
building included; the two balls by turns.
"""

from __future__ import annotations

import time

import numpy as np
import trimesh
from insert_scenes import room
from measured import Rows, asked

import relume as rl
from relume.renderers.mitsuba.differential import Differential

SAMPLES = 64


def ball(rings: int) -> rl.Mesh:
    """A ball of about 4·rings² triangles, standing on the table."""
    # Of small radius trimesh leaves out the small triangles at the poles.
    body = trimesh.creation.uv_sphere(radius=1.0, count=[rings, rings])
    vertices = (0.1 * np.asarray(body.vertices) + np.array([0, 0.1, 0])).astype(np.float32)
    return rl.Mesh(vertices, body.faces.astype(np.int32), rl.Diffuse((0.6, 0.5, 0.4)))


def seconds(scene: rl.Scene, camera: rl.Camera, samples: int, seed: int) -> tuple[float, float]:
    """Of one call; and the standard error of the change over the mean radiance of the objects."""
    start = time.perf_counter()
    change = Differential(samples).change(scene, camera, seed=seed)
    taken = time.perf_counter() - start
    error = (
        np.sqrt(change.difference_variance + change.objects_variance).mean() / change.objects[change.matte > 0].mean()
    )
    return taken, float(error)


def main(rows: Rows, quick: bool) -> None:
    share, turns, counts = (3, 2, (16,)) if quick else (1, 3, (16, 32, 64))
    scene, camera = room(384 // share)
    balls = [ball(rings) for rings in (71, 686)]
    scenes = [rl.Scene(scene.light, scene.local, (one,)) for one in balls]
    times: list[list[float]] = [[], []]
    for turn in range(turns + 1):
        for which, each in enumerate(scenes):
            taken, _ = seconds(each, camera, SAMPLES, turn)
            if turn:
                times[which].append(taken)
    few, many = (len(one.faces) for one in balls)
    rows.value(f"{many} triangles against {few}", [b / a for a, b in zip(*times, strict=True)], "×", goal="triangles")
    scene, camera = room(768 // share)
    for samples in counts:
        seconds(scene, camera, samples, 0)
        taken, error = seconds(scene, camera, samples, 1)
        rows.value(f"{camera.width}×{camera.height}, {samples} rays a pixel", taken, "s", limit="≤ 30",
                   note=f"standard error {100 * error:.2f} % of the objects' mean, before denoising")  # fmt: skip


if __name__ == "__main__":
    options = asked(__doc__).parse_args()
    main(Rows(options.rows), options.quick)

"""A store of eight times the memory is imported, relit and measured within that memory, seen from outside."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("zarr", reason="the extra lightstage is not installed")

LIGHTS, ROWS, COLUMNS = 512, 256, 512
CAP = LIGHTS * ROWS * COLUMNS * 3 * 2 // 8
"""Bytes: an eighth of the store's values, 50 MB."""
PICTURES = 144, 512, 1024
"""Lights, rows and columns of a stage of few large pictures, with noise."""
CODE = """
import resource, sys, tempfile, warnings
import numpy as np
import relume as rl
from relume.lightstage.relighting.voronoi_cells import even_directions
warnings.simplefilter("ignore")
job, store, rows, cap = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
count, columns = (int(word) for word in sys.argv[5:7])
light = rl.EnvironmentMap(np.random.default_rng(0).random((16, 32, 3), np.float32))
settings = rl.lightstage.RelightSettings(memory=cap, threads=1)
if job == "build":
    class Made:
        lights = rl.lightstage.StageLights.towards(even_directions(count))
        shape, camera = (rows, columns), None
        noise = rl.lightstage.Noise(1e-4, 1e-3) if count < 500 else None
        def block(self, chosen, part):
            shape = chosen.stop - chosen.start, part.stop - part.start, self.shape[1], 3
            return np.random.default_rng(chosen.start).random(shape, np.float32)
    rl.lightstage.build_store(Made(), store)
elif job == "relight":
    rl.lightstage.relight(store, light, settings=settings)
elif job == "frames":
    turned = rl.lightstage.StageLighting((light,)).turntable(40)
    for picture in rl.lightstage.relight_sequence(store, turned, settings):
        pass
elif job == "written":
    turned = rl.lightstage.StageLighting((light,)).turntable(12)
    with tempfile.TemporaryDirectory(dir=sys.argv[7]) as out:
        rl.lightstage.relight_frames(store, turned, out, settings)
elif job == "separate":
    rl.lightstage.measure_surface(rl.lightstage.read_stage(store), memory=cap)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
"""


def peak(*arguments: object) -> int:
    """The greatest memory, bytes, of a process of its own."""
    done = subprocess.run([sys.executable, "-c", CODE, *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return int(done.stdout)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads the greatest memory of a process as Linux says it")
def test_a_store_of_eight_times_the_memory_stays_within_it(tmp_path: Path) -> None:
    stage = LIGHTS, COLUMNS
    peak("build", tmp_path / "small", 16, CAP, *stage)
    peak("build", tmp_path / "large", ROWS, CAP, *stage)
    for job in ("relight", "frames", "separate"):
        # The same on a sixteenth of the rows takes what the program itself does, kernels compiled.
        alone = min(peak(job, tmp_path / "small", 16, CAP, *stage) for _ in range(2))
        assert peak(job, tmp_path / "large", ROWS, CAP, *stage) - alone < CAP, job


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads the greatest memory of a process as Linux says it")
def test_large_frames_take_no_more_than_two_pictures_above_the_memory(tmp_path: Path) -> None:
    lights, rows, columns = PICTURES
    cap = lights * rows * columns * 3 * 2 // 8
    picture = rows * columns * 3 * 4 * 2  # radiance and variance
    given = cap, lights, columns, tmp_path
    peak("build", tmp_path / "small", 16, *given)
    peak("build", tmp_path / "large", rows, *given)
    alone = min(peak("written", tmp_path / "small", 16, *given) for _ in range(2))
    assert peak("written", tmp_path / "large", rows, *given) - alone < cap + 2 * picture

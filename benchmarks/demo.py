"""The main job on the example room: wall time of each stage and the most memory held."""

from __future__ import annotations

import resource
import tempfile
from pathlib import Path

import relume as rl

if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        result = rl.insert(rl.read_shot(Path(__file__).parents[1] / "examples/room/shot.toml"), folder)
    for stage, seconds in result.seconds.items():
        print(f"{seconds:7.2f} s  {stage}")
    print(f"{sum(result.seconds.values()):7.2f} s  in all (limit 120 s)")
    print(f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:7.2f} GB  most memory (limit 2 GB)")

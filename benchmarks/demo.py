"""The main job on the example room, kernels kept: time to the report, of each stage, and the most memory held."""

from __future__ import annotations

import resource
import tempfile
import time
from pathlib import Path

from measured import Rows, asked

import relume as rl


def main(rows: Rows, samples: int | None) -> None:
    shot = rl.read_shot(Path(__file__).parents[1] / "examples/room/shot.toml")
    if samples is not None:
        shot = shot.model_copy(update={"render": shot.render.model_copy(update={"samples": samples})})
    with tempfile.TemporaryDirectory() as folder:
        start = time.perf_counter()
        result = rl.insert(shot, folder)
        rl.write_report(result, folder)
        taken = time.perf_counter() - start
    for stage, seconds in result.seconds.items():
        print(f"{seconds:7.2f} s  {stage}")
    rows.value("the demo, from JPEGs to the report", taken, "s", goal="demo")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    rows.value("most memory held by the demo", peak, "GB", limit="≤ 2")


if __name__ == "__main__":
    options = asked(__doc__).parse_args()
    main(Rows(options.rows), 4 if options.quick else None)

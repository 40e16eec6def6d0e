"""The main job on the example room, from photographs to the report: wall time of each stage, and the most memory held.

A stage that was begun beside others counts what was still to be waited for. Imports are counted, kernels are kept.
"""

from __future__ import annotations

import time

START = time.perf_counter()

import resource  # noqa: E402 (imports are part of what is measured)
import tempfile  # noqa: E402
from pathlib import Path  # noqa: E402

from measured import Rows, asked  # noqa: E402

import relume as rl  # noqa: E402


def main(rows: Rows, samples: int | None) -> None:
    shot = rl.read_shot(Path(__file__).parents[1] / "examples/room/shot.toml")
    if samples is not None:
        shot = shot.model_copy(update={"render": shot.render.model_copy(update={"samples": samples})})
    with tempfile.TemporaryDirectory() as folder:
        imported = time.perf_counter()
        result = rl.insert(shot, folder)
        written = time.perf_counter()
        rl.write_report(result, folder)
        done = time.perf_counter()
    stages = {"imports and the shot file": imported - START, **result.seconds, "report": done - written}
    stages["between the stages"] = done - START - sum(stages.values())
    for stage, seconds in stages.items():
        print(f"{seconds:7.2f} s  {stage}")
    rows.value("the demo, from JPEGs to the report", done - START, "s", goal="demo")
    use = resource.getrusage(resource.RUSAGE_SELF)
    print(f"{use.ru_utime + use.ru_stime:7.2f} s  of processor time")
    rows.value("most memory held by the demo", use.ru_maxrss * 1024 / 1e9, "GB", limit="≤ 2")


if __name__ == "__main__":
    options = asked(__doc__).parse_args()
    main(Rows(options.rows), 4 if options.quick else None)

"""The suite: minutes of `make test`, seconds of `make quick`; with `--quick` only the latter."""

from __future__ import annotations

import re
import subprocess
import time
from pathlib import Path

from measured import Rows, asked

ROOT = Path(__file__).resolve().parents[1]


def seconds(target: str) -> tuple[float, str]:
    """Of one `make` target, and what it said last; tests that fail end this script."""
    start = time.perf_counter()
    done = subprocess.run(["make", target], cwd=ROOT, capture_output=True, text=True)
    taken, said = time.perf_counter() - start, done.stdout.strip().splitlines()
    last = said[-1] if said else done.stderr[-200:]
    if done.returncode:
        raise SystemExit(f"make {target}: {last}")
    return taken, re.sub(r" in .*| *=+ *", "", last)


if __name__ == "__main__":
    options = asked(__doc__).parse_args()
    rows = Rows(options.rows)
    taken, said = seconds("quick")
    rows.value("make quick", taken, "s", goal="quick_suite", note=said)
    if not options.quick:
        taken, said = seconds("test")
        rows.value("make test", taken / 60, "min", goal="suite", note=said)

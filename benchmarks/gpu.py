"""The demo and the suite on an NVIDIA GPU (Mitsuba's `cuda_ad_rgb`) against the same machine's processors.

    python benchmarks/gpu.py [--quick] [--write docs/benchmarks.md]

Where no GPU answers it says so in one line and exits 2. Mitsuba is kept from the GPU by CUDA_VISIBLE_DEVICES. A suite
that fails under one of the two is a row that says so. Quickly: the demo alone.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import textwrap
import time
from datetime import UTC, datetime
from pathlib import Path

from measured import Result, Row, Rows, asked, read_rows
from table import every_row, machine, packages, placed

from relume.renderers.mitsuba.variant import why_not_here

ROOT = Path(__file__).resolve().parents[1]
PLACES = {"the GPU": {}, "the processors": {"CUDA_VISIBLE_DEVICES": "-1"}}
COMMAND = "import sys; from relume.cli import main; sys.exit(main(sys.argv[1:]))"


def demo(place: str) -> float:
    """Seconds of the demo, the second time, kernels kept."""
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(2):
            start = time.perf_counter()
            run = [sys.executable, "-c", COMMAND, "demo", "-o", f"{folder}/{turn}", "-q"]
            subprocess.run(run, env=os.environ | PLACES[place], check=True, capture_output=True)
        return time.perf_counter() - start


def suite(place: str) -> tuple[float, str]:
    """Seconds of the suite and its last line."""
    start = time.perf_counter()
    run = ["make", "-C", str(ROOT), "test"]
    done = subprocess.run(run, env=os.environ | PLACES[place], capture_output=True, text=True)
    lines = [line for line in done.stdout.splitlines() if line.strip() and not line.startswith("make")]
    return time.perf_counter() - start, lines[-1] if lines else done.stderr[-200:]


def gpu() -> str:
    """The GPU's name, as its driver tells."""
    words = ["nvidia-smi", "--query-gpu=name", "--format=csv,noheader"]
    try:
        return subprocess.run(words, capture_output=True, text=True).stdout.strip().splitlines()[0]
    except (OSError, IndexError):
        return "a GPU without a name"


def main(rows: Rows, quick: bool) -> None:
    turns = [{place: demo(place) for place in PLACES} for _ in range(1 if quick else 3)]
    ours, theirs = ([turn[place] for turn in turns] for place in PLACES)
    rows.ratio("the demo on the GPU, warm", ours, "the processors", theirs, note=gpu())
    if quick:
        return
    (ours_taken, ours_said), (theirs_taken, theirs_said) = (suite(place) for place in PLACES)
    note = f"on the GPU {ours_said}; on the processors {theirs_said}"
    rows.ratio("the suite on the GPU", [ours_taken], "the processors", [theirs_taken], note=note)


def section(rows: tuple[Row, ...]) -> str:
    """The document's section."""
    day = datetime.now(UTC).strftime("%Y-%m-%d")
    where = textwrap.fill(f"{gpu()}; {machine()}; {', '.join(packages())}; {day}; `benchmarks/gpu.py`.", 119)
    return f"## On a GPU\n\n{where}\n\n{every_row([Result('gpu.py', 'done', 0.0, None, day, False, rows)])}\n\n"


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("--write", type=Path, metavar="DOCUMENT", help="put the ratios there as its last section")
    options = parser.parse_args()
    if why := why_not_here("cuda_ad_rgb"):
        print(f"no GPU: {why}", file=sys.stderr)
        sys.exit(2)
    with tempfile.TemporaryDirectory() as name:
        kept = options.rows or Path(name) / "rows"
        main(Rows(kept), options.quick)
        if options.write:
            text = options.write.read_text(encoding="utf-8")
            made = placed(text, "`benchmarks/gpu.py`", section(tuple(read_rows(kept))), first=False)
            options.write.write_text(made, encoding="utf-8")

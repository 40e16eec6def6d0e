"""How long the first word takes: importing relume, --help, info; median of seven fresh processes each."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

from measured import Rows, asked

ROOM = Path(__file__).parents[1] / "examples" / "room"


def seconds(arguments: list[str]) -> float:
    """Wall time of one fresh process, or what it says of itself."""
    start = time.perf_counter()
    printed = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=True).stdout
    try:
        return float(printed)
    except ValueError:
        return time.perf_counter() - start


def main(rows: Rows, times: int) -> None:
    within = "import time; t = time.perf_counter(); import relume; print(time.perf_counter() - t)"
    # What the installed command does, whatever folder it lies in.
    command = "from relume.cli import main; main()"

    def runs(*arguments: str) -> list[float]:
        return [seconds(["-c", *arguments]) for _ in range(times + 1)][1:]

    rows.value("import relume, within Python", runs(within), "s", limit="≤ 0.15")
    rows.value("relume --help", runs(command, "--help"), "s", limit="≤ 0.5")
    rows.value("relume info FILE", runs(command, "info", str(ROOM / "plate/IMG_0001.jpg")), "s", goal="info")


if __name__ == "__main__":
    options = asked(__doc__).parse_args()
    main(Rows(options.rows), 2 if options.quick else 7)

"""How long the first word takes: importing relume, --help, info; median of seven fresh processes each."""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
from pathlib import Path

ROOM = Path(__file__).parents[1] / "examples" / "room"
COMMANDS = {
    "import relume (limit 0.15 s, within python)": [
        "-c",
        "import time; t = time.perf_counter(); import relume; print(time.perf_counter() - t)",
    ],
    "relume --help (limit 0.5 s)": ["-c", "from relume.cli import main; main(['--help'])"],
    "relume info FILE (limit 1 s)": [
        "-c",
        f"from relume.cli import main; main(['info', {str(ROOM / 'plate/IMG_0001.jpg')!r}])",
    ],
}


def seconds(arguments: list[str]) -> float:
    """Wall time of one fresh process, or what it says of itself."""
    start = time.perf_counter()
    printed = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=True).stdout
    try:
        return float(printed)
    except ValueError:
        return time.perf_counter() - start


if __name__ == "__main__":
    for name, arguments in COMMANDS.items():
        print(f"{statistics.median(seconds(arguments) for _ in range(7)):.3f} s  {name}")

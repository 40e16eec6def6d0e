"""The first run of a command after an installation by pip alone, against the second.

    benchmarks/first_run.py                       a wheel of this checkout, with its kernels
    benchmarks/first_run.py --quick               one command, of a wheel without kernels: what compiling takes
    benchmarks/first_run.py WHEEL [COMMAND …]     this wheel, and of the commands below only these

The wheel goes into a fresh environment that borrows all other packages from the running one; home is empty before each
first run, so that nothing is kept anywhere: no kernels, no fonts, no code of Dr.Jit. Processor time is user and system.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import time
from pathlib import Path
from statistics import median

import numpy as np
from measured import Rows, asked

import relume as rl

ROOT = Path(__file__).parents[1]
ROOM = ROOT / "examples" / "room"
COMMANDS = {
    "info": ["info", f"{ROOM}/plate/IMG_0001.jpg"],
    "convert": ["convert", "sky.hdr", "--from", "latlong", "--to", "angular", "-o", "out/sky.exr"],
    "merge": ["merge", f"{ROOM}/ball_0", "-o", "out/merged.exr"],
    "whitted": [
        *["render", f"{ROOM}/objects/suzanne_plastic.glb", "--light", "sky.hdr", "--renderer", "whitted"],
        *["--size", "320x240", "-o", "out/whitted.png"],
    ],
    "develop": ["develop", "sky.hdr", "-o", "out/sky.png"],
    "insert": ["insert", f"{ROOM}/shot.toml", "-o", "out", "--samples", "8"],
}


def environment(folder: Path, wheel: Path) -> Path:
    """A fresh virtual environment with the wheel in it; its Python."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder], check=True)
    python = folder / "bin" / "python"
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(folder)}))
    (packages / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    pip = [sys.executable, "-m", "pip", f"--python={python}", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*pip, "--ignore-installed", wheel], check=True)
    return python


def seconds(command: list[object], folder: Path, home: Path) -> tuple[float, float]:
    """Wall and processor time of one fresh process."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "PYTHON", "XDG_"))}
    shutil.rmtree(folder / "out", ignore_errors=True)  # what an insert measured would be taken from there
    (folder / "out").mkdir()
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(
        [str(word) for word in command], cwd=folder, env={**kept, "HOME": str(home)}, check=True, capture_output=True
    )
    wall, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def built(folder: Path, *, kernels: bool) -> Path:
    """A wheel of this checkout; its kernels take some minutes."""
    run = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder, ROOT]
    subprocess.run(run, env={**os.environ, "HATCH_BUILD_NO_HOOKS": str(int(not kernels))}, check=True)
    return next(folder.glob("relume-*.whl"))


def measure(rows: Rows, goal: str, command: str, wheel: Path, sky: Path, place: Path) -> None:
    """Report a command's times, in an environment of its own, so that no other command warms it."""
    python = environment(place / "venv", wheel)
    shutil.copy(sky, place)
    (place / "home").mkdir()
    run = [python, "-c", "import sys; from relume.cli import main; sys.exit(main(sys.argv[1:]))", *COMMANDS[command]]
    times = [seconds(run, place, place / "home") for _ in range(2 if command == "insert" else 4)]
    (cold, cold_work), *again = times
    warm, warm_work = (median(column) for column in zip(*again, strict=True))
    note = f"{cold:.2f} and {warm:.2f} s, processor time {cold_work:.2f} and {warm_work:.2f} s"
    what = f"relume {command}, time of the first run after pip by that of the second"
    rows.value(what, cold / warm, "×", goal=goal, note=note)


if __name__ == "__main__":
    parser = asked(__doc__)
    parser.add_argument("wheel", nargs="?", type=Path)
    parser.add_argument("commands", nargs="*", metavar="COMMAND")
    options = parser.parse_args()
    # Without its kernels the wheel is not what is asked about.
    table, aim = Rows(options.rows), "" if options.quick else "cold"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wheel = options.wheel.resolve() if options.wheel else built(folder, kernels=not options.quick)
        print(f"{wheel.name}, {wheel.stat().st_size / 1e6:.1f} MB")
        steps = np.linspace(0.05, 5, 512 * 256 * 3).reshape(256, 512, 3)
        rl.write(folder / "sky.hdr", rl.RadianceMap(steps.astype(np.float32)))
        for command in options.commands or (["develop"] if options.quick else COMMANDS):
            measure(table, aim, command, wheel, folder / "sky.hdr", folder / command)

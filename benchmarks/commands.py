"""Whole commands that take long or much memory: processor time (user and system) and the most memory of one process.

The map is of eight lamps in a textured room (`reflection_maps.lamps`), the stage the virtual head in ../shared/stages,
without which its two rows are left out. `Prefiltered` draws five glossy balls at 3840×2160.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from measured import Rows, asked
from reflection_maps import lamps

import relume as rl
from relume.image import files

COMMAND = "import sys; from relume.cli import main; sys.exit(main(sys.argv[1:]))"
FRAME = """
import sys, numpy as np, relume as rl
from relume.light.reflection.lobes import Phong
from relume.scene.materials.reflective import glossy
width = int(sys.argv[2])
balls = tuple(rl.Sphere((2.2 * i, 0.0, 0.0), 1.0, glossy(specular=Phong(50))) for i in range(-2, 3))
camera = rl.Camera.looking_at(
    np.array([0, 0, 12.0]), np.zeros(3), width=width, height=width * 9 // 16, focal_length=1.0 * width
)
rl.Prefiltered().render(rl.Scene(rl.read_environment(sys.argv[1]), (), balls), camera)
"""


def used(words: list[str], folder: Path) -> tuple[float, float]:
    """Seconds of processor time and GB at most of one process."""
    process = subprocess.Popen(
        [sys.executable, "-c", *words], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    assert process.stderr is not None
    said = process.stderr.read().decode(errors="replace")
    _, status, use = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(words[1:])}: {said.strip()[-500:]}")
    return use.ru_utime + use.ru_stime, use.ru_maxrss * 1024 / 1e9


def warm(words: list[str], folder: Path, written: str) -> tuple[float, float]:
    """The same of the second of two runs: the first may compile kernels."""
    used(words, folder)
    made = folder / written
    shutil.rmtree(made) if made.is_dir() else made.unlink()
    return used(words, folder)


def stage_folder() -> Path | None:
    """The virtual head, beside the repository or in it."""
    for parent in Path(__file__).resolve().parents[1:3]:
        if (parent / "shared" / "stages" / "head").is_dir():
            return parent / "shared" / "stages" / "head"
    return None


def of_maps(rows: Rows, folder: Path, height: int, width: int) -> None:
    files.write(folder / "room.exr", rl.RadianceMap(lamps(height // 2).radiance))
    files.write(folder / "small.exr", rl.RadianceMap(lamps(512).radiance))
    _, held = used([COMMAND, "reflect", "room.exr", "-o", "tables", "-q"], folder)
    rows.value(f"memory of relume reflect of a map {2 * height} wide", held, "GB", goal="reflect_memory")
    seconds, _ = warm([COMMAND, "reflect", "small.exr", "-o", "sheet", "--sheet", "-q"], folder, "sheet")
    rows.value("relume reflect --sheet of a map 1024 wide", seconds, "s", goal="sheet")
    _, held = used([FRAME, "small.exr", str(width)], folder)
    rows.value(f"memory of a frame {width} wide by Prefiltered", held, "GB", goal="mapped_memory")


def of_a_stage(rows: Rows, folder: Path, size: int) -> None:
    stage = stage_folder()
    if stage is None:
        rows.absent("relume stage view", "no ../shared/stages/head", goal="stage_view")
        rows.absent("relume stage relight", "no ../shared/stages/head", goal="stage_relight")
        return
    light = ["--light", "small.exr"]
    view = ["stage", "view", str(stage), "--position", "2.1,0.1,3.6", "--picture-size", f"{size}x{size}"]
    seconds, held = warm([COMMAND, *view, *light, "-o", "view.exr", "-q"], folder, "view.exr")
    rows.value(f"relume stage view, {size}²", seconds, "s", goal="stage_view", note=f"{held:.1f} GB")
    words = [COMMAND, "stage", "relight", str(stage), *light, "-o", "relit.exr", "-q"]
    seconds, held = warm(words, folder, "relit.exr")
    rows.value("relume stage relight with a mesh, 256²", seconds, "s", goal="stage_relight", note=f"{held:.1f} GB")


if __name__ == "__main__":
    options = asked(__doc__).parse_args()
    table = Rows(options.rows)
    with tempfile.TemporaryDirectory() as name:
        of_maps(table, Path(name), 512 if options.quick else 4096, 1280 if options.quick else 3840)
        if options.quick:
            raise SystemExit
        of_a_stage(table, Path(name), 256)

"""Blender against our light: does the `blender` preset face the right way, and do the exported lights light as ours?

Usage: python benchmarks/hosts/blender.py PYTHON_WITH_BPY [FOLDER]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from trial import LIGHTS, background, finish, report_axes, report_irradiance, run_inside, write_oriented_probe

from relume.image import files
from relume.light.exports import FORMATS
from relume.sphere.illumination import as_radiance_map

VIEWS = ("px", "nx", "py", "ny", "pz", "nz")


def main(python: str, folder: Path) -> None:
    write_oriented_probe("blender", folder / "probe.exr")
    files.write(folder / "background.exr", as_radiance_map(background()))
    script = folder / "lights.py"
    script.write_text(FORMATS["blender"].text(LIGHTS, unit="relative", background="background.exr"), encoding="utf-8")
    inside = Path(__file__).with_name("inside_blender.py")
    run_inside(python, inside, str(folder / "probe.exr"), str(script), str(folder), needs="bpy")
    seen = [files.read_radiance(folder / f"axis_{view}.exr").radiance[62:66, 62:66].mean((0, 1)) for view in VIEWS]
    lit = [files.read_radiance(folder / f"irradiance_{view}.exr").radiance.mean((0, 1)) * np.pi for view in VIEWS]
    finish(report_axes("blender", np.array(seen)), report_irradiance("blender", np.array(lit), 0.02))


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as temporary:
        main(sys.argv[1], Path(sys.argv[2] if len(sys.argv) == 3 else temporary))

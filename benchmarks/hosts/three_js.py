"""three.js against our light: background and mirrored sphere the right way round, glTF lights as bright as ours.

Usage: python benchmarks/hosts/three_js.py PYTHON_WITH_PLAYWRIGHT THREE_PACKAGE CHROMIUM [FOLDER]

THREE_PACKAGE is the folder that `npm pack three` unpacks to.
"""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
from trial import LIGHTS, NORMALS, POINTS, finish, report_axes, run_inside, write_oriented_probe

from relume.export.lamps import LampFile
from relume.export.light_files import FORMATS


def main(python: str, three: Path, chromium: str, folder: Path) -> None:
    if not (three / "build/three.module.js").is_file():
        sys.exit(f"{three} is no package of three.js; get one with `npm pack three` and unpack it")
    if shutil.which(chromium) is None:
        sys.exit(f"{chromium} is not there; install Chromium")
    here = Path(__file__).parent
    write_oriented_probe("three", folder / "probe.hdr", 512)
    gltf = FORMATS["gltf"].text(LampFile(LIGHTS, "relative", points=POINTS))
    (folder / "lights.gltf").write_text(gltf, encoding="utf-8")
    shutil.copy(here / "three_js.html", folder / "page.html")
    shutil.copytree(three, folder / "three", dirs_exist_ok=True)
    run_inside(python, here / "inside_browser.py", str(folder), chromium, needs="playwright")
    result = json.loads((folder / "result.json").read_text())
    print(f"three.js revision {result['revision']}")
    # The environment is blurred a little on the way to the sphere, and the letters lie beside its middle.
    right = [
        report_axes("background", np.array(result["shown"])),
        report_axes("mirrored sphere", np.array(result["ball"]), 0.05),
    ]
    lit = np.array(result["squares"]) * np.pi
    wanted = LIGHTS.irradiance_on(NORMALS) + POINTS.seen_from((0, 0, 0)).irradiance_on(NORMALS)
    worst = float(np.abs(lit - wanted).max() / wanted.max())
    print(f"glTF lights: irradiance {np.round(lit, 4).tolist()}, differs by {worst:.3%} of the largest at most")
    finish(*right, worst < 0.001)


if __name__ == "__main__":
    if len(sys.argv) not in (4, 5):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as temporary:
        main(sys.argv[1], Path(sys.argv[2]), sys.argv[3], Path(sys.argv[4] if len(sys.argv) == 5 else temporary))

"""OpenUSD against our light: the exported layer passes its checks, and its lights and dome mean what ours do.

Usage: python benchmarks/hosts/usd.py PYTHON_WITH_USD_CORE [FOLDER]
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from trial import LIGHTS, POINTS, background, finish, run_inside

from relume.export.light_files import FORMATS
from relume.image import files
from relume.sphere.environment_files import as_radiance_map


def main(python: str, folder: Path) -> None:
    files.write(folder / "back ground.exr", as_radiance_map(background()))
    angles = np.radians([0.0, 0.53, 5.0, 30.0])
    layer = folder / "lights.usda"
    text = FORMATS["usd"].text(LIGHTS, unit="relative", background="back ground.exr", angles=angles, points=POINTS)
    layer.write_text(text, encoding="utf-8")
    run_inside(
        python,
        Path(__file__).with_name("inside_usd.py"),
        str(layer),
        str(folder / "told.json"),
        needs="pxr",
        package="usd-core",
    )
    said = json.loads((folder / "told.json").read_text())
    version, problems = said["version"], said["problems"] or "no complaints"
    print(f"OpenUSD {version}: {said['checks']} checks, {problems}; up {said['up']}, {said['metres']} m")
    towards = np.array([light["towards"] for light in said["lights"]])
    irradiance = np.array([light["irradiance"] for light in said["lights"]])
    turned = float(np.abs(towards - LIGHTS.directions).max())
    off = float(np.abs(irradiance - LIGHTS.irradiance).max())
    print(f"lights: directions differ by {turned:.1e}, irradiance by {off:.1e} at most")
    places = np.array([sphere["position"] for sphere in said["spheres"]])
    shine = np.array([sphere["power"] for sphere in said["spheres"]]) / 4
    moved, weaker = float(np.abs(places - POINTS.positions).max()), float(np.abs(shine - POINTS.intensity).max())
    print(f"spheres: places differ by {moved:.1e}, intensity by {weaker:.1e} at most")
    dome = said["dome"]
    print(f"dome: the middle of the file is {dome['middle']}, to its right {dome['right']}, on top {dome['top']}")
    finish(
        said["problems"] == [],
        said["up"] == "Y" and said["metres"] == 1 and said["default"] == "/Light",
        turned < 1e-7 and off < 1e-6 and all(light["normalize"] for light in said["lights"]),
        moved < 1e-12 and weaker < 1e-5 and all(sphere["normalize"] for sphere in said["spheres"]),
        [sphere["point"] for sphere in said["spheres"]] == [True, False],
        np.allclose([sphere["radius"] for sphere in said["spheres"]], [0.01, 0.1]),
        np.allclose([light["angle"] for light in said["lights"]], np.degrees(angles)),
        np.allclose([dome["middle"], dome["right"], dome["top"]], [[0, 0, -1], [1, 0, 0], [0, 1, 0]], atol=1e-12),
        Path(dome["file"]) == (folder / "back ground.exr").resolve() and dome["format"] == "latlong",
    )


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as temporary:
        main(sys.argv[1], Path(sys.argv[2] if len(sys.argv) == 3 else temporary))

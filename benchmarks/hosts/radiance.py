"""Radiance against our light: the exported background the right way round, and the irradiance of lights and background.

Usage: python benchmarks/hosts/radiance.py PYTHON_WITH_PYRADIANCE [FOLDER]
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from trial import LIGHTS, NORMALS, POINTS, background, finish, report_axes, report_irradiance, write_oriented_probe

from relume.export.lamps import LampFile
from relume.export.light_files import FORMATS
from relume.image import files
from relume.light.constellations.constellation import Constellation
from relume.sphere.environment_files import as_radiance_map

TO_RADIANCE = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
INDIRECT = ("-ab", "1", "-ad", "32768", "-as", "0", "-aa", "0", "-dj", "0", "-dt", "0", "-lw", "1e-7")
EFFICACY = 179.0


def programs(python: str) -> Path:
    """The folder of pyradiance's oconv and rtrace."""
    ask = "import os, pyradiance; print(os.path.dirname(pyradiance.__file__))"
    try:
        done = subprocess.run([python, "-c", ask], check=True, capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError):
        sys.exit(f"{python} has no pyradiance; make an environment with `pip install pyradiance` and name its python")
    return Path(done.stdout.strip())


def traced(place: Path, folder: Path, scene: str, vectors: np.ndarray, *options: str) -> np.ndarray:
    """What rtrace says of rays (N, 3) from the origin (or, with -I, of surfaces of these normals): (N, 3)."""
    environment = {**os.environ, "RAYPATH": f".{os.pathsep}{place / 'lib'}"}
    tree = subprocess.run([place / "bin/oconv", scene], cwd=folder, env=environment, check=True, capture_output=True)
    (folder / "scene.oct").write_bytes(tree.stdout)
    rays = "\n".join(f"0 0 0 {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vectors @ TO_RADIANCE.T)
    command = [place / "bin/rtrace", "-h", *options, "scene.oct"]
    done = subprocess.run(command, cwd=folder, env=environment, check=True, capture_output=True, text=True, input=rays)
    return np.array([[float(value) for value in line.split()] for line in done.stdout.splitlines()])


def main(python: str, folder: Path) -> None:
    place, write = programs(python), FORMATS["radiance"].text
    write_oriented_probe("radiance", folder / "probe.hdr")
    none = Constellation(np.zeros((0, 3)), np.zeros((0, 3)))
    (folder / "probe.rad").write_text(write(LampFile(none, "relative", "probe.hdr")), encoding="utf-8")
    axes = traced(place, folder, "probe.rad", NORMALS)
    files.write(folder / "background.hdr", as_radiance_map(background()))
    right = [report_axes("radiance", axes)]
    for unit, factor in (("relative", 1.0), ("cd/m²", EFFICACY)):
        scene = write(LampFile(LIGHTS, unit, "background.hdr", points=POINTS))
        (folder / "lights.rad").write_text(scene, encoding="utf-8")
        lit = traced(place, folder, "lights.rad", NORMALS, "-I", *INDIRECT) * factor
        right.append(report_irradiance(f"radiance ({unit})", lit, 0.01))
    finish(*right)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as temporary:
        main(sys.argv[1], Path(sys.argv[2] if len(sys.argv) == 3 else temporary))

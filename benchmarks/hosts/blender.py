"""Blender against our light: the `blender` preset faces the right way, and the exported lights light as ours.

Its importers also read our USD and glTF files, which says whether others understand those as we do.

Usage: python benchmarks/hosts/blender.py PYTHON_WITH_BPY [FOLDER]
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
from trial import LIGHTS, POINTS, background, finish, report_axes, report_irradiance, run_inside, write_oriented_probe

from relume.export.lamps import LampFile
from relume.export.light_files import FORMATS
from relume.image import files
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.mappings.orientation_chart import orientation_chart

VIEWS = ("px", "nx", "py", "ny", "pz", "nz")


def main(python: str, folder: Path) -> None:
    write_oriented_probe("blender", folder / "probe.exr")
    files.write(folder / "labelled.exr", as_radiance_map(orientation_chart(256)))
    files.write(folder / "background.exr", as_radiance_map(background()))
    for name, kind, behind in (
        ("lights.py", "blender", "background.exr"),
        ("probe.usda", "usd", "labelled.exr"),
        ("lights.gltf", "gltf", None),
    ):
        text = FORMATS[kind].text(LampFile(LIGHTS, "relative", behind, points=POINTS))
        (folder / name).write_text(text, encoding="utf-8")
    run_inside(python, Path(__file__).with_name("inside_blender.py"), str(folder), needs="bpy")
    right = [
        report_axes("blender", middles(folder, "axis")),
        report_axes("USD in Blender", middles(folder, "usd"), 0.03),
    ]
    for kind, (suns, points) in json.loads((folder / "imported.json").read_text()).items():
        placed = [points[name] for name in sorted(points)]
        moved = float(np.abs([each["position"] for each in placed] - POINTS.positions).max())
        gives = np.array([each["watts"] for each in placed]).sum() / (4 * np.pi * POINTS.intensity.sum())
        print(f"{kind} in Blender: points off by {moved:.0e} m, their watts / 4π are {gives:.5g} times our intensity")
        right.append(moved < 1e-5)
        found = [suns[name] for name in sorted(suns)]
        off = float(np.abs([sun["towards"] for sun in found] - LIGHTS.directions).max())
        times = np.array([sun["gives"] for sun in found]).sum() / LIGHTS.irradiance.sum()
        print(f"{kind} in Blender: directions off by {off:.0e}; its importer multiplies irradiance by {times:.5g}")
        right.append(off < 1e-5)
    lit = [files.read_radiance(folder / f"irradiance_{view}.exr").radiance.mean((0, 1)) * np.pi for view in VIEWS]
    finish(*right, report_irradiance("blender", np.array(lit), 0.02))


def middles(folder: Path, name: str) -> np.ndarray:
    """The colours in the middles of the six views, (6, 3)."""
    pictures = [files.read_radiance(folder / f"{name}_{view}.exr").radiance for view in VIEWS]
    return np.array([picture[62:66, 62:66].mean((0, 1)) for picture in pictures])


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as temporary:
        main(sys.argv[1], Path(sys.argv[2] if len(sys.argv) == 3 else temporary))

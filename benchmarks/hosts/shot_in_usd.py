"""OpenUSD against a shot's layer: it passes its checks, its camera is ours, and every mesh has a material.

Usage: python benchmarks/hosts/shot_in_usd.py PYTHON_WITH_USD_CORE LIGHT.exr [FOLDER]

LIGHT.exr is the light of a finished run, `relume insert examples/room/shot.toml -o …`.
"""

from __future__ import annotations

import json
import sys
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from shot_in_blender import room
from trial import finish, run_inside

from relume.export.shot_files import SHOT_FORMATS, export_shot
from relume.scene.scene import Box


def main(python: str, light: Path, folder: Path) -> None:
    value = room(light)
    box = replace(value.scene, distant=Box((-2.5, -0.75, -2.0), (2.5, 1.95, 2.0)), probe=(0.0, 0.05, 0.0))
    right = []
    for name, scene in (("infinite", value.scene), ("box", box)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            export_shot(replace(value, scene=scene), folder / name, SHOT_FORMATS["usd"])
        script, result = Path(__file__).with_name("inside_shot_usd.py"), folder / f"{name}.json"
        layer = str(folder / name / "shot.usda")
        run_inside(python, script, layer, str(result), needs="pxr", package="usd-core")
        said = json.loads(result.read_text())
        fov = float(np.degrees(2 * np.arctan(value.camera.width / 2 / value.camera.focal_length)))
        away = float(np.abs(np.array(said["position"]) - value.camera.position).max())
        print(f"{name}: {said['checks']} checks, {said['problems'] or 'no complaints'}; {', '.join(said['types'])}")
        print(f"{name}: the field of view is {said['fov']:.5f}°, ours {fov:.5f}°; the camera is {away:.1e} m off")
        right += [said["problems"] == [], abs(said["fov"] - fov) < 1e-3, away < 1e-6, all(said["bound"])]
    finish(*right)


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as temporary:
        main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3] if len(sys.argv) == 4 else temporary))

"""Khronos' validator on our glTF: no errors, warnings or hints, with lights and without.

Usage: python benchmarks/hosts/gltf.py FOLDER_WITH_GLTF_VALIDATOR, where `npm install gltf-validator` was run
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from trial import LIGHTS, POINTS, finish

from relume.export.lamps import LampFile
from relume.export.light_files import FORMATS
from relume.light.constellations.constellation import Constellation

VALIDATE = """
const validator = require("gltf-validator");
const bytes = new Uint8Array(require("fs").readFileSync(process.argv[1]));
validator.validateBytes(bytes).then((report) => console.log(JSON.stringify(report.issues)));
"""


def main(place: Path, folder: Path) -> None:
    if shutil.which("node") is None or not (place / "node_modules/gltf-validator").is_dir():
        sys.exit(f"{place} has no gltf-validator; install Node.js and run `npm install gltf-validator` there")
    none = Constellation(np.zeros((0, 3)), np.zeros((0, 3)))
    right = []
    for name, lights, points in (("lights", LIGHTS, None), ("placed", LIGHTS, POINTS), ("none", none, None)):
        file = folder / f"{name}.gltf"
        text = FORMATS["gltf"].text(LampFile(lights, "cd/m²", "rest.exr", points=points))
        file.write_text(text, encoding="utf-8")
        done = subprocess.run(
            ["node", "-e", VALIDATE, str(file)], cwd=place, capture_output=True, text=True, check=True
        )
        issues = json.loads(done.stdout)
        print(f"{name}: {issues['numErrors']} errors, {issues['numWarnings']} warnings, {issues['numInfos']} remarks")
        right.append(issues["messages"] == [])
    finish(*right)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as temporary:
        main(Path(sys.argv[1]), Path(temporary))

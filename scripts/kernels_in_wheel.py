"""Puts compiled kernels into a wheel: hatchling calls it (pyproject.toml).

They are compiled as `scripts/compile_kernels` does it, for the Python and the Numba that build the wheel, and used
where these are the same; elsewhere kernels are compiled when they are first called. `HATCH_BUILD_NO_HOOKS=true pip
wheel .` leaves them out and gives one wheel for all systems. An editable install has none: `scripts/setup` compiles.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class KernelsInWheel(BuildHookInterface):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        if version == "editable":
            return
        self.folder = tempfile.mkdtemp()
        chosen = {**os.environ, "NUMBA_CACHE_DIR": self.folder}
        command = [sys.executable, str(Path(self.root, "scripts", "compile_kernels"))]
        self.app.display_info("Compiling kernels, once; this takes some minutes")
        done = subprocess.run(command, env=chosen, capture_output=True, text=True)
        if done.returncode or not list(Path(self.folder).glob("kernels-*")):
            said = done.stderr.strip().rpartition("\n")[2]
            self.app.display_warning(f"The wheel brings no kernels, they could not be compiled: {said}")
            return
        build_data["force_include"][self.folder] = "relume/kernels"
        build_data["pure_python"], build_data["infer_tag"] = False, True

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        if version != "editable":
            shutil.rmtree(self.folder)

"""One studio over the small shot for many files of tests: a server and its worker take six seconds to begin."""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from serving import Server
from small_shot import TEXT

OWN = ("shot.toml", "plate.exr", "light.exr", "objects", "objects/ball.glb", "out", "out/stages")
"""What the folder begins with, and what costs time to be made again and is found by what it was made of."""


@dataclass(frozen=True)
class OneStudio:
    """A server of the studio, and the folder of its shot."""

    folder: Path
    server: Server

    def as_begun(self, text: str = TEXT) -> None:
        """The shot as it was written, or another text of it, and nothing beside it that was made since."""
        self._wait_for_rest()
        self.server.post("/shot/undo", {"by": 10_000})
        for within in (self.folder, self.folder / "objects", self.folder / "out"):
            for path in list(within.iterdir()) if within.is_dir() else ():
                if path.relative_to(self.folder).as_posix() not in OWN:
                    shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        if text != TEXT:
            (self.folder / "shot.toml").write_text(text, encoding="utf-8")
        assert (self.folder / "shot.toml").read_text(encoding="utf-8") == text
        assert self.server.json("/shot")["fault"] is None

    def look(self) -> None:
        """A quick look, by which the camera and the light of the shot as it is are known."""
        assert self.server.post("/jobs/start", {"kind": "look"})[0] == 200
        assert self._wait_for_rest()["status"] == "done"

    def _wait_for_rest(self) -> dict[str, Any]:
        if self.server.json("/shot")["job"]["status"] == "paused":
            self.server.post("/jobs/stop")
        end = time.monotonic() + 240
        while (job := self.server.json("/shot")["job"])["status"] in ("waiting", "running", "paused", "stopping"):
            assert time.monotonic() < end, job
            time.sleep(0.03)
        return job

"""Where the example's photographs are."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from relume.errors import UnreadableFile


def example_room() -> Path:
    """The folder of the example room: its photographs (plate, ball_0, ball_90), its objects and its shot.toml.

    It lies beside the package in a checkout, and inside the package where a wheel installed it.
    Raises UnreadableFile where neither is there.
    """
    package = Path(str(files("relume")))
    for folder in (package / "examples" / "room", package.parents[1] / "examples" / "room"):
        if (folder / "shot.toml").is_file():
            return folder
    raise UnreadableFile("the example room is not installed; use a checkout of relume, or its wheel")

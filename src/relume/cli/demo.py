"""`relume demo`: the main job on the example room."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import Threads
from relume.cli.console import OutputOptions, finish, warnings_as_doubts
from relume.cli.insert import inserted


def demo(
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The folder for the pictures.")] = Path("relume-demo"),
    threads: Threads = None,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Insert five objects into the photograph of a room, and say where the pictures are."""
    with warnings_as_doubts(output) as doubts:
        found = inserted(rl.read_shot(rl.capture.example_room() / "shot.toml"), out, output, threads)
        finish(output, [*doubts, *found], rest=out / "report.html")

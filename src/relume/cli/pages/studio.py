"""`relume studio`: a shot or a place and its photographs in the browser, edited by looking and pointing."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes


def studio(
    path: Annotated[
        Path, Parameter(help="A folder of photographs, a shot file, .toml, or a place file, to mark edges.")
    ] = Path("."),
    /,
    *,
    out: Annotated[
        Path | None,
        Parameter(alias="-o", help='The folder for results and kept stages; "out" beside the shot file unless given.'),
    ] = None,
    host: Annotated[str, Parameter(help="The address to listen at.")] = "127.0.0.1",
    port: Annotated[int, Parameter(help="The port to listen at; 0 takes a free one.")] = 0,
    allow_remote: Annotated[
        bool, Parameter(negative="", help="Let --host be one that other machines reach; they can edit the shot then.")
    ] = False,
    browser: Annotated[bool, Parameter(help="Open the page in the browser.")] = True,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Go from a folder of photographs to a composite by looking and pointing; shot.toml is the document.

    Every act edits shot.toml, and edits made elsewhere appear. What the page renders `relume insert` does not render
    again. Of a place file the page marks edges in its photographs, and solves it as `relume model` does.

    Runs until Ctrl-C; the page speaks to this machine alone.
    """

    def say(address: str) -> None:
        print_facts(output, {"address": address}, title="relume studio; Ctrl-C ends it")
        sys.stdout.flush()  # a program that started this waits for the address

    with warnings_as_notes(output):
        rl.open_studio(path, out, host=host, port=port, allow_remote=allow_remote, open_browser=browser, say=say)

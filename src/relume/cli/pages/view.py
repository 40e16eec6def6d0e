"""`relume view`: pictures and maps in the browser, with their values, errors and differences."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes


def view(
    files: Annotated[
        list[Path],
        Parameter(
            name="FILES",
            help="Pictures, radiance maps, environment maps, or folders of them; a light stage, with maps to light "
            "it; a picture by Whitted's method, with its scene file.",
            negative="",
        ),
    ],
    /,
    *,
    host: Annotated[str, Parameter(help="The address to listen at.")] = "127.0.0.1",
    port: Annotated[int, Parameter(help="The port to listen at; 0 takes a free one.")] = 0,
    allow_remote: Annotated[
        bool, Parameter(negative="", help="Let --host be one that other machines reach; they can read the files then.")
    ] = False,
    browser: Annotated[bool, Parameter(help="Open the page in the browser.")] = True,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Show pictures and maps in the browser: exposure, values with errors, wipes, differences, maps from inside.

    Runs until Ctrl-C. The page speaks to this machine alone, and whoever has the printed address may read these files.
    """

    def say(address: str) -> None:
        print_facts(output, {"address": address}, title="relume view; Ctrl-C ends it")
        sys.stdout.flush()  # a program that started this waits for the address

    with warnings_as_notes(output):
        rl.view(files, host=host, port=port, allow_remote=allow_remote, open_browser=browser, say=say)

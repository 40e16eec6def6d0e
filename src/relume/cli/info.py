"""`relume info`: what a file holds, or what this machine renders with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from relume.cli.console import Manner, speaking, tell, version


def info(
    paths: Annotated[list[Path] | None, Parameter(help="Pictures, radiance maps or light maps.", negative="")] = None,
    /,
    *,
    system: Annotated[
        bool, Parameter(negative="", help="Tell what this machine renders with, and what is missing.")
    ] = False,
    manner: Manner = Manner(),
) -> None:
    """Tell what picture files hold: size, exposure, unit, range, parts; or what this machine renders with."""
    with speaking(manner):
        if system:
            tell(manner, _system(), title="relume on this machine")
        elif not paths:
            raise ValueError("name a file, or ask about this machine with --system")
        for path in paths or ():
            from relume.image import files

            facts = files.describe(path)
            shown = (
                facts if manner.json or manner.verbose else {k: v for k, v in facts.items() if v not in (None, [], {})}
            )
            tell(manner, {k: v for k, v in shown.items() if k != "file" or manner.json}, title=str(path))


def _system() -> dict[str, object]:
    import os
    import platform
    from importlib.metadata import version as version_of

    from relume.render.mitsuba_variant import choose_variant

    choice = choose_variant()
    return {
        "relume": version(),
        "python": platform.python_version(),
        "mitsuba": version_of("mitsuba"),
        "variant": choice.name,
        "because": choice.reason,
        "cores": os.cpu_count(),
    }

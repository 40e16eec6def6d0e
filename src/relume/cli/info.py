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
    draw: Annotated[
        Path | None,
        Parameter(help="Draw a light map at three exposures with its axes, as this .png."),
    ] = None,
    from_: Annotated[
        str | None, Parameter(name="--from", help="Mapping of the map to draw, where the file does not remember it.")
    ] = None,
    manner: Manner = Manner(),
) -> None:
    """Tell what picture files hold: size, exposure, unit, range, parts; or what this machine renders with."""
    with speaking(manner):
        if system:
            tell(manner, _system(), title="relume on this machine")
        elif not paths:
            raise ValueError("name a file, or ask about this machine with --system")
        if draw is not None:
            _draw(paths or [], draw, from_)
        elif from_ is not None:
            raise ValueError("--from is for --draw; give that too")
        for path in paths or ():
            from relume.image import files

            facts = files.describe(path)
            shown = (
                facts if manner.json or manner.verbose else {k: v for k, v in facts.items() if v not in (None, [], {})}
            )
            tell(manner, {k: v for k, v in shown.items() if k != "file" or manner.json}, title=str(path))


def _draw(paths: list[Path], out: Path, from_: str | None) -> None:
    from relume.cli.arguments import require_suffix
    from relume.cli.light_input import read_light
    from relume.image import files
    from relume.shot.light_plot import light_plot
    from relume.sphere.mappings import mapping_named

    if len(paths) != 1:
        raise ValueError(f"--draw shows one map; {len(paths)} files are named")
    require_suffix(out, ".png", option="--draw")
    light = read_light(paths[0], None if from_ is None else mapping_named(from_))
    with files.replacing(out) as temporary:
        temporary.write_bytes(light_plot(light, paths[0].name))


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

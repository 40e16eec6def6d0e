"""`relume info`: what a file holds, or what this machine renders with."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import relume as rl
from relume.cli.console import OutputOptions, print_facts, refuse, version, warnings_as_notes
from relume.cli.reading_options import ReadingOptions
from relume.errors import RelumeError
from relume.image.files.read_options import ReadOptions


def info(
    paths: Annotated[
        list[Path] | None, Parameter(help="Pictures, radiance maps, light maps, camera raws, cubes.", negative="")
    ] = None,
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
    options: ReadingOptions = ReadingOptions(),
    output: OutputOptions = OutputOptions(),
) -> None:
    """Tell what picture files hold: size, exposure, unit, range, faults; or what this machine renders with.

    Of several files those that can be read are told of, also where another cannot; the exit code is 2 then. With --json
    each file is one line.
    """
    with warnings_as_notes(output):
        if system:
            print_facts(output, _system(), title="relume on this machine")
        elif not paths:
            raise ValueError("name a file, or ask about this machine with --system")
        reading = options.reading()
        if draw is not None:
            _draw(paths or [], draw, from_, reading)
        elif from_ is not None:
            raise ValueError("--from is for --draw; give that too")
        unreadable: list[RelumeError] = []
        for path in paths or ():
            from relume.cli.info_lines import lines_of
            from relume.image.files import describe

            try:
                facts = with_directions(describe(path, reading))
            except RelumeError as error:
                unreadable.append(error)
                continue
            print_facts(output, facts if output.json else lines_of(facts, whole=output.verbose), title=str(path))
        if unreadable:
            for error in unreadable[:-1]:
                refuse(str(error), 2)
            raise unreadable[-1]


def with_directions(facts: dict[str, Any]) -> dict[str, Any]:
    """The facts of a map, its brightest places with their direction: degrees to the right of −Z and up from level.

    assumed : whether only the shape says that the map is a lat-long map
    """
    places = {name: facts[name] for name in ("brightest", "lone") if facts.get(name)}
    return facts | {name: {**place, "direction": _direction(facts, place)} for name, place in places.items()}


def _direction(facts: Mapping[str, Any], place: Mapping[str, Any]) -> dict[str, Any] | None:
    told, (width, height) = facts["attributes"], facts["size"]
    if "mirror" in told or "face" in told or ("mapping" not in told and width != 2 * height):
        return None

    import numpy as np

    from relume.sphere.mappings.mapping import LatLong
    from relume.sphere.mappings.names import mapping_named

    try:
        mapping = mapping_named(told["mapping"]) if "mapping" in told else LatLong()
        if mapping.shape(height) != (height, width):
            return None
        view = mapping
        if "orientation" in told:
            from relume.sphere.mappings.orientation import orientation_named

            view = orientation_named(told["orientation"])
    except ValueError:  # of another program, or of another time
        return None
    x, y, z = view.directions(np.array([(place["x"] + 0.5) / width, (place["y"] + 0.5) / height]))
    if np.isnan(x):
        return None
    azimuth, elevation = np.degrees([np.arctan2(x, -z), np.arcsin(np.clip(y, -1, 1))])
    return {
        "azimuth": round(float(azimuth), 2),
        "elevation": round(float(elevation), 2),
        "mapping": mapping.name,
        "assumed": "mapping" not in told and told.get("envmap") != "latlong",
    }


def _draw(paths: list[Path], out: Path, from_: str | None, reading: ReadOptions) -> None:
    from relume.cli.arguments import require_suffix
    from relume.image import files
    from relume.report.light_plot import light_plot
    from relume.sphere.mappings.names import mapping_named

    if len(paths) != 1:
        raise ValueError(f"--draw shows one map; {len(paths)} files are named")
    require_suffix(out, ".png", option="--draw")
    light = rl.read_environment(paths[0], None if from_ is None else mapping_named(from_), options=reading)
    with files.replacing(out) as temporary:
        temporary.write_bytes(light_plot(light, paths[0].name))


def _system() -> dict[str, object]:
    import os
    import platform
    from importlib.metadata import version as version_of

    from relume.renderers.mitsuba.variant import choose_variant

    choice = choose_variant()
    return {
        "relume": version(),
        "python": platform.python_version(),
        "mitsuba": version_of("mitsuba"),
        "variant": choice.name,
        "because": choice.reason,
        "cores": os.cpu_count(),
    }

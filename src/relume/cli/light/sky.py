"""`relume sky`: a place, a date and an hour in, the clear sky with its sun out, as an environment map in cd/m²."""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, mapping_of, require_suffix
from relume.cli.console import OutputOptions, print_facts, warnings_as_notes
from relume.cli.option_types import Colour, numbers


def sky(
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The environment map to write, .exr or .hdr.")],
    latitude: Annotated[
        float | None, Parameter(allow_leading_hyphen=True, help="Degrees north of the equator; south is negative.")
    ] = None,
    longitude: Annotated[
        float | None, Parameter(allow_leading_hyphen=True, help="Degrees east of Greenwich; west is negative.")
    ] = None,
    date: Annotated[
        str | None,
        Parameter(help="Date and time with the clock's offset from UTC, like 2026-06-21T13:00+02:00, or Z for UTC."),
    ] = None,
    sun: Annotated[
        tuple[float, float] | None,
        numbers(
            "ELEVATION[,AZIMUTH]",
            like="45 or 45,180",
            filled=0.0,
            help="Where the sun stands instead, degrees above the horizon, and from north over east.",
        ),
    ] = None,
    turbidity: Annotated[float, Parameter(help="Haze: 1 is air alone, 3 a clear day, 10 thick haze.")] = 3.0,
    ground: Annotated[Colour, Parameter(help="Albedo of the ground, a number or R,G,B.")] = (0.2, 0.2, 0.2),
    heading: Annotated[
        float,
        Parameter(
            allow_leading_hyphen=True,
            help="Compass direction that the middle of the map (−Z) looks in, degrees from north over east.",
        ),
    ] = 0.0,
    size: Annotated[int, Parameter(help="Rows of the map.")] = 512,
    to: Annotated[str | None, Parameter(help="Mapping, latlong unless given; see `convert`.")] = None,
    only: Annotated[
        Literal["sky", "sun"] | None,
        Parameter(help="sky: without the sun's disc, though the ground is lit by it; sun: the disc alone."),
    ] = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Make the light of a clear day by place and time, in cd/m²: sky, sun, lit ground (Hošek & Wilkie 2012, 2013)."""
    with warnings_as_notes(output):
        # Where the sun stands.
        require_suffix(out, ".exr", ".hdr")
        turned = math.radians(heading)
        if sun is not None:
            if (latitude, longitude, date) != (None, None, None):
                raise ValueError("--sun says where the sun stands; leave --latitude, --longitude and --date out")
            if not 0 < sun[0] <= 90:
                raise ValueError(f"--sun: the sun's elevation is {sun[0]:g}°; give above 0 to 90, which is day")
            place = rl.light.SunPosition(math.radians(sun[0]), math.radians(sun[1]))
            description = rl.light.Sky(place, turbidity, ground, turned)
        else:
            if latitude is None or longitude is None or date is None:
                raise ValueError("give --latitude, --longitude and --date, or --sun ELEVATION,AZIMUTH")
            description = rl.light.Sky.at(latitude, longitude, _time(date), turbidity, ground, turned)
        # How the map is laid out.
        mapping = mapping_of(to, "--to") or rl.mappings.LatLong()
        mapping.shape(size)
        if dry_run:
            print_facts(output, {"would write": str(out), **description.facts()})
            return
        # The map, and what light it holds.
        light = rl.light.sky(description, size, mapping, dome=only != "sun", sun=only != "sky")
        rl.write(out, rl.as_radiance_map(light))
        audit = light.audit().facts()
        print_facts(output, {"written": str(out), **description.facts(), "unit": light.unit, "total": audit["total"]})


def _time(text: str) -> datetime:
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        raise ValueError(f'--date: "{text}" is no date and time; write it like 2026-06-21T13:00+02:00') from None

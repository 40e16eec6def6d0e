"""`relume sun`: the light that a clipped sun held, from a grey ball or a chart that the same light fell on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import Accept, Clamp, DryRun, From, mapping_of, require_files, require_suffix
from relume.cli.console import OutputOptions, finish, print_facts, warnings_as_notes
from relume.cli.option_types import Colour, Point, numbers

Circle = tuple[float, float, float]


def sun(
    light_map: Annotated[Path, Parameter(name="MAP", help="The environment map whose sun clipped, .exr or .hdr.")],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The map to write, .exr or .hdr.")],
    grey_ball: Annotated[
        Path | None,
        Parameter(help="Radiance map of a matte ball in the same light, exposed like the map and itself not clipped."),
    ] = None,
    albedo: Annotated[Colour | None, Parameter(help="Of the grey ball: a number or R,G,B, linear, like 0.18.")] = None,
    camera: Annotated[
        Point, Parameter(help="Where the camera of --grey-ball stood, in metres from the ball's centre.")
    ] = (0.0, 0.0, 1.0),
    radius: Annotated[float, Parameter(help="Of the grey ball, metres.")] = 0.05,
    pick: Annotated[
        Circle | None,
        numbers("X,Y,RADIUS", like="320,240,100", help="The grey ball's rim in pixels; found unless given."),
    ] = None,
    chart: Annotated[
        Path | None, Parameter(help="Radiance map that shows a chart instead, exposed like the map.")
    ] = None,
    patch: Annotated[
        list[tuple[Circle, tuple[float] | tuple[float, float, float], tuple[float, float, float]]] | None,
        numbers(
            "X,Y,RADIUS=REFLECTANCE@NX,NY,NZ",
            like="640,360,20=0.9@0,1,0",
            help="A patch of the chart in pixels, its reflectance (a number or R,G,B) and the direction it faces; "
            "again for each.",
        ),
    ] = None,
    level: Annotated[
        float | None,
        Parameter(
            help="Radiance from which on the map counts as clipped; by default as the file marks it, else its plateau."
        ),
    ] = None,
    disc: Annotated[
        bool,
        Parameter(negative="", help="Put what is missing into a disc of the sun's size, not where the map clipped."),
    ] = False,
    from_: From = None,
    clamp: Clamp = False,
    accept: Accept = False,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Give a clipped sun back its light, so that a matte thing in the same light is as bright as it was."""
    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        require_suffix(out, ".exr", ".hdr")
        require_files([light_map, *(path for path in (grey_ball, chart) if path)])
        if (grey_ball is None) == (chart is None):
            raise ValueError("give --grey-ball with --albedo, or --chart with --patch")
        light = rl.read_environment(light_map, mapping_of(from_), clamp=clamp)
        # What the chart or the ball measured.
        if chart is not None:
            if not patch:
                raise ValueError("--chart needs a --patch, like 640,360,20=0.9@0,1,0")
            patches = [
                rl.light.ChartPatch(circle, reflectance if len(reflectance) == 3 else reflectance[0], normal)
                for circle, reflectance, normal in patch
            ]
            readings = rl.light.measure_chart(rl.read_radiance(chart), patches, str(chart))
        else:
            assert grey_ball is not None
            if albedo is None:
                raise ValueError("--grey-ball needs its --albedo, like 0.18 for middle grey")
            picture = rl.read_radiance(grey_ball)
            readings = rl.light.measure_grey_ball(picture, albedo, camera, radius, pick, grey_ball.name)
        if dry_run:
            print_facts(output, {"would write": str(out), "readings": len(readings.normals), "from": readings.source})
            return
        # The sun, the map with it, and the light before and after.
        shape = rl.light.SunDisc() if disc else rl.light.ClippedPixels()
        found = rl.light.recover_sun(light, readings, level=level, shape=shape)
        written = rl.as_radiance_map(found.light)
        rl.write(out, replace(written, attributes={**written.attributes, **found.attributes}))
        energy = {"before": light.audit().facts(), "after": found.light.audit().facts()}
        print_facts(output, {"written": str(out), **found.facts(), **energy})
        finish(output, found.doubts, accept=accept)

"""`relume sun`: what a clipped sun really held, from a grey ball or a chart that the same light fell on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import DryRun, read_point, require_files, require_suffix
from relume.cli.console import OutputOptions, note, print_facts, warnings_as_notes
from relume.cli.light_input import Clamp
from relume.errors import DoubtfulResult, UnreadableFile

if TYPE_CHECKING:
    import numpy as np

    from relume.image.radiance import RadianceMap
    from relume.light.suns.clipped_sun import RecoveredSun
    from relume.light.suns.matte_readings import MatteReadings, Patch

UNMEASURED = 0.01
"""Share of a patch's pixels that may be clipped: dust on the sensor is left out, a saturated patch is none."""
RESIDUAL, AGREEMENT = 0.1, 0.05
"""A fit that misses its readings by more, or a map that differs by more where nothing clipped, is doubtful."""


def sun(
    light_map: Annotated[Path, Parameter(name="MAP", help="The light map whose sun clipped, .exr or .hdr.")],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The map to write, .exr or .hdr.")],
    grey_ball: Annotated[
        Path | None,
        Parameter(help="Radiance map of a matte ball in the same light, exposed like the map and itself not clipped."),
    ] = None,
    albedo: Annotated[str | None, Parameter(help="Of the grey ball: a number or R,G,B, linear, like 0.18.")] = None,
    camera: Annotated[
        str,
        Parameter(
            allow_leading_hyphen=True,
            help="Where the camera of --grey-ball stood, as X,Y,Z in metres from the ball's centre.",
        ),
    ] = "0,0,1",
    radius: Annotated[float, Parameter(help="Of the grey ball, metres.")] = 0.05,
    pick: Annotated[
        str | None,
        Parameter(allow_leading_hyphen=True, help="The grey ball's rim as X,Y,RADIUS in pixels; sought unless given."),
    ] = None,
    chart: Annotated[
        Path | None, Parameter(help="Radiance map that shows a chart instead, exposed like the light map.")
    ] = None,
    patch: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            help="X,Y,RADIUS=REFLECTANCE@NX,NY,NZ: a patch of the chart in pixels, its reflectance (a number or R,G,B) "
            "and the direction it faces; again for each.",
        ),
    ] = None,
    level: Annotated[
        float | None,
        Parameter(help="Radiance from which on the map counts as clipped; as the file marks it, else its plateau."),
    ] = None,
    disc: Annotated[
        bool,
        Parameter(negative="", help="Put what is missing into a disc of the sun's size, not where the map clipped."),
    ] = False,
    from_: Annotated[
        str | None, Parameter(name="--from", help="Mapping of the map where the file does not remember it, as convert.")
    ] = None,
    clamp: Clamp = False,
    accept: Annotated[bool, Parameter(negative="", help="Exit with 0 although the result is doubtful.")] = False,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Give a clipped sun back its light, so that a matte thing in the same light is as bright as it was."""
    from relume.image import files
    from relume.light.suns.clipped_regions import Disc, Spread
    from relume.light.suns.clipped_sun import recover_sun
    from relume.sphere.environment_files import as_radiance_map
    from relume.sphere.mappings.names import mapping_named

    with warnings_as_notes(output):
        require_suffix(out, ".exr", ".hdr")
        require_files([light_map, *(path for path in (grey_ball, chart) if path)])
        if (grey_ball is None) == (chart is None):
            raise ValueError("give --grey-ball with --albedo, or --chart with --patch")
        light = rl.read_environment(light_map, None if from_ is None else mapping_named(from_), clamp=clamp)
        if grey_ball is not None:
            readings = _of_ball(grey_ball, albedo, read_point(camera, "--camera"), radius, pick)
        else:
            assert chart is not None
            readings = _of_chart(chart, patch or [])
        if dry_run:
            print_facts(output, {"would write": str(out), "readings": len(readings.normals), "from": readings.source})
            return
        found = recover_sun(light, readings, level=level, shape=Disc() if disc else Spread())
        picture = as_radiance_map(found.light)
        files.write(out, replace(picture, attributes={**picture.attributes, **found.attributes}))
        print_facts(
            output,
            {
                "written": str(out),
                "from": readings.source,
                "sources": [
                    {
                        "direction": [round(float(value), 4) for value in source.direction],
                        "irradiance": [float(f"{value:.5g}") for value in source.irradiance],
                        "uncertainty": [float(f"{value:.2g}") for value in source.uncertainty],
                        "factor": [float(f"{value:.4g}") for value in source.factor],
                    }
                    for source in found.sources
                ],
                "residual": float(f"{found.residual:.3g}"),
                "before": light.audit().facts(),
                "after": found.light.audit().facts(),
            },
        )
        _doubt(out, found, accept, output)


def _doubt(out: Path, found: RecoveredSun, accept: bool, output: OutputOptions) -> None:
    if found.residual <= RESIDUAL and not abs(found.agreement - 1) > AGREEMENT:
        return
    line = f"{out}: written, but it misses the readings by {100 * found.residual:.2g} %"
    if abs(found.agreement - 1) > AGREEMENT:
        line = f"{out}: written, but where nothing clipped the readings are {found.agreement:.3g} times the map"
    line += "; is the reflectance right, and were both exposed alike at one place?"
    if not accept:
        raise DoubtfulResult(line)
    note(output, line)


def _of_ball(
    path: Path, albedo: str | None, camera: tuple[float, float, float], radius: float, pick: str | None
) -> MatteReadings:
    import numpy as np

    from relume.image import files
    from relume.light.suns.matte_readings import read_grey_ball
    from relume.probe.ball.silhouette import outline_of_circle
    from relume.probe.ball.unwrapping import unwrap_ball

    if albedo is None:
        raise ValueError("--grey-ball needs its --albedo, like 0.18 for middle grey")
    outline = None if pick is None else outline_of_circle(*read_point(pick, "--pick"))
    view = unwrap_ball(
        files.read_radiance(path), camera=np.array(camera), centre=np.zeros(3), radius=radius, outline=outline,
        name=path.name,
    )  # fmt: skip
    return read_grey_ball(view, _reflectance(albedo, "--albedo"))


def _of_chart(path: Path, words: Sequence[str]) -> MatteReadings:
    from relume.image import files
    from relume.light.suns.matte_readings import read_chart

    if not words:
        raise ValueError("--chart needs a --patch, like 640,360,20=0.9@0,1,0")
    picture = files.read_radiance(path)
    return read_chart([_patch(word, picture, path) for word in words], picture.unit)


def _patch(word: str, picture: RadianceMap, path: Path) -> Patch:
    import numpy as np

    from relume.light.suns.matte_readings import Patch
    from relume.sphere.directions import normalised

    place, equals, rest = word.partition("=")
    reflectance, at, facing = rest.partition("@")
    if not equals or not at:
        raise ValueError(f'--patch "{word}": write X,Y,RADIUS=REFLECTANCE@NX,NY,NZ, like 640,360,20=0.9@0,1,0')
    x, y, radius = read_point(place, "--patch")
    normal = np.array(read_point(facing, "--patch"))
    if not np.all(np.isfinite(normal)) or not normal.any():
        raise ValueError(f'--patch "{word}": {facing} is no direction; tell which way the patch faces, like 0,1,0')
    rows, columns = np.indices(picture.radiance.shape[:2]) + 0.5
    inside = np.hypot(columns - x, rows - y) <= radius
    if inside.sum() < 4:
        raise ValueError(f'--patch "{word}": fewer than four pixels of {path} lie there; mind that x, y are pixels')
    width, height = picture.size
    if min(x, y, width - x, height - y) < radius:
        raise ValueError(f'--patch "{word}": reaches out of {path}, which is {width}×{height} pixels; give a smaller')
    values = _measured(word, picture, inside, path)
    deviation = values.std(0) / np.sqrt(len(values))
    return Patch(
        _three(values.mean(0)),
        _reflectance(reflectance, "--patch"),
        _three(normalised(normal)),
        _three(deviation),
    )


def _measured(word: str, picture: RadianceMap, inside: np.ndarray, path: Path) -> np.ndarray:
    """Radiance (N, 3) of a patch's pixels, without the few that were not measured."""
    import numpy as np

    values = picture.radiance[inside].astype(np.float64)
    odd = ~np.isfinite(values).all(-1) | (values < 0).any(-1)
    # Every code but 0 is of a bound, or of nothing: their mean would be one too.
    odd |= False if picture.clipped is None else picture.clipped[inside] != 0
    number = int(np.count_nonzero(odd))
    if number >= UNMEASURED * len(values):
        raise UnreadableFile(
            f'{path}: --patch "{word}": {number} of its {len(values)} pixels are saturated, black or not seen; expose '
            "the chart so that none is, or give a smaller patch"
        )
    if not values[~odd].any():
        raise UnreadableFile(f'{path}: --patch "{word}": black all over, so it tells nothing; photograph it lit')
    return values[~odd]


def _three(values: np.ndarray) -> tuple[float, float, float]:
    red, green, blue = map(float, values)
    return red, green, blue


def _reflectance(text: str, option: str) -> tuple[float, float, float] | float:
    try:
        values = [float(part) for part in text.split(",")]
        if len(values) not in (1, 3):
            raise ValueError
    except ValueError:
        raise ValueError(f'{option}: "{text}" is no reflectance; write a number or R,G,B, like 0.18') from None
    return values[0] if len(values) == 1 else (values[0], values[1], values[2])

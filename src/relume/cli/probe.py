"""`relume probe`: photographs of a mirrored ball in, an illumination map out."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, Times, read_point, read_times, require_files, require_suffix
from relume.cli.console import Manner, note, speaking, tell


def probe(
    photographs: Annotated[
        list[Path], Parameter(help="A bracket of the ball, or one radiance map of it.", negative="")
    ],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The lat-long illumination map to write, .exr or .hdr.")],
    second: Annotated[
        list[Path] | None,
        Parameter(
            help="A bracket of the same ball from another side, best a quarter turn away.",
            negative="",
            consume_multiple=True,
        ),
    ] = None,
    camera: Annotated[
        str, Parameter(help="Where the camera stood, as X,Y,Z in metres from the ball's centre.")
    ] = "0,0,1",
    second_camera: Annotated[str, Parameter(help="Where the camera of --second stood.")] = "1,0,0",
    radius: Annotated[
        float | None, Parameter(help="The ball's radius in metres, where the EXIF has no focal length.")
    ] = None,
    times: Times = None,
    size: Annotated[int, Parameter(help="Rows of the map.")] = 512,
    dry_run: DryRun = False,
    manner: Manner = Manner(),
) -> None:
    """Find the mirrored ball, unwrap it with the camera's perspective, and blend up to two views into one light map."""
    import numpy as np

    from relume.capture.bracket import Bracket, read_bracket, require_told
    from relume.capture.calibration import recover_response
    from relume.capture.merging import merge
    from relume.image import files
    from relume.image.radiance import RadianceMap
    from relume.probe.ball import view_ball
    from relume.probe.blending import assemble
    from relume.sphere.illumination import as_radiance_map

    with speaking(manner):
        require_suffix(out, ".exr", ".hdr")
        groups = [(photographs, read_point(camera, "--camera"))]
        if second:
            groups.append((second, read_point(second_camera, "--second-camera")))
        seconds = read_times(times)
        pictures: list[tuple[RadianceMap | Bracket, float | None, str]] = []
        for paths, _ in groups:
            require_files(paths)
            first = files.read(paths[0])
            if isinstance(first, RadianceMap):
                pictures.append((first, None, paths[0].name))
                continue
            given = None if seconds is None else [seconds.pop(0) for _ in paths if seconds]
            bracket = read_bracket(paths, times=given)
            pictures.append((bracket, bracket.focal_length, bracket.name))
        if dry_run:
            tell(manner, {"would write": str(out), "views": [name for _, _, name in pictures]})
            return
        brackets = [p for p, _, _ in pictures if isinstance(p, Bracket)]
        require_told(brackets)
        curve = None
        if brackets:
            recovered = recover_response(brackets).response
            curve = recovered.balanced_at(recovered.levels - 1)
        views = []
        for (picture, focal_length, name), (_, position) in zip(pictures, groups, strict=True):
            if isinstance(picture, Bracket) and curve is not None:
                picture = merge(picture, curve)
            assert isinstance(picture, RadianceMap)
            if focal_length is None and radius is None:
                note(
                    manner,
                    f"{name}: no focal length in its EXIF and no --radius; the ball is taken to be 5 cm in radius",
                )
            views.append(
                view_ball(
                    picture, camera=np.array(position), centre=np.zeros(3), focal_length=focal_length,
                    radius=0.05 if radius is None else radius, name=name,
                )
            )  # fmt: skip
        result = assemble(views, size=size)
        files.write(out, as_radiance_map(result.light))
        unseen = float(((result.confidence < 0.05) * result.light.mapping.solid_angles(size)).sum())
        if unseen > 0:
            note(
                manner,
                f"{unseen:.2g} sr are seen by no view and were filled from beside; photograph from a second side",
            )
        if result.clipped_solid_angle > 0:
            note(
                manner, f"{result.clipped_solid_angle:.2g} sr are saturated in every photograph; add shorter exposures"
            )
        tell(
            manner,
            {
                "written": str(out),
                "balls": [
                    {
                        "x": round(v.outline.centre[0], 2),
                        "y": round(v.outline.centre[1], 2),
                        "radius": round(v.outline.radius, 2),
                    }
                    for v in views
                ],
                "turned by registration": [f"{math.degrees(c):.2f}°" for c in result.corrections],
                "total": result.light.total().round(4).tolist(),
                "irradiance from above": result.light.irradiance(np.array([0.0, 1.0, 0.0])).round(4).tolist(),
            },
        )

"""`relume stage view`: a stage, light, a mesh and a camera in, the subject seen from there out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import ClusterWord, DryRun, require_files
from relume.cli.console import OutputOptions, note, print_facts, spread, warnings_as_notes
from relume.cli.option_types import Point, Size
from relume.cli.stage.light import Light
from relume.cli.stage.options import Exposure, Stage, existing_parent, require_picture


def view(
    stage: Stage,
    /,
    *,
    mesh: Annotated[
        Path | None,
        Parameter(help="A mesh of the subject in the stage's frame, metres: .glb, .obj, .ply; else the stage's own."),
    ] = None,
    out: Annotated[
        Path, Parameter(alias="-o", help="The picture: .exr (with alpha and what no camera saw), .hdr, .png or .jpg.")
    ],
    light: Light = Light(),
    position: Annotated[Point | None, Parameter(help="Where the new camera stands, X,Y,Z metres.")] = None,
    target: Annotated[Point, Parameter(help="What it looks at, X,Y,Z metres, horizon level.")] = (0.0, 0.0, 0.0),
    field_of_view: Annotated[
        float | None, Parameter(help="Of the new camera, across, degrees; the stage's own unless given.")
    ] = None,
    picture_size: Annotated[
        Size | None, Parameter(help="Of the picture, WIDTHxHEIGHT; the stage's own unless given.")
    ] = None,
    camera_file: Annotated[
        Path | None, Parameter(help="The new camera in a file instead: .glb, .usda, .fspy or .json of Blender.")
    ] = None,
    camera: Annotated[
        list[str] | None,
        Parameter(negative="", help="A camera whose pictures are used; again for each; else the first."),
    ] = None,
    measured: Annotated[
        bool,
        Parameter(
            negative="",
            help="Carry the measured reflectance functions to the new view (the paper's eq. 9) instead of computing "
            "direct light on the mesh; quicker, and less exact where the light is narrow.",
        ),
    ] = False,
    exposure: Exposure = 0.0,
    cluster: ClusterWord = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Relight a subject and see it from a new place (Debevec et al. 2000, §4): shadows and highlights move.

    What no camera of the stage saw is left out; the command prints its share.
    """
    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        light.check()
        if measured and cluster is not None:
            raise ValueError("--measured is done in this process; leave it or --cluster out")
        require_picture(out)
        require_files([path for path in (mesh, camera_file) if path is not None])
        subject = rl.lightstage.subject_mesh(stage, mesh)
        if subject is None:
            raise ValueError(f"{stage}: has no mesh, which a new view needs; give --mesh, from `relume stage scan`")
        if (position is None) == (camera_file is None):
            raise ValueError("give one of --position and --camera-file")
        # The source cameras' pictures, and the new camera.
        names = camera or [None]
        fields = [rl.lightstage.read_stage(stage, name) for name in names]
        own = fields[0].camera
        if own is None:
            raise ValueError(f"{stage}: has no camera, which a new view needs; add it to stage.json")
        if camera_file is not None:
            new = rl.read_camera(camera_file, *(picture_size or (own.width, own.height)))
        else:
            assert position is not None
            new = _camera(own, position, target, field_of_view, picture_size)
        if dry_run:
            print_facts(output, {"would write": str(out), "size": [new.width, new.height], "cameras": len(fields)})
            return
        # The view.
        with spread(cluster, output) as (workers, report):
            report("viewing", 0.0)
            sources = [
                rl.lightstage.SourceView(field, name=name or Path(stage).name)
                for field, name in zip(fields, names, strict=True)
            ]
            settings = rl.lightstage.ViewSettings(measured=measured, nearest=light.nearest)
            found = rl.lightstage.view(
                sources, light.lighting(), new, subject, settings, cluster=workers, scratch=existing_parent(out)
            )
            report("viewing", 1.0)
        # The files.
        if out.suffix.lower() == ".exr":
            layers = {"radiance": found.picture.radiance, "alpha": found.alpha, "unseen": found.unseen}
            rl.files.write_layers(out, layers, unit=found.picture.unit)
        else:
            rl.lightstage.write_picture(out, found.picture, exposure)
        share = float(found.unseen.sum() / (found.alpha.sum() + found.unseen.sum()))
        if 0.01 < share <= 0.25:  # of more the library warns
            note(output, f"{share:.0%} of what the new view shows was seen by no camera, and is left black")
        print_facts(output, {"written": str(out), "size": [new.width, new.height], "unseen": float(f"{share:.3g}")})


def _camera(
    own: rl.Camera, position: Point, target: Point, field_of_view: float | None, size: Size | None
) -> rl.Camera:
    """The new camera; what is not given is as the stage's own."""
    import numpy as np

    width, height = size or (own.width, own.height)
    if field_of_view is not None and not 0 < field_of_view < 180:
        raise ValueError(f"--field-of-view is {field_of_view}; give degrees above 0 and below 180")
    focal = own.focal_length * width / own.width
    if field_of_view is not None:
        focal = width / 2 / np.tan(np.radians(field_of_view) / 2)
    return rl.Camera.looking_at(
        np.array(position), np.array(target), width=width, height=height, focal_length=float(focal)
    )

"""`relume stage view`: a stage, light, a mesh and a camera in, the subject seen from there out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, read_point, require_files
from relume.cli.console import OutputOptions, note, print_facts, progress, warnings_as_notes
from relume.cli.stage.light import Light
from relume.cli.stage.options import Stage
from relume.cli.stage.output import require_picture, write_picture

if TYPE_CHECKING:
    from relume.lightstage.field.field import ReflectanceField
    from relume.lightstage.novel_view.source_views import View
    from relume.scene.cameras.camera import Camera
    from relume.scene.shapes.shapes import Mesh


def view(
    stage: Stage,
    /,
    *,
    mesh: Annotated[Path, Parameter(help="A mesh of the subject in the stage's frame, metres: .glb, .obj, .ply.")],
    out: Annotated[
        Path, Parameter(alias="-o", help="The picture: .exr (with alpha and what no camera saw), .hdr, .png or .jpg.")
    ],
    light: Light = Light(),
    position: Annotated[
        str | None, Parameter(allow_leading_hyphen=True, help="Where the new camera stands, X,Y,Z metres.")
    ] = None,
    target: Annotated[
        str, Parameter(allow_leading_hyphen=True, help="What it looks at, X,Y,Z metres, horizon level.")
    ] = "0,0,0",
    field_of_view: Annotated[
        float | None, Parameter(help="Of the new camera, across, degrees; the stage's own.")
    ] = None,
    size: Annotated[str | None, Parameter(help="Of the picture, WIDTHxHEIGHT; the stage's own.")] = None,
    camera_file: Annotated[
        Path | None, Parameter(help="The new camera in a file instead: .glb, .usda, .fspy or .json of Blender.")
    ] = None,
    camera: Annotated[
        list[str] | None,
        Parameter(negative="", help="A camera of the stage whose pictures are used; again for each; the first."),
    ] = None,
    measured: Annotated[
        bool,
        Parameter(
            negative="",
            help="Carry the measured reflectance functions to the new view (the paper's eq. 9) instead of computing "
            "direct light on the mesh; quicker, and less exact where the light is narrow.",
        ),
    ] = False,
    exposure: Annotated[float, Parameter(allow_leading_hyphen=True, help="Stops to brighten .png and .jpg by.")] = 0.0,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Relight a subject and see it from a new place (Debevec et al. 2000, §4): shadows and highlights move.

    What no camera of the stage saw is left out, and told.
    """
    from relume.image import files
    from relume.lightstage.acquire.read_stage import read_stage, stage_geometry
    from relume.lightstage.direct_light.model import DirectLightSettings
    from relume.lightstage.novel_view.direct_light_view import direct_light_view
    from relume.lightstage.novel_view.source_views import Source
    from relume.scene.shapes.meshes import read_meshes

    with warnings_as_notes(output):
        light.check()
        require_picture(out)
        require_files([mesh, *([camera_file] if camera_file else [])])
        if (position is None) == (camera_file is None):
            raise ValueError("give one of --position and --camera-file")
        fields, names = [read_stage(stage, name) for name in camera or [None]], camera or [stage.name]
        if fields[0].camera is None:
            raise ValueError(f"{stage}: tells no camera, which a new view needs; add it to stage.json")
        new = _camera(fields[0].camera, position, target, field_of_view, size, camera_file)
        meshes = read_meshes(mesh)
        if dry_run:
            print_facts(output, {"would write": str(out), "size": [new.width, new.height], "cameras": len(fields)})
            return
        with progress(output) as report:
            report("viewing", 0.0)
            if measured:
                found, unit = _carried(fields, names, light, new, meshes)
            else:
                sources = [Source(field, name=name) for field, name in zip(fields, names, strict=True)]
                directed, unit = light.directed()
                radius = stage_geometry(stage)[1]
                settings = DirectLightSettings() if radius is None else DirectLightSettings(light_radius=radius)
                found = direct_light_view(sources, directed, new, meshes, settings=settings)
            report("viewing", 1.0)
        if out.suffix.lower() == ".exr":
            layers = {"radiance": found.picture.radiance, "alpha": found.alpha, "unseen": found.unseen}
            files.write_layers(out, layers, unit=unit)
        else:
            write_picture(out, found.picture, exposure)
        share = float(found.unseen.sum() / (found.alpha.sum() + found.unseen.sum()))
        if share > 0.01:
            note(output, f"{share:.0%} of what the new view shows was seen by no camera, and is left black")
        print_facts(output, {"written": str(out), "size": [new.width, new.height], "unseen": float(f"{share:.3g}")})


def _carried(
    fields: Sequence[ReflectanceField], names: Sequence[str], light: Light, new: Camera, meshes: Sequence[Mesh]
) -> tuple[View, str]:
    """The view by the paper's eq. 9, and its unit."""
    from relume.lightstage.novel_view.measured_view import view as seen_from
    from relume.lightstage.novel_view.source_views import Source
    from relume.lightstage.surface.separation import separate

    parts = [separate(field) for field in fields]
    told = zip(fields, parts, names, strict=True)
    sources = [Source(field, part, alpha=part.alpha, name=name) for field, part, name in told]
    given = [light.irradiances(field.lights) for field in fields]
    return seen_from(sources, [amounts for amounts, _ in given], new, meshes), given[0][1]


def _camera(
    own: Camera, position: str | None, target: str, field_of_view: float | None, size: str | None, file: Path | None
) -> Camera:
    """The new camera; what is not told of it is as the stage's own."""
    import numpy as np

    from relume.scene.cameras.camera import Camera
    from relume.scene.cameras.files import read_camera

    width, height = (own.width, own.height) if size is None else _size(size)
    if file is not None:
        return read_camera(file, width, height)
    assert position is not None
    if field_of_view is not None and not 0 < field_of_view < 180:
        raise ValueError(f"--field-of-view is {field_of_view}; give degrees above 0 and below 180")
    focal = own.focal_length * width / own.width
    if field_of_view is not None:
        focal = width / 2 / np.tan(np.radians(field_of_view) / 2)
    place, at = np.array(read_point(position, "--position")), np.array(read_point(target, "--target"))
    return Camera.looking_at(place, at, width=width, height=height, focal_length=float(focal))


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(word) for word in text.lower().split("x"))
        if not (0 < width <= 65536 and 0 < height <= 65536):
            raise ValueError
    except ValueError:
        raise ValueError(f'--size: "{text}" is no size; write WIDTHxHEIGHT, like 960x1440') from None
    return width, height

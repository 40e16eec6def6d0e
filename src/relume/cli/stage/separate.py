"""`relume stage separate`: a stage in, what its subject's surface is like out."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, made_folder, require_files
from relume.cli.console import OutputOptions, print_facts, progress, warnings_as_notes
from relume.cli.stage.options import Camera, Stage, work_of
from relume.cli.stage.output import require_output_folder

if TYPE_CHECKING:
    import numpy as np

    from relume.lightstage.field.field import ReflectanceField
    from relume.lightstage.surface.surface_maps import SurfaceMaps

SOOT = 0.01
"""An albedo below that of soot and black velvet."""


def separate(
    stage: Stage,
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The folder for maps.exr (normal, albedo, specular energy and reflectance, roughness), a .png of each "
            "and, with --mesh, subject.glb.",
        ),
    ],
    crossed: Annotated[
        Path | None,
        Parameter(help="The same stage through a crossed polariser; STAGE is then the parallel one."),
    ] = None,
    mesh: Annotated[
        Path | None,
        Parameter(help="A mesh of the subject in the stage's frame: it is written with the maps as its material."),
    ] = None,
    camera: Camera = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Tell what light does below the surface from what it does on it (Debevec et al. 2000, §4.2), and map both.

    By the colour of the light, or from a pair of polarised stages, which grey and black subjects need.
    """
    import numpy as np

    from relume.image import files
    from relume.image.photograph import Photograph
    from relume.lightstage.acquire.read_stage import read_stage
    from relume.lightstage.field.polarised import PolarisedPair
    from relume.lightstage.surface.separation import separate as separated
    from relume.lightstage.surface.surface_maps import surface_maps

    with warnings_as_notes(output):
        require_output_folder(out)
        require_files([mesh] if mesh else [])
        field = read_stage(stage, camera)
        other = None if crossed is None else read_stage(crossed, camera)
        if dry_run:
            print_facts(output, {"would write": str(out), **work_of(field, 1 << 30)})
            return
        with progress(output) as report:
            report("separating", 0.0)
            parts = separated(field) if other is None else PolarisedPair(field, other)
            report("separating", 1.0)
            maps = surface_maps(parts)
            report("maps", 1.0)
        known = maps.weight > 0
        if not known.any():
            raise ValueError(
                f"{stage}: nothing could be told of any of its {known.size} pixels; look at its pictures and at the "
                "directions of its lights: no pixel answers to them as a surface does"
            )
        _tell_doubtful_level(maps, known)
        made_folder(out)
        names = ("normal", "albedo", "specular_energy", "specular_reflectance", "roughness", "weight")
        files.write_layers(out / "maps.exr", {name: getattr(maps, name) for name in names})
        for name, picture in maps.pictures().items():
            codes = np.rint(255 * np.clip(_shown(name, picture), 0, 1)).astype(np.uint8)
            files.write(out / f"{name}.png", Photograph(codes))
        written = ["maps.exr", *(f"{name}.png" for name in names)]
        if mesh is not None:
            _write_mesh(out / "subject.glb", mesh, maps, field)
            written.append("subject.glb")
        print_facts(
            output,
            {
                "written": [str(out / name) for name in written],
                "known": float(f"{known.mean():.4g}"),
                "albedo, median": [float(f"{v:.4g}") for v in np.median(maps.albedo[known], axis=0)],
                "roughness, median": float(f"{np.median(maps.roughness[known]):.3g}"),
            },
        )


def _tell_doubtful_level(maps: SurfaceMaps, known: np.ndarray) -> None:
    """Warn of an albedo that no subject has: pictures hold it in the unit that the lights' irradiance is told in."""
    import numpy as np

    usual = float(np.median(maps.albedo[known].mean(axis=-1)))
    if not SOOT < usual < 1:
        warnings.warn(
            f"the median albedo is {usual:.3g}, which no subject has; the irradiance of the stage's lights is told too "
            f"{'small' if usual >= 1 else 'large'}, or not at all, so normals and roughness alone hold",
            stacklevel=2,
        )


def _write_mesh(out: Path, mesh: Path, maps: SurfaceMaps, field: ReflectanceField) -> None:
    """The parts of the mesh that the maps know, with them as their material."""
    from relume.lightstage.surface.material_export import textured
    from relume.scene.gltf.writing import write_glb
    from relume.scene.shapes.meshes import read_meshes

    if field.camera is None:
        raise ValueError("--mesh needs the stage's camera; tell it in stage.json")
    meshes, made, faults = read_meshes(mesh), [], []
    for index, each in enumerate(meshes):
        try:
            made += textured(each, field.camera, maps, meshes[:index] + meshes[index + 1 :])
        except ValueError as error:
            faults.append(str(error))
    if not made:
        raise ValueError(faults[0])
    for fault in faults:
        warnings.warn(f"{fault}; it is left out of {out.name}", stacklevel=2)
    write_glb(out, tuple(made))


def _shown(name: str, picture: np.ndarray) -> np.ndarray:
    """Albedo as the eye expects it; numbers of directions and shares as they are."""
    from relume.image.colour import encode_srgb

    return encode_srgb(picture) if name == "albedo" else picture

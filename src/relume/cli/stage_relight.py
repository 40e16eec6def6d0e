"""`relume stage relight`: a stage and light in, the subject under that light out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from relume.cli.arguments import DryRun, Threads, require_files
from relume.cli.console import Manner, note, progress, speaking, tell
from relume.cli.stage_light import Light
from relume.cli.stage_options import Camera, MaxMemory, Stage, bytes_of, work_of
from relume.cli.stage_output import require_frames, require_picture, write_frames, write_picture

if TYPE_CHECKING:
    from relume.image.radiance import RadianceMap
    from relume.lightstage.dense_directions import DirectedLight
    from relume.lightstage.field import ReflectanceField
    from relume.lightstage.relighting import Progress


def relight(
    stage: Stage,
    /,
    *,
    out: Annotated[
        Path,
        Parameter(
            alias="-o",
            help="The picture: .exr (with its variance where the noise is known), .hdr, .png or .jpg; with --frames a "
            "folder, or an .mp4.",
        ),
    ],
    light: Light = Light(),
    camera: Camera = None,
    mesh: Annotated[
        Path | None,
        Parameter(
            help="A mesh of the subject in the stage's frame: with it shadows and glints move between the stage's "
            "lights instead of fading over. The one that stage.json names, or the only one in objects/, unless given."
        ),
    ] = None,
    no_mesh: Annotated[
        bool, Parameter(negative="", help="Sum the stage's pictures alone; much faster, and linear to rounding.")
    ] = False,
    frames: Annotated[
        int | None,
        Parameter(help="Turn the maps once about the vertical, right-handed, in so many pictures."),
    ] = None,
    exposure: Annotated[
        float, Parameter(allow_leading_hyphen=True, help="Stops to brighten .png, .jpg and .mp4 by.")
    ] = 0.0,
    max_memory: MaxMemory = "2G",
    threads: Threads = None,
    dry_run: DryRun = False,
    manner: Manner = Manner(),
) -> None:
    """Relight a subject: the sum of its pictures, each by what its light has to give (Debevec et al. 2000, eq. 4).

    The light is integrated over all of the sphere. Values are radiance, in the map's unit. A folder of maps as --light
    gives a picture for each.
    """
    from relume.lightstage.reading import read_stage
    from relume.lightstage.relighting import relight as relit
    from relume.lightstage.sequences import relight_sequence

    with speaking(manner):
        light.check(maps_only=frames is not None)
        moving = frames is not None or light.is_sequence
        if moving:
            require_frames(out, light.pictures if frames is None else frames)
        else:
            require_picture(out)
        if mesh is not None and (no_mesh or moving or light.nearest):
            raise ValueError("--mesh is for single pictures, without --no-mesh and --nearest; leave one of them out")
        require_files([mesh] if mesh else [])
        memory = bytes_of(max_memory, "--max-memory")
        field = read_stage(stage, camera)
        geometry = None if no_mesh or moving or light.nearest else _geometry(stage, mesh, field, manner)
        if dry_run:
            tell(manner, {"would write": str(out), **work_of(field, memory), "mesh": geometry and str(geometry.path)})
            return
        with progress(manner) as report:
            settings = {"threads": threads, "memory": memory, "progress": lambda share: report("relighting", share)}
            if moving:
                amounts, unit = light.turning(field.lights, frames, lambda share: report("light", share))
                pictures = relight_sequence(field, amounts, **settings)
                count = write_frames(out, (replace(each, unit=unit) for each in pictures), exposure)
            else:
                given, unit = light.irradiances(field.lights)
                if geometry is None:
                    picture = relit(field, given, **settings)
                else:
                    picture = geometry.relit(field, light.directed()[0], **settings)
                write_picture(out, replace(picture, unit=unit), exposure)
                count = 1
        facts = {"written": str(out), "pictures": count, "lights": len(field.lights)}
        if geometry is not None:
            facts["mesh"] = str(geometry.path)
        tell(manner, {**facts, "size": list(field.shape[::-1]), "unit": unit})


@dataclass(frozen=True)
class _Geometry:
    """A mesh of the subject, and half the apparent diameter of the stage's lights, radians."""

    path: Path
    light_radius: float | None

    def relit(
        self, field: ReflectanceField, light: DirectedLight, *, threads: int | None, memory: int, progress: Progress
    ) -> RadianceMap:
        """The subject with shadows of its mesh; where the noise is known its variance is that of the plain sum."""
        from relume.image.radiance import RadianceMap
        from relume.lightstage.densified import Densification, densely_relit
        from relume.lightstage.relighting import relight as summed
        from relume.scene.meshes import read_meshes

        settings = Densification() if self.light_radius is None else Densification(light_radius=self.light_radius)
        radiance = densely_relit(field, light, read_meshes(self.path), settings, progress=progress)
        variance = None
        if field.noise is not None:
            given = settings.remainder.gathered(field.lights, light.directions, light.irradiances)
            variance = summed(field, given, threads=threads, memory=memory).variance
        return RadianceMap(radiance, variance)


def _geometry(stage: Path, mesh: Path | None, field: ReflectanceField, manner: Manner) -> _Geometry | None:
    """The mesh that is given, or that the stage has; none where the stage tells no camera."""
    from relume.lightstage.reading import geometry_of

    found, radius = geometry_of(stage)
    chosen = mesh or found
    if chosen is None:
        return None
    if field.camera is None:
        if mesh is not None:
            raise ValueError(f"--mesh: {stage} tells no camera, so that nothing says where the mesh is seen; add it")
        note(manner, f"{chosen} is not used: the stage tells no camera")
        return None
    if mesh is None:
        note(manner, f"shadows between the stage's lights are {chosen.name}'s; --no-mesh sums the pictures alone")
    return _Geometry(chosen, radius)

"""`relume stage relight`: a stage and light in, the subject under that light out."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from relume.cli.arguments import DryRun, Threads, require_files
from relume.cli.console import OutputOptions, note, print_facts, progress, warnings_as_notes
from relume.cli.stage.light import Light
from relume.cli.stage.options import Camera, MaxMemory, Stage, bytes_of, work_of
from relume.cli.stage.output import require_frames, require_picture, write_frames, write_picture

if TYPE_CHECKING:
    import numpy as np

    from relume.image.radiance import RadianceMap
    from relume.lightstage.direct_light.light_directions import DirectedLight
    from relume.lightstage.direct_light.model import DirectLightSettings
    from relume.lightstage.field.field import ReflectanceField
    from relume.lightstage.field.lights import StageLights
    from relume.lightstage.relighting.relighting import Progress
    from relume.scene.shapes.shapes import Mesh

_FAR = 0.05
"""Share of the light from where the stage has no lights that is worth a word."""


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
    no_mesh: Annotated[bool, Parameter(negative="", help="Sum the stage's pictures alone; much faster.")] = False,
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
    output: OutputOptions = OutputOptions(),
) -> None:
    """Relight a subject: the sum of its pictures, each by what its light has to give (Debevec et al. 2000, eq. 4).

    The light is integrated over all of the sphere. Values are radiance, in the map's unit. A folder of maps as --light
    gives a picture for each.
    """
    from relume.lightstage.acquire.read_stage import read_stage, stage_geometry

    with warnings_as_notes(output):
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
        geometry = None if no_mesh or moving or light.nearest else _geometry(stage, mesh, field, output)
        if moving and not no_mesh and not light.nearest and stage_geometry(stage)[0] is not None:
            note(output, "sequences sum the stage's pictures alone; single pictures take the mesh's shadows too")
        if dry_run:
            more = 0.0 if geometry is None else geometry.seconds(field, light.directed()[0], threads, memory)
            work = work_of(field, memory, more)
            print_facts(output, {"would write": str(out), **work, "mesh": geometry and str(geometry.path)})
            return
        if geometry is not None and not geometry.fits(field, mesh is not None, threads, memory, output):
            geometry = None
        _tell_far(light, field.lights, frames, output)
        with progress(output) as report:
            settings = {"threads": threads, "memory": memory, "progress": lambda share: report("relighting", share)}
            if moving:
                pictures, unit = _sequence(field, light, frames, settings, lambda share: report("light", share))
                count = write_frames(out, (replace(each, unit=unit) for each in pictures), exposure)
            else:
                if geometry is None:
                    picture, unit = _single(field, light, settings)
                else:
                    directed, unit = light.directed()
                    picture = geometry.relit(field, directed, **settings)
                write_picture(out, replace(picture, unit=unit), exposure)
                count = 1
        facts = {"written": str(out), "pictures": count, "lights": len(field.lights)}
        if geometry is not None:
            facts["mesh"] = str(geometry.path)
        print_facts(output, {**facts, "size": list(field.shape[::-1]), "unit": unit})


def _single(field: ReflectanceField, light: Light, settings: dict[str, Any]) -> tuple[RadianceMap, str]:
    """The subject under the light without a mesh, and its unit."""
    from relume.lightstage.relighting.interpolation import Barycentric
    from relume.lightstage.relighting.relighting import weighted_sum as summed
    from relume.lightstage.relighting.specular_spikes import relight_spiky

    given, unit = light.irradiances(field.lights)
    if light.nearest:
        return summed(field, given, **settings), unit
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it was said where the light was read first
        glints, _ = light.irradiances(field.lights, Barycentric())
    return relight_spiky(field, given, glints, **settings), unit


def _sequence(
    field: ReflectanceField, light: Light, frames: int | None, settings: dict[str, Any], report: Progress
) -> tuple[Iterator[RadianceMap], str]:
    """The pictures of a sequence, and their unit."""
    from relume.lightstage.relighting.interpolation import Barycentric
    from relume.lightstage.relighting.sequences import weighted_sums
    from relume.lightstage.relighting.specular_spikes import relight_spiky_sequence

    if light.nearest:
        amounts, unit = light.turning(field.lights, frames, report)
        return weighted_sums(field, amounts, **settings), unit
    smooth, unit = light.turning(field.lights, frames, lambda share: report(share / 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it was said where the light was read first
        glints, _ = light.turning(field.lights, frames, lambda share: report((1 + share) / 2), Barycentric())
    return relight_spiky_sequence(field, smooth, glints, **settings), unit


def _tell_far(light: Light, lights: StageLights, frames: int | None, output: OutputOptions) -> None:
    """Say how much of the light comes from where the stage has no lights."""
    from relume.lightstage.relighting.interpolation import reached, unreached_share
    from relume.lightstage.relighting.voronoi_cells import even_directions

    if reached(lights, even_directions(4096)).min() == 1:
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what reading the light has to say is said where it is used
        share = max(
            unreached_share(lights, each.directions, each.irradiances) for each in _directed_lights(light, frames)
        )
    if share >= _FAR:
        most = "up to " if frames or light.is_sequence else ""
        note(
            output,
            f"{most}{share:.0%} of the light comes from where the stage has no lights; the nearest lights give it "
            "instead, and shading and shadows are wrong for it",
        )


def _directed_lights(light: Light, frames: int | None) -> Iterator[DirectedLight]:
    """The light of every picture as directions."""
    import numpy as np

    from relume.sphere.directions import rotation_about

    if light.is_sequence:
        for path in sorted((light.light or [])[0].iterdir()):
            if path.suffix.lower() in (".exr", ".hdr"):
                yield replace(light, light=[path]).directed()[0]
        return
    directed, _ = light.directed()
    for index in range(frames or 1):
        yield directed.turned(rotation_about((0.0, 1.0, 0.0), 2 * np.pi * index / (frames or 1)))


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
        from relume.lightstage.direct_light.control_variate import relight_with_mesh
        from relume.lightstage.relighting.relighting import weighted_sum as summed
        from relume.lightstage.relighting.specular_spikes import share_below, warn_below

        settings = self.settings()
        radiance = relight_with_mesh(
            field, light, self.meshes(), settings, progress=progress, threads=threads, memory=memory
        )
        warn_below(share_below(radiance))
        variance = None
        if field.noise is not None:
            given = settings.remainder.gathered(field.lights, light.directions, light.irradiances)
            variance = summed(field, given, threads=threads, memory=memory).variance
        return RadianceMap(radiance, variance)

    def seconds(self, field: ReflectanceField, light: DirectedLight, threads: int | None, memory: int) -> float:
        """About how long `relit` takes; refuses too little memory."""
        from relume.lightstage.direct_light.control_variate import estimate_seconds, row_blocks

        row_blocks(field, memory)
        return estimate_seconds(field, light, self.meshes(), self.settings(), threads=threads)

    def fits(
        self, field: ReflectanceField, asked: bool, threads: int | None, memory: int, output: OutputOptions
    ) -> bool:
        """Whether the mesh is where the pictures show the subject: one that was asked for must be."""
        from relume.lightstage.novel_view.projection import Subject, check_mesh_matches

        if field.camera is None:
            return False
        try:
            sight = Subject.of(self.meshes()).seen(field.camera)
            check_mesh_matches(_brightness(field, threads, memory), sight, "the stage's camera")
        except ValueError as error:
            if asked:
                raise ValueError(f"--mesh: {self.path}: {error}") from None
            note(output, f"{self.path} is not used: {error}")
            return False
        if not asked:
            note(
                output, f"shadows between the stage's lights are {self.path.name}'s; --no-mesh sums the pictures alone"
            )
        return True

    def meshes(self) -> Sequence[Mesh]:
        from relume.scene.shapes.meshes import read_meshes

        return read_meshes(self.path)

    def settings(self) -> DirectLightSettings:
        from relume.lightstage.direct_light.model import DirectLightSettings

        return (
            DirectLightSettings() if self.light_radius is None else DirectLightSettings(light_radius=self.light_radius)
        )


def _brightness(field: ReflectanceField, threads: int | None, memory: int) -> np.ndarray:
    """The mean (H, W) of a field's pictures over the sphere."""
    import numpy as np

    from relume.lightstage.relighting.relighting import weighted_sum as summed

    even = np.repeat(field.lights.solid_angles[:, None] / (4 * np.pi), 3, axis=1)
    return summed(field, even, threads=threads, memory=memory).radiance.mean(axis=-1)


def _geometry(stage: Path, mesh: Path | None, field: ReflectanceField, output: OutputOptions) -> _Geometry | None:
    """The mesh that is given, or that the stage has; none where the stage tells no camera."""
    from relume.lightstage.acquire.read_stage import stage_geometry

    found, radius = stage_geometry(stage)
    chosen = mesh or found
    if chosen is None:
        return None
    if field.camera is None:
        if mesh is not None:
            raise ValueError(f"--mesh: {stage} tells no camera, so that nothing says where the mesh is seen; add it")
        note(output, f"{chosen} is not used: the stage tells no camera")
        return None
    return _Geometry(chosen, radius)

"""`relume stage relight`: a stage and light in, the subject under that light out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import ClusterWord, DryRun, MapsOptions, Threads, require_files
from relume.cli.console import OutputOptions, note, print_facts, spread, warnings_as_notes
from relume.cli.stage.light import Light
from relume.cli.stage.options import (
    MEMORY,
    Camera,
    Exposure,
    MaxMemory,
    Stage,
    existing_parent,
    require_frames,
    require_picture,
    work_facts,
)

Labels = Annotated[
    Path | None,
    Parameter(
        help="A light for each pixel: a picture of as many grey levels as there are --light, the darkest for the first."
    ),
]


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
            help="A mesh of the subject in the stage's frame: with it shadows and highlights move between the stage's "
            "lights instead of fading over. The one that stage.json names, or the only one in objects/, unless given."
        ),
    ] = None,
    no_mesh: Annotated[bool, Parameter(negative="", help="Sum the stage's pictures alone; much faster.")] = False,
    frames: Annotated[
        int | None, Parameter(help="Turn the maps once about the vertical, right-handed, in so many pictures.")
    ] = None,
    maps: MapsOptions = MapsOptions(),
    compressed: Annotated[
        Literal["cosine", "low-rank"] | None,
        Parameter(
            help="Compress the stage first, for sequences: by a cosine transform over the lights, or to a low-rank "
            "basis. The error is measured and printed."
        ),
    ] = None,
    labels: Labels = None,
    exposure: Exposure = 0.0,
    max_memory: MaxMemory = MEMORY,
    threads: Threads = None,
    cluster: ClusterWord = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Relight a subject: the sum of its pictures, each by what its light has to give (Debevec et al. 2000, eq. 4).

    The light is integrated over all of the sphere. Values are radiance, in the map's unit. A folder of maps as --light
    gives a picture for each, or a film of them with --rate.
    """
    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        if labels is not None and (light.direction or light.lamp):
            raise ValueError("--labels chooses between the --light of each pixel; leave --direction and --lamp out")
        light.check(maps_only=frames is not None or labels is not None)
        moving = frames is not None or light.is_sequence
        if not light.is_sequence:
            maps.refuse()
        _check(mesh, no_mesh, moving, light, compressed, labels, cluster is not None)
        if moving:
            require_frames(out, 2 if frames is None else frames)
        else:
            require_picture(out)
        # The stage, and the mesh where one is used.
        field = rl.lightstage.read_stage(stage, camera)
        found = None if no_mesh else rl.lightstage.subject_mesh(stage, mesh)
        if found is not None and moving and not light.nearest:
            note(output, "sequences sum the stage's pictures alone; single pictures take the mesh's shadows too")
        if moving or light.nearest or labels:
            found = None
        own = {"threads": threads, "memory": max_memory, "scratch": existing_parent(out)}
        settings = rl.lightstage.RelightSettings(nearest=light.nearest, compression=compressed, **own)
        if dry_run:
            usable = found is not None and field.camera is not None
            more = rl.lightstage.mesh_seconds(field, light.lighting(), found, settings) if usable and found else 0.0
            work = work_facts(rl.lightstage.estimate_work(field, max_memory, more))
            print_facts(output, {"would write": str(out), **work, "mesh": found and found.name})
            return
        # The pictures.
        with spread(cluster, output) as (workers, report):
            share = lambda part: report("relighting", part)  # noqa: E731
            if moving:
                lights = light.sequence(frames, maps)
                count = rl.lightstage.relight_frames(
                    field, lights, out, settings, stops=exposure, cluster=workers, progress=share
                )
                unit = lights[0].unit
            else:
                if labels is not None:
                    each = [light.lighting([path]) for path in light.light or []]
                    picture = rl.lightstage.relight_per_pixel(
                        field, labels, each, settings, cluster=workers, progress=share
                    )
                else:
                    found = _usable(field, found, settings, workers, output)
                    picture = rl.lightstage.relight(
                        field, light.lighting(), found, settings, cluster=workers, progress=share
                    )
                rl.lightstage.write_picture(out, picture, exposure)
                unit, count = picture.unit, 1
        facts: dict[str, object] = {"written": str(out), "pictures": count, "lights": len(field.lights)}
        if found is not None:
            facts["mesh"] = found.name
        print_facts(output, {**facts, "size": list(field.shape[::-1]), "unit": unit})


def _usable(
    field: rl.lightstage.ReflectanceField,
    mesh: rl.lightstage.SubjectMesh | None,
    settings: rl.lightstage.RelightSettings,
    cluster: Any,
    output: OutputOptions,
) -> rl.lightstage.SubjectMesh | None:
    """The mesh where it can be used; one that the stage brought is named."""
    found = rl.lightstage.usable_mesh(field, mesh, settings, cluster=cluster)
    if found is not None and not found.required:
        note(output, f"{found.name} gives the shadows between the lights; --no-mesh leaves it out")
    return found


def _check(
    mesh: Path | None,
    no_mesh: bool,
    moving: bool,
    light: Light,
    compressed: str | None,
    labels: Path | None,
    clustered: bool,
) -> None:
    """Refuse options that do not go together."""
    if mesh is not None and (no_mesh or moving or light.nearest or labels):
        raise ValueError("--mesh is for single pictures, without --no-mesh, --nearest and --labels; leave one out")
    if compressed and not moving:
        raise ValueError("--compressed is for sequences: give --frames, or a folder of maps as --light")
    if compressed and clustered:
        raise ValueError("--compressed is done in this process; leave it or --cluster out")
    if labels is not None and moving:
        raise ValueError("--labels is for single pictures; leave it or --frames out")
    require_files([path for path in (mesh, labels) if path])

"""`relume stage separate`: a stage in, what its subject's surface is like out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import ClusterWord, DryRun, require_files, require_output_folder
from relume.cli.console import OutputOptions, print_facts, spread, warnings_as_notes
from relume.cli.stage.options import MEMORY, Camera, MaxMemory, Stage, existing_parent, place, rounded, work_facts


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
        Path | str | None,
        Parameter(
            converter=place,
            n_tokens=1,
            help="The same stage through a crossed polariser; STAGE is then the parallel one.",
        ),
    ] = None,
    mesh: Annotated[
        Path | None,
        Parameter(help="A mesh of the subject in the stage's frame: it is written with the maps as its material."),
    ] = None,
    camera: Camera = None,
    max_memory: MaxMemory = MEMORY,
    cluster: ClusterWord = None,
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Separate diffuse from specular reflection (Debevec et al. 2000, §4.2), and map both.

    By the colour of the light, or from a pair of polarised stages, which grey and black subjects need. Normals and
    albedo come from photometric stereo on the diffuse part.
    """
    import numpy as np

    with warnings_as_notes(output):
        # Everything that can be refused before the work.
        require_output_folder(out)
        require_files([mesh] if mesh else [])
        field = rl.lightstage.read_stage(stage, camera)
        other = None if crossed is None else rl.lightstage.read_stage(crossed, camera)
        if dry_run:
            print_facts(output, {"would write": str(out), **work_facts(rl.lightstage.estimate_work(field, max_memory))})
            return
        # Diffuse and specular reflection, and the maps of both.
        with spread(cluster, output) as (workers, report):
            maps = rl.lightstage.measure_surface(
                field,
                other,
                cluster=workers,
                memory=max_memory,
                scratch=existing_parent(out),
                progress=lambda share: report("separating", share),
            )
        # The files.
        meshes = rl.read_meshes(mesh) if mesh is not None else ()
        written = rl.lightstage.write_surface(out, maps, meshes, field.camera)
        known = maps.weight > 0
        print_facts(
            output,
            {
                "written": [str(path) for path in written],
                "known": float(f"{known.mean():.4g}"),
                "albedo, median": rounded(np.median(maps.albedo[known], axis=0)),
                "roughness, median": float(f"{np.median(maps.roughness[known]):.3g}"),
            },
        )

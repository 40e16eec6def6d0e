"""`relume render --environment`: the illumination map of a scene seen from a point in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from relume.cli.arguments import read_point
from relume.cli.console import OutputOptions, print_facts, progress

if TYPE_CHECKING:
    import numpy as np

    from relume.project.scene_file.scene_file import SceneFile
    from relume.renderers.renderer import Renderer

ROWS = 512


def write_environment(
    out: Path, read: SceneFile, place: str, size: str | None, renderer: Renderer, *, seed: int, dry_run: bool,
    output: OutputOptions,
) -> None:  # fmt: skip
    """Render the map at the point that `place` tells, and write it; on a dry run only tell what would be done."""
    from relume.cli.render_choice import read_size
    from relume.image import files
    from relume.renderers.environment_probe import environment
    from relume.sphere.directions import UP
    from relume.sphere.environment_files import as_radiance_map

    point = read_point(place, "--environment")
    width, rows = (2 * ROWS, ROWS) if size is None else read_size(size)
    if width != 2 * rows:
        raise ValueError(f"--size: {size} is no lat-long map; with --environment it is twice as wide as high")
    told: dict[str, object] = {"environment at": list(point), "size": f"{width}×{rows}"}
    if dry_run:
        print_facts(output, {"would write": str(out), **told})
        return
    with progress(output) as report:
        light = environment(
            read.scene, point, renderer, size=rows, seed=seed, progress=lambda share: report("rendering", share)
        )
    files.write(out, as_radiance_map(light))
    told |= {"total": _six_digits(light.total()), "irradiance from above": _six_digits(light.irradiance(UP))}
    print_facts(output, {"written": str(out), **told})


def _six_digits(values: np.ndarray) -> list[float]:
    return [float(f"{value:.6g}") for value in values]

"""The render of a shot: what its objects change, kept while it is made and denoised when it is done."""

from __future__ import annotations

import warnings
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import CannotResume
from relume.image.radiance import RadianceMap
from relume.project.insertion.preview import Previews, composed_change
from relume.project.shot_file.shot import RenderTable
from relume.project.stages import Arrays
from relume.renderers.progressive.accumulation import Watch, forget
from relume.renderers.progressive.graceful_shutdown import Force
from relume.renderers.renderer import Moments, Renderer
from relume.renderers.results import Change, Progress
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.shutter import Shutter
from relume.scene.scene import Scene
from relume.virtual_camera.film.film import Film


def rendered(
    scene: Scene, camera: Camera, table: RenderTable, renderer: Renderer, plate: RadianceMap, *,
    folder: Path, film: Film, progress: Progress, moving: Moments | None = None, shutter: Shutter = Shutter(0.0, 0.0),
    force: Force | None = None, restart: bool = False,
) -> Change:  # fmt: skip
    """What the objects change of the plate.

    folder : where the state of an unfinished render is kept, and beside it its preview
    force : how a first Ctrl-C is answered in time; see `render.interruption`
    Raises Interrupted, which leaves the state to a later run.
    """
    folder.mkdir(parents=True, exist_ok=True)
    previews = Previews(folder.parent, lambda sums: composed_change(sums, plate.radiance), film, plate.unit)
    watch = Watch(folder / "render.passes", restart, preview=previews if table.preview else None, force=force)

    def trace(watch: Watch) -> Change:
        return renderer.change(
            scene, camera, seed=table.seed, progress=progress, watch=watch, plate=plate.radiance,
            moments=moving, shutter=shutter,
        )  # fmt: skip

    try:
        change = trace(watch)
    except CannotResume as error:
        what = str(error).partition(";")[0]
        warnings.warn(f"cannot resume the saved render: {what}; starting over", stacklevel=2)
        change = trace(Watch(watch.checkpoint, True, preview=watch.preview, force=force))
    forget(watch)
    previews.remove()
    if table.denoise:
        from relume.renderers.mitsuba.denoise import denoised

        change = denoised(change)
    return change


def change_arrays(change: Change) -> Arrays:
    """For keeping."""
    return {field.name: np.asarray(getattr(change, field.name)) for field in fields(change)}


def change_from(arrays: Arrays) -> Change:
    """The inverse of `change_arrays`."""
    planes: dict[str, Any] = dict(arrays)
    counts: dict[str, Any] = {name: int(arrays[name]) for name in ("samples", "passes")}
    return Change(**planes | counts)

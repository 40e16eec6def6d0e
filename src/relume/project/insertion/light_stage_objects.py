"""Objects that are real: photographed on a light stage, relit by the light of the place and laid over their meshes.

The mesh of such an object is rendered as any other, so that it shades and mirrors into the place; its own pixels are
then those of its reflectance field, under the light that reaches it there, carried to the plate's camera (Debevec et
al. 2000, §4.5, Fig. 15). What no camera of the stage saw keeps the look that it was rendered with.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from relume.errors import InvalidShot
from relume.lightstage.acquire.read_stage import read_stage, stage_geometry
from relume.lightstage.direct_light.light_directions import quadtree_lights
from relume.lightstage.direct_light.model import DirectLightSettings
from relume.lightstage.novel_view.new_views import direct_light_view
from relume.lightstage.novel_view.projection import Subject
from relume.lightstage.novel_view.source_views import NewView, SourceView
from relume.project.mesh_tables import turn_of
from relume.project.shot_file.objects import placed_meshes
from relume.project.shot_file.shot import Object, Shot
from relume.renderers.environment_probe import environment
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.results import Change
from relume.scene.cameras.camera import Camera
from relume.scene.scene import Scene
from relume.scene.shapes.meshes import read_meshes
from relume.scene.shapes.shapes import bounds

LIGHT = Mitsuba(samples=64, depth=6)
"""Renders what reaches the subject; its noise is averaged over the cells of the stage's lights."""
LIGHT_ROWS = 128
LEAVES = 500
"""Directions that stand for the light: a room's light is rendered, and wide."""
NEARER = 1.01
"""Another object's depth times this is still before the subject's: depths are means over pixels."""


def with_stages(
    shot: Shot, place: Scene, camera: Camera, change: Change, report: Callable[[float], None] = lambda share: None
) -> Change:
    """The change with the pixels of objects from light stages as their reflectance fields show them.

    place : the place relit, without objects
    Raises InvalidShot where a stage cannot be used with its mesh and the plate's camera.
    """
    real = [index for index, table in enumerate(shot.objects) if table.stage is not None]
    for done, index in enumerate(real):
        table = shot.objects[index]
        others = shot.model_copy(update={"objects": [o for i, o in enumerate(shot.objects) if i != index]})
        around = place.adding(*placed_meshes(others))
        try:
            seen, distance = _look(shot, table, around, camera)
        except ValueError as error:
            raise InvalidShot(f"objects.{index}.stage: {error}") from None
        change = laid_over(change, seen, distance)
        report((done + 1) / len(real))
    return change


def laid_over(change: Change, seen: NewView, distance: np.ndarray) -> Change:
    """The change with a subject's own picture in place of its rendered one, where it is the nearest object.

    distance : (H, W) metres from the camera to the subject; ∞ beside it
    """
    nearest = (distance <= change.depth * NEARER) & (change.depth > 0)
    share = np.where(nearest, np.minimum(seen.alpha, change.matte), 0.0)[..., None]
    left = 1 - share / np.maximum(change.matte, 1e-6)[..., None]
    objects = change.objects * left + share * seen.picture.radiance
    variance = change.objects_variance * left**2
    if seen.picture.variance is not None:
        variance = variance + share**2 * seen.picture.variance
    return replace(change, objects=objects.astype(np.float32), objects_variance=variance.astype(np.float32))


def _look(shot: Shot, table: Object, around: Scene, camera: Camera) -> tuple[NewView, np.ndarray]:
    """What the plate's camera sees of the subject, and how far it is."""
    assert table.stage is not None
    turn, path = turn_of(table), shot.path(table.stage)
    meshes = read_meshes(shot.path(table.mesh))
    if camera.rolling is not None:
        raise InvalidShot(
            f"camera.readout: things from light stages ({table.stage}) are seen at one moment; leave it out"
        )
    # The camera as the stage would see it: the placement undone.
    moved = replace(
        camera,
        position=(camera.position - np.array(table.translate)) @ turn / table.scale,
        rotation=turn.T @ camera.rotation,
    )
    middle = bounds(meshes).mean(axis=0) * table.scale @ turn.T + np.array(table.translate)
    light = environment(around, middle, LIGHT, size=LIGHT_ROWS, seed=shot.render.seed)
    sources = [
        SourceView(read_stage(path, name), name=table.stage + (f", camera {name}" if name else ""))
        for name in table.stage_cameras or [None]
    ]
    radius = stage_geometry(path)[1]
    settings = DirectLightSettings() if radius is None else DirectLightSettings(light_radius=radius)
    seen = direct_light_view(sources, quadtree_lights(light, LEAVES).turned(turn.T), moved, meshes, settings=settings)
    return seen, Subject.of(meshes).seen(moved).distance * table.scale

"""A subject from a new viewpoint, with direct light computed there: shadows, foreshortening and gloss of its mesh.

What `direct_model` fits to each pixel of a source, scales of diffuse and of glossy direct light, is looked up where the
new view's rays meet the mesh, and times the direct light there; what direct light leaves over comes with the picture,
as diffuse light does in Debevec et al. 2000, §4.3. Where the light is narrow this follows it better than reflectance
functions carried from light to light (`viewpoint`), for it knows what is between the stage's lights.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.lightstage.direct_light.light_directions import DirectedLight
from relume.lightstage.direct_light.model import (
    DirectLightSettings,
    DirectModel,
    direct_model,
    direct_picture,
    left_over,
)
from relume.lightstage.novel_view.blending import Blending
from relume.lightstage.novel_view.projection import Outline, Subject, without_background
from relume.lightstage.novel_view.source_views import NewRays, NewView, SourceView, blend_sources
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh

_ROWS = 32


def direct_light_view(
    sources: SourceView | Sequence[SourceView],
    light: DirectedLight,
    camera: Camera,
    meshes: Mesh | Sequence[Mesh],
    *,
    settings: DirectLightSettings = DirectLightSettings(),
    blending: Blending = Blending(),
) -> NewView:
    """The subject under light from many directions, seen by a new camera.

    light : as `quadtree_lights` makes it from a map
    camera : the new one
    meshes : the subject's geometry, world
    The sources' parts and chromaticity ramps are not used. What no camera saw is a hole, as in `viewpoint.view`.
    Raises ValueError for a mesh that does not match a source's picture, and a new camera that sees nothing of it.
    """
    given = [sources] if isinstance(sources, SourceView) else list(sources)
    if not given:
        raise ValueError("no source is given; a new view needs one camera's reflectance field or more")
    several = [meshes] if isinstance(meshes, Mesh) else list(meshes)
    subject = Subject.of(several)
    rays = NewRays.of(subject, camera)
    models = [direct_model(source.field, several, settings) for source in given]

    def layers(index: int, edges: Outline) -> tuple[np.ndarray, Outline]:
        left, scales = _layers_under(models[index], light)
        left, usable = without_background(left, edges)
        return np.concatenate([left, scales], axis=-1), usable

    def shading(index: int, visible: np.ndarray, found: np.ndarray) -> np.ndarray:
        direct = _direct(models[index], camera, light)[:, rays.pixels()[visible]]
        return found[:, :3] + np.einsum("bkc,kbc->kc", direct, found[:, 3:].reshape(-1, 2, 3))

    return blend_sources(given, subject, rays, layers, shading, blending)


def _layers_under(model: DirectModel, light: DirectedLight) -> tuple[np.ndarray, np.ndarray]:
    """What direct light leaves over under this light, (H, W, 3), and the scales of its two parts, (H, W, 6)."""
    field = model.source
    amounts, spike_irradiances = (
        by.gathered(field.lights, light.directions, light.irradiances)
        for by in (model.settings.remainder, model.settings.spike_interpolation)
    )
    left, scales = np.zeros((*field.shape, 3)), np.zeros((*field.shape, 6))
    for begin in range(0, field.shape[0], _ROWS):
        rows = slice(begin, min(begin + _ROWS, field.shape[0]))
        over, found = left_over(model, rows, amounts, spike_irradiances)
        scales[rows] = found.reshape(-1, field.shape[1], 6)
        left[rows] = over.reshape(-1, field.shape[1], 3)
    return left, scales


def _direct(model: DirectModel, camera: Camera, light: DirectedLight) -> np.ndarray:
    """Direct light (2, H · W, 3) as the pixels of a new camera gather it."""
    seen, parts = replace(model, camera=camera), []
    for begin in range(0, camera.height, _ROWS):
        rows = slice(begin, min(begin + _ROWS, camera.height))
        wide, samples = seen.samples(rows)
        parts.append(direct_picture(seen, samples, wide, rows, light))
    return np.concatenate(parts, axis=1)

"""A subject relit and seen from where no camera stood, by what was measured or with direct light computed there.

`measured_view`: each source camera's reflectance functions are carried to the new view and relit; that picture, still
in the source's perspective, is projected on the mesh and seen from the new camera, and the sources are blended
(Debevec et al. 2000, §4.3–4.5, Fig. 14, 15).

`direct_light_view`: what `direct_model` fits to each pixel of a source, scales of diffuse and of glossy direct light,
is looked up where the new view's rays meet the mesh, and times the direct light there: shadows, foreshortening and
gloss of its mesh. What direct light leaves over comes with the picture, as diffuse light does in §4.3. Where the light
is narrow this follows it better, for it knows what is between the stage's lights.

Nothing is invented: what no camera saw is a hole in `alpha`, counted by `unseen`. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from relume.lightstage.blocks import Cluster, by_bands
from relume.lightstage.direct_light.light_directions import DirectedLight
from relume.lightstage.direct_light.model import (
    DirectLightSettings,
    DirectModel,
    direct_model,
    direct_picture,
    left_over,
)
from relume.lightstage.novel_view.projection import Outline, Sight, Subject, without_background
from relume.lightstage.novel_view.resynthesis import LightTriangles, resynthesised_diffuse, resynthesised_specular
from relume.lightstage.novel_view.source_views import Blending, NewRays, NewView, SourceView, blend_sources
from relume.lightstage.relighting.relighting import cut
from relume.lightstage.surface.photometric_stereo import lit
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh

PIXELS = 8192
"""Pixels worked on at once: with 300 lights a block of one part is 30 MB."""
_ROWS, _FITTED_PIXELS = 32, 2**15
"""Rows of a source that are fitted at once: so many at least, and as many as have so many pixels."""
_LIT_PIXELS = 2**16
_BESIDE = 8
"""Rows beside those of the mesh that are looked at too: its background, and what a pixel gathers."""


def measured_view(
    sources: SourceView | Sequence[SourceView],
    irradiances: np.ndarray | Sequence[np.ndarray],
    camera: Camera,
    meshes: Mesh | Sequence[Mesh],
    *,
    blending: Blending = Blending(),
) -> NewView:
    """The subject under light of these irradiances, seen by a new camera.

    irradiances : (N, 3), of every light's cell; or such an array for each source, where their lights differ
    Raises ValueError for irradiances of another shape, a mesh that does not match a source's picture, and a new camera
    that sees nothing of it.
    Source: Debevec et al. 2000, §4.5.
    """
    given = _given(sources)
    lights = _of_each(irradiances, given)
    subject = Subject.of(meshes)
    rays = NewRays.of(subject, camera)

    def layers(index: int, edges: Outline) -> tuple[np.ndarray, Outline]:
        wanted = _wanted(subject, edges.sight, camera)
        picture = _shaded(given[index], lights[index], edges.sight, wanted, camera)
        return without_background(picture, edges)

    return blend_sources(given, subject, rays, layers, lambda index, visible, found: found, blending)


def _given(sources: SourceView | Sequence[SourceView]) -> list[SourceView]:
    given = [sources] if isinstance(sources, SourceView) else list(sources)
    if not given:
        raise ValueError("no source is given; a new view needs one camera's reflectance field or more")
    return given


def _of_each(irradiances: np.ndarray | Sequence[np.ndarray], sources: list[SourceView]) -> list[np.ndarray]:
    """Irradiances (N, 3) for each source, checked."""
    several = [irradiances] * len(sources) if isinstance(irradiances, np.ndarray) else list(irradiances)
    if len(several) != len(sources):
        raise ValueError(f"irradiances for {len(several)} sources, but there are {len(sources)}")
    for source, each in zip(sources, several, strict=True):
        if np.shape(each) != (len(source.field.lights), 3) or not np.all(np.isfinite(each)):
            raise ValueError(
                f"{source.name}: irradiances are {np.shape(each)}; expected {len(source.field.lights)} × 3 finite "
                "numbers, one colour for each light"
            )
    return [np.asarray(each, np.float64) for each in several]


def _wanted(subject: Subject, sight: Sight, camera: Camera) -> np.ndarray:
    """(H, W) bool: the source's pixels that the new camera sees, and those beside them that are looked up too."""
    from scipy.ndimage import binary_dilation

    shared = sight.met.copy()
    shared[shared] = subject.visible(sight.points[shared], sight.facets[shared], camera)
    return np.asarray(binary_dilation(shared, np.ones((3, 3)), iterations=2), bool) & sight.met


def _shaded(source: SourceView, irradiance: np.ndarray, sight: Sight, wanted: np.ndarray, camera: Camera) -> np.ndarray:
    """The source's picture (H, W, 3) under the light, shaded at the wanted pixels as the new camera would see them."""
    field, parts = source.field, source.parts
    every, triangles = slice(0, len(field.lights)), LightTriangles.of(field.lights) if parts is not None else None
    result = np.zeros((*field.shape, 3))
    normal = sight.normals if source.normal is None else source.normal
    way = camera.position - sight.points
    new_view = way / np.linalg.norm(way, axis=-1, keepdims=True)
    for rows in cut(field.shape[0], max(1, PIXELS // field.shape[1])):
        if not _near(sight.met, rows):
            continue
        result[rows] = np.einsum("nrwc,nc->rwc", field.block(every, rows), irradiance, optimize=True)
        if parts is None:
            continue
        met = wanted[rows]
        diffuse, specular = parts.diffuse.block(every, rows)[:, met], parts.specular.block(every, rows)[:, met]
        angles = (normal[rows][met], sight.views[rows][met], new_view[rows][met])
        reached = lit(diffuse + specular)
        diffuse, specular = without_debt(diffuse, specular)
        specular = resynthesised_specular(specular, field.lights, *angles, reached, triangles)
        if source.alpha is not None:
            diffuse = resynthesised_diffuse(diffuse, field.lights, *angles, source.alpha[rows][met])
        shown = np.einsum("npc,nc->pc", diffuse, irradiance) + np.einsum("npc,nc->pc", specular, irradiance)
        result[rows][met] = shown
    return result


def without_debt(diffuse: np.ndarray, specular: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both parts (N, P, 3), where the specular one took so much that a channel of the other is below 0, repaid.

    At grazing angles little is left of a pixel besides its highlight, and a chromaticity that is off by a little leaves
    coloured specks when that highlight moves away. The parts sum to the same values.
    """
    debt = np.clip(-diffuse.min(axis=-1), 0, np.maximum(specular.min(axis=-1), 0))[..., None]
    return diffuse + debt, specular - debt


def direct_light_view(
    sources: SourceView | Sequence[SourceView],
    light: DirectedLight,
    camera: Camera,
    meshes: Mesh | Sequence[Mesh],
    *,
    settings: DirectLightSettings = DirectLightSettings(),
    blending: Blending = Blending(),
    cluster: Cluster = None,
    place: Path | str | None = None,
) -> NewView:
    """The subject under light from many directions, seen by a new camera.

    light : as `quadtree_lights` makes it from a map
    cluster, place : whose workers do bands of rows, and where these lie (`blocks.by_bands`)
    The sources' parts and chromaticity ramps are not used.
    Raises ValueError for a mesh that does not match a source's picture, and a new camera that sees nothing of it.
    """
    given = _given(sources)
    several = [meshes] if isinstance(meshes, Mesh) else list(meshes)
    subject = Subject.of(several)
    rays = NewRays.of(subject, camera)
    models = [direct_model(source.field, several, settings) for source in given]

    def layers(index: int, edges: Outline) -> tuple[np.ndarray, Outline]:
        left, scales = _layers_under(models[index], light, edges.sight.met, cluster, place)
        left, usable = without_background(left, edges)
        return np.concatenate([left, scales], axis=-1), usable

    def shading(index: int, visible: np.ndarray, found: np.ndarray) -> np.ndarray:
        direct = _direct(models[index], camera, light, cluster, place)[:, rays.pixels()[visible]]
        return found[:, :3] + np.einsum("bkc,kbc->kc", direct, found[:, 3:].reshape(-1, 2, 3))

    return blend_sources(given, subject, rays, layers, shading, blending)


def _layers_under(
    model: DirectModel, light: DirectedLight, met: np.ndarray, cluster: Cluster, place: Path | str | None
) -> tuple[np.ndarray, np.ndarray]:
    """What direct light leaves over under this light, (H, W, 3), and the scales of its two parts, (H, W, 6).

    met : (H, W) bool, where the source sees the mesh; far from it nothing is read, and both are 0
    """
    field = model.source
    amounts, spike_irradiances = (
        by.gathered(field.lights, light.directions, light.irradiances)
        for by in (model.settings.remainder, model.settings.spike_interpolation)
    )
    left, scales = np.zeros((*field.shape, 3)), np.zeros((*field.shape, 6))
    # Every band asks the mesh anew under each light.
    step = max(_ROWS, _FITTED_PIXELS // field.shape[1])
    bands = [rows for rows in cut(field.shape[0], step) if _near(met, rows)]
    shared = model, amounts, spike_irradiances
    made = by_bands(_layers_of_rows, shared, bands, cluster=cluster, place=place)
    for number, rows in enumerate(bands):
        left[rows], scales[rows] = made.of("left", number), made.of("scales", number)
    return left, scales


def _layers_of_rows(shared: tuple[DirectModel, np.ndarray, np.ndarray], rows: slice) -> dict[str, np.ndarray]:
    model, amounts, spike_irradiances = shared
    wide, samples = model.samples(rows)
    over, found = left_over(model, samples, wide, rows, amounts, spike_irradiances)
    columns = model.source.shape[1]
    return {"left": over.reshape(-1, columns, 3), "scales": found.reshape(-1, columns, 6)}


def _near(met: np.ndarray, rows: slice) -> bool:
    """Whether the mesh is seen (H, W) in these rows or close to them."""
    return bool(met[max(0, rows.start - _BESIDE) : rows.stop + _BESIDE].any())


def _direct(
    model: DirectModel, camera: Camera, light: DirectedLight, cluster: Cluster, place: Path | str | None
) -> np.ndarray:
    """Direct light (2, H · W, 3) as the pixels of a new camera gather it."""
    # Light after light goes over a band: few large ones, since each asks the mesh anew.
    bands = cut(camera.height, max(1, _LIT_PIXELS // camera.width))
    shared = replace(model, camera=camera), light
    made = by_bands(_direct_rows, shared, bands, cluster=cluster, place=place)
    return np.concatenate(made.each("direct"), axis=1)


def _direct_rows(shared: tuple[DirectModel, DirectedLight], rows: slice) -> dict[str, np.ndarray]:
    model, light = shared
    wide, samples = model.samples(rows)
    return {"direct": direct_picture(model, samples, wide, rows, light)}

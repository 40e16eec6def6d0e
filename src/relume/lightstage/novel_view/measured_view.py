"""A relit subject seen from where no camera stood (Debevec et al. 2000, §4.3–4.5, Fig. 14, 15).

Each source camera's reflectance functions are carried to the new view and relit; that picture, still in the source's
perspective, is projected on the mesh and seen from the new camera, and the sources are blended. World frame, metres.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from relume.lightstage.novel_view.blending import Blending
from relume.lightstage.novel_view.projection import Outline, Sight, Subject, without_background
from relume.lightstage.novel_view.resynthesis import LightTriangles, Resynthesis
from relume.lightstage.novel_view.source_views import NewRays, NewView, SourceView, blend_sources
from relume.lightstage.surface.shadow_map import lit
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh

PIXELS = 8192
"""Pixels worked on at once: with 300 lights a block of one part is 30 MB."""


def measured_view(
    sources: SourceView | Sequence[SourceView],
    irradiances: np.ndarray | Sequence[np.ndarray],
    camera: Camera,
    meshes: Mesh | Sequence[Mesh],
    *,
    resynthesis: Resynthesis = Resynthesis(),
    blending: Blending = Blending(),
) -> NewView:
    """The subject under light of these irradiances, seen by a new camera.

    irradiances : (N, 3), of every light's cell; or such an array for each source, where their lights differ
    camera : the new one
    meshes : the subject's geometry, world
    Nothing is invented: what no camera saw is a hole in `alpha`, counted by `unseen` and, from a quarter of the subject
    on, by a warning.
    Raises ValueError for irradiances of another shape, a mesh that does not match a source's picture, and a new camera
    that sees nothing of it.
    Source: Debevec et al. 2000, §4.5.
    """
    given = [sources] if isinstance(sources, SourceView) else list(sources)
    lights = _of_each(irradiances, given)
    subject = Subject.of(meshes)
    rays = NewRays.of(subject, camera)

    def layers(index: int, edges: Outline) -> tuple[np.ndarray, Outline]:
        wanted = _wanted(subject, edges.sight, camera)
        picture = _shaded(given[index], lights[index], edges.sight, wanted, camera, resynthesis)
        return without_background(picture, edges)

    return blend_sources(given, subject, rays, layers, lambda index, visible, found: found, blending)


def _of_each(irradiances: np.ndarray | Sequence[np.ndarray], sources: list[SourceView]) -> list[np.ndarray]:
    """Irradiances (N, 3) for each source, checked."""
    if not sources:
        raise ValueError("no source is given; a new view needs one camera's reflectance field or more")
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


def _shaded(
    source: SourceView,
    irradiance: np.ndarray,
    sight: Sight,
    wanted: np.ndarray,
    camera: Camera,
    resynthesis: Resynthesis,
) -> np.ndarray:
    """The source's picture (H, W, 3) under the light, shaded at the wanted pixels as the new camera would see them."""
    field, parts = source.field, source.parts
    every, triangles = slice(0, len(field.lights)), LightTriangles.of(field.lights) if parts is not None else None
    step = max(1, PIXELS // field.shape[1])
    result = np.zeros((*field.shape, 3))
    normal = sight.normals if source.normal is None else source.normal
    way = camera.position - sight.points
    new_view = way / np.linalg.norm(way, axis=-1, keepdims=True)
    for start in range(0, field.shape[0], step):
        rows = slice(start, min(start + step, field.shape[0]))
        if parts is None:
            result[rows] = np.einsum("nrwc,nc->rwc", field.block(every, rows), irradiance, optimize=True)
            continue
        met = wanted[rows]
        diffuse, specular = parts.diffuse.block(every, rows)[:, met], parts.specular.block(every, rows)[:, met]
        angles = (normal[rows][met], sight.views[rows][met], new_view[rows][met])
        reached = lit(diffuse + specular)
        diffuse, specular = without_debt(diffuse, specular)
        specular = resynthesis.specular(specular, field.lights, *angles, reached, triangles)
        if source.alpha is not None:
            diffuse = resynthesis.diffuse(diffuse, field.lights, *angles, source.alpha[rows][met])
        block = np.einsum("nrwc,nc->rwc", field.block(every, rows), irradiance, optimize=True)
        block[met] = np.einsum("npc,nc->pc", diffuse, irradiance) + np.einsum("npc,nc->pc", specular, irradiance)
        result[rows] = block
    return result


def without_debt(diffuse: np.ndarray, specular: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both parts (N, P, 3), where the specular one took so much that a channel of the other is below 0, repaid.

    At grazing angles little is left of a pixel besides its highlight, and a chromaticity that is off by a little leaves
    coloured specks when that highlight moves away. The parts sum to the same values.
    """
    debt = np.clip(-diffuse.min(axis=-1), 0, np.maximum(specular.min(axis=-1), 0))[..., None]
    return diffuse + debt, specular - debt

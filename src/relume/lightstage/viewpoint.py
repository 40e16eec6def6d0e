"""A relit subject seen from where no camera stood (Debevec et al. 2000, §4.3–4.5, Fig. 14, 15).

Each source camera's reflectance functions are carried to the new view and relit; that picture, still in the source's
perspective, is projected on the mesh and seen from the new camera, and the sources are blended. World frame, metres.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from relume.image.radiance import OUTSIDE, RadianceMap
from relume.lightstage.field import ReflectanceField
from relume.lightstage.resynthesis import LightTriangles, Resynthesis
from relume.lightstage.shadow_map import lit
from relume.lightstage.view_blending import Blending, blended, border_distance
from relume.lightstage.view_projection import (
    Sight,
    Subject,
    check_mesh_matches,
    outline,
    sampled,
    without_background,
)
from relume.scene.camera import Camera
from relume.scene.shapes import Mesh

SIDE = 2
"""Rays along each side of a pixel of the new view: outlines in steps of a quarter."""
PIXELS = 8192
"""Pixels worked on at once: with 300 lights a block of one part is 30 MB."""


class Separated(Protocol):
    """A reflectance field told apart: `separation.Separation` and `polarised.PolarisedPair` are."""

    @property
    def diffuse(self) -> ReflectanceField: ...

    @property
    def specular(self) -> ReflectanceField: ...


@dataclass(frozen=True, eq=False)
class Source:
    """What one camera took of the subject.

    field : its reflectance field, with the camera
    parts : the same, told apart; None for a subject without highlights, whose picture is projected as it is
    normal : (H, W, 3) unit, world, for the highlights; the mesh's own if None
    alpha : (H, W, 2), of the chromaticity ramp; the diffuse part keeps its chromaticity if None
    matte : (H, W) 0…1, the subject's share of each pixel; the mesh's if None
    name : for messages
    """

    field: ReflectanceField
    parts: Separated | None = None
    normal: np.ndarray | None = None
    alpha: np.ndarray | None = None
    matte: np.ndarray | None = None
    name: str = "the source camera"

    def __post_init__(self) -> None:
        shape = self.field.shape
        if self.field.camera is None:
            raise ValueError(f"{self.name}: where the pictures were taken from is not known; give the field a camera")
        for name, array, wanted in (
            ("normal", self.normal, (*shape, 3)),
            ("alpha", self.alpha, (*shape, 2)),
            ("matte", self.matte, shape),
        ):
            if array is not None and array.shape != wanted:
                raise ValueError(f"{self.name}: the map {name} is {array.shape}; expected {wanted}")

    @property
    def camera(self) -> Camera:
        assert self.field.camera is not None
        return self.field.camera


@dataclass(frozen=True, eq=False)
class View:
    """A subject from a new viewpoint.

    picture : its radiance, in the unit of field × irradiance, not multiplied by `alpha`; 0 and marked `OUTSIDE` where
        no camera saw the surface
    alpha : (H, W) float32, the share of the pixel that shows what some camera saw
    unseen : (H, W) float32, the share that shows a surface which no camera saw: a hole
    """

    picture: RadianceMap
    alpha: np.ndarray
    unseen: np.ndarray


def view(
    sources: Source | Sequence[Source],
    irradiances: np.ndarray | Sequence[np.ndarray],
    camera: Camera,
    meshes: Mesh | Sequence[Mesh],
    *,
    resynthesis: Resynthesis = Resynthesis(),
    blending: Blending = Blending(),
) -> View:
    """The subject under light of these irradiances, seen by a new camera.

    irradiances : (N, 3), of every light's cell; or such an array for each source, where their lights differ
    camera : the new one
    meshes : the subject's geometry, world
    Nothing is invented: what no camera saw is a hole in `alpha`, told by `unseen` and, from a quarter of the subject
    on, by a warning.
    Raises ValueError for irradiances of another shape, a mesh that does not match a source's picture, and a new camera
    that sees nothing of it.
    Source: Debevec et al. 2000, §4.5.
    """
    given = [sources] if isinstance(sources, Source) else list(sources)
    lights = _of_each(irradiances, given)
    subject = Subject.of(meshes)
    x, y = ((np.arange(SIDE * size) + 0.5) / SIDE for size in (camera.width, camera.height))
    sight = subject.seen(camera, np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1))
    place = np.flatnonzero(sight.met)
    if not len(place):
        raise ValueError("the new camera sees nothing of the mesh; check its pose")
    points, normals, facets, towards, shape = (
        array.reshape(-1, *array.shape[2:])[place]
        for array in (sight.points, sight.normals, sight.facets, sight.views, sight.shape)
    )
    values, weights = np.zeros((len(given), len(place), 3)), np.zeros((len(given), len(place)))
    for index, (source, irradiance) in enumerate(zip(given, lights, strict=True)):
        edges = outline(subject, source.camera, source.matte)
        check_mesh_matches(_brightness(source.field), edges.sight, source.name)
        wanted = _wanted(subject, edges.sight, camera)
        picture = _shaded(source, irradiance, edges.sight, wanted, camera, resynthesis)
        shaded, edges = without_background(picture, edges)
        visible = np.flatnonzero(subject.visible(points, facets, source.camera))
        layers = np.concatenate([shaded, border_distance(edges)[..., None]], axis=-1)
        found, certainty = sampled(layers, edges, points[visible], shape[visible])
        back = source.camera.position - points[visible]
        back /= np.linalg.norm(back, axis=-1, keepdims=True)
        values[index, visible] = found[:, :3]
        weights[index, visible] = blending.weights(normals[visible], back, towards[visible], certainty, found[:, 3])
    mean, seen = blended(values, weights)
    return _assembled(mean, seen, place, camera)


def _of_each(irradiances: np.ndarray | Sequence[np.ndarray], sources: list[Source]) -> list[np.ndarray]:
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


def _brightness(field: ReflectanceField) -> np.ndarray:
    """The mean (H, W) of all values of each pixel, read light by light."""
    total = np.zeros(field.shape)
    for light in range(len(field.lights)):
        total += field.block(slice(light, light + 1), slice(0, field.shape[0]))[0].mean(axis=-1)
    return total / len(field.lights)


def _wanted(subject: Subject, sight: Sight, camera: Camera) -> np.ndarray:
    """(H, W) bool: the source's pixels that the new camera sees, and those beside them that are looked up too."""
    from scipy.ndimage import binary_dilation

    shared = sight.met.copy()
    shared[shared] = subject.visible(sight.points[shared], sight.facets[shared], camera)
    return np.asarray(binary_dilation(shared, np.ones((3, 3)), iterations=2), bool) & sight.met


def _shaded(
    source: Source,
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


def _assembled(values: np.ndarray, seen: np.ndarray, place: np.ndarray, camera: Camera) -> View:
    """Pixels from rays: values (N, 3) and whether they were seen (N,), at numbers `place` of the finer grid."""
    height, width = camera.height, camera.width
    count = height * width * SIDE * SIDE
    finer, shown, hole = np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    finer[place[seen]], shown[place[seen]], hole[place[~seen]] = values[seen], 1, 1
    cells = (height, SIDE, width, SIDE)
    alpha, unseen = (each.reshape(cells).mean((1, 3)) for each in (shown, hole))
    radiance = finer.reshape(*cells, 3).mean((1, 3)) / np.maximum(alpha, 1 / (2 * SIDE * SIDE))[..., None]
    missing = float(unseen.sum() / (alpha.sum() + unseen.sum()))
    if missing > 0.25:
        warnings.warn(
            f"no camera saw {missing:.0%} of what the new view shows; it is left out (see `unseen`): add a source "
            "camera on that side",
            stacklevel=3,
        )
    clipped = np.where(alpha > 0, 0, OUTSIDE).astype(np.uint8)
    return View(
        RadianceMap(radiance.astype(np.float32), clipped=clipped), alpha.astype(np.float32), unseen.astype(np.float32)
    )

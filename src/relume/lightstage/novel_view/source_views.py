"""What a new camera sees of a subject, gathered from the cameras that took it: rays, source pixels, blending.

Each ray of the new view meets the mesh; what each source camera shows of that place is looked up in its picture, and
the sources are blended (Debevec et al. 2000, §4.5; Debevec, Yu, Borshukov 1998). World frame, metres.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from relume.errors import warn
from relume.image.radiance import OUTSIDE, RadianceMap
from relume.lightstage.blocks import sum_of_lights
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.novel_view.projection import Outline, Subject, check_mesh_matches, outline, sampled
from relume.lightstage.surface.separation import Separated
from relume.scene.cameras.camera import Camera

SIDE = 2
"""Rays along each side of a pixel of the new view: outlines in steps of a quarter."""


@dataclass(frozen=True, eq=False)
class SourceView:
    """What one camera took of the subject.

    field : its reflectance field, with the camera
    parts : the same, separated into diffuse and specular; None for a subject without highlights, whose picture is
        projected as it is
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
        """The field's camera."""
        assert self.field.camera is not None
        return self.field.camera


@dataclass(frozen=True, eq=False)
class NewView:
    """A subject from a new viewpoint.

    picture : its radiance, in the unit of field × irradiance, not multiplied by `alpha`; 0 and marked `OUTSIDE` where
        no camera saw the surface
    alpha : (H, W) float32, the share of the pixel that shows what some camera saw
    unseen : (H, W) float32, the share that shows a surface which no camera saw: a hole
    """

    picture: RadianceMap
    alpha: np.ndarray
    unseen: np.ndarray


@dataclass(frozen=True, eq=False)
class NewRays:
    """Rays of a new camera that meet the subject, M of them.

    place : (M,) numbers in the grid of SIDE × SIDE rays a pixel, row by row
    points, normals, facets, towards : (M, 3) where they meet it, its normals, those of its triangles, and the
        directions back to the camera
    shape : (M,) int, which mesh
    """

    camera: Camera
    place: np.ndarray
    points: np.ndarray
    normals: np.ndarray
    facets: np.ndarray
    towards: np.ndarray
    shape: np.ndarray

    @staticmethod
    def of(subject: Subject, camera: Camera) -> NewRays:
        """Raises ValueError where the camera sees nothing of the subject."""
        x, y = ((np.arange(SIDE * size) + 0.5) / SIDE for size in (camera.width, camera.height))
        sight = subject.seen(camera, np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1))
        place = np.flatnonzero(sight.met)
        if not len(place):
            raise ValueError("the new camera sees nothing of the mesh; check its pose")
        return NewRays(
            camera,
            place,
            *(
                array.reshape(-1, *array.shape[2:])[place]
                for array in (sight.points, sight.normals, sight.facets, sight.views, sight.shape)
            ),
        )

    def pixels(self) -> np.ndarray:
        """(M,) int, the pixel of the new view that each ray belongs to, row by row."""
        row, column = np.divmod(self.place, SIDE * self.camera.width)
        return (row // SIDE) * self.camera.width + column // SIDE


@dataclass(frozen=True)
class Blending:
    """How much each source camera counts in a new view (view-dependent texture mapping).

    It counts the more the nearer its direction is to the new view's, the more the surface faces it, and the farther the
    place is from where its sight of the surface ends: all three go to nothing smoothly, so that no seam shows where one
    camera takes over from another.

    angle : radians between two directions of view at which a camera counts e^−½ of one that looks from the new view
        itself. 20°: what eq. 9 carries that far is still near what was measured
    facing : power of the cosine between normal and view; 2, since a pixel covers the more of the surface, one way, the
        less it faces it, and its highlights are the less to be trusted
    feather : pixels of the source over which its weight rises from the border of what it sees. 8: a seam narrower than
        that is seen as a line
    """

    angle: float = np.radians(20)
    facing: float = 2.0
    feather: float = 8.0

    def __post_init__(self) -> None:
        if not (0 < self.angle < np.inf and 0 <= self.facing < np.inf and 0 <= self.feather < np.inf):
            raise ValueError(f"{self}: expected an angle in radians above 0, and two numbers that are not below 0")

    def weights(
        self, normals: np.ndarray, view: np.ndarray, new_view: np.ndarray, certainty: np.ndarray, border: np.ndarray
    ) -> np.ndarray:
        """The weight (N,) of one source at N places, above 0 where it sees them and 0 elsewhere.

        normals, view, new_view : (N, 3) unit, world; views from the surface to the source and to the new camera
        certainty : (N,) of what was sampled, 0…1 (`projection.sampled`)
        border : (N,) pixels of the source to the border of what it sees
        """
        cosine = np.clip(np.einsum("pk,pk->p", view, new_view), -1, 1)
        near = np.exp(-0.5 * (np.arccos(cosine) / self.angle) ** 2)
        faced = np.maximum(np.einsum("pk,pk->p", normals, view), 0.01) ** self.facing
        inside = np.clip(border / self.feather, 0, 1) if self.feather > 0 else np.ones_like(border)
        smooth = inside * inside * (3 - 2 * inside)
        # Never nothing where something is seen: alone, it fills the place.
        return np.where(certainty > 0, certainty * faced * np.maximum(near, 1e-12) * np.maximum(smooth, 1e-4), 0)


Layers = Callable[[int, Outline], tuple[np.ndarray, Outline]]
"""Of a source's number and outline: values of its pixels, (H, W, C), and which of them may be used."""
Shading = Callable[[int, np.ndarray, np.ndarray], np.ndarray]
"""Of a source's number, rays (n,) and what was looked up for them (n, C): radiance (n, 3)."""


def blend_sources(
    sources: Sequence[SourceView], subject: Subject, rays: NewRays, layers: Layers, shading: Shading, blending: Blending
) -> NewView:
    """The new view from all sources; what none saw is a hole, with a warning from a quarter on.

    Raises ValueError for a mesh that does not match a source's picture.
    """
    from scipy.ndimage import distance_transform_edt

    values, weights = np.zeros((len(sources), len(rays.place), 3)), np.zeros((len(sources), len(rays.place)))
    for index, source in enumerate(sources):
        edges = outline(subject, source.camera, source.matte)
        check_mesh_matches(sum_of_lights(source.field) / len(source.field.lights), edges.sight, source.name)
        values_of_source, edges = layers(index, edges)
        visible = np.flatnonzero(subject.visible(rays.points, rays.facets, source.camera))
        # Pixels to where the source's sight of the surface ends; 0 where it has none.
        border = np.asarray(distance_transform_edt(np.pad(edges.usable, 1)))[1:-1, 1:-1]
        values_of_source = np.concatenate([values_of_source, border[..., None]], axis=-1)
        found, certainty = sampled(values_of_source, edges, rays.points[visible], rays.shape[visible])
        back = source.camera.position - rays.points[visible]
        back /= np.linalg.norm(back, axis=-1, keepdims=True)
        values[index, visible] = shading(index, visible, found[:, :-1])
        weights[index, visible] = blending.weights(
            rays.normals[visible], back, rays.towards[visible], certainty, found[:, -1]
        )
    total = weights.sum(axis=0)
    mean = np.einsum("kn,knc->nc", weights, values) / np.maximum(total, 1e-300)[:, None]
    return _assembled(mean, total > 0, rays.place, rays.camera)


def _assembled(values: np.ndarray, seen: np.ndarray, place: np.ndarray, camera: Camera) -> NewView:
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
        warn(
            f"no camera saw {missing:.0%} of what the new view shows; it is left out (see `unseen`): add a source "
            "camera on that side"
        )
    clipped = np.where(alpha > 0, 0, OUTSIDE).astype(np.uint8)
    return NewView(
        RadianceMap(radiance.astype(np.float32), clipped=clipped), alpha.astype(np.float32), unseen.astype(np.float32)
    )

"""A picture projected on a mesh and seen from elsewhere (Debevec et al. 2000, §4.5).

The mesh is the subject's, in the world's frame, metres. Pixels are (x right, y down), centres at halves. What of a
pixel shows which surface is found by rays: a pixel at an outline mixes a surface with what is behind it, and such a
mixture is either undone, where behind it is background, or not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.errors import warn
from relume.renderers.raytrace.raycast import RayCaster
from relume.renderers.raytrace.surface import Surfaces
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh

FILTER = 1.5
"""Pixels across what a pixel gathers light from: a little more than its own square, as of lenses and of renderers."""
FINER = 5
"""Rays along each side of that."""
PURE = 0.97
"""Share of a pixel that must be its surface and background alone, for it to be used."""
LEAST = 0.3
"""Share of its surface in a pixel below which the rest is not taken out: noise would be magnified threefold."""
SPILLED = 0.1
"""Part of a pixel's radiance that may be background that is taken out."""
BESIDE = 3.0
"""Pixels by which places on the mesh may lie apart and be one surface, measured along the surface."""
DOUBTFUL, MISMATCH = 0.1, 0.25
"""Share of the mesh's picture that may be dark while as much of the photograph's light falls beside it: from the first
on there is a warning, at the second an end. A head 90 pixels wide crosses them when its mesh is off by 6 and 13."""
DARK = 0.02
"""Of the mesh's bright parts: what is below is dark. A black cloth reflects a twentieth of what skin does."""


@dataclass(frozen=True, eq=False)
class Subject:
    """A subject's meshes, made ready for rays."""

    caster: RayCaster
    surfaces: Surfaces

    @staticmethod
    def of(meshes: Mesh | Sequence[Mesh]) -> Subject:
        """Raises ValueError where there is no mesh, or none that is finite."""
        several = [meshes] if isinstance(meshes, Mesh) else list(meshes)
        if not several:
            raise ValueError("no mesh is given; a new view needs the subject's geometry")
        return Subject(RayCaster.of(several), Surfaces.of(several))

    def seen(self, camera: Camera, points: np.ndarray | None = None) -> Sight:
        """What the camera sees through pixel coordinates (…, 2), or through all its pixel centres (H, W)."""
        rays = camera.rays() if points is None else camera.rays_through(points)
        flat = np.ascontiguousarray(rays.reshape(-1, 3))
        eye = np.array(camera.position, np.float64)
        hits = self.caster.nearest(eye, flat)
        surface = self.surfaces.at(eye, flat, hits)
        # Both sides of a mesh are met; the one that is seen faces the viewer.
        towards = np.where(np.einsum("pk,pk->p", surface.geometric_normal, flat) > 0, -1.0, 1.0)[:, None]
        shape = rays.shape[:-1]
        return Sight(
            camera,
            surface.point.reshape(*shape, 3),
            (surface.shading_normal * towards).reshape(*shape, 3),
            (surface.geometric_normal * towards).reshape(*shape, 3),
            -rays,
            hits.shape.reshape(shape),
            np.where(hits.shape >= 0, hits.distance, np.inf).reshape(shape),
        )

    def visible(self, points: np.ndarray, normals: np.ndarray, camera: Camera) -> np.ndarray:
        """Whether the camera sees these points of the surface, (N,) bool: in front of it, inside its picture, unhidden.

        points, normals : (N, 3), the normals on the side that is looked at
        """
        eye = np.array(camera.position, np.float64)
        way = eye - points
        distance = np.linalg.norm(way, axis=-1)
        at = camera.project(points)
        with np.errstate(invalid="ignore"):
            inside = np.all((at >= 0) & (at <= [camera.width, camera.height]), axis=-1)
        result = inside & (distance > 0) & (np.einsum("pk,pk->p", way, normals) > 0)
        if result.any():
            start, towards = points[result], way[result] / distance[result, None]
            # float32 corners are off by 1e-7 of their distance from the origin.
            slack = 1e-5 * (distance[result] + np.abs(start).max(initial=0))
            origins = start + 2 * slack[:, None] * normals[result]
            result[result] = ~self.caster.occluded(origins, towards, np.maximum(distance[result] - 2 * slack, 0))
        return result


@dataclass(frozen=True, eq=False)
class Sight:
    """What a camera sees of a subject, for pixels or points of any shape (…).

    points : (…, 3) metres, world; 0 where nothing is met
    normals, facets : (…, 3) unit, world, on the side that is seen: smooth as the mesh has them, and of its triangles
    views : (…, 3) unit, from the surface to the camera
    shape : (…) int, which mesh; −1 where none
    distance : (…) metres along the ray; ∞ where nothing is met
    """

    camera: Camera
    points: np.ndarray
    normals: np.ndarray
    facets: np.ndarray
    views: np.ndarray
    shape: np.ndarray
    distance: np.ndarray

    @property
    def met(self) -> np.ndarray:
        """(…) bool: where there is a surface."""
        return self.shape >= 0

    @property
    def reach(self) -> np.ndarray:
        """(…) metres along the surface that a pixel covers, at most; 0 where nothing is met."""
        facing = np.maximum(np.einsum("...k,...k->...", self.facets, self.views), 0.05)
        return np.where(self.met, np.where(self.met, self.distance, 0) / self.camera.focal_length / facing, 0)


@dataclass(frozen=True, eq=False)
class Outline:
    """What the pixels of a source picture hold.

    sight : what the camera sees through their centres
    share : (H, W) of the pixel that is not background, 0…1
    usable : (H, W) bool, pixels of one surface, alone or before background
    """

    sight: Sight
    share: np.ndarray
    usable: np.ndarray


def outline(subject: Subject, camera: Camera, matte: np.ndarray | None = None) -> Outline:
    """Which pixels of a camera show one surface of the subject, and how much of each.

    matte : (H, W) 0…1, the subject's share of each pixel, where it is known better than from the mesh
    """
    sight = subject.seen(camera)
    own, background, total = np.zeros(sight.shape.shape), np.zeros(sight.shape.shape), 0.0
    steps = ((np.arange(FINER) + 0.5) / FINER - 0.5) * FILTER
    x, y = np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5
    centres = np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)
    near = BESIDE * sight.reach
    for right in steps:
        for down in steps:
            # Pixels count most in their middle: a tent, as linear as the look-up that follows.
            weight = (1 - abs(right) / FILTER) * (1 - abs(down) / FILTER)
            other = subject.seen(camera, centres + np.array([right, down]))
            apart = np.where(sight.met & other.met, np.linalg.norm(other.points - sight.points, axis=-1), np.inf)
            own += weight * ((other.shape == sight.shape) & (apart < near))
            background += weight * ~other.met
            total += weight
    own, background = own / total, background / total
    usable = sight.met & (own + background > PURE)
    share = 1 - background
    if matte is not None:
        if matte.shape != share.shape:
            raise ValueError(f"a matte of {matte.shape} for a camera of {share.shape}; expected one number a pixel")
        share = np.clip(matte, 0, 1).astype(np.float64)
    return Outline(sight, share, usable & (share > LEAST))


def without_background(picture: np.ndarray, source: Outline) -> tuple[np.ndarray, Outline]:
    """The surface's own radiance (H, W, 3) in pixels that it shares with background, and which are usable after it.

    The background beside is the mean of the pixels within two that show nothing else, which is its light spilled into
    the pixel; black where there are none. Where it makes more than a tenth of what a pixel shows, the pixel is not
    used: shares of pixels are known to a few hundredths, and so much of a bright background would stay in it.
    """
    from scipy.ndimage import uniform_filter

    empty = (source.share < 1 - PURE).astype(np.float64)
    near = uniform_filter(empty, 5, mode="nearest")
    spread = np.stack([uniform_filter(picture[..., k] * empty, 5, mode="nearest") for k in range(3)], axis=-1)
    behind = spread / np.maximum(near, 1e-6)[..., None] * (near > 1e-6)[..., None]
    share = np.where(source.usable, source.share, 1.0)[..., None]
    spilled = (1 - share) * behind
    bled = np.abs(spilled).sum(-1) > SPILLED * np.abs(picture).sum(-1)
    return (picture - spilled) / share, replace(source, usable=source.usable & ~bled)


def sampled(picture: np.ndarray, source: Outline, points: np.ndarray, shape: np.ndarray) -> tuple[np.ndarray, ...]:
    """What a picture (H, W, C) shows at points (N, 3) of meshes `shape` (N,): values (N, C) and the certainty (N,).

    Bilinear among the usable pixels that show the same surface; where none of the four is, the nearest of those within
    two pixels. The certainty is 1 where all four are, and 0 where nothing is near: the values are 0 there.
    """
    height, width = source.usable.shape
    at = source.sight.camera.project(points)
    known = np.asarray(np.isfinite(at).all(axis=-1))
    at = np.where(known[:, None], at, 0.5) - 0.5
    corner = np.floor(at).astype(np.int64)
    near = BESIDE * source.sight.reach.reshape(-1)
    flat, usable = picture.reshape(-1, picture.shape[-1]), source.usable.reshape(-1) & (near > 0)
    places, meshes = source.sight.points.reshape(-1, 3), source.sight.shape.reshape(-1)
    total, weight, sure = np.zeros((len(points), picture.shape[-1])), np.zeros(len(points)), np.zeros(len(points))
    for down in range(-1, 3):
        for right in range(-1, 3):
            column, row = corner[:, 0] + right, corner[:, 1] + down
            inside = known & (column >= 0) & (column < width) & (row >= 0) & (row < height)
            pixel = np.clip(row, 0, height - 1) * width + np.clip(column, 0, width - 1)
            same = inside & usable[pixel] & (meshes[pixel] == shape)
            same &= np.linalg.norm(places[pixel] - points, axis=-1) < near[pixel]
            across, along = np.abs(at[:, 0] - column), np.abs(at[:, 1] - row)
            bilinear = np.maximum(1 - across, 0) * np.maximum(1 - along, 0)
            # The farther ring counts only where the four pixels do not.
            share = same * (bilinear + 1e-5 * np.exp(-4 * (across**2 + along**2)))
            total += share[:, None] * flat[pixel]
            weight += share
            sure += same * bilinear
    return np.divide(total, np.maximum(weight, 1e-30)[:, None]), np.where(weight > 0, np.maximum(sure, 1e-3), 0)


def check_mesh_matches(brightness: np.ndarray, sight: Sight, name: str = "the camera") -> None:
    """Raises ValueError where the mesh is not where the picture shows the subject, and warns where that is doubtful.

    brightness : (H, W), the mean of the subject's pictures under all lights
    A mesh of a part of the subject, as of a face without its hair, is no mismatch, nor are parts that are black; a mesh
    of which a quarter is dark in the picture, while a quarter of the light falls beside it, is.
    """
    from scipy.ndimage import binary_dilation

    met = sight.met
    if met.sum() < 16:
        raise ValueError(
            f"{name} sees the mesh in {int(met.sum())} of {met.size} pixels; check its pose, and that the mesh is in "
            "metres with +Y up"
        )
    bright = np.maximum(brightness, 0)
    # Against the mesh's own bright parts, since a background may be as bright as it likes; unless all of them are dark.
    level = float(np.quantile(bright[met], 0.95))
    everywhere = float(np.quantile(bright[bright > 0], 0.95)) if np.any(bright > 0) else 0.0
    dark = float(np.mean(bright[met] <= DARK * level)) if level > DARK / 4 * everywhere else 1.0
    around = np.asarray(binary_dilation(met, iterations=3), bool)
    beside = float(bright[~around].sum() / max(bright.sum(), 1e-30))
    said = (
        f"the picture is dark in {dark:.0%} of the pixels where the mesh is, and {beside:.0%} of its light falls "
        "beside it; check the camera's pose and the mesh's place"
    )
    if dark > 3 * MISMATCH or min(dark, beside) > MISMATCH:
        raise ValueError(f"the mesh does not match {name}: {said}")
    if min(dark, beside) > DOUBTFUL:
        warn(f"the mesh hardly matches {name}: {said}")

"""Scans of one subject from several sides made one surface (Curless & Levoy 1996).

Each scan says, near its surface, how far a place lies before it: the distance along the camera's ray, times the cosine
of the surface there. In a lattice of cells these are averaged, each by how certain it is, and the surface is where the
average is 0. What no scan saw stays open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from relume.errors import warn
from relume.lightstage.geometry.meshing import face_normals, pixel_widths, surface_normals
from relume.lightstage.geometry.scan import PLAIN, Scan
from relume.scene.shapes.shapes import Mesh

MOST_CELLS = 2**28
"""A gigabyte of distances."""
LEAST_COSINE = 0.1
"""Between a surface and the ray that sees it: beyond it a pixel is ten times as long as wide."""
LEAST_DEVIATION = 5e-5
"""Metres, of a scan's depth besides its noise: the rig is not exact."""
RIM = 8
"""Pixels from a scan's rim over which it loses its say: where it ends, the mean must not jump."""


@dataclass(frozen=True)
class MergingSettings:
    """How scans become one surface.

    cell : metres, of the lattice; as wide as the median pixel on the surface for None
    reach : cells before and behind a surface within which a scan speaks: more than noise and the rig's errors together,
        less than half of what is thin, as an ear
    """

    cell: float | None = None
    reach: int = 3


@dataclass(frozen=True, eq=False)
class MergedScan:
    """Several scans as one surface, metres, in their frame.

    mesh : without texture coordinates
    cell : of the lattice, metres
    apart : root mean square of what scans say of a place that several see, about their mean, metres; NaN where none do
    """

    mesh: Mesh
    cell: float
    apart: float

    def facts(self) -> dict[str, object]:
        """What a user should know, millimetres."""
        return {
            "vertices": len(self.mesh.vertices),
            "faces": len(self.mesh.faces),
            "cell, mm": float(f"{1e3 * self.cell:.3g}"),
            "views apart from each other, rms, mm": float(f"{1e3 * self.apart:.2g}"),
        }


def merge_scans(scans: Sequence[Scan], settings: MergingSettings = MergingSettings()) -> MergedScan:
    """One mesh of what several scans saw, all in one frame, as `scan(camera=…)` places them in a light stage's.

    scans : two or more
    settings : how large a cell of the lattice is, and how far a scan speaks
    Warns where the scans contradict each other by more than a cell: their places are wrong. Raises ValueError for fewer
    than two scans, for a lattice of too many cells, and without scikit-image.
    Source: Curless & Levoy 1996, "A volumetric method for building complex models from range images".
    """
    try:
        from skimage.measure import marching_cubes
    except ImportError:
        raise ValueError('several views need scikit-image: pip install "relume[lightstage]"') from None
    if len(scans) < 2:
        raise ValueError(f"{len(scans)} scans; give two or more to merge, or write the one as it is")
    # The lattice, and which of its corners lie near a surface.
    every = np.concatenate([each.surface[each.kept] for each in scans])
    cell = settings.cell
    if cell is None:
        cell = float(np.median(np.concatenate([pixel_widths(s.surface, s.rig.camera)[s.kept] for s in scans])))
    origin = every.min(axis=0) - (settings.reach + 2) * cell
    counts = np.ceil((every.max(axis=0) - origin) / cell).astype(int) + settings.reach + 3
    if np.prod(counts.astype(float)) > MOST_CELLS:
        raise ValueError(
            f"a lattice of {' × '.join(str(each) for each in counts)} cells of {1e3 * cell:.2g} mm does not fit into "
            "memory; give a larger cell"
        )
    corners = _near(np.rint((every - origin) / cell).astype(int), counts, settings.reach)
    places = origin + cell * np.stack(np.unravel_index(corners, counts), axis=-1)
    # What all scans say of them.
    total, mean, square, voices = (np.zeros(len(corners)) for _ in range(4))
    for each in scans:
        distance, weight = _said(each, places, settings.reach * cell)
        total += weight
        mean += weight * distance
        square += weight * distance**2
        voices += weight > 0
    heard = total > 0
    mean[heard] /= total[heard]
    shared = voices > 1
    spread = square[shared] / total[shared] - mean[shared] ** 2
    apart = float(np.sqrt(np.maximum(spread, 0).mean())) if shared.any() else np.nan
    if apart > cell:
        warn(
            f"the scans contradict each other by {1e3 * apart:.2g} mm, more than a cell of {1e3 * cell:.2g} mm: check "
            "the cameras' places, and that the subject kept still"
        )
    # Where the mean is 0, in cells all of whose corners are known; skimage looks for a cell's mask at its far corner.
    field, known = np.zeros(np.prod(counts), np.float32), np.zeros(np.prod(counts), bool)
    field[corners[heard]], known[corners[heard]] = mean[heard] / cell, True
    known = ndimage.minimum_filter(known.reshape(counts), 2, mode="constant")
    try:
        vertices, faces, _, _ = marching_cubes(field.reshape(counts), 0.0, mask=known)
    except (RuntimeError, ValueError):
        raise ValueError("no surface is left where the scans were merged; give a larger cell") from None
    vertices, faces = origin + cell * vertices.astype(np.float64), faces.astype(np.int32)
    normals = face_normals(vertices, faces).astype(np.float32)
    return MergedScan(Mesh(vertices.astype(np.float32), faces, PLAIN, normals, None, "scan"), cell, apart)


def _near(cells: np.ndarray, counts: np.ndarray, reach: int) -> np.ndarray:
    """Numbers of the lattice's corners within reach of any of these (N, 3), each way."""
    near = np.zeros(counts, bool)
    near[tuple(cells.T)] = True
    return np.flatnonzero(ndimage.maximum_filter(near, 2 * reach + 1))


def _said(scanned: Scan, places: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray]:
    """How far before a scan's surface places (N, 3) lie, and how much that counts, 0 where the scan says nothing."""
    camera = scanned.rig.camera
    far = np.linalg.norm(scanned.surface - camera.position, axis=-1)
    normal = surface_normals(scanned.surface, camera)
    cosine = np.einsum("...k,...k->...", normal, camera.position - scanned.surface) / far
    rays = camera.rays()
    variance = np.einsum("...i,...ij,...j->...", rays, scanned.points.covariance, rays)
    inner = np.minimum(np.asarray(ndimage.distance_transform_edt(np.isfinite(cosine))) / RIM, 1)
    certain = inner * cosine / (variance + LEAST_DEVIATION**2)
    pixel = camera.project(places) - 0.5
    inside = np.all((pixel >= 0) & (pixel <= [camera.width - 1, camera.height - 1]), axis=-1)
    rows_columns = pixel[inside, ::-1].T
    distance, weight = np.zeros(len(places)), np.zeros(len(places))
    # A NaN among the four pixels about a place makes the mean NaN: holes and jumps between surfaces say nothing.
    jump = ndimage.maximum_filter(np.nan_to_num(far), 3) - ndimage.minimum_filter(np.nan_to_num(far, nan=np.inf), 3)
    far = np.where(jump < 4 * reach, far, np.nan)
    there, slope, counts = (ndimage.map_coordinates(values, rows_columns, order=1) for values in (far, cosine, certain))
    before = (there - np.linalg.norm(places[inside] - camera.position, axis=-1)) * slope
    believed = np.isfinite(before) & np.isfinite(counts) & (np.abs(before) < reach) & (slope > LEAST_COSINE)
    distance[inside] = np.where(believed, before, 0)
    weight[inside] = np.where(believed, counts, 0)
    return distance, weight

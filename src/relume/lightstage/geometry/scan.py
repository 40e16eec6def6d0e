"""A mesh of a subject from photographs under a projector's patterns: what `relume stage scan` calls."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np

from relume.errors import warn
from relume.lightstage.geometry.decoding import DecodingSettings, ProjectorPlaces, decoded_places
from relume.lightstage.geometry.fusion import FusionSettings, corrected_normals, fused_points
from relume.lightstage.geometry.meshing import CleaningSettings, cleaned, face_normals, lattice_mesh, surface_normals
from relume.lightstage.geometry.pattern_photographs import PatternPhotographs, read_pattern_photographs
from relume.lightstage.geometry.rig import ScannerRig, read_rig
from relume.lightstage.geometry.triangulation import ScannedPoints, triangulated
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Material
from relume.scene.shapes.shapes import Mesh

SHADE = 0.5
"""Of what is bright enough in the picture, the share that the patterns do not reach from which on it is warned of."""
PLAIN = Material(base_color=(0.5, 0.5, 0.5))
"""What a scanned surface is taken for: its shape alone is known."""


@dataclass(frozen=True)
class ScanSettings:
    """How photographs become a mesh: what is believed, what is kept, and how normals count.

    decoding : which pixels of the patterns are believed
    cleaning : which triangles are kept
    fusion : how normals count
    """

    decoding: DecodingSettings = DecodingSettings()
    cleaning: CleaningSettings = CleaningSettings()
    fusion: FusionSettings = FusionSettings()


@dataclass(frozen=True, eq=False)
class Scan:
    """A scanned subject, metres, in the rig's frame.

    mesh : a vertex for each pixel of the camera that saw surface; its texture coordinates are the picture's
    points : of all pixels, before they were cleaned and fused with normals
    kept : (H, W) bool, which of them are the mesh's
    surface : (H, W, 3), these, fused with normals where there are some; NaN elsewhere
    places : what the patterns said of each pixel
    rig : the camera and the projector
    """

    mesh: Mesh
    points: ScannedPoints
    kept: np.ndarray
    surface: np.ndarray
    places: ProjectorPlaces
    rig: ScannerRig

    def facts(self) -> dict[str, object]:
        """What a user should know: shares of the picture, and how certain the points are, millimetres."""
        reached, known = self.places.reached, self.points.known
        spread = np.sqrt(np.einsum("nkk->n", self.points.covariance[self.kept]))
        return {
            "vertices": len(self.mesh.vertices),
            "faces": len(self.mesh.faces),
            "in the projector's shade, or dark": float(f"{1 - reached.mean():.3g}"),
            "lit, but not believed": float(f"{(reached & ~known).sum() / max(reached.sum(), 1):.3g}"),
            "dropped as noise": float(f"{(known & ~self.kept).sum() / max(known.sum(), 1):.3g}"),
            "deviation of a point by noise, median, mm": float(f"{1e3 * np.median(spread):.2g}"),
            "gap between rays, median, mm": float(f"{1e3 * np.median(self.points.gap[self.kept]):.2g}"),
        }


def scan(
    photographs: str | os.PathLike[str] | PatternPhotographs,
    rig: str | os.PathLike[str] | ScannerRig,
    *,
    camera: Camera | None = None,
    normals: np.ndarray | None = None,
    settings: ScanSettings = ScanSettings(),
) -> Scan:
    """A mesh of what a camera saw under a projector's patterns (as the faces of Debevec et al. 2000, §4.5, Fig. 14e).

    photographs : a folder of pictures, named as the patterns are, with their projector.json
    rig : the camera and the projector, or the file of them
    camera : of the light stage, where the rig's camera stands in it; the mesh is then in the stage's frame, else in the
        rig's
    normals : (H, W, 3) unit, of photometric stereo by the same camera, in the mesh's frame, 0 where unknown: the
        surface follows them on the small, and the triangulated points on the large (Nehab et al. 2005)
    settings : what is believed, what is kept, and how normals count
    Holes stay: what the projector does not reach has no mesh. Warns where that is half of the subject or more.
    Raises UnreadableFile for photographs or a rig that cannot be used, and ValueError where nothing is seen.
    """
    taken = photographs if isinstance(photographs, PatternPhotographs) else read_pattern_photographs(photographs)
    given = rig if isinstance(rig, ScannerRig) else read_rig(rig)
    given = given if camera is None else given.placed(camera)
    places = decoded_places(taken, settings.decoding)
    lost = float(1 - places.known[places.reached].mean())
    if lost > SHADE:
        warn(
            f"{lost:.0%} of what the projector lights is not believed: the patterns are lost in shade between "
            "surfaces, below the skin or out of focus; there is no mesh there"
        )
    scanned = triangulated(places, given)
    kept = cleaned(scanned, given.camera, settings.cleaning)
    points = np.where(kept[..., None], scanned.points, np.nan)
    if normals is None:
        turned = surface_normals(points, given.camera)
    else:
        if normals.shape != points.shape:
            raise ValueError(
                f"the normals are {normals.shape[1]}×{normals.shape[0]} pixels, the photographs {points.shape[1]}×"
                f"{points.shape[0]}; take both with the same camera"
            )
        turned = corrected_normals(normals, points, given.camera, settings.fusion)
        points = fused_points(scanned, kept, turned, given.camera, settings.fusion)
        turned = np.where(np.isfinite(turned), turned, surface_normals(points, given.camera))
    return Scan(_mesh(points, kept, turned, given.camera, settings.cleaning), scanned, kept, points, places, given)


def _mesh(
    points: np.ndarray, kept: np.ndarray, normals: np.ndarray, camera: Camera, settings: CleaningSettings
) -> Mesh:
    """The mesh of points (H, W, 3); normals at its rim, where no neighbours show them, are those of its faces."""
    pixels, faces = lattice_mesh(points, kept, camera, settings)
    rows, columns = pixels.T
    vertices = points[rows, columns]
    own = normals[rows, columns]
    own = np.where(np.isfinite(own), own, face_normals(vertices, faces))
    uv = np.stack([(columns + 0.5) / camera.width, 1 - (rows + 0.5) / camera.height], axis=-1)
    return Mesh(vertices.astype(np.float32), faces, PLAIN, own.astype(np.float32), uv.astype(np.float32), "scan")

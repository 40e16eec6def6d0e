"""What a subject's surface is like, from its stage to files: what `relume stage separate` calls."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from relume.errors import OutputNotWritten
from relume.image import files
from relume.image.colour import encode_srgb
from relume.image.photograph import Photograph
from relume.lightstage.field.field import ReflectanceField
from relume.lightstage.field.polarised import PolarisedPair
from relume.lightstage.surface.material_export import write_material
from relume.lightstage.surface.separation import separate
from relume.lightstage.surface.surface_maps import MAPS, SurfaceMaps, surface_maps
from relume.scene.cameras.camera import Camera
from relume.scene.shapes.shapes import Mesh

SOOT = 0.01
"""An albedo below that of soot and black velvet."""


def measure_surface(field: ReflectanceField, crossed: ReflectanceField | None = None) -> SurfaceMaps:
    """Normals, albedo, specular energy and reflectance, and roughness of a subject (Debevec et al. 2000, §4.2).

    Diffuse and specular reflection are separated by the colour of the light, or from a pair of polarised stages, which
    grey and black subjects need.

    crossed : the same stage through a crossed polariser; `field` is then the parallel one
    Warns of an albedo that no subject has. Raises ValueError where no pixel can be explained.
    """
    maps = surface_maps(separate(field) if crossed is None else PolarisedPair(field, crossed))
    known = maps.weight > 0
    if not known.any():
        raise ValueError(
            f"none of the {known.size} pixels answers to the lights as a surface does; check the pictures and the "
            "directions of the lights"
        )
    # Pictures hold the albedo in the unit of the lights' irradiance.
    usual = float(np.median(maps.albedo[known].mean(axis=-1)))
    if not SOOT < usual < 1:
        warnings.warn(
            f"the median albedo is {usual:.3g}, which no subject has: the lights' irradiance is given too "
            f"{'small' if usual >= 1 else 'large'}, or not at all; normals and roughness alone are right",
            stacklevel=2,
        )
    return maps


def write_surface(
    folder: str | os.PathLike[str], maps: SurfaceMaps, meshes: Sequence[Mesh] = (), camera: Camera | None = None
) -> tuple[Path, ...]:
    """Write maps.exr, a .png of each map and, with meshes, subject.glb with the maps as its material.

    meshes : of the subject, metres, in the stage's frame
    camera : that the maps were taken with; needed with meshes
    Returns the files. Raises ValueError as `write_material`, OutputNotWritten.
    """
    place = Path(folder)
    if meshes and camera is None:
        raise ValueError("the mesh needs the stage's camera; give it in stage.json")
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputNotWritten(f"{place}: cannot be made a folder ({error.strerror}); choose another") from None
    files.write_layers(place / "maps.exr", {name: getattr(maps, name) for name in MAPS})
    for name, picture in maps.pictures().items():
        # Albedo as the eye expects it; numbers of directions and shares as they are.
        shown = encode_srgb(picture) if name == "albedo" else picture
        codes = np.rint(255 * np.clip(shown, 0, 1)).astype(np.uint8)
        files.write(place / f"{name}.png", Photograph(codes))
    written = [place / "maps.exr", *(place / f"{name}.png" for name in MAPS)]
    if meshes and camera is not None:
        write_material(place / "subject.glb", meshes, camera, maps)
        written.append(place / "subject.glb")
    return tuple(written)

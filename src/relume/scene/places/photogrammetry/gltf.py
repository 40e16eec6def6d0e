"""Cameras of a glTF file, named as the photographs, as programs of photogrammetry export them; metres, +Y up."""

from __future__ import annotations

from pathlib import Path

from relume.errors import UnreadableFile
from relume.scene.gltf.camera import gltf_camera_names, read_gltf_camera
from relume.scene.places.photogrammetry.model import DOWN_AND_AHEAD, FoundModel, FoundView
from relume.scene.places.photographs import photograph_facts, pictures_in


def read_gltf_views(path: Path, photographs: Path) -> FoundModel:
    """Every camera of the file whose photograph lies in a folder; raises UnreadableFile where one does not.

    A camera of glTF has a field of view and no pixels: its picture gives those.
    """
    pictures = {name: picture for picture in pictures_in(photographs) for name in (picture.name, picture.stem)}
    views = []
    for name in gltf_camera_names(path):
        if name not in pictures:
            raise UnreadableFile(
                f"{path}: camera {name!r} has no photograph in {photographs}; name cameras as the photographs, and "
                "give their folder"
            )
        picture = pictures[name]
        width, height = photograph_facts(picture).size
        camera = read_gltf_camera(path, width, height, name, None, None)
        views.append(
            FoundView(
                picture.name,
                (width, height),
                camera.focal_length,
                camera.principal_point,
                DOWN_AND_AHEAD @ camera.rotation.T,
                camera.position,
            )
        )
    if not views:
        raise UnreadableFile(f"{path}: holds no camera that a node places; export it with its cameras")
    return FoundModel(tuple(views), up=(0.0, 1.0, 0.0), scaled=True)

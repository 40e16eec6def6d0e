"""Pictures of a panorama from files: radiance maps, brackets in folders, and single photographs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from relume.capture.brackets.merging import merge_brackets
from relume.capture.exposure.bracket import read_bracket, require_told
from relume.capture.exposure.folder import pictures_in
from relume.errors import UnreadableFile
from relume.image import files
from relume.image.files.signatures import kind_of
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.probe.single_photograph import linear


@dataclass(frozen=True, eq=False)
class Source:
    """A picture of a panorama before its lens and its orientation are known.

    picture : the radiance map
    focal_length : pixels, where the file tells it
    name : the file or folder
    assumed : whether the picture is a single photograph whose encoding was assumed to be sRGB
    """

    picture: RadianceMap
    focal_length: float | None
    name: str
    assumed: bool = False


def read_sources(paths: Sequence[Path], *, response: Response | None = None) -> list[Source]:
    """Read the views of a panorama: each path is one.

    paths : a radiance map, a photograph, or a folder with the bracket of one view
    response : of the camera; recovered from the brackets unless given, and taken to be sRGB for single photographs

    All brackets share one response, so that their maps share one scale. Raises UnreadableFile, NotABracket.
    """
    folders = [path for path in paths if path.is_dir()]
    of_folders: dict[Path, Source] = {}
    if folders:
        groups = [pictures_in(folder) for folder in folders]
        for folder, group in zip(folders, groups, strict=True):
            if not group:
                raise UnreadableFile(
                    f"{folder}: no photograph is in this folder; name the folder of one view's bracket"
                )
            if any(kind_of(path) == "RAW" for path in group):
                raise UnreadableFile(f"{folder}: holds camera raws; merge them with `relume merge`, and give the maps")
        brackets = [read_bracket(group) for group in groups]
        if len(brackets) > 1:
            require_told(brackets)
        merged = merge_brackets(brackets, profile=response)
        for folder, bracket in zip(folders, merged.brackets, strict=True):
            of_folders[folder] = Source(bracket.picture, bracket.focal_length, folder.name)
    sources = []
    for path in paths:
        if path in of_folders:
            sources.append(of_folders[path])
            continue
        image = files.read(path)
        if isinstance(image, RadianceMap):
            sources.append(Source(image, None, path.name))
        else:
            sources.append(Source(linear(image, response), image.focal_length, path.name, response is None))
    return sources

"""What the photographs of a place say of themselves: their size and the focal length of their EXIF."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from relume.errors import UnreadableFile
from relume.image import files
from relume.image.files.signatures import MAPS, PHOTOGRAPHS, kind_of


@dataclass(frozen=True, eq=False)
class PhotographFacts:
    """Of a photograph's file: (width, height), pixels, and the focal length of its EXIF, pixels, or None."""

    size: tuple[int, int]
    exif_focal_length: float | None = None


def photograph_facts(picture: Path) -> PhotographFacts:
    """Of a photograph or a radiance map; raises UnreadableFile."""
    if kind_of(picture) in MAPS:
        height, width = files.read_radiance(picture).radiance.shape[:2]
        return PhotographFacts((width, height))
    photograph = files.read_photograph(picture)
    return PhotographFacts(photograph.size, photograph.focal_length)


def pictures_in(folder: Path) -> list[Path]:
    """The photographs and radiance maps of a folder, by name."""
    return [path for path in sorted(folder.iterdir()) if path.is_file() and _is_picture(path)]


def _is_picture(path: Path) -> bool:
    try:
        return kind_of(path) in (*MAPS, *PHOTOGRAPHS)
    except UnreadableFile:
        return False

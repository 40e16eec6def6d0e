"""Photographs of a subject under a projector's patterns: read from a folder, and refused where a pattern is lost."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.lightstage.geometry.patterns import ProjectorPatterns, read_projector_patterns
from relume.lightstage.matting.gray_code import linear_picture

CLIPPED = 0.999
"""Of a photograph's white: codes from here on hold more light than they say."""
REACHED = 0.05
"""Of the brightest percent of a picture, what the projector must add to a pixel to have reached it."""
HALF_WAY = (0.2, 0.8)
"""Between black (0) and white (1): where the median of every shifted cosine lies."""


@dataclass(frozen=True, eq=False)
class PatternPhotographs:
    """Photographs of one subject under each of a projector's patterns.

    patterns : what was projected
    pictures : (K, H, W) float32, the mean of the channels, scene-linear, in the order of the patterns' names
    clipped : (H, W) bool, where any photograph is saturated
    colour : (H, W, 3) float32, what white light adds to black
    """

    patterns: ProjectorPatterns
    pictures: np.ndarray
    clipped: np.ndarray
    colour: np.ndarray

    def __getitem__(self, name: str) -> np.ndarray:
        """The picture (H, W) under one pattern."""
        return self.pictures[self.patterns.names.index(name)]

    def shifted(self, axis: str) -> np.ndarray:
        """The pictures (steps, H, W) under the cosines of an axis."""
        first = self.patterns.names.index(f"phase_{axis}0")
        return self.pictures[first : first + self.patterns.steps]

    @property
    def light(self) -> np.ndarray:
        """What the projector's white adds to each pixel, (H, W)."""
        return self["white"] - self["black"]

    @property
    def reached(self) -> np.ndarray:
        """Where (H, W) bool the projector's white adds light at all; the rest is in shade, or too dark."""
        light = self.light
        return light > REACHED * np.quantile(light, 0.99)


def read_pattern_photographs(folder: str | os.PathLike[str]) -> PatternPhotographs:
    """The photographs of a folder, named as the patterns are, beside the patterns' projector.json; any picture format.

    Photographs (JPEG, PNG, TIFF) are taken as sRGB, or as their profiles say.
    Raises UnreadableFile, in one line, for a picture that is missing, twice there or of another size, and for a pattern
    that is not seen in its picture.
    """
    place = Path(folder)
    if not place.is_dir():
        raise UnreadableFile(f"{place}: no folder; give the one with the photographs under the patterns")
    patterns = read_projector_patterns(place)
    paths = _named(place, patterns)
    pictures, clipped, colour, shape = [], None, None, None
    for name, path in zip(patterns.names, paths, strict=True):
        picture, encoded = linear_picture(path, shape, paths[0].name)
        shape = (picture.shape[0], picture.shape[1])
        clipped = np.zeros(shape, bool) if clipped is None else clipped
        if encoded:
            clipped |= (picture >= CLIPPED).any(axis=-1)
        if name in ("white", "black"):
            colour = picture if colour is None else colour - picture
        pictures.append(picture.mean(axis=-1))
    assert clipped is not None and colour is not None
    found = PatternPhotographs(patterns, np.stack(pictures), clipped, colour)
    _refuse_lost(found, paths)
    share = float(clipped[found.reached].mean())
    if share > 0.01:
        warn(f"{place}: {share:.0%} of what the projector lights is saturated and left out; expose shorter")
    return found


def _named(folder: Path, patterns: ProjectorPatterns) -> list[Path]:
    """The file of each pattern."""
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.iterdir()):
        found.setdefault(path.stem, []).append(path)
    missing = [name for name in patterns.names if name not in found]
    if missing:
        raise UnreadableFile(
            f"{folder}: {len(missing)} of {len(patterns.names)} photographs are missing, first of {missing[0]!r}; "
            "name each as its pattern is"
        )
    for name in patterns.names:
        if len(found[name]) > 1:
            raise UnreadableFile(f"{found[name][1]}: {found[name][0].name} is there too; keep one of them")
    return [found[name][0] for name in patterns.names]


def _refuse_lost(found: PatternPhotographs, paths: list[Path]) -> None:
    """Raises UnreadableFile where the projector is not seen, or one of its shifted patterns is not."""
    white, light = found["white"], found.light
    if not np.quantile(light, 0.99) > 0.05 * np.quantile(white, 0.99):
        raise UnreadableFile(
            f"{paths[0]}: hardly brighter than {paths[1].name}: the projector's light is lost in the room's; darken "
            "the room, and check which is which"
        )
    reached = found.reached
    for name, path, picture in zip(found.patterns.names, paths, found.pictures, strict=True):
        if not name.startswith("phase"):
            continue
        level = float(np.median((picture[reached] - found["black"][reached]) / light[reached]))
        if not HALF_WAY[0] < level < HALF_WAY[1]:
            raise UnreadableFile(
                f"{path}: the pattern is not seen: {level:.0%} of white's light on the middle lit pixel, where about "
                f"50% is expected ({1 - reached.mean():.0%} of the picture lies in shade); take it again"
            )

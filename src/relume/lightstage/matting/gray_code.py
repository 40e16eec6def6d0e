"""Pictures of a subject before striped backdrops: which stripes each showed, read from a folder and checked.

A backdrop is `texels` wide and high; u counts from its left edge to the right and v from its upper edge down, as the
camera sees it with nothing in the way. Stripes of axis "x" change along u. In Gray code of n levels texel i has the
code i ⊕ (i ≫ 1), and level 0, the coarsest, shows its highest bit: level 0 is white in the right or lower half. Plain
stripes of a width begin with black. Pictures are scene-linear (Debevec et al. 2000, appendix; Zongker et al. 1999).
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import UnreadableFile, warn
from relume.image import files
from relume.image.colour_space import decoded
from relume.image.radiance import RadianceMap

_NAME = re.compile(r"(gray|stripes)_([xy])(\d+)(_inverse)?")
_LIST = "patterns.json"


@dataclass(frozen=True, eq=False)
class Stripes:
    """What a backdrop showed: texels of one axis, white or black, the same all along the other axis.

    axis : "x" where stripes change from left to right, "y" where from top to bottom
    white : (texels,) bool
    name : for messages
    """

    axis: str
    white: np.ndarray
    name: str

    @property
    def edges(self) -> int:
        """How often white and black meet."""
        return int(np.count_nonzero(self.white[1:] != self.white[:-1]))


def gray_stripes(axis: str, level: int, texels: int, *, inverse: bool = False) -> Stripes:
    """Stripes of the binary-reflected Gray code of `texels` places; level 0 is the coarsest.

    inverse : black and white exchanged
    Raises ValueError for a level the code does not have.
    """
    levels = max(texels - 1, 0).bit_length()
    name = f"gray_{axis}{level}{'_inverse' * inverse}"
    if not 0 <= level < levels:
        raise ValueError(f"{name}: a Gray code of {texels} texels has levels 0 … {levels - 1}")
    place = np.arange(texels)
    bit = ((place ^ (place >> 1)) >> (levels - 1 - level)) & 1
    return Stripes(axis, bit.astype(bool) ^ inverse, name)


def plain_stripes(axis: str, width: int, texels: int, *, inverse: bool = False) -> Stripes:
    """Black and white stripes in turns, each `width` texels, the first one black; `inverse` exchanges them.

    Raises ValueError for a width that leaves a single stripe.
    """
    name = f"stripes_{axis}{width}{'_inverse' * inverse}"
    if not 0 < width < texels:
        raise ValueError(f"{name}: stripes {width} texels wide on a backdrop of {texels}; expected 1 … {texels - 1}")
    return Stripes(axis, (np.arange(texels) // width % 2).astype(bool) ^ inverse, name)


@dataclass(frozen=True, eq=False)
class Patterns:
    """Pictures of one subject before a black, a white and striped backdrops.

    black, white : (H, W, 3) float32, scene-linear
    pictures : (K, H, W, 3) float32
    stripes : K of them, of both axes; those of one axis have one number of texels
    """

    black: np.ndarray
    white: np.ndarray
    pictures: np.ndarray
    stripes: tuple[Stripes, ...]

    def __post_init__(self) -> None:
        for axis in "xy":
            counts = {len(stripe.white) for stripe in self.stripes if stripe.axis == axis}
            if len(counts) != 1:
                found = " and ".join(str(count) for count in sorted(counts)) or "no stripes at all"
                raise ValueError(f"along {axis} the backdrop has {found} texels; expected one number of texels")
        shape = self.white.shape
        if self.black.shape != shape or self.pictures.shape != (len(self.stripes), *shape):
            raise ValueError(
                f"{len(self.stripes)} stripe patterns, but pictures {self.pictures.shape} and black "
                f"{self.black.shape}; expected one of {shape} for each"
            )
        for name, picture in (("black", self.black), ("white", self.white), ("a striped one", self.pictures)):
            if not np.all(np.isfinite(picture)):
                raise ValueError(f"the picture before the backdrop ({name}) holds NaN or infinity; give finite pixels")
        if not np.median(self.white) > np.median(self.black):
            raise ValueError(
                "the picture before white is no brighter than that before black; check which is which, and the exposure"
            )

    @property
    def texels(self) -> tuple[int, int]:
        """The backdrop's texels across and down."""
        across, down = (next(len(s.white) for s in self.stripes if s.axis == axis) for axis in "xy")
        return across, down


def disorder(patterns: Patterns) -> str:
    """What shows that pictures and stripes do not belong together, in one line; "" where nothing does.

    Finer stripes have more edges: along rows for x, along columns for y. Stripes too fine for the camera, whose
    pictures are grey, are left out. Of the coarsest few may be in sight; of them neighbouring pixels should show
    neighbouring places, and in another order they should not do so better.
    """
    middle = 0.5 * (patterns.white + patterns.black).sum(axis=2)
    contrast = 0.5 * (patterns.white - patterns.black).sum(axis=2)
    signs = [
        np.where(np.abs(seen) > 0.5 * contrast, np.sign(seen), 0).astype(np.int8)
        for seen in (picture.sum(axis=2) - middle for picture in patterns.pictures)
    ]
    for axis in "xy":
        along, across = (1, 0) if axis == "x" else (0, 1)
        changes = [
            (stripe.edges, _edges(sign, along), _edges(sign, across), stripe.name)
            for stripe, sign in sorted(zip(patterns.stripes, signs, strict=True), key=lambda pair: pair[0].edges)
            if stripe.axis == axis and np.count_nonzero(sign) > 0.6 * sign.size
        ]
        if 1.5 * sum(entry[1] for entry in changes) < sum(entry[2] for entry in changes):
            other = "top to bottom" if axis == "x" else "left to right"
            return f"the stripes of {axis} ({changes[0][3]} and others) change from {other}; exchange x and y"
        for coarse, fine in pairwise(changes):
            if fine[0] > coarse[0] >= _MANY and fine[1] < 0.75 * coarse[1]:
                return (
                    f"{fine[3]} shows fewer stripes than {coarse[3]}, but should show more; are they out of order? "
                    "Gray code begins with the coarsest, level 0"
                )
        if wrong := _coarse_disorder(patterns, signs, axis):
            return wrong
    return ""


_MANY, _COARSE = 4, 4
"""Edges from which counting them gives the order, and how many of the coarsest patterns are tried in other orders."""


def _coarse_disorder(patterns: Patterns, signs: list[np.ndarray], axis: str) -> str:
    """What shows that the coarsest patterns of an axis were exchanged; "" where nothing does."""
    own = [index for index, stripe in enumerate(patterns.stripes) if stripe.axis == axis]
    own = sorted(own, key=lambda index: patterns.stripes[index].edges)[:_COARSE]
    weights = 1 << np.arange(len(own))
    codes = weights @ np.stack([patterns.stripes[index].white for index in own])
    cells = {code: np.flatnonzero(codes == code) for code in np.unique(codes)}
    if any(np.ptp(texels) >= len(texels) for texels in cells.values()):
        return ""  # these alone name no places
    places = np.full(1 << len(own), -10.0 * len(codes))  # a code of no place is far from all
    for code, texels in cells.items():
        places[code] = texels.mean()
    apart = 1.5 * max(len(texels) for texels in cells.values())
    seen = np.stack([signs[index] for index in own])

    def jumps(order: tuple[int, ...]) -> int:
        found = np.where(np.all(seen != 0, axis=0), places[np.tensordot(weights, seen[list(order)] > 0, 1)], np.nan)
        return sum(int(np.count_nonzero(np.abs(np.diff(found, axis=which)) > apart)) for which in (0, 1))

    given = tuple(range(len(own)))
    best = min(permutations(given), key=jumps)  # the given order, where others are no better
    if jumps(given) > 2 * jumps(best) + 0.1 * min(seen.shape[1:]):
        names = [patterns.stripes[own[place]].name for place in given]
        better = [patterns.stripes[own[place]].name for place in best]
        return (
            f"the pictures of {', '.join(names)} fit together better as {', '.join(better)}; are they out of order? "
            "Gray code begins with the coarsest, level 0"
        )
    return ""


def _edges(signs: np.ndarray, axis: int) -> int:
    """How often signs (H, W) change along an axis; zeros are passed over."""
    lines = signs if axis == 1 else signs.T
    last = np.maximum.accumulate(np.where(lines != 0, np.arange(lines.shape[1]), 0), axis=1)
    filled = np.take_along_axis(lines, last, axis=1)
    return int(np.count_nonzero(filled[:, 1:] * filled[:, :-1] < 0))


def read_patterns(folder: str | os.PathLike[str]) -> Patterns:
    """The pictures of a folder: `black`, `white`, `gray_x0` … and `gray_y0` …, or as its patterns.json names them.

    folder : of the pictures

    By name: `gray_x0` … are the levels of a Gray code, the coarsest first, over 2^levels texels. `stripes_x16` has
    plain stripes 16 texels wide, over the Gray code's texels or else twice the widest stripe. `_inverse` behind either
    exchanges black and white. Any picture format will do. patterns.json is {"texels": [across, down], "black": FILE,
    "white": FILE, "patterns": [{"file": FILE, "stripes": "gray", "axis": "x", "level": 0, "inverse": false}, {"file":
    FILE, "stripes": "plain", "axis": "y", "width": 16}, …]}. Photographs (JPEG, PNG, TIFF) are taken as sRGB, with a
    warning.

    Raises UnreadableFile, in one line, for what is missing, damaged, of two sizes or out of order.
    """
    place = Path(folder)
    if not place.is_dir():
        raise UnreadableFile(f"{place}: no folder; give the one with the pictures before the backdrops")
    black, white, listed = _listed(place) if (place / _LIST).is_file() else _named(place)
    stripes = tuple(stripe for stripe, _ in listed)
    pictures = _pictures([black, white, *(path for _, path in listed)])
    try:
        patterns = Patterns(pictures[0], pictures[1], pictures[2:], stripes)
        wrong = disorder(patterns)
    except ValueError as error:
        raise UnreadableFile(f"{place}: {error}") from None
    if wrong:
        raise UnreadableFile(f"{place}: {wrong}")
    return patterns


def _pictures(paths: Sequence[Path]) -> np.ndarray:
    """All pictures (N, H, W, 3) float32, scene-linear."""
    pictures, encoded = [], False
    for path in paths:
        picture, photograph = linear_picture(path, pictures[0].shape[:2] if pictures else None, paths[0].name)
        pictures.append(picture)
        encoded |= photograph
    if encoded:
        warn(
            f"{paths[0].parent}: photographs, taken as sRGB, or as their profiles say; merged EXR files would be exact"
        )
    return np.stack(pictures)


def linear_picture(path: Path, shape: tuple[int, int] | None = None, first: str = "") -> tuple[np.ndarray, bool]:
    """A picture (H, W, 3) float32, scene-linear, and whether it is a photograph, whose white is 1.

    shape : rows and columns that it must have, those of the picture `first`
    Raises UnreadableFile.
    """
    image = files.read(path)
    encoded = not isinstance(image, RadianceMap)
    picture = decoded(image).astype(np.float32) if encoded else image.radiance
    rows, columns = picture.shape[:2]
    if shape is not None and shape != (rows, columns):
        raise UnreadableFile(
            f"{path}: {columns}×{rows} pixels, but {first} has {shape[1]}×{shape[0]}; all pictures need one size"
        )
    return picture, encoded


def _named(folder: Path) -> tuple[Path, Path, list[tuple[Stripes, Path]]]:
    """The pictures before black, white and stripes, by their names."""
    found: dict[str, Path] = {}
    for path in sorted(folder.iterdir()):
        if path.stem in ("black", "white") or _NAME.fullmatch(path.stem):
            if path.stem in found:
                raise UnreadableFile(f"{path}: {found[path.stem].name} is there too; keep one of them")
            found[path.stem] = path
    for need in ("black", "white"):
        if need not in found:
            raise UnreadableFile(f'{folder}: no picture "{need}", of the subject before a {need} backdrop; add it')
    named = [(match, path) for stem, path in found.items() if (match := _NAME.fullmatch(stem))]
    listed = []
    for axis in "xy":
        own = [(match, path) for match, path in named if match[2] == axis]
        levels = {int(match[3]) for match, _ in own if match[1] == "gray"}
        missing = sorted(set(range(max(levels, default=-1) + 1)) - levels)
        if missing or not own:
            raise UnreadableFile(f"{folder}: no picture gray_{axis}{missing[0] if missing else 0}; take or name it")
        texels = 1 << len(levels) if levels else 2 * max(int(match[3]) for match, _ in own)
        for match, path in own:
            kind = gray_stripes if match[1] == "gray" else plain_stripes
            try:
                listed.append((kind(axis, int(match[3]), texels, inverse=bool(match[4])), path))
            except ValueError as error:
                raise UnreadableFile(f"{path}: {error}") from None
    return found["black"], found["white"], listed


def _listed(folder: Path) -> tuple[Path, Path, list[tuple[Stripes, Path]]]:
    """The same, as a patterns.json names them."""
    path = folder / _LIST
    try:
        table = json.loads(path.read_text("utf-8"))
        texels = dict(zip("xy", (int(count) for count in table["texels"]), strict=True))
        listed = [(_entry(entry, texels), folder / entry["file"]) for entry in table["patterns"]]
        return folder / table["black"], folder / table["white"], listed
    except KeyError as error:
        raise UnreadableFile(f"{path}: the key {error} is missing; add it") from None
    except (OSError, TypeError, ValueError) as error:
        raise UnreadableFile(f"{path}: not a list of patterns ({error}); see the example in the manual") from None


def _entry(entry: Mapping[str, Any], texels: Mapping[str, int]) -> Stripes:
    axis, inverse = entry["axis"], bool(entry.get("inverse", False))
    if axis not in texels:
        raise ValueError(f'axis "{axis}"; expected "x" or "y"')
    if entry["stripes"] == "gray":
        return gray_stripes(axis, int(entry["level"]), texels[axis], inverse=inverse)
    if entry["stripes"] == "plain":
        return plain_stripes(axis, int(entry["width"]), texels[axis], inverse=inverse)
    raise ValueError(f'stripes "{entry["stripes"]}"; expected "gray" or "plain"')

"""A bracket: photographs of one static scene from one place, differently exposed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.errors import NotABracket
from relume.image import files
from relume.image.photograph import Exposure, Photograph


@dataclass(frozen=True, eq=False)
class Bracket:
    """Photographs sorted from the least to the most exposed; one photograph is a bracket too."""

    photographs: tuple[Photograph, ...]

    def __post_init__(self) -> None:
        photographs = self.photographs
        if not photographs:
            raise NotABracket("no photographs were given; name at least one file")
        for photograph in photographs:
            if photograph.exposure is None:
                raise NotABracket(
                    f"{photograph.name}: no exposure time in its EXIF; give one per photograph with --times"
                )
            if photograph.size != photographs[0].size or photograph.pixels.dtype != photographs[0].pixels.dtype:
                raise NotABracket(
                    f"{photograph.name} is {_form(photograph)}, {photographs[0].name} is {_form(photographs[0])}; "
                    "a bracket needs photographs of one size and depth"
                )
        for attribute in ("f_number", "iso"):
            known = [getattr(p.exposure, attribute) is not None for p in photographs]
            if any(known) and not all(known):
                raise NotABracket(
                    f"{photographs[known.index(False)].name}: no {attribute} in its EXIF while other frames have one; "
                    "give all exposures with --times"
                )
        ordered = sorted(photographs, key=lambda p: (_factor(p), p.name))
        object.__setattr__(self, "photographs", tuple(ordered))

    @property
    def exposures(self) -> np.ndarray:
        """Pixel exposure per unit of radiance of each photograph, rising (`Exposure.factor`)."""
        return np.array([_factor(p) for p in self.photographs])

    @property
    def focal_length(self) -> float | None:
        """Of the lens, in pixels; None where the photographs tell none."""
        return next((p.focal_length for p in self.photographs if p.focal_length is not None), None)

    @property
    def name(self) -> str:
        """The photographs' names, short, for messages."""
        names = [p.name for p in self.photographs]
        return names[0] if len(names) == 1 else f"{names[0]} … {names[-1]}"


def read_bracket(paths: Sequence[str | Path], *, times: Sequence[float] | None = None) -> Bracket:
    """Read photographs into a bracket.

    paths : image files; their order does not matter
    times : exposure time of each path in seconds, for photographs without EXIF; replaces the whole EXIF exposure,
        because a hand-written list is the stronger word
    Raises UnreadableFile, NotABracket.
    """
    if times is not None and len(times) != len(paths):
        raise NotABracket(f"{len(times)} times were given for {len(paths)} photographs; give one a photograph")
    photographs = [files.read_photograph(path) for path in paths]
    if times is not None:
        photographs = [replace(p, exposure=Exposure(float(t))) for p, t in zip(photographs, times, strict=True)]
    return Bracket(tuple(photographs))


def _factor(photograph: Photograph) -> float:
    assert photograph.exposure is not None  # __post_init__ refused the others
    return photograph.exposure.factor


def _form(photograph: Photograph) -> str:
    return f"{photograph.size[0]}×{photograph.size[1]} {photograph.pixels.dtype}"

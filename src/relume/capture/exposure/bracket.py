"""A bracket: photographs of one static scene from one place, differently exposed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.capture.exposure.exposures import Times, exposed, read_like_times
from relume.errors import NotABracket, warn
from relume.image import files
from relume.image.colour_space import first_apart, name_of
from relume.image.files.formats import read_photographs
from relume.image.files.photographs.remarks import warn_of_crops
from relume.image.photograph import Photograph, RawPhotograph


@dataclass(frozen=True, eq=False)
class Bracket:
    """Photographs sorted from the least to the most exposed; one photograph is a bracket too.

    photographs : of one size, depth and colour space, each with its exposure
    Raises NotABracket for others, and for none.
    """

    photographs: tuple[Photograph, ...]

    def __post_init__(self) -> None:
        photographs = self.photographs
        if not photographs:
            raise NotABracket("no photographs were given; name at least one file")
        for photograph in photographs:
            if photograph.exposure is None:
                raise NotABracket(
                    f"{photograph.name}: no exposure time in its EXIF; give one per photograph with --times"
                    f"{read_like_times(photographs)}"
                )
            if photograph.size != photographs[0].size or photograph.pixels.dtype != photographs[0].pixels.dtype:
                raise NotABracket(
                    f"{photograph.name} is {_form(photograph)}, {photographs[0].name} is {_form(photographs[0])}; "
                    "a bracket needs photographs of one size and depth; `relume probe` lays crops of a mirrored ball "
                    "on one another"
                )
        if other := first_apart(photographs):
            raise NotABracket(
                f"{photographs[other].name} is in {name_of(photographs[other])}, {photographs[0].name} in "
                f"{name_of(photographs[0])}; a bracket needs photographs of one colour space: export all alike"
            )
        require_facts_of_all(photographs)
        ordered = sorted(photographs, key=lambda p: (_factor(p), p.name))
        object.__setattr__(self, "photographs", tuple(ordered))

    @property
    def exposures(self) -> np.ndarray:
        """Pixel exposure per unit of radiance of each photograph, rising (`Exposure.factor`)."""
        return np.array([_factor(p) for p in self.photographs])

    @property
    def exposure_table(self) -> tuple[FrameFacts, ...]:
        """What is known of each exposure, from the least to the most exposed."""
        stops = np.log2(self.exposures / self.exposures[0])
        known = [(p.name, p.exposure, float(s)) for p, s in zip(self.photographs, stops, strict=True) if p.exposure]
        return tuple(FrameFacts(name, e.seconds, e.f_number, e.iso, s, e.source) for name, e, s in known)

    @property
    def focal_length(self) -> float | None:
        """The focal length of the lens, in pixels; None where the photographs hold none."""
        return next((p.focal_length for p in self.photographs if p.focal_length is not None), None)

    @property
    def name(self) -> str:
        """The photographs' names, short, for messages."""
        names = [p.name for p in self.photographs]
        return names[0] if len(names) == 1 else f"{names[0]} … {names[-1]}"


@dataclass(frozen=True)
class FrameFacts:
    """What is known of the exposure of one photograph of a bracket: a line of its exposure table.

    name : the file
    seconds, f_number, iso : as in `Exposure`; None where unknown
    stops : above the least exposed photograph of the bracket
    source : where it comes from: "given", "sidecar", "EXIF", "name" or "estimated"
    """

    name: str
    seconds: float
    f_number: float | None
    iso: float | None
    stops: float
    source: str


def read_bracket(
    paths: Sequence[str | Path],
    *,
    times: Times = None,
    times_from_names: bool = False,
    ignore: tuple[int, int, int] | None = None,
    true_powers: bool = False,
    sidecars: bool = True,
) -> Bracket:
    """Read photographs into a bracket, each with the exposure of the strongest source that has it.

    The order of the sources is fixed: `times` or the names, a list beside the photographs, EXIF, the pixels.

    paths : image files; their order does not matter but for `times` in seconds
    times : exposure time of each path in seconds, or the path of a file that lists them; replaces the whole EXIF
        exposure, because a hand-written list is the stronger word
    times_from_names : read the times from the files' names, like 1_160.jpg or cp_t160.jpg for 1/160 s and 0.25s.jpg;
        not the default, as numbers in names mostly count photographs. They too replace the whole EXIF exposure
    ignore : red, green and blue of pixels that are not part of the picture, as stored in the file (0 to 255, or to
        65535): the pure blue (0, 0, 255) of the memorial church's borders. Exactly this colour is meant, so give it for
        losslessly stored photographs only
    true_powers : take marked shutter speeds for the powers of two that they stand for; `true_shutter` says why not
        always
    sidecars : look for a list of exposures beside the photographs

    A photograph that is there twice, pixel for pixel and with the same exposure, is kept once, with a warning.
    Raises UnreadableFile, NotABracket. Warns of exposures that are uncertain.
    """
    if isinstance(paths, str | Path):
        raise NotABracket(f'{paths}: one path; give a list of photographs, like sorted(glob.glob("folder/*.jpg"))')
    photographs = read_photographs(paths)
    warn_of_crops(photographs)
    if ignore is not None:
        photographs = _ignoring(photographs, ignore)
    speeds = None
    if true_powers:
        facts = [files.read_facts(path) for path in paths]
        speeds = {f.name: f.shutter_speed for f in facts}
    photographs = exposed(
        photographs, times=times, times_from_names=times_from_names, sidecars=sidecars, shutter_speeds=speeds
    )
    return Bracket(_once_each(photographs))


def require_facts_of_all(photographs: Sequence[Photograph | RawPhotograph]) -> None:
    """Refuse photographs of which only some hold an aperture, or an ISO: an unknown one counts as 1, or as 100."""
    for attribute in ("f_number", "iso"):
        known = [getattr(p.exposure, attribute) is not None for p in photographs]
        if any(known) and not all(known):
            raise NotABracket(
                f"{photographs[known.index(False)].name}: no {attribute} in its EXIF while other frames have one; "
                "give all exposures with --times"
            )


def require_known_exposures(brackets: Iterable[Bracket]) -> None:
    """Refuse brackets whose exposures were only estimated where several have to lie on one scale."""
    for bracket in brackets:
        for photograph in bracket.photographs:
            if photograph.exposure is not None and photograph.exposure.source == "estimated":
                raise NotABracket(
                    f"{bracket.name}: no exposure times in the EXIF, so the scale of these photographs is not that of "
                    f"the others; give their times{read_like_times(bracket.photographs)}"
                )


def same_pixels(first: Photograph, second: Photograph) -> bool:
    """Whether two photographs are one, pixel for pixel."""
    # A few pixels distinguish nearly all pairs; only copies are compared whole.
    return np.array_equal(first.pixels[::37, ::37], second.pixels[::37, ::37]) and np.array_equal(
        first.pixels, second.pixels
    )


def _ignoring(photographs: list[Photograph], colour: tuple[int, int, int]) -> list[Photograph]:
    for photograph in photographs:
        if not 0 <= min(colour) <= max(colour) <= np.iinfo(photograph.pixels.dtype).max:
            raise NotABracket(
                f"{photograph.name}: no {photograph.pixels.dtype} pixel has the colour {','.join(map(str, colour))}; "
                f"give values from 0 to {np.iinfo(photograph.pixels.dtype).max}"
            )
    found = [np.all(p.pixels == np.array(colour), axis=2) for p in photographs]
    if photographs and not any(outside.any() for outside in found):
        warn(
            f"{photographs[0].name} and the others have no pixel of the colour {','.join(map(str, colour))} to ignore; "
            "give it as it is stored in the files"
        )
    return [without(p, outside) if outside.any() else p for p, outside in zip(photographs, found, strict=True)]


def without(photograph: Photograph, outside: np.ndarray) -> Photograph:
    """The photograph with more of it, (H, W) bool, marked as outside the picture."""
    return replace(photograph, outside=outside if photograph.outside is None else outside | photograph.outside)


def _once_each(photographs: list[Photograph]) -> tuple[Photograph, ...]:
    kept: list[Photograph] = []
    for photograph in photographs:
        twin = next((p for p in kept if p.exposure == photograph.exposure and same_pixels(p, photograph)), None)
        if twin is None:
            kept.append(photograph)
        else:
            warn(f"{photograph.name}: pixel for pixel {twin.name}, so it is left out; take one of them away")
    return tuple(kept)


def _factor(photograph: Photograph) -> float:
    assert photograph.exposure is not None  # __post_init__ refused the others
    return photograph.exposure.factor


def _form(photograph: Photograph) -> str:
    return f"{photograph.size[0]}×{photograph.size[1]} {photograph.pixels.dtype}"

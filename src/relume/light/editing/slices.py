"""The way of a radiance map through a paint program: an 8- or 16-bit slice out, its changed pixels back."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from relume.errors import GatheredDoubts, UnreadableFile, warn
from relume.image import files
from relume.image.colour import luminance
from relume.image.colour_space import colour_space_of, name_of
from relume.image.ldr_slices import (
    DOUBTFUL_PLACES,
    DOUBTFUL_SHARE,
    Repainted,
    Replaced,
    Scaled,
    Slice,
    fingerprint,
    fitting_stops,
    painted,
)
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.image.resizing import cropped
from relume.light.editing.edits import energy


def slice_sidecar(picture: str | os.PathLike[str]) -> Path:
    """Where a slice's description lies: beside it, where no paint program touches it.

    picture : the slice's file
    """
    picture = Path(picture)
    return picture.with_name(picture.name + ".json")


def write_slice(
    picture: RadianceMap,
    out: str | os.PathLike[str],
    stops: float | None = None,
    bits: int = 8,
    box: tuple[int, int, int, int] | None = None,
) -> dict[str, object]:
    """Write one exposure of a map as a .png to paint on, and how it was made beside it; facts for a person.

    picture : the map
    out : the .png
    stops : radiance 2^−stops is white; chosen to fit what is written unless given
    bits : 8 or 16 a channel; 8, which every paint program reads, unless given
    box : the rectangle of the map that is written: left, top, width and height in pixels; all of it unless given
    Raises ValueError for a rectangle that is not in the map.
    """
    out = Path(out)
    part = picture if box is None else cropped(picture, *box)
    cut = Slice(fitting_stops(part) if stops is None else stops, bits, fingerprint(picture), box)
    photograph = cut.photograph(part)
    files.write(out, photograph)
    files.write_text(slice_sidecar(out), cut.to_json() + "\n")
    white, black = (float((photograph.pixels == code).any(-1).mean()) for code in (2**bits - 1, 0))
    return {
        "written": [str(out), str(slice_sidecar(out))],
        "stops": cut.stops,
        "white": cut.white,
        "unit": picture.unit,
        "share at white": white,
        "share at black": black,
        **({} if box is None else {"crop": list(box)}),
    }


@dataclass(frozen=True)
class PaintedSlice:
    """A slice that was painted on.

    path : the painted picture: PNG, TIFF or JPEG
    original : the slice before painting; made again from the map unless given
    stops : of the slice; as the description beside it says unless given
    bits : of the slice
    scale : multiply the map by painted ÷ before, so that lights beyond white stay lights; else changed pixels become
        what was painted, white at most
    tolerance : difference of pixel values that counts as none; 8 or more for a JPEG
    """

    path: Path
    original: Path | None = None
    stops: float | None = None
    bits: int = 8
    scale: bool = False
    tolerance: int = 0

    def description(self) -> Slice:
        """How the slice was made; raises UnreadableFile where nothing says it."""
        if self.stops is not None:
            return Slice(self.stops, self.bits)
        beside = [slice_sidecar(path) for path in (self.original, self.path) if path is not None]
        for path in beside:
            if path.is_file():
                try:
                    return Slice.from_json(path.read_text(encoding="utf-8"))
                except (OSError, ValueError) as error:
                    raise UnreadableFile(f"{path}: {error}; give --slice STOPS and remove it") from None
        raise UnreadableFile(
            f"{self.path}: no {beside[-1].name} beside it gives its exposure; give --original, the slice that was "
            "written, or --slice STOPS"
        )


@dataclass(frozen=True, eq=False)
class PaintedOver:
    """A map with what was painted.

    picture : the result
    facts : for a person
    doubts : where most pixels changed
    """

    picture: RadianceMap
    facts: dict[str, object]
    doubts: tuple[str, ...]


def paint_over(picture: RadianceMap, slice_: PaintedSlice, name: str = "the map") -> PaintedOver:
    """The map with the pixels that were changed in a slice, and no others.

    picture : the map
    slice_ : what was painted on, as it is read back
    name : of the map, for messages

    Raises UnreadableFile for a slice of another map, with transparency or in another colour space than sRGB.
    """
    cut = slice_.description()
    if slice_.original is None and cut.of and cut.of != fingerprint(picture):
        raise UnreadableFile(
            f"{name}: not the map that {slice_.path} was cut from, or changed since; give that map, or the slice "
            "before painting as --original"
        )
    part = picture if cut.box is None else cropped(picture, *cut.box)
    result = painted(
        part,
        _opaque_srgb(slice_.path),
        cut,
        original=None if slice_.original is None else _opaque_srgb(slice_.original),
        method=Scaled() if slice_.scale else Replaced(),
        tolerance=slice_.tolerance,
    )
    _warn(result, picture, scaled=slice_.scale)
    whole = result.picture if cut.box is None else _put_back(picture, result.picture, cut.box)
    facts: dict[str, object] = {
        "pixels changed": int(result.changed.sum()),
        "share changed": result.share,
        "places changed": result.places,
        **energy(picture, "before"),
        **energy(whole, "after"),
    }
    doubts = ()
    if result.share > DOUBTFUL_SHARE:
        doubts = (
            f"{slice_.path}: {100 * result.share:.0f} % of the pixels changed; if a JPEG or a colour conversion did "
            "that, save a PNG in sRGB, or give --tolerance 8 or the --original saved by the same program",
        )
    return PaintedOver(whole, facts, doubts)


def _put_back(picture: RadianceMap, part: RadianceMap, box: tuple[int, int, int, int]) -> RadianceMap:
    """The map with a rectangle of it as `part` has it, all planes."""
    left, top, width, height = box
    planes: dict[str, np.ndarray] = {}
    for name in ("radiance", "variance", "clipped"):
        whole, new = getattr(picture, name), getattr(part, name)
        if whole is not None and new is not None:
            planes[name] = whole.copy()
            planes[name][top : top + height, left : left + width] = new
    return replace(picture, **planes)


def _opaque_srgb(path: Path) -> Photograph:
    """A painted file; raises UnreadableFile where it is transparent or not sRGB."""
    with GatheredDoubts() as gathered:
        photograph = files.read_photograph(path)
    for doubt in gathered.doubts:
        text = doubt.line
        if "alpha is left out" in text or "colour profile" in text:
            raise UnreadableFile(f"{text}; flatten it and save it in sRGB, as the way back needs")
        warn(text, doubt.effect)
    if colour_space_of(photograph) is not None:
        raise UnreadableFile(f"{path}: in {name_of(photograph)}; save it in sRGB, as the way back needs")
    return photograph


def _warn(result: Repainted, picture: RadianceMap, *, scaled: bool) -> None:
    """Warn of what the paint program could not show."""
    if not result.changed.any():
        warn("no pixel was changed; the map is written as it was")
    if result.above_white and result.lost > 0 and not scaled:
        share = result.lost / max(float(luminance(picture.radiance).sum(dtype="float64")), 1e-300)
        warn(
            f"{result.above_white} changed pixels were brighter than the slice's white and are no more: "
            f"{100 * share:.3g} % of the map's light; --scale keeps lights, a darker --slice shows them"
        )
    if result.places > DOUBTFUL_PLACES:
        warn(
            f"{result.places} separate places changed, as a JPEG leaves them and no brush; save a PNG, or raise "
            "--tolerance"
        )
    if result.painted_white:
        warn(
            f"{result.painted_white} pixels were painted white, the brightest a slice holds; paint on a darker slice "
            "for more"
        )

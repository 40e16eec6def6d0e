"""The round trip of `relume edit` through a program that paints: a slice out, its changed pixels back."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Group, Parameter

from relume.cli.arguments import require_files
from relume.cli.console import OutputOptions, print_facts
from relume.cli.edit_steps import energy
from relume.errors import DoubtfulResult, UnreadableFile

if TYPE_CHECKING:
    from relume.image.ldr_slices import Repainted, Slice
    from relume.image.photograph import Photograph
    from relume.image.radiance import RadianceMap

PAINTER = Group("Or, alone, to a painter and back", sort_key=5)


@Parameter(name="*")
@dataclass(frozen=True)
class Painter:
    """The round trip through a program that paints."""

    cut: Annotated[
        str | None,
        Parameter(
            name="--slice",
            group=PAINTER,
            allow_leading_hyphen=True,
            help="Write one exposure as a .png to paint on: stops, at which radiance 2^−stops is white, or auto. How "
            "it was made is kept in a .json beside it. With --paint: the stops, where that is lost.",
        ),
    ] = None
    bits: Annotated[Literal[8, 16], Parameter(group=PAINTER, help="Of the slice, a channel.")] = 8
    paint: Annotated[
        Path | None,
        Parameter(group=PAINTER, help="A painted slice (PNG, TIFF, JPEG): put only its changed pixels into the map."),
    ] = None
    original: Annotated[
        Path | None,
        Parameter(group=PAINTER, help="The slice before painting, to compare with; else it is made anew from the map."),
    ] = None
    scale: Annotated[
        bool,
        Parameter(
            group=PAINTER,
            negative="",
            help="Multiply the map by painted ÷ before, so that lights beyond white stay lights; else changed pixels "
            "become what was painted, white at most.",
        ),
    ] = False
    tolerance: Annotated[
        int,
        Parameter(group=PAINTER, help="Difference of pixel values that counts as none, 8 or more for a JPEG."),
    ] = 0
    accept: Annotated[bool, Parameter(group=PAINTER, negative="", help="Exit with 0 although most pixels changed.")] = (
        False
    )


def sidecar(picture: Path) -> Path:
    """Where a slice's description lies: beside it, where no painter touches it."""
    return picture.with_name(picture.name + ".json")


def cut_slice(source: Path, out: Path, painter: Painter, dry_run: bool, output: OutputOptions) -> None:
    """Write an exposure of a map and, beside it, how it was made."""
    from relume.image import files
    from relume.image.ldr_slices import Slice, fingerprint, fitting_stops

    word = painter.cut or "auto"
    stops = None if word == "auto" else _stops(word)
    if dry_run:
        print_facts(output, {"would write": [str(out), str(sidecar(out))], "stops": word})
        return
    picture = files.read_radiance(source)
    cut = Slice(fitting_stops(picture) if stops is None else stops, painter.bits, fingerprint(picture))
    photograph = cut.photograph(picture)
    files.write(out, photograph)
    files.write_text(sidecar(out), cut.to_json() + "\n")
    white, black = (float((photograph.pixels == code).any(-1).mean()) for code in (2**painter.bits - 1, 0))
    print_facts(
        output,
        {
            "written": [str(out), str(sidecar(out))],
            "stops": cut.stops,
            "white": cut.white,
            "unit": picture.unit,
            "share at white": white,
            "share at black": black,
        },
    )


def _stops(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise ValueError(f'--slice: "{word}" is no exposure; write stops, like 2 or -3.5, or auto') from None


def paint_back(source: Path, out: Path, painter: Painter, dry_run: bool, output: OutputOptions) -> None:
    """Write the map with what was painted; raises DoubtfulResult where most pixels changed."""
    from relume.image import files
    from relume.image.ldr_slices import DOUBTFUL_SHARE, Replaced, Scaled, painted

    assert painter.paint is not None
    require_files([path for path in (painter.paint, painter.original) if path is not None])
    cut = _description(painter)
    if dry_run:
        print_facts(
            output, {"would write": str(out), "stops": cut.stops, "method": "scale" if painter.scale else "replace"}
        )
        return
    picture = files.read_radiance(source)
    _require_same_map(picture, cut, source, painter)
    result = painted(
        picture,
        _plain(painter.paint),
        cut,
        original=None if painter.original is None else _plain(painter.original),
        method=Scaled() if painter.scale else Replaced(),
        tolerance=painter.tolerance,
    )
    _note_what_no_painter_sees(result, picture, scaled=painter.scale)
    files.write(out, result.picture)
    told: dict[str, object] = {"written": str(out), "pixels changed": int(result.changed.sum())}
    told |= {"share changed": result.share, "places changed": result.places}
    print_facts(output, told | energy(picture, "before") | energy(result.picture, "after"))
    if result.share > DOUBTFUL_SHARE and not painter.accept:
        raise DoubtfulResult(
            f"{painter.paint}: {100 * result.share:.0f} % of the pixels changed; if a JPEG or a colour conversion did "
            "that, save a PNG in sRGB, or give --tolerance 8 or the --original saved by the same program, else --accept"
        )


def _description(painter: Painter) -> Slice:
    """How the slice was made: by --slice where it tells, else by the file beside the slice."""
    from relume.image.ldr_slices import Slice

    assert painter.paint is not None
    if painter.cut not in (None, "auto"):
        return Slice(_stops(painter.cut), painter.bits)
    beside = [sidecar(path) for path in (painter.original, painter.paint) if path is not None]
    for path in beside:
        if path.is_file():
            try:
                return Slice.from_json(path.read_text(encoding="utf-8"))
            except (OSError, ValueError) as error:
                raise UnreadableFile(f"{path}: {error}; give --slice STOPS and remove it") from None
    raise UnreadableFile(
        f"{painter.paint}: no {beside[-1].name} beside it tells its exposure; give --original, the slice that was "
        "written, or --slice STOPS"
    )


def _require_same_map(picture: RadianceMap, cut: Slice, source: Path, painter: Painter) -> None:
    from relume.image.ldr_slices import fingerprint

    if painter.original is None and cut.of and cut.of != fingerprint(picture):
        raise UnreadableFile(
            f"{source}: not the map that {painter.paint} was cut from, or changed since; give that map, or the slice "
            "before painting as --original"
        )


def _plain(path: Path) -> Photograph:
    """A painted file, opaque and in sRGB; raises UnreadableFile for what else the file says it is."""
    from relume.image import files

    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", UserWarning)
        photograph = files.read_photograph(path)
    for warning in told:
        text = str(warning.message)
        if "alpha is left out" in text or "colour profile" in text:
            raise UnreadableFile(f"{text}; flatten it and save it in sRGB, for the way back knows no other")
        warnings.warn(text, stacklevel=2)
    return photograph


def _note_what_no_painter_sees(result: Repainted, picture: RadianceMap, *, scaled: bool) -> None:
    from relume.image.colour import luminance
    from relume.image.ldr_slices import DOUBTFUL_PLACES

    if not result.changed.any():
        warnings.warn("no pixel was changed; the map is written as it was", stacklevel=2)
    if result.above_white and result.lost > 0 and not scaled:
        share = result.lost / max(float(luminance(picture.radiance).sum(dtype="float64")), 1e-300)
        warnings.warn(
            f"{result.above_white} changed pixels were brighter than the slice's white and are no more: "
            f"{100 * share:.3g} % of the map's light; --scale keeps lights, a darker --slice shows them",
            stacklevel=2,
        )
    if result.places > DOUBTFUL_PLACES:
        warnings.warn(
            f"{result.places} separate places changed, as a JPEG leaves them and no brush; save a PNG, or raise "
            "--tolerance",
            stacklevel=2,
        )
    if result.painted_white:
        warnings.warn(
            f"{result.painted_white} pixels were painted white, the brightest a slice holds; paint on a darker --slice "
            "for more",
            stacklevel=2,
        )

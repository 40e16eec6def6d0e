"""`relume edit`: a radiance map in, the same map cropped, scaled, combined, balanced, blurred, joined, painted over."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Group, Parameter

import relume as rl
from relume.cli.arguments import DryRun, From, mapping_of, require_files, require_suffix
from relume.cli.console import OutputOptions, finish, print_facts, warnings_as_notes
from relume.cli.option_types import Box, Colour, numbers

FRAME = Group("First the frame", sort_key=1)
ARITHMETIC = Group("Then arithmetic, one kind at a time", sort_key=2)
COLOUR = Group("Then gain, then balance", sort_key=3)
BLUR = Group("Then blur", sort_key=4)
JOIN = Group("Then another environment map under it", sort_key=5)
PAINTER = Group("Or, alone, to a painter and back", sort_key=6)
Operands = list[float | tuple[float, float, float] | Path]


def _operands(help: str) -> Parameter:
    return numbers("MAP|NUMBER|R,G,B", like="other.exr, 0.5 or 0.6,0.5,0.4", help=help, group=ARITHMETIC)


@Parameter(name="*")
@dataclass(frozen=True)
class FrameOptions:
    """Which pixels there are."""

    crop: Annotated[
        Box | None, Parameter(group=FRAME, help="Keep this rectangle, in pixels; with --slice, paint on it alone.")
    ] = None
    resize: Annotated[
        str | None,
        Parameter(
            group=FRAME,
            help="WIDTH,HEIGHT, or WIDTH, or like 50%: by area, without ringing, the mean kept; an environment map by "
            "solid angle, its total kept.",
        ),
    ] = None

    def edits(self) -> Iterator[rl.light.Edit]:
        if self.crop is not None:
            yield rl.light.Crop(*self.crop)
        if self.resize is not None:
            yield _resize(self.resize)


@Parameter(name="*")
@dataclass(frozen=True)
class ArithmeticOptions:
    """Arithmetic with other maps of the same size, or constants."""

    add: Annotated[Operands | None, _operands("A map, a number or R,G,B; may repeat.")] = None
    subtract: Annotated[Operands | None, _operands("What comes out negative is set to 0.")] = None
    multiply: Annotated[Operands | None, _operands("A relative map counts as a plain factor.")] = None
    divide: Annotated[Operands | None, _operands("By 0 gives 0, marked.")] = None
    minimum: Annotated[Operands | None, Parameter(name="--min"), _operands("The lesser of both, by channel.")] = None
    maximum: Annotated[Operands | None, Parameter(name="--max"), _operands("The greater of both, by channel.")] = None
    average: Annotated[Operands | None, _operands("Another map; again for each: the mean of all.")] = None
    signed: Annotated[
        bool, Parameter(group=ARITHMETIC, negative="", help="Keep negative results, as of a difference; in an .exr.")
    ] = False

    def edits(self) -> Iterator[rl.light.Edit]:
        kinds = {
            "add": self.add,
            "subtract": self.subtract,
            "multiply": self.multiply,
            "divide": self.divide,
            "min": self.minimum,
            "max": self.maximum,
            "average": self.average,
        }
        given = {word: operands for word, operands in kinds.items() if operands}
        if len(given) > 1:
            raise ValueError(f"{_joined(given)}: their order would matter; give one kind in a call")
        if not given and self.signed:
            raise ValueError("--signed is for arithmetic; give --subtract or another too")
        for word, operands in given.items():
            require_files([each for each in operands if isinstance(each, Path)])
            yield rl.light.Arithmetic(rl.light.Operation(word), tuple(operands), self.signed)


@Parameter(name="*")
@dataclass(frozen=True)
class ColourOptions:
    """Gain and white balance."""

    stops: Annotated[
        float | None,
        Parameter(group=COLOUR, allow_leading_hyphen=True, help="Brighten by so many stops; negative darkens."),
    ] = None
    gain: Annotated[float | None, Parameter(group=COLOUR, help="Multiply by this factor.")] = None
    grey: Annotated[
        tuple[int, int] | tuple[int, int, float] | None,
        numbers(
            "X,Y[,RADIUS]",
            like="320,240 or 320,240,8",
            group=COLOUR,
            help="Make this place (5 pixels round it unless given) neutral, as bright as it is.",
        ),
    ] = None
    balance: Annotated[Colour | None, Parameter(group=COLOUR, help="Multiply the channels by these.")] = None
    temperature: Annotated[
        float | None,
        Parameter(
            group=COLOUR,
            help="Make light of this colour temperature neutral, in K: black bodies below 4000 K, else daylight (CIE).",
        ),
    ] = None

    def edits(self) -> Iterator[rl.light.Edit]:
        _at_most_one({"stops": self.stops, "gain": self.gain})
        _at_most_one({"grey": self.grey, "balance": self.balance, "temperature": self.temperature})
        if self.stops is not None:
            yield rl.light.Gain.of_stops(self.stops)
        if self.gain is not None:
            yield rl.light.Gain(self.gain)
        if self.grey is not None:
            column, row, *radius = self.grey
            yield rl.light.NeutralAt(int(column), int(row), *radius)
        if self.balance is not None:
            yield rl.light.Balance(self.balance)
        if self.temperature is not None:
            yield rl.light.NeutralUnder(self.temperature)


@Parameter(name="*")
@dataclass(frozen=True)
class BlurOptions:
    """Motion blur and soft focus, in linear light."""

    motion: Annotated[
        tuple[float, float] | None,
        numbers(
            "LENGTH[,ANGLE]",
            like="8 or 8,90",
            filled=0.0,
            group=BLUR,
            help="A straight streak, in pixels and degrees anticlockwise.",
        ),
    ] = None
    blur: Annotated[float | None, Parameter(group=BLUR, help="Soft blur of this deviation, in pixels.")] = None
    spin: Annotated[
        float | None,
        Parameter(group=BLUR, help="Motion blur of an environment map: a turn about the vertical, in degrees."),
    ] = None
    spherical_blur: Annotated[
        float | None,
        Parameter(group=BLUR, help="Soft blur of an environment map, on the sphere: its deviation in degrees."),
    ] = None
    glow: Annotated[
        float | None,
        Parameter(group=BLUR, help="Soft focus: blur this share of the light, 0 to 1, and leave the rest sharp."),
    ] = None

    def edits(self) -> Iterator[rl.light.Edit]:
        if self.glow is not None and self.blur is None and self.spherical_blur is None:
            raise ValueError("--glow is a share of what is blurred; give --blur or --spherical-blur too")
        share = 1.0 if self.glow is None else self.glow
        if self.motion is not None:
            yield rl.light.MotionBlur(self.motion[0], math.radians(self.motion[1]))
        if self.blur is not None:
            yield rl.light.SoftBlur(self.blur, share)
        if self.spin is not None:
            yield rl.light.Spin(math.radians(self.spin))
        if self.spherical_blur is not None:
            yield rl.light.SphericalBlur(math.radians(self.spherical_blur), share)


@Parameter(name="*")
@dataclass(frozen=True)
class JoinOptions:
    """A masked join with another environment map, like a photographed sky over a rendered ground."""

    over: Annotated[
        Path | None,
        Parameter(
            group=JOIN,
            help="Lay this environment map over another one, in the same unit; what this one does not show comes from "
            "there.",
        ),
    ] = None
    mask: Annotated[
        Path | None,
        Parameter(
            group=JOIN, help="A grey picture laid out as this map, white where it is seen; the horizon unless given."
        ),
    ] = None
    horizon: Annotated[
        float | None,
        Parameter(group=JOIN, allow_leading_hyphen=True, help="Height from which on this map is seen, degrees; 0."),
    ] = None
    soft: Annotated[
        float | None,
        Parameter(group=JOIN, help="Width of the edge in degrees: 2 at a horizon, 0 by a mask, unless given."),
    ] = None

    def edits(self) -> Iterator[rl.light.Edit]:
        if self.over is None:
            if (self.mask, self.horizon, self.soft) != (None, None, None):
                raise ValueError("--mask, --horizon and --soft say where another map is seen; give --over MAP too")
            return
        if self.mask is not None and self.horizon is not None:
            raise ValueError("--mask and --horizon both say where the other map is seen; give one")
        require_files([path for path in (self.over, self.mask) if path is not None])
        soft = None if self.soft is None else math.radians(self.soft)
        if self.mask is not None:
            yield rl.light.Join(self.over, self.mask, soft or 0.0)
        else:
            default = rl.light.Horizon()
            height = math.radians(self.horizon or 0.0)
            yield rl.light.Join(self.over, rl.light.Horizon(height, default.softness if soft is None else soft))


@Parameter(name="*")
@dataclass(frozen=True)
class PaintOptions:
    """The round trip through a program that paints."""

    cut: Annotated[
        float | Literal["auto"] | None,
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
        Parameter(group=PAINTER, help="The slice before painting, to compare with; else made again from the map."),
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
        int, Parameter(group=PAINTER, help="Difference of pixel values that counts as none, 8 or more for a JPEG.")
    ] = 0
    accept: Annotated[bool, Parameter(group=PAINTER, negative="", help="Exit with 0 although most pixels changed.")] = (
        False
    )

    @property
    def stops(self) -> float | None:
        """The stops of --slice; None for auto."""
        return self.cut if isinstance(self.cut, float) else None


def _resize(text: str) -> rl.light.Resize:
    """A word like "512", "512,256", "512x256" or "50%"."""
    try:
        if text.endswith("%"):
            return rl.light.Resize(percent=float(text[:-1]))
        width, *height = (int(word) for word in text.lower().replace("x", ",").replace("×", ",").split(","))
        return rl.light.Resize(width, *height)
    except (TypeError, ValueError):
        raise ValueError(f'--resize: "{text}" is not a size; write it like 512, 512,256 or 50%') from None


def _joined(options: Iterable[str]) -> str:
    return " and ".join(f"--{option}" for option in options)


def _at_most_one(options: dict[str, object]) -> None:
    given = {option: value for option, value in options.items() if value is not None}
    if len(given) > 1:
        raise ValueError(f"{_joined(given)} contradict each other; give one")


MAPS = (".exr", ".hdr")


def edit(
    light: Annotated[Path, Parameter(name="MAP", help="The radiance map, .exr, .hdr or another format.")],
    /,
    *,
    out: Annotated[Path, Parameter(alias="-o", help="The map to write, .exr or .hdr; with --slice a .png.")],
    from_: From = None,
    frame: FrameOptions = FrameOptions(),
    arithmetic: ArithmeticOptions = ArithmeticOptions(),
    colour: ColourOptions = ColourOptions(),
    blur: BlurOptions = BlurOptions(),
    join: JoinOptions = JoinOptions(),
    painter: PaintOptions = PaintOptions(),
    dry_run: DryRun = False,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Edit a radiance map in linear light: crop, resize, arithmetic, gain, balance, blur, join, in order, or paint.

    Edits may be given together; they are done in the order in which they stand here, whatever the order of the
    words. Variance, marks of clipped pixels, unit and attributes go along. A map whose file stores its mapping is an
    environment map: it is resized and blurred on the sphere. --slice writes an 8- or 16-bit exposure for any paint
    program, and --paint puts the pixels that were changed there, and no others, back into the map.
    """
    with warnings_as_notes(output):
        require_files([light])
        edits = [*frame.edits(), *arithmetic.edits(), *colour.edits(), *blur.edits(), *join.edits()]
        alone = "--paint" if painter.paint is not None else "--slice" if painter.cut is not None else ""
        # A crop beside a slice says which part of the map is painted on; the way back knows it.
        part = alone == "--slice" and frame == FrameOptions(crop=frame.crop)
        _check(painter, alone, edits[1:] if part and frame.crop is not None else edits)
        if from_ is not None and alone:
            raise ValueError(f"--from is for edits of environment maps; {alone} needs none")
        require_suffix(out, *([".png"] if alone == "--slice" else MAPS))
        if alone == "--slice" and dry_run:
            paths = [str(out), str(rl.light.slice_sidecar(out))]
            print_facts(output, {"would write": paths, "stops": painter.cut})
        elif alone == "--slice":
            picture = rl.read_radiance(light)
            print_facts(output, rl.light.write_slice(picture, out, painter.stops, painter.bits, frame.crop))
        elif alone == "--paint":
            _paint_over(light, out, painter, dry_run, output)
        else:
            mapping = mapping_of(from_)
            if dry_run:
                print_facts(output, {"would write": str(out), "edits": [str(each) for each in edits]})
                return
            edited = rl.light.edit(rl.read_radiance(light), edits, mapping)
            rl.write(out, edited.picture)
            print_facts(output, {"written": str(out), **edited.facts()})


def _paint_over(light: Path, out: Path, painter: PaintOptions, dry_run: bool, output: OutputOptions) -> None:
    assert painter.paint is not None
    require_files([path for path in (painter.paint, painter.original) if path is not None])
    painted = rl.light.PaintedSlice(
        painter.paint, painter.original, painter.stops, painter.bits, painter.scale, painter.tolerance
    )
    if dry_run:
        method = "scale" if painter.scale else "replace"
        print_facts(output, {"would write": str(out), "stops": painted.description().stops, "method": method})
        return
    result = rl.light.paint_over(rl.read_radiance(light), painted, str(light))
    rl.write(out, result.picture)
    print_facts(output, {"written": str(out), **result.facts})
    finish(output, result.doubts, accept=painter.accept)


def _check(painter: PaintOptions, alone: str, edits: list[rl.light.Edit]) -> None:
    """Refuse options that contradict each other or would do nothing."""
    if alone and edits:
        raise ValueError(f"{alone} and {edits[0].name}: paint on the map that is finished; give {alone} alone")
    for option, given in (
        ("--original", painter.original is not None),
        ("--scale", painter.scale),
        ("--tolerance", painter.tolerance != 0),
        ("--accept", painter.accept),
    ):
        if given and alone != "--paint":
            raise ValueError(f"{option} is for what was painted; give --paint too")
    if painter.bits != 8 and not alone:
        raise ValueError("--bits is for a slice; give --slice too")
    if not alone and not edits:
        raise ValueError(
            "nothing to do; give --crop, --resize, --add, --stops, --grey, --blur, --over, --slice or another"
        )

"""What `relume edit` is told, turned into steps that are functions from a radiance map to another."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter

from relume.cli import edit_steps
from relume.cli.arguments import numbers, whole
from relume.cli.edit_steps import Step

if TYPE_CHECKING:
    from relume.image.radiance import RadianceMap

FRAME = Group("First the frame", sort_key=1)
ARITHMETIC = Group("Then arithmetic, one kind at a time", sort_key=2)
COLOUR = Group("Then gain, then balance", sort_key=3)
BLUR = Group("Then blur", sort_key=4)


@Parameter(name="*")
@dataclass(frozen=True)
class Frame:
    """Which pixels there are."""

    crop: Annotated[str | None, Parameter(group=FRAME, help="Keep the rectangle X,Y,WIDTH,HEIGHT, in pixels.")] = None
    resize: Annotated[
        str | None,
        Parameter(
            group=FRAME,
            help="WIDTH,HEIGHT, or WIDTH, or like 50%: by area, without ringing, the mean kept; a light map by solid "
            "angle, its total kept.",
        ),
    ] = None

    def steps(self) -> list[Step]:
        """The steps asked for; raises ValueError naming the option."""
        made = []
        if self.crop is not None:
            left, top, width, height = whole(numbers(self.crop, "--crop", 4), "--crop")
            made.append(Step("--crop", f"crop {self.crop}", lambda p: edit_steps.crop(p, left, top, width, height)))
        if self.resize is not None:
            size = _size(self.resize)
            made.append(Step("--resize", f"resize {self.resize}", lambda p: edit_steps.resize(p, *size(p.size))))
        return made


@Parameter(name="*")
@dataclass(frozen=True)
class Arithmetic:
    """Arithmetic with other maps of the same size, or constants."""

    add: Annotated[
        list[str] | None,
        Parameter(
            group=ARITHMETIC, negative="", allow_leading_hyphen=True, help="A map, a number or R,G,B; may repeat."
        ),
    ] = None
    subtract: Annotated[
        list[str] | None,
        Parameter(
            group=ARITHMETIC, negative="", allow_leading_hyphen=True, help="What comes out negative is set to 0."
        ),
    ] = None
    multiply: Annotated[
        list[str] | None,
        Parameter(
            group=ARITHMETIC,
            negative="",
            allow_leading_hyphen=True,
            help="By a relative map is by a plain factor.",
        ),
    ] = None
    divide: Annotated[
        list[str] | None,
        Parameter(group=ARITHMETIC, negative="", allow_leading_hyphen=True, help="By 0 gives 0, marked."),
    ] = None
    minimum: Annotated[
        list[str] | None,
        Parameter(
            name="--min",
            group=ARITHMETIC,
            negative="",
            allow_leading_hyphen=True,
            help="The lesser of both, by channel.",
        ),
    ] = None
    maximum: Annotated[
        list[str] | None,
        Parameter(
            name="--max", group=ARITHMETIC, negative="", allow_leading_hyphen=True, help="The greater, by channel."
        ),
    ] = None
    average: Annotated[
        list[str] | None, Parameter(group=ARITHMETIC, negative="", help="Another map; again for each: the mean of all.")
    ] = None
    signed: Annotated[
        bool, Parameter(group=ARITHMETIC, negative="", help="Keep negative results, as of a difference; in an .exr.")
    ] = False

    def steps(self) -> list[Step]:
        """The step asked for; raises ValueError for two kinds."""
        from relume.image import arithmetic

        kinds = {
            "--add": (self.add, arithmetic.added),
            "--subtract": (self.subtract, arithmetic.subtracted),
            "--multiply": (self.multiply, arithmetic.multiplied),
            "--divide": (self.divide, arithmetic.divided),
            "--min": (self.minimum, arithmetic.darker),
            "--max": (self.maximum, arithmetic.brighter),
            "--average": (self.average, None),
        }
        given = {option: kind for option, kind in kinds.items() if kind[0]}
        if len(given) > 1:
            raise ValueError(f"{' and '.join(given)}: their order would matter; give one kind in a call")
        if not given and self.signed:
            raise ValueError("--signed is for arithmetic; give --subtract or another too")
        return [self._step(option, words or [], verb) for option, (words, verb) in given.items()]

    def _step(self, option: str, words: list[str], verb: Callable[[RadianceMap, object], RadianceMap] | None) -> Step:
        from relume.cli.arguments import require_files
        from relume.image import arithmetic

        constants = [_constant(word) for word in words]
        require_files([Path(word) for word, value in zip(words, constants, strict=True) if value is None])
        if verb is None and any(value is not None for value in constants):
            raise ValueError(f"{option} takes maps; add a constant with --add and halve with --gain")

        def apply(picture: RadianceMap) -> RadianceMap:
            if verb is None:
                picture = arithmetic.average([picture, *map(_map, words)])
            else:
                for word, value in zip(words, constants, strict=True):
                    picture = verb(picture, _map(word) if value is None else value)
            return picture if self.signed else arithmetic.without_negative(picture)

        return Step(option, f"{option.removeprefix('--')} {' '.join(words)}", apply)


@Parameter(name="*")
@dataclass(frozen=True)
class Colour:
    """Gain and white balance."""

    stops: Annotated[
        float | None,
        Parameter(group=COLOUR, allow_leading_hyphen=True, help="Brighten by so many stops; negative darkens."),
    ] = None
    gain: Annotated[float | None, Parameter(group=COLOUR, help="Multiply by this factor.")] = None
    grey: Annotated[
        str | None,
        Parameter(
            group=COLOUR, help="Make the place X,Y[,RADIUS] (5 pixels unless given) neutral, as bright as it is."
        ),
    ] = None
    balance: Annotated[str | None, Parameter(group=COLOUR, help="Multiply the channels by R,G,B.")] = None
    temperature: Annotated[
        float | None,
        Parameter(
            group=COLOUR,
            help="Make light of this colour temperature neutral, in K: black bodies below 4000 K, else daylight (CIE).",
        ),
    ] = None

    def steps(self) -> list[Step]:
        """The steps asked for; raises ValueError for two gains or two balances."""
        _at_most_one({"--stops": self.stops, "--gain": self.gain}, "tell the gain")
        balances = {"--grey": self.grey, "--balance": self.balance, "--temperature": self.temperature}
        _at_most_one(balances, "tell the balance")
        made = []
        if self.stops is not None or self.gain is not None:
            option = "--gain" if self.stops is None else "--stops"
            factor = self.gain if self.stops is None else _two_to(self.stops)
            if factor is None or not (math.isfinite(factor) and factor > 0):
                raise ValueError(f"{option}: the factor is {factor}; it must be above 0")
            made.append(Step(option, f"gain × {factor:g}", lambda p: edit_steps.gain(p, factor)))
        if self.grey is not None:
            x, y, *radius = numbers(self.grey, "--grey", 2, 3)
            column, row = whole([x, y], "--grey")
            made.append(
                Step("--grey", f"grey at {self.grey}", lambda p: edit_steps.neutral_at(p, column, row, *radius))
            )
        if self.balance is not None:
            gains = numbers(self.balance, "--balance", 3)
            made.append(Step("--balance", f"balance × {self.balance}", lambda p: edit_steps.balance(p, gains)))
        if (kelvin := self.temperature) is not None:
            made.append(
                Step("--temperature", f"light of {kelvin:g} K neutral", lambda p: edit_steps.neutral_under(p, kelvin))
            )
        return made


@Parameter(name="*")
@dataclass(frozen=True)
class Blur:
    """Motion blur and soft focus, in linear light."""

    motion: Annotated[
        str | None,
        Parameter(group=BLUR, help="LENGTH[,ANGLE]: a straight streak, in pixels and degrees anticlockwise."),
    ] = None
    blur: Annotated[float | None, Parameter(group=BLUR, help="Soft blur of this deviation, in pixels.")] = None
    spin: Annotated[
        float | None, Parameter(group=BLUR, help="Motion blur of a light map: a turn about the vertical, in degrees.")
    ] = None
    spherical_blur: Annotated[
        float | None,
        Parameter(group=BLUR, help="Soft blur of a light map, on the sphere: its deviation in degrees."),
    ] = None
    glow: Annotated[
        float | None,
        Parameter(group=BLUR, help="Soft focus: blur this share of the light, 0 to 1, and leave the rest sharp."),
    ] = None

    def steps(self) -> list[Step]:
        """The steps asked for; raises ValueError naming the option."""
        if self.glow is not None and self.blur is None and self.spherical_blur is None:
            raise ValueError("--glow is a share of what is blurred; give --blur or --spherical-blur too")
        share = 1.0 if self.glow is None else self.glow
        made = []
        if self.motion is not None:
            length, *angle = numbers(self.motion, "--motion", 1, 2)
            radians = math.radians(angle[0]) if angle else 0.0
            made.append(Step("--motion", f"motion blur {self.motion}", lambda p: edit_steps.streak(p, length, radians)))
        if (sigma := self.blur) is not None:
            made.append(
                Step("--blur", f"soft blur {sigma:g} pixels{_of(share)}", lambda p: edit_steps.soften(p, sigma, share))
            )
        if (turn := self.spin) is not None:
            made.append(Step("--spin", f"spin {turn:g}°", lambda p: edit_steps.spin(p, math.radians(turn))))
        if (wide := self.spherical_blur) is not None:
            words = f"soft blur {wide:g}°{_of(share)}"
            made.append(Step("--spherical-blur", words, lambda p: edit_steps.blur_sphere(p, math.radians(wide), share)))
        return made


def _of(share: float) -> str:
    return "" if share == 1 else f" of {share:g} of the light"


def _at_most_one(options: dict[str, object], what: str) -> None:
    given = [option for option, value in options.items() if value is not None]
    if len(given) > 1:
        raise ValueError(f"{' and '.join(given)} all {what}; give one")


def _constant(word: str) -> float | tuple[float, float, float] | None:
    """The number or R,G,B that a word is; None for the name of a file."""
    try:
        values = [float(part) for part in word.split(",")]
    except ValueError:
        return None
    if len(values) not in (1, 3) or not all(map(math.isfinite, values)):
        raise ValueError(f'"{word}" is no constant; write one number, or R,G,B')
    return values[0] if len(values) == 1 else (values[0], values[1], values[2])


def _map(word: str) -> RadianceMap:
    from relume.image import files

    return files.read_radiance(word)


def _two_to(stops: float) -> float:
    if not abs(stops) <= 100:
        raise ValueError(f"--stops: {stops:g}; expected −100 to 100")
    return 2.0**stops


def _size(text: str) -> Callable[[tuple[int, int]], tuple[int, int]]:
    """From the present (width, height) to the one that text like "512", "512,256" or "50%" asks for."""
    if text.endswith("%"):
        (percent,) = numbers(text[:-1], "--resize", 1)
        return lambda size: (_at_least_one(size[0] * percent / 100), _at_least_one(size[1] * percent / 100))
    width, *height = whole(numbers(text.replace("x", ",").replace("×", ","), "--resize", 1, 2), "--resize")
    if height:
        return lambda size: (width, height[0])
    return lambda size: (width, _at_least_one(size[1] * width / size[0]))


def _at_least_one(length: float) -> int:
    # What is negative or 0 is refused where the map is resized.
    return max(1, round(length)) if length > 0 else 0

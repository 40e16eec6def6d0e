"""What `relume merge` is told of the camera and the light, turned into a `MergeSettings`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Group, Parameter

if TYPE_CHECKING:
    from relume.capture.brackets.settings import MergeSettings
    from relume.capture.lens.vignetting import Vignetting
    from relume.capture.scale.readings import ScaleReading

Method = Literal["debevec-malik", "mitsunaga-nayar", "robertson"]
STEPS, LENS, SCALE = Group("Steps", sort_key=1), Group("Lens", sort_key=2), Group("Absolute scale, one of", sort_key=3)


@Parameter(name="*")
@dataclass(frozen=True)
class Steps:
    """How the photographs are treated."""

    method: Annotated[Method, Parameter(group=STEPS, help="How the response is recovered.")] = "debevec-malik"
    refine: Annotated[
        bool, Parameter(group=STEPS, negative="", help="Correct exposures that the photographs contradict.")
    ] = False
    align: Annotated[bool, Parameter(group=STEPS, help="Bring photographs that moved onto one another.")] = True
    deghost: Annotated[bool, Parameter(group=STEPS, help="Leave out what moved between them.")] = True
    paper_weights: Annotated[bool, Parameter(group=STEPS, negative="", help="Weigh as Debevec & Malik do (eq. 4).")] = (
        False
    )
    neutral: Annotated[
        int | None,
        Parameter(group=STEPS, help="Pixel value whose equal channels are grey; white unless given, 128 for film."),
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Lens:
    """What the lens did to the light."""

    glare: Annotated[
        str | None,
        Parameter(group=LENS, help="Diminish the veil that a black place X,Y,WIDTH,HEIGHT of the picture shows."),
    ] = None
    flat_field: Annotated[
        list[Path] | None,
        Parameter(
            group=LENS, negative="", consume_multiple=True,
            help="Radiance maps of an evenly lit wall by the same lens and aperture: its vignetting is taken out.",
        ),
    ] = None  # fmt: skip
    white: Annotated[
        str | None, Parameter(group=LENS, help="A white light or card in X,Y,WIDTH,HEIGHT that is to come out grey.")
    ] = None
    focal_length: Annotated[float | None, Parameter(group=LENS, help="In pixels, where the photographs tell none.")] = (
        None
    )


@Parameter(name="*")
@dataclass(frozen=True)
class Readings:
    """What ties the map to cd/m²."""

    absolute: Annotated[
        bool, Parameter(group=SCALE, negative="", help="From shutter, aperture and ISO; good to a third of a stop.")
    ] = False
    spot: Annotated[
        str | None, Parameter(group=SCALE, help="A spot meter's reading X,Y,CD[,RADIUS]: cd/m² at pixel X,Y.")
    ] = None
    lux: Annotated[
        str | None,
        Parameter(
            group=SCALE, help="A lux meter's reading X,Y,WIDTH,HEIGHT,LUX,REFLECTANCE on a matt card in that rectangle."
        ),
    ] = None
    luminaire: Annotated[
        str | None,
        Parameter(group=SCALE, help="A light of known cd/m² and colour, X,Y,WIDTH,HEIGHT,R,G,B (white: R = G = B)."),
    ] = None

    def scale(self) -> ScaleReading | None:
        """The one that was given; None where none was. Raises ValueError for two, or for wrong numbers."""
        from relume.capture.scale.readings import ExposureScale, LuminaireReading, LuxReading, Rectangle, SpotReading

        given = [name for name in ("absolute", "spot", "lux", "luminaire") if getattr(self, name)]
        if not given:
            return None
        if len(given) > 1:
            raise ValueError(f"--{given[0]} and --{given[1]} both give the scale; give one")
        if self.absolute:
            return ExposureScale()
        name, option = given[0], f"--{given[0]}"
        values = numbers(getattr(self, name), option, *{"spot": (3, 4), "lux": (6,), "luminaire": (7,)}[name])
        if name == "spot":
            return SpotReading(*whole(values[:2], option), *values[2:])
        place = Rectangle(*whole(values[:4], option))
        if name == "lux":
            return LuxReading(place, *values[4:])
        return LuminaireReading(place, (values[4], values[5], values[6]))


def settings_of(steps: Steps, lens: Lens, readings: Readings) -> MergeSettings:
    """What the options ask for."""
    from relume.capture.brackets.settings import RESPONSE_METHODS, MergeSettings
    from relume.capture.scale.readings import DarkPlace, Rectangle, WhiteCard
    from relume.capture.weighting import Hat, InverseVariance

    dark, white = (
        None if text is None else Rectangle(*whole(numbers(text, option, 4), option))
        for text, option in ((lens.glare, "--glare"), (lens.white, "--white"))
    )
    return MergeSettings(
        method=RESPONSE_METHODS[steps.method],
        weighting=Hat() if steps.paper_weights else InverseVariance(),
        refine=steps.refine,
        align=steps.align,
        deghost=steps.deghost,
        neutral=steps.neutral,
        glare=None if dark is None else DarkPlace(dark),
        vignetting=flat_fields(lens.flat_field),
        balance=None if white is None else WhiteCard(white),
        scale=readings.scale(),
        focal_length=lens.focal_length,
    )


def numbers(text: str, option: str, *counts: int) -> list[float]:
    """As many numbers as one of `counts` from text like "10,20,5.5"; raises ValueError naming the option."""
    try:
        values = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        values = []
    if len(values) not in counts or not all(map(isfinite, values)):
        wanted = " or ".join(map(str, counts))
        raise ValueError(f'{option}: "{text}" is not {wanted} numbers; write them with commas between')
    return values


def whole(values: Sequence[float], option: str) -> list[int]:
    """Pixels and pixel values as integers; raises ValueError naming the option where one is a fraction."""
    if broken := [value for value in values if not value.is_integer()]:
        raise ValueError(f"{option}: {broken[0]:g} is no whole number; pixels and their values are")
    return [int(value) for value in values]


def flat_fields(paths: Sequence[Path] | None) -> tuple[Vignetting, ...]:
    """The vignetting that radiance maps of an even wall show; none without any."""
    from relume.capture.lens.vignetting import recover_vignetting
    from relume.image import files

    if not paths:
        return ()
    walls = [files.read_radiance(path) for path in paths]
    # `relume merge` writes the aperture into its maps.
    apertures = {wall.attributes.get("f_number") for wall in walls}
    told = apertures.pop() if len(apertures) == 1 else None
    return (recover_vignetting(walls, f_number=float(told) if told else None),)

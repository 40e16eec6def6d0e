"""Options of `relume merge`: the steps, the lens, and the readings that give the scale to cd/m²."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Group, Parameter

from relume.cli.option_types import numbers

if TYPE_CHECKING:
    import relume as rl

Method = Literal["debevec-malik", "mitsunaga-nayar", "robertson"]
STEPS, LENS, SCALE = Group("Steps", sort_key=1), Group("Lens", sort_key=2), Group("Absolute scale, one of", sort_key=3)
Spot = tuple[int, int, float] | tuple[int, int, float, float]
Lux = tuple[int, int, int, int, float, float]
Luminaire = tuple[int, int, int, int, float, float, float]
BOX = "X,Y,WIDTH,HEIGHT"


@Parameter(name="*")
@dataclass(frozen=True)
class Steps:
    """What is done to the photographs."""

    method: Annotated[Method, Parameter(group=STEPS, help="How the response is recovered.")] = "debevec-malik"
    refine: Annotated[
        bool, Parameter(group=STEPS, negative="", help="Correct exposures that the photographs contradict.")
    ] = False
    align: Annotated[bool, Parameter(group=STEPS, help="Bring photographs that moved onto one another.")] = True
    deghost: Annotated[bool, Parameter(group=STEPS, help="Leave out what moved between them.")] = True
    paper_weights: Annotated[
        bool, Parameter(group=STEPS, negative="", help="Weight as Debevec & Malik do (eq. 4).")
    ] = False
    neutral: Annotated[
        int | None,
        Parameter(group=STEPS, help="Pixel value whose equal channels are grey; white unless given, 128 for film."),
    ] = None


@Parameter(name="*")
@dataclass(frozen=True)
class Lens:
    """What the lens did to the light."""

    glare: Annotated[
        tuple[int, int, int, int] | None,
        numbers(
            BOX, like="40,60,8,8", group=LENS, help="A black place of the picture: the veil of glare it shows goes."
        ),
    ] = None
    flat_field: Annotated[
        list[Path] | None,
        Parameter(
            group=LENS, negative="", consume_multiple=True,
            help="Radiance maps of an evenly lit wall by the same lens and aperture: its vignetting is taken out.",
        ),
    ] = None  # fmt: skip
    white: Annotated[
        tuple[int, int, int, int] | None,
        numbers(BOX, like="40,60,8,8", group=LENS, help="A white light or card that is to come out grey."),
    ] = None
    focal_length: Annotated[float | None, Parameter(group=LENS, help="In pixels, where the photographs hold none.")] = (
        None
    )


@Parameter(name="*")
@dataclass(frozen=True)
class Readings:
    """What gives the map its scale to cd/m²."""

    absolute: Annotated[
        bool, Parameter(group=SCALE, negative="", help="From shutter, aperture and ISO; good to a third of a stop.")
    ] = False
    spot: Annotated[
        Spot | None,
        numbers("X,Y,CD[,RADIUS]", like="60,40,500", group=SCALE, help="A spot meter's reading: cd/m² at pixel X,Y."),
    ] = None
    lux: Annotated[
        Lux | None,
        numbers(
            f"{BOX},LUX,REFLECTANCE", like="20,30,16,8,1000,0.18", group=SCALE,
            help="A lux meter's reading on a matt card in that rectangle.",
        ),
    ] = None  # fmt: skip
    luminaire: Annotated[
        Luminaire | None,
        numbers(
            f"{BOX},R,G,B", like="20,30,16,8,100,100,100", group=SCALE,
            help="A light of known cd/m² and colour (white: R = G = B).",
        ),
    ] = None  # fmt: skip


def settings_of(steps: Steps, lens: Lens, readings: Readings) -> rl.capture.MergeSettings:
    """The settings that the options ask for."""
    from relume import capture

    return capture.MergeSettings(
        method=capture.RESPONSE_METHODS[steps.method],
        weighting=capture.Hat() if steps.paper_weights else capture.InverseVariance(),
        refine=steps.refine,
        align=steps.align,
        deghost=steps.deghost,
        neutral=steps.neutral,
        glare=None if lens.glare is None else capture.DarkPlace(capture.Rectangle(*lens.glare)),
        vignetting=capture.read_flat_fields(lens.flat_field or ()),
        balance=None if lens.white is None else capture.WhiteCard(capture.Rectangle(*lens.white)),
        scale=_scale(readings),
        focal_length=lens.focal_length,
    )


def _scale(
    readings: Readings,
) -> rl.capture.ExposureScale | rl.capture.SpotReading | rl.capture.LuxReading | rl.capture.LuminaireReading | None:
    """The reading that was given; raises ValueError for two."""
    from relume import capture

    given = [name for name in ("absolute", "spot", "lux", "luminaire") if getattr(readings, name)]
    if len(given) > 1:
        raise ValueError(f"--{given[0]} and --{given[1]} both give the scale; give one")
    if readings.spot is not None:
        return capture.SpotReading(*readings.spot[:2], *readings.spot[2:])
    if readings.lux is not None:
        return capture.LuxReading(capture.Rectangle(*readings.lux[:4]), *readings.lux[4:])
    if readings.luminaire is not None:
        return capture.LuminaireReading(capture.Rectangle(*readings.luminaire[:4]), readings.luminaire[4:])
    return capture.ExposureScale() if readings.absolute else None

"""The [tone] table of a preset: what makes the light a picture, a kind a table."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from relume.image.photograph import Exposure
from relume.project.schema import Positive, Table
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.steps import Screen, Tone
from relume.virtual_camera.tone.ferwerda import Ferwerda
from relume.virtual_camera.tone.metered import CameraExposure, Fixed, Metered

Stock = Literal["black-and-white", "colour-negative", "slide"]


class Step(Table):
    """A table that becomes a frozen value; what it leaves out is the value's own default."""

    def given(self, *but: str) -> dict[str, Any]:
        """The keys that the file has, as they are called."""
        return {key: getattr(self, key) for key in self.model_fields_set if key not in ("kind", *but)}


class ScreenTable(Step):
    """The display's luminances, cd/m²; what is left out is that of the tone's own screen."""

    white: Positive | None = None
    black: Positive | None = None

    def made(self, own: Screen) -> Screen:
        return replace(own, **self.given())


class ScreenTone(Step):
    """A tone that makes its picture for a screen."""

    own_screen: ClassVar[Screen] = Screen()

    screen: ScreenTable = ScreenTable()

    @model_validator(mode="after")
    def _screen_is_one(self) -> Self:
        self.made_screen()
        return self

    def made_screen(self) -> Screen:
        return self.screen.made(self.own_screen)


class ExposureTone(Step):
    """Plain exposure, by the bright parts or the mean where one of them is told, by the brighter of both else."""

    kind: Literal["exposure"]
    percentile: Annotated[float, Field(gt=0, le=100)] | None = None
    grey: Positive | None = None

    def made(self, folder: Path) -> Tone:
        return Metered(self.percentile, self.grey) if self.given() else Metered()


class FixedTone(Step):
    """Plain exposure as told: display values per unit of radiance."""

    kind: Literal["fixed"]
    gain: Positive = 1.0

    def made(self, folder: Path) -> Tone:
        return Fixed(self.gain)


class CameraTone(Step):
    """A camera's shutter, f-number and ISO; with its profile its response, on whose scale the picture has to be."""

    kind: Literal["camera"]
    seconds: Positive
    f_number: Positive
    iso: Positive = 100.0
    response: str | None = None

    def made(self, folder: Path) -> Tone:
        exposure = Exposure(self.seconds, self.f_number, self.iso)
        if self.response is None:
            return CameraExposure(exposure)
        from relume.capture.response.camera_profile import read_profile
        from relume.virtual_camera.plate_matching.camera_profile import profiled_response, profiled_scale

        profile = read_profile(folder / self.response)
        return Film.of(exposure, profiled_response(profile), scale=profiled_scale(profile, exposure))


class ReinhardTone(Step):
    """Reinhard et al. 2002, global."""

    kind: Literal["reinhard"]
    key: Positive | None = None
    white: Positive | None = None

    def made(self, folder: Path) -> Tone:
        from relume.virtual_camera.tone.reinhard import Reinhard

        return Reinhard(**self.given())


class ReinhardLocalTone(Step):
    """Reinhard et al. 2002, dodging and burning."""

    kind: Literal["reinhard-local"]
    key: Positive | None = None
    sharpening: Positive | None = None
    threshold: Positive | None = None
    scales: Annotated[int, Field(ge=2, le=16)] | None = None

    def made(self, folder: Path) -> Tone:
        from relume.virtual_camera.tone.reinhard_local import ReinhardLocal

        return ReinhardLocal(**self.given())


class HistogramTone(ScreenTone):
    """Ward Larson et al. 1997; "human" has an eye's contrast, veil, acuity and colours unless told."""

    kind: Literal["histogram", "human"]
    human_contrast: bool | None = None
    veil: bool | None = None
    acuity: bool | None = None
    colour: bool | None = None
    centre_weighted: bool = False

    def made(self, folder: Path) -> Tone:
        from relume.virtual_camera.tone.histogram.adjustment import HistogramAdjustment
        from relume.virtual_camera.tone.histogram.curve import HumanContrast, LinearContrast

        told = {name: getattr(self, name) for name in ("human_contrast", "veil", "acuity", "colour")}
        human = {name: self.kind == "human" if value is None else value for name, value in told.items()}
        return HistogramAdjustment(
            self.made_screen(),
            HumanContrast() if human["human_contrast"] else LinearContrast(),
            veil=human["veil"],
            acuity=human["acuity"],
            colour=human["colour"],
            centre_weighted=self.centre_weighted,
        )


class TumblinRushmeierTone(ScreenTone):
    """Tumblin & Rushmeier 1993."""

    kind: Literal["tumblin-rushmeier"]

    def made(self, folder: Path) -> Tone:
        from relume.virtual_camera.tone.tumblin_rushmeier import TumblinRushmeier

        return TumblinRushmeier(self.made_screen())


class FerwerdaTone(ScreenTone):
    """Ferwerda et al. 1996."""

    own_screen: ClassVar[Screen] = Ferwerda().screen

    kind: Literal["ferwerda"]
    percentile: Annotated[float, Field(gt=0, le=100)] | None = None
    acuity: bool | None = None
    colour: bool | None = None

    def made(self, folder: Path) -> Tone:
        return Ferwerda(screen=self.made_screen(), **self.given("screen"))


class PattanaikTone(ScreenTone):
    """Pattanaik et al. 1998, multiscale."""

    kind: Literal["pattanaik"]

    def made(self, folder: Path) -> Tone:
        from relume.virtual_camera.tone.pattanaik.pattanaik import Pattanaik

        return Pattanaik(self.made_screen())


class BlackWhiteTone(Step):
    """The black and white point of HDRExpose (Cachelin 2001)."""

    kind: Literal["black-white"]
    black: Positive | None = None
    white: Positive | None = None

    def made(self, folder: Path) -> Tone:
        from relume.virtual_camera.tone.black_white_point import BlackWhitePoint

        return BlackWhitePoint(**self.given())


class OcioTone(Step):
    """A view of an OpenColorIO configuration."""

    kind: Literal["ocio"]
    config: str | None = None
    display: str | None = None
    view: str | None = None
    looks: list[str] = Field(default_factory=list)
    grey: Positive | None = None

    def made(self, folder: Path) -> Tone:
        from relume.virtual_camera.tone.ocio import Ocio

        given = self.given("looks", "config")
        if self.config is not None:
            given["config"] = self.config if self.config.startswith("ocio://") else str(folder / self.config)
        return Ocio(**given, looks=tuple(self.looks))


class DarkroomTone(Step):
    """A film, and the paper that it is printed on."""

    kind: Literal["darkroom"]
    stock: Stock = "black-and-white"
    speed: Positive | None = None
    grade: Annotated[float, Field(ge=0, le=5)] | None = None
    stops: float | None = None
    print_stops: float | None = None
    frame: Positive | None = None
    grain: bool = True
    halation: bool = True

    @model_validator(mode="after")
    def _grade_is_of_paper(self) -> DarkroomTone:
        if self.grade is not None and self.stock != "black-and-white":
            raise ValueError("grades are of black-and-white paper; leave grade out")
        return self

    def made(self, folder: Path) -> Tone:
        from relume.virtual_camera.film import stocks
        from relume.virtual_camera.film.darkroom import Darkroom

        speed = {} if self.speed is None else {"speed": self.speed}
        if self.stock == "slide":
            film, paper = stocks.slide(**speed), None
        elif self.stock == "colour-negative":
            film, paper = stocks.colour_negative(**speed), stocks.colour_paper()
        else:
            film, paper = (
                stocks.black_and_white_negative(**speed),
                stocks.paper(2.0 if self.grade is None else self.grade),
            )
        film = replace(
            film, grain=film.grain if self.grain else None, halation=film.halation if self.halation else None
        )
        return Darkroom(film, paper, **self.given("stock", "speed", "grade", "grain", "halation"))


ToneTable = Annotated[
    ExposureTone | FixedTone | CameraTone | ReinhardTone | ReinhardLocalTone | HistogramTone | TumblinRushmeierTone
    | FerwerdaTone | PattanaikTone | BlackWhiteTone | OcioTone | DarkroomTone,
    Field(discriminator="kind"),
]  # fmt: skip

"""What `relume merge` is told of the camera and the light, turned into a `MergeSettings`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from cyclopts import Group, Parameter

from relume.errors import NotABracket

if TYPE_CHECKING:
    import numpy as np

    from relume.capture.exposure.bracket import Bracket, FrameFacts
    from relume.capture.lens.vignetting import Vignetting
    from relume.capture.measurement import MergeSettings
    from relume.capture.raw.merging import RawCalibration
    from relume.capture.response.camera_profile import CameraProfile
    from relume.capture.scale.absolute import Scale
    from relume.capture.scale.luminaire import Balance
    from relume.image.photograph import Exposure
    from relume.image.radiance import RadianceMap
    from relume.image.response import Response

Read = TypeVar("Read")
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

    def scale(self) -> Callable[[RadianceMap, Bracket, Response], Scale] | None:
        """The scale's maker; None where no reading was given. Raises ValueError for two, or for wrong numbers."""
        given = [name for name in ("absolute", "spot", "lux", "luminaire") if getattr(self, name)]
        if not given:
            return None
        if len(given) > 1:
            raise ValueError(f"--{given[0]} and --{given[1]} both tell the scale; give one")
        if self.absolute:
            return _from_exposure
        return self._from_reading(given[0])

    def raw_scale(
        self, profile: CameraProfile | None
    ) -> Callable[[RadianceMap, Bracket, RawCalibration], Scale] | None:
        """The same for camera raws; where no reading was given, the profile's."""
        # Readings and profile ask nothing of the response.
        found: Any = self.scale() or _scale(profile)
        return _from_saturation if self.absolute else found

    def _from_reading(self, name: str) -> Callable[[RadianceMap, Bracket, Response], Scale]:
        from relume.capture.scale.absolute import scale_from_lux, scale_from_spot
        from relume.capture.scale.luminaire import scale_from_luminaire
        from relume.capture.scale.regions import rectangle

        option = f"--{name}"
        values = numbers(getattr(self, name), option, *{"spot": (3, 4), "lux": (6,), "luminaire": (7,)}[name])
        if name == "spot":
            (x, y), (reading, *radii) = whole(values[:2], option), values[2:]
            _require_positive(reading, option, "the reading in cd/m²")
            for radius in radii:
                _require_positive(radius, option, "the radius in pixels")
            return _by(
                option,
                lambda picture, bracket, _: scale_from_spot(
                    picture, x, y, reading, radius=radii[0] if radii else _spot_radius(bracket)
                ),
            )
        left, top, width, height = _box(values[:4], option)
        if name == "lux":
            lux, reflectance = values[4:]
            _require_positive(lux, option, "the reading in lux")
            if not 0 < reflectance <= 1:
                remedy = f" (write {reflectance / 100:g} for {reflectance:g} %)" if 1 < reflectance <= 100 else ""
                raise ValueError(f"{option}: the reflectance is {reflectance:g}; it lies above 0 and up to 1{remedy}")
            return _by(
                option,
                lambda picture, *_: scale_from_lux(
                    picture, rectangle(picture.size, left, top, width, height), lux, reflectance=reflectance
                ),
            )
        colour = (values[4], values[5], values[6])
        for value in colour:
            _require_positive(value, option, "a channel in cd/m²")
        return _by(
            option,
            lambda picture, *_: scale_from_luminaire(
                picture, rectangle(picture.size, left, top, width, height), colour
            ),
        )


def places(lens: Lens, readings: Readings) -> tuple[str, ...]:
    """The options given that point at a place of the picture."""
    given = {"--spot": readings.spot, "--lux": readings.lux, "--luminaire": readings.luminaire}
    given |= {"--white": lens.white, "--glare": lens.glare}
    return tuple(option for option, text in given.items() if text)


def _by(option: str, read: Callable[..., Read]) -> Callable[..., Read]:
    """`read`, whose complaints of the picture name the option."""

    def named(*given: Any) -> Read:
        try:
            return read(*given)
        except ValueError as error:
            raise ValueError(f"{option}: {error}") from None

    return named


def _require_positive(value: float, option: str, what: str) -> None:
    if not (isfinite(value) and value > 0):
        raise ValueError(f"{option}: {what} is {value:g}; it must be above 0")


def _box(values: Sequence[float], option: str) -> list[int]:
    """Left, top, width and height in pixels of what could be a rectangle."""
    left, top, width, height = whole(values, option)
    if left < 0 or top < 0 or width <= 0 or height <= 0:
        raise ValueError(
            f"{option}: {left},{top},{width},{height} is no rectangle; give X,Y from 0, and WIDTH and HEIGHT above 0"
        )
    return [left, top, width, height]


def _from_exposure(picture: RadianceMap, bracket: Bracket, response: Response) -> Scale:
    from relume.capture.scale.absolute import scale_from_exposure

    return scale_from_exposure(response, [p.exposure for p in bracket.photographs if p.exposure])


def _from_saturation(picture: RadianceMap, bracket: Bracket, calibration: RawCalibration) -> Scale:
    from relume.capture.scale.absolute import scale_from_saturation

    return scale_from_saturation(calibration.saturation, calibration.exposures)


def treatment_of(steps: Steps, lens: Lens, readings: Readings, profile: CameraProfile | None) -> MergeSettings:
    """What the options ask for; what they leave open the profile tells."""
    from relume.capture.ghosts.deghosting import Consistency
    from relume.capture.lens.glare_recovery import recover_glare_from_dark
    from relume.capture.measurement import MergeSettings
    from relume.capture.response.debevec_malik import DebevecMalik
    from relume.capture.response.mitsunaga_nayar import MitsunagaNayar
    from relume.capture.response.ratios import Ratios
    from relume.capture.response.robertson import Robertson
    from relume.capture.scale.luminaire import balance_from_luminaire
    from relume.capture.weighting import Hat, InverseVariance

    if lens.focal_length is not None:
        _require_positive(lens.focal_length, "--focal-length", "the focal length in pixels")
    if steps.neutral is not None and steps.neutral < 0:
        raise ValueError(f"--neutral: {steps.neutral} is no pixel value; they begin at 0")
    scale = readings.scale() or _scale(profile)
    methods = {"debevec-malik": DebevecMalik(), "mitsunaga-nayar": MitsunagaNayar(), "robertson": Robertson()}
    known = vignetting_of(profile)
    dark, white = _rectangle(lens.glare, "--glare"), _rectangle(lens.white, "--white")
    return MergeSettings(
        method=methods[steps.method],
        weighting=Hat() if steps.paper_weights else InverseVariance(),
        refine=Ratios() if steps.refine else None,
        aligned=steps.align,
        consistency=Consistency() if steps.deghost else None,
        neutral=steps.neutral,
        glare=None if dark is None else _by("--glare", lambda picture: recover_glare_from_dark(picture, dark(picture))),
        vignetting=flat_fields(lens.flat_field) or known,
        balance=_balance(profile)
        if white is None
        else _by("--white", lambda picture: balance_from_luminaire(picture, white(picture))),
        scale=scale,
        focal_length=lens.focal_length,
    )


def vignetting_of(profile: CameraProfile | None) -> tuple[Vignetting, ...]:
    """What a profile knows of its lens."""
    from relume.capture.lens.vignetting import Vignetting

    return () if profile is None or profile.vignetting is None else (Vignetting.from_dict(profile.vignetting),)


def _balance(profile: CameraProfile | None) -> Callable[[RadianceMap], Balance] | None:
    from relume.capture.scale.luminaire import Balance

    if profile is None or profile.balance == (1.0, 1.0, 1.0):
        return None
    return lambda _: Balance(profile.balance)


def _scale(profile: CameraProfile | None) -> Callable[[RadianceMap, Bracket, Response], Scale] | None:
    from relume.capture.scale.absolute import METER, Scale

    if profile is None or profile.scale is None:
        return None
    deviation = METER if profile.scale_deviation is None else profile.scale_deviation
    scale, measured_with = Scale.grey(profile.scale, deviation, "the camera's profile"), profile.scale_exposure

    def known(picture: RadianceMap, bracket: Bracket | None, response: Response) -> Scale:
        exposure = bracket.photographs[0].exposure if bracket is not None else None
        if exposure is not None and measured_with not in (None, tells(exposure)):
            raise NotABracket(
                f"{bracket.name if bracket else ''}: its exposures tell {words(tells(exposure))}, those of the "
                f"profile's scale {words(measured_with)}; the scale holds only where both tell the same"
            )
        return scale

    return known


def tells(exposure: Exposure | FrameFacts) -> tuple[bool, bool]:
    """Whether f-number and ISO are known: an unknown one counts as 1 and 100 in relative radiance."""
    return exposure.f_number is not None, exposure.iso is not None


def words(told: tuple[bool, bool] | None) -> str:
    """What `tells` found."""
    found = [name for name, known in zip(("f-number", "ISO"), told or (), strict=False) if known]
    return " and ".join(found) or "neither f-number nor ISO"


def _rectangle(text: str | None, option: str) -> Callable[[RadianceMap], np.ndarray] | None:
    if text is None:
        return None
    from relume.capture.scale.regions import rectangle

    left, top, width, height = _box(numbers(text, option, 4), option)
    return lambda picture: rectangle(picture.size, left, top, width, height)


def _spot_radius(bracket: Bracket | None) -> float:
    """Pixels: of a meter's 1° where the focal length is known, else a few."""
    from relume.capture.scale.regions import spot_radius

    return spot_radius(bracket.focal_length) if bracket is not None and bracket.focal_length else 4.0


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

"""A virtual camera like the one that took a plate: what it does to light before, at and after the sensor.

Of a camera's profile it takes the response, the vignetting and the scale, where they hold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from relume.capture.lens.vignetting import Vignetting
from relume.capture.response.camera_profile import CameraProfile
from relume.capture.scale.absolute import Scale, scale_from_exposure
from relume.errors import NotABracket, warn
from relume.image.colour import luminance
from relume.image.colour_space import name_of
from relume.image.photograph import Exposure, Photograph
from relume.image.radiance import RadianceMap
from relume.image.response import Response, srgb_response
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.film.undeveloping import AllButEnds, undevelop
from relume.virtual_camera.lens.vignetting import MeasuredVignetting
from relume.virtual_camera.plate_matching.grain_measuring import photograph_grain
from relume.virtual_camera.plate_matching.sharpness import Sharpness, measured_sharpness
from relume.virtual_camera.protocols import Optics, Relative
from relume.virtual_camera.view import View

MIDDLE = 118 / 255
"""Share of the largest value that a light meter's reading becomes (ISO 12232, standard output sensitivity)."""
JPEG_GUARD = 5
"""Values at either end that JPEG leaves in patches that were white or black."""
FAR = 2.0
"""Stops between the medians of picture and plate above which that is warned of: other scenes in the same light differ
by less, other units by more."""
_LOOKED_AT = 2**18


@dataclass(frozen=True)
class Softness(Relative):
    """A plate's sharpness as `Optics`: what is rendered with pixels as wide as they are becomes as soft as it."""

    sharpness: Sharpness

    def apply(self, radiance: np.ndarray, view: View) -> np.ndarray:
        """Radiance (H, W, 3) float32 as that lens spreads it; light stays the same, mirrored at the border."""
        out = np.empty(radiance.shape, np.float32)
        for channel in range(3):
            out[..., channel] = self.sharpness.blurred(radiance[..., channel])
        return out


@dataclass(frozen=True, eq=False)
class MatchedCamera:
    """What develops a picture as the plate's camera would have.

    film : its exposure, response and grain
    optics : in the order in which light passes them, which is that of `VirtualCamera`: softness, then fall-off
    facts : a line each on what was taken from where, to be shown
    """

    film: Film
    optics: tuple[Optics, ...]
    facts: tuple[str, ...]


def match_camera(
    photograph: Photograph,
    picture: RadianceMap,
    profile: CameraProfile | Response | None = None,
    *,
    clean: np.ndarray | None = None,
) -> MatchedCamera:
    """The virtual camera for `picture`, so that it looks as if the camera of `photograph` had taken it.

    photograph : the plate, as the camera wrote it
    picture : what is to be developed, rendered without a lens of its own; its unit says whether exposures hold for it,
        and it is metered where none do
    profile : the camera's profile, or its response alone; None for sRGB, with a line in the facts
    clean : (H, W, 3) the plate's values without noise, not rounded, from which its grain is measured; unless
        given its own flat patches are looked at

    The plate's EXIF exposure counts where picture and camera are on one scale. A picture in cd/m² needs a camera with
    f-number and ISO, or a measured scale. A relative picture needs a response, on whose scale merging puts radiance.
    Else a light meter exposes the picture: its log mean becomes 118 of 255. The tones of the plate say nothing of that,
    for it shows another scene; but the facts say by how much the picture comes out brighter than the plate, and a
    warning does so above 2 stops.
    """
    facts: list[str] = []
    response, vignetting, scale = _known(profile, photograph, facts)
    film = _exposed(photograph, picture, response, scale, facts)
    facts.append(f"exposed by {film.exposure:.4g} per unit of radiance")
    seen = _seen(photograph, film)
    _compare_brightness(picture, seen, facts)
    optics: list[Optics] = []
    sharpness = None if seen is None else measured_sharpness(seen)
    if sharpness is None:
        facts.append("sharpness: the plate shows too few clean edges; left as rendered")
    else:
        facts.append(f"sharpness: sigma {sharpness.sigma:.2f} pixels, from {sharpness.edges} edges of the plate")
        if sharpness.sigma > 0:
            optics.append(Softness(sharpness))
    if vignetting is not None:
        optics.append(MeasuredVignetting(vignetting))
    grain = photograph_grain(photograph, clean=clean, response=response)
    if grain is None:
        facts.append("grain: the plate shows too few flat patches; none is added")
    else:
        # Of values 0 to 255, from one of the photograph's own.
        factor = 255 / float(np.iinfo(photograph.pixels.dtype).max)
        grain = replace(grain, values=grain.values * factor, deviation=grain.deviation * factor)
        middle = float(grain.deviation_at(np.full(3, 255 * MIDDLE)).mean())
        facts.append(f"grain: standard deviation {middle:.2f} of 255 at middle grey, from the plate's flat patches")
    return MatchedCamera(replace(film, grain=grain), tuple(optics), tuple(facts))


def _known(
    profile: CameraProfile | Response | None, photograph: Photograph, facts: list[str]
) -> tuple[Response | None, Vignetting | None, Scale | None]:
    """Response, vignetting and scale of a profile that hold for the photograph."""
    if isinstance(profile, Response):
        facts.append("response: as given")
        return profile, None, None
    if profile is None or profile.response is None:
        why = "no profile was given" if profile is None else "the profile is that of raws"
        facts.append(f"response: sRGB, for {why}; a camera's own differs in contrast")
        if (space := name_of(photograph)) != "sRGB":
            # Its numbers are matched; what is written is sRGB.
            warn(
                f"{photograph.name}: it is in {space} and is matched as if it were in sRGB, so colours differ from it; "
                "convert it to sRGB first, or give the camera's profile",
                0.1,
            )
        response = None
    else:
        facts.append(f"response: of the profile of {profile.camera or 'an unnamed camera'}")
        response = profiled_response(profile)
    if profile is None:
        return response, None, None
    exposure = photograph.exposure
    vignetting = profiled_vignetting(profile)
    if vignetting is not None:
        at = None if exposure is None else exposure.f_number
        other = vignetting.f_number is not None and at is not None and abs(np.log(at / vignetting.f_number)) > 0.03
        facts.append(
            "vignetting: of the profile"
            + (f", measured at f/{vignetting.f_number:g}; the plate is at f/{at:g}" if other else "")
        )
    scale = profiled_scale(profile, exposure)
    if scale is None and profile.scale is not None and exposure is not None:
        facts.append("scale: the profile's needs f-number and ISO as it was measured with; not used")
    return response, vignetting, scale


def _exposed(
    photograph: Photograph, picture: RadianceMap, response: Response | None, scale: Scale | None, facts: list[str]
) -> Film:
    """The film at the plate's exposure where that holds for the picture, else at a meter's."""
    exposure, absolute = photograph.exposure, picture.unit == "cd/m²"
    why = "the plate has no exposure"
    if exposure is not None:
        settings = f"{exposure.seconds:.4g} s"
        settings += "" if exposure.f_number is None else f", f/{exposure.f_number:g}"
        settings += "" if exposure.iso is None else f", ISO {exposure.iso:g}"
        if absolute and response is not None and scale is not None:
            facts.append(f"exposure: the plate's, {settings}, and the profile's scale")
            return Film.of(exposure, response, scale=scale)
        if absolute and exposure.f_number is not None and exposure.iso is not None:
            facts.append(f"exposure: the plate's, {settings}, by what ISO 12232 promises (to a third of a stop)")
            return Film.of(
                exposure, response, scale=None if response is None else scale_from_exposure(response, exposure)
            )
        if not absolute and response is not None:
            facts.append(f"exposure: the plate's, {settings}; the picture is taken to be on the response's scale")
            return Film.of(exposure, response)
        why = (
            "the plate has no f-number or ISO, and no scale is known"
            if absolute
            else "the picture is relative, and sRGB has no scale of its own"
        )
    from relume.virtual_camera.tone.luminance_statistics import log_average

    curves = srgb_response().log_exposure if response is None else response.log_exposure
    levels = np.arange(curves.shape[1])
    wanted = luminance(np.exp([np.interp(MIDDLE * levels[-1], levels, curve) for curve in curves]))
    facts.append(f"exposure: metered, the picture's log mean becomes 118 of 255, for {why}")
    return Film(float(wanted) / log_average(picture.radiance), response)


def _seen(photograph: Photograph, film: Film) -> RadianceMap | None:
    """What the plate shows, in the picture's unit; None where hardly any of it is neither white nor black."""
    guard = JPEG_GUARD if photograph.pixels.dtype == np.uint8 else 0
    try:
        return undevelop(photograph, film, weighting=AllButEnds(guard))
    except NotABracket:
        return None


def _compare_brightness(picture: RadianceMap, seen: RadianceMap | None, facts: list[str]) -> None:
    """How much brighter the picture comes out than the plate: by medians of what is lit, for suns sway any mean."""
    if seen is None:
        facts.append("brightness: the plate is white or black nearly everywhere; not compared with it")
        return
    medians = _median(picture), _median(seen)
    if not all(medians):
        facts.append("brightness: the picture or the plate is black; not compared")
        return
    stops = float(np.log2(medians[0] / medians[1]))
    words = f"the picture comes out {abs(stops):.1f} stops {'brighter' if stops >= 0 else 'darker'} than the plate"
    facts.append(f"brightness: {words}, by their medians")
    if abs(stops) > FAR:
        warn(
            f"{words}, by their medians: the plate's exposure may not be of the picture's unit; where both show the "
            f"same light, expose by {-stops:+.1f} stops"
        )


def _median(picture: RadianceMap) -> float:
    """The median luminance of what is lit; 0 where nothing is."""
    width, height = picture.size
    step = max(1, int(np.sqrt(width * height / _LOOKED_AT)))
    light = luminance(picture.radiance[::step, ::step])
    lit = light[np.isfinite(light) & (light > 0)]
    return float(np.median(lit)) if lit.size else 0.0


def profiled_response(profile: CameraProfile) -> Response:
    """The response with the profile's balance in it, as merging has it; raises ValueError for a profile of raws."""
    if profile.response is None:
        raise ValueError(
            f"the profile of {profile.camera or 'a camera'} is of raws, and holds no response; give another"
        )
    if profile.balance == (1, 1, 1):
        return profile.response
    # The balance is a factor on radiance that was measured, so its inverse on what is to be exposed.
    curves = profile.response.log_exposure + np.log(profile.balance)[:, None]
    return Response(curves, profile.response.noise)


def profiled_vignetting(profile: CameraProfile) -> Vignetting | None:
    """The fall-off; None where it was not measured."""
    return None if profile.vignetting is None else Vignetting.from_dict(profile.vignetting)


def profiled_scale(profile: CameraProfile, exposure: Exposure | None) -> Scale | None:
    """cd/m² per unit of that camera's radiance, where it holds for an exposure; None where it does not.

    Relative radiance takes an unknown f-number as 1 and an unknown ISO as 100, so a scale holds for exposures that have
    the same settings as those it was measured with.
    """
    if profile.scale is None or exposure is None:
        return None
    if profile.scale_exposure not in (None, (exposure.f_number is not None, exposure.iso is not None)):
        return None
    return Scale.grey(profile.scale, profile.scale_deviation or 0.0, "the camera's profile")

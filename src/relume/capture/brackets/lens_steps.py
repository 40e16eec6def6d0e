"""The steps that photographs and camera raws share: timing, and the lens, balance, scale and origin of a merged map."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from relume.capture.brackets.result import MergedBracket, clipping_report
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket
from relume.capture.exposure.consistency import BracketDoubt
from relume.capture.lens.glare import Glare, diminish_glare
from relume.capture.lens.lateral_colour import LateralColour, without_lateral_colour
from relume.capture.lens.vignetting import corrected as without_vignetting
from relume.capture.raw.merging import RawCalibration
from relume.capture.scale.absolute import Scale, apply_scale
from relume.capture.scale.readings import ChannelGains, apply_balance
from relume.image.files.metadata.gps import text_of
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.image.response import Response


@dataclass
class Steps:
    """Adds up the seconds of each step; `progress` is called with its name as it begins."""

    progress: Callable[[str], None]
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        self.progress(name)
        begin = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begin


class LensSteps:
    """Takes the lens out of the maps of one camera; what is read in the first map holds for all of them."""

    def __init__(self, settings: MergeSettings, steps: Steps) -> None:
        self._settings, self._steps = settings, steps
        self._glare: Glare | None = None
        self._lateral: LateralColour | None = None
        self._balance: ChannelGains | None = None
        self._scale: Scale | None = None

    def applied(
        self, picture: RadianceMap, bracket: Bracket, camera: Response | RawCalibration, doubts: Sequence[BracketDoubt]
    ) -> MergedBracket:
        """The bracket's map without glare, vignetting and lateral colour, balanced and scaled, with its origin.

        Its attributes hold that and its aperture, so that a map of an even wall says at which one its vignetting
        was measured.
        """
        settings = self._settings
        apertures = {photograph.exposure.f_number for photograph in bracket.photographs if photograph.exposure}
        f_number = apertures.pop() if len(apertures) == 1 else None
        if f_number is not None:
            picture = replace(picture, attributes={**picture.attributes, "f_number": f"{f_number:g}"})
        if settings.glare is not None:
            with self._steps.step("glare"):
                if self._glare is None:
                    self._glare = settings.glare(picture) if callable(settings.glare) else settings.glare
                picture = diminish_glare(picture, self._glare).picture
        if settings.vignetting:
            picture = without_vignetting(picture, settings.vignetting, f_number=f_number)
        if settings.lateral is not None:
            with self._steps.step("lateral colour"):
                if self._lateral is None:
                    self._lateral = settings.lateral(picture) if callable(settings.lateral) else settings.lateral
                picture = without_lateral_colour(picture, self._lateral)
        if settings.balance is not None:
            if self._balance is None:
                self._balance = settings.balance(picture) if callable(settings.balance) else settings.balance
            picture = apply_balance(picture, self._balance)
        picture = replace(picture, attributes={**picture.attributes, **provenance(bracket.photographs)})
        if settings.scale is not None:
            if self._scale is None:
                self._scale = settings.scale(picture, bracket, camera) if callable(settings.scale) else settings.scale
            picture = apply_scale(picture, self._scale)
        focal_length = settings.focal_length or bracket.focal_length
        return MergedBracket(
            picture, bracket.name, bracket.photographs[0].camera, bracket.exposure_table, tuple(doubts), None, None,
            clipping_report(picture, focal_length=focal_length), focal_length, self._scale, self._balance,
        )  # fmt: skip


def provenance(photographs: Sequence[Photograph]) -> dict[str, str]:
    """Attributes of the radiance map of a bracket: what all its photographs share, when it began, and its exposures.

    camera, lens, serial, iso, focal_length (mm), owner, copyright, comments : where all photographs hold the same
    camera_make : the make alike, where it is known; `camera` is then the model alone, as EXIF and other files have them
    latitude, longitude : degrees north and east, alike
    taken : of the first photograph, YYYY:MM:DD hh:mm:ss
    exposure_times : s, from the least to the most exposed; exposure_ratios to the least where they were estimated
    """
    first = photographs[0]
    # Photographs of one camera may differ in what they hold of its make: one that an editor stripped.
    make, model = "", first.camera if all(p.camera == first.camera for p in photographs) else ""
    if len({p.make_and_model for p in photographs}) == 1:
        make, model = first.make_and_model
    shared: dict[str, str | None] = {
        "camera": model,
        "camera_make": make,
        "lens": _one({p.settings.lens for p in photographs}),
        "serial": _one({p.settings.serial for p in photographs}),
        "focal_length": _one({_number(p.settings.focal_length) for p in photographs}),
        "iso": _one({_number(p.exposure.iso) if p.exposure else None for p in photographs}),
        "owner": _one({p.settings.owner for p in photographs}),
        "copyright": _one({p.settings.copyright for p in photographs}),
        "comments": _one({p.settings.comments for p in photographs}),
        "latitude": _one({_degrees(p.settings.latitude) for p in photographs}),
        "longitude": _one({_degrees(p.settings.longitude) for p in photographs}),
    }
    taken = [p.settings.taken for p in photographs if p.settings.taken]
    if taken:
        shared["taken"] = min(taken).strftime("%Y:%m:%d %H:%M:%S")
    exposures = [p.exposure for p in photographs if p.exposure]
    # Of estimated exposures only their ratios are known.
    guessed = any(exposure.source == "estimated" for exposure in exposures)
    least = exposures[0].seconds if guessed else 1.0
    name = "exposure_ratios" if guessed else "exposure_times"
    shared[name] = " ".join(f"{exposure.seconds / least:.6g}" for exposure in exposures)
    return {key: value for key, value in shared.items() if value}


def _one(values: set[str | None]) -> str | None:
    return next(iter(values)) if len(values) == 1 else None


def _number(value: float | None) -> str | None:
    return None if value is None else f"{value:g}"


def _degrees(value: float | None) -> str | None:
    return None if value is None else text_of(value)

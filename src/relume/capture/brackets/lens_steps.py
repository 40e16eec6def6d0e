"""The steps that photographs and camera raws share: timing, and the lens, balance and scale of a merged map."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket
from relume.capture.lens.glare import Glare, diminish_glare
from relume.capture.lens.vignetting import corrected as without_vignetting
from relume.capture.provenance import provenance
from relume.capture.raw.merging import RawCalibration
from relume.capture.scale.absolute import Scale, apply_scale
from relume.capture.scale.luminaire import ChannelGains, apply_balance
from relume.image.photograph import Exposure
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
        self._balance: ChannelGains | None = None
        self._scale: Scale | None = None

    def applied(
        self,
        picture: RadianceMap,
        bracket: Bracket,
        exposures: Sequence[Exposure],
        camera: Response | RawCalibration,
    ) -> tuple[RadianceMap, ChannelGains | None, Scale | None]:
        """The map without glare and vignetting, balanced and scaled, with its origin in its attributes.

        The attributes hold its aperture, so that a map of an even wall knows at which one its vignetting was measured.
        """
        settings = self._settings
        apertures = {exposure.f_number for exposure in exposures}
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
        if settings.balance is not None:
            if self._balance is None:
                self._balance = settings.balance(picture) if callable(settings.balance) else settings.balance
            picture = apply_balance(picture, self._balance)
        picture = replace(picture, attributes={**picture.attributes, **provenance(bracket.photographs)})
        if settings.scale is not None:
            if self._scale is None:
                self._scale = settings.scale(picture, bracket, camera) if callable(settings.scale) else settings.scale
            picture = apply_scale(picture, self._scale)
        return picture, self._balance, self._scale

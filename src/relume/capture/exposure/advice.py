"""Which exposures to take of a place, from one photograph of it (Debevec & Malik 1997, §2.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil, floor, log, log2

import numpy as np

from relume.capture.exposure.exposures import marked_shutter, true_shutter
from relume.capture.merging import log_deviation
from relume.capture.scale.absolute import scale_from_exposure
from relume.errors import NotABracket
from relume.image.colour_space import response_of
from relume.image.photograph import Exposure, Photograph
from relume.image.response import Response, srgb_response

ACCURATE = 0.1
"""Relative deviation of an exposure up to which a value is in the working range: a sixth of a stop."""
MIDDLE = (20 / 255, 240 / 255)
"""The working range, shares of white, where a response says nothing of noise: without toe and shoulder."""
OVERLAP = 1.0
"""Stops that neighbours show in common unless the step is given: enough for their curves to be joined."""
ROUNDING = 1 / 12 + 1e-6
"""Variance of a value of which nothing but its rounding is known."""
FEW_WHITE, FEW_BLACK = 1e-5, 1e-3
"""Shares of the picture that may be white, or too dark: a lamp is a handful of pixels, a keyhole is no loss."""
THIRD = 1 / 3
"""Stops: the steps of cameras' dials."""
FASTEST = 1 / 8000
"""Seconds: the shortest time of most shutters."""


@dataclass(frozen=True)
class BracketAdvice:
    """Which photographs cover a place.

    stops : of each photograph beside the one that was looked at, shortest first: to thirds, or, beside one whose time
        no dial has, to where a dial's thirds are
    exposures : the same as exposures, with its f-number and ISO, and the times that cameras mark: 1/50 s, not 1/47.6;
        none where its exposure is unknown
    scene : stops from the darkest to the brightest that is to be measured, R of Debevec & Malik 1997, §2.3
    working : stops that one photograph measures, F
    fewest : ⌈R / F⌉, with nothing in common between neighbours
    white, dark : shares of the picture above and below the working range
    open_above, open_below : whether the photograph does not show how bright the brightest is, how dark the darkest
    """

    stops: tuple[float, ...]
    exposures: tuple[Exposure, ...]
    scene: float
    working: float
    fewest: int
    white: float
    dark: float
    open_above: bool
    open_below: bool

    @property
    def too_short(self) -> tuple[Exposure, ...]:
        """The exposures that most shutters cannot make: they need a neutral filter or a smaller aperture."""
        return tuple(each for each in self.exposures if each.seconds < FASTEST)


def advise_brackets(
    photograph: Photograph, *, response: Response | None = None, step: float | None = None,
    brightest: float | None = None,
) -> BracketAdvice:  # fmt: skip
    """Which exposures put every part of a photographed place into the working range of the camera.

    photograph : of the place, with its exposure
    response : of the camera, as a bracket of it or its profile gives; that of the photograph's colour space unless
        given. Where it knows the camera's noise, values whose exposure is known to 10 % are the working range; else
        those from 20 to 240 of 255, the middle of the curve
    step : stops between neighbours, rounded down to thirds; the working range less one unless given, so that neighbours
        show a stop in common
    brightest : cd/m² of the brightest that is to be measured, where the photograph is white: a frosted bulb has 1e5, a
        bare filament 1e7, the sun 1.6e9. Unless given, one working range above white is covered
    Where the photograph is black, one working range below black is covered.
    Needs f-number and ISO for `brightest`. Raises ValueError for a step that is not above 0 or wider than the working
    range, a response of other values, or a picture that has no pixels; NotABracket where `brightest` has no scale.
    """
    levels = int(np.iinfo(photograph.pixels.dtype).max) + 1
    response = response or response_of(photograph) or srgb_response(levels)
    if response.levels != levels:
        raise ValueError(
            f"{photograph.name}: {levels} values, and a response of {response.levels}; give one of its own"
        )
    low, high = _working_range(response)
    working = (high - low) / log(2)
    if step is None:
        step = max(floor((working - OVERLAP) / THIRD) * THIRD, THIRD)
    if not 0 < step <= working:
        raise ValueError(f"step is {step:g} stops; expected above 0 and at most the working range, {working:.1f}")
    step = max(floor(step / THIRD + 1e-9), 1) * THIRD

    # What the photograph shows: ln exposure of each pixel's brightest channel.
    pixels = photograph.pixels if photograph.outside is None else photograph.pixels[~photograph.outside]
    pixels = pixels.reshape(-1, 3)
    if not len(pixels):
        raise ValueError(f"{photograph.name}: no pixel is part of the picture; give one that shows the place")
    seen = np.max([response.log_exposure[c][pixels[:, c]] for c in range(3)], axis=0)
    white, dark = float(np.mean(seen > high)), float(np.mean(seen < low))
    top, bottom = float(np.quantile(seen, 1 - FEW_WHITE)), float(np.quantile(seen, FEW_BLACK))
    # Beyond its ends it only says that there is more.
    open_above = white > FEW_WHITE
    open_below = bool(np.mean((pixels == 0).all(axis=1)) > FEW_BLACK)
    if open_below:
        # What exposure a value of 0 stands for is a matter of the file's bits.
        bottom = low - (high - low)
    if brightest is not None:
        top = max(_exposure_of(brightest, photograph, response), bottom)
        open_above = False
    elif open_above:
        top = high + (high - low)
    # The shortest holds the brightest, the longest the darkest, each at a mark of the dial.
    scene, shortest, longest = (top - bottom) / log(2), (high - top) / log(2), (low - bottom) / log(2)
    given = photograph.exposure
    own = 0.0 if given is None else log2(true_shutter(given.seconds))
    first = floor((own + shortest) / THIRD + 1e-9) * THIRD - own
    more = max(ceil((longest - first) / step - 1e-9), 0)
    stops = tuple(first + k * step for k in range(more + 1))
    exposures = () if given is None else tuple(
        replace(given, seconds=marked_shutter(2.0 ** (own + each)), source="given") for each in stops
    )  # fmt: skip
    fewest = max(ceil(scene / working - 1e-9), 1)
    return BracketAdvice(stops, exposures, scene, working, fewest, white, dark, open_above, open_below)


def _working_range(response: Response) -> tuple[float, float]:
    """ln exposure where the working range begins and ends, in all channels."""
    values = np.arange(response.levels) / (response.levels - 1)
    inside = (values >= MIDDLE[0]) & (values <= MIDDLE[1])
    if np.any(response.deviation**2 > ROUNDING):
        # Near white a value may be clipped, however little it scatters.
        known = (log_deviation(response) <= ACCURATE).all(axis=0) & (values <= MIDDLE[1])
        inside = known if known.any() else inside
    chosen = np.flatnonzero(inside)
    curves = response.log_exposure
    return float(curves[:, chosen[0]].max()), float(curves[:, chosen[-1]].min())


def _exposure_of(brightest: float, photograph: Photograph, response: Response) -> float:
    """ln exposure in the photograph of a luminance in cd/m²."""
    if not (np.isfinite(brightest) and brightest > 0):
        raise ValueError(f"brightest is {brightest}; expected cd/m² above 0")
    if photograph.exposure is None:
        raise NotABracket(f"{photograph.name} holds no exposure, so that its cd/m² are unknown; leave brightest out")
    scale = scale_from_exposure(response, photograph.exposure)
    return float(np.log(brightest / scale.luminance * photograph.exposure.factor))

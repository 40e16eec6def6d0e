"""What ties the channels of a response: the exposures that make up white, and the curves' ends that say so.

A camera balances its channels before it encodes them, so that all saturate at one light. The curves' last values are
those least known: few places show them, JPEG of half the colour resolution scatters them by several values, and what
passes white is cut off. So an end is what the channel's own curve says and what it should be beside the other channels,
each by its uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from relume.capture.response.calibration import Calibration
from relume.capture.response.saturation import WHITE, White

OBSERVED = 0.9
"""Share of the greatest value up to which a curve must have been observed for its end to be believed as it is."""
GUESSED = 0.7
"""The same below which a curve's end is a guess, whatever it looks like: sixteen scans of film, whose blue is hardly
seen above the middle, came out yellow."""
ALIKE = 0.15
"""ln exposure by which a curve's unobserved end may depart from those of the other channels. Cameras whose curves
differ by channel stay within 0.05 there; curves that nothing held came out up to 3 off, which tinted whole pictures."""
KNOWN = 0.86
"""Share of the greatest value up to which JPEG leaves a curve within 1 % (value 219): its end is judged from there."""
SCATTER = 2.0
"""Pixel values by which the end of a curve from JPEGs may be wrong; 1 to 8 were seen on virtual cameras."""
LEAST = 0.01
"""ln exposure by which the ends of channels differ that are alike below."""
GOES_ON = 0.4
"""Share of a channel's departure from the others between the middle and KNOWN that goes on from there to its end.
0.35 to 0.65 on cameras whose channels differ; between 0.3 and 0.5 results differ by less than 1 %."""
UNSURE = 0.5
"""Standard deviation of that share."""


def tied(calibration: Calibration, whites: Sequence[White]) -> Calibration:
    """The calibration with its channels tied at white, and the ends of its curves where they are likely to be.

    whites : of all the brackets that the calibration comes from
    """
    curves, levels = calibration.response.log_exposure, calibration.response.levels
    ends = neutral_exposures(calibration, whites)
    tops = _tops(levels, whites)
    known = _known(levels)
    # From where it is known each curve is bent towards its end, so that it rises as before; guesses stay as they are.
    # It is bent by the whole at the value where its channel ends, as the whole is balanced.
    rise = np.clip((np.arange(levels) - known) / np.maximum(tops - known, 1)[:, None], 0.0, 1.0) ** 2
    moved = np.where(_observed(calibration), ends - _ends(curves, tops), 0.0)
    bent = np.maximum.accumulate(curves + moved[:, None] * rise, axis=1)
    bent += 1e-9 * (np.arange(levels) - (levels - 1)) * (moved[:, None] != 0)
    response = replace(calibration.response, log_exposure=bent)
    return replace(calibration, response=response).balanced_where(ends)


def neutral_exposures(calibration: Calibration, whites: Sequence[White]) -> np.ndarray:
    """(3,) ln exposure of each channel, on the curves' scale, that make up white: what is tied to be achromatic.

    whites : of all the brackets that the calibration comes from

    All channels saturate at once: at the values that `whites` hold, else at the greatest value. Ends of curves that
    were observed are weighed against the other channels' (`_likely`). An end that was not is extrapolated; where it is
    a guess, or departs from the other channels' by more than cameras' curves differ, the channel is tied to them at the
    highest value that it shows, and where no channel was observed up to white all are tied at the highest value that
    all show.
    """
    curves, levels = calibration.response.log_exposure, calibration.response.levels
    tops = _tops(levels, whites)
    own, shown, seen = _ends(curves, tops), _shown(calibration), _observed(calibration)
    if not seen.any():
        # From the highest value that all show to the end, all curves should go on alike.
        common = curves[:, shown.min()]
        sure = shown.min() >= GUESSED * (levels - 1) and np.ptp(own - common) < ALIKE
        return own if sure else common
    ends = own.copy()
    # A channel that was pressed together ends where it ends.
    whole = seen & (tops >= WHITE * levels)
    if levels == 256 and whole.sum() > 1:
        ends[whole] = _likely(curves[whole], own[whole])
        ends[~seen] += np.mean(ends[whole] - own[whole])
    for c in np.flatnonzero(~seen):
        expected = curves[c, shown[c]] + np.mean(ends[seen] - curves[seen, shown[c]])
        if shown[c] < GUESSED * (levels - 1) or abs(expected - ends[c]) > ALIKE:
            ends[c] = expected
    return ends


def _likely(curves: np.ndarray, own: np.ndarray) -> np.ndarray:
    """(C,) where curves (C, 256) of channels probably end, of which `own` (C,) is what each says by itself.

    From value KNOWN on, channels rise alike, but for part of what they differ by below.
    """
    known, middle = curves[:, _known(256)], curves[:, 127]
    departure = (known - middle) - np.mean(known - middle)
    rise = own - known - GOES_ON * departure
    common = np.median(rise)
    # What a pixel value is worth at the end, the same for all: a single curve may run away there.
    value = np.median(rise) / (255 - _known(256))
    expected, measured = UNSURE * np.abs(departure) + LEAST, SCATTER * value
    share = expected**2 / (expected**2 + measured**2)
    return known + GOES_ON * departure + common + share * (rise - common)


def _known(levels: int) -> int:
    return round(KNOWN * (levels - 1))


def _tops(levels: int, whites: Sequence[White]) -> np.ndarray:
    """(3,) the value at which each channel ends."""
    return np.array([max((w.value for w in whites if w.channel == c), default=levels - 1) for c in range(3)])


def _ends(curves: np.ndarray, tops: np.ndarray) -> np.ndarray:
    """(3,) ln exposure at these values, one a channel."""
    return np.array([curve[top] for curve, top in zip(curves, tops, strict=True)])


def _shown(calibration: Calibration) -> np.ndarray:
    """(3,) the highest value that each channel was observed at, but for the last of 200 observations."""
    most = calibration.response.levels - 1
    return np.array([min(np.percentile(s[:, 1], 99.5), most) for s in calibration.samples]).astype(int)


def _observed(calibration: Calibration) -> np.ndarray:
    """(3,) whether a channel was observed up to near white."""
    return _shown(calibration) >= OBSERVED * (calibration.response.levels - 1)

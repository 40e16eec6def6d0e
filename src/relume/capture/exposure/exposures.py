"""The exposure of every photograph of a bracket: given by hand, listed beside it, in its EXIF, in its name where asked,
or estimated from its pixels.

The order is fixed, from the strongest word to the weakest, and `Exposure.source` says which one counted.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import log2
from pathlib import Path

import numpy as np

from relume.capture.exposure.comparison import brightness_chain, reduced
from relume.capture.exposure.folder import listed_exposures
from relume.capture.exposure.named_times import seconds_in_names, times_in_names
from relume.capture.exposure.sidecar import ExposureList, number_in, read_times
from relume.errors import NotABracket, warn
from relume.image.photograph import Exposure, Photograph

# In the order of the dial, so that each is a step from the one before it; s, or 1/s for the fast ones.
_THIRDS_SLOW = (1, 1.3, 1.6, 2, 2.5, 3.2, 4, 5, 6, 8, 10, 13, 15, 20, 25, 30)
_THIRDS_FAST = (1, 1.25, 5 / 3, 2, 2.5, 10 / 3, 4, 5, 6, 8, 10, 13, 15, 20, 25, 30, 40, 50, 60, 80, 100, 125, 160, 200)
_THIRDS_FAST += (250, 320, 400, 500, 640, 800, 1000, 1250, 1600, 2000, 2500, 3200, 4000, 5000, 6400, 8000)
_HALVES_SLOW = (1.5, 3, 6, 10, 20)
_HALVES_FAST = (10 / 7, 10 / 3, 6, 10, 20, 45, 90, 180, 350, 750, 1500, 3000, 6000)
_MARKS = (
    *((seconds, step / 3) for step, seconds in enumerate(_THIRDS_SLOW)),
    *((1 / speed, -step / 3) for step, speed in enumerate(_THIRDS_FAST)),
    (3.0, 5 / 3),  # other makers' marks for 3.2 and 0.3
    (1 / 3, -5 / 3),
    *((seconds, step + 1 / 2) for step, seconds in enumerate(_HALVES_SLOW)),
    *((1 / speed, -step - 1 / 2) for step, speed in enumerate(_HALVES_FAST)),
)
_ELECTRONIC = (10000, 12500, 16000, 20000, 25000, 32000)
"""Marks in 1/s beyond the fastest mechanical shutters'."""
_EXACT = 2e-3
"""How near a time must come to a mark: EXIF holds 1/60 as a fraction, lists print it with three or four digits."""
Times = Sequence[float] | str | os.PathLike[str] | None
"""Seconds, one a photograph in their order, or the path of a file that lists them."""


def exposed(
    photographs: Sequence[Photograph],
    *,
    times: Times = None,
    times_from_names: bool = False,
    sidecars: bool = True,
    shutter_speeds: Mapping[str, float | None] | None = None,
) -> list[Photograph]:
    """The photographs, each with the exposure of the strongest source that has it.

    photographs : named by the paths of their files
    times : seconds, one a photograph, or the path of a list; replaces the whole EXIF exposure, because a hand-written
        list is the stronger word
    times_from_names : read the times from the names (`named_times`); they too replace the whole EXIF exposure
    sidecars : look for such a list beside the photographs; it too replaces the whole EXIF exposure
    shutter_speeds : APEX values by name (`Facts.shutter_speed`); where given, marked shutter speeds are replaced by
        the powers of two that they stand for (`true_shutter`), in all exposures but estimated ones
    Raises NotABracket for a wrong number of times, lists that disagree or name no photograph, and photographs whose
    exposure cannot be estimated either; UnreadableFile. Warns of every exposure that is uncertain.
    """
    if times_from_names:
        if times is not None:
            raise ValueError("times are given and are to be read from the names too; choose one of the two")
        named = seconds_in_names([p.name for p in photographs])
        listed = [Exposure(seconds, source="name") for seconds in named]
    elif times is None:
        listed = _listed(photographs, sidecars)
    elif isinstance(times, str | os.PathLike):
        listed = _given_list(photographs, read_times(times))
    else:
        if len(times) != len(photographs):
            raise NotABracket(
                f"{len(times)} times were given for {len(photographs)} photographs; give one a photograph"
            )
        listed = [Exposure(float(seconds)) for seconds in times]
    stated = [replace(p, exposure=e or p.exposure) for p, e in zip(photographs, listed, strict=True)]
    stated = _on_one_scale(stated, photographs)
    if shutter_speeds is not None:
        for place, p in enumerate(stated):
            if p.exposure is not None:
                seconds = true_shutter(p.exposure.seconds, shutter_speeds.get(p.name))
                stated[place] = replace(p, exposure=replace(p.exposure, seconds=seconds))
    # A photograph alone has nothing to be compared with: the bracket refuses it.
    return estimated(stated) if len(stated) > 1 else stated


def estimated(photographs: Sequence[Photograph]) -> list[Photograph]:
    """The photographs, those without an exposure with one estimated from their pixels, if sRGB encoded them.

    Where others have one, the estimate is read off theirs: between two of them it does not depend on the encoding.
    Where none has, only ratios are known, and the photograph in the middle is counted as exposed for one second.
    Cameras that press more contrast into their pictures than sRGB have these ratios estimated too large, by a quarter
    to a third of the stops. Warns of each; raises NotABracket where pixels show nothing.
    """
    unknown = [i for i, p in enumerate(photographs) if p.exposure is None]
    if not unknown:
        return list(photographs)
    try:
        seen = brightness_chain([reduced(p) for p in photographs])
    except NotABracket as error:
        raise NotABracket(f"{error}{read_like_times(photographs)}") from None
    known = [p.exposure for p in photographs if p.exposure is not None]
    exposures: list[Exposure] = []
    if known:
        stated = [(s, np.log(p.exposure.factor)) for s, p in zip(seen, photographs, strict=True) if p.exposure]
        base = known[0]
        scale = replace(base, seconds=1.0).factor
        exposures = [
            replace(base, seconds=float(np.exp(_read_off(seen[i], sorted(stated)))) / scale, source="estimated")
            for i in unknown
        ]
        names = ", ".join(photographs[i].name for i in unknown)
        warn(f"{names}: no exposure is known; it is estimated from the other photographs, so give all with --times")
    else:
        middle = np.sort(seen)[len(seen) // 2]
        exposures = [Exposure(float(seconds), source="estimated") for seconds in np.exp(seen - middle)]
        ratios = " : ".join(f"{ratio:.3g}" for ratio in np.exp(np.sort(seen) - seen.min()))
        warn(
            f"{photographs[0].name} and others: no exposure is known; only the ratios {ratios} are known, from the "
            f"pixels under an assumed sRGB curve; {_advice(photographs, seen)}"
        )
    by_index = dict(zip(unknown, exposures, strict=True))
    return [replace(p, exposure=by_index[i]) if i in by_index else p for i, p in enumerate(photographs)]


def _listed(photographs: Sequence[Photograph], sidecars: bool) -> list[Exposure | None]:
    """What the lists beside the photographs give, folder by folder."""
    listed: list[Exposure | None] = [None] * len(photographs)
    folders = {Path(p.name).parent for p in photographs} if sidecars else set()
    for folder in sorted(folders):
        members = [i for i, p in enumerate(photographs) if Path(p.name).parent == folder]
        paths = [Path(photographs[i].name) for i in members]
        for i, exposure in zip(members, listed_exposures(paths, _brightness(photographs, members)), strict=True):
            listed[i] = exposure
    return listed


def _given_list(photographs: Sequence[Photograph], given: ExposureList) -> list[Exposure | None]:
    paths = [Path(p.name) for p in photographs]
    if not given.names and len(given.exposures) != len(paths):
        raise NotABracket(
            f"{given.path}: {len(given.exposures)} times for {len(paths)} photographs; list one a photograph, or names"
        )
    listed = given.exposures_of(paths, range(len(paths)), _brightness(photographs, range(len(paths))))
    missing = [str(path) for path, exposure in zip(paths, listed, strict=True) if exposure is None]
    if len(missing) == len(paths):
        raise NotABracket(
            f"{given.path}: names none of the photographs, such as {paths[0].name}; check which list it is"
        )
    if missing:
        warn(f"{given.path}: does not name {', '.join(missing)}; add them to the list")
    return [replace(exposure, source="given") if exposure else None for exposure in listed]


def _brightness(photographs: Sequence[Photograph], members: Sequence[int]) -> Callable[[], list[float]]:
    return lambda: [reduced(photographs[i]).mean for i in members]


def _on_one_scale(stated: list[Photograph], photographs: Sequence[Photograph]) -> list[Photograph]:
    """Where only some exposures have aperture or ISO, the others take them from their own EXIF if it has them."""
    for attribute in ("f_number", "iso"):
        known = [p.exposure is None or getattr(p.exposure, attribute) is not None for p in stated]
        if any(p.exposure and ok for p, ok in zip(stated, known, strict=True)) and not all(known):
            stated = [
                replace(p, exposure=replace(p.exposure, **{attribute: getattr(original.exposure, attribute)}))
                if p.exposure and original.exposure and not ok
                else p
                for p, original, ok in zip(stated, photographs, known, strict=True)
            ]
    return stated


def _read_off(seen: float, stated: Sequence[tuple[float, float]]) -> float:
    """ln exposure at `seen` on the line through `stated`, carried on at both ends with the slope of the whole."""
    places, values = np.array(stated).T
    run = places[-1] - places[0]
    slope = (values[-1] - values[0]) / run if run > 0.5 else 1.0
    beyond = min(seen - places[0], 0.0) + max(seen - places[-1], 0.0)
    return float(np.interp(seen, places, values) + slope * beyond)


def read_like_times(photographs: Sequence[Photograph]) -> str:
    """The end of a refusal: that the names read like times, and which; "" where they do not."""
    times = times_in_names([p.name for p in photographs])
    if times is None:
        return ""
    return f"; the file names read like times: if they are, give --times-from-names ({', '.join(times)} s)"


def _advice(photographs: Sequence[Photograph], seen: np.ndarray) -> str:
    times = times_in_names([p.name for p in photographs])
    if times is None:
        return "give the exposure times with --times"
    seconds = [number_in(time) for time in times]
    if list(np.argsort(seconds)) != list(np.argsort(seen)):
        return "give the exposure times with --times; the file names read like times, but not of these photographs"
    return read_like_times(photographs).removeprefix("; ")


def true_shutter(seconds: float, shutter_speed: float | None = None) -> float:
    """The time for which a shutter marked `seconds` is open: 1/64 s for 1/60, 16 s for 15, 2^(−13/3) s for 1/20.

    seconds : as marked; any other time than a mark of a whole, half or third stop is returned as it is
    shutter_speed : −log₂ of the time as the camera wrote it beside (APEX ShutterSpeedValue); decides where a mark
        serves two scales (1/20 is the third stop 1/20.2 and the half stop 1/22.6), which else are taken for thirds

    "The actual exposure times varied by powers of two between stops, rather than the rounded numbers displayed"
    (Debevec & Malik 1997, footnote 4, of one camera whose shutter they recorded). An option and not the rule:
    telephones and electronic shutters write the time they measured, and those locked to mains light keep 1/60 for 1/60.
    Either mistake is 7 % at most, and refining the exposures from the pixels removes it.
    """
    steps = [step for mark, step in _MARKS if abs(seconds - mark) <= _EXACT * mark]
    if not steps:
        return seconds
    if shutter_speed is None:
        return 2.0 ** steps[0]
    return 2.0 ** min(steps, key=lambda step: abs(step + shutter_speed))


def marked_shutter(seconds: float) -> float:
    """The time as cameras mark it that stands for this one: 1/50 s for 1/50.8, the nearest third of a stop.

    seconds : that a shutter is open, as `true_shutter` gives it
    Longer than 30 s, where no dial has marks, whole seconds; shorter than 1/32 000 s it is returned as it is.
    """
    step = round(3 * log2(seconds))
    fast = (*_THIRDS_FAST, *_ELECTRONIC)
    if step < 0:
        return 1 / fast[-step] if -step < len(fast) else seconds
    return float(_THIRDS_SLOW[step]) if step < len(_THIRDS_SLOW) else float(round(seconds))


def seconds_in_words(seconds: float) -> str:
    """1/60 s, 0.4 s, 15 s: a time of so many `seconds` as photographers say it.

    Shutters are marked 1/4 and faster as fractions of whole numbers; 0.3 s and longer as they are.
    """
    if 1e-6 < seconds < 0.29 and abs(round(1 / seconds) * seconds - 1) < 0.02:
        return f"1/{round(1 / seconds)} s"
    return f"{seconds:.4g} s"

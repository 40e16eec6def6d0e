"""Doubts about a bracket: what its files and its pixels say that does not fit together.

Nothing here stops a merge. What cannot be merged at all `Bracket` refuses.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume import errors
from relume.capture.exposure.bracket import Bracket, same_pixels
from relume.capture.exposure.comparison import (
    STRANGE,
    Reduced,
    brightness_chain,
    log_ratio,
    reduced,
    similarity,
    structure,
)
from relume.capture.exposure.exposures import seconds_in_words
from relume.capture.exposure.folder import name_order
from relume.capture.exposure.named_times import times_in_names
from relume.capture.exposure.overexposed import NEARLY, STRANGE_WHITE, darkest_alike, share_shown
from relume.capture.exposure.validation import ExposureCorrections, compare
from relume.errors import NotABracket
from relume.image.photograph import Photograph
from relume.image.response import Response

_STOP = float(np.log(2.0))
_LEAST = 0.22 * _STOP  # a third of a stop, found within a tenth
_GROSS = 1.5 * _STOP
_EVIDENCE, _GROSS_EVIDENCE = 0.05, 0.01
"""Shares of a picture seen in a neighbour too, on which a small or a gross departure is believed: a lamp's glare is
less than the first and looks like two thirds of a stop."""
_SAME = 0.1 * _STOP  # marked speeds of one exposure differ by less
_CAST, _STRONG_CAST = 0.35 * _STOP, 0.7 * _STOP
"""Between the channels: curves that differ by channel reach 0.25 stops, and at 0.7 the colours are plainly others."""
_FEWEST_LEVELS = 64
_PURE = ((0, 0, 1), (0, 1, 0), (1, 0, 0), (1, 0, 1), (0, 1, 1), (1, 1, 0))
_BORDER = 2e-3  # of a photograph; a lamp that saturates one channel alone is smaller, or not black in the others
_SAMPLES = 1_000_000  # pixels in which levels are counted


NOTHING_TO_DO = "nothing need be done"


@dataclass(frozen=True)
class BracketDoubt:
    """Something about a bracket that a photographer should know; `ranked` is the `errors.Doubt` that it becomes.

    frame : the file it is about, or the bracket's name where it is about all
    what : is doubtful
    remedy : what to do
    degraded : whether what is merged regardless is worse than it could be
    effect : by what share the light is likely wrong for it, see `errors.Doubt`; None where there is no estimate
    """

    frame: str
    what: str
    remedy: str
    degraded: bool
    effect: float | None = None

    @property
    def ranked(self) -> errors.Doubt:
        """The same for ranking; what is degraded by an unknown amount counts as wrong."""
        unknown = errors.WRONG if self.degraded else None
        return errors.Doubt(self.line, unknown if self.effect is None else self.effect)

    @property
    def line(self) -> str:
        """All of it in one line."""
        return f"{self.frame}: {self.what}; {self.remedy}"


def check(bracket: Bracket, response: Response | None = None) -> tuple[BracketDoubt, ...]:
    """The doubts about a bracket, drawn from what its files say and from its pixels made small.

    response : of the camera, if known; without it a curve is fitted, which cannot find the scale of all exposures, and
        of three photographs cannot say that the first or the last is off by a third of a stop
    """
    pictures = [reduced(p) for p in bracket.photographs]
    strangers = _strangers(bracket, pictures)
    doubts = [*_of_settings(bracket), *_of_sources(bracket), *_of_copies(bracket), *_of_levels(bracket)]
    if borders := list(_of_borders(bracket)):
        # What is not part of the picture makes exposures and scenes look wrong: it is to be taken out before all else.
        return (*doubts, *borders)
    names = {doubt.frame for doubt in strangers}
    # Photographs of another scene would be blamed for their exposures too, and their neighbours with them.
    members = [i for i, p in enumerate(bracket.photographs) if p.name not in names]
    doubts += strangers
    if len(members) > 1 and bracket.name not in names:
        order = sorted(members, key=lambda i: pictures[i].mean)
        photographs, sorted_pictures = [bracket.photographs[i] for i in order], [pictures[i] for i in order]
        doubts += _of_exposures(bracket, photographs, sorted_pictures, response)
    return (*doubts, *_of_order(bracket))


def _of_settings(bracket: Bracket) -> Iterator[BracketDoubt]:
    photographs = bracket.photographs
    # One camera and lens took all; what another one adds is its own response, fall-off or place.
    for what, values, remedy, effect in (
        ("cameras", [p.camera for p in photographs], "merge each camera's photographs by themselves", 0.5),
        ("camera bodies", [p.settings.serial for p in photographs], "merge each body's photographs by themselves", 0.3),
        ("lenses", [p.settings.lens for p in photographs], "merge each lens's photographs by themselves", 0.3),
        (
            "focal lengths",
            [f"{p.settings.focal_length:g} mm" if p.settings.focal_length else None for p in photographs],
            "leave out the photographs taken at another zoom",
            0.5,
        ),
    ):
        if len(found := sorted({value for value in values if value})) > 1:
            yield BracketDoubt(bracket.name, f"taken with different {what}: {', '.join(found)}", remedy, True, effect)
    table = bracket.exposure_table
    if len(apertures := sorted({line.f_number for line in table if line.f_number})) > 1:
        stated = ", ".join(f"f/{value:g}" for value in apertures)
        yield BracketDoubt(
            bracket.name,
            f"the aperture varies ({stated}); it is allowed for, but vignetting and depth of field vary with it",
            "varying the aperture is not recommended: vary the time alone",
            False,
            0.03,
        )
    if len(gains := sorted({line.iso for line in table if line.iso})) > 1:
        stated = ", ".join(f"{value:g}" for value in gains)
        yield BracketDoubt(
            bracket.name,
            f"the ISO varies ({stated}); it is allowed for, but cameras' ISO steps are inexact, and the standard error "
            "is that of one ISO",
            "switch automatic ISO off and vary the time alone",
            True,
            0.05,
        )


def _of_sources(bracket: Bracket) -> Iterator[BracketDoubt]:
    estimated = [line.name for line in bracket.exposure_table if line.source == "estimated"]
    if estimated:
        named = times_in_names([photograph.name for photograph in bracket.photographs])
        suggested = f"the names read {', '.join(named)}: take those with --times-from-names, or " if named else ""
        yield BracketDoubt(
            bracket.name if len(estimated) == len(bracket.photographs) else ", ".join(estimated),
            "no exposure is known; it was estimated from the pixels",
            f"{suggested}give the exposure times with --times",
            True,
            0.5,  # over four stops; the photographs alone leave the contrast open by some 15 % in the exponent
        )


def _of_copies(bracket: Bracket) -> Iterator[BracketDoubt]:
    photographs = bracket.photographs
    for i, second in enumerate(photographs):
        first = next((p for p in photographs[:i] if same_pixels(p, second)), None)
        # All black and all white photographs are alike without being copies.
        if first is None or np.ptp(second.pixels[::7, ::7]) < 0.05 * np.iinfo(second.pixels.dtype).max:
            continue
        same = abs(_log_exposure(first) - _log_exposure(second)) < _SAME
        stated = "" if same else f", yet given {_stated(second)} and not {_stated(first)}"
        yield BracketDoubt(
            second.name, f"pixel for pixel {first.name}{stated}", "take one of them out", True, 0.02 if same else 0.5
        )


def _of_levels(bracket: Bracket) -> Iterator[BracketDoubt]:
    """Doubt a response drawn from photographs that hold but a few of the values they could."""
    photographs = bracket.photographs
    most = int(np.iinfo(photographs[0].pixels.dtype).max) + 1
    step = max(1, round((photographs[0].pixels[..., 0].size * len(photographs) / _SAMPLES) ** 0.5))
    seen = np.zeros((3, most), bool)
    for photograph in photographs:
        sample = photograph.pixels[::step, ::step].reshape(-1, 3)
        for channel in range(3):
            seen[channel, sample[:, channel]] = True
    fewest = int(seen.sum(axis=1).min())
    if fewest < _FEWEST_LEVELS:
        yield BracketDoubt(
            bracket.name,
            f"too few grey levels to recover a response: a channel holds {fewest} of {most} values",
            "give the camera's own files, or a response recovered before",
            True,
            0.3,
        )


def _of_borders(bracket: Bracket) -> Iterator[BracketDoubt]:
    """Doubt pixels of one pure colour, such as registered scans have at their borders."""
    for colour in _PURE:
        shares = [
            float(np.all(p.pixels[::3, ::3] == np.array(colour) * np.iinfo(p.pixels.dtype).max, axis=2).mean())
            for p in bracket.photographs
            if p.outside is None
        ]
        if shares and max(shares) > _BORDER:
            written = ",".join(str(v * np.iinfo(bracket.photographs[0].pixels.dtype).max) for v in colour)
            yield BracketDoubt(
                bracket.name,
                f"up to {100 * max(shares):.1f} % of a photograph are exactly the colour {written}, as borders are "
                "that are no part of the picture",
                f"leave them out with --ignore {written}",
                True,
                max(0.3, max(shares)),  # merged as light, and in the response
            )


def _strangers(bracket: Bracket, pictures: Sequence[Reduced]) -> list[BracketDoubt]:
    order = sorted(range(len(pictures)), key=lambda i: pictures[i].mean)
    structures, shares = [structure(picture) for picture in pictures], [share_shown(picture) for picture in pictures]
    # By how much each is more alike to another than photographs of different scenes may be.
    best: dict[int, float] = {}
    # The photograph two further on too: the neighbours of a stranger are none.
    for distance in (1, 2):
        for first, second in zip(order, order[distance:], strict=False):
            if shares[second] < NEARLY:
                alike, limit = darkest_alike(pictures[first], pictures[second]), STRANGE_WHITE
            else:
                alike, limit = similarity(structures[first], structures[second]), STRANGE
            for member in (first, second) if alike is not None else ():
                best[member] = max(best.get(member, -2.0), (alike or 0.0) - limit)
    strange = [i for i, above in sorted(best.items()) if above < 0]
    if strange and len(strange) == len(best):
        what = "these photographs do not show one scene"
        return [BracketDoubt(bracket.name, what, "merge photographs of one scene, taken from one place", True, 1.0)]
    return [
        BracketDoubt(
            bracket.photographs[i].name,
            "seems not to be of the scene that the others show",
            "leave it out",
            True,
            min(0.5, shares[i]),  # what is white is not merged
        )
        for i in strange
    ]


def _of_exposures(
    bracket: Bracket, photographs: Sequence[Photograph], pictures: Sequence[Reduced], response: Response | None
) -> Iterator[BracketDoubt]:
    stated = np.array([_log_exposure(p) for p in photographs])
    result = compare(pictures, stated, response)
    yield from _of_white_balance(photographs, result)
    if np.ptp(stated) < _SAME:
        try:
            shown = float(np.ptp(brightness_chain(pictures)))
        except NotABracket:
            return
        if shown > 0.5 * _STOP:
            yield BracketDoubt(
                bracket.name,
                f"all have {_stated(photographs[0])} by {_source(photographs[0])}, yet their brightness differs by "
                f"about {shown / _STOP:.1f} stops",
                "give the exposure times with --times",
                True,
                float(np.expm1(shown)),
            )
        return
    wrong = [i for i in range(len(stated)) if _believed(result, i)]
    gross = [i for i in wrong if abs(result.corrections[i]) >= _GROSS]
    turned = compare(pictures, np.sort(stated), response) if _turned(pictures, stated) else None
    if turned is not None and not any(_believed(turned, i) for i in range(len(stated))):
        yield BracketDoubt(
            bracket.name,
            f"the exposures are in another order than the photographs' brightness ({_pairs(photographs)})",
            "give the times in the order of the files, and as seconds: 1/30, not 30",
            True,
            1.0,
        )
        return
    yield from (_of_exposure(photographs[i], float(result.corrections[i])) for i in gross or wrong)
    others = [i for i in range(len(stated)) if i not in gross]
    if gross and len(others) > 1:
        # A gross error drags the curve with it; the others are looked at again without it.
        result = compare([pictures[i] for i in others], stated[others], response)
        for place, i in enumerate(others):
            if _believed(result, place):
                yield _of_exposure(photographs[i], float(result.corrections[place]))


def _of_exposure(photograph: Photograph, correction: float) -> BracketDoubt:
    direction = "more" if correction > 0 else "less"
    amount = _amount(abs(correction) / _STOP)
    # Its neighbours measure the same pixels, and hold half of the weight.
    effect = float(np.expm1(abs(correction))) / 2
    if abs(correction) >= _GROSS:
        return BracketDoubt(
            photograph.name,
            f"{_source(photograph)} seems wrong by {amount}: at {_stated(photograph)}, it shows that much {direction} "
            "light",
            "give the right times with --times, or leave it out",
            True,
            effect,
        )
    return BracketDoubt(
        photograph.name,
        f"given {_stated(photograph)} by {_source(photograph)}, it shows about {amount} {direction} light "
        "beside the others",
        "correct it with --times, or from four photographs on with --refine",
        True,
    )


def _of_white_balance(photographs: Sequence[Photograph], result: ExposureCorrections) -> Iterator[BracketDoubt]:
    """Doubt the colours where the channels of neighbours drift apart, if the camera was free to let them."""
    for first, second, cast, shared in zip(photographs, photographs[1:], result.casts, result.shared, strict=False):
        automatic = first.settings.automatic_white or second.settings.automatic_white
        spread = np.nanmax(cast) - np.nanmin(cast) if np.isfinite(cast).any() else 0.0
        if shared < _EVIDENCE or spread < (_CAST if automatic else _STRONG_CAST):
            continue
        channels = ("red", "green", "blue")
        strong, weak = channels[int(np.nanargmax(cast))], channels[int(np.nanargmin(cast))]
        why = "by its automatic white balance" if automatic else "as if by white balance or another light"
        yield BracketDoubt(
            second.name,
            f"its colours differ from those of {first.name} {why}: {strong} against {weak} by "
            f"{spread / _STOP:.1f} stops",
            "photograph again with a fixed white balance; merged, the colours are those of neither",
            bool(spread >= _STRONG_CAST),
            float(np.expm1(spread)) / 2,  # what is merged lies between the two
        )


def _of_order(bracket: Bracket) -> Iterator[BracketDoubt]:
    names = [name_order(p.name) for p in bracket.photographs]
    if names not in (sorted(names), sorted(names, reverse=True)):
        what = "the files are not named in the order of their exposures; they were sorted by exposure"
        yield BracketDoubt(bracket.name, what, NOTHING_TO_DO, False, 0.0)


def _pairs(photographs: Sequence[Photograph]) -> str:
    """Which exposure each photograph is taken for; of many the first."""
    words = [f"{Path(p.name).name} {_stated(p)}" for p in photographs[:5]]
    return ", ".join(words) + ", …" * (len(photographs) > len(words))


def _turned(pictures: Sequence[Reduced], stated: np.ndarray) -> bool:
    """Whether a photograph that is plainly brighter than another is stated to be plainly less exposed."""
    falls = [i for i in range(len(stated) - 1) if stated[i + 1] - stated[i] < -_LEAST]
    return any((log_ratio(pictures[i], pictures[i + 1]) or 0.0) > _LEAST for i in falls)


def _believed(result: ExposureCorrections, place: int) -> bool:
    size, evidence = abs(result.corrections[place]), result.evidence[place]
    return bool(size >= _LEAST and evidence >= _EVIDENCE) or bool(size >= _GROSS and evidence >= _GROSS_EVIDENCE)


def _log_exposure(photograph: Photograph) -> float:
    assert photograph.exposure is not None  # a Bracket's photographs have one
    return float(np.log(photograph.exposure.factor))


def _source(photograph: Photograph) -> str:
    assert photograph.exposure is not None
    return {"given": "the time given", "sidecar": "the list beside it", "EXIF": "its EXIF", "name": "its name"}.get(
        photograph.exposure.source, "its estimate"
    )


def _stated(photograph: Photograph) -> str:
    assert photograph.exposure is not None
    return seconds_in_words(photograph.exposure.seconds)


def _amount(stops: float) -> str:
    words = ((0.42, "a third of a stop"), (0.58, "half a stop"), (0.84, "two thirds of a stop"), (1.25, "a stop"))
    return next((word for limit, word in words if stops < limit), f"{stops:.{0 if stops >= 3 else 1}f} stops")

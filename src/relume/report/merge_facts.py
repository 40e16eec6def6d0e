"""Facts of a merge: numbers for machines, and lines for a person."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from relume.capture.brackets.result import MergedBracket
from relume.capture.brackets.shoot import MergedShoot, MergePlan
from relume.capture.exposure.advice import BracketAdvice
from relume.capture.exposure.exposures import seconds_in_words
from relume.report.capture_report import clipped_facts, counted, frame_facts, in_words

Block = tuple[str, dict[str, object]]
"""A title and lines under it, by their first words."""


def merge_facts(shoot: MergedShoot) -> dict[str, object]:
    """Everything about merged brackets for a machine; what is not known is None.

    shoot : as `merge_shoot` made it
    """
    cameras = shoot.result.cameras.items()
    return {
        "brackets": [_bracket(*each) for each in zip(shoot.result.brackets, shoot.targets, strict=True)],
        "misfit": {name: camera.calibration.residual.tolist() for name, camera in cameras if camera.calibration},
        "doubts": list(shoot.result.warnings),
        "notes": list(shoot.result.notes),
        "profile": {name: str(path) for name, path in shoot.profiles.items()},
    }


def advice_summary(advice: BracketAdvice) -> dict[str, object]:
    """What `advise_brackets` says, as lines for a person.

    advice : of `advise_brackets`
    """
    ends = {"lighter than 240 of 255": advice.white, "too dark": advice.dark}
    shown = [f"{100 * share:.2g} % {word}" for word, share in ends.items() if share > 0]
    more = " or more" if advice.open_above or advice.open_below else ""
    stops = ", ".join(f"{each:+.3g}" for each in advice.stops)
    lines: dict[str, object] = {
        "to be measured": f"{advice.scene:.1f} stops{more}" + (f"; here {' and '.join(shown)}" if shown else ""),
        "working range": f"{advice.working:.1f} stops, so {counted(advice.fewest, 'photograph')} at least",
        "take": f"{counted(len(advice.stops), 'photograph')}, at {stops} stops from this one",
    }
    if advice.exposures:
        lines["exposures"] = ", ".join(seconds_in_words(each.seconds) for each in advice.exposures)
    if advice.open_above:
        lines["then"] = "look at the shortest: while any of it is white, take one more, or give --brightest"
    if advice.too_short:
        lines["filter"] = (
            "1 is shorter than 1/8000 s: use a neutral filter for it"
            if len(advice.too_short) == 1
            else f"{len(advice.too_short)} are shorter than 1/8000 s: use a neutral filter for them"
        )
    return lines


def plan_facts(plan: MergePlan) -> dict[str, object]:
    """Everything about a plan for a machine: nothing is written, so "would_write" is the map.

    plan : as `plan_merge` made it
    """
    brackets = []
    for planned in plan.brackets():
        factors = [e.factor for _, e in planned.frames if e]
        frames = [
            _FRAME | {"name": Path(name).name}
            | ({} if e is None else _exposure(e, float(np.log2(e.factor / min(factors)))))
            for name, e in planned.frames
        ]  # fmt: skip
        brackets.append(_BRACKET | {"would_write": str(planned.target), "camera": planned.camera, "frames": frames})
    return {"brackets": brackets, "misfit": {}, "doubts": [], "notes": [], "profile": {}}


def merge_summary(shoot: MergedShoot, *, report: Path | None = None) -> list[Block]:
    """Everything about merged brackets for a person: a block a bracket, titled with its map where there are several.

    shoot : as `merge_shoot` made it
    report : the page that was written beside, to be named
    """
    found: list[Block] = []
    several = len(shoot.targets) > 1
    for bracket, target in zip(shoot.result.brackets, shoot.targets, strict=True):
        lines = _words(bracket)
        found.append((str(target), lines) if several else ("", {"written": str(target), **lines}))
    last: dict[str, object] = {}
    for name, camera in shoot.result.cameras.items():
        of = f" of {name or 'an unknown camera'}" if len(shoot.result.cameras) > 1 else ""
        if camera.calibration is not None:
            last[f"misfit of ln exposure{of}"] = ", ".join(f"{r:.2g}" for r in camera.calibration.residual)
        if name in shoot.profiles:
            last[f"profile{of}"] = str(shoot.profiles[name])
    if report is not None:
        last["report"] = str(report)
    if several and last:
        found.append(("all together", last))
    else:
        found[-1][1].update(last)
    return found


def plan_summary(plan: MergePlan) -> list[Block]:
    """The lines of a dry run, for a person.

    plan : as `plan_merge` made it
    """
    return [
        (
            f"would write {planned.target}",
            {
                Path(name).name: f"{seconds_in_words(e.seconds)} ({e.source})" if e else "unknown"
                for name, e in planned.frames
            },
        )
        for planned in plan.brackets()
    ]


_FRAME: dict[str, Any] = dict.fromkeys(
    (
        "name", "seconds", "f_number", "iso", "stops", "source", "corrected_stops", "dx", "dy", "angle_degrees",
        "ghost_share",
    )
)  # fmt: skip
_BRACKET: dict[str, Any] = dict.fromkeys(
    (
        "written", "camera", "unit", "frames", "saturated", "black", "outside", "pixels", "solid_angle_sr",
        "irradiance_at_least", "luminance_at_least", "light_share_at_least", "scale", "lateral_colour", "moved",
        "ghost_share",
    )
)  # fmt: skip


def _exposure(known: Any, stops: float) -> dict[str, Any]:
    """Of an `Exposure`, or of `FrameFacts`, which name the same."""
    return {
        "seconds": known.seconds, "f_number": known.f_number, "iso": known.iso, "stops": stops, "source": known.source,
    }  # fmt: skip


def _bracket(bracket: MergedBracket, target: Path) -> dict[str, Any]:
    found, scale, deghosted = bracket.clipping, bracket.scale, bracket.deghosted
    bounds: dict[str, Any] = {}
    if found.saturated:
        bounds = {
            "solid_angle_sr": found.solid_angle,
            "irradiance_at_least": None if found.irradiance is None else list(found.irradiance),
            "luminance_at_least": found.brightest,
            "light_share_at_least": found.share,
        }
    return _BRACKET | bounds | {
        "written": str(target),
        "camera": bracket.camera,
        "unit": bracket.picture.unit,
        "frames": _frames(bracket),
        "saturated": found.saturated, "black": found.black, "outside": found.outside, "pixels": found.pixels,
        "scale": scale and {"factor": list(scale.factor), "deviation": scale.deviation, "source": scale.source},
        "lateral_colour": bracket.picture.attributes.get("lateral_colour"),
        "moved": _moved(bracket),
        "ghost_share": None if deghosted is None else float(deghosted.ghosts.mean()),
    }  # fmt: skip


def _frames(bracket: MergedBracket) -> list[dict[str, Any]]:
    facts = frame_facts(bracket)
    return [
        _FRAME | {"name": Path(frame.name).name} | _exposure(frame, frame.stops) | facts[frame.name]
        for frame in bracket.frames
    ]


def _moved(bracket: MergedBracket) -> int | None:
    """How many photographs were moved onto the others; None where that was switched off."""
    return None if bracket.aligned is None else sum(motion != type(motion)() for motion in bracket.aligned.motions)


def _words(bracket: MergedBracket) -> dict[str, object]:
    times = {Path(f.name).name: f"{seconds_in_words(f.seconds)} ({f.source})" for f in bracket.frames}
    found: dict[str, object] = {"exposures": times, "unit": in_words(bracket.picture.unit)}
    if bracket.scale is not None:
        found["scale"] = str(bracket.scale)
    if lateral := bracket.picture.attributes.get("lateral_colour"):
        found["lateral colour"] = f"{lateral}, taken out"
    if moved := _moved(bracket):
        found["moved"] = counted(moved, "photograph")
    if bracket.deghosted is not None and bracket.deghosted.ghosts.any():
        found["ghosts"] = f"{100 * float(bracket.deghosted.ghosts.mean()):.2g} % of the picture"
    return found | dict(clipped_facts(bracket.clipping, bracket.picture.unit))

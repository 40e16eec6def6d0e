"""What `relume merge` tells of its work: numbers for machines, and words for a person."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from relume.capture.brackets.result import MergedBracket, MergeResult
from relume.image.photograph import Exposure
from relume.report.capture_report import clipped_facts, counted, in_words, seconds_in_words

Block = tuple[str, dict[str, object]]
"""A title and lines under it, by their first words."""


@dataclass(frozen=True)
class Plan:
    """A map that would be written, its camera, and the exposure of each photograph as far as it is known."""

    target: Path
    camera: str
    frames: tuple[tuple[str, Exposure | None], ...]


def numbers(
    result: MergeResult,
    targets: Sequence[Path],
    *,
    profile: Mapping[str, str],
    report: Path | None,
    notes: Sequence[str],
) -> dict[str, object]:
    """All of it for a machine; what is not known is None.

    profile : the file written for each camera
    notes : a line each
    """
    return {
        "brackets": [_bracket(*each) for each in zip(result.brackets, targets, strict=True)],
        "misfit": {
            name: camera.calibration.residual.tolist() for name, camera in result.cameras.items() if camera.calibration
        },
        "doubts": list(result.warnings),
        "notes": list(notes),
        "report": None if report is None else str(report),
        "profile": dict(profile),
    }


def planned_numbers(plans: Sequence[Plan], notes: Sequence[str]) -> dict[str, object]:
    """The same of a dry run: nothing is written, so "would_write" tells the map."""
    brackets = []
    for plan in plans:
        factors = [e.factor for _, e in plan.frames if e]
        frames = [
            _FRAME | {"name": Path(name).name}
            | ({} if e is None else _exposure(e, float(np.log2(e.factor / min(factors)))))
            for name, e in plan.frames
        ]  # fmt: skip
        brackets.append(_BRACKET | {"would_write": str(plan.target), "camera": plan.camera, "frames": frames})
    return {"brackets": brackets, "misfit": {}, "doubts": [], "notes": list(notes), "report": None, "profile": {}}


def blocks(
    result: MergeResult, targets: Sequence[Path], *, profile: Mapping[str, str], report: Path | None
) -> list[Block]:
    """All of it for a person: a block a bracket, titled with its map where there are several."""
    found: list[Block] = []
    for bracket, target in zip(result.brackets, targets, strict=True):
        lines = _words(bracket)
        several = len(targets) > 1
        found.append((str(target), lines) if several else ("", {"written": str(target), **lines}))
    last: dict[str, object] = {}
    for name, camera in result.cameras.items():
        of = f" of {name or 'an unknown camera'}" if len(result.cameras) > 1 else ""
        if camera.calibration is not None:
            last[f"misfit of ln exposure{of}"] = ", ".join(f"{r:.2g}" for r in camera.calibration.residual)
        if name in profile:
            last[f"profile{of}"] = profile[name]
    if report is not None:
        last["report"] = str(report)
    if len(found) > 1 and last:
        found.append(("all together", last))
    else:
        found[-1][1].update(last)
    return found


def planned_blocks(plans: Sequence[Plan]) -> list[Block]:
    """The words of a dry run."""
    return [
        (
            f"would write {plan.target}",
            {
                Path(name).name: f"{seconds_in_words(e.seconds)} ({e.source})" if e else "unknown"
                for name, e in plan.frames
            },
        )
        for plan in plans
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
        "irradiance_at_least", "luminance_at_least", "light_share_at_least", "scale", "moved", "ghost_share",
    )
)  # fmt: skip


def _exposure(told: Any, stops: float) -> dict[str, Any]:
    """Of an `Exposure`, or of `FrameFacts`, which name the same."""
    return {"seconds": told.seconds, "f_number": told.f_number, "iso": told.iso, "stops": stops, "source": told.source}


def _bracket(measured: MergedBracket, target: Path) -> dict[str, Any]:
    found, scale, deghosted = measured.extent, measured.scale, measured.deghosted
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
        "camera": measured.camera,
        "unit": measured.picture.unit,
        "frames": _frames(measured),
        "saturated": found.saturated, "black": found.black, "outside": found.outside, "pixels": found.pixels,
        "scale": scale and {"factor": list(scale.factor), "deviation": scale.deviation, "source": scale.source},
        "moved": _moved(measured),
        "ghost_share": None if deghosted is None else float(deghosted.ghosts.mean()),
    }  # fmt: skip


def _frames(measured: MergedBracket) -> list[dict[str, Any]]:
    told: dict[str, dict[str, Any]] = {frame.name: {} for frame in measured.frames}
    for name, (stops, _) in measured.corrections.items():
        told[name]["corrected_stops"] = stops
    if (aligned := measured.aligned) is not None:
        for photograph, motion in zip(aligned.bracket.photographs, aligned.motions, strict=True):
            degrees = float(np.degrees(motion.angle))
            told[photograph.name] |= {"dx": float(motion.dx), "dy": float(motion.dy), "angle_degrees": degrees}
    if (deghosted := measured.deghosted) is not None:
        for photograph, share in zip(deghosted.bracket.photographs, deghosted.shares, strict=True):
            told[photograph.name]["ghost_share"] = float(share)
    return [
        _FRAME | {"name": Path(frame.name).name} | _exposure(frame, frame.stops) | told[frame.name]
        for frame in measured.frames
    ]


def _moved(measured: MergedBracket) -> int | None:
    """How many photographs were moved onto the others; None where that was switched off."""
    return None if measured.aligned is None else sum(motion != type(motion)() for motion in measured.aligned.motions)


def _words(measured: MergedBracket) -> dict[str, object]:
    times = {Path(f.name).name: f"{seconds_in_words(f.seconds)} ({f.source})" for f in measured.frames}
    found: dict[str, object] = {"exposures": times, "unit": in_words(measured.picture.unit)}
    if measured.scale is not None:
        found["scale"] = str(measured.scale)
    if moved := _moved(measured):
        found["moved"] = counted(moved, "photograph")
    if measured.deghosted is not None and measured.deghosted.ghosts.any():
        found["ghosts"] = f"{100 * float(measured.deghosted.ghosts.mean()):.2g} % of the picture"
    return found | dict(clipped_facts(measured.extent, measured.picture.unit))

"""The report of a measurement: what was photographed, what came of it, and what should be doubted."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from relume.capture.brackets.result import ClippingReport, MergedBracket, MergeResult
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.exposures import seconds_in_words
from relume.capture.response.calibration import Calibration
from relume.image import files
from relume.report import capture_plots, plots
from relume.report.page import figure, heading, note, page, paragraph, side_by_side, table, triple

GRID = (6, 8)
"""Arrows down and across."""


def write_capture_report(
    result: MergeResult, path: str | os.PathLike[str], *, settings: MergeSettings = MergeSettings(), profile: str = ""
) -> None:
    """Write one page: doubts, exposures, radiance, false colour, response, noise, alignment, ghosts, what was clipped.

    result : of `merge_brackets`
    path : the page, .html
    settings : what the result was made with; the page lists what was switched off and what of the lens was not undone
    profile : the name of the one that was given
    Raises OutputNotWritten.
    """
    path = Path(path)
    parts = [*map(note, result.warnings), *map(note, result.messages)]
    for camera in result.cameras.values():
        for bracket in (each for each in result.brackets if each.camera == camera.name):
            parts += _bracket(bracket, _summary(bracket, result, settings, profile))
        if camera.calibration is not None:
            parts += [heading("The camera's response"), _response(camera.calibration)]
    rows = [(step, f"{seconds:.2f} s") for step, seconds in result.seconds.items()]
    parts += [heading("Timings"), table(rows)]
    files.write_text(path, page("relume merge", parts))


def _bracket(bracket: MergedBracket, summary: str) -> list[str]:
    picture, names = bracket.picture, [Path(frame.name).name for frame in bracket.frames]
    parts = [
        heading(names[0] if len(names) == 1 else f"{names[0]} … {names[-1]}"),
        summary,
        *(note(doubt.line) for doubt in bracket.doubts if not doubt.degraded),
        _pictures(bracket),
        figure(
            capture_plots.false_colour(picture),
            f"Luminance in false colour: {bracket.clipping.orders:.1f} orders of magnitude between the darkest "
            "thousandth and the brightest ten-thousandth.",
        ),
        heading("Exposures"),
        _exposures(bracket),
        heading("What no photograph measured"),
        _clipped(bracket),
    ]
    if picture.variance is not None:
        parts += [
            heading("How sure it is"),
            figure(
                capture_plots.relative_error(picture),
                "Standard error of the radiance. White: measured by no photograph.",
            ),
        ]
    return parts + _alignment(bracket) + _ghosts(bracket)


def _summary(bracket: MergedBracket, result: MergeResult, settings: MergeSettings, profile: str) -> str:
    """What it is and what was done, and of which nothing was measured."""
    found, (width, height) = bracket.clipping, bracket.picture.size
    scale, balance = bracket.scale, bracket.balance
    # What the lens does that nothing measured.
    known = {"vignetting": bool(settings.vignetting), "glare": settings.glare is not None}
    rows = [
        ("camera", bracket.camera or "unknown"),
        ("photographs", f"{len(bracket.frames)} of {width} × {height} pixels"),
        ("unit", in_words(bracket.picture.unit)),
        ("scale", "none; radiance is relative" if scale is None else str(scale)),
        ("balance", "the camera's own" if balance is None else f"channels multiplied by {triple(balance.gains)}"),
        ("response", _origin(bracket, result, profile)),
        ("switched off", ", ".join(_switched_off(bracket, result, settings)) or "nothing"),
        ("left in, for not measured", ", ".join(name for name, is_known in known.items() if not is_known) or "nothing"),
        (
            "measured by no photograph",
            f"saturated {percent(found.saturated, found.pixels)}, black {percent(found.black, found.pixels)}, "
            f"outside {percent(found.outside, found.pixels)}",
        ),
    ]
    return table(rows)


def _origin(bracket: MergedBracket, result: MergeResult, profile: str) -> str:
    camera = result.cameras[bracket.camera]
    if camera.response is None:
        return "none needed: camera raws are linear" + (f"; sensor given by {profile}" if profile else "")
    if camera.calibration is None:
        return f"given by {profile}" if profile else "given"
    count = sum(each.camera == bracket.camera for each in result.brackets)
    return f"recovered from {counted(count, 'bracket')}"


def _switched_off(bracket: MergedBracket, result: MergeResult, settings: MergeSettings) -> list[str]:
    if result.cameras[bracket.camera].response is None:
        return ["alignment and deghosting: camera raws are merged as they lie"]
    off = [] if settings.align else ["alignment"]
    return off if settings.deghost else [*off, "deghosting"]


def _pictures(bracket: MergedBracket) -> str:
    light = bracket.picture.radiance
    seen = light[light > 0]
    whites = np.percentile(seen, (75, 98, 99.95)) if seen.size else np.ones(3)
    words = ("dark places", "as a photograph", "lights")
    return side_by_side(
        [
            figure(plots.exposed(light, float(w)), f"{word}: {w:.3g} {in_words(bracket.picture.unit)} is white")
            for w, word in zip(whites, words, strict=True)
        ]
    )


def _exposures(bracket: MergedBracket) -> str:
    corrected = {name: f"{stops:+.3f} ± {error:.3f}" for name, (stops, error) in bracket.corrections.items()}
    facts = frame_facts(bracket)
    rows = [
        (
            Path(frame.name).name,
            seconds_in_words(frame.seconds),
            f"f/{frame.f_number:g}" if frame.f_number else "–",
            f"{frame.iso:g}" if frame.iso else "–",
            f"{frame.stops:+.2f}",
            frame.source,
            corrected.get(frame.name, "–"),
            "{dx:+.2f}, {dy:+.2f} px, {angle_degrees:+.3f}°".format(**known) if "dx" in known else "–",
            f"{100 * known['ghost_share']:.2g} %" if "ghost_share" in known else "–",
        )
        for frame, known in ((each, facts[each.name]) for each in bracket.frames)
    ]
    head = ("photograph", "time used", "aperture", "ISO", "stops", "source", "corrected by", "moved by", "ghosts")
    return table(rows, head=head)


def frame_facts(bracket: MergedBracket) -> dict[str, dict[str, float]]:
    """What was found of each photograph, by its name: stops by which its exposure was corrected, motion, ghosts."""
    facts: dict[str, dict[str, float]] = {frame.name: {} for frame in bracket.frames}
    for name, (stops, _) in bracket.corrections.items():
        facts[name]["corrected_stops"] = stops
    if (aligned := bracket.aligned) is not None:
        for photograph, motion in zip(aligned.bracket.photographs, aligned.motions, strict=True):
            degrees = float(np.degrees(motion.angle))
            facts[photograph.name] |= {"dx": float(motion.dx), "dy": float(motion.dy), "angle_degrees": degrees}
    if (deghosted := bracket.deghosted) is not None:
        for photograph, share in zip(deghosted.bracket.photographs, deghosted.shares, strict=True):
            facts[photograph.name]["ghost_share"] = float(share)
    return facts


def in_words(unit: str) -> str:
    """The unit of a radiance map behind a number."""
    return "relative units" if unit == "relative" else unit


def counted(number: int, what: str) -> str:
    """1 photograph, 2 photographs."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def percent(part: int, whole: int) -> str:
    """A share of pixels; a few are never shown as none."""
    share = 100 * part / whole
    return f"{share:.2g} %" if part == 0 or share >= 0.01 else "below 0.01 %"


def _clipped(bracket: MergedBracket) -> str:
    found = bracket.clipping
    if found.saturated == found.black == found.outside == 0:
        return paragraph("Nothing: every pixel was measured by at least one photograph.")
    rows = clipped_facts(found, bracket.picture.unit)
    return figure(
        capture_plots.clipped_marks(bracket.picture),
        f"Red: saturated in every photograph, a lower bound ({percent(found.saturated, found.pixels)}). Blue: black in "
        f"every one, an upper bound ({percent(found.black, found.pixels)}). Green: outside "
        f"({percent(found.outside, found.pixels)}).",
    ) + table(rows)


def clipped_facts(found: ClippingReport, unit: str) -> list[tuple[str, str]]:
    """What an `ClippingReport` holds, a line each; nothing is added to the bounds."""
    rows, unit = [], in_words(unit)
    if found.saturated:
        rows.append(("saturated in every photograph", f"{found.saturated} of {counted(found.pixels, 'pixel')}"))
        if found.moved:
            frames = ", ".join(f"{count} in {Path(name).name}" for name, count in found.moved.items())
            rows.append(("of them where something moved, white in the one that counts", frames))
        if found.solid_angle is not None and found.irradiance is not None:
            rows.append(("their solid angle", f"{found.solid_angle:.3g} sr"))
            rows.append(("irradiance they bring at least", f"{triple(found.irradiance)} {unit}·sr"))
        else:
            rows.append(("their solid angle", "not known without a focal length in pixels, --focal-length"))
        rows.append(("their luminance reaches at least", f"{found.brightest:.4g} {unit}"))
        rows.append(("their share of all light in the picture", f"at least {100 * found.share:.2g} %"))
    if found.black:
        rows.append(("black in every photograph", counted(found.black, "pixel")))
    if found.outside:
        rows.append(("outside every photograph", counted(found.outside, "pixel")))
    return rows


def _response(calibration: Calibration) -> str:
    residual = ", ".join(f"{r:.3f}" for r in calibration.residual)
    words = f"Curves over the observations they were recovered from. Misfit of ln exposure {residual}"
    if calibration.noise is not None:
        noise = calibration.noise
        words += f"; shot noise {triple(noise.shot)}, read noise {triple(noise.read)} of the exposure at white"
    return figure(plots.response_plot(calibration), words + " (red, green, blue).")


def _alignment(bracket: MergedBracket) -> list[str]:
    aligned = bracket.aligned
    if aligned is None or len(aligned.motions) == 1:
        return []
    if not aligned.moved:
        return [heading("Alignment"), paragraph("All photographs lay on one another; none was moved.")]
    height, width = bracket.picture.radiance.shape[:2]
    y, x = np.meshgrid(*((np.arange(n) + 0.5) / n for n in GRID), indexing="ij")
    places = np.stack([(x - 0.5) * width, (y - 0.5) * height], axis=-1)
    fields = [
        (Path(photograph.name).name, motion.apply(places) - places)
        for photograph, motion in zip(aligned.bracket.photographs, aligned.motions, strict=True)
        if motion != type(motion)()
    ]
    reference = Path(aligned.bracket.photographs[aligned.reference].name).name
    return [
        heading("Alignment"),
        figure(
            capture_plots.arrows(bracket.picture.radiance, fields),
            f"From where a point is in {reference} to where each photograph shows it.",
        ),
    ]


def _ghosts(bracket: MergedBracket) -> list[str]:
    found = bracket.deghosted
    if found is None:
        return []
    if not found.ghosts.any():
        return [heading("Ghosts"), paragraph("Nothing moved; nothing was left out.")]
    marks = [(found.ghosts, capture_plots.GHOST)]
    share = 100 * float(found.ghosts.mean())
    return [
        heading("Ghosts"),
        figure(
            capture_plots.marked(bracket.picture.radiance, marks),
            f"Where something moved, {share:.2g} % of the picture: there the radiance is that of the photographs which "
            "agree, not of all.",
        ),
    ]

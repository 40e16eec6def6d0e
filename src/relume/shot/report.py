"""The report of `relume insert`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from relume.image import files
from relume.shot import plots
from relume.shot.outcome import Inserted
from relume.shot.page import figure, heading, note, page, paragraph, side_by_side, slide, table, triple
from relume.sphere.directions import UP


def write_report(result: Inserted, path: Path) -> None:
    """Write the page: before and after, response curves, light, matte, signed difference, energy audit, timings."""
    files.write_text(path, _page(result))


def _page(result: Inserted) -> str:
    after, before = plots.encoded(result.picture.pixels), plots.encoded(result.before.pixels)
    parts = [
        "<h1>relume insert</h1>",
        *(note(each) for each in result.notes),
        slide(before, after, "Before, to the left of the handle; after, to the right."),
        heading("What the objects changed"),
        _difference(result),
        heading("The light"),
        _light(result),
        heading("The camera's response"),
        *(_response(camera, result) for camera in result.calibrations),
        heading("Energy audit"),
        _audit(result),
        heading("Timings"),
        table([(stage, f"{seconds:.2f} s" + (" (kept from before)" if stage in result.kept else ""))
               for stage, seconds in result.seconds.items()]),
    ]  # fmt: skip
    return page("relume insert", parts)


def _difference(result: Inserted) -> str:
    difference = (result.with_.radiance - result.without.radiance) * (1 - result.with_.matte[..., None])
    scale = float(np.percentile(np.abs(difference), 99.5))
    return side_by_side(
        [
            figure(
                plots.signed(difference, scale),
                "With − without, about grey: dark is light taken, bright is light added.",
            ),
            figure(plots.grey(result.with_.matte), "Matte: the share of each pixel that the objects cover."),
        ]
    )


def _light(result: Inserted) -> str:
    light = result.probe.light.radiance
    white = float(np.percentile(light, 95))
    shown = [
        figure(plots.exposed(light, white * 2.0**stops), f"{-stops:+g} stops" if stops else "as it is")
        for stops in (0.0, 3.5, 7.0)
    ]
    turned = ", ".join(f"{np.degrees(c):.2f}°" for c in result.probe.corrections[1:])
    words = (
        f"Lat-long: −Z in the middle, +X to its right. Registration turned the other views by {turned}."
        if turned
        else "Lat-long: −Z in the middle, +X to its right."
    )
    return side_by_side(shown) + paragraph(words)


def _response(camera: str, result: Inserted) -> str:
    calibration = result.calibrations[camera]
    residual = ", ".join(f"{r:.3f}" for r in calibration.residual)
    response = calibration.response
    noise = ", ".join(f"{n:.2f}" for n in response.deviation[:, response.levels // 2])
    caption = (
        f"{camera or 'The camera'}: curves over the observations they were recovered from. Misfit of ln exposure "
        f"{residual}; noise of a middle pixel value {noise} (red, green, blue)."
    )
    return figure(plots.response_plot(calibration), caption)


def _audit(result: Inserted) -> str:
    probe, plate = result.probe, result.plate
    rows = [
        ("unit", plate.unit),
        ("total of the light, ∫ L dω", triple(probe.light.total())),
        ("irradiance from above", triple(probe.light.irradiance(UP))),
        ("brightest direction", triple(probe.light.radiance.max((0, 1)))),
        ("light saturated in every photograph", f"{probe.clipped_solid_angle:.3g} sr"),
        ("light seen by no view", f"{_unseen(result):.3g} sr"),
    ]
    if plate.clipped is not None:
        rows.append(("plate pixels clipped in every photograph", str(int((plate.clipped > 0).sum()))))
    for found in result.recovered:
        if found is not None:
            rows.append(("recovered reflectance", f"{triple(found.reflectance)} ± {triple(found.spread)}"))
    change = (result.with_.radiance - result.without.radiance)[result.with_.matte == 0]
    rows.append(("light taken from the surroundings", triple(-np.minimum(change, 0).sum(0))))
    rows.append(("light added to them", triple(np.maximum(change, 0).sum(0))))
    return table(rows)


def _unseen(result: Inserted) -> float:
    light = result.probe.light
    return float(((result.probe.confidence < 0.05) * light.mapping.solid_angles(light.size)).sum())

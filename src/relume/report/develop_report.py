"""The report of `relume develop`: a wipe between plain exposure and the picture, stops, false colour, and the facts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from relume.image import files
from relume.image.photograph import Photograph
from relume.image.radiance import RadianceMap
from relume.report import plots
from relume.report.page import figure, heading, main_heading, note, page, paragraph, side_by_side, slide, table
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.tone.display.false_colour import false_colour
from relume.virtual_camera.tone.display.stops import stops_sheet
from relume.virtual_camera.view import View
from relume.virtual_camera.virtual_camera import VirtualCamera

STOPS = (-6.0, -4.0, -2.0, 0.0, 2.0, 4.0)
"""Of the contact sheet: highlights to shadows."""


def write_develop_report(
    path: Path,
    scene: RadianceMap,
    image: RadianceMap,
    shown: Photograph,
    view: View,
    *,
    facts: Mapping[str, object],
    notes: Sequence[str] = (),
    title: str = "relume develop",
) -> None:
    """Write one page that shows a developed picture beside what it was made from.

    scene : radiance before the lens
    image : as the lens drew it
    shown : the developed picture
    Raises OutputNotWritten.
    """
    plain = develop(scene, VirtualCamera(), view)
    before, after = plots.encoded(plain.pixels), plots.encoded(shown.pixels)
    lens = [figure(after, "The picture.")]
    if image is not scene:
        drawn = develop(image, VirtualCamera(), view)
        lens.insert(0, figure(plots.encoded(drawn.pixels), "What the lens drew, plainly exposed."))
    lens.insert(0, figure(before, "The scene, as a light meter exposes it."))
    parts = [
        main_heading(title),
        *(note(line) for line in notes),
        slide(before, after, "The scene, plainly exposed, to the left of the handle; the picture to the right."),
        heading("Side by side"),
        side_by_side(lens),
        heading("At several exposures"),
        figure(plots.encoded(_sheet(image)), "What the lens drew, stops from plain exposure."),
        heading("How bright it is"),
        figure(plots.encoded(false_colour(image).pixels), f"Luminance, {image.unit}."),
        heading("How it was made"),
        table([(key, _told(value)) for key, value in facts.items()]),
        paragraph("All but the tone is done in linear light, in the order in which light meets it."),
    ]
    files.write_text(path, page(title, parts))


def _sheet(image: RadianceMap) -> np.ndarray:
    settled = VirtualCamera().tone_map(image, View(1.0)).gain
    return stops_sheet(image, STOPS, Film(settled)).pixels


def _told(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_told(each)}" for key, each in value.items()) or "none"
    if isinstance(value, list | tuple | np.ndarray):
        return ", ".join(_told(each) for each in value) or "none"
    return "none" if value is None else str(value)

"""The report of `relume develop`: a wipe between plain exposure and the picture, stops, false colour, and the facts."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from relume.image import files
from relume.project.developing.develop_files import DevelopedFile
from relume.report import plots
from relume.report.page import figure, heading, page, paragraph, side_by_side, slide, table
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.tone.display.false_colour import false_colour
from relume.virtual_camera.tone.display.stops import stops_sheet
from relume.virtual_camera.view import View
from relume.virtual_camera.virtual_camera import VirtualCamera

STOPS = (-6.0, -4.0, -2.0, 0.0, 2.0, 4.0)
"""Of the contact sheet: highlights to shadows."""


def write_develop_report(
    path: str | os.PathLike[str],
    made: DevelopedFile,
    *,
    facts: Mapping[str, object] | None = None,
    title: str = "relume develop",
) -> None:
    """Write one page that shows a developed picture beside the radiance it was made from.

    path : the page, .html
    made : what `develop_file` returned
    facts : for its table; those of `made` unless given
    title : of the page
    Raises OutputNotWritten, and ValueError for a dry run.
    """
    path = Path(path)
    scene, image, view = made.scene, made.image, made.view
    plain = develop(scene, VirtualCamera(), view)
    before, after = plots.encoded(plain.pixels), plots.encoded(made.photograph().pixels)
    pictures = [figure(before, "The scene, as a light meter exposes it."), figure(after, "The picture.")]
    if image is not scene:
        drawn = develop(image, VirtualCamera(), view)
        pictures.insert(1, figure(plots.encoded(drawn.pixels), "The light that the lens drew, plainly exposed."))
    stops = stops_sheet(image, STOPS, Film(VirtualCamera().tone_map(image, View(1.0)).gain))
    parts = [
        slide(before, after, "The scene, plainly exposed, to the left of the handle; the picture to the right."),
        heading("Side by side"),
        side_by_side(pictures),
        heading("At several exposures"),
        figure(plots.encoded(stops.pixels), "The light that the lens drew, in stops from plain exposure."),
        heading("How bright it is"),
        figure(plots.encoded(false_colour(image).pixels), f"Luminance, {image.unit}."),
        heading("How it was made"),
        table([("picture", made.name), *((key, _words(value)) for key, value in (facts or made.facts).items())]),
        paragraph("Everything before the tone operator is done in linear light, in the order in which light meets it."),
    ]
    files.write_text(path, page(title, parts))


def _words(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.5g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_words(each)}" for key, each in value.items()) or "none"
    if isinstance(value, list | tuple | np.ndarray):
        return ", ".join(_words(each) for each in value) or "none"
    return "none" if value is None else str(value)

"""The page of a patch's reflectance: measured and fitted, as Debevec et al. 2000, Fig. 11, and in sections."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

import numpy as np

from relume.image import files
from relume.image.colour import encode_srgb
from relume.lightstage.reflectometry.patch_fit import PatchReflectance, SeparatedPatch, separate_patch
from relume.lightstage.reflectometry.patch_samples import PatchSamples, in_plane
from relume.lightstage.reflectometry.skin_layers import layered_reflection, layers_like
from relume.report.page import figure, note, page, paragraph, table
from relume.report.plots import CHANNELS, encoded_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SECTIONS = 4
"""Angles of view whose sections are drawn: from straight on to the most slanted."""
_LINE = np.radians(np.linspace(-85, 85, 69))
_REFERENCE = np.radians(np.linspace(-80, 80, 9))
TRIED = 2500
"""Photons of each point of the reference: its noise is then a few per cent, less than a line is wide."""


def write_patch_report(
    path: str | os.PathLike[str],
    samples: PatchSamples,
    found: PatchReflectance,
    light: tuple[float, float, float] = (1.0, 1.0, 1.0),
    title: str = "a patch of skin",
) -> None:
    """Write a page: the numbers, both parts over all angles (Fig. 11), and sections with the fit and the reference.

    path : the page, .html
    samples : that the fit was given
    found : what `fit_patch` returned
    light : colour of the lamp beside its irradiance, as the fit was given it
    title : of the page
    The reference is skin of two layers by Monte Carlo (Hanrahan & Krueger 1993), whose absorption is the patch's.
    Raises OutputNotWritten.
    """
    parts = separate_patch(samples, light)
    contents = [table({name: _words(value) for name, value in found.facts().items()})]
    if not parts.separable:
        contents.append(note("The patch has the lamp's own colour: its parts are separated by their shape alone."))
    contents += [
        figure(
            encoded_figure(_maps(samples, parts, found)),
            "Measured (above) and fitted (below) diffuse and specular reflection over both angles, each brightest "
            "value white; black was not measured.",
        ),
        paragraph(
            "Points are measured, lines fitted (Torrance and Sparrow's lobe on a Lambertian one with a ramp of "
            "chromaticity), dashes are skin of two layers (Hanrahan and Krueger 1993), whose absorption was chosen "
            "so that it reflects head-on as the patch does."
        ),
        figure(encoded_figure(_sections(samples, parts, found)), "Sections at angles of view, over that of incidence."),
    ]
    files.write_text(path, page(title, contents))


def _words(value: object) -> str:
    return ", ".join(str(each) for each in value) if isinstance(value, list) else str(value)


def _maps(samples: PatchSamples, parts: SeparatedPatch, found: PatchReflectance) -> Figure:
    """Fig. 11: angles of incidence across, of view down, as evenly as they were taken."""
    from matplotlib.figure import Figure

    across, columns = np.unique(np.round(np.degrees(samples.incidence), 2), return_inverse=True)
    down, rows = np.unique(np.round(np.degrees(samples.viewing), 2), return_inverse=True)
    fitted = (
        found.diffuse_part(samples.incidence, samples.viewing), found.specular_part(samples.light, samples.view)
    )  # fmt: skip
    drawn = Figure(figsize=(11, 5.2), dpi=110, layout="constrained")
    axes = drawn.subplots(2, 2, sharex=True, sharey=True)
    for column, (name, measured) in enumerate((("diffuse", parts.diffuse), ("specular", parts.specular))):
        white = max(float(np.quantile(measured, 0.998)), 1e-9)
        for row, values in enumerate((measured, fitted[column])):
            picture = np.zeros((len(down), len(across), 3))
            picture[rows, columns] = encode_srgb(np.clip(values / white, 0, 1))
            edges = (-0.5, len(across) - 0.5, len(down) - 0.5, -0.5)
            axes[row, column].imshow(picture, aspect="auto", interpolation="nearest", extent=edges)
            axes[row, column].set_title(f"{name}, {('measured', 'fitted')[row]}", fontsize=9)
            axes[row, column].tick_params(labelsize=7)
        places = np.linspace(0, len(across) - 1, min(7, len(across))).astype(int)
        axes[1, column].set_xticks(places, [f"{across[place]:.0f}" for place in places])
        axes[1, column].set_xlabel("angle of incidence, degrees", fontsize=8)
    for row in (0, 1):
        axes[row, 0].set_yticks(range(len(down)), [f"{angle:g}" for angle in down])
        axes[row, 0].set_ylabel("angle of view, degrees", fontsize=8)
    return drawn


def _sections(samples: PatchSamples, parts: SeparatedPatch, found: PatchReflectance) -> Figure:
    """Diffuse and specular reflection over the angle of incidence, for some angles of view."""
    from matplotlib.figure import Figure

    views = np.unique(np.round(samples.viewing, 5))
    views = views[views >= -1e-5] if (views >= -1e-5).sum() >= 2 else views
    views = views[np.unique(np.linspace(0, len(views) - 1, SECTIONS).astype(int))]
    reference = _reference(found, views)
    drawn = Figure(figsize=(11, 5.4), dpi=110, layout="constrained")
    axes = drawn.subplots(2, len(views), sharex=True, squeeze=False)
    for column, view in enumerate(views):
        own = np.abs(samples.viewing - view) < 1e-4
        incidence = np.degrees(samples.incidence[own])
        slanted = np.full_like(_LINE, view)
        diffuse = found.diffuse_part(_LINE, slanted)
        specular = found.specular_part(in_plane(_LINE), in_plane(slanted))
        for channel, (_, colour) in enumerate(CHANNELS):
            for row, (measured, fitted) in enumerate(((parts.diffuse, diffuse), (parts.specular, specular))):
                if row == 0 or channel == 1:
                    axes[row, column].plot(incidence, measured[own, channel], ".", ms=3, color=colour, alpha=0.6)
                    axes[row, column].plot(np.degrees(_LINE), fitted[:, channel], color=colour, lw=1.2)
            axes[0, column].plot(np.degrees(_REFERENCE), reference[column, :, channel], "--", color=colour, lw=0.9)
        axes[0, column].set_title(f"view {np.degrees(view):.3g}°", fontsize=9)
        axes[1, column].set_xlabel("incidence, degrees", fontsize=8)
    for row, name in enumerate(("diffuse f cos θi, 1/sr", "specular f cos θi, 1/sr")):
        axes[row, 0].set_ylabel(name, fontsize=8)
    for axis in axes.ravel():
        axis.grid(alpha=0.25)
        axis.tick_params(labelsize=7)
        axis.set_ylim(bottom=0)
    return drawn


def _reference(found: PatchReflectance, views: np.ndarray) -> np.ndarray:
    """f cos θi of layered skin (views, angles of incidence, 3)."""
    layers = layers_like(found.albedo, photons=TRIED)
    reflected = layered_reflection(layers, _REFERENCE, views, photons=TRIED) * np.cos(_REFERENCE)[:, None, None]
    return reflected.transpose(1, 0, 2)

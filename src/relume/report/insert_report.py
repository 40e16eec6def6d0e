"""The reports of `relume insert`: of one picture, and of a sequence with some of its frames and how steady it is."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from relume.image import bands, files
from relume.image.mapped_arrays import give_back_read
from relume.project.insertion.outcome import Inserted
from relume.project.insertion.sequence import SequenceMade, sparkles
from relume.renderers.results import Change
from relume.report import plots
from relume.report.page import figure, heading, note, page, paragraph, side_by_side, slide, table, triple
from relume.sphere.directions import UP

SHOWN = 9
"""Frames of a sequence, at most."""
WIDTH = 480
"""Pixels of a frame's picture, at most."""


def write_insert_report(result: Inserted, path: Path) -> None:
    """Write the page: before and after, response curves, light, matte, signed difference, energy audit, timings."""
    # Pictures are encoded beside the plots, which take longest and are first.
    works: list[Callable[[], str]] = [
        *(partial(_response, camera, result) for camera in result.calibrated.calibrations),
        *(partial(work, result) for work in (_before_and_after, _difference, _surfaces, _light)),
    ]
    *responses, slid, difference, surfaces, light = bands.side_by_side(works, result.plate.radiance.size // 3)
    parts = [
        *(note(each.words) for each in result.doubts),
        slid,
        heading("What the objects changed"),
        difference,
        heading("The real surfaces"),
        surfaces,
        heading("The light"),
        light,
        heading("The camera's response"),
        *responses,
        heading("Energy audit"),
        _audit(result),
        heading("Timings"),
        table([(stage, f"{seconds:.2f} s" + (" (kept from before)" if stage in result.kept else ""))
               for stage, seconds in result.seconds.items()]),
    ]  # fmt: skip
    files.write_text(path, page("relume insert", parts))


def _before_and_after(result: Inserted) -> str:
    after, before = plots.encoded(result.picture.pixels), plots.encoded(result.composited.before.pixels)
    return slide(before, after, "Before, to the left of the handle; after, to the right.")


def _difference(result: Inserted) -> str:
    change = result.change
    scale = float(np.percentile(np.abs(change.difference), 99.5, overwrite_input=True))
    give_back_read(change.difference)
    return side_by_side(
        [
            figure(
                plots.signed(change.difference, scale),
                "With − without, about grey: dark is light taken, bright is light added.",
            ),
            figure(plots.grey(change.matte), "Matte: the share of each pixel that the objects cover."),
        ]
    )


def _surfaces(result: Inserted) -> str:
    found = result.place.recovered
    if found is None:
        return paragraph("None: the objects throw no shadow and no light on anything.")
    white = float(np.percentile(result.plate.radiance, 99))
    shown = [
        figure(plots.exposed(found.albedo, 1.0), "Diffuse reflectance, recovered from the plate: the light taken out."),
        figure(plots.exposed(found.without, white), "The model without objects; it should look like the plate."),
    ]
    rows: list[tuple[str, str]] = []
    for index, surface in enumerate(found.surfaces):
        name = f"surface {index + 1}"
        if surface.reflectance is not None and surface.spread is not None:
            rows.append((f"{name}: reflectance", f"{triple(surface.reflectance)}, varies by {triple(surface.spread)}"))
        if surface.gloss is not None:
            errors = surface.fitted
            f0, roughness = f"{surface.gloss.f0:.3f}", f"{surface.gloss.roughness:.3f}"
            if errors is not None:
                f0, roughness = f"{f0} ± {errors.f0_error:.3f}", f"{roughness} ± {errors.roughness_error:.3f}"
                views = "probe and plate" if errors.views == 2 else "the plate alone"
                rows.append((f"{name}: gloss found from", f"{errors.points} places, {views}"))
            rows.append((f"{name}: gloss", f"F₀ {f0}, roughness {roughness}"))
    return side_by_side(shown) + table(rows)


def _light(result: Inserted) -> str:
    light = result.calibrated.probe.light.radiance
    white = float(np.percentile(light, 95))
    shown = [
        figure(plots.exposed(light, white * 2.0**stops), f"{-stops:+g} stops" if stops else "as it is")
        for stops in (0.0, 3.5, 7.0)
    ]
    turned = ", ".join(f"{np.degrees(c):.2f}°" for c in result.calibrated.probe.corrections[1:])
    words = "Equirectangular (lat-long): −Z in the middle, +X to its right."
    if turned:
        words += f" Registration turned the other views by {turned}."
    return side_by_side(shown) + paragraph(words)


def _response(camera: str, result: Inserted) -> str:
    calibration = result.calibrated.calibrations[camera]
    residual = ", ".join(f"{r:.3f}" for r in calibration.residual)
    response = calibration.response
    noise = ", ".join(f"{n:.2f}" for n in response.deviation[:, response.levels // 2])
    caption = (
        f"{camera or 'The camera'}: curves over the observations they were recovered from. Misfit of ln exposure "
        f"{residual}; noise of a middle pixel value {noise} (red, green, blue)."
    )
    return figure(plots.response_plot(calibration), caption)


def _audit(result: Inserted) -> str:
    probe, plate = result.calibrated.probe, result.plate
    unseen = float(((probe.confidence < 0.05) * probe.light.mapping.solid_angles(probe.light.size)).sum())
    rows = [
        ("unit", plate.unit),
        ("total of the light, ∫ L dω", triple(probe.light.total())),
        ("irradiance from above", triple(probe.light.irradiance(UP))),
        ("brightest direction", triple(probe.light.radiance.max((0, 1)))),
        ("light saturated in every photograph", f"{probe.clipped_solid_angle:.3g} sr"),
        ("light seen by no view", f"{unseen:.3g} sr"),
    ]
    if plate.clipped is not None:
        rows.append(("plate pixels clipped in every photograph", str(int((plate.clipped > 0).sum()))))
    place = ", ".join(f"{v:.3f}" for v in result.camera.position)
    rows.append(("camera", f"at {place} metres; {result.place.fit.agreement}"))
    sharpness = result.composited.match.sharpness
    rows.append(("sharpness of the plate", "not matched" if sharpness is None else f"σ {sharpness.sigma:.2f} pixels"))
    taken, added = _taken_and_added(result.change)
    rows.append(("light taken from the surroundings", triple(taken)))
    rows.append(("light added to them", triple(added)))
    return table(rows)


def _taken_and_added(change: Change) -> tuple[np.ndarray, np.ndarray]:
    """(3,) sums beside the objects; some rows at a time, each added to the sum of those above it."""
    taken, added = np.zeros((1, 3), np.float32), np.zeros((1, 3), np.float32)
    step = max(1, bands.BAND // change.matte.shape[1])
    for top in range(0, len(change.matte), step):
        rows = slice(top, top + step)
        beside = change.difference[rows][change.matte[rows] == 0]
        taken = np.concatenate([taken, np.minimum(beside, 0)]).sum(0)[None]
        added = np.concatenate([added, np.maximum(beside, 0)]).sum(0)[None]
        give_back_read(change.difference, change.matte)
    return -taken[0], added[0]


def write_sequence_report(result: SequenceMade, path: Path) -> None:
    """Write the page; frames without a composite.png are in the table only."""
    there = [frame for frame in result.frames if (frame.folder / "composite.png").is_file()]
    chosen = [there[i] for i in np.unique(np.linspace(0, len(there) - 1, min(SHOWN, len(there))).astype(int))]
    shown = [figure(_small(frame.folder / "composite.png"), f"Frame {frame.number}") for frame in chosen]
    unlike: dict[int, float] = {}
    window: list[np.ndarray] = []
    for index, frame in enumerate(there):
        window = [*window[-2:], files.read_photograph(frame.folder / "composite.png").pixels]
        if len(window) == 3 and len({each.shape for each in window}) == 1:
            unlike[there[index - 1].number] = sparkles(*window)
    parts = [
        *(note(each.words) for each in result.doubts),
        paragraph(f"{len(result.frames)} frames, {sum(frame.kept for frame in result.frames)} of them made before."),
        *(side_by_side(shown[i : i + 3]) for i in range(0, len(shown), 3)),
        heading("Frames"),
        table(
            [
                (
                    str(frame.number),
                    f"{frame.seconds:.1f} s" + (" (kept from before)" if frame.kept else ""),
                    f"{unlike[frame.number]:.3%}" if frame.number in unlike else "",
                )
                for frame in result.frames
            ],
            head=("frame", "time", "pixels unlike the frame before and after"),
        ),
    ]
    files.write_text(path, page("relume insert: a sequence", parts))


def _small(path: Path) -> bytes:
    pixels = files.read_photograph(path).pixels
    step = max(1, -(-pixels.shape[1] // WIDTH))
    return plots.encoded(np.ascontiguousarray(pixels[::step, ::step]))

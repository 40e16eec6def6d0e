"""The report: one page that holds all it shows, so that it can be sent to a colleague."""

from __future__ import annotations

import base64
import html
from pathlib import Path

import numpy as np

from relume.image import files
from relume.shot import plots
from relume.shot.outcome import Inserted
from relume.sphere.directions import UP

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 1080px; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.1rem; margin-top: 2rem; } img { width: 100%; display: block; }
figure { margin: 0; } figcaption { color: #555; font-size: 13px; padding: .3rem 0 .8rem; }
.two { display: grid; grid-template-columns: 1fr 1fr; gap: 1rem; }
.three { display: grid; grid-template-columns: repeat(3, 1fr); gap: 1rem; }
.note { background: #fff4d6; padding: .5rem .8rem; border-left: 4px solid #e0a800; margin: .4rem 0; }
.slide { position: relative; } .slide img + img { position: absolute; top: 0; left: 0; clip-path: inset(0 50% 0 0); }
.slide input { width: 100%; } table { border-collapse: collapse; } td { padding: .15rem 1rem .15rem 0; }
"""
SLIDE = "this.previousElementSibling.style.clipPath = 'inset(0 ' + (100 - this.value) + '% 0 0)'"


def write_report(result: Inserted, path: Path) -> None:
    """Write the page: before and after, response curves, light, matte, signed difference, energy audit, timings."""
    files.write_text(path, _page(result))


def _page(result: Inserted) -> str:
    after, before = plots.encoded(result.picture.pixels), plots.encoded(result.before.pixels)
    parts = [
        "<h1>relume insert</h1>",
        *(f'<p class="note">{html.escape(note)}</p>' for note in result.notes),
        f'<figure class="slide">{_image(after, "after")}{_image(before, "before")}'
        f'<input type="range" value="50" aria-label="before and after" oninput="{html.escape(SLIDE)}">'
        "<figcaption>Before, to the left of the handle; after, to the right.</figcaption></figure>",
        "<h2>What the objects changed</h2>",
        _difference(result),
        "<h2>The light</h2>",
        _light(result),
        "<h2>The camera's response</h2>",
        *(_response(camera, result) for camera in result.calibrations),
        "<h2>Energy audit</h2>",
        _audit(result),
        "<h2>Timings</h2>",
        _table([(stage, f"{seconds:.2f} s" + (" (kept from before)" if stage in result.kept else ""))
                for stage, seconds in result.seconds.items()]),
    ]  # fmt: skip
    body = "\n".join(parts)
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>relume insert</title><style>{STYLE}</style>\n'
        f"{body}</html>\n"
    )


def _difference(result: Inserted) -> str:
    difference = (result.with_.radiance - result.without.radiance) * (1 - result.with_.matte[..., None])
    scale = float(np.percentile(np.abs(difference), 99.5))
    return (
        '<div class="two">'
        + _figure(
            plots.signed(difference, scale), "With − without, about grey: dark is light taken, bright is light added."
        )
        + _figure(plots.grey(result.with_.matte), "Matte: the share of each pixel that the objects cover.")
        + "</div>"
    )


def _light(result: Inserted) -> str:
    light = result.probe.light.radiance
    white = float(np.percentile(light, 95))
    shown = [
        _figure(plots.exposed(light, white * 2.0**stops), f"{-stops:+g} stops" if stops else "as it is")
        for stops in (0.0, 3.5, 7.0)
    ]
    turned = ", ".join(f"{np.degrees(c):.2f}°" for c in result.probe.corrections[1:])
    words = (
        f"Lat-long: −Z in the middle, +X to its right. Registration turned the other views by {turned}."
        if turned
        else "Lat-long: −Z in the middle, +X to its right."
    )
    return f'<div class="three">{"".join(shown)}</div><p>{words}</p>'


def _response(camera: str, result: Inserted) -> str:
    calibration = result.calibrations[camera]
    residual = ", ".join(f"{r:.3f}" for r in calibration.residual)
    noise = ", ".join(f"{n:.2f}" for n in calibration.response.noise)
    caption = (
        f"{camera or 'The camera'}: curves over the observations they were recovered from. Misfit of ln exposure "
        f"{residual}; noise of a pixel value {noise} (red, green, blue)."
    )
    return _figure(plots.response_plot(calibration), caption)


def _audit(result: Inserted) -> str:
    probe, plate = result.probe, result.plate
    rows = [
        ("unit", plate.unit),
        ("total of the light, ∫ L dω", _triple(probe.light.total())),
        ("irradiance from above", _triple(probe.light.irradiance(UP))),
        ("brightest direction", _triple(probe.light.radiance.max((0, 1)))),
        ("light saturated in every photograph", f"{probe.clipped_solid_angle:.3g} sr"),
        ("light seen by no view", f"{_unseen(result):.3g} sr"),
    ]
    if plate.clipped is not None:
        rows.append(("plate pixels clipped in every photograph", str(int((plate.clipped > 0).sum()))))
    for found in result.recovered:
        if found is not None:
            rows.append(("recovered reflectance", f"{_triple(found.reflectance)} ± {_triple(found.spread)}"))
    change = (result.with_.radiance - result.without.radiance)[result.with_.matte == 0]
    rows.append(("light taken from the surroundings", _triple(-np.minimum(change, 0).sum(0))))
    rows.append(("light added to them", _triple(np.maximum(change, 0).sum(0))))
    return _table(rows)


def _unseen(result: Inserted) -> float:
    light = result.probe.light
    return float(((result.probe.confidence < 0.05) * light.mapping.solid_angles(light.size)).sum())


def _triple(values: object) -> str:
    return "(" + ", ".join(f"{v:.4g}" for v in np.asarray(values, np.float64)) + ")"


def _figure(image: bytes, caption: str) -> str:
    return f"<figure>{_image(image, caption)}<figcaption>{html.escape(caption)}</figcaption></figure>"


def _image(image: bytes, text: str) -> str:
    data = base64.b64encode(image).decode("ascii")
    return f'<img alt="{html.escape(text)}" src="data:image/png;base64,{data}">'


def _table(rows: list[tuple[str, str]]) -> str:
    body = "".join(f"<tr><td>{html.escape(k)}</td><td>{html.escape(v)}</td></tr>" for k, v in rows)
    return f"<table>{body}</table>"

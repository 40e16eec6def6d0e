"""The merged photographs of a shot as files and facts: radiance maps, response curves, how each photograph agrees."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import relume as rl
from relume.studio.words import in_the_page

CURVE_POINTS, SAMPLES = 65, 250
"""Points of a response's curve and observations of a channel that a page draws."""


def merged_facts(shot: Path, scratch: Path, progress: Callable[[str, float], None]) -> dict[str, Any]:
    """Merge a shot's photographs, write each map into the scratch folder, and say what was found, for JSON.

    Raises RelumeError.
    """
    # What was merged, for a page to see whether it was changed since: as the file has it at the beginning.
    made_from = tomllib.loads(shot.read_text(encoding="utf-8"))
    found = rl.report.merge_shot(rl.read_shot(shot), progress=progress)
    brackets = []
    for name, bracket, residuals in zip(found.names, found.brackets, found.residuals, strict=True):
        file = f"merged {name}.exr".replace(" ", "_")
        rl.write(scratch / file, bracket.picture)
        brackets.append(
            {
                "name": name, "file": file, "camera": bracket.camera, "unit": bracket.picture.unit,
                "scale": None if bracket.scale is None else str(bracket.scale), "clipped": _clipped(bracket.clipping),
                "frames": [_frame(shot.parent, each, residuals.get(each.name)) for each in bracket.frames],
                "doubts": [in_the_page(doubt.line) for doubt in bracket.doubts],
            }
        )  # fmt: skip
    return {
        "brackets": brackets,
        "cameras": {name: _camera(each) for name, each in found.cameras.items()},
        "made_from": {"plate": made_from.get("plate"), "light": {"balls": made_from.get("light", {}).get("balls", [])}},
        "doubts": [in_the_page(doubt.line) for doubt in found.doubts],
    }


def _frame(folder: Path, frame: Any, stops: float | None) -> dict[str, Any]:
    path = Path(frame.name)
    inside = path.resolve().is_relative_to(folder.resolve())
    name = path.resolve().relative_to(folder.resolve()).as_posix() if inside else path.name
    return {
        "path": name,
        "exposure": rl.capture.seconds_in_words(frame.seconds),
        "stops": None if stops is None else round(stops, 4),
    }


def _clipped(report: Any) -> str:
    parts = [
        f"{100 * count / report.pixels:.2g} % {word} in every photograph"
        for count, word in ((report.saturated, "saturated"), (report.black, "black"))
        if count
    ]
    return "; ".join(parts) or "every pixel is measured"


def _camera(camera: Any) -> dict[str, Any]:
    """A camera's response for a plot; raws have none."""
    if camera.response is None:
        return {"name": camera.name}
    curves, known = camera.response.log_exposure, camera.calibration
    values = np.unique(np.linspace(0, curves.shape[1] - 1, CURVE_POINTS).round().astype(int))
    errors = None if known is None or known.error is None else np.nan_to_num(known.error[:, values]).round(4).tolist()
    samples = (
        [] if known is None else [each[:: max(1, len(each) // SAMPLES)].round(3).tolist() for each in known.samples]
    )
    return {
        "name": camera.name, "levels": curves.shape[1], "values": values.tolist(),
        "curves": curves[:, values].round(4).tolist(), "errors": errors, "samples": samples,
        "residual": None if known is None else [round(float(v), 4) for v in known.residual],
    }  # fmt: skip

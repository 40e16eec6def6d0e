"""What was found of the real surfaces, for a page to write on them: reflectance and gloss with their errors."""

from __future__ import annotations

from typing import Any

import relume as rl


def surface_facts(shot: rl.Shot, recovered: Any) -> list[dict[str, Any]]:
    """Of each surface what was recovered, for JSON.

    recovered : the result's, None where nothing was
    given is the entry of [[local]] as the shot has it, of which a page sees whether it is still that one, and number
    its place there. spread is by how much the reflectance varies over the surface's pixels: half the distance between
    the 16th and the 84th percentile. The gloss has one standard deviation of each of its numbers.
    """
    if recovered is None:
        return []
    tables = [(number, table) for number, table in enumerate(shot.surfaces()) for _ in table.shapes(shot.folder)]
    found = []
    for (number, table), surface in zip(tables, recovered.surfaces, strict=True):
        fitted = surface.fitted
        found.append(
            {
                "number": number, "given": table.model_dump(mode="json", exclude_unset=True),
                "reflectance": _listed(surface.reflectance), "spread": _listed(surface.spread),
                "measured": _listed(surface.measured), "pixels": surface.pixels,
                "gloss": None if surface.gloss is None else {
                    "f0": surface.gloss.f0, "roughness": surface.gloss.roughness, "found": None if fitted is None else {
                        "f0_error": fitted.f0_error, "roughness_error": fitted.roughness_error, "points": fitted.points,
                        "views": fitted.views, "notes": list(fitted.notes),
                    },
                },
            }
        )  # fmt: skip
    return found


def _listed(colour: tuple[float, float, float] | None) -> list[float] | None:
    return None if colour is None else [float(each) for each in colour]

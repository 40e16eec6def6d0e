"""What `relume probe` tells of the light it made: every view's ball, how the views lie, the energy, what is unsure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from relume.cli.console import OutputOptions, note
from relume.probe.ball.blending import Probe
from relume.probe.ball.unwrapping import BallView


def remark(result: Probe, output: OutputOptions, count: int) -> None:
    """Notes on what no view saw and what was saturated, as the map's marks have it."""
    measured = result.light.audit()
    if measured.unseen > 0:
        again = "photograph from a second side" if count == 1 else "photograph from one more side"
        note(output, f"{measured.unseen:.3g} sr are seen by no view and were filled from beside; {again}")
    if measured.clipped > 0:
        note(output, f"{measured.clipped:.3g} sr are saturated in every photograph; add shorter exposures")


def facts_of(views: Sequence[BallView], result: Probe, told: bool, output: OutputOptions) -> dict[str, Any]:
    """The facts for a machine, or for a person with a line a ball.

    told : whether the places of the cameras were
    """
    balls = [_ball(view) for view in views]
    facts: dict[str, Any] = {}
    if output.json:
        facts["balls"] = balls
    else:
        facts |= {f"ball {number}" if len(balls) > 1 else "ball": ball for number, ball in enumerate(balls, start=1)}
    if len(views) > 1:
        facts["cameras told"] = told
        facts["turned by registration"] = [f"{math.degrees(c):.2f}°" for c in result.corrections]
        facts["brightness against the first"] = [round(gain, 3) for gain in result.gains]
        facts["surroundings, ball radii away"] = round(1 / result.nearness, 1) if result.nearness > 1e-3 else "far"
        if not told and result.turns is not None:
            towards = [turn @ view.towards_camera for turn, view in zip(result.turns, views, strict=True)]
            start = math.atan2(towards[0][0], towards[0][2])
            facts["turns found"] = [
                f"{math.degrees(math.atan2(x, z) - start) % 360:.1f}°" for x, _, z in (t.tolist() for t in towards)
            ]
    else:
        facts["turned by registration"] = ["0.00°"]
    return facts | result.light.audit().facts()


def _ball(view: BallView) -> dict[str, Any]:
    outline = view.outline
    found: dict[str, Any] = {
        "x": round(outline.centre[0], 2),
        "y": round(outline.centre[1], 2),
        "radius": round(outline.radius, 2),
        "radii away": round(view.distance, 2),
    }
    if outline.semi_axes is not None and outline.semi_axes[0] > 1.001 * outline.semi_axes[1]:
        found["semi-axes"] = [round(axis, 2) for axis in outline.semi_axes]
    return found

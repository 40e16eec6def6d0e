"""Slips of the tape measure and of the clock: lengths in another unit, a diameter for a radius, a plate of another day.

The ball's rim and the focal length say from how many radii it was photographed; the tape says it too.
"""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta

import numpy as np

from relume.capture.exposure.bracket import Bracket
from relume.errors import InvalidShot, warn
from relume.image.photograph import Settings
from relume.image.radiance import RadianceMap
from relume.probe.ball.unwrapping import BallView, unwrap_ball
from relume.project.shot_file.light_table import Ball, BallPhotographs
from relume.project.shot_file.shot import Shot
from relume.scene.cameras.camera import Camera

METRES = "lengths are metres: 5 cm are 0.05"
CLOSE = 20.0
"""Ball radii from the camera to the ball from which on the camera's own reflection and the perspective are small."""
REMOTE = 300.0
"""Ball radii, 15 m for a ball of 5 cm, from which nobody photographs one."""
OFF = 1.25
"""Times by which the distance by rim and focal length may differ from that by tape: EXIF rounds its focal lengths, and
lenses shorten them where they focus near."""
LOST = 1.7
"""Times by which it may differ where a rim that was missed is as likely as a slip of the tape."""
FULL = 0.6
"""Of the picture's shorter side that a ball covers from which on the picture is a crop."""
SUNK = 0.1
"""Of the ball's radius that it may reach into a plane: what the tape leaves unsure."""
LATER = timedelta(minutes=30)
"""Between plate and ball from which on the sun has moved by 7°."""
MISPLACED = 0.1
"""What a ball that stands elsewhere than it is said to does to the light: it turns it by some degrees."""
CHANGED = 0.2
"""What half an hour or half a kilometre does to daylight."""
EARTH = 6_371_000.0
"""Its radius, m."""
APART = 200.0
"""Metres between plate and ball that a receiver's errors do not explain."""


def require_measures(shot: Shot) -> None:
    """Raises InvalidShot where a camera stands inside the ball; warns of other lengths that cannot be."""
    ball = shot.light.ball
    if ball is None:
        return
    for index, table in enumerate(shot.light.balls or ()):
        if table.camera is None or ball.centre is None:
            continue  # found from the ball
        distance = float(np.linalg.norm(np.subtract(table.camera, ball.centre)))
        if distance <= ball.radius:
            raise InvalidShot(
                f"light.ball.radius: the ball is given {ball.radius:g} m, and the camera of light.balls.{index} stands "
                f"{distance:.3g} m from its middle, inside it; {METRES}"
            )
        radii = distance / ball.radius
        if radii > REMOTE:
            warn(
                f"light.balls.{index}.camera: {distance:.3g} m from a ball of {ball.radius:g} m, {radii:.0f} of its "
                f"radii; {METRES}",
                effect=MISPLACED,
            )
        elif radii < CLOSE - 0.5:
            warn(
                f"light.balls.{index}.camera: {radii:.2g} ball radii away; the camera hides much of the light there: "
                f"stand {CLOSE:g} radii away ({CLOSE * ball.radius:.2g} m) or more",
                effect=1 / radii**2,
            )
    if ball.centre is None:
        return
    heights = [table.height for table in shot.local if table.shape == "plane"]
    depth = max(heights, default=-np.inf) - (ball.centre[1] - ball.radius)
    if len(heights) == 1 and depth > SUNK * ball.radius:
        warn(
            f"light.ball: it reaches {depth:.2g} m into the plane it stands on; check its centre and radius", MISPLACED
        )


def require_outside_ball(camera: Camera, ball: Ball | None) -> None:
    """Raises InvalidShot where the plate's camera stands inside the ball: a slip of a unit."""
    if ball is None or ball.centre is None:
        return
    distance = float(np.linalg.norm(camera.position - np.array(ball.centre)))
    if distance <= ball.radius:
        raise InvalidShot(
            f"light.ball: a ball of radius {ball.radius:g} m at {list(ball.centre)}, and the plate's camera stands "
            f"{distance:.3g} m from its middle, inside it; {METRES}"
        )


def held_to_tape(view: BallView, index: int, table: BallPhotographs, ball: Ball) -> BallView:
    """The view, by the tape where it is a crop whose EXIF says the focal length of the whole picture; warns.

    view : by the focal length of the table or of the EXIF
    index : of `table` in light.balls
    """
    assert table.camera is not None and ball.centre is not None  # else there is no tape
    distance = float(np.linalg.norm(np.subtract(table.camera, ball.centre)))
    by_tape = distance / ball.radius
    quotient = view.distance / by_tape
    if 1 / OFF < quotient < OFF:
        return view
    seen = f"light.balls.{index}: by its rim and focal length the camera stood {view.distance:.3g} ball radii away"
    full = 2 * view.outline.radius > FULL * min(view.picture.size)
    if quotient < 1 and full and table.focal_length is None:
        warn(
            f"{seen}, by tape {by_tape:.3g}; the photographs are taken for crops, whose EXIF has the focal length of "
            "the whole picture, and the tape is believed: else give focal_length",
            effect=MISPLACED,
        )
        return unwrap_ball(
            view.picture, camera=np.array(table.camera), centre=np.array(ball.centre), radius=ball.radius,
            outline=view.outline, reflectance=view.reflectance,
        )  # fmt: skip
    if 1.7 < quotient < 2.3:
        advice = f"is {ball.radius:g} m the ball's diameter?"
    elif not 0.2 < quotient < 5:
        advice = METRES
    else:
        advice = "check camera, ball.radius and focal_length"
    # A rim that was lost takes light from a wrong area; what it is off by, where no slip of the tape explains it.
    lost = not full and 1 / LOST < quotient < LOST
    if lost:
        advice += "; or the rim was missed: `relume probe --picture` draws it, pick in light.balls gives it"
    effect = 1 - min(quotient, 1 / quotient) ** 2 if lost else MISPLACED
    warn(f"{seen}, by tape {by_tape:.3g}; {advice}", effect)
    return view


def other_time_or_place(plate: object, balls: tuple[object, ...]) -> Iterator[str]:
    """What the EXIF of plate and ball says against their having been taken together, a line each.

    plate, balls : brackets; others hold no EXIF of single photographs and are passed over
    """
    here = _settings(plate)
    there = [each for ball in balls for each in _settings(ball)]
    ours, theirs = _taken(here), _taken(there)
    if ours and theirs:
        after, before = min(ours) - max(theirs), min(theirs) - max(ours)
        gap, word = (after, "after") if after > before else (before, "before")
        if gap > LATER:
            yield (
                f"the plate was taken {_in_words(gap)} {word} the ball's photographs, by their cameras' clocks; "
                "daylight changes within minutes: photograph both together"
            )
    places = [[(each.latitude, each.longitude) for each in part if each.latitude is not None] for part in (here, there)]
    if places[0] and places[1]:
        metres = _metres_between(places[0][0], places[1][0])
        if metres > APART:
            yield (
                f"the plate was taken {metres / 1000:.1f} km from the ball's photographs, by their GPS; the light of "
                "another place does not fit: photograph both at one"
            )


def _settings(source: object) -> list[Settings]:
    if isinstance(source, RadianceMap) or not isinstance(source, Bracket):
        return []
    return [photograph.settings for photograph in source.photographs]


def _taken(settings: list[Settings]) -> list[datetime]:
    return [each.taken for each in settings if each.taken is not None]


def _in_words(gap: timedelta) -> str:
    hours = gap.total_seconds() / 3600
    if hours < 1:
        return f"{60 * hours:.0f} minutes"
    return f"{hours:.1f} hours" if hours < 48 else f"{hours / 24:.0f} days"


def _metres_between(first: tuple[float | None, float | None], second: tuple[float | None, float | None]) -> float:
    """Along the ground, between places (latitude, longitude) in degrees: the haversine formula."""
    one, other = np.radians(np.array(first, np.float64)), np.radians(np.array(second, np.float64))
    half = np.sin((other - one) / 2) ** 2
    return float(2 * EARTH * np.arcsin(np.sqrt(half[0] + np.cos(one[0]) * np.cos(other[0]) * half[1])))

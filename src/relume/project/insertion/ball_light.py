"""The light of a shot from its photographs of the ball: views unwrapped where their cameras stood, and blended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from relume.capture.brackets.result import MergedBracket
from relume.errors import InvalidShot, NotABracket, warn
from relume.image.bands import side_by_side
from relume.image.radiance import RadianceMap
from relume.probe.ball.blending import Probe, blend_views
from relume.probe.ball.probing import rim_doubts
from relume.probe.ball.reflectance import CHROME_STEEL, BallReflectance
from relume.probe.ball.registration import KnownPlaces, UnknownPlaces
from relume.probe.ball.rim_selection import picked_rim
from relume.probe.ball.silhouette import Outline
from relume.probe.ball.unwrapping import BallView, unwrap_ball
from relume.project.insertion.ball_camera import BallCamera
from relume.project.insertion.slips import held_to_tape
from relume.project.shot_file.light_table import Ball, BallPhotographs, picked_by_key
from relume.project.shot_file.shot import Shot

FEWEST = 0.01
"""Share of a ball's picture that has to be measured."""


def picked_outline(
    table: BallPhotographs, picture: RadianceMap, name: str, focal_length: float | None
) -> Outline | None:
    """The ball's outline that the shot file gives, followed where it is a pick; None where it gives none."""
    outline = table.outline()
    if outline is None or table.pick is None:
        return outline
    return picked_rim(picture.radiance, outline, name, focal_length)


def _reflectance(given: float | tuple[float, float, float] | str) -> BallReflectance:
    """Of the ball, as the shot file has it: numbers are means over the ball, "chrome" rises towards the rim."""
    if isinstance(given, str):
        return CHROME_STEEL
    red, green, blue = np.broadcast_to(given, 3).tolist()
    return BallReflectance((red, green, blue), rising=False)


def blended(shot: Shot, merged: Sequence[MergedBracket], stood: BallCamera | None) -> Probe:
    """The views of the ball, unwrapped and blended.

    stood : the plate's camera, where it was found from the ball: it took the views of which no other place is given
    """
    ball, tables = shot.light.ball, shot.light.balls or ()
    if ball is None or not tables:
        raise InvalidShot("light: balls and ball are both needed")
    works = [
        partial(_view, shot, ball, index, table, bracket, stood)
        for index, (table, bracket) in enumerate(zip(tables, merged, strict=True))
    ]
    views = side_by_side(works, max(each.picture.radiance.size // 3 for each in merged))
    known = all(table.camera is not None for table in tables[1:])
    return blend_views(views, size=shot.light.size, registration=KnownPlaces() if known else UnknownPlaces())


def _view(
    shot: Shot, ball: Ball, index: int, table: BallPhotographs, bracket: MergedBracket, stood: BallCamera | None
) -> BallView:  # fmt: skip
    """One view of the ball, unwrapped where its camera stood; its number in the shot is `index`."""
    picture = bracket.picture
    if picture.clipped is not None and (picture.clipped == 0).mean() < FEWEST:
        raise NotABracket(f"{bracket.name}: almost nothing is measured; add longer and shorter exposures")
    picture = replace(picture, variance=None)
    centre = ball.centre if stood is None else stood.centre
    place, focal_length = table.camera, table.focal_length or bracket.focal_length
    outline = picked_outline(table, picture, bracket.name, focal_length)
    if place is None and stood is not None:
        place = stood.fit.camera.position
        # The plate's own lens where the plate's camera took it; of a crop the EXIF's is that of the whole.
        outline = stood.outline if index == 0 and stood.outline is not None else outline
        if index == 0:
            focal_length = table.focal_length if stood.outline is None else stood.fit.camera.focal_length
    with picked_by_key(f"light.balls.{index}"):
        view = unwrap_ball(
            picture, camera=np.array(place), centre=np.array(centre), focal_length=focal_length,
            radius=ball.radius, outline=outline, name=bracket.name,
            reflectance=_reflectance(ball.reflectance),
            measured=table.camera is not None and ball.centre is not None,
        )  # fmt: skip
    remedy = "`relume probe --picture` draws it; take it by pick = [x, y, radius] in that entry of light.balls"
    for doubt in rim_doubts(view, bracket.name, remedy, picked=outline is not None):
        warn(doubt.line, doubt.effect)
    if stood is not None and stood.outline is not None and outline is stood.outline:
        return stood.turned(view)
    if focal_length is not None and table.camera is not None and ball.centre is not None:
        return held_to_tape(view, index, table, ball)
    return view

"""`fisheyes_from_files`: round photographs from one place in several directions in, an environment map out."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from relume.capture.response.camera_profile import CameraProfile
from relume.errors import GatheredDoubts, NotAPanorama
from relume.probe.panorama.files_to_map import HOLE
from relume.probe.panorama.matching import Matching
from relume.probe.panorama.view_files import KnownOrientation, Source, known_orientations, read_sources
from relume.probe.panorama.views import angles_of, orientation
from relume.probe.round_matching import ROUND, OrientedViews, orient_round_views
from relume.probe.round_views import FisheyeLens, ParabolicMirror, RoundLens, RoundView, join_round_views
from relume.sphere.environment_map import EnvironmentMap

MOST_ROWS = 4096
SMALLEST = 0.1
"""Of the picture's lesser side, the least a rim may be across: a smaller one is a slip in the numbers given."""


@dataclass(frozen=True, eq=False)
class RoundPanorama:
    """An environment map with the round views it was joined from.

    light : lat-long; `clipped` marks what no view saw, or none measured
    views : with the rotations and the lens that were found
    gains : (N,), that each picture was multiplied by
    unseen : share of the sphere that no view shows
    oriented : how the turns were found; None where they were given
    warnings : doubts about the result, a line each
    notes : what was done that nobody asked for, a line each
    """

    light: EnvironmentMap
    views: tuple[RoundView, ...]
    gains: np.ndarray
    unseen: float
    oriented: OrientedViews | None
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def facts(self, *, listed: bool = True) -> dict[str, object]:
        """What was found, degrees; the views as one list (`listed`) for machines, or by name, for lines."""
        views: list[dict[str, object]] = []
        for index, (view, gain) in enumerate(zip(self.views, self.gains, strict=True)):
            angles = (round(math.degrees(angle), 2) + 0.0 for angle in angles_of(view.rotation))
            of_view: dict[str, object] = dict(zip(("yaw", "pitch", "roll"), angles, strict=True))
            if self.oriented is not None:
                of_view["deviation"] = float(f"{math.degrees(self.oriented.deviations[index]):.2g}")
                of_view["matches"] = int(self.oriented.matches[index])
            views.append({"name": view.name, **of_view, "gain": float(f"{gain:.4g}")})
        lens, found = self.views[0].lens, self.oriented
        light = self.light.audit().facts()
        return {
            "size": f"{2 * self.light.size}×{self.light.size}",
            **({"views": views} if listed else {f"view {view.pop('name')}": view for view in views}),
            "field": f"{math.degrees(lens.field):.1f}°" if isinstance(lens, FisheyeLens | ParabolicMirror) else None,
            "matches agree within": None if found is None else f"{math.degrees(found.error):.3f}°",
            "unseen": f"{self.unseen:.2%}",
            **{key: light[key] for key in ("total", "irradiance", "peak", "peak direction")},
        }


def fisheyes_from_files(
    paths: Sequence[str | os.PathLike[str]],
    lens: RoundLens = FisheyeLens(),
    *,
    rim: tuple[float, float, float] | None = None,
    turn: float | None = None,
    orientations: str | os.PathLike[str] | None = None,
    profile: CameraProfile | None = None,
    size: int | None = None,
    balance: bool = True,
    matching: Matching = ROUND,
) -> RoundPanorama:
    """Read round views, find out how each was turned, and join them into an environment map.

    paths : each a photograph, a radiance map, or a folder with the bracket of one view
    lens : that drew all of them; its field is found with the turns, within some per cent of what is given
    rim : x, y and radius of the round picture, pixels from the upper left corner; unless given it is centred and
        touches the nearer borders
    turn, orientations : where views looked, as in `known_orientations`: all, and none is matched; or a table of some,
        which keep theirs, and the others are matched. Where none is known the first view looks level towards −Z
    profile : of the camera; recovered from brackets unless given, sRGB for single photographs
    size : rows of the map, even; as fine as the views unless given, 4096 at most
    balance, matching : as in `join_round_views` and `orient_round_views`
    Raises UnreadableFile, NotABracket, NotAPanorama, ValueError.
    """
    places = [Path(path) for path in paths]
    known = known_orientations(places, turn=turn, table=orientations)
    with GatheredDoubts() as gathered:
        sources = read_sources(places, profile=profile)
        views = [_view(each, lens, rim, known.get(path)) for each, path in zip(sources, places, strict=True)]
        given = [path in known for path in places]
        oriented = None if all(given) else orient_round_views(views, matching, known=given if any(given) else None)
        views = views if oriented is None else list(oriented.views)
        probe = join_round_views(views, size or _rows(views), balance=balance)
    notes = tuple(doubt.line for doubt in gathered.doubts)
    angles = probe.light.mapping.solid_angles(probe.light.size)
    unseen = float((angles * (probe.seen < 0.5)).sum() / angles.sum())
    doubts = (f"{unseen:.0%} of the sphere is seen by no view; add views",) if unseen > HOLE else ()
    return RoundPanorama(probe.light, tuple(views), probe.gains, unseen, oriented, doubts, notes)


def _view(
    source: Source, lens: RoundLens, rim: tuple[float, float, float] | None, given: KnownOrientation | None
) -> RoundView:
    """A view, turned as it is given or not at all; raises NotAPanorama for a rim that cannot be."""
    width, height = source.picture.size
    x, y, radius = (width / 2, height / 2, min(width, height) / 2) if rim is None else rim
    if not (0 < x < width and 0 < y < height):
        raise NotAPanorama(f"{source.name}: the rim's middle {x:g}, {y:g} is not within {width}×{height} pixels")
    if 2 * radius < SMALLEST * min(width, height):
        raise NotAPanorama(
            f"{source.name}: a rim of radius {radius:g} in {width}×{height} pixels is less than "
            f"{SMALLEST:.0%} of the picture across; give the middle and the radius of the circle in pixels"
        )
    return RoundView(source.picture, lens, (x, y), radius, _known(given), source.name)


def _rows(views: Sequence[RoundView]) -> int:
    """Rows of a map that is as fine as the finest view is on average from its middle to its rim."""
    fields = [each.lens.field if isinstance(each.lens, FisheyeLens | ParabolicMirror) else math.tau for each in views]
    rows = max(2 * each.radius * math.pi / field for each, field in zip(views, fields, strict=True))
    return min(2 * math.ceil(rows / 2), MOST_ROWS)


def _known(given: KnownOrientation | None) -> np.ndarray:
    return np.eye(3) if given is None else orientation(*map(math.radians, (given.yaw, given.pitch, given.roll)))

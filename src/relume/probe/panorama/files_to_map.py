"""`panorama_from_files`: photographs from one place in several directions in, an environment map out."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from relume.capture.brackets.settings import MergeSettings
from relume.capture.response.camera_profile import CameraProfile
from relume.errors import GatheredDoubts, NotAPanorama, UnreadableFile
from relume.probe.panorama.balance import Balancing
from relume.probe.panorama.matching import Matching
from relume.probe.panorama.stitching import Panorama, stitch_panorama
from relume.probe.panorama.view_files import (
    CUBE_FIELD,
    KnownOrientation,
    known_orientations,
    oriented_view,
    read_sources,
    stored_crop,
)

HOLE = 0.02
"""Share of the sphere that may be unseen before the map is doubtful: what a tripod hides."""


@dataclass(frozen=True)
class PanoramaSettings:
    """How views become one environment map.

    size : rows of the map; as fine as the views unless given
    field : across, degrees, instead of what the files hold
    faces, turn, orientations : where the views looked, as in `known_orientations`; give one at most
    match : find the orientation although the views hold how they were cropped out of a map
    matching : how orientations are found
    balance : of exposure and vignetting; None leaves views in cd/m² and crops of one map as they are, and balances
        all others
    colours : whether each channel is balanced by itself
    merge : how brackets become radiance
    """

    size: int | None = None
    field: float | None = None
    faces: tuple[str, ...] = ()
    turn: float | None = None
    orientations: Path | None = None
    match: bool = False
    matching: Matching = Matching()
    balance: bool | None = None
    colours: bool = False
    merge: MergeSettings = MergeSettings()

    def known(self, paths: Sequence[Path]) -> Mapping[Path, KnownOrientation]:
        """The orientations that are given of the views in these files; refuses views and settings that cannot be.

        paths : of the views
        """
        for path in paths:
            if not path.exists():
                raise UnreadableFile(f"{path}: no such file or folder; check the path")
        if len(paths) < 2:
            name = paths[0].name if paths else "no view"
            raise NotAPanorama(f"{name}: a panorama needs two views at least; give the others too")
        known = known_orientations(paths, faces=self.faces, turn=self.turn, table=self.orientations)
        if self.match and known:
            raise ValueError("match finds the orientation that faces, turn or orientations give; give one")
        return known


def panorama_from_files(
    paths: Sequence[str | os.PathLike[str]],
    *,
    profile: CameraProfile | None = None,
    settings: PanoramaSettings = PanoramaSettings(),
) -> Panorama:
    """Read the views, find out where each looked, and stitch them into an environment map.

    paths : each a photograph, a radiance map, or a folder with the bracket of one view
    profile : of the camera; recovered from brackets unless given, sRGB for single photographs
    settings : orientations, balance, and how brackets become radiance
    Raises UnreadableFile, NotABracket, NotAPanorama, ValueError.
    """
    paths = [Path(path) for path in paths]
    known = settings.known(paths)
    notes: list[str] = []
    with GatheredDoubts() as gathered:
        # Radiance, lens and orientation of each view.
        sources = read_sources(paths, profile=profile, settings=settings.merge)
        if assumed := [source.name for source in sources if source.assumed]:
            notes.append(
                f"{len(assumed)} single photographs are assumed to be sRGB, and show no more than their own exposure; "
                "--profile gives their camera's response, folders give whole brackets"
            )
        stored = [stored_crop(source.picture, source.name) for source in sources]
        use = not (settings.match or known)
        crops = [crop if crop is None or use else replace(crop, rotation=None) for crop in stored]
        views = [
            oriented_view(
                source, known.get(path), crop, field=settings.field,
                assumed_field=CUBE_FIELD if settings.faces else None,
            )
            for source, path, crop in zip(sources, paths, crops, strict=True)
        ]  # fmt: skip
        cropped = [crop is not None and crop.rotation is not None for crop in stored]
        if use and any(cropped):
            notes.append(
                f"{sum(cropped)} of {len(views)} views hold how they were cropped out of an environment map, and are "
                "put back there; --match finds their orientation anyway"
            )

        # Views that share one exposure are not balanced.
        balance, calibrated = settings.balance, sources[0].picture.unit != "relative"
        if balance is None and not settings.colours and (calibrated or all(cropped)):
            balance = False
            why = "radiance in cd/m² was measured" if calibrated else "crops of an environment map share its exposure"
            notes.append(f"the views are not balanced: {why}; --balance does it")

        result = stitch_panorama(
            views,
            size=settings.size,
            matching=settings.matching,
            balancing=None if balance is False else Balancing(colours=settings.colours),
        )

    # What the map lacks.
    notes += result.notes
    if result.saturated > 0:
        notes.append(f"{result.saturated:.2g} sr are saturated in every view; add shorter exposures")
    if result.unseen > 0:
        notes.append(f"{result.unseen:.2g} sr are seen by no view and were filled in smoothly")
    doubts = list(result.warnings)
    if result.unseen > HOLE * 4 * math.pi:
        doubts.append(f"{100 * result.unseen / (4 * math.pi):.0f} % of the sphere is seen by no view; add views")
    lines = dict.fromkeys([*(each.line for each in gathered.doubts), *notes])
    return replace(result, notes=tuple(lines), warnings=tuple(doubts))

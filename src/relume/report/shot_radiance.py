"""The photographs of a shot merged as `insert` merges them, for looking at their radiance before anything is lit by it.

Beside the maps stands what they were made by: each camera's response with its observations, and by how many stops every
photograph departs from what the others of its bracket say of the same places.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from relume.capture.brackets.result import MergedBracket, MergedCamera
from relume.capture.exposure.bracket import Bracket
from relume.errors import Doubt, GatheredDoubts, InvalidShot, ranked
from relume.image.radiance import RadianceMap
from relume.image.response import Response
from relume.project.insertion.photographs import read_photographs
from relume.project.merging.merged_photographs import merged_brackets
from relume.project.shot_file.shot import Shot

PLACES = 100_000
"""Pixels of a bracket that are compared between its photographs, about."""
EXPOSED = (0.06, 0.94)
"""Shares of white between which a value says well how much light there was."""
FEWEST = 50
"""Places that two photographs must both show well for one to be judged by the other."""


@dataclass(frozen=True, eq=False)
class ShotRadiance:
    """The radiance of a shot's photographs.

    names : "plate", "ball 1", … of the brackets; a plate that is a radiance map is none
    brackets : merged, in that order
    cameras : what is known of each camera, by its name
    residuals : for each bracket, by the names of its photographs: by how many stops the light that one shows departs
        from the mean of the others. It is the median over places that both show well; None where there are too few
    doubts : what the user should know, what matters most first
    """

    names: tuple[str, ...]
    brackets: tuple[MergedBracket, ...]
    cameras: dict[str, MergedCamera]
    residuals: tuple[dict[str, float | None], ...]
    doubts: tuple[Doubt, ...]


def merge_shot(shot: Shot, *, progress: Callable[[str, float], None] = lambda step, share: None) -> ShotRadiance:
    """Merge every bracket of a shot: the radiance that `insert` goes on with, before it is denoised.

    shot : as `read_shot` or `Shot.new` made it
    progress : called with the name of each step and the share of it that is done, 0 to 1
    Raises UnreadableFile, NotABracket, InvalidShot, also where the shot has finished maps alone.
    """
    with GatheredDoubts() as gathered:
        progress("photographs", 0.0)
        photographs = read_photographs(shot)
        progress("photographs", 1.0)
        given = isinstance(photographs.plate, RadianceMap)
        if given and not photographs.balls:
            raise InvalidShot("plate.photographs: plate and light are radiance maps already; there is nothing to merge")
        progress("merge", 0.0)
        brackets, cameras = merged_brackets(shot, photographs)
        progress("merge", 1.0)
    names = (*(() if given else ("plate",)), *(f"ball {n + 1}" for n in range(len(photographs.balls))))
    sources = (*(() if given else (photographs.plate,)), *photographs.balls)
    residuals = tuple(
        _residuals(_merged_from(each, source), cameras[name].response if name in cameras else None)
        for each, source, name in zip(brackets, sources, (each.camera for each in brackets), strict=True)
    )
    return ShotRadiance(names, tuple(brackets), cameras, residuals, ranked(gathered.doubts))


def _merged_from(merged: MergedBracket, source: object) -> Bracket | None:
    """The photographs as they were merged, lying on one another; None for camera raws."""
    if merged.deghosted is not None:
        return merged.deghosted.bracket
    if merged.aligned is not None:
        return merged.aligned.bracket
    return source if isinstance(source, Bracket) else None


def _residuals(bracket: Bracket | None, response: Response | None) -> dict[str, float | None]:
    """Of each photograph by its name: g(Z) − ln Δt against the mean of the others' (Debevec & Malik 1997, eq. 5)."""
    if bracket is None or response is None:
        return {}
    photographs = bracket.photographs
    height, width = photographs[0].pixels.shape[:2]
    step = max(1, round((height * width / PLACES) ** 0.5))
    values = np.stack([each.pixels[::step, ::step].reshape(-1, 3) for each in photographs])
    white = int(np.iinfo(values.dtype).max)
    if response.levels != white + 1:
        return {}
    exposed = (values > EXPOSED[0] * white) & (values < EXPOSED[1] * white)
    # ln E of each place, as each photograph has it.
    logs = np.stack([response.log_exposure[c][values[..., c]] for c in range(3)], axis=-1)
    logs -= np.log(bracket.exposures)[:, None, None]
    count, total = exposed.sum(0), np.where(exposed, logs, 0.0).sum(0)
    found: dict[str, float | None] = {}
    for photograph, mine, shows in zip(photographs, logs, exposed, strict=True):
        both = shows & (count > 1)
        away = mine[both] - (total[both] - mine[both]) / (count[both] - 1)
        found[photograph.name] = float(np.median(away) / np.log(2)) if away.size >= FEWEST else None
    return found

"""Sorting the photographs of a shoot into brackets, by their settings and the order in which they were taken."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np

from relume.capture.exposure.folder import expand, listed_exposures, name_order
from relume.image import files
from relume.image.files import Facts
from relume.image.photograph import Exposure, Settings

_LONG = 4.0  # times the usual pause: a walk to the next place, where the usual pause is what the camera needs
_SHORTEST = 3.0  # s; no pause below it parts a bracket: cameras that write to a slow card stop for it
_CONTINUED = 600.0  # s; a bracket that was continued at other exposures was continued within ten minutes
_STEP = 0.2  # stops; marked speeds of one exposure differ by less


class Photographed(Protocol):
    """What grouping needs to know: a `Photograph` has it, and so do `Facts`."""

    @property
    def name(self) -> str: ...
    @property
    def size(self) -> tuple[int, int]: ...
    @property
    def exposure(self) -> Exposure | None: ...
    @property
    def camera(self) -> str: ...
    @property
    def settings(self) -> Settings: ...


T = TypeVar("T", bound=Photographed)


def group_files(paths: Iterable[str | os.PathLike[str]], *, sidecars: bool = True) -> tuple[tuple[Path, ...], ...]:
    """The brackets among photographs and folders of them, read from headers alone; folders are never mixed.

    paths : of photographs, and folders of them
    sidecars : let lists beside the photographs give the exposures, as `read_bracket` does
    Raises UnreadableFile, NotABracket.
    """
    facts = [files.read_facts(path) for path in expand(paths)]
    brackets: list[tuple[Path, ...]] = []
    for _, folder in groupby(facts, key=lambda f: Path(f.name).parent):
        brackets += [tuple(Path(f.name) for f in bracket) for bracket in group(_listed(list(folder), sidecars))]
    return tuple(brackets)


def group(photographs: Sequence[T]) -> tuple[tuple[T, ...], ...]:
    """Photographs parted into brackets, each in the order in which it was taken.

    Those of another camera, size, aperture, focal length or white balance belong to another bracket. Of the rest, a
    pause much longer than the usual one parts two brackets, but for a bracket that goes on after the pause at exposures
    next to those before it. Without such a pause a new bracket begins where the exposures start over.
    """
    brackets: list[tuple[T, ...]] = []
    for members in _by_settings(photographs):
        runs = [run for part in _parted_by_pauses(members) for run in _parted_by_repetition(part)]
        brackets += map(tuple, runs)
    places = {id(photograph): place for place, photograph in enumerate(_in_order(photographs))}
    return tuple(sorted(brackets, key=lambda bracket: places[id(bracket[0])]))


def _listed(facts: list[Facts], sidecars: bool) -> list[Facts]:
    if not sidecars:
        return facts
    listed = listed_exposures([Path(f.name) for f in facts], None)
    return [replace(f, exposure=e or f.exposure) for f, e in zip(facts, listed, strict=True)]


def _by_settings(photographs: Sequence[T]) -> list[list[T]]:
    alike: dict[object, list[T]] = {}
    for photograph in _in_order(photographs):
        settings, exposure = photograph.settings, photograph.exposure
        f_number = exposure.f_number if exposure else None
        key = (photograph.camera, settings.serial, photograph.size, f_number)
        alike.setdefault((*key, settings.focal_length, settings.automatic_white), []).append(photograph)
    return list(alike.values())


def _in_order(photographs: Sequence[T]) -> list[T]:
    """By the time taken where all hold one, and by name among those of one time."""
    if all(p.settings.taken for p in photographs):
        return sorted(photographs, key=lambda p: (p.settings.taken, name_order(p.name)))
    return sorted(photographs, key=lambda p: name_order(p.name))


def _parted_by_pauses(members: list[T]) -> list[list[T]]:
    pauses = _pauses(members)
    if len(pauses) == 0:
        return [members]
    threshold = max(_SHORTEST, _LONG * float(np.median(pauses)))
    parts = [[members[0]]]
    for photograph, pause in zip(members[1:], pauses, strict=True):
        if pause > threshold and not (pause < _CONTINUED and _goes_on(parts[-1], members, photograph, threshold)):
            parts.append([])
        parts[-1].append(photograph)
    return parts


def _pauses(members: list[T]) -> np.ndarray:
    """Seconds from the end of each exposure to the beginning of the next; empty where not all times are known."""
    taken = [p.settings.taken for p in members]
    if not all(taken):
        return np.zeros(0)
    begun = [(t - taken[0]).total_seconds() for t in taken if t and taken[0]]
    return np.diff(begun) - [p.exposure.seconds if p.exposure else 0.0 for p in members[:-1]]


def _goes_on(before: list[T], members: list[T], first: T, threshold: float) -> bool:
    """Whether the photographs from `first` to the next long pause carry on the exposures `before`.

    Their range must lie beside the other and no further off than the largest step in either: a bracket of a room, and
    after it one of the sunlit yard, are as little one bracket as two brackets of one range are.
    """
    start = next(i for i, photograph in enumerate(members) if photograph is first)
    long = np.flatnonzero(_pauses(members[start:]) > threshold)
    after = members[start : start + int(long[0]) + 1] if len(long) else members[start:]
    if len(before) < 2 or len(after) < 2 or not all(p.exposure for p in (*before, *after)):
        return False
    lower, upper = sorted((_stops(before), _stops(after)), key=lambda stops: stops[0])
    step = max(np.diff(lower).max(), np.diff(upper).max())
    return bool(_STEP < upper[0] - lower[-1] < step + 2 * _STEP)


def _parted_by_repetition(members: list[T]) -> list[list[T]]:
    """The runs in which no exposure occurs twice; all in one where any such run would be a single photograph.

    So photographs of one exposure stay together, and so do those of a bracket that was taken twice frame by frame.
    """
    if not all(p.exposure for p in members):
        return [members]
    runs: list[list[T]] = [[]]
    for photograph in members:
        if any(abs(float(np.diff(_stops([photograph, other])[:2])[0])) < _STEP for other in runs[-1]):
            runs.append([])
        runs[-1].append(photograph)
    return runs if min(map(len, runs)) > 1 else [members]


def _stops(photographs: Sequence[Photographed]) -> np.ndarray:
    """Exposures in stops, rising."""
    return np.sort([np.log2(p.exposure.factor) for p in photographs if p.exposure])

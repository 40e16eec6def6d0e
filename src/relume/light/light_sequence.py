"""Light that changes with time: environment maps one after the other, as of a probe that was filmed.

Between two maps radiance is interpolated linearly, in linear light, so that nothing flickers and constant light stays
constant; before the first and after the last the ends hold. `LightSequence` is what `insert`, `render`, `reflect` and
`stage relight` all ask for the light at a time.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from glob import escape, glob
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from relume.errors import UnreadableFile
from relume.image.files.video import is_video
from relume.image.radiance import SATURATED
from relume.sphere.environment_files import read_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.map_store import is_map_store, maps_in_store, name_of_map, number_in_store
from relume.sphere.mappings.mapping import Mapping

ENDINGS = (".exr", ".hdr", ".pic")


@dataclass(frozen=True)
class Moment:
    """Where a time lies between two maps of a sequence.

    before, after : their files; one file twice on a map, before the first and after the last
    share : of the second, 0 to below 1
    """

    before: Path
    after: Path
    share: float


@dataclass(frozen=True)
class LightSequence:
    """Environment maps one after the other.

    paths : files, in order; the first is at 0 s
    rate : maps a second; 24 as of a cinema film
    interpolation : "linear" in radiance between two maps, or "none", the earlier map until the next
    mapping : where the files do not store it
    clamp : set negative pixels to 0, with a warning

    Raises ValueError for no maps, and for a rate or a word that is none.
    """

    paths: tuple[Path, ...]
    rate: float = 24.0
    interpolation: Literal["linear", "none"] = "linear"
    mapping: Mapping | None = None
    clamp: bool = False

    def __post_init__(self) -> None:
        if not self.paths:
            raise ValueError("no maps; give files, or a pattern that files have, as probe/*.exr")
        if not 0 < self.rate < np.inf:
            raise ValueError(f"the rate is {self.rate:g} maps a second; it must be above 0")
        if self.interpolation not in ("linear", "none"):
            raise ValueError(f'the interpolation is {self.interpolation!r}; expected "linear" or "none"')

    @classmethod
    def found(
        cls,
        patterns: str | os.PathLike[str] | Iterable[str | os.PathLike[str]],
        rate: float = 24.0,
        interpolation: Literal["linear", "none"] = "linear",
        *,
        folder: str | os.PathLike[str] = ".",
        mapping: Mapping | None = None,
        clamp: bool = False,
    ) -> LightSequence:
        """The maps of patterns, names, folders and stores, by the last number in each name; where none has one by name.

        patterns : like "maps/*.exr", names of files, folders, or a store
        rate, interpolation, mapping, clamp : as of the sequence itself
        folder : from which they start
        Raises UnreadableFile for what is not there, for a number that is missing or there twice, and for a name
        without a number among others.
        """
        words = [patterns] if isinstance(patterns, str | os.PathLike) else list(patterns)
        paths = [path for word in words for path in _matching(Path(folder), word)]
        return cls(tuple(_in_order(paths)), rate, interpolation, mapping, clamp)

    @property
    def seconds(self) -> float:
        """From the first map to the last."""
        return (len(self.paths) - 1) / self.rate

    def times(self, rate: float = 24.0) -> tuple[float, ...]:
        """Seconds of the pictures of a film, `rate` in each second, from the first map to the last."""
        if not 0 < rate < np.inf:
            raise ValueError(f"the rate is {rate:g} pictures a second; it must be above 0")
        return tuple(number / rate for number in range(int(self.seconds * rate + 1e-6) + 1))

    def moment(self, seconds: float) -> Moment:
        """The maps round a time in `seconds` and where it lies between them.

        Raises ValueError for a time that is none.
        """
        if not np.isfinite(seconds):
            raise ValueError(f"the time is {seconds}; expected seconds")
        # A frame's time is a sum of fractions: what is on a map but for rounding is on it.
        place = min(max(seconds * self.rate, 0.0), len(self.paths) - 1.0)
        place = float(np.round(place)) if abs(place - np.round(place)) < 1e-6 else place
        first = int(place)
        share = place - first if self.interpolation == "linear" else 0.0
        return Moment(self.paths[first], self.paths[first + (share > 0)], share)

    def at(self, seconds: float) -> EnvironmentMap:
        """The light at a time in `seconds`.

        Raises UnreadableFile where the two maps round it differ in mapping, size or unit.
        """
        moment = self.moment(seconds)
        first = self._read(moment.before)
        if not moment.share:
            return first
        second = self._read(moment.after)
        _require_alike(moment.before, _kind(first), moment.after, _kind(second))
        share = np.float32(moment.share)
        radiance = (1 - share) * first.radiance + share * second.radiance
        return EnvironmentMap(radiance, first.mapping, first.unit, _marks(first, second), first.attributes)

    def weights(self, begin: float, end: float) -> dict[Path, float]:
        """The share of each map in the mean light from one second to another, exactly; together 1.

        begin, end : seconds
        Raises ValueError for times that are none, or that fall.
        """
        if not (np.isfinite(begin) and np.isfinite(end) and begin <= end):
            raise ValueError(f"from {begin} to {end} s; expected seconds that rise")
        first, last = begin * self.rate, end * self.rate
        if last - first < 1e-9:
            moment = self.moment(begin)
            return (
                {moment.before: 1.0}
                if not moment.share
                else {moment.before: 1 - moment.share, moment.after: moment.share}
            )
        shares = np.zeros(len(self.paths))
        # Each stretch between two maps by itself; before the first and after the last the ends hold.
        cuts = [first, *range(int(np.ceil(first)), int(np.floor(last)) + 1), last]
        for low, high in pairwise(cuts):
            place = min(max((low + high) / 2, 0.0), len(shares) - 1.0)
            index = min(int(place), len(shares) - 1)
            share = place - index if self.interpolation == "linear" else 0.0
            shares[index] += (1 - share) * (high - low)
            if share:
                shares[index + 1] += share * (high - low)
        return {path: float(each / (last - first)) for path, each in zip(self.paths, shares, strict=True) if each > 0}

    def mean(self, begin: float, end: float) -> EnvironmentMap:
        """The mean light from one second to another, as a shutter sees it that is open so long; of one time that light.

        begin, end : seconds
        Raises as `at` and `weights`.
        """
        parts = list(self.weights(begin, end).items())
        first = self._read(parts[0][0])
        if len(parts) == 1:
            return first
        radiance, marks = np.zeros(first.radiance.shape, np.float64), first
        for path, share in parts:
            other = self._read(path)
            _require_alike(parts[0][0], _kind(first), path, _kind(other))
            radiance += share * other.radiance
            marks = replace(first, clipped=_marks(marks, other))
        return replace(marks, radiance=radiance.astype(np.float32))

    def _read(self, path: Path) -> EnvironmentMap:
        return _map_in_file(path, _stamp(path), self.mapping, self.clamp)

    def checked(self) -> LightSequence:
        """The same sequence, after every map was read.

        Raises UnreadableFile for a map that cannot be read, or is not as the first.
        """
        stamps = tuple(_stamp(path) for path in self.paths)
        kinds = [
            _kind_in_file(path, stamp, self.mapping, self.clamp) for path, stamp in zip(self.paths, stamps, strict=True)
        ]
        for path, kind in zip(self.paths[1:], kinds[1:], strict=True):
            _require_alike(self.paths[0], kinds[0], path, kind)
        return self


_Kind = tuple[str, int, str]
"""Mapping, rows and unit."""


def _kind(light: EnvironmentMap) -> _Kind:
    return light.mapping.name, light.size, light.unit


@lru_cache(maxsize=2)
def _map_in_file(path: Path, stamp: int, mapping: Mapping | None, clamp: bool) -> EnvironmentMap:
    """The map of a file, read once for the times on both sides of it; `stamp` is there for the cache alone."""
    return read_environment(path, mapping, clamp=clamp)


@lru_cache(maxsize=100_000)
def _kind_in_file(path: Path, stamp: int, mapping: Mapping | None, clamp: bool) -> _Kind:
    return _kind(read_environment(path, mapping, clamp=clamp))


def _stamp(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0


def _require_alike(first: Path, one: _Kind, path: Path, other: _Kind) -> None:
    words = ("a {} map", "a map of {} rows", "in {}")
    for word, mine, theirs in zip(words, one, other, strict=True):
        if mine != theirs:
            raise UnreadableFile(
                f"{path}: {word.format(theirs)}, but {name_of_map(first)} is {word.format(mine)}; the maps of a "
                "sequence are alike: convert them with convert --each"
            )


def _marks(first: EnvironmentMap, second: EnvironmentMap) -> np.ndarray | None:
    """Marks of a mixture: a lower bound where either map is one, else unseen where either is."""
    if first.clipped is None and second.clipped is None:
        return None
    empty = np.zeros(first.radiance.shape[:2], np.uint8)
    one, other = (empty if each.clipped is None else each.clipped for each in (first, second))
    either = np.maximum(one, other)
    return np.where((one == SATURATED) | (other == SATURATED), SATURATED, either).astype(np.uint8)


def _matching(folder: Path, word: str | os.PathLike[str]) -> list[Path]:
    """The files of a name, a pattern or a folder."""
    path = folder / word
    if is_map_store(path):
        return list(maps_in_store(path))
    if is_video(path):
        raise UnreadableFile(f"{path}: a film, and no maps; make them: relume probe {path.name} -o {path.stem}.zarr")
    if path.is_dir():
        found = [each for each in path.iterdir() if each.suffix.lower() in ENDINGS and not each.name.startswith(".")]
    elif path.is_file() or not any(c in os.fspath(word) for c in "*?["):
        found = [path]
    else:
        # The folder is a name, whatever brackets are in it.
        place = os.fspath(word) if Path(word).is_absolute() else os.path.join(escape(str(folder)), os.fspath(word))
        found = [Path(name) for name in glob(place)]
    if not found or not all(each.is_file() for each in found):
        raise UnreadableFile(f"{path}: no such maps; give files, a folder of them, or a pattern, as probe/*.exr")
    return found


def _in_order(paths: Sequence[Path]) -> list[Path]:
    """By the last number in each name; where none has a number, by name. In a store by the number of the map."""
    if not any(re.search(r"\d", path.stem) for path in paths):
        return sorted(paths)
    numbers: dict[int, Path] = {}
    for path in paths:
        stored = number_in_store(path)
        digits = re.findall(r"\d+", path.stem) if stored is None else [stored]
        if not digits:
            raise UnreadableFile(
                f"{path}: no number in its name, by which maps are ordered; name them as probe_0001.exr"
            )
        other = numbers.setdefault(int(digits[-1]), path)
        if other != path:
            raise UnreadableFile(f"{path}: {other.name} has the number {int(digits[-1])} too; keep one of them")
    order = sorted(numbers)
    step = min(after - before for before, after in pairwise(order)) if len(order) > 1 else 1
    for before, after in pairwise(order):
        if after - before != step:
            raise UnreadableFile(
                f"{numbers[before]}: after it the map of number {before + step} is missing; the next is "
                f"{numbers[after].name}"
            )
    return [numbers[number] for number in order]

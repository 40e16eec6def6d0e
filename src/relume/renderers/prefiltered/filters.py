"""How a pixel reads a reflection map: at its middle, or over all that it reflects (Miller & Hoffman 1984, §§7.1, 8).

Each is a frozen value for `Prefiltered(filter=…)`. `prepared(table)` makes of a table (H, 2H, 3) what the filter reads;
`add` adds a layer's light to the chosen samples.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from relume.image.bands import in_threads
from relume.renderers.prefiltered import filter_kernels as kernels
from relume.renderers.prefiltered.plain_kernel import plain, plain_at_once
from relume.renderers.prefiltered.shading_inputs import Samples, Term
from relume.sphere.bilinear_kernels import padded
from relume.sphere.mappings.mapping import LatLong

_NEAR = 8192
"""Samples whose normals, views and light a core keeps in its own cache."""
Lookup = Callable[[np.ndarray, np.ndarray], None]
"""Writes what samples see, whose indices (Q,) are given second, to `seen` (Q, 4) float32."""


@dataclass(frozen=True, eq=False)
class Spans:
    """The samples of a picture, and what was already found of them.

    samples : P of them, with M corners
    threads : all cores for None
    """

    samples: Samples
    threads: int | None = None
    _found: dict[tuple, np.ndarray] = field(default_factory=dict)

    def middles(self, term: Term, size: int) -> np.ndarray:
        """The samples' directions (P, 3) float32 for a size of 3; their image points (P, 2) in a lat-long map for 2."""
        return self._once(self.samples.normal, self.samples.to_eye, size, term)

    def corners(self, term: Term, size: int) -> np.ndarray:
        """The corners' directions (M, 3), or image points (M, 2); up to four samples share one."""
        return self._once(self.samples.corner_normal, self.samples.corner_to_eye, size, term)

    def _once(self, normals: np.ndarray, views: np.ndarray, size: int, term: Term) -> np.ndarray:
        wanted = (id(normals), size, term.kind, float(term.ratio))
        if wanted not in self._found:
            places = np.empty((len(normals), size), np.float32)
            in_threads(
                lambda begin, end: kernels.find_places(places, normals, views, term.kind, term.ratio, begin, end),
                len(places), self.threads,
            )  # fmt: skip
            self._found[wanted] = places
        return self._found[wanted]

    def over_quads(self, term: Term, lookup: Callable[[np.ndarray, np.ndarray, np.ndarray], None]) -> Lookup:
        """What `lookup(seen, quads, samples' indices)` sees in the directions (Q, 4, 3) that samples' corners span."""
        keys, middles = self.corners(term, 3), self.middles(term, 3)

        def over(seen: np.ndarray, here: np.ndarray) -> None:
            quads = np.empty((len(here), 4, 3), np.float32)
            kernels.quadrilaterals(quads, here, self.samples, middles, keys)
            lookup(seen, quads, here)

        return over

    def add(self, light: np.ndarray, chosen: np.ndarray, term: Term, lookup: Lookup, *, chunk: int = 65536) -> None:
        """Add what is looked up for the chosen samples, times the term's weight, to `light` (P, 4) float32."""

        def work(begin: int, end: int) -> None:
            here = chosen[begin:end]
            seen = np.zeros((len(here), 4), np.float32)
            lookup(seen, here)
            kernels.add_seen(light, here, seen, self.samples, term)

        in_threads(work, len(chosen), self.threads, chunk=chunk)


class Filter(Protocol):
    """A way to read a table."""

    def prepared(self, table: np.ndarray) -> Any:
        """What is kept of a table (H, 2H, 3)."""
        return padded(table)

    def add(self, light: np.ndarray, chosen: np.ndarray, spans: Spans, term: Term, prepared: Any) -> None:
        """Add the term of the `chosen` samples, (Q,) indices, to `light` (P, 4) float32."""
        ...

    def add_all(self, light: np.ndarray, spans: Spans, parts: Sequence[tuple[np.ndarray, Term, Any]]) -> None:
        """Add several terms, each of its chosen samples and with its table."""
        for chosen, term, prepared in parts:
            self.add(light, chosen, spans, term, prepared)


@dataclass(frozen=True)
class Plain(Filter):
    """Bilinear interpolation at the pixel's middle (§7.1); highlights on curved surfaces break up."""

    def add(self, light: np.ndarray, chosen: np.ndarray, spans: Spans, term: Term, prepared: Any) -> None:
        self.add_all(light, spans, [(chosen, term, prepared)])

    def add_all(self, light: np.ndarray, spans: Spans, parts: Sequence[tuple[np.ndarray, Term, Any]]) -> None:
        # Samples stay in a core's own cache while all the terms of one colour, which choose the same, look them up.
        even = [part for part in parts if not len(part[1].colour)]

        def work(begin: int, end: int) -> None:
            for near in range(begin, end, _NEAR):
                for chosen, term, prepared in even:
                    plain(light, chosen[near : min(near + _NEAR, end)], spans.samples, term, prepared)

        in_threads(work, max((len(chosen) for chosen, _, _ in even), default=0), spans.threads)
        for chosen, term, prepared in parts:
            if len(term.colour):
                self._add_coloured(light, chosen, spans, term, prepared)

    def shaded(
        self, samples: Samples, material: np.ndarray, parts: Sequence[tuple[int, Term, Any]], threads: int | None
    ) -> np.ndarray:
        """The light of all samples (P, 4), of terms that each have one colour, with a material's number and a table.

        As `add_all` to zeros, but for what memory has to give.
        """
        light = np.empty((len(material), 4), np.float32)
        terms, tables = [part[1] for part in parts], [part[2] for part in parts]
        whose, kinds = np.array([part[0] for part in parts], np.int32), np.array([t.kind for t in terms])
        ratios, weights = np.array([t.ratio for t in terms], np.float32), np.stack([t.weight for t in terms])
        places = np.array([table.ctypes.data for table in tables]), np.array([len(table) - 2 for table in tables])
        inputs = light, material, samples.normal, samples.to_eye, whose, kinds, ratios, weights, *places
        in_threads(lambda begin, end: plain_at_once(*inputs, begin, end), len(material), threads)
        return light

    def _add_coloured(self, light: np.ndarray, chosen: np.ndarray, spans: Spans, term: Term, prepared: Any) -> None:
        points = spans.middles(term, 2)
        spans.add(light, chosen, term, lambda seen, here: kernels.looked_up_at(seen, here, points, prepared))


@dataclass(frozen=True)
class Subdivision(Filter):
    """Recursive subdivision of the pixel's reflected corners (§8.1), the most exact and the slowest.

    depth : halvings at most; a piece of a thousandth of a pixel is "inconsequentially small": finer ones took seven
        times as long and changed the error by a hundredth of itself
    """

    depth: int = 10

    def __post_init__(self) -> None:
        if not 0 <= self.depth <= 30:
            raise ValueError(f"depth of the subdivision is {self.depth}; expected 0 to 30")

    def add(self, light: np.ndarray, chosen: np.ndarray, spans: Spans, term: Term, prepared: Any) -> None:
        depth = self.depth
        lookup = spans.over_quads(term, lambda seen, quads, here: kernels.subdivided(seen, quads, prepared, depth))
        spans.add(light, chosen, term, lookup, chunk=1024)


@dataclass(frozen=True)
class Quadrilateral(Filter):
    """The mean over the quadrilateral that the pixel's reflected corners span (§8.2)."""

    def add(self, light: np.ndarray, chosen: np.ndarray, spans: Spans, term: Term, prepared: Any) -> None:
        lookup = spans.over_quads(term, lambda seen, quads, here: kernels.spanned(seen, quads, prepared))
        spans.add(light, chosen, term, lookup, chunk=1024)


@dataclass(frozen=True)
class Preintegrated(Filter):
    """The mean over a rectangle of the map, by differences in a table of its sums (§8.3; summed areas, Crow 1984).

    The sums are in double precision: the highest value times the number of entries must leave the lowest its digits.
    """

    def prepared(self, table: np.ndarray) -> kernels.Sums:
        rows, columns = table.shape[:2]
        areas = LatLong().solid_angles(rows)[:, :1]
        sums = np.zeros((rows + 1, columns + 1, 3))
        np.cumsum(np.cumsum(table * areas[..., None], axis=0, dtype=np.float64), axis=1, out=sums[1:, 1:])
        return kernels.Sums(sums, np.concatenate([[0.0], np.cumsum(areas)]), padded(table))

    def add(self, light: np.ndarray, chosen: np.ndarray, spans: Spans, term: Term, prepared: Any) -> None:
        points, samples = spans.corners(term, 2), spans.samples

        def lookup(seen: np.ndarray, here: np.ndarray) -> None:
            kernels.preintegrated(seen, here, samples, term.kind, term.ratio, points, prepared)

        spans.add(light, chosen, term, lookup)


@dataclass(frozen=True)
class Mip(Filter):
    """Pyramids of ever smaller tables, interpolated between two of them (Williams 1983)."""

    def prepared(self, table: np.ndarray) -> kernels.Pyramid:
        levels = [np.asarray(table, np.float64)]
        while len(levels[-1]) > 2:
            levels.append(_halved(levels[-1]))
        flat = [padded(level) for level in levels]
        begins = np.cumsum([0, *(level.size for level in flat)])[:-1]
        rows = np.array([level.shape[0] for level in levels])
        return kernels.Pyramid(np.concatenate([level.reshape(-1) for level in flat]), begins, rows)

    def add(self, light: np.ndarray, chosen: np.ndarray, spans: Spans, term: Term, prepared: Any) -> None:
        points = spans.middles(term, 2)

        def lookup(seen: np.ndarray, quads: np.ndarray, here: np.ndarray) -> None:
            kernels.from_pyramid(seen, quads, points[here], prepared)

        spans.add(light, chosen, term, spans.over_quads(term, lookup), chunk=16384)


def background(table: np.ndarray, rays: np.ndarray, threads: int | None) -> np.ndarray:
    """The light (Q, 3) float32 that a padded table holds in the directions of rays (Q, 3)."""
    views, count = np.ascontiguousarray(rays, np.float32), len(rays)
    points, seen = np.empty((count, 2), np.float32), np.empty((count, 4), np.float32)
    every = np.arange(count, dtype=np.int32)

    def work(begin: int, end: int) -> None:
        kernels.find_places(points, views, views, 2, np.float32(1), begin, end)
        kernels.looked_up_at(seen[begin:end], every[begin:end], points, table)

    in_threads(work, count, threads)
    return seen[:, :3]


def _halved(table: np.ndarray) -> np.ndarray:
    """A table of half the rows: means by solid angle of four entries, or of a few more where the size is odd."""
    rows = len(table)
    areas = LatLong().solid_angles(rows)[:, :1, None]
    sums = _pairs(_pairs((table * areas).reshape(rows, 2, rows, 3), 0), 2).reshape(rows // 2, rows // 2 * 2, 3)
    return sums / (_pairs(areas, 0) * (rows / (rows // 2)))


def _pairs(values: np.ndarray, axis: int) -> np.ndarray:
    """Sums over half as many stretches of an axis, all as long; of an odd number they take parts of every third."""
    values = np.moveaxis(values, axis, 0)
    count = len(values) // 2
    sums = values[: 2 * count : 2] + values[1::2]
    if len(values) % 2:
        before = (np.arange(count) / count).reshape(-1, *[1] * (values.ndim - 1))
        sums += (before + 1 / count) * values[2::2] - before * values[: 2 * count : 2]
    return np.moveaxis(sums, 0, axis)

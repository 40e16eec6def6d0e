"""One light from the maps of several probes: what each place of the walls shines, from all that saw it.

A probe's map says from where light comes to one place. Over a model of the place (Debevec 1998, §5.1) it says what each
place of the walls shines, and so what any other place gets. Several maps say that of the same walls, each best of what
it was near to: they are joined on the walls, and looked at from one place again. What is not on the walls, though the
model has it there, is best in the map that saw it from where it is wanted: the nearest view counts most, as in
view-dependent texture mapping (Debevec, Taylor & Malik 1996).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.errors import Doubt
from relume.image.bilinear import bilinear
from relume.image.colour import luminance
from relume.image.radiance import OUTSIDE
from relume.light.constellations.placement import PlacedLights
from relume.light.reflection.convolution import as_latlong
from relume.renderers.several_probes.disagreement import ROWS, CellSums, Disagreement
from relume.renderers.several_probes.hanging_lamps import take_hanging_lamps, with_lamps
from relume.renderers.several_probes.placed_probe import PlacedProbe, WallsOf, names_of, require_probes
from relume.scene.scene import Distant, Infinite
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong, continued_round

FINER = 2
"""Rays a pixel of the result along each side: walls that it sees smaller than a probe did are averaged."""
BAND = 16
"""Rows of the result that are made at a time."""
SAME_VIEW = np.radians(2.0)
"""Angle between two views of a place within which they count alike: a pixel of a map of 90 rows."""
UNMEASURED = 1e-6
"""Weight of what a map does not show or was saturated in: it counts where no map has better."""
BRIGHTER = 0.15
"""Stops by which a whole map may be off the first before it is said: a tenth, as lenses and exposures differ."""
NAMED = 3
"""Disagreements that notes name, at most."""
WORTH = 0.01
"""Of the light, by which maps differ about a place that notes name."""


@dataclass(frozen=True, eq=False)
class InterpolatedLight:
    """The light of several probes at one place.

    light : lat-long map, as a probe at `position` would have it; over the distant scene it lights all other places too
    position : metres, world
    lamps : those that hang before the walls, which the map shows as well
    lamps_seen : (lamps,) the share of each that the map shows, 0 to 1: the rest hides behind parts of the distant scene
    variance : of the light's radiance, from the probes' own; None unless each has one. Without the lamps' light
    shares : (probes,) of the light that each gave
    unseen_solid_angle : steradians of the walls that no probe saw, for parts of the model hide them
    disagreements : where maps differ by more than their errors, the greatest first
    notes : doubts, a line each
    """

    light: EnvironmentMap
    position: tuple[float, float, float]
    lamps: PlacedLights
    lamps_seen: np.ndarray
    variance: np.ndarray | None
    shares: np.ndarray
    unseen_solid_angle: float
    disagreements: tuple[Disagreement, ...]
    notes: tuple[Doubt, ...]


def interpolate_probes(
    probes: Sequence[PlacedProbe], at: tuple[float, float, float] | None = None, distant: Distant = Infinite()
) -> InterpolatedLight:
    """Join the maps of several probes of one place to the light that a probe at `at` would see.

    probes : one or more, in one unit and one world
    at : metres, world; the middle of the probes unless given. For a scene at infinity, where the objects stand
    distant : the shape of the place. Each point of it takes its radiance from the maps that show it, each looked up
        from its own position. A map counts by how finely it shows the point (cos θ / distance²) and how near its view
        is to that from `at`. At infinity the maps are mixed by 1 / distance² from `at`, and near light has no parallax

    Lamps that hang before the walls are found where two maps show them, and put where they are. Raises ValueError for
    no probes, maps of different units, two at one place, places outside of the distant scene, and an open mesh.
    Source: Debevec 1998, §5.1 and Fig. 5; Debevec, Taylor & Malik 1996 (view-dependent texture mapping).
    """
    middle = np.mean([probe.position for probe in probes], axis=0) if at is None and len(probes) else at
    wanted = (0.0, 0.0, 0.0) if middle is None else (float(middle[0]), float(middle[1]), float(middle[2]))
    require_probes(probes, wanted, distant)
    # The lamps before the walls, and the maps without them.
    straight = [replace(probe, light=as_latlong(probe.light)) for probe in probes]
    if any(probe.light.mapping != LatLong() for probe in probes):
        straight = [replace(probe, variance=None) for probe in straight]
    freed = take_hanging_lamps(straight, distant)
    # The walls, band by band.
    size = max(probe.light.size for probe in freed.probes)
    sums = CellSums(len(probes), np.pi / min(probe.light.size for probe in freed.probes))
    maps = [_Looked.of(probe) for probe in freed.probes]
    walls = None if isinstance(distant, Infinite) else WallsOf.of(distant)
    bands = [
        _band(maps, np.array(wanted), walls, size, slice(top, min(top + BAND, size)), sums)
        for top in range(0, size, BAND)
    ]
    radiance, variance, codes = (np.concatenate(each) for each in zip(*(band[:3] for band in bands), strict=True))
    given, unseen = np.sum([band[3] for band in bands], axis=0), float(sum(band[4] for band in bands))
    first = freed.probes[0].light
    clipped = None if all(probe.light.clipped is None for probe in freed.probes) else codes
    own = len(probes) == 1 and wanted == tuple(probes[0].position)
    rest = (
        first
        if own
        else EnvironmentMap(radiance.astype(np.float32), LatLong(), first.unit, clipped, dict(first.attributes))
    )
    light, lamps_seen = with_lamps(rest, freed.lamps, np.array(wanted), distant)
    # What the maps do not agree about.
    total = float(luminance(light.total()))
    differing = tuple(_on_wall(each, wanted, walls) for each in sums.differing(total))
    names = names_of(probes)
    known = None if any(probe.variance is None for probe in freed.probes) else variance.astype(np.float32)
    notes = _notes_of_lamps(freed.lamps, freed.uncertainty, lamps_seen, walls is not None)
    if walls is not None:
        notes += _notes_of_walls(sums.gains(), differing, unseen, names)
    elif len(probes) > 1:
        notes += (_without_parallax(differing, names),)
    return InterpolatedLight(
        light, wanted, freed.lamps, lamps_seen, known, given / max(float(given.sum()), 1e-30), unseen, differing, notes
    )


@dataclass(frozen=True, eq=False)
class _Looked:
    """A map ready to be looked up."""

    position: np.ndarray
    radiance: np.ndarray
    variance: np.ndarray | None
    clipped: np.ndarray | None

    @staticmethod
    def of(probe: PlacedProbe) -> _Looked:
        variance = None if probe.variance is None else continued_round(np.asarray(probe.variance, np.float32))
        return _Looked(
            np.array(probe.position), continued_round(probe.light.radiance), variance, probe.light.clipped
        )  # fmt: skip

    def at(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray | None, np.ndarray]:
        """Radiance (N, 3), its variance, and codes (N,) of what was clipped."""
        rows, columns = self.radiance.shape[0] - 2, self.radiance.shape[1] - 2
        points = LatLong().image_points(directions) * [columns, rows]
        x, y = points[:, 0], points[:, 1]
        codes = np.zeros(len(directions), np.uint8)
        if self.clipped is not None:
            codes = self.clipped[y.astype(int).clip(0, rows - 1), x.astype(int).clip(0, columns - 1)]
        variance = None if self.variance is None else np.asarray(bilinear(self.variance, x + 1, y + 1))
        return np.asarray(bilinear(self.radiance, x + 1, y + 1)), variance, codes


def _band(
    maps: Sequence[_Looked], at: np.ndarray, walls: WallsOf | None, size: int, rows: slice, sums: CellSums
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Some rows of the joined map: radiance, variance, codes, the luminance of each map in it, and what none saw."""
    fine, count = size * FINER, rows.stop - rows.start
    down = (np.arange(rows.start * FINER, rows.stop * FINER) + 0.5) / fine
    across = (np.arange(2 * fine) + 0.5) / (2 * fine)
    u, v = (each.ravel() for each in np.broadcast_arrays(across[None, :], down[:, None]))
    directions = LatLong().directions(np.stack([u, v], axis=-1))
    areas = (np.pi / fine) ** 2 * np.sin(np.pi * v)
    row, column = (v * ROWS).astype(int), (u * 2 * ROWS).astype(int)
    cells = np.minimum(row, ROWS - 1) * 2 * ROWS + np.minimum(column, 2 * ROWS - 1)
    sums.add_places(cells, areas, directions)
    ends = normals = None
    if walls is not None:
        reach, normals = walls.met(at, directions)
        ends = at + reach[:, None] * directions
    # Each map's radiance and its weight at these places.
    shown, weights, seen = [], [], []
    for index, each in enumerate(maps):
        ways, weight, sees = directions, np.full(len(directions), _by_distance(at, each.position)), None
        if walls is not None and ends is not None and normals is not None:
            ways, weight, sees = _of_walls(each.position, at, directions, ends, normals, walls)
        radiance, variance, codes = each.at(ways)
        visible = np.ones(len(ways), bool) if sees is None else sees
        measured = visible & (codes == 0)
        sums.add(index, cells, areas, radiance, variance, measured)
        shown.append((radiance, variance, codes))
        weights.append(weight * np.where(measured, 1.0, np.where(codes == OUTSIDE, UNMEASURED**2, UNMEASURED)))
        seen.append(visible)
    share = np.stack(weights)
    share /= share.sum(axis=0)
    # Pixels are the means of their rays.
    picture = (count, FINER, 2 * size, FINER)
    mixed = sum(part[:, None] * each[0] for part, each in zip(share, shown, strict=True))
    spread = sum(
        part[:, None] ** 2 * (0.0 if each[1] is None else each[1]) for part, each in zip(share, shown, strict=True)
    ) + np.zeros_like(mixed)
    best = np.argmax(share, axis=0)
    codes = np.choose(best, [each[2] for each in shown]).reshape(picture).max((1, 3)).astype(np.uint8)
    given = np.array(
        [float((luminance(part[:, None] * each[0]) * areas).sum()) for part, each in zip(share, shown, strict=True)]
    )
    unseen = float(areas[~np.any(seen, axis=0)].sum())
    means = (np.asarray(each).reshape(*picture, 3).mean((1, 3)) for each in (mixed, spread))
    return next(means), next(means), codes, given, unseen


def _by_distance(at: np.ndarray, position: np.ndarray) -> float:
    """1 / distance², so that a place between two probes takes from both, and a probe's own place from it alone."""
    return 1 / max(float(((at - position) ** 2).sum()), 1e-12)


def _of_walls(
    position: np.ndarray, at: np.ndarray, directions: np.ndarray, ends: np.ndarray, normals: np.ndarray, walls: WallsOf
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions from a probe to places of the walls, how much it counts there, and whether it sees them."""
    ways = ends - position
    distance = np.linalg.norm(ways, axis=-1)
    ways /= distance[:, None]
    # How many of its pixels a piece of wall has; never none, for the corner of a box faces no way.
    fineness = np.maximum(np.abs((ways * normals).sum(-1)), 0.02) / distance**2
    angle = np.arccos(np.clip((ways * directions).sum(-1), -1, 1))
    weight = fineness / (SAME_VIEW**2 + angle**2)
    sees = walls.shown_to(position, ways, distance)
    return ways, weight * np.where(sees, 1.0, UNMEASURED), sees


def _on_wall(each: Disagreement, at: tuple[float, float, float], walls: WallsOf | None) -> Disagreement:
    if walls is None:
        return each
    way = np.array(each.direction)
    x, y, z = (float(v) for v in np.array(at) + walls.met(np.array(at), way[None])[0][0] * way)
    return replace(each, place=(x, y, z))


def _without_parallax(differing: Sequence[Disagreement], names: Sequence[str]) -> Doubt:
    line = (
        "the light of several probes is mixed by their distance from where it is wanted: without the shape of the "
        "place near light has no parallax; give light.distant"
    )
    if not differing:
        return Doubt(line, 0.02)
    worst = differing[0]
    first, second = (names[number] for number in worst.probes)
    towards = [round(v, 2) for v in worst.direction]
    line += f" ({first} and {second} differ most towards {towards}, {worst.times})"
    return Doubt(line, sum(each.share for each in differing))


def _notes_of_lamps(lamps: PlacedLights, spread: np.ndarray, seen: np.ndarray, walls: bool) -> tuple[Doubt, ...]:
    done = "it is put there" if walls else "the map shows it where it is seen from the place that is lit"
    lines = []
    for place, error, share in zip(lamps.positions, spread, seen, strict=True):
        where = [round(float(v), 3) for v in place]
        line = f"a lamp hangs at {where} ± {error:.2g} m, before what is behind it, by the maps of several probes"
        line += f"; {done}"
        if share < 1:
            line += f"; the joined map shows {share:.0%} of it, the distant scene hides the rest"
        lines.append(line)
    return tuple(Doubt(line, 0.0) for line in lines)


def _notes_of_walls(
    gains: np.ndarray, differing: Sequence[Disagreement], unseen: float, names: Sequence[str]
) -> tuple[Doubt, ...]:
    notes = []
    for name, gain in zip(names, gains, strict=True):
        if abs(np.log2(max(gain, 1e-30))) > BRIGHTER:
            line = (
                f"{name} is {gain:.2f} times as bright as {names[0]} where both show one place; are their exposures "
                "on one scale?"
            )
            notes.append(Doubt(line, abs(float(gain) - 1)))
    notes += [Doubt(each.line(names), each.share) for each in differing[:NAMED] if each.share > WORTH]
    if unseen > 0.01:
        line = f"{unseen:.2g} sr of the place are hidden from every probe: their light is continued from beside them"
        notes.append(Doubt(line, unseen / (4 * np.pi)))
    return tuple(notes)

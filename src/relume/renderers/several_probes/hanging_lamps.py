"""Lamps that hang before the walls: what several probes see, in different directions, of one thing.

Projected onto a wall, a lamp that hangs before it lands in another place for each probe. From two probes its place
follows, so it is taken out of their maps before these are joined, and put back where the joined map sees it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from relume.errors import LampsNotMatched, SunNotFound
from relume.light.constellations.local_lamps import free_lamp
from relume.light.constellations.placement import PlacedLights
from relume.light.constellations.triangulation import triangulated
from relume.light.reflection.convolution import as_latlong
from relume.light.suns.extraction import extract_sun
from relume.renderers.several_probes.placed_probe import PlacedProbe, WallsOf
from relume.scene.scene import Box, Distant, Dome, Enclosure
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import pixel_directions

MOST = 8
"""Lamps that are looked for in a map: a room has fewer."""
SURELY = 3.0
"""Standard deviations of its place by which a lamp hangs before the wall; of lamps on the wall three in a thousand."""
CLEAR = 0.05
"""Of the way to the wall that a lamp hangs before it, at least: what is nearer differs from one on it by 10 % of its
light, and a lamp with a depth of its own, like a window's frame, is no hanging one."""


@dataclass(frozen=True, eq=False)
class HangingLamps:
    """Lamps apart from the light behind them.

    probes : the maps without them
    lamps : where they hang, how strong and how large they are
    uncertainty : (N,) metres, the standard deviation of each place
    """

    probes: tuple[PlacedProbe, ...]
    lamps: PlacedLights
    uncertainty: np.ndarray


def take_hanging_lamps(probes: Sequence[PlacedProbe], distant: Distant) -> HangingLamps:
    """Take the lamps that hang before the walls out of all maps; none of a single probe, which shows no depth.

    Maps of places from which a part of the distant scene hides a lamp are left as they are.
    """
    walls = _walls(distant)
    places, spread = _places(probes, walls)
    lamps, errors = [], []
    for place, error in zip(places, spread, strict=True):
        seeing = [index for index, probe in enumerate(probes) if _sees(walls, np.array(probe.position), place)]
        try:
            freed = {index: free_lamp(probes[index].light, place, probes[index].position) for index in seeing}
        except ValueError:
            continue  # a map does not show it, as where something hides it that the distant scene has not
        probes = [
            replace(probe, light=freed[index].rest) if index in freed else probe for index, probe in enumerate(probes)
        ]
        radii = [float(each.lamp.radii[0]) for each in freed.values() if each.lamp.radii is not None]
        intensity = np.mean([each.lamp.intensity[0] for each in freed.values()], axis=0)
        lamps.append((place, intensity, float(np.mean(radii))))
        errors.append(error)
    placed = PlacedLights(
        np.array([each[0] for each in lamps]).reshape(-1, 3),
        np.array([each[1] for each in lamps]).reshape(-1, 3),
        np.array([each[2] for each in lamps]),
    )
    return HangingLamps(tuple(probes), placed, np.array(errors))


def with_lamps(
    light: EnvironmentMap, lamps: PlacedLights, at: np.ndarray, distant: Distant
) -> tuple[EnvironmentMap, np.ndarray]:
    """A lat-long map with the lamps as a place sees them, and the share (N,) of each that it sees, 0 to 1.

    distant : what hides a lamp, or a part of it; each has all of its light where nothing does
    Raises ValueError for a place within a lamp.
    """
    shares = np.ones(len(lamps.positions))
    if not len(shares):
        return light, shares
    seen, walls = lamps.seen_from(at), _walls(distant)
    directions, areas = pixel_directions(light.mapping, light.size), light.mapping.solid_angles(light.size)
    radiance, pixel = light.radiance.astype(np.float64), np.pi / light.size
    assert seen.angular_radii is not None  # spheres
    for index, (towards, irradiance, radius) in enumerate(
        zip(seen.directions, seen.irradiance, seen.angular_radii, strict=True)
    ):
        angle = np.arccos(np.clip(directions @ towards, -1, 1))
        # Its rim falls over a pixel, and it is a pixel wide at least.
        cover = np.clip((max(float(radius), pixel) - angle) / pixel + 0.5, 0, 1)
        whole = (cover * areas).sum()
        if walls is not None:
            on_it = np.nonzero(cover)
            distance = float(np.linalg.norm(lamps.positions[index] - at))
            cover[on_it] *= walls.shown_to(at, directions[on_it], np.full(len(on_it[0]), distance))
        shares[index] = (cover * areas).sum() / whole
        radiance += cover[..., None] * irradiance / whole
    return replace(light, radiance=radiance.astype(np.float32)), shares


def _walls(distant: Distant) -> WallsOf | None:
    return WallsOf.of(distant) if isinstance(distant, Box | Dome | Enclosure) else None


def _sees(walls: WallsOf | None, eye: np.ndarray, place: np.ndarray) -> bool:
    """Whether nothing of the walls lies between."""
    way = place - eye
    distance = float(np.linalg.norm(way))
    return walls is None or bool(walls.shown_to(eye, way[None] / distance, np.array([distance]))[0])


def _places(probes: Sequence[PlacedProbe], walls: WallsOf | None) -> tuple[list[np.ndarray], list[float]]:
    """Of lamps that two probes see before the walls, each once: their places (3,) and standard deviations, metres."""
    compact = []
    for probe in probes:
        try:
            compact.append(extract_sun(as_latlong(probe.light), MOST).lights())
        except SunNotFound:
            compact.append(None)
    found: list[np.ndarray] = []
    spread: list[float] = []
    for i, j in combinations(range(len(probes)), 2):
        first, second = compact[i], compact[j]
        if first is None or second is None:
            continue
        pixel = np.pi / min(probes[i].light.size, probes[j].light.size)
        try:
            met = triangulated(
                first, second, probes[i].position, probes[j].position, uncertainty=max(pixel / 2, np.radians(0.2))
            )
        except LampsNotMatched:
            continue
        for place, error in zip(met.points.positions, met.uncertainty, strict=True):
            known = any(np.linalg.norm(place - other) < SURELY * error + 0.05 for other in found)
            if not known and all(_hangs(walls, np.array(probes[k].position), place, error) for k in (i, j)):
                found.append(place)
                spread.append(float(error))
    return found, spread


def _hangs(walls: WallsOf | None, eye: np.ndarray, place: np.ndarray, error: float) -> bool:
    """Whether a place lies before the wall behind it; before infinity all do that have one."""
    if walls is None:
        return True
    way = place - eye
    length = float(np.linalg.norm(way))
    reach = float(walls.met(eye, way[None] / length)[0][0])
    return reach - length > max(SURELY * error, CLEAR * reach)

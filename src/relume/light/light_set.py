"""The lights that stand for an environment map: its suns, the other lights, a residual map, and their places.

`make_lights` is what `relume lights` does; `relume.export.light_files` writes its result for other programs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import tee

import numpy as np

from relume.errors import RelumeError, SunNotFound, UnreadableFile
from relume.image.radiance import SATURATED
from relume.light.constellations.constellation import Constellation, constellation, irradiance_error, together
from relume.light.constellations.k_means import Regions
from relume.light.constellations.moving import moving_constellation
from relume.light.constellations.placement import PlacedLights, chosen, placed_in_box
from relume.light.constellations.rectangles import MedianCut
from relume.light.constellations.residual import key_lights
from relume.light.constellations.triangulation import triangulated
from relume.light.light_sequence import LightSequence
from relume.light.suns.extraction import Sun, extract_sun
from relume.sphere.audit import six_digits
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.map_store import name_of_map
from relume.sphere.mappings.mapping import LatLong

COUNT, MOST = 64, 65536
CONTRAST = 4.0
FINEST = np.radians(0.5)
"""The least error that a lamp's direction is assumed to have, which is how well balls are registered."""
Place = tuple[float, float, float]


@dataclass(frozen=True)
class Room:
    """A room whose walls the lights stand on.

    probe : (3,), metres, world, where the map was taken
    low, high : the room's lowest and highest corner, metres
    distant : the numbers of lights that stay distant, like a sun through a window; the strongest is 0
    """

    probe: Place
    low: Place
    high: Place
    distant: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        placed_in_box(Constellation(np.zeros((0, 3)), np.zeros((0, 3))), self.probe, (self.low, self.high))


@dataclass(frozen=True, eq=False)
class SecondProbe:
    """A second map of the same place, by which compact lamps are triangulated.

    light : the second map, in the first one's unit
    probe, at : (3,), metres, world, where the first and the second map were taken
    name : of the second map, for messages
    """

    light: EnvironmentMap
    probe: Place
    at: Place
    name: str = "the second map"

    def __post_init__(self) -> None:
        if self.probe == self.at:
            raise ValueError(f"both maps were taken at {self.at}; lamps are located by two probes that stood apart")


@dataclass(frozen=True, eq=False)
class LightSettings:
    """How lights are made of a map.

    count : lights in all, at most; 64 unless given, or with `suns` and a residual the suns alone
    method : how the sphere is divided
    suns : compact lamps that are taken out first; None for none
    residual : keep what is not bright in a lat-long map
    contrast : the residual is nowhere brighter than so many times its own mean; 4 unless given
    soft : give every light, not only suns, the apparent diameter of the light it stands for
    room : put the lights on the walls of a room
    second : put the suns where two maps see them
    """

    count: int | None = None
    method: Regions = MedianCut()
    suns: int | None = None
    residual: bool = False
    contrast: float | None = None
    soft: bool = False
    room: Room | None = None
    second: SecondProbe | None = None

    def __post_init__(self) -> None:
        if self.count is not None and not 1 <= self.count <= MOST:
            raise ValueError(f"count is {self.count}; give 1 to {MOST}, like {COUNT}")
        if self.suns is not None and self.suns < 1:
            raise ValueError(f"suns are {self.suns}; give 1 or more, or leave it out")
        if self.suns is not None and self.count is not None and self.count < self.suns + (not self.residual):
            raise ValueError(
                f"a count of {self.count} with {self.suns} suns leaves no light for the rest; give a greater count, or "
                "keep the rest as a residual map"
            )
        if self.contrast is not None and not (self.residual and self.contrast >= 0):
            raise ValueError(f"contrast is {self.contrast}; it is 0 or more, like 4, and needs a residual map")
        if self.room is not None and self.second is not None:
            raise ValueError("lights are placed by a room or by a second map; give one of them")
        if self.second is not None and self.suns is None:
            raise ValueError("a second map locates compact lamps; say how many to look for, like 4 suns")


@dataclass(frozen=True, eq=False)
class LightSet:
    """The lights of a map, ready for `write_lights`.

    light : the map they stand for; lat-long where there is a residual
    lights : all of them as the map shows them, suns first
    distant : those of them without a place
    angles : apparent diameters of `distant`, radians; None where all are parallel
    points : those with a place; None where no places were asked for
    probe : (3,), metres, where the map was taken, for lights with places
    residual : the light that the lights do not carry; None where they carry all
    suns : the compact lamps
    details : of the placement, for a person
    notes : what the user should know
    doubts : what makes the result doubtful: clipped light
    """

    light: EnvironmentMap
    lights: Constellation
    distant: Constellation
    angles: np.ndarray | None = None
    points: PlacedLights | None = None
    probe: Place = (0.0, 0.0, 0.0)
    residual: EnvironmentMap | None = None
    suns: tuple[Sun, ...] = ()
    details: dict[str, object] | None = None
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()

    def at_probe(self) -> Constellation:
        """All lights as they arrive at the probe, from their places where they have one."""
        if self.points is None:
            return self.lights
        return together(self.points.seen_from(self.probe), self.distant)

    def facts(self) -> dict[str, object]:
        """Number, totals, error of irradiance, places and suns, for a person or a machine."""
        lights = self.at_probe()
        mean, worst = irradiance_error(self.light, lights, self.residual)
        facts: dict[str, object] = {
            "total of the map": six_digits(self.light.total()),
            "total of the lights": six_digits(lights.total()),
        }
        if self.residual is not None:
            facts["total of the residual"] = six_digits(self.residual.total())
        facts["irradiance error, of the mean"] = {"mean": float(f"{mean:.3g}"), "largest": float(f"{worst:.3g}")}
        facts |= self.details or {}
        if self.suns:
            facts["suns"] = [_sun_facts(each) for each in self.suns]
        return facts


def make_lights(light: EnvironmentMap, settings: LightSettings = LightSettings(), name: str = "the map") -> LightSet:
    """The lights that stand for an environment map; together with the residual they carry all of its light.

    light : in any mapping
    settings : how many lamps, suns and files; a light constellation unless given
    name : of the map, for messages

    Raises UnreadableFile for a black map, SunNotFound where no sun stands out, ValueError for numbers of lights there
    are not, and another unit of the second map.
    Sources: Debevec 2005; Viriyothai & Debevec 2009; Debevec, *Fiat Lux* (SIGGRAPH 99).
    """
    # Refuse what cannot be divided.
    notes: list[str] = []
    if not light.radiance.any():
        raise UnreadableFile(f"{name}: black all over; there is no light to make lights of")
    second = settings.second
    if second is not None and second.light.unit != light.unit:
        raise ValueError(
            f"{second.name}: its unit is {second.light.unit} and the first map's {light.unit}; intensities are "
            "compared, so calibrate both or neither"
        )
    doubts, photographed = [], light

    # Suns, other lights and residual.
    if settings.residual and not isinstance(light.mapping, LatLong):
        notes.append(f"{name}: a {light.mapping.name} map, resampled to lat-long, which the residual has to be")
        light = light.remapped(LatLong())
    try:
        suns, residual, lights = _divide(light, settings)
    except SunNotFound as error:
        raise SunNotFound(f"{name}: {error}") from None
    if settings.suns is not None and len(suns) < settings.suns:
        notes.append(
            f"{settings.suns} suns were asked for and {len(suns)} stand out; the light of others stays with the rest"
        )
    notes += [
        f"{name}: the sun is of one value all over; if it is photographed it clipped there"
        for sun in suns
        if sun.flat and not sun.clipped
    ]
    doubts += _clipped(name, photographed, suns)
    angles = _apparent_diameters(lights, len(suns), settings.soft)
    made = LightSet(light, lights, lights, angles, residual=residual, suns=suns)

    # Places.
    if settings.room is not None:
        made = _on_walls(made, settings.room)
    elif second is not None:
        made, seen, alone = _triangulate(made, second, settings.suns or 1)
        notes += alone
        doubts += _clipped(second.name, second.light, seen)
    return replace(made, notes=tuple(notes), doubts=tuple(doubts))


def follow_lights(sequence: LightSequence, settings: LightSettings = LightSettings()) -> Iterator[LightSet]:
    """The lights of each map of a sequence, one `LightSet` a map: the same lights in all, which move without popping.

    settings : `count`, `soft`, and `method`, by which the first map is divided before k-means settles

    A light's number is the same in all. Each map's lights carry all of its light. Source: Lloyd 1982.
    Raises ValueError for settings of a single map: suns, a residual, places; UnreadableFile for a first map that is
    black, and for what is none.
    """
    if settings.suns is not None or settings.residual or settings.room is not None or settings.second is not None:
        raise ValueError("suns, a residual and places are of a single map; leave them out for a folder of maps")
    first = sequence.at(0)
    if not first.radiance.any():
        raise UnreadableFile(f"{sequence.paths[0]}: black all over; begin with a map that shows light")
    times = [number / sequence.rate for number in range(len(sequence.paths))]
    maps, kept = tee(map(sequence.at, times))
    moving = moving_constellation(maps, settings.count or COUNT, settings.method)
    for path, light, lights in zip(sequence.paths, kept, moving, strict=True):
        doubts = tuple(_clipped(name_of_map(path), light, ()))
        yield LightSet(light, lights, lights, _apparent_diameters(lights, 0, settings.soft), doubts=doubts)


def _divide(
    light: EnvironmentMap, settings: LightSettings
) -> tuple[tuple[Sun, ...], EnvironmentMap | None, Constellation]:
    """The suns, the residual where one is kept, and all the lights, the suns first."""
    count, method = settings.count or COUNT, settings.method
    contrast = CONTRAST if settings.contrast is None else settings.contrast
    if settings.suns is None:
        if not settings.residual:
            return (), None, constellation(light, count, method)
        key = key_lights(light, count, contrast, method)
        return (), key.residual, key.lights
    taken = extract_sun(light, settings.suns)
    others = count - len(taken.suns)
    if settings.residual and (others < 1 or (settings.count is None and settings.contrast is None)):
        return taken.suns, taken.rest, taken.lights()
    if not settings.residual:
        return taken.suns, None, together(taken.lights(), constellation(taken.rest, others, method))
    key = key_lights(taken.rest, others, contrast, method)
    return taken.suns, key.residual, together(taken.lights(), key.lights)


def _apparent_diameters(lights: Constellation, suns: int, soft: bool) -> np.ndarray | None:
    """Radians (N,): the suns', and with `soft` those of all; None where all light is parallel."""
    if lights.angular_radii is None or not (suns or soft):
        return None
    angles = np.minimum(2 * lights.angular_radii, np.pi)
    return angles if soft else np.where(np.arange(len(angles)) < suns, angles, 0)


def _clipped(name: str, light: EnvironmentMap, suns: tuple[Sun, ...]) -> list[str]:
    """What a map's clipped pixels make doubtful: a line, or none."""
    number = 0 if light.clipped is None else int(np.count_nonzero(light.clipped == SATURATED))
    if not number:
        return []
    effect = (
        "the sun is clipped, its light a lower bound" if any(sun.clipped for sun in suns) else "lights there are weaker"
    )
    return [
        f"{name}: {number} pixels are clipped, so {effect}; photograph them in shorter exposures, or recover the sun "
        "with `relume sun`"
    ]


def _on_walls(made: LightSet, room: Room) -> LightSet:
    """Every light on the walls of the room, but for those that stay distant."""
    shown = replace(made.lights, angular_radii=None if made.angles is None else made.angles / 2)
    placed = placed_in_box(shown, room.probe, (room.low, room.high), room.distant)
    kept = np.unique(np.array(room.distant, np.int64))
    return replace(
        made,
        probe=room.probe,
        distant=placed.distant,
        angles=None if made.angles is None else made.angles[kept],
        points=placed.points,
        details={"placed": len(placed.points.positions)},
    )


def _triangulate(made: LightSet, second: SecondProbe, suns: int) -> tuple[LightSet, tuple[Sun, ...], list[str]]:
    """The suns where the rays of both maps meet; the second map's suns; a note on lamps that one map alone sees."""
    try:
        taken = extract_sun(second.light, suns)
    except SunNotFound as error:
        raise SunNotFound(f"{second.name}: {error}") from None
    # Radians, the side of a pixel of mean solid angle, were all the sphere shown.
    shown = (np.count_nonzero(each.mapping.solid_angles(each.size)) for each in (made.light, second.light))
    pixel = float(np.sqrt(4 * np.pi / min(shown)))
    own = chosen(made.lights, np.arange(len(made.suns)))
    try:
        found = triangulated(own, taken.lights(), second.probe, second.at, uncertainty=max(float(FINEST), pixel))
    except RelumeError as error:
        raise type(error)(f"{second.name}: {error}") from None
    first_alone, second_alone = (len(numbers) for numbers in found.unmatched)
    notes = []
    if first_alone or second_alone:
        notes.append(
            f"{second.name}: {first_alone} lamps of the first map and {second_alone} of the second have no partner; "
            "the first's stay distant, the second's are left out"
        )
    kept = np.setdiff1d(np.arange(len(made.lights.directions)), found.pairs[:, 0])
    lamps = zip(found.points.positions, found.points.intensity, found.uncertainty, found.misses, strict=True)
    distant = chosen(made.lights, kept)
    placed = replace(
        made,
        probe=second.probe,
        distant=distant,
        angles=None if made.angles is None else made.angles[kept],
        points=found.points,
        details={
            "placed": len(found.pairs),
            "far": len(found.far),
            "unmatched": {"first": first_alone, "second": second_alone},
            "lamps": [
                {
                    "position": [float(f"{part:.4g}") for part in place],
                    "intensity": six_digits(intensity),
                    "uncertain by": float(f"{uncertain:.2g}"),
                    "rays miss by": float(f"{miss:.2g}"),
                }
                for place, intensity, uncertain, miss in lamps
            ],
        },
    )
    return placed, taken.suns, notes


def _sun_facts(sun: Sun) -> dict[str, object]:
    x, y, z = sun.direction
    return {
        "direction": six_digits(sun.direction),
        "height": float(f"{np.degrees(np.arcsin(np.clip(y, -1, 1))):.4g}"),
        "to the right": float(f"{np.degrees(np.arctan2(x, -z)):.4g}"),
        "irradiance": six_digits(sun.irradiance),
        "diameter": float(f"{np.degrees(2 * sun.angular_radius):.3g}"),
        "share": float(f"{sun.share:.3g}"),
        "clipped": sun.clipped,
    }

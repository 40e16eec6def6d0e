"""Places on the command line: lights put on the walls of a room, or lamps found by a second probe."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter

import relume as rl
from relume.cli.arguments import read_point, require_files
from relume.errors import RelumeError

if TYPE_CHECKING:
    import numpy as np

    from relume.light.constellations.constellation import Constellation
    from relume.light.constellations.placement import PlacedLights
    from relume.light.suns.extraction import Sun
    from relume.sphere.environment_map import EnvironmentMap
    from relume.sphere.mappings.mapping import Mapping

PLACES = Group("Lights that have a place")
FINEST = 0.5
"""Degrees: the least that a lamp's direction is taken to err by, which is how well balls are registered."""


@Parameter(name="*")
@dataclass(frozen=True)
class Places:
    """Where the probe stood, and what tells the distances of its lights; all in metres, +Y up."""

    at: Annotated[
        str | None,
        Parameter(group=PLACES, allow_leading_hyphen=True, help="Where the map was taken: X,Y,Z in metres, +Y up."),
    ] = None
    box: Annotated[
        str | None,
        Parameter(
            group=PLACES,
            allow_leading_hyphen=True,
            help="The room that --at is in, from its lowest corner to its highest, X,Y,Z,X,Y,Z: the lights stand where "
            "their rays meet its walls.",
        ),
    ] = None
    distant: Annotated[
        list[int] | None,
        Parameter(
            group=PLACES,
            negative="",
            help="With --box: the number of a light that stays distant, like the sun through a window; the strongest, "
            "and with --sun the strongest sun, is 0. May repeat.",
        ),
    ] = None
    second: Annotated[
        Path | None,
        Parameter(
            group=PLACES,
            help="A map taken at another place: the --sun lamps that both see stand where their rays meet; the far and "
            "those seen by one alone, stay distant.",
        ),
    ] = None
    second_at: Annotated[
        str | None, Parameter(group=PLACES, allow_leading_hyphen=True, help="Where the second was taken: X,Y,Z.")
    ] = None

    def check(self, suns: int | None) -> None:
        """Refuse what cannot be, before any work; `suns` as --sun asked for them."""
        told = {"--box": self.box, "--second": self.second, "--second-at": self.second_at, "--distant": self.distant}
        if self.at is None:
            for option, value in told.items():
                if value is not None:
                    raise ValueError(f"{option} is for lights that have a place; say where the map was taken with --at")
            return
        at = read_point(self.at, "--at")
        if (self.box is None) == (self.second is None):
            raise ValueError("--at places lights by a room's --box or by a --second map; give one of them")
        if self.box is not None:
            _refuse_outside(at, self.box)
        if (self.second is None) != (self.second_at is None):
            raise ValueError("--second and --second-at belong together: a map, and where it was taken")
        if self.second is None or self.second_at is None:
            return
        if self.distant is not None:
            raise ValueError("--distant is for --box; with --second what is far stays distant by itself")
        if suns is None:
            raise ValueError("--second matches compact lamps; say how many to look for, like --sun 4")
        if read_point(self.second_at, "--second-at") == at:
            raise ValueError("--at and --second-at are one place; lamps are found by two probes that stood apart")
        require_files([self.second])


@dataclass(frozen=True, eq=False)
class Located:
    """A constellation's lights, some of which have got places.

    points : those
    distant : the others
    angles : apparent diameters of the others in radians; None where all are parallel
    facts : to be told
    suns : compact lamps of the second map
    """

    points: PlacedLights
    distant: Constellation
    angles: np.ndarray | None
    facts: dict[str, object]
    suns: tuple[Sun, ...] = ()

    def seen(self, places: Places) -> Constellation:
        """All the lights as the probe sees them."""
        from relume.light.constellations.constellation import together

        return together(self.points.seen_from(read_point(places.at or "", "--at")), self.distant)


def on_walls(places: Places, made: Constellation, angles: np.ndarray | None) -> Located:
    """Every light on the walls of the room but for those told to stay distant; as wide as their `angles`, (N,)."""
    import numpy as np

    from relume.light.constellations.placement import placed_in_box

    distant = places.distant or []
    shown = replace(made, angular_radii=None if angles is None else angles / 2)
    try:
        placed = placed_in_box(shown, read_point(places.at or "", "--at"), _corners(places.box or ""), distant)
    except ValueError as error:
        raise ValueError(f"--distant: {error}") from None
    kept = np.unique(np.array(distant, np.int64))
    facts: dict[str, object] = {"placed": len(placed.points.positions)}
    return Located(placed.points, placed.distant, None if angles is None else angles[kept], facts)


def read_second(places: Places, first: EnvironmentMap, mapping: Mapping | None, clamp: bool) -> EnvironmentMap | None:
    """The second map, to be compared with the first; None where none is told."""
    if places.second is None:
        return None
    light = rl.read_environment(places.second, mapping, clamp=clamp)
    if light.unit != first.unit:
        raise ValueError(
            f"--second {places.second}: its unit is {light.unit} and the first map's {first.unit}; intensities are "
            "compared, so calibrate both or neither"
        )
    return light


def by_second(
    places: Places,
    maps: tuple[EnvironmentMap, EnvironmentMap],
    made: Constellation,
    angles: np.ndarray | None,
    count: int,
    asked: int,
) -> Located:
    """The lamps where the rays of both maps meet.

    count : how many of the lights are lamps of the first map, the first of them
    asked : how many to look for in the second
    """
    import numpy as np

    from relume.errors import SunNotFound
    from relume.light.constellations.placement import chosen
    from relume.light.constellations.triangulation import triangulated
    from relume.light.suns.extraction import extract_sun

    try:
        taken = extract_sun(maps[1], asked)
    except SunNotFound as error:
        raise SunNotFound(f"{places.second}: {error}") from None
    pixel = max(float(np.sqrt(4 * np.pi / np.count_nonzero(_areas(light)))) for light in maps)
    try:
        found = triangulated(
            chosen(made, np.arange(count)),
            taken.lights(),
            read_point(places.at or "", "--at"),
            read_point(places.second_at or "", "--second-at"),
            uncertainty=max(float(np.radians(FINEST)), pixel),
        )
    except RelumeError as error:
        raise type(error)(f"--second {places.second}: {error}") from None
    alone = [len(numbers) for numbers in found.unmatched]
    if any(alone):
        warnings.warn(
            f"--second {places.second}: {alone[0]} lamps of the first map and {alone[1]} of the second have no "
            "partner; the first's stay distant, the second's are left out",
            stacklevel=2,
        )
    kept = np.setdiff1d(np.arange(len(made.directions)), found.pairs[:, 0])
    facts: dict[str, object] = {
        "placed": len(found.pairs),
        "far": len(found.far),
        "unmatched": {"first": len(found.unmatched[0]), "second": len(found.unmatched[1])},
        "lamps": [
            {
                "position": [float(f"{part:.4g}") for part in place],
                "intensity": [float(f"{part:.6g}") for part in intensity],
                "uncertain by": float(f"{uncertain:.2g}"),
                "rays miss by": float(f"{miss:.2g}"),
            }
            for place, intensity, uncertain, miss in zip(
                found.points.positions, found.points.intensity, found.uncertainty, found.misses, strict=True
            )
        ],
    }
    apparent = None if angles is None else angles[kept]
    return Located(found.points, chosen(made, kept), apparent, facts, taken.suns)


def _areas(light: EnvironmentMap) -> np.ndarray:
    return light.mapping.solid_angles(light.size)


def _refuse_outside(at: tuple[float, float, float], box: str) -> None:
    import numpy as np

    from relume.light.constellations.constellation import Constellation
    from relume.light.constellations.placement import placed_in_box

    try:
        placed_in_box(Constellation(np.zeros((0, 3)), np.zeros((0, 3))), at, _corners(box))
    except ValueError as error:
        raise ValueError(f"--box: {error}") from None


def _corners(text: str) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    words = text.replace(",", " ").split()
    if len(words) != 6:
        raise ValueError(f'"{text}" is no room; write two corners in metres, like -2,0,-3,2,2.7,3')
    return read_point(" ".join(words[:3]), "--box"), read_point(" ".join(words[3:]), "--box")

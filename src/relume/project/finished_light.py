"""Light that shot and scene files name and need not measure: a map, maps that change with time, a clear sky."""

from __future__ import annotations

import os
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from relume.errors import RelumeError
from relume.image import files
from relume.light.daylight.sky import Sky, sky
from relume.light.daylight.sun_position import SunPosition
from relume.light.light_sequence import LightSequence
from relume.project.probe_tables import ProbeTable, joined_probes
from relume.project.schema import GreyOrColour, Names, Positive, Table, Vector
from relume.scene.scene import Distant
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap

if TYPE_CHECKING:
    from relume.renderers.several_probes.interpolation import InterpolatedLight

RATE = 24.0
"""Maps a second, where neither the table nor a sequence says so."""


class SkyTable(Table):
    """A clear sky, by place and time or by where the sun stands.

    latitude, longitude : degrees north and east
    date : date and time with its offset from UTC
    sun : [elevation, azimuth] in degrees, instead of the three; azimuth from north over east
    turbidity : haze, 1 to 10
    ground : albedo of the ground all round
    heading : compass direction that −Z looks in, degrees from north over east
    disc : whether the sun's disc is in the map; the ground is lit by it either way
    size : rows of the map
    """

    latitude: Annotated[float, Field(ge=-90, le=90)] | None = None
    longitude: Annotated[float, Field(ge=-360, le=360)] | None = None
    date: datetime | None = None
    sun: tuple[float, float] | None = None
    turbidity: float = 3.0
    ground: GreyOrColour = (0.2, 0.2, 0.2)
    heading: float = 0.0
    disc: bool = True
    size: Annotated[int, Field(ge=16, le=8192)] = 512

    @model_validator(mode="after")
    def _of_a_day(self) -> SkyTable:
        self.description()
        return self

    def description(self) -> Sky:
        """The sky; raises ValueError for a sun below the horizon, and for numbers that none has."""
        turned = float(np.radians(self.heading))
        place = self.latitude, self.longitude, self.date
        if self.sun is not None:
            if place != (None, None, None):
                raise ValueError("sun says where the sun stands; leave latitude, longitude and date out")
            stands = SunPosition(float(np.radians(self.sun[0])), float(np.radians(self.sun[1])))
            return Sky(stands, self.turbidity, self.ground, turned)
        if self.latitude is None or self.longitude is None or self.date is None:
            raise ValueError("give latitude, longitude and date, or sun = [elevation, azimuth]")
        return Sky.at(self.latitude, self.longitude, self.date, self.turbidity, self.ground, turned)

    def light(self) -> EnvironmentMap:
        """The sky as a map, in cd/m²."""
        return sky(self.description(), self.size, sun=self.disc)


class FinishedLight(Table):
    """The part of a [light] table that names finished light; at most one of map, maps, probes and sky.

    map : the file of a map
    maps : files or patterns of maps that follow one another, by the last number in each name
    rate : maps a second; that of the sequence unless given
    interpolation : "linear" in radiance between two maps, or "none"
    time : seconds into the maps; of a sequence they begin with its first frame
    shutter : when it opens and closes, seconds about `time`: the mean light between; of a sequence its own
    probes : maps taken at several places of one place, each with its position
    sky : a clear sky
    """

    map: str | None = None
    maps: Names | None = None
    rate: Positive | None = None
    interpolation: Literal["linear", "none"] = "linear"
    time: float = 0.0
    shutter: tuple[float, float] = (0.0, 0.0)
    probes: list[ProbeTable] | None = None
    sky: SkyTable | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> FinishedLight:
        if len(self.given()) > 1:
            raise ValueError(f"has {' and '.join(self.given())}; give one of map, maps, probes and sky")
        if self.maps is not None and not self.maps:
            raise ValueError("maps are none; give files or a pattern, as probe/*.exr")
        if self.probes is not None and not self.probes:
            raise ValueError('probes are none; give each as { map = "a.exr", position = [x, y, z] }')
        for name in ("rate", "interpolation", "time", "shutter"):
            if self.maps is None and name in self.model_fields_set:
                raise ValueError(f"has {name}, which is of maps that change with time; give maps, or leave it out")
        if self.shutter[0] > self.shutter[1]:
            raise ValueError(f"shutter is {list(self.shutter)}; expected seconds that rise")
        return self

    def given(self) -> list[str]:
        """Which of the keys map, maps, probes and sky there are."""
        return [name for name in ("map", "maps", "probes", "sky") if getattr(self, name) is not None]

    def sequence_of_maps(self, folder: Path, rate: float | None = None) -> LightSequence | None:
        """The maps that follow one another, or None; raises UnreadableFile.

        folder : from which names start
        rate : maps a second where the table does not say it
        """
        if self.maps is None:
            return None
        return LightSequence.found(self.maps, self.rate or rate or RATE, self.interpolation, folder=folder)

    def at_second(
        self, seconds: float, folder: Path, rate: float, shutter: tuple[float, float] = (0.0, 0.0)
    ) -> dict[str, Any]:
        """Keys of the table at a time of a sequence: the maps round it alone; none where no map changes.

        shutter : when it opens and closes, seconds about that time
        """
        found = self.sequence_of_maps(folder, rate)
        if found is None:
            return {}
        if shutter != (0.0, 0.0):
            begin, end = (seconds + self.time + each for each in shutter)
            seen = found.weights(begin, end)
            first = found.paths.index(next(iter(seen)))
            # At the ends, which hold, a map is there once and the times are before it or after it.
            place, paths = begin - first / found.rate, [_named(path, folder) for path in seen]
            return {"maps": paths, "rate": found.rate, "time": place, "shutter": (0.0, end - begin)}
        moment = found.moment(seconds + self.time)
        paths = [moment.before, moment.after] if moment.share else [moment.before]
        return {"maps": [_named(path, folder) for path in paths], "rate": 1.0, "time": moment.share}

    def joined(
        self, distant: Distant, at: Vector | None, folder: Path, refused: type[RelumeError], table_is: str = "light"
    ) -> InterpolatedLight | None:
        """The light of several probes at a place, the middle of them where that is None; None without probes.

        Raises `refused` for maps that do not go together and places outside of the distant scene.
        """
        return None if self.probes is None else joined_probes(self.probes, at, distant, folder, refused, table_is)

    def finished(self, folder: Path, refused: type[RelumeError]) -> EnvironmentMap | None:
        """The light, at `time`; None where it is not finished, or is of several probes.

        Raises `refused` for a map of unknown mapping.
        """
        if self.sky is not None:
            return self.sky.light()
        if (maps := self.sequence_of_maps(folder)) is not None:
            return maps.mean(*(self.time + each for each in self.shutter))
        if self.map is None:
            return None
        path = folder / self.map
        try:
            return as_environment(files.read_radiance(path))
        except ValueError as error:
            raise refused(f"{path}: {error}") from None

    def names_of_maps(self, folder: Path) -> list[str]:
        """The files of maps that follow one another or are probes', as a file in this folder names them.

        Raises UnreadableFile.
        """
        if self.probes is not None:
            return [each.map for each in self.probes]
        found = self.sequence_of_maps(folder)
        return [] if found is None else [_named(path, folder) for path in found.paths]


def _named(path: Path, folder: Path) -> str:
    """A file as a table in this folder names it."""
    try:
        return str(path.relative_to(folder))
    except ValueError:  # elsewhere
        return os.fspath(path.absolute())

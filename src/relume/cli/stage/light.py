"""Light on the command line for a stage: maps, directions, lamps and constellations, summed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import read_rotation, require_files
from relume.cli.light_input import Clamp
from relume.errors import UnreadableFile

if TYPE_CHECKING:
    import numpy as np

    from relume.light.constellations.constellation import Constellation
    from relume.lightstage.direct_light.light_directions import DirectedLight
    from relume.lightstage.field.lights import StageLights
    from relume.lightstage.relighting.interpolation import Interpolation
    from relume.sphere.environment_map import EnvironmentMap


@Parameter(name="*")
@dataclass(frozen=True)
class Light:
    """What shines on the subject; all that is given is summed."""

    light: Annotated[
        list[Path] | None,
        Parameter(negative="", help="An illumination map, or the .json of `relume lights`; again for each."),
    ] = None
    direction: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            allow_leading_hyphen=True,
            help="A parallel light from X,Y,Z, with irradiance 1 or as told: X,Y,Z=E or X,Y,Z=R,G,B; again for each.",
        ),
    ] = None
    lamp: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            allow_leading_hyphen=True,
            help="A lamp at X,Y,Z metres from the subject's middle, irradiance at a metre 1 or as told: X,Y,Z=I or "
            "X,Y,Z=R,G,B; again for each.",
        ),
    ] = None
    size: Annotated[float, Parameter(help="Apparent diameter of every --direction and --lamp, degrees.")] = 0.0
    rotate: Annotated[
        str | None,
        Parameter(
            allow_leading_hyphen=True,
            help="Turn the maps by YAW[,PITCH[,ROLL]] degrees about +Y, then +X, then +Z, right-handed.",
        ),
    ] = None
    clamp: Clamp = False
    nearest: Annotated[
        bool,
        Parameter(negative="", help="Give all light to the nearest light of the stage, as the paper does."),
    ] = False

    def check(self, *, maps_only: bool = False) -> None:
        """Refuse what cannot be, before any work."""
        if not (self.light or self.direction or self.lamp):
            raise ValueError("no light: give --light MAP, --direction X,Y,Z or --lamp X,Y,Z")
        if (maps_only or self.is_sequence) and (self.direction or self.lamp):
            raise ValueError("--direction and --lamp do not turn with a map; give --light alone")
        if not 0 <= self.size < 180:
            raise ValueError(f"--size is {self.size}; give degrees from 0 to below 180, like 0.5 for the sun")
        if self.is_sequence:
            if maps_only or len(self.light or []) > 1:
                raise ValueError("--light: a folder of maps is a sequence of its own; give it alone, without --frames")
            if self.pictures < 2:
                raise UnreadableFile(f"{(self.light or [])[0]}: a folder with fewer than two maps; name the map itself")
        else:
            require_files(self.light or [])

    @property
    def is_sequence(self) -> bool:
        """Whether --light is a folder: a map for each picture, as of a filmed probe."""
        return any(path.is_dir() for path in self.light or [])

    @property
    def pictures(self) -> int:
        """How many maps the folder of --light holds."""
        return len(self._listed())

    def _listed(self) -> list[Path]:
        folder = (self.light or [])[0]
        return sorted(path for path in folder.iterdir() if path.suffix.lower() in (".exr", ".hdr"))

    def directed(self) -> tuple[DirectedLight, str]:
        """The same light as directions, for shadows between the stage's lights, and its unit."""
        import numpy as np

        from relume.lightstage.direct_light.light_directions import DirectedLight, quadtree_lights

        radius = np.radians(self.size) / 2
        maps = self.maps()
        parts = [quadtree_lights(light).turned(self.rotation()) for light in maps]
        for read in self.constellations():
            radii = np.zeros(len(read.directions)) if read.angular_radii is None else read.angular_radii
            parts.append(DirectedLight(read.directions, read.irradiance, radii))
        for word in self.direction or []:
            towards, irradiance = read_strength(word, "--direction")
            parts.append(_parallel(np.array(towards), np.array(irradiance), radius))
        for word in self.lamp or []:
            place, intensity = np.array(read_strength(word, "--lamp"))
            parts.append(_parallel(place, intensity / (place @ place), radius))
        return DirectedLight.of(parts), maps[0].unit if maps else "relative"

    def turning(
        self,
        lights: StageLights,
        frames: int | None,
        report: Callable[[float], None],
        by: Interpolation | None = None,
    ) -> tuple[np.ndarray, str]:
        """Irradiances (K, N, 3) of every picture of a sequence, and their unit; `by` as of `irradiances`."""
        import numpy as np

        from relume.lightstage.relighting.irradiances import constellation_irradiances, irradiances
        from relume.sphere.directions import rotation_about

        by, found = by or self.interpolation(), []
        if frames is None:
            units = set()
            for index, path in enumerate(self._listed()):
                light = rl.read_environment(path, clamp=self.clamp)
                units.add(light.unit)
                if len(units) > 1:
                    raise ValueError(f"{path}: in {light.unit}, the maps before it not; a sequence has one unit")
                found.append(irradiances(lights, light, by, self.rotation()))
                report((index + 1) / self.pictures)
            return np.stack(found), units.pop()
        maps, lamps = self.maps(), self.constellations()
        for index in range(frames):
            turn = rotation_about((0.0, 1.0, 0.0), 2 * np.pi * index / frames)
            total = np.zeros((len(lights), 3))
            for light in maps:
                total += irradiances(lights, light, by, turn @ self.rotation())
            for read in lamps:
                total += constellation_irradiances(lights, replace(read, directions=read.directions @ turn.T), by)
            found.append(total)
            report((index + 1) / frames)
        return np.stack(found), maps[0].unit if maps else "relative"

    def interpolation(self) -> Interpolation:
        from relume.lightstage.relighting.interpolation import NearestLight, Smooth

        return NearestLight() if self.nearest else Smooth()

    def maps(self) -> list[EnvironmentMap]:
        """The maps of --light, not turned."""
        paths = [path for path in self.light or [] if path.suffix.lower() != ".json"]
        maps = [rl.read_environment(path, clamp=self.clamp) for path in paths]
        units = {each.unit for each in maps}
        if len(units) > 1:
            raise ValueError("--light: one map is in cd/m² and another relative; they cannot be summed")
        return maps

    def constellations(self) -> list[Constellation]:
        """The parallel lights of --light's .json, turned as the maps are."""
        from relume.export import json_lights

        turn = self.rotation().T
        found = [json_lights.read(path) for path in self.light or [] if path.suffix.lower() == ".json"]
        return [replace(each, directions=each.directions @ turn) for each in found]

    def rotation(self) -> np.ndarray:
        """What --rotate turns the maps by."""
        import numpy as np

        return np.eye(3) if self.rotate is None else read_rotation(self.rotate, "--rotate")

    def irradiances(self, lights: StageLights, by: Interpolation | None = None) -> tuple[np.ndarray, str]:
        """What each light of the stage has to give, (N, 3), and its unit; shared out as --nearest says unless given."""
        import numpy as np

        from relume.lightstage.relighting import illumination
        from relume.scene.lights import DistantLight, PointLight

        by, maps = by or self.interpolation(), self.maps()
        total = np.zeros((len(lights), 3))
        for light in maps:
            total += illumination.irradiances(lights, light, by, self.rotation())
        for read in self.constellations():
            total += illumination.constellation_irradiances(lights, read, by)
        radius = np.radians(self.size) / 2
        for word in self.direction or []:
            towards, irradiance = read_strength(word, "--direction")
            lamp = DistantLight(towards, irradiance)
            total += illumination.lamp_irradiances(lights, lamp, by, radius=radius)
        for word in self.lamp or []:
            place, intensity = read_strength(word, "--lamp")
            total += illumination.lamp_irradiances(lights, PointLight(place, intensity), by, radius=radius)
        return total, maps[0].unit if maps else "relative"


def _parallel(towards: np.ndarray, irradiance: np.ndarray, radius: float) -> DirectedLight:
    import numpy as np

    from relume.lightstage.direct_light.light_directions import DirectedLight

    unit = towards / np.linalg.norm(towards)
    return DirectedLight(unit[None], irradiance[None].astype(np.float64), np.array([radius]))


Three = tuple[float, float, float]


def read_strength(word: str, option: str) -> tuple[Three, Three]:
    """A place or direction and a colour from "X,Y,Z", "X,Y,Z=E" or "X,Y,Z=R,G,B"."""
    place, equals, strength = word.partition("=")
    try:
        x, y, z = (float(each) for each in place.replace(",", " ").split())
    except ValueError:
        raise ValueError(f'{option}: "{place}" are not three numbers; write X,Y,Z, like 1,1,2') from None
    if not equals:
        return (x, y, z), (1.0, 1.0, 1.0)
    try:
        numbers = [float(each) for each in strength.replace(",", " ").split()]
        red, green, blue = numbers * 3 if len(numbers) == 1 else numbers
    except ValueError:
        raise ValueError(
            f'{option}: "{strength}" is no strength; write one number or three, like {place}=2.5'
        ) from None
    return (x, y, z), (red, green, blue)

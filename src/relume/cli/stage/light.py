"""Options for the light on a stage: environment maps, light sets, directions and lamps, which are summed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

import relume as rl
from relume.cli.arguments import Clamp, MapsOptions, require_files
from relume.cli.option_types import Angles, numbers

if TYPE_CHECKING:
    import numpy as np

Three = tuple[float, float, float]
Placed = tuple[Three, Three] | tuple[Three, tuple[float]] | Three
"""A place or direction, with a strength of three numbers, one, or none."""


Rotate = Annotated[Angles | None, Parameter(help="Turn the map by YAW[,PITCH[,ROLL]] degrees, right-handed.")]


def read_turned(path: Path, angles: Three | None) -> rl.EnvironmentMap:
    """The environment map of a file, turned as --rotate says."""
    light, rotation = rl.read_environment(path), rotation_of(angles)
    return light if rotation is None else light.rotated(rotation)


def rotation_of(angles: Three | None) -> np.ndarray | None:
    """The rotation by yaw about +Y after pitch about +X after roll about +Z, degrees; None for none."""
    from scipy.spatial.transform import Rotation

    return None if angles is None else Rotation.from_euler("YXZ", angles, degrees=True).as_matrix()


@Parameter(name="*")
@dataclass(frozen=True)
class Light:
    """What shines on the subject; all that is given is summed."""

    light: Annotated[
        list[Path] | None,
        Parameter(
            negative="",
            help="An environment map, or the .json of `relume lights`; again for each. Or a folder of maps, alone.",
        ),
    ] = None
    direction: Annotated[
        list[Placed] | None,
        numbers(
            "X,Y,Z[=R,G,B]",
            like="1,1,2=2.5",
            help="A parallel light from X,Y,Z, of irradiance 1 or as given, one number or three; again for each.",
        ),
    ] = None
    lamp: Annotated[
        list[Placed] | None,
        numbers(
            "X,Y,Z[=R,G,B]",
            like="1,1,2=2.5",
            help="A lamp at X,Y,Z metres from the subject's middle, of irradiance 1 at a metre or as given; again for "
            "each.",
        ),
    ] = None
    size: Annotated[float, Parameter(help="Apparent diameter of every --direction and --lamp, degrees.")] = 0.0
    rotate: Annotated[
        Angles | None,
        Parameter(help="Turn the maps by YAW[,PITCH[,ROLL]] degrees about +Y, then +X, then +Z, right-handed."),
    ] = None
    clamp: Clamp = False
    nearest: Annotated[
        bool, Parameter(negative="", help="Give all light to the nearest light of the stage, as the paper does.")
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
                raise ValueError("--light: a folder of maps is a sequence already; give it alone, without --frames")
            if len(self._maps_of_folder()) < 2:
                folder = (self.light or [])[0]
                raise rl.errors.UnreadableFile(f"{folder}: a folder with fewer than two maps; name the map itself")
        else:
            require_files(self.light or [])

    @property
    def is_sequence(self) -> bool:
        """Whether --light is a folder: a map for each picture, as of a filmed probe."""
        return any(path.is_dir() for path in self.light or [])

    def lighting(self, paths: Sequence[Path] | None = None) -> rl.lightstage.StageLighting:
        """The light; of these maps and light sets alone where they are given."""
        import numpy as np

        files = list(self.light or []) if paths is None else paths
        lamps = [] if paths is not None else [rl.scene.DistantLight(*_strength(each)) for each in self.direction or []]
        lamps += [] if paths is not None else [rl.scene.PointLight(*_strength(each)) for each in self.lamp or []]
        return rl.lightstage.StageLighting(
            tuple(rl.read_environment(path, clamp=self.clamp) for path in files if path.suffix.lower() != ".json"),
            tuple(rl.read_lights(path) for path in files if path.suffix.lower() == ".json"),
            tuple(lamps),
            float(np.radians(self.size)),
            rotation_of(self.rotate),
        )

    def sequence(self, frames: int | None, maps: MapsOptions) -> Sequence[rl.lightstage.StageLighting]:
        """The light of each frame: maps that turn once, or those of a folder, one after the other."""
        if frames is not None:
            return self.lighting().turntable(frames)
        lights = maps.sequence((self.light or [])[0], clamp=self.clamp).checked()
        turn = rotation_of(self.rotate)
        return [rl.lightstage.StageLighting((lights.at(time),), rotation=turn) for time in lights.times()]

    def _maps_of_folder(self) -> list[Path]:
        folder = (self.light or [])[0]
        return [path for path in folder.iterdir() if path.suffix.lower() in (".exr", ".hdr")]


def _strength(placed: Placed) -> tuple[Three, Three]:
    """A place or direction, and R, G and B."""
    if len(placed) == 3:
        return placed, (1.0, 1.0, 1.0)
    place, strength = placed
    red, green, blue = strength * 3 if len(strength) == 1 else strength
    return place, (red, green, blue)

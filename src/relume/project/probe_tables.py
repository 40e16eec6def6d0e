"""Several probes of one place in shot and scene files: maps, each with where it was taken, joined to one light."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from relume.errors import RelumeError, UnreadableFile
from relume.image import files
from relume.light.constellations.local_lamps import free_lamp
from relume.light.constellations.placement import PlacedLights
from relume.project.schema import Table, Vector
from relume.scene.lights import SphereLight
from relume.scene.materials.checks import triple
from relume.scene.scene import Distant
from relume.sphere.directions import UP, rotation_about
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap

if TYPE_CHECKING:
    from relume.renderers.several_probes.interpolation import InterpolatedLight
    from relume.renderers.several_probes.placed_probe import PlacedProbe


class ProbeTable(Table):
    """A map of the place and where it was taken.

    map : its file
    position : metres, world
    heading : degrees about +Y by which it is turned to stand in the scene's frame, counter-clockwise seen from above
    """

    map: str
    position: Vector
    heading: float = 0.0

    def placed(self, folder: Path) -> PlacedProbe:
        """The map at its place; raises UnreadableFile, and ValueError for a map of unknown mapping."""
        from relume.renderers.several_probes.placed_probe import PlacedProbe

        picture = files.read_radiance(folder / self.map)
        light, variance = as_environment(picture), picture.variance
        if variance is not None and variance.shape != light.radiance.shape:
            variance = None
        if self.heading % 360 != 0:
            # What a turn does to the errors is not known; they are left out.
            light, variance = light.rotated(rotation_about(UP, np.radians(self.heading))), None
        return PlacedProbe(light, self.position, variance, self.map)


def joined_probes(
    tables: Sequence[ProbeTable],
    at: Vector | None,
    distant: Distant,
    folder: Path,
    refused: type[RelumeError],
    table_is: str = "light",
) -> InterpolatedLight:
    """The light of several probes at a place, the middle of them unless given; raises `refused`, UnreadableFile.

    folder : from which names start
    table_is : what messages call the table
    """
    from relume.renderers.several_probes.interpolation import interpolate_probes

    placed = []
    for index, table in enumerate(tables):
        try:
            placed.append(table.placed(folder))
        except (ValueError, UnreadableFile) as error:
            raise refused(f"{table_is}.probes.{index}: {error}") from None
    try:
        return interpolate_probes(placed, at, distant)
    except ValueError as error:
        raise refused(f"{table_is}.probes: {error}") from None


def lamp_out_of(
    light: EnvironmentMap, position: Sequence[float], at: Sequence[float]
) -> tuple[EnvironmentMap, SphereLight]:
    """A map as a place sees it, without the lamp that hangs at a position; and the lamp. Raises ValueError."""
    found = free_lamp(light, position, at)
    return found.rest, _sphere(found.lamp)


def without_hanging(
    light: EnvironmentMap, joined: InterpolatedLight, gain: np.ndarray
) -> tuple[EnvironmentMap, list[SphereLight]]:
    """A joined map without the lamps that were found to hang in the place, and the lamps.

    gain : (3,) by which the map was made brighter since it was joined
    One that does not stand out from what is behind it, as beside another lamp, stays in the map as far as it shows it.
    What the map does not show of it is what the probes that see it say.
    """
    lamps: list[SphereLight] = []
    found = joined.lamps
    for index, (position, share) in enumerate(zip(found.positions, joined.lamps_seen, strict=True)):
        shown = None
        if share > 0:
            with suppress(ValueError):
                light, shown = lamp_out_of(light, position, joined.position)
        if share >= 1:
            lamps += [] if shown is None else [shown]
            continue
        # The part that stays in the map gives its light from there.
        free = 1.0 if share == 0 or shown is not None else 1 - share
        radii = None if found.radii is None else found.radii[index : index + 1]
        lamps.append(_sphere(PlacedLights(position[None], free * gain * found.intensity[index : index + 1], radii)))
    return light, lamps


def gain_since_joined(light: EnvironmentMap, joined: InterpolatedLight) -> np.ndarray:
    """(3,) by which a joined map was made brighter since, channel by channel."""
    return light.total() / np.maximum(joined.light.total(), 1e-30)


def _sphere(lamp: PlacedLights) -> SphereLight:
    """The sphere that gives the lamp's light: a sphere of radiance L and radius r has intensity π r² L."""
    assert lamp.radii is not None  # free_lamp finds it
    radius = float(lamp.radii[0])
    radiance = lamp.intensity[0] / (np.pi * radius**2)
    return SphereLight(triple(lamp.positions[0]), radius, triple(radiance))

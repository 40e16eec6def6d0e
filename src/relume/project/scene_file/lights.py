"""The light of a scene file: its map, maps, sky or colour, and whence it comes; lamps are in `lamps`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from pydantic import model_validator

from relume.errors import InvalidScene, warn
from relume.image import files
from relume.light.light_sequence import LightSequence
from relume.project.finished_light import FinishedLight
from relume.project.keyed_values import table_at, values_at
from relume.project.place_tables import DistantTable as DistantSceneTable
from relume.project.place_tables import distant_scene, shining_place
from relume.project.probe_tables import gain_since_joined, without_hanging
from relume.project.scene_file.images import naming
from relume.project.schema import GreyOrColour, Positive, Vector
from relume.project.shot_file.sequence_table import LightKey, require_rising
from relume.renderers.mitsuba.distant import require_inside
from relume.renderers.several_probes.interpolation import InterpolatedLight
from relume.scene.lights import Light
from relume.scene.motion.keyframes import Interpolation
from relume.scene.motion.moving_objects import columns_turned
from relume.scene.scene import Distant, Infinite
from relume.scene.shapes.shapes import Mesh
from relume.sphere.directions import UP, rotation_about
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong

EVEN_ROWS = 4
"""Rows of a map that is the same everywhere."""


class LightTable(FinishedLight):
    """The light of the distant scene: a map, maps or a sky, turned about +Y, counter-clockwise from above, or a colour.

    exposure : stops by which it is brighter, beside `scale`
    distant : the shape of the distant scene, onto which the map is projected, as in the shot file; or a mesh that
        shines by its own radiance, before the map where there is one
    probe : where the map was taken, metres; of several probes the place they are joined for, their middle unless given
    keyframes : of a sequence: how far it is turned, and how much brighter it is
    """

    colour: GreyOrColour | None = None
    turn: float = 0.0
    scale: Positive = 1.0
    exposure: float = 0.0
    distant: DistantSceneTable = DistantSceneTable()
    probe: Vector | None = None
    keyframes: tuple[LightKey, ...] = ()

    @model_validator(mode="after")
    def _of_a_place(self) -> LightTable:
        require_rising(self.keyframes)
        near = self.distant.is_projected
        if near and self.probe is None and self.probes is None:
            raise ValueError("a near distant scene needs probe = [x, y, z], the place the map was taken at, metres")
        if self.probe is not None and not near and self.probes is None:
            raise ValueError("has probe, but the light is alike everywhere; give distant too, or leave probe out")
        if self.colour is not None and any(key.turn is not None for key in self.keyframes):
            raise ValueError("keyframes have turn, but a colour is the same from everywhere; remove turn")
        return self

    @model_validator(mode="after")
    def _one_source(self) -> LightTable:
        kinds = [*self.given(), *(["colour"] if self.colour is not None else [])]
        shines = self.distant.radiance == "own"
        if len(kinds) > 1 or not (kinds or shines):
            raise ValueError(
                f"has {' and '.join(kinds) or 'none of them'}; give one of map, maps, probes, sky and colour"
            )
        if self.colour is not None and "turn" in self.model_fields_set:
            raise ValueError("has turn, but a colour is the same from everywhere; remove turn")
        return self


def distant_light(table: LightTable | None, path: Path, joined: InterpolatedLight | None = None) -> EnvironmentMap:
    """The light from infinity as its file has it, black without any; raises InvalidScene naming the key.

    path : the scene file, beside which the map is looked for
    joined : of several probes
    """
    if joined is not None:
        return joined.light
    if table is None or (table.colour is None and not table.given()):
        return _even((0.0, 0.0, 0.0))
    if table.colour is not None:
        with naming(f"{path}: light.colour"):
            return _even(table.colour)
    with naming(f"{path}: light.{table.given()[0]}"):
        if table.map is not None:
            return read_light(path.parent / table.map)
        light = table.finished(path.parent, InvalidScene)
    assert light is not None  # _one_source
    return light


def joined_of(table: LightTable | None, path: Path) -> InterpolatedLight | None:
    """The light of several probes; None without. Raises InvalidScene naming the key."""
    if table is None or table.probes is None:
        return None
    with naming(f"{path}: light.distant"):
        distant = distant_scene(table.distant, path.parent)
    joined = table.joined(distant, table.probe, path.parent, InvalidScene, f"{path}: light")
    assert joined is not None  # there are probes
    return joined


def hanging_in(
    light: EnvironmentMap, joined: InterpolatedLight | None, table: LightTable | None
) -> tuple[EnvironmentMap, tuple[Light, ...]]:
    """The adjusted light without the lamps that several probes show before the walls, and these lamps.

    Where keys or a turn change the light they stay in the map, for lamps that have a place cannot follow.
    """
    if joined is None or table is None or table.distant.shape == "infinite":
        return light, ()
    if table.keyframes or table.turn % 360 != 0:
        if len(joined.lamps.positions):
            warn("light.turn and keyframes leave lamps that several probes show on the walls; leave them out")
        return light, ()
    rest, lamps = without_hanging(light, joined, gain_since_joined(light, joined))
    return rest, tuple(lamps)


def maps_of(table: LightTable | None, path: Path, rate: float) -> LightSequence | None:
    """Maps that follow one another, all of them read once; None without. Raises UnreadableFile.

    rate : of the sequence's frames
    """
    maps = None if table is None else table.sequence_of_maps(path.parent, rate)
    return None if maps is None else maps.checked()


def adjusted_light(light: EnvironmentMap, table: LightTable | None, path: Path) -> EnvironmentMap:
    """The light of a file scaled and turned as its table says; raises InvalidScene naming the key."""
    if table is None:
        return light
    with naming(f"{path}: light.scale"):
        return _adjusted(light, table)


def light_at(table: LightTable | None, frame: float, between: Interpolation, path: Path) -> LightTable | None:
    """The table at a frame of a sequence, without its keys; raises InvalidScene naming the key."""
    if table is None or not table.keyframes:
        return table
    changes = values_at(table.keyframes, frame, between, ("turn", "exposure"))
    return table_at(table, changes, f"{path}: light", frame, InvalidScene)


def distant_of(table: LightTable | None, path: Path, joined: InterpolatedLight | None = None) -> tuple[Distant, Vector]:
    """The shape of the distant scene, and where its map was taken; raises InvalidScene naming the key.

    joined : of several probes
    """
    if table is not None and joined is not None:
        return distant_scene(table.distant, path.parent), joined.position
    if table is None or table.probe is None:
        return Infinite(), (0.0, 0.0, 0.0)
    with naming(f"{path}: light.distant"):
        distant = distant_scene(table.distant, path.parent)
    with naming(f"{path}: light.probe"):
        require_inside(distant, table.probe)
    return distant, table.probe


def shining_of(table: LightTable | None, path: Path) -> tuple[tuple[Mesh, ...], tuple[Light, ...]]:
    """A distant scene that shines by its own radiance: its meshes and lamps; raises InvalidScene naming the key."""
    if table is None:
        return (), ()
    with naming(f"{path}: light.distant"):
        return shining_place(table.distant, path.parent)


def read_light(path: Path) -> EnvironmentMap:
    """The environment map in a file; raises UnreadableFile, or ValueError where its mapping is unknown."""
    picture = files.read_radiance(path)
    try:
        return as_environment(picture)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _even(colour: tuple[float, float, float]) -> EnvironmentMap:
    return EnvironmentMap(np.broadcast_to(np.array(colour, np.float32), (EVEN_ROWS, 2 * EVEN_ROWS, 3)).copy())


def _adjusted(light: EnvironmentMap, table: LightTable) -> EnvironmentMap:
    with np.errstate(over="ignore"):
        factor = table.scale * 2.0**table.exposure
        scaled = replace(light, radiance=(light.radiance * factor).astype(np.float32))
    angle = np.radians(table.turn % 360)
    if not angle:
        return scaled
    if not isinstance(light.mapping, LatLong):
        return scaled.rotated(rotation_about(UP, angle))
    return replace(scaled, radiance=columns_turned(scaled.radiance, angle).astype(np.float32))

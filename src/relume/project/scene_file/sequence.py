"""A scene file's sequence: the scene and its camera at any frame, from the keys and the files of what moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from relume.light.light_sequence import LightSequence
from relume.project.keyed_values import BETWEEN
from relume.project.scene_file.camera import CameraTable, camera_of
from relume.project.scene_file.lamps import LampTableOfAKind, lamps_at
from relume.project.scene_file.lights import LightTable, adjusted_light, light_at
from relume.project.scene_file.shapes import MovingObject
from relume.project.shot_file.sequence_table import SequenceTable
from relume.scene.cameras.camera import Camera
from relume.scene.motion.keyframes import Shutter
from relume.scene.motion.moving_objects import ObjectOrbit
from relume.scene.scene import Scene
from relume.sphere.environment_map import EnvironmentMap


@dataclass(frozen=True, eq=False)
class SceneSequence:
    """Which frames a scene file asks for, and what moves in them.

    table : the file's [sequence]
    path : the file, absolute, for messages and for the camera's file
    camera, table_of_light : the file's [camera] and [light], with their keys
    light : the map of [light] as it was read, neither scaled nor turned; of maps that change the first frame's
    maps : those of [light] that follow one another; None where one stays
    objects : the file's, in order
    lamps : its [[lights]], with their keys
    """

    table: SequenceTable
    path: Path
    camera: CameraTable
    table_of_light: LightTable | None
    light: EnvironmentMap
    objects: tuple[MovingObject, ...]
    maps: LightSequence | None = None
    lamps: tuple[LampTableOfAKind, ...] = ()

    @property
    def shutter(self) -> Shutter | None:
        """When the shutter is open; None for frames without blur."""
        return None if self.table.shutter is None else Shutter(*self.table.shutter)

    def under(self, light: EnvironmentMap) -> SceneSequence:
        """The same under another light, as it is but for the keys of [light]."""
        table = self.table_of_light
        if table is not None:
            table = table.model_copy(update={"scale": 1.0, "turn": 0.0, "exposure": 0.0})
        return replace(self, light=light, table_of_light=table, maps=None)

    def at(self, frame: float, scene: Scene, camera: Camera) -> tuple[Scene, Camera]:
        """The scene and the camera at a frame, of the size of `camera`; raises InvalidScene naming the key.

        scene : of the same file, whose real surfaces stay
        """
        return self.scene_at(frame, scene), self.camera_at(frame).resized(camera.width, camera.height)

    def identity(self) -> list[object]:
        """What all that moves depends on, of values that can be hashed: tables, files as paths, solids, maps."""
        tables = [self.table.model_dump(mode="json", exclude={"frames", "plates"}), self.table.frames[0]]
        tables += [each and each.model_dump(mode="json") for each in (self.camera, self.table_of_light)]
        asked = self.camera.file
        tables += [each.model_dump(mode="json") for each in self.lamps]
        files = [] if asked is None else [self.path.parent / asked.path]
        objects = [
            [
                each.solids, each.placement.model_dump(mode="json"), [key.model_dump(mode="json") for key in each.keys],
                each.motion, each.orbit,
            ]
            for each in self.objects
        ]  # fmt: skip
        maps = [] if self.maps is None else list(self.maps.paths)
        return [tables, files, self.light, maps, objects]

    def scene_at(self, frame: float, scene: Scene) -> Scene:
        """The scene at a frame; its light is the very same one where no key changes it."""
        between = BETWEEN[self.table.interpolation]
        table = self.table_of_light
        light = scene.light
        if table is not None and (table.keyframes or self.maps is not None):
            found = self.light if self.maps is None else self.maps.at(self._seconds(frame) + table.time)
            light = adjusted_light(found, light_at(table, frame, between, self.path), self.path)
        if any(each.keyframes for each in self.lamps):
            scene = replace(scene, lights=lamps_at(self.lamps, frame, between, self.path))
        objects = self.objects
        if any(each.moves or each.orbit is not None for each in objects):
            seconds, share = self._seconds(frame), self._share(frame)
            pairs = [(solid, each.orbit) for each in objects for solid in each.at(frame, seconds, between, self.path)]
            scene = replace(scene, objects=tuple(solid for solid, _ in pairs))
            scene = orbited(scene, [orbit for _, orbit in pairs], share)
        return scene if light is scene.light else replace(scene, light=light)

    @property
    def only_maps_change(self) -> bool:
        """Whether nothing moves but the light, by its maps alone, so that an exposure is a still under their mean."""
        keyed = self.camera.keyframes or self.camera.file is not None
        keyed = keyed or (self.table_of_light is not None and bool(self.table_of_light.keyframes))
        moving = any(each.moves or each.orbit is not None for each in self.objects)
        return self.maps is not None and not keyed and not moving

    def exposed(self, frame: float, scene: Scene) -> Scene:
        """The scene of a frame where `only_maps_change`, under the mean of its light while the shutter is open."""
        assert self.maps is not None and self.table_of_light is not None  # only_maps_change
        opens, closes = (self._seconds(frame + each) for each in self.table.shutter or (0.0, 0.0))
        time = self.table_of_light.time
        light = adjusted_light(self.maps.mean(opens + time, closes + time), self.table_of_light, self.path)
        return replace(scene, light=light)

    def camera_at(self, frame: float) -> Camera:
        """The camera at a frame, of the file's own size."""
        table = self.camera.at(frame, BETWEEN[self.table.interpolation], self.path)
        return camera_of(table, self.path, self._seconds(frame), self.table.rate)

    def _seconds(self, frame: float) -> float:
        """Since the sequence began, with which motion in files begins."""
        return (frame - self.table.frames[0]) / self.table.rate

    def _share(self, frame: float) -> float:
        """Of the sequence; the last frame stops one short of the end, so that a full turn loops."""
        first, last = self.table.frames[0], self.table.frames[-1]
        return (frame - first) / (last - first + 1)


def orbited(scene: Scene, orbits: Sequence[ObjectOrbit | None], share: float) -> Scene:
    """The scene with objects that go round, after this share of their way."""
    pairs = zip(scene.objects, orbits, strict=True)
    return replace(scene, objects=tuple(solid if orbit is None else orbit.at(solid, share) for solid, orbit in pairs))

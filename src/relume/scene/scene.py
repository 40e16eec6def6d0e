"""A scene: the real surfaces, the objects added to them, and the light of the distant scene (Debevec 1998, §4)."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from relume.scene.distant import Distant, Infinite, Point
from relume.scene.lights import Light
from relume.scene.shapes.shapes import Shape, Solid
from relume.sphere.environment_map import EnvironmentMap


@dataclass(frozen=True, eq=False)
class Scene:
    """What a renderer renders.

    light : the distant scene, as `probe` sees it
    local : real surfaces that the objects affect
    objects : what is added; a renderer's matte is their coverage
    lights : others than the distant scene
    distant : onto what the light is projected; at infinity, where every place sees the same, unless given
    probe : where the light was measured, metres, world; means nothing for a distant scene at infinity
    """

    light: EnvironmentMap
    local: tuple[Shape, ...] = ()
    objects: tuple[Solid, ...] = ()
    lights: tuple[Light, ...] = ()
    distant: Distant = Infinite()
    probe: Point = (0.0, 0.0, 0.0)

    def adding(self, *objects: Solid) -> Scene:
        """The same scene with more objects."""
        return replace(self, objects=(*self.objects, *objects))

    def without_objects(self) -> Scene:
        """The real scene alone."""
        return replace(self, objects=())

    def with_local(self, local: Iterable[Shape]) -> Scene:
        """The same scene over other real surfaces."""
        return replace(self, local=tuple(local))

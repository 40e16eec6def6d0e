"""The place of a shot: its light projected onto the distant scene, its lamps, its real surfaces."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np

from relume.errors import InvalidShot
from relume.image.radiance import RadianceMap
from relume.light.constellations.local_lamps import free_lamp
from relume.light.constellations.placement import PlacedLights
from relume.probe.ball.blending import Probe
from relume.project.insertion.sequence_moments import changed_light
from relume.project.shot_file.distant_table import distant_scene
from relume.project.shot_file.shot import Shot
from relume.renderers.mitsuba.distant import require_inside
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.renderer import Renderer
from relume.renderers.results import Progress
from relume.scene.cameras.camera import Camera
from relume.scene.distant import Infinite
from relume.scene.lights import SphereLight
from relume.scene.materials.checks import triple
from relume.scene.scene import Scene
from relume.surface.gloss import ViewOfProbe
from relume.surface.reflectance import RecoveredLocal, recover


def place_of(shot: Shot, probe: Probe) -> Scene:
    """The scene without objects, as it was photographed; its surfaces grey where they are to be recovered.

    Raises InvalidShot where a lamp is not seen in the light, and what reading the meshes raises.
    """
    light, where = changed_light(probe.light, shot.light.heading, 0.0), (0.0, 0.0, 0.0)
    if shot.light.ball is not None:
        where = shot.light.ball.centre
    elif shot.light.probe is not None:
        where = shot.light.probe
    lamps: list[SphereLight] = []
    for index, position in enumerate(shot.light.lamps):
        try:
            found = free_lamp(light, position, where)
        except ValueError as error:
            raise InvalidShot(f"light.lamps.{index}: {error}") from None
        light = found.rest
        lamps.append(_sphere(found.lamp))
    local = tuple(shape for table in shot.local for shape in table.shapes(shot.folder))
    if not local:
        warnings.warn(
            "there is no local surface: the objects throw no shadow; describe what they stand on as [[local]]",
            stacklevel=2,
        )
    return Scene(light, local, (), tuple(lamps), distant_scene(shot.light.distant, shot.folder), where)


def require_in_place(place: Scene, camera: Camera) -> None:
    """Raises InvalidShot where probe, camera or a lamp stands outside a near distant scene: a slip of a length."""
    if isinstance(place.distant, Infinite):
        return
    standing = {"light.probe or light.ball": place.probe, "camera": tuple(camera.position)}
    standing |= {
        f"light.lamps.{i}": lamp.position for i, lamp in enumerate(place.lights) if isinstance(lamp, SphereLight)
    }
    for key, position in standing.items():
        try:
            require_inside(place.distant, (position[0], position[1], position[2]))
        except ValueError:
            where = ", ".join(f"{v:.3g}" for v in position)
            raise InvalidShot(
                f"{key}: at ({where}) metres it is outside of light.distant; is a length wrong, or the distant scene "
                "too small?"
            ) from None


def relit(place: Scene, shot: Shot) -> Scene:
    """The place under the light as the shot changes it: turned about the place where it was measured, brighter."""
    turn, exposure = shot.light.turn, shot.light.exposure
    if turn == 0 and exposure == 0:
        return place
    if turn != 0 and place.lights:
        raise InvalidShot("light.turn: lamps that have a place cannot be turned; leave light.lamps out, or the turn")
    lamps = tuple(
        replace(lamp, radiance=tuple(float(c) * 2.0**exposure for c in lamp.radiance)) if isinstance(lamp, SphereLight)
        else lamp for lamp in place.lights
    )  # fmt: skip
    return replace(place, light=changed_light(place.light, turn, exposure), lights=lamps)


def recovered_place(
    shot: Shot, plate: RadianceMap, camera: Camera, place: Scene, probe: Probe, renderer: Renderer | None,
    progress: Progress,
) -> RecoveredLocal:  # fmt: skip
    """The place's surfaces with the reflectance that plate and light tell (Debevec 1998, §7)."""
    ball = shot.light.ball
    seen = ball is not None
    # A mesh file may hold several surfaces, which are all wanted alike.
    wanted = [table.wanted(seen) for table in shot.local for _ in table.shapes(shot.folder)]
    view = ViewOfProbe(probe.confidence, ball.radius) if ball is not None else None
    try:
        return recover(
            plate, camera, place, wanted, probe=view, renderer=renderer or Mitsuba(samples=64, depth=6),
            seed=shot.render.seed, progress=progress,
        )  # fmt: skip
    except ValueError as error:
        raise InvalidShot(f"local.reflectance: {error}") from None


def _sphere(lamp: PlacedLights) -> SphereLight:
    """The sphere that gives the lamp's light: a sphere of radiance L and radius r has intensity π r² L."""
    assert lamp.radii is not None  # free_lamp tells it
    radius = float(lamp.radii[0])
    radiance = lamp.intensity[0] / (np.pi * radius**2)
    return SphereLight(triple(lamp.positions[0]), radius, triple(radiance))

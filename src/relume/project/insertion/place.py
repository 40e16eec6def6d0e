"""The third step of `insert`: the place as it was photographed, its camera, light, real surfaces and their reflectance.

A place is a scene without objects: the light projected onto the distant scene, its lamps, and its real surfaces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from relume.capture.lens.vignetting import Vignetting
from relume.composite.surface.recovery import KnownMaterial, RecoveredLocal, Recovery
from relume.composite.surface.reflectance import recover_reflectance
from relume.composite.surface.several_plates import LitView, recover_from_views
from relume.composite.surface.two_views import ViewOfProbe
from relume.errors import InvalidShot, warn
from relume.image.radiance import RadianceMap
from relume.probe.ball.blending import Probe
from relume.project.insertion.photographs import Calibrated
from relume.project.insertion.slips import require_outside_ball
from relume.project.place_tables import distant_scene, shining_place
from relume.project.probe_tables import gain_since_joined, lamp_out_of, without_hanging
from relume.project.shot_file.camera_table import camera_fit
from relume.project.shot_file.objects import require_outside
from relume.project.shot_file.shot import Shot
from relume.project.stages import Steps
from relume.renderers.mitsuba.distant import require_inside
from relume.renderers.mitsuba.path_tracer import Mitsuba
from relume.renderers.progressive.fingerprint import without_threads
from relume.renderers.renderer import Renderer
from relume.renderers.results import Progress
from relume.renderers.several_probes.interpolation import InterpolatedLight
from relume.scene.cameras.camera import Camera
from relume.scene.cameras.fit import CameraFit
from relume.scene.lights import RectangleLight, SphereLight
from relume.scene.places.reading import read_shapes
from relume.scene.scene import Infinite, Point, Scene
from relume.scene.shapes.shapes import Mesh
from relume.sphere.directions import UP, rotation_about
from relume.sphere.environment_map import EnvironmentMap


@dataclass(frozen=True, eq=False)
class Place:
    """The place of a shot.

    fit : the plate's camera, and how well the photograph agrees with it
    camera : the same with the aperture and the focus that [match] asks for
    bare : the scene as it was photographed, its surfaces grey where they are to be recovered
    recovered : the real surfaces, or None where there are none
    vignetting : the fall-off that is in the plate; None where there is none
    """

    fit: CameraFit
    camera: Camera
    bare: Scene
    recovered: RecoveredLocal | None
    vignetting: Vignetting | None

    def relit(self, shot: Shot, light: EnvironmentMap | None = None) -> Scene:
        """The scene without objects, under the light as `shot` changes it; raises InvalidShot.

        light : another finished map than the place's own, on the plate's scale
        """
        shapes = () if self.recovered is None else self.recovered.shapes
        bare = self.bare
        if light is not None:
            light, lamps = _light_and_lamps(shot, light, bare.probe)
            # Lamps that stay: those of a place that shines by its own radiance.
            own = [lamp for lamp in bare.lights if isinstance(lamp, RectangleLight)]
            bare = replace(bare, light=light, lights=(*lamps, *own))
        return relit(bare.with_local(shapes), shot)


def find_camera(shot: Shot, calibrated: Calibrated, steps: Steps) -> CameraFit:
    """Fit the plate's camera; raises InvalidShot, GridNotFound, UnreadableFile."""
    with steps.timed("camera"):
        if calibrated.stood is not None:
            return calibrated.stood.fit
        fit = camera_fit(shot.camera, calibrated.plate.size, shot.folder, calibrated.focal_length)
    require_outside_ball(fit.camera, shot.light.ball)
    return fit


def find_place(
    shot: Shot, calibrated: Calibrated, fit: CameraFit, meshes: Sequence[Mesh], renderer: Renderer | None, steps: Steps
) -> Place:
    """Set up the light about the plate's camera, and recover the reflectance of the real surfaces.

    fit : of the camera
    meshes : the objects, which must not hold the camera
    renderer : lights the surfaces for the recovery; a path tracer of its own unless given
    Raises InvalidShot, GridNotFound, UnreadableFile.
    """
    plate = calibrated.plate
    camera = _with_lens(shot, fit.camera, calibrated)
    shining = _shining(shot, steps)
    bare = bare_place(shot, calibrated.probe, calibrated.centre, calibrated.joined, shining)
    require_in_place(bare, camera)
    require_outside(meshes, camera)
    vignetting = shot.match.vignetting_in(shot.folder, camera.focal_length, plate.size)
    recovered = None
    if bare.local:
        even = plate
        if vignetting is not None:
            # What the scene's radiance was, for recovering reflectance.
            fall_off = vignetting.falloff(plate.size)[..., None]
            even = replace(plate, radiance=(plate.radiance / fall_off).astype(np.float32))
        ball = shot.light.ball
        made_from = [
            even, camera, bare, calibrated.probe.confidence, calibrated.probe.mirrored_at, calibrated.probe.nearness,
            [table.model_dump() for table in shot.surfaces()],
            [view.model_dump() for view in shot.views],
            [shot.path(name) for view in shot.views for name in view.files()],
            ball and ball.model_dump(), shot.render.seed, without_threads(renderer),
        ]  # fmt: skip
        views = [view.lit(bare, shot.folder, number) for number, view in enumerate(shot.views)]
        progress: Progress = lambda share: steps.progress("reflectance", share)  # noqa: E731
        recovered = steps.keep(
            "reflectance",
            made_from,
            lambda: _recovered(shot, even, camera, bare, calibrated.probe, views, renderer, progress),
        )
    return Place(fit, camera, bare, recovered, vignetting)


def _with_lens(shot: Shot, camera: Camera, calibrated: Calibrated) -> Camera:
    """The camera with the aperture and the focus that [match] asks for."""
    diameter, focus = shot.match.aperture, shot.match.focus
    if diameter is None or focus is None:
        return camera
    if diameter == "exif":
        from relume.virtual_camera.lens.defocus_blur import aperture_from

        bracket = calibrated.bracket
        diameter = None if bracket is None else aperture_from(bracket.photographs[0])
        if diameter is None:
            raise InvalidShot(
                "match.aperture: the plate's EXIF has no f-number or focal length; give the diameter in metres"
            )
    return replace(camera, aperture=diameter / 2, focus=focus)


def _shining(shot: Shot, steps: Steps) -> Shining:
    """What of the place shines by its own radiance; raises InvalidShot, UnreadableFile."""
    table = shot.light.distant
    if table.radiance != "own":
        return Shining()
    assert table.mesh is not None  # of its own radiance
    meshes, scale = read_shapes(shot.path(table.mesh)), 1.0 if shot.light.scale is None else shot.light.scale

    def found() -> Shining:
        try:
            return Shining(*shining_place(table, shot.folder, np.array(scale)))
        except ValueError as error:
            raise InvalidShot(f"light.distant: {error}") from None

    return steps.keep("shining", [table.model_dump(), scale, meshes], found)


@dataclass(frozen=True, eq=False)
class Shining:
    """What of a place shines by its own radiance.

    meshes : they shine, or take light
    lamps : the brightest of it
    """

    meshes: tuple[Mesh, ...] = ()
    lamps: tuple[RectangleLight, ...] = ()


def bare_place(
    shot: Shot, probe: Probe, centre: Point | None = None, joined: InterpolatedLight | None = None,
    shining: Shining = Shining(),
) -> Scene:  # fmt: skip
    """The scene without objects, as it was photographed; its surfaces grey where they are to be recovered.

    centre : of the ball, metres, where it was found and not measured; or the place that several probes are joined for
    joined : the light of several probes as it was joined, whose hanging lamps are taken out of the map
    shining : what of it shines by its own radiance, real surfaces after those of [[local]]
    Raises InvalidShot where a lamp is not seen in the light, and what reading the meshes raises.
    """
    where = (0.0, 0.0, 0.0)
    if shot.light.ball is not None:
        where = centre or shot.light.ball.centre or where
    else:
        where = centre or shot.light.probe or where
    light, lamps = _light_and_lamps(shot, probe.light, where)
    distant = distant_scene(shot.light.distant, shot.folder)
    if joined is not None and not isinstance(distant, Infinite):
        light, found = without_hanging(light, joined, gain_since_joined(probe.light, joined))
        lamps = (*lamps, *found)
    local = (*(shape for table in shot.surfaces() for shape in table.shapes(shot.folder)), *shining.meshes)
    if not local:
        warn("there is no local surface: the objects throw no shadow; describe what they stand on as [[local]]")
    return Scene(light, local, (), (*lamps, *shining.lamps), distant, where, shot.medium and shot.medium.medium())


def _light_and_lamps(shot: Shot, light: EnvironmentMap, where: Point) -> tuple[EnvironmentMap, tuple[SphereLight, ...]]:
    """The light in the scene's frame without its lamps, and those; raises InvalidShot where one is not seen in it."""
    light = turned_light(light, shot.light.heading, 0.0)
    lamps: list[SphereLight] = []
    for index, position in enumerate(shot.light.lamps):
        try:
            light, lamp = lamp_out_of(light, position, where)
        except ValueError as error:
            raise InvalidShot(f"light.lamps.{index}: {error}") from None
        lamps.append(lamp)
    return light, tuple(lamps)


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
    """The place under the light as the shot changes it: turned about the place where it was measured, brighter.

    Lights that were added shine beside it, as they stand in the shot.
    """
    turn, exposure = shot.light.turn, shot.light.exposure
    added = [each for each in shot.light.added if each.on]
    if turn == 0 and exposure == 0 and not added:
        return place
    if turn != 0 and place.lights:
        raise InvalidShot("light.turn: lamps that have a place cannot be turned; leave light.lamps out, or the turn")
    lamps = tuple(
        replace(lamp, radiance=tuple(float(c) * 2.0**exposure for c in lamp.radiance)) if isinstance(lamp, SphereLight)
        else lamp for lamp in place.lights
    )  # fmt: skip
    light = turned_light(place.light, turn, exposure)
    for each in added:
        light = each.shining_in(light)
    return replace(place, light=light, lights=lamps)


def _recovered(
    shot: Shot, plate: RadianceMap, camera: Camera, place: Scene, probe: Probe, views: Sequence[LitView],
    renderer: Renderer | None, progress: Progress,
) -> RecoveredLocal:  # fmt: skip
    """The place's surfaces with the reflectance that follows from plate and light (Debevec 1998, §7)."""
    ball = shot.light.ball
    seen = ball is not None
    # A mesh file may hold several surfaces, which are all wanted alike.
    wanted = [table.wanted(seen) for table in shot.surfaces() for _ in table.shapes(shot.folder)]
    # What shines by itself, after them, is known.
    wanted += [Recovery(KnownMaterial())] * (len(place.local) - len(wanted))
    view = None
    if ball is not None:
        view = ViewOfProbe(probe.confidence, ball.radius, probe.mirrored_at, probe.nearness)
    try:
        if views:
            first = LitView(plate, camera, place)
            traced = renderer or Mitsuba(samples=64, depth=6)
            joint = recover_from_views(
                [first, *views], wanted, renderer=traced, seed=shot.render.seed, progress=progress
            )
            return replace(joint.local, notes=(*joint.local.notes, *joint.notes))
        return recover_reflectance(
            plate, camera, place, wanted, probe=view, renderer=renderer or Mitsuba(samples=64, depth=6),
            seed=shot.render.seed, progress=progress,
        )  # fmt: skip
    except ValueError as error:
        raise InvalidShot(f"local.reflectance: {error}") from None


def turned_light(light: EnvironmentMap, turn: float, exposure: float) -> EnvironmentMap:
    """The light turned about +Y, degrees, counter-clockwise seen from above, and made brighter by stops."""
    if turn % 360 != 0:
        light = light.rotated(rotation_about(UP, np.radians(turn)))
    return light if exposure == 0 else replace(light, radiance=np.float32(2.0**exposure) * light.radiance)

"""What another program gets of a shot: plate, camera, real surfaces, objects and light, and what it is written from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from relume.errors import InvalidShot, UnsupportedScene
from relume.export.lamps import LampFile
from relume.image import files
from relume.image.bilinear import bilinear
from relume.light.constellations.constellation import Constellation, together
from relume.light.constellations.placement import PlacedLights, radii_at
from relume.light.reflection.convolution import as_latlong
from relume.project.insertion.prepared import PreparedShot
from relume.renderers.mitsuba.distant import wall_distances
from relume.scene.lights import AmbientLight, DistantLight, Light, PointLight, RectangleLight, SphereLight, SquareLaw
from relume.scene.scene import Infinite
from relume.sphere.environment_files import as_radiance_map
from relume.sphere.environment_map import EnvironmentMap

LIGHT = "light.exr"
"""The file of the light that no lamp stands for, beside the others of a shot."""


def write_pictures(value: PreparedShot, folder: Path, light: EnvironmentMap | None = None) -> None:
    """Write the plate, scene-linear and developed, and the light where one is given."""
    if light is not None:
        files.write(folder / LIGHT, as_radiance_map(light))
    files.write(folder / "plate.exr", value.plate)
    files.write(folder / "plate.png", value.picture())


def light_of(value: PreparedShot) -> tuple[EnvironmentMap, LampFile]:
    """The lat-long map that no lamp stands for, and the scene's lamps and key lights, each where it stands.

    The map is the background of the lamps unless the distant scene has walls, which show it then.
    The key lights of a distant scene with walls stand where their rays from the probe meet them, as in
    `light.placing.placed_in_box`. Raises UnsupportedScene for ambient light, points without the
    square law, and rectangles of light.
    """
    scene, keys = value.scene, value.keys
    distant, places = _of_scene(scene.lights)
    if keys is None:
        light = scene.light
    else:
        light = keys.residual
        if isinstance(scene.distant, Infinite):
            distant = together(distant, replace(keys.lights, labels=None))
        else:
            reach = wall_distances(scene.distant, np.array(scene.probe), keys.lights.directions)
            radii = radii_at(keys.lights, reach)
            places += zip(
                np.array(scene.probe) + reach[:, None] * keys.lights.directions,
                keys.lights.irradiance * reach[:, None] ** 2,
                np.zeros(len(reach)) if radii is None else radii,
                strict=True,
            )
    radii = distant.angular_radii
    angles = np.zeros(len(distant.directions)) if radii is None else np.minimum(2 * radii, np.pi)
    placed = None
    if places:
        positions, intensity, sizes = zip(*places, strict=True)
        placed = PlacedLights(np.array(positions, np.float64), np.array(intensity), np.array(sizes, np.float64))
    background = LIGHT if isinstance(scene.distant, Infinite) else None
    return as_latlong(light), LampFile(distant, light.unit, background, angles, placed)


def _of_scene(lights: tuple[Light, ...]) -> tuple[Constellation, list[tuple[Any, Any, float]]]:
    """The parallel lights; place, intensity and radius of each that has a place."""
    towards, irradiance, places = [], [], []
    for light in lights:
        if isinstance(light, DistantLight):
            way = np.asarray(light.towards, np.float64)
            towards.append(way / np.linalg.norm(way))
            irradiance.append(light.irradiance)
        elif isinstance(light, SphereLight):
            # From everywhere a sphere is a disc of π r².
            intensity = np.pi * light.radius**2 * np.asarray(light.radiance, np.float64)
            places.append((light.position, intensity, light.radius))
        elif isinstance(light, RectangleLight):
            raise UnsupportedScene(
                "rectangles of light are not written for other programs; leave them out, or use spheres of light"
            )
        elif isinstance(light, AmbientLight) or not isinstance(light.falloff, SquareLaw):
            raise UnsupportedScene(
                "ambient light, and points that do not fall with the square of the distance, are in no other program; "
                "leave them out, or use an even light map"
            )
        else:
            assert isinstance(light, PointLight)
            places.append((light.position, np.asarray(light.intensity, np.float64), 0.0))
    distant = Constellation(
        np.array(towards, np.float64).reshape(-1, 3),
        np.array(irradiance, np.float64).reshape(-1, 3),
        np.zeros(len(towards)),
        np.zeros(len(towards)),
    )
    return distant, places


def undistorted(value: PreparedShot) -> tuple[PreparedShot, tuple[str, ...]]:
    """The shot as a camera without lens distortion would have taken it, and a note that says so where it changed.

    Other programs' cameras draw straight lines straight. The plate is drawn anew for one (bilinear); what lies outside
    of it is its edge, drawn out. The scene stays as it is. Raises InvalidShot for a rolling shutter.
    """
    if value.camera.rolling is not None:
        raise InvalidShot("camera.readout: other programs' cameras see all rows at once; leave it out for the export")
    if value.camera.distortion is None:
        return value, ()
    camera = value.camera.pinhole()
    seen = value.camera.project(camera.position + camera.rays())
    x, y = seen[..., 0], seen[..., 1]
    outside = ~((x >= 0) & (x <= camera.width) & (y >= 0) & (y <= camera.height))
    x, y = np.nan_to_num(x, nan=0.0), np.nan_to_num(y, nan=0.0)

    def drawn(pixels: np.ndarray) -> np.ndarray:
        return bilinear(pixels.astype(np.float64), x, y)

    plate = replace(value.plate, radiance=drawn(value.plate.radiance).astype(np.float32), variance=None, clipped=None)
    shown = value.picture()
    picture = replace(shown, pixels=np.rint(drawn(shown.pixels)).astype(shown.pixels.dtype), outside=None)
    note = (
        "the lens' distortion is in no other program's camera: the plate is drawn anew without it, and "
        f"{outside.mean():.1%} of it, at the edges, had no pixel; distort the finished picture to lay it over the "
        "photograph"
    )
    return replace(value, camera=camera, plate=plate, photograph=picture), (note,)

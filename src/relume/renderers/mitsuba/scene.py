"""Our scene in Mitsuba's words: the adapter for light, shapes and materials.

Mitsuba's `envmap` is half a turn away from our lat-long and its rows align corners where ours have pixel centres;
`envmap_pixels` converts so that Mitsuba's bilinear look-up equals ours. Mitsuba never opens a file: it gets arrays.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np

from relume.errors import UnsupportedScene, warn
from relume.light.reflection.convolution import as_latlong
from relume.renderers.mitsuba.arrays import rgb, triangles
from relume.renderers.mitsuba.distant import distant_shape, require_inside
from relume.renderers.mitsuba.enclosing import lamp_in_a_body
from relume.renderers.mitsuba.materials import NARROW, SMOOTH, bsdf, crossed_straight, emission, interior
from relume.renderers.raytrace.alpha_coverage import is_pierced
from relume.scene.cameras.camera import Camera
from relume.scene.lights import AmbientLight, DistantLight, Light, PointLight, RectangleLight, SphereLight, SquareLaw
from relume.scene.materials.materials import Diffuse, Material, Ward
from relume.scene.materials.reflective import Reflective
from relume.scene.materials.whitted import WhittedMaterial
from relume.scene.scene import Infinite, Scene
from relume.scene.shapes.shapes import AnyMaterial, Patches, Plane, Polygon, Shape, Sphere
from relume.scene.shapes.tessellation import tessellated, triangulated
from relume.sphere.bilinear_kernels import padded
from relume.sphere.environment_map import EnvironmentMap

FAR = 1e5
"""Metres: nothing farther is drawn, and a lens whose focus is farther is in focus there."""


def scene_dictionary(mi: Any, scene: Scene, camera: Camera, *, media: bool = False) -> dict[str, Any]:
    """The whole scene, lit, as seen by the camera.

    media : fill bodies with what their materials are filled with, for an integrator that goes through it
    """
    if (reason := why_not(scene)) is not None:
        raise UnsupportedScene(reason)
    dictionary = surfaces_dictionary(mi, scene, camera, media=media)
    require_inside(scene.distant, scene.probe, scene.objects)
    # Of a black map no direction is likelier than another, and it adds nothing to other lights.
    if np.any(scene.light.radiance) or not scene.lights:
        if isinstance(scene.distant, Infinite):
            dictionary["light"] = {"type": "envmap", "bitmap": mi.Bitmap(envmap_pixels(scene.light)), "scale": 1.0}
        else:
            dictionary["light"] = distant_shape(mi, scene)
    for index, light in enumerate(scene.lights):
        dictionary[f"light_{index:04d}"] = _light(mi, light)
    return dictionary


def surfaces_dictionary(mi: Any, scene: Scene, camera: Camera, *, media: bool = False) -> dict[str, Any]:
    """Its surfaces without any light: for depth, normals and albedo, which the distant scene has none of."""
    dictionary: dict[str, Any] = {"type": "scene", "sensor": sensor(mi, camera)}
    for index, shape in enumerate((*scene.local, *scene.objects)):
        material = material_on(shape)
        surface, inside = bsdf(mi, material, media=media), interior(material) if media else None
        dictionary[f"shape_{index:04d}"] = _shape(mi, shape, surface, emission(mi, material), inside)
    return dictionary


def why_not(scene: Scene) -> str | None:
    """What Mitsuba cannot render of a scene, in one line with the remedy; None where it can render all."""
    for light in scene.lights:
        if isinstance(light, AmbientLight):
            return (
                "Mitsuba has no ambient light, which nothing shadows; use rl.Whitted (--renderer whitted), or an even "
                "light map, as light.colour makes it"
            )
        if isinstance(light, PointLight) and not isinstance(light.falloff, SquareLaw):
            return (
                "Mitsuba's points of light fall with the square of the distance, and one of the scene's does not; "
                "use rl.Whitted (--renderer whitted), or the square law"
            )
    for shape in (*scene.local, *scene.objects):
        if isinstance(shape.material, WhittedMaterial):
            return (
                f"Mitsuba cannot shade the whitted material {shape.material.name!r}; "
                "use rl.Whitted (--renderer whitted), or a diffuse or pbr material"
            )
        if isinstance(shape.material, Reflective):
            return (
                f"Mitsuba cannot shade the reflection maps of {shape.material.name or 'a Reflective surface'!r}; "
                "use rl.Prefiltered (renderer prefiltered), or a diffuse or pbr material"
            )
    return lamp_in_a_body(scene.lights, (*scene.local, *scene.objects))


def material_on(shape: Shape) -> AnyMaterial:
    """A shape's material as Mitsuba's coordinates have it: its sphere's go round the other way than a lat-long map."""
    material = shape.material
    if not isinstance(shape, Sphere) or not isinstance(material, Material | Diffuse | Ward):
        return material
    turned = {
        field.name: np.ascontiguousarray(value[:, ::-1])
        for field in fields(material)
        if isinstance(value := getattr(material, field.name), np.ndarray) and value.ndim > 1
    }
    if "normal" in turned:
        turned["normal"] *= np.array([-1, 1, 1], turned["normal"].dtype)
    return replace(material, **turned) if turned else material


def warn_of_holes(scene: Scene, senders: int) -> None:
    """Warn of light of lamps without a size that is bent or mirrored beside surfaces with holes: none is followed.

    senders : shapes that send light on in one direction, which one with holes does too, straight on
    """
    materials = [shape.material for shape in (*scene.local, *scene.objects)]
    pierced = [each for each in materials if isinstance(each, Material) and is_pierced(each)]
    bends = senders > len(pierced) or any(np.any(each.through) or np.any(each.metallic) for each in pierced)
    if pierced and bends and any(isinstance(light, PointLight | DistantLight) for light in scene.lights):
        warn(
            f"material {pierced[0].name!r} has holes: beside them light of points and suns does "
            "not go through glass and off mirrors; that of lamps with a size (spheres, rectangles) does"
        )


def warn_of_specks(scene: Scene) -> None:
    """Warn of a body that scatters light within a surface of little roughness, under lamps without a size.

    Into a smooth one light is followed from the lamps. Out of a rough one paths find them by chance, and few of them.
    """
    if not any(isinstance(light, PointLight | DistantLight) for light in scene.lights):
        return
    for shape in (*scene.local, *scene.objects):
        material = shape.material
        if not isinstance(material, Material) or material.medium is None or crossed_straight(material) is not None:
            continue
        if any(material.medium.scattering) and SMOOTH < np.mean(np.asarray(material.roughness)) < NARROW:
            warn(
                f"material {material.name!r} scatters light below a surface of little roughness: that of points and "
                f"suns is found through it by chance, in white specks; use a roughness of at most {SMOOTH:g} or of "
                f"{NARROW:g} and more, or lamps with a size (spheres, rectangles)"
            )
            return


def matte_dictionary(mi: Any, scene: Scene, camera: Camera) -> dict[str, Any]:
    """The paper's mask image (§5.2) as albedo: objects white, real surfaces black; its mean is the coverage."""
    dictionary: dict[str, Any] = {"type": "scene", "sensor": sensor(mi, camera)}
    for index, shape in enumerate((*scene.local, *scene.objects)):
        white = index >= len(scene.local)
        paint = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": float(white)}}
        dictionary[f"shape_{index:04d}"] = _shape(mi, shape, paint)
    return dictionary


def sensor(mi: Any, camera: Camera) -> dict[str, Any]:
    """Mitsuba's camera looks along +Z with +X to its left: ours, turned half a turn about +Y.

    Raises UnsupportedScene for a distorting lens, a rolling shutter, and for an aperture whose axis
    does not meet the picture's middle.
    """
    if camera.distortion is not None:
        raise UnsupportedScene(
            "Mitsuba's cameras have no lens distortion; install LLVM 16 or newer for ours, or use rl.scene.undistorted"
        )
    if camera.rolling is not None:
        raise UnsupportedScene("Mitsuba's cameras have no rolling shutter; install LLVM 16 or newer for ours")
    across, down = 0.5 - np.array(camera.principal_point) / [camera.width, camera.height]
    if camera.aperture > 0 and max(abs(across), abs(down)) > 1e-9:
        raise UnsupportedScene(
            "Mitsuba's thin lens stands before the picture's middle, and this one's principal point is elsewhere; "
            "install LLVM 16 or newer for ours, or use an aperture of 0"
        )
    pose = np.eye(4)
    pose[:3, :3] = camera.rotation @ np.diag([-1.0, 1.0, -1.0])
    pose[:3, 3] = camera.position
    lens: dict[str, Any] = {
        "type": "perspective",
        "principal_point_offset_x": float(across),
        "principal_point_offset_y": float(down),
    }
    if camera.aperture > 0:
        lens = {"type": "thinlens", "aperture_radius": camera.aperture, "focus_distance": float(min(camera.focus, FAR))}
    return lens | {
        "fov": float(np.degrees(2 * np.arctan(camera.width / 2 / camera.focal_length))),
        "fov_axis": "x",
        "near_clip": 1e-3,
        "far_clip": FAR,
        "to_world": mi.ScalarTransform4f(pose),
        # The box filter keeps every sample in its pixel, so that sums do not depend on the order of threads.
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
        "sampler": {"type": "independent"},
    }


def envmap_pixels(light: EnvironmentMap) -> np.ndarray:
    """Pixels of Mitsuba's envmap (2·size + 1, 2·size, 3) that look up the same light as `light.lookup`.

    Twice the rows: the odd ones stand at our pixel centres, the even ones half-way, at the means of their
    neighbours, where bilinear interpolation would be anyway; the first and last are the poles.
    """
    # A row more at each pole is the other side's.
    tall = padded(as_latlong(light).radiance)[:, 1:-1, :3]
    rows = np.empty((2 * len(tall) - 3, *tall.shape[1:]), np.float32)
    rows[1::2] = tall[1:-1]
    rows[0::2] = 0.5 * (tall[:-1] + tall[1:])
    # Mitsuba's left edge looks along −Z, which is our middle.
    return np.ascontiguousarray(np.roll(rows, tall.shape[1] // 2, axis=1))


def _light(mi: Any, light: Light) -> dict[str, Any]:
    """A light that `why_not` has nothing against."""
    assert not isinstance(light, AmbientLight)
    if isinstance(light, PointLight):
        return {"type": "point", "position": list(light.position), "intensity": rgb(light.intensity)}
    if isinstance(light, SphereLight):
        # A shape, but of the light: the planes of surfaces do not show it, and other light passes it.
        glow = {"type": "area", "radiance": rgb(light.radiance)}
        parts = {"emitter": glow, "bsdf": {"type": "null"}}
        return {"type": "sphere", "center": list(light.position), "radius": light.radius} | parts
    if isinstance(light, RectangleLight):
        pose = np.eye(4)
        # Mitsuba's rectangle spans ±1 in x and y and faces +Z.
        pose[:3, :3] = light.frame * [light.size[0] / 2, light.size[1] / 2, 1]
        pose[:3, 3] = light.position
        parts = {"emitter": {"type": "area", "radiance": rgb(light.radiance)}, "bsdf": {"type": "null"}}
        return {"type": "rectangle", "to_world": mi.ScalarTransform4f(pose)} | parts
    # Mitsuba's direction is the light's way; ours points towards where it comes from.
    way = [-float(part) for part in light.towards]
    return {"type": "directional", "direction": way, "irradiance": rgb(light.irradiance)}


def _shape(
    mi: Any,
    shape: Shape,
    bsdf: dict[str, Any],
    emitter: dict[str, Any] | None = None,
    interior: dict[str, Any] | None = None,
) -> Any:
    parts = {"bsdf": bsdf, "emitter": emitter, "interior": interior}
    parts = {name: words for name, words in parts.items() if words is not None}
    if isinstance(shape, Plane):
        x, z = shape.extent
        pose = np.eye(4)
        # Mitsuba's rectangle spans ±1 in x and y and faces +Z; ours lies down and faces up.
        pose[:3, :3] = np.array([[x / 2, 0, 0], [0, 0, 1], [0, -z / 2, 0]])
        pose[1, 3] = shape.height
        return {"type": "rectangle", "to_world": mi.ScalarTransform4f(pose)} | parts
    if isinstance(shape, Sphere):
        # Mitsuba's own sphere has its texture's poles on the z axis; ours stand up.
        upright = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = shape.radius * upright, shape.centre
        return {"type": "sphere", "to_world": mi.ScalarTransform4f(pose)} | parts
    if isinstance(shape, Patches):
        shape = tessellated(shape)
    elif isinstance(shape, Polygon):
        shape = triangulated(shape)
    # Mitsuba's images begin with the upper row at v = 0; ours have the lower left corner at (0, 0).
    return triangles(mi, shape if shape.uv is None else replace(shape, uv=shape.uv * [1, -1] + [0, 1]), parts)

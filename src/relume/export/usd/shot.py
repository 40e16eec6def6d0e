"""The shot as a USD layer: camera, surfaces with UsdPreviewSurface materials, and the light as `light.exports.usd`."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from relume.export.lamps import figure, figures
from relume.export.parts import Part, parts_of
from relume.export.shot_lamps import light_of, undistorted, write_pictures
from relume.export.usd import lights
from relume.export.usd.surfaces import mesh_of_part, mesh_with_material, shader_network
from relume.project.insertion.prepared import PreparedShot
from relume.renderers.mitsuba.distant import walls
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material, is_image
from relume.scene.shapes.shapes import Mesh

USE = """shot.usda refers to light.usda (lights, dome) and to the images. What USD has no words for is in attributes of
its own:
    relume:shadowCatcher       bool, on real surfaces: show what the objects change of them, not themselves
    relume:hiddenFromCamera    bool, on the walls of the distant scene: they give light and are not seen
    relume:plate, relume:photograph    assets, on the camera: the plate, scene-linear and developed"""

CATCHER = "bool relume:shadowCatcher = 1"
SENSOR = 0.36
"""Horizontal aperture: 36 mm in tenths of the stage's unit, as UsdGeomCamera wants it."""


def write(value: PreparedShot, folder: Path) -> tuple[str, ...]:
    """Write the files; what USD does not hold."""
    value, notes = undistorted(value)
    parts, lost = parts_of(value.scene)
    light, lamps = light_of(value)
    write_pictures(value, folder, light)
    (folder / "light.usda").write_text(lights.text(lamps), encoding="utf-8")
    groups = [
        ("Real", [mesh_of_part("Shot/Real", part, folder, CATCHER) for part in parts if part.real]),
        ("Objects", [mesh_of_part("Shot/Objects", part, folder) for part in parts if not part.real]),
    ]
    if lamps.background is None:
        groups.append(("Distant", [_walls(value)]))
        notes = (
            *notes,
            "the distant scene's walls are a mesh that emits by its material: rasterisers show it and light nothing by "
            "it, and no program hides it from the camera by itself",
        )
    body = "".join(f'    def Xform "{name}"\n    {{\n{"".join(found)}    }}\n' for name, found in groups if found)
    text = (
        "#usda 1.0\n(\n"
        '    defaultPrim = "Shot"\n'
        '    doc = "A shot written by relume: camera of the plate, light, real surfaces and objects."\n'
        '    metersPerUnit = 1\n    upAxis = "Y"\n)\n\n'
        'def Xform "Shot"\n{\n'
        f"{_camera(value.camera)}"
        '    def "Light" (\n        prepend references = @./light.usda@\n    )\n    {\n    }\n'
        f"{body}}}\n"
    )
    (folder / "shot.usda").write_text(text, encoding="utf-8")
    return (*notes, *lost, *_lost([part for part in parts if not part.real]))


def _camera(camera: Camera) -> str:
    x, y = camera.principal_point
    pixel = SENSOR / camera.width
    pose = np.eye(4)
    # USD multiplies rows from the left: the camera's axes are rows, its place the last.
    pose[:3, :3], pose[3, :3] = np.asarray(camera.rotation).T, camera.position
    rows = ", ".join(f"({figures(tuple(map(float, row)), ', ')})" for row in pose)
    lens = pixel * camera.focal_length
    focus = ""
    if camera.aperture:
        # The f-number is of lengths in one unit; the lens is in tenths of a metre here.
        focus = (
            f"        float fStop = {figure(float(lens / 10 / (2 * camera.aperture)))}\n"
            f"        float focusDistance = {figure(float(min(camera.focus, 1e6)))}\n"
        )
    return f"""    def Camera "Camera"
    {{
        float2 clippingRange = (0.01, 10000)
        float focalLength = {figure(float(lens))}
        float horizontalAperture = {figure(SENSOR)}
        float horizontalApertureOffset = {figure(float((camera.width / 2 - x) * pixel))}
        token projection = "perspective"
        float verticalAperture = {figure(float(pixel * camera.height))}
        float verticalApertureOffset = {figure(float((y - camera.height / 2) * pixel))}
{focus}        custom asset relume:photograph = @./plate.png@
        custom asset relume:plate = @./plate.exr@
        custom int2 relume:resolution = ({camera.width}, {camera.height})
        matrix4d xformOp:transform = ( {rows} )
        uniform token[] xformOpOrder = ["xformOp:transform"]
    }}
"""


def _walls(value: PreparedShot) -> str:
    built = walls(value.scene.distant, value.scene.probe)
    uv = (built.uv * [1, -1] + [0, 1]).astype(np.float32)
    mesh = Mesh(built.vertices, built.faces, Diffuse((0.0, 0.0, 0.0)), None, uv)
    black = [("color3f", "diffuseColor", (0.0, 0.0, 0.0)), ("int", "useSpecularWorkflow", 1)]
    black += [("color3f", "specularColor", (0.0, 0.0, 0.0))]
    material = shader_network(black, [("color3f", "emissiveColor", "light.exr")])
    return mesh_with_material("Shot/Distant", "walls", mesh, "bool relume:hiddenFromCamera = 1", material)


def _lost(added: list[Part]) -> tuple[str, ...]:
    """What UsdPreviewSurface has no input for."""
    notes = []
    for part in added:
        material = part.material
        if not isinstance(material, Material):
            continue
        there = {
            "transmission (written as opacity, which does not bend light)": np.any(material.through),
            "attenuation": np.isfinite(material.attenuation_distance) and np.any(material.through),
            "sheen": np.any(material.sheen_color),
            "anisotropy": material.anisotropy != 0,
            "specular weight and colour": np.any(np.asarray(material.specular) != 1)
            or np.any(np.asarray(material.specular_color) != 1),
            "images of transmission (their mean)": is_image(material.transmission),
        }
        missing = [name for name, is_there in there.items() if is_there]
        if missing:
            notes.append(f"{part.name}: UsdPreviewSurface has no {', '.join(missing)}")
    return tuple(notes)

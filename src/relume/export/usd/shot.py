"""The shot as a USD layer: camera, surfaces with UsdPreviewSurface materials, and the light as `light.exports.usd`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from relume.export.lamps import figure, figures
from relume.export.parts import Part, base_colour, parts_of
from relume.export.shot_lamps import light_of, undistorted, write_pictures
from relume.export.usd import lights
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.project.insertion.prepared import PreparedShot
from relume.renderers.mitsuba.distant import walls
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material, is_image, mean_number
from relume.scene.shapes.shapes import Mesh

USE = """shot.usda refers to light.usda (lights, dome) and to the images. What USD has no words for is in attributes of
its own:
    relume:shadowCatcher       bool, on real surfaces: show what the objects change of them, not themselves
    relume:hiddenFromCamera    bool, on the walls of the distant scene: they give light and are not seen
    relume:plate, relume:photograph    assets, on the camera: the plate, scene-linear and developed"""

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
        ("Real", [_mesh("Real", part, folder, "bool relume:shadowCatcher = 1") for part in parts if part.real]),
        ("Objects", [_mesh("Objects", part, folder) for part in parts if not part.real]),
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


def _written(values: Any, folder: Path, name: str) -> str:
    """The file of an image (H, W) or (H, W, 3), linear and in full precision."""
    array = np.asarray(values, np.float32)
    array = array if array.ndim == 3 else np.repeat(array[..., None], 3, axis=-1)
    files.write(folder / f"{name}.exr", RadianceMap(np.ascontiguousarray(array)))
    return f"{name}.exr"


def _mesh(group: str, part: Part, folder: Path, own: str | None = None) -> str:
    return _geometry(group, part.name, part.mesh, own, _material(part, folder))


def _geometry(group: str, name: str, mesh: Mesh, own: str | None, material: str) -> str:
    lines = [
        "uniform bool doubleSided = 1",
        f"float3[] extent = [({_row(mesh.vertices.min(axis=0))}), ({_row(mesh.vertices.max(axis=0))})]",
        f"int[] faceVertexCounts = [{', '.join(['3'] * len(mesh.faces))}]",
        f"int[] faceVertexIndices = [{', '.join(map(str, mesh.faces.ravel().tolist()))}]",
        f"rel material:binding = </Shot/{group}/{name}/Material>",
        f"point3f[] points = [{_rows(mesh.vertices)}]",
    ]
    if mesh.normals is not None:
        lines.append(f'normal3f[] normals = [{_rows(mesh.normals)}] (\n            interpolation = "vertex"\n        )')
    if mesh.uv is not None:
        lines.append(
            f'texCoord2f[] primvars:st = [{_rows(mesh.uv)}] (\n            interpolation = "vertex"\n        )'
        )
    lines.append('uniform token subdivisionScheme = "none"')
    if own is not None:
        lines.append(f"custom {own}")
    body = "".join(f"            {line}\n" for line in lines)
    return (
        f'        def Mesh "{name}" (\n            prepend apiSchemas = ["MaterialBindingAPI"]\n        )\n        {{\n'
        f"{body}{material.replace('{path}', f'/Shot/{group}/{name}/Material')}        }}\n"
    )


def _material(part: Part, folder: Path) -> str:
    material, name = part.material, part.name
    inputs: list[tuple[str, str, Any]] = [("color3f", "diffuseColor", base_colour(material))]
    if isinstance(material, Diffuse):
        # No specular part: a Lambert surface.
        inputs += [("int", "useSpecularWorkflow", 1), ("color3f", "specularColor", (0.0, 0.0, 0.0))]
        inputs += [("float", "roughness", 1.0)]
    else:
        inputs += [
            ("float", "metallic", material.metallic),
            ("float", "roughness", material.roughness),
            ("float", "ior", material.ior),
        ]
        opacity = np.asarray(material.alpha) * (1 - np.mean(material.through))
        if np.any(opacity != 1):
            inputs.append(("float", "opacity", opacity))
        if np.any(material.clearcoat):
            inputs.append(("float", "clearcoat", material.clearcoat))
            inputs.append(("float", "clearcoatRoughness", material.clearcoat_roughness))
        if material.emits:
            inputs.append(("color3f", "emissiveColor", material.emission))
        if material.normal is not None:
            inputs.append(("normal3f", "normal", np.asarray(material.normal)))
    textures = [(kind, key, _written(value, folder, f"{name}_{key}")) for kind, key, value in inputs if is_image(value)]
    return _network([each for each in inputs if not is_image(each[2])], textures)


def _network(inputs: list[tuple[str, str, Any]], textures: list[tuple[str, str, str]]) -> str:
    """A material: its surface, and for images a texture each that reads the mesh's st."""
    lines = [f"{kind} inputs:{key} = {_value(value)}" for kind, key, value in inputs]
    lines += [
        f"{kind} inputs:{key}.connect = <{{path}}/{key}.outputs:{'r' if kind == 'float' else 'rgb'}>"
        for kind, key, _ in textures
    ]
    surface = "".join(f"                    {line}\n" for line in lines)
    shaders = "".join(
        f"""                def Shader "{key}"
                {{
                    uniform token info:id = "UsdUVTexture"
                    asset inputs:file = @./{file}@
                    token inputs:sourceColorSpace = "raw"
                    float2 inputs:st.connect = <{{path}}/st.outputs:result>
                    token inputs:wrapS = "repeat"
                    token inputs:wrapT = "repeat"
                    {"float outputs:r" if kind == "float" else "float3 outputs:rgb"}
                }}
"""
        for kind, key, file in textures
    )
    if textures:
        shaders += """                def Shader "st"
                {
                    uniform token info:id = "UsdPrimvarReader_float2"
                    string inputs:varname = "st"
                    float2 outputs:result
                }
"""
    return f"""            def Material "Material"
            {{
                token outputs:surface.connect = <{{path}}/Surface.outputs:surface>
                def Shader "Surface"
                {{
                    uniform token info:id = "UsdPreviewSurface"
{surface}                    token outputs:surface
                }}
{shaders}            }}
"""


def _walls(value: PreparedShot) -> str:
    built = walls(value.scene.distant, value.scene.probe)
    uv = (built.uv * [1, -1] + [0, 1]).astype(np.float32)
    mesh = Mesh(built.vertices, built.faces, Diffuse((0.0, 0.0, 0.0)), None, uv)
    black = [("color3f", "diffuseColor", (0.0, 0.0, 0.0)), ("int", "useSpecularWorkflow", 1)]
    black += [("color3f", "specularColor", (0.0, 0.0, 0.0))]
    material = _network(black, [("color3f", "emissiveColor", "light.exr")])
    return _geometry("Distant", "walls", mesh, "bool relume:hiddenFromCamera = 1", material)


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


def _value(value: Any) -> str:
    if np.ndim(value):
        return f"({figures(tuple(map(float, value)), ', ')})"
    return str(value) if isinstance(value, int) else figure(mean_number(value))


def _row(values: np.ndarray) -> str:
    return figures(values.tolist(), ", ")


def _rows(values: np.ndarray) -> str:
    return ", ".join(f"({_row(row)})" for row in values)

"""Surfaces in USD's words: meshes with UsdPreviewSurface materials, whose images are EXR files beside the layer."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from relume.export.lamps import figure, figures
from relume.export.parts import Part, base_colour
from relume.image import files
from relume.image.radiance import RadianceMap
from relume.scene.materials.materials import Diffuse, is_image, mean_number
from relume.scene.shapes.shapes import Mesh


def written_image(values: Any, folder: Path, name: str) -> str:
    """The file of an image (H, W) or (H, W, 3), linear and in full precision."""
    array = np.asarray(values, np.float32)
    array = array if array.ndim == 3 else np.repeat(array[..., None], 3, axis=-1)
    files.write(folder / f"{name}.exr", RadianceMap(np.ascontiguousarray(array)))
    return f"{name}.exr"


def mesh_of_part(
    group: str, part: Part, folder: Path, own: str | None = None, *, images: Mapping[str, str] = {}
) -> str:
    """A part below the prim /`group`, its images written into the folder; `own` is an attribute of its own.

    images : by the name of a part, the file that holds its emission already
    """
    return mesh_with_material(group, part.name, part.mesh, own, material_of(part, folder, images))


def mesh_with_material(group: str, name: str, mesh: Mesh, own: str | None, material: str) -> str:
    """A mesh below the prim /`group`, such as Shot/Real, and the words of its material."""
    lines = [
        "uniform bool doubleSided = 1",
        f"float3[] extent = [({_row(mesh.vertices.min(axis=0))}), ({_row(mesh.vertices.max(axis=0))})]",
        f"int[] faceVertexCounts = [{', '.join(['3'] * len(mesh.faces))}]",
        f"int[] faceVertexIndices = [{', '.join(map(str, mesh.faces.ravel().tolist()))}]",
        f"rel material:binding = </{group}/{name}/Material>",
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
        f"{body}{material.replace('{path}', f'/{group}/{name}/Material')}        }}\n"
    )


def material_of(part: Part, folder: Path, images: Mapping[str, str] = {}) -> str:
    """The material of a part, its images written into the folder but for an emission that `images` names a file of."""
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
    emission = images.get(name)
    textures = [
        (kind, key, emission if emission and key == "emissiveColor" else written_image(value, folder, f"{name}_{key}"))
        for kind, key, value in inputs
        if is_image(value)
    ]
    return shader_network([each for each in inputs if not is_image(each[2])], textures)


def shader_network(inputs: list[tuple[str, str, Any]], textures: list[tuple[str, str, str]]) -> str:
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


def _value(value: Any) -> str:
    if np.ndim(value):
        return f"({figures(tuple(map(float, value)), ', ')})"
    return str(value) if isinstance(value, int) else figure(mean_number(value))


def _row(values: np.ndarray) -> str:
    return figures(values.tolist(), ", ")


def _rows(values: np.ndarray) -> str:
    return ", ".join(f"({_row(row)})" for row in values)

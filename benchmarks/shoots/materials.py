"""Blender's materials for a virtual shoot, and images for them. Radiance 1.0 is 100 cd/m²."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

bpy: Any = import_module("bpy")

Triple = tuple[float, float, float]


def _nodes(name: str) -> tuple[Any, Any, Any]:
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    return material, nodes, links


def glow(name: str, radiance: Triple, *, sampled: bool = True) -> Any:
    """What shines alike in all directions; not `sampled`, paths find it by chance alone."""
    material, nodes, links = _nodes(name)
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    strength = max(radiance) or 1.0
    emission.inputs["Color"].default_value = [*(c / strength for c in radiance), 1.0]
    emission.inputs["Strength"].default_value = strength
    links.new(emission.outputs[0], output.inputs["Surface"])
    material.cycles.emission_sampling = "AUTO" if sampled else "NONE"
    return material


def painted(name: str, radiance: np.ndarray) -> Any:
    """A surface that shines as the picture of its radiance (H, W, 3) says, row 0 on top, and reflects nothing.

    Paths find it by chance alone: it is smooth and all around.
    """
    height, width = radiance.shape[:2]
    picture = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True)
    picture.colorspace_settings.name = "Non-Color"
    full = np.ones((height, width, 4), np.float32)
    full[..., :3] = radiance
    picture.pixels.foreach_set(full[::-1].ravel())
    picture.pack()
    material, nodes, links = _nodes(name)
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    links.new(_texture(nodes, picture).outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs[0], output.inputs["Surface"])
    material.cycles.emission_sampling = "NONE"
    return material


def principled(
    name: str, base: Triple | Any, *, metallic: float = 0.0, roughness: float | Any = 0.5, ior: float = 1.5,
    transmission: float = 0.0, specular: float = 0.5, absorption: tuple[Triple, float] | None = None,
) -> Any:  # fmt: skip
    """Blender's Principled BSDF, with images in place of numbers where given.

    base, roughness : a value, or an image (`image`); an image of roughness holds it in green and metallic in blue
    absorption : what is left of light after a distance in metres, (colour, distance), inside of a clear body
    """
    material, nodes, links = _nodes(name)
    shader, output = nodes.new("ShaderNodeBsdfPrincipled"), nodes.new("ShaderNodeOutputMaterial")
    shader.distribution = "GGX"
    for key, value in (("Metallic", metallic), ("IOR", ior), ("Transmission Weight", transmission),
                       ("Specular IOR Level", specular)):  # fmt: skip
        shader.inputs[key].default_value = value
    if isinstance(base, tuple):
        shader.inputs["Base Color"].default_value = [*base, 1.0]
    else:
        links.new(_texture(nodes, base).outputs["Color"], shader.inputs["Base Color"])
    if isinstance(roughness, float):
        shader.inputs["Roughness"].default_value = roughness
    else:
        parts = nodes.new("ShaderNodeSeparateColor")
        links.new(_texture(nodes, roughness).outputs["Color"], parts.inputs[0])
        links.new(parts.outputs["Green"], shader.inputs["Roughness"])
        links.new(parts.outputs["Blue"], shader.inputs["Metallic"])
    links.new(shader.outputs[0], output.inputs["Surface"])
    if absorption is not None:
        # Blender leaves exp(−density · (1 − colour) · d), and colour must not be negative.
        left, distance = absorption
        depth = -np.log(left)
        volume = nodes.new("ShaderNodeVolumeAbsorption")
        volume.inputs["Color"].default_value = [*(1 - depth / depth.max()), 1.0]
        volume.inputs["Density"].default_value = depth.max() / distance
        links.new(volume.outputs[0], output.inputs["Volume"])
    return material


def _texture(nodes: Any, pixels: Any) -> Any:
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = pixels
    return texture


def image(name: str, pixels: np.ndarray, *, colour: bool = True) -> Any:
    """An 8-bit image; `pixels` (H, W, 3) from 0 to 1, row 0 on top, encoded as sRGB where they are colours."""
    height, width = pixels.shape[:2]
    made = bpy.data.images.new(name, width, height, alpha=False)
    made.colorspace_settings.name = "sRGB" if colour else "Non-Color"
    full = np.ones((height, width, 4), np.float32)
    full[..., :3] = pixels
    made.pixels.foreach_set(full[::-1].ravel())
    made.pack()
    return made

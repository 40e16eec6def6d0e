"""Two sets of things to insert, as Blender's objects and as glTF files with the same meshes and materials.

`glossy_set`: mirror, grey, clear glass, rough gold, plastic, as in the room. `crafted_set`: what that has none of: an
image of marble, streaks of brushed steel in an image of roughness, glaze, glass that is green by depth, matte clay.
"""

from __future__ import annotations

import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
from blender import cylinder, mesh, sphere
from materials import Triple, bpy, image, principled

GREEN = ((0.25, 0.75, 0.45), 0.05)
"""What the green glass leaves of light after so many metres."""

Spot = tuple[float, float, float]
"""x, y on the ground and the turn about z in degrees."""


def _clouds(shape: tuple[int, int], slope: float, seed: int) -> np.ndarray:
    """Noise whose spectrum falls with `slope`, deviation 1; its edges meet."""
    generator = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(shape[0])[:, None] * shape[0], np.fft.rfftfreq(shape[1]) * shape[1])
    spectrum = np.fft.rfft2(generator.normal(size=shape)) / np.maximum(frequency, 1.0) ** slope
    spectrum[0, 0] = 0
    made = np.fft.irfft2(spectrum, shape)
    return made / made.std()


def marble() -> Any:
    """White stone with grey veins."""
    vein = np.exp(-np.abs(_clouds((256, 512), 1.7, 3)) * 6)[..., None]
    shade = 0.04 * _clouds((256, 512), 1.5, 4)[..., None]
    return image("marble", np.clip(np.array([0.88, 0.86, 0.82]) + shade - vein * [0.45, 0.42, 0.36], 0, 1))


def brushed() -> Any:
    """Roughness in green, metallic in blue: streaks along the image's width."""
    streaks = np.repeat(np.random.default_rng(5).normal(size=(256, 4)), 64, axis=1)
    roughness = np.clip(0.32 + 0.05 * streaks, 0.2, 0.5)
    return image("brushed", np.stack([np.ones_like(roughness), roughness, np.ones_like(roughness)], -1), colour=False)


def clay() -> Any:
    """Terracotta with darker bands."""
    band = 0.06 * np.sin(np.linspace(0, 30, 256))[:, None, None] + 0.03 * _clouds((256, 256), 1.0, 6)[..., None]
    return image("clay", np.clip(np.array([0.78, 0.48, 0.34]) + band, 0, 1))


def _lathe(name: str, profile: list[tuple[float, float]], material: Any, at: Triple) -> Any:
    """A closed body turned about z: radius and height from the bottom to the top, the first and the last at radius 0.

    The profile is refined by Catmull and Rom's spline, so that highlights run smoothly.
    """
    points = np.array([profile[0], *profile, profile[-1]], float)
    t = np.linspace(0, 1, 12, endpoint=False)[:, None]
    pieces = []
    for a, b, c, d in zip(points, points[1:], points[2:], points[3:], strict=False):
        pieces.append(0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3))
    line = np.concatenate(pieces)[1:]
    around = 128
    turn = 2 * math.pi * np.arange(around) / around
    rings = np.stack(
        [line[:, None, 0] * np.cos(turn), line[:, None, 0] * np.sin(turn), line[:, None, 1] + 0 * turn], axis=-1
    )
    vertices = [(0.0, 0.0, profile[0][1]), *rings.reshape(-1, 3), (0.0, 0.0, profile[-1][1])]
    last, faces = len(vertices) - 1, []
    for i in range(around):
        j = (i + 1) % around
        faces.append((0, 1 + j, 1 + i))
        for ring in range(len(line) - 1):
            low, high = 1 + ring * around, 1 + (ring + 1) * around
            faces.append((low + i, low + j, high + j, high + i))
        faces.append((last, last - around + i, last - around + j))
    made = mesh(name, vertices, faces, material)
    made.data.shade_smooth()
    made.location = at
    return made


def _cube(name: str, centre: Triple, side: float, turn: float, material: Any) -> Any:
    """A cube with rounded edges and an image on each face."""
    bpy.ops.mesh.primitive_cube_add(size=side, location=centre, rotation=(0, 0, math.radians(turn)))
    made = bpy.context.object
    made.name = made.data.name = name
    made.data.materials.append(material)
    bevel = made.modifiers.new("bevel", "BEVEL")
    bevel.width, bevel.segments = side * 0.04, 3
    bpy.ops.object.modifier_apply(modifier="bevel")
    bpy.ops.object.shade_smooth_by_angle(angle=math.radians(35))
    return made


def glossy_set(places: dict[str, Spot]) -> list[Any]:
    """Those of the room, wherever `places` puts them."""
    made = []
    for name, (x, y, turn) in places.items():
        if name == "suzanne_plastic":
            bpy.ops.mesh.primitive_monkey_add(size=0.15, location=(x, y, 0.074), rotation=(-0.6, 0, math.radians(turn)))
            suzanne = bpy.context.object
            suzanne.name = suzanne.data.name = name
            suzanne.data.materials.append(principled("plastic", (0.05, 0.22, 0.5), roughness=0.3))
            smooth = suzanne.modifiers.new("smooth", "SUBSURF")
            smooth.levels = smooth.render_levels = 2
            bpy.ops.object.modifier_apply(modifier="smooth")
            bpy.ops.object.shade_smooth()
            bpy.context.view_layer.update()
            lowest = min((suzanne.matrix_world @ v.co).z for v in suzanne.data.vertices)
            suzanne.location.z += 0.0005 - lowest
            made.append(suzanne)
        elif name == "sphere_mirror":
            silver = principled("mirror", (0.95, 0.95, 0.95), metallic=1.0, roughness=0.0)
            made.append(sphere(name, (x, y, 0.06), 0.06, silver))
        elif name == "sphere_gray":
            grey = principled("gray", (0.5, 0.5, 0.5), roughness=1.0, specular=0.0)
            made.append(sphere(name, (x, y, 0.055), 0.055, grey))
        elif name == "sphere_glass":
            glass = principled("glass", (1.0, 1.0, 1.0), roughness=0.0, ior=1.5, transmission=1.0)
            made.append(sphere(name, (x, y, 0.05), 0.05, glass))
        elif name == "cube_gold":
            gold = principled("gold", (1.0, 0.72, 0.3), metallic=1.0, roughness=0.25)
            made.append(_cube(name, (x, y, 0.04), 0.08, turn, gold))
    return made


def crafted_set(places: dict[str, Spot], *, glaze: float = 0.1) -> list[Any]:
    """Marble ball, steel drum, glazed vase, green glass, clay cube: those that `places` names."""
    vase = [
        (0.0, 0.0), (0.03, 0.0), (0.036, 0.006), (0.05, 0.045), (0.047, 0.08), (0.026, 0.115), (0.022, 0.135),
        (0.03, 0.15), (0.026, 0.152), (0.0, 0.152),
    ]  # fmt: skip
    pebble = [(0.0, 0.0), (0.025, 0.002), (0.045, 0.018), (0.05, 0.035), (0.04, 0.056), (0.022, 0.069), (0.0, 0.072)]
    made = []
    for name, (x, y, turn) in places.items():
        if name == "sphere_marble":
            made.append(sphere(name, (x, y, 0.055), 0.055, principled("marble", marble(), roughness=0.35)))
        elif name == "drum_steel":
            steel = principled("steel", (0.62, 0.6, 0.58), metallic=1.0, roughness=brushed())
            made.append(cylinder(name, (x, y, 0.045), 0.045, 0.09, steel))
        elif name == "vase_glazed":
            glazed = principled("glaze", (0.75, 0.8, 0.82), roughness=glaze)
            made.append(_lathe(name, vase, glazed, (x, y, 0.0005)))
        elif name == "pebble_green":
            glass = principled("green", (1.0, 1.0, 1.0), roughness=0.0, ior=1.5, transmission=1.0, absorption=GREEN)
            made.append(_lathe(name, pebble, glass, (x, y, 0.0005)))
        elif name == "cube_clay":
            made.append(_cube(name, (x, y, 0.035), 0.07, turn, principled("clay", clay(), roughness=0.9)))
    return made


def write_glb(thing: Any, path: Path) -> None:
    """The object alone, in its own place, +Y up."""
    bpy.ops.object.select_all(action="DESELECT")
    thing.select_set(True)
    bpy.ops.export_scene.gltf(
        filepath=str(path), export_format="GLB", use_selection=True, export_yup=True, export_apply=True
    )
    if thing.name == "pebble_green":
        _add_volume(path)


def _add_volume(path: Path) -> None:
    """KHR_materials_volume with Blender's absorption: its exporter writes the colour by another law."""
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    table = json.loads(data[20 : 20 + length])
    colour, distance = GREEN
    for material in table["materials"]:
        material["extensions"]["KHR_materials_volume"] = {
            "thicknessFactor": 0.1, "attenuationColor": list(colour), "attenuationDistance": distance,
        }  # fmt: skip
    table["extensionsUsed"] = sorted({*table.get("extensionsUsed", []), "KHR_materials_volume"})
    text = json.dumps(table).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest)) + struct.pack("<I4s", len(text), b"JSON")
    path.write_bytes(head + text + rest)

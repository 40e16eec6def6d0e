"""The little of Blender that a virtual shoot needs: meshes, lamps, a camera, a render. Knows nothing of relume.

Blender's frame is Z up: (x, y, z) there is (x, z, −y) in relume's. Metres; radiance 1.0 is 100 cd/m².
"""

from __future__ import annotations

import math
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from materials import Triple, bpy

Vector: Any = import_module("mathutils").Vector


def empty() -> Any:
    """A scene without anything, traced by Cycles on the processor."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    return scene


# Shapes


def mesh(name: str, vertices: Any, faces: Any, material: Any, uv: Any = None) -> Any:
    """A mesh; `uv` a pair for each vertex."""
    data = bpy.data.meshes.new(name)
    data.from_pydata([tuple(map(float, v)) for v in vertices], [], [tuple(map(int, f)) for f in faces])
    if uv is not None:
        corners = np.array([loop.vertex_index for loop in data.loops])
        data.uv_layers.new(name="uv").data.foreach_set("uv", np.asarray(uv, np.float32)[corners].ravel())
    data.materials.append(material)
    data.update()
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def quad(name: str, centre: Triple, across: Triple, up: Triple, material: Any) -> Any:
    """A rectangle by its middle and its two full sides; it faces along across × up."""
    c, a, u = (np.array(v, float) for v in (centre, across, up))
    corners = [c - (a + u) / 2, c + (a - u) / 2, c + (a + u) / 2, c - (a - u) / 2]
    return mesh(name, corners, [(0, 1, 2, 3)], material, [(0, 0), (1, 0), (1, 1), (0, 1)])


def box(name: str, low: Triple, high: Triple, material: Any) -> Any:
    """A box along the axes."""
    x, y, z = zip(low, high, strict=True)
    corners = [(x[i], y[j], z[k]) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return mesh(name, corners, faces, material)


def sphere(name: str, centre: Triple, radius: float, material: Any, *, fine: int = 128) -> Any:
    """A ball with smooth normals; `fine` facets around."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=fine, ring_count=fine // 2, radius=radius, location=centre)
    return _finished(name, material)


def globe_light(name: str, centre: Triple, radius: float, radiance: Triple) -> Any:
    """A ball that shines, sampled as a ball; mirrors show it, cameras do not."""
    data = bpy.data.lights.new(name, "POINT")
    strength = max(radiance)
    # Cycles makes of P watts a ball of radiance P / (4π² r²).
    data.energy, data.color = 4 * math.pi**2 * radius**2 * strength, [c / strength for c in radiance]
    data.shadow_soft_size, data.use_soft_falloff = radius, False
    made = bpy.data.objects.new(name, data)
    made.location = centre
    bpy.context.scene.collection.objects.link(made)
    return made


def cylinder(name: str, centre: Triple, radius: float, height: float, material: Any) -> Any:
    bpy.ops.mesh.primitive_cylinder_add(vertices=128, radius=radius, depth=height, location=centre)
    return _finished(name, material, angle=math.radians(40))


def _finished(name: str, material: Any, angle: float = math.pi) -> Any:
    made = bpy.context.object
    made.name = made.data.name = name
    made.data.materials.clear()
    made.data.materials.append(material)
    bpy.ops.object.shade_smooth_by_angle(angle=angle)
    return made


# The picture


def camera(position: Triple, look_at: Triple, field_of_view: float, size: tuple[int, int]) -> Any:
    """The scene's camera, horizon level; `field_of_view` across, degrees, on a sensor 36 mm wide."""
    scene = bpy.context.scene
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.sensor_width, data.clip_start, data.clip_end = "HORIZONTAL", 36.0, 1e-3, 1e4
    data.lens = focal_length(field_of_view)
    made = bpy.data.objects.new("camera", data)
    made.location = position
    made.rotation_euler = (Vector(look_at) - Vector(position)).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(made)
    scene.camera = made
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    bpy.context.view_layer.update()
    return made


def focal_length(field_of_view: float) -> float:
    """Millimetres on a sensor 36 mm wide."""
    return 18.0 / math.tan(math.radians(field_of_view) / 2)


def render(
    path: Path, *, samples: int, seed: int, region: tuple[float, float, float, float] | None = None, bounces: int = 12,
    denoised: bool = False,
) -> None:  # fmt: skip
    """One picture, every path traced, nothing clamped.

    region : left, bottom, right and top as shares of the picture; black outside
    denoised : by Cycles, which guides Open Image Denoise by albedo and normals
    """
    scene = bpy.context.scene
    cycles, settings = scene.cycles, scene.render.image_settings
    cycles.device, cycles.samples, cycles.seed, cycles.use_denoising = "CPU", samples, seed, denoised
    cycles.use_adaptive_sampling = False
    scene.render.use_border, scene.render.use_crop_to_border = region is not None, False
    if region is not None:
        scene.render.border_min_x, scene.render.border_min_y = region[:2]
        scene.render.border_max_x, scene.render.border_max_y = region[2:]
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.max_bounces, cycles.diffuse_bounces = bounces, bounces
    cycles.glossy_bounces = cycles.transmission_bounces = bounces
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.render.use_persistent_data = True
    settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth, settings.exr_codec = "OPEN_EXR", "RGB", "32", "ZIP"
    unfinished = path.with_name(f"unfinished_{path.name}")
    scene.render.filepath = str(unfinished)
    start = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    unfinished.rename(path)
    print(f"{path.name}: {time.perf_counter() - start:.0f} s", flush=True)

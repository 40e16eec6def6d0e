"""Renders a packed scene with Cycles; runs inside the Python that has bpy and knows nothing of relume.

    BPY_PYTHON benchmarks/insert_cycles.py FOLDER

FOLDER holds scene.npz as `insert_scenes.pack` writes it and jobs.json, a list of
    {"name", "samples", "seed", "objects": bool, "catcher": bool, "denoise": bool, "bounces", "adaptive": noise or none}
Written there: NAME.exr, all layers, for each job, and seconds.json: of each job's render call, writing included, by the
clock and of the processors. The
scene stays loaded from one job to the next. +Y up becomes Blender's +Z up: (x, y, z) is (x, −z, y) there.
"""

from __future__ import annotations

import json
import sys
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

try:
    bpy: Any = import_module("bpy")
except ImportError:  # as `make bench` runs it, from relume's own environment
    bpy = None

UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
"""Blender-from-ours."""


def build(path: Path) -> tuple[list[Any], list[Any]]:
    """The scene; its local surfaces and its objects."""
    arrays = np.load(path)
    tables = json.loads(str(arrays["tables"]))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    _camera(scene, tables["camera"], arrays)
    _world(scene, arrays["light"])
    for lamp in tables["lights"]:
        _lamp(scene, lamp)
    local, objects = [], []
    for surface in tables["surfaces"]:
        made = _mesh(surface, arrays)
        scene.collection.objects.link(made)
        (objects if surface["object"] else local).append(made)
    return local, objects


def _camera(scene: Any, table: dict[str, Any], arrays: Any) -> None:
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.sensor_width = "HORIZONTAL", 36.0
    data.lens = table["focal_length"] * 36.0 / table["width"]
    data.clip_start, data.clip_end = 1e-3, 1e5
    made = bpy.data.objects.new("camera", data)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = UP @ arrays["camera.rotation"], UP @ arrays["camera.position"]
    made.matrix_world = pose.T.tolist()  # bpy takes columns
    scene.collection.objects.link(made)
    scene.camera = made
    scene.render.resolution_x, scene.render.resolution_y = table["width"], table["height"]
    scene.render.resolution_percentage = 100


def _image(name: str, pixels: np.ndarray) -> Any:
    height, width = pixels.shape[:2]
    image = bpy.data.images.new(name, width, height, alpha=False, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    full = np.ones((height, width, 4), np.float32)
    full[..., :3] = pixels
    image.pixels.foreach_set(full[::-1].ravel())
    image.pack()
    return image


def _world(scene: Any, light: np.ndarray) -> None:
    world = bpy.data.worlds.new("world")
    scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    background, output = nodes.new("ShaderNodeBackground"), nodes.new("ShaderNodeOutputWorld")
    links.new(background.outputs[0], output.inputs[0])
    if not light.any():
        background.inputs["Strength"].default_value = 0.0
        return
    sky = nodes.new("ShaderNodeTexEnvironment")
    # Our middle looks along −Z, Blender's +Y; the middle of its equirectangular images looks along +X.
    sky.image = _image("light", np.roll(light, -light.shape[1] // 4, axis=1))
    links.new(sky.outputs[0], background.inputs[0])
    world.cycles.sampling_method = "MANUAL"
    world.cycles.sample_map_resolution = light.shape[1]


def _lamp(scene: Any, table: dict[str, Any]) -> None:
    kind = "POINT" if "position" in table else "SUN"
    data = bpy.data.lights.new("lamp", kind)
    given = next(key for key in ("intensity", "radiance", "irradiance") if key in table)
    colour = np.array(table[given])
    data.color = (colour / colour.max()).tolist()
    made = bpy.data.objects.new("lamp", data)
    if "radius" in table:
        data.energy, data.shadow_soft_size = float(4 * np.pi**2 * table["radius"] ** 2 * colour.max()), table["radius"]
        made.location = (UP @ np.array(table["position"])).tolist()
    elif kind == "POINT":
        # A point of intensity I sends 4πI in all, and Cycles divides a point's watts by 4π² (a sphere of radiance
        # P / 4π²r²); so P = 4π²·I. It shows a sphere that has a radius as such.
        data.energy, data.shadow_soft_size = float(4 * np.pi**2 * colour.max()), 0.0
        made.location = (UP @ np.array(table["position"])).tolist()
    else:
        data.energy, data.angle = float(colour.max()), 0.0
        vector = import_module("mathutils").Vector
        made.rotation_euler = vector(UP @ np.array(table["towards"])).to_track_quat("Z", "Y").to_euler()
    scene.collection.objects.link(made)


def _mesh(table: dict[str, Any], arrays: Any) -> Any:
    key = table["key"]
    vertices, faces = arrays[f"{key}.vertices"] @ UP.T, arrays[f"{key}.faces"]
    mesh = bpy.data.meshes.new(table["name"])
    mesh.from_pydata(vertices.tolist(), [], faces.tolist())
    if f"{key}.uv" in arrays:
        layer = mesh.uv_layers.new(name="uv")
        layer.data.foreach_set("uv", arrays[f"{key}.uv"][faces.ravel()].astype(np.float32).ravel())
    if f"{key}.normals" in arrays:
        mesh.polygons.foreach_set("use_smooth", np.ones(len(faces), bool))
        mesh.normals_split_custom_set_from_vertices((arrays[f"{key}.normals"] @ UP.T).tolist())
    mesh.update()
    made = bpy.data.objects.new(table["name"], mesh)
    mesh.materials.append(_material(table["name"], table["material"], arrays, key))
    return made


def _material(name: str, table: dict[str, Any], arrays: Any, key: str) -> Any:
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    if "emission" in table:
        shader = nodes.new("ShaderNodeEmission")
        strength = max(table["emission"])
        shader.inputs["Color"].default_value = [*(c / strength for c in table["emission"]), 1.0]
        shader.inputs["Strength"].default_value = strength
    elif "reflectance" in table:
        shader = nodes.new("ShaderNodeBsdfDiffuse")
        _colour(nodes, links, shader.inputs["Color"], table["reflectance"], arrays, key)
    else:
        shader = nodes.new("ShaderNodeBsdfPrincipled")
        _colour(nodes, links, shader.inputs["Base Color"], table["base_color"], arrays, key)
        for ours, theirs in (("metallic", "Metallic"), ("roughness", "Roughness"), ("ior", "IOR"),
                             ("transmission", "Transmission Weight")):  # fmt: skip
            shader.inputs[theirs].default_value = table[ours]
        shader.distribution = "GGX"
    links.new(shader.outputs[0], output.inputs[0])
    return material


def _colour(nodes: Any, links: Any, socket: Any, value: Any, arrays: Any, key: str) -> None:
    if value is not None:
        socket.default_value = [*value, 1.0]
        return
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = _image(f"{key}.image", arrays[f"{key}.image"])
    texture.extension = "EXTEND"
    links.new(texture.outputs[0], socket)


def render(job: dict[str, Any], local: list[Any], objects: list[Any], folder: Path) -> tuple[float, float]:
    """One picture; seconds of the call by the clock, and of the processors."""
    scene = bpy.context.scene
    cycles, layer = scene.cycles, scene.view_layers[0]
    cycles.device, cycles.samples, cycles.seed = "CPU", job["samples"], job["seed"]
    cycles.use_adaptive_sampling = job.get("adaptive") is not None
    if job.get("adaptive") is not None:
        cycles.adaptive_threshold = job["adaptive"]
    cycles.use_denoising, cycles.denoiser = job["denoise"], "OPENIMAGEDENOISE"
    cycles.pixel_filter_type = "BOX"
    # All light, as the others trace it: nothing clamped, no blurred caustics.
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    bounces = job["bounces"]
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = bounces
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    scene.render.use_persistent_data = True
    scene.render.film_transparent = job["catcher"]
    layer.cycles.use_pass_shadow_catcher = job["catcher"]
    for each in objects:
        each.hide_render = not job["objects"]
    for each in local:
        each.is_shadow_catcher = job["catcher"]
    picture = scene.render.image_settings
    picture.media_type = "MULTI_LAYER_IMAGE"
    picture.file_format, picture.color_depth, picture.exr_codec = "OPEN_EXR_MULTILAYER", "32", "NONE"
    scene.render.filepath = str(folder / f"{job['name']}.exr")
    start, used = time.perf_counter(), time.process_time()
    bpy.ops.render.render(write_still=True)
    return time.perf_counter() - start, time.process_time() - used


def main(folder: Path) -> None:
    local, objects = build(folder / "scene.npz")
    seconds = {}
    for job in json.loads((folder / "jobs.json").read_text()):
        seconds[job["name"]] = render(job, local, objects, folder)
    (folder / "seconds.json").write_text(json.dumps(seconds))


if __name__ == "__main__":
    if bpy is None or len(sys.argv) != 2:
        print(__doc__)
    else:
        main(Path(sys.argv[1]))

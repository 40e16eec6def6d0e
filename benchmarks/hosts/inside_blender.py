"""What Blender does in `blender.py`: runs under a python that has bpy, without relume.

Usage: python inside_blender.py FOLDER, which holds probe.exr, lights.py, probe.usda and lights.gltf
"""

import json
import runpy
import sys
from pathlib import Path

import bpy  # pyright: ignore[reportMissingImports]
from mathutils import Matrix, Vector  # pyright: ignore[reportMissingImports]

TO_BLENDER = Matrix(((1, 0, 0), (0, 0, -1), (0, 1, 0)))
# right, up and backward of a camera that looks along +X, −X, +Y, −Y, +Z, −Z, in relume's axes
AXES = {
    "px": ((0, 0, 1), (0, 1, 0), (1, 0, 0)),
    "nx": ((0, 0, -1), (0, 1, 0), (-1, 0, 0)),
    "py": ((1, 0, 0), (0, 0, 1), (0, 1, 0)),
    "ny": ((1, 0, 0), (0, 0, -1), (0, -1, 0)),
    "pz": ((-1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "nz": ((1, 0, 0), (0, 1, 0), (0, 0, -1)),
}


def empty_scene(size, samples):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    return scene


def camera_towards(scene, axis, place=(0, 0, 0), orthographic=False):
    right, up, towards = (TO_BLENDER @ Vector(part) for part in AXES[axis])
    camera = bpy.data.objects.new(axis, bpy.data.cameras.new(axis))
    camera.data.angle = 1.5707963267948966
    if orthographic:
        camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
    pose = Matrix((right, up, -towards)).transposed().to_4x4()
    pose.translation = Vector(place)
    camera.matrix_world = pose
    scene.collection.objects.link(camera)
    scene.camera = camera
    return right, up, towards


def render(scene, path):
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def look_round(scene, folder, name):
    """Six views of the scene's world."""
    for axis in AXES:
        camera_towards(scene, axis)
        render(scene, folder / f"{name}_{axis}.exr")


def load_probe(probe):
    """A world with a file in its environment texture and nothing set."""
    scene = empty_scene(128, 16)
    world = bpy.data.worlds.new("probe")
    scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    assert world.node_tree is not None
    nodes = world.node_tree.nodes
    nodes.clear()
    output, shader = nodes.new("ShaderNodeOutputWorld"), nodes.new("ShaderNodeBackground")
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = bpy.data.images.load(str(probe))
    world.node_tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
    world.node_tree.links.new(shader.outputs["Background"], output.inputs["Surface"])
    return scene


def import_usd(layer):
    scene = empty_scene(128, 16)
    scene.world = bpy.data.worlds.new("usd")  # its importer gives a dome to a world that is there
    bpy.ops.wm.usd_import(filepath=str(layer))
    return scene, (suns(), points())


def import_gltf(file):
    empty_scene(128, 16)
    bpy.ops.import_scene.gltf(filepath=str(file))
    return suns(), points()


def suns():
    """Of every Sun the direction towards it and what it gives, by name."""
    bpy.context.view_layer.update()
    found = {}
    for lamp in bpy.data.objects:
        if lamp.type == "LIGHT" and lamp.data.type == "SUN":
            towards = TO_BLENDER.transposed() @ (lamp.matrix_world.to_3x3() @ Vector((0, 0, 1)))
            found[lamp.name] = {
                "towards": list(towards),
                "gives": [lamp.data.energy * part for part in lamp.data.color],
            }
    return found


def points():
    """Of every Point light its place in relume's axes and its watts, by name."""
    return {
        lamp.name: {
            "position": list(TO_BLENDER.transposed() @ lamp.matrix_world.translation),
            "watts": [lamp.data.energy * part for part in lamp.data.color],
        }
        for lamp in bpy.data.objects
        if lamp.type == "LIGHT" and lamp.data.type == "POINT"
    }


def measure(script, folder):
    """A white matte square with each axis for its normal, under the lights and background of the script."""
    for axis in AXES:
        scene = empty_scene(4, 4096)
        runpy.run_path(script)
        *_, towards = (TO_BLENDER @ Vector(part) for part in AXES[axis])
        # The camera stands on the normal and looks back at the square.
        opposite = {"p": "n", "n": "p"}[axis[0]] + axis[1]
        right, up, _ = camera_towards(scene, opposite, place=towards, orthographic=True)
        # Lamps near by light the middle of the square, where they are reckoned, and its rims differently.
        scene.camera.data.ortho_scale = 0.01
        corners = [x * right + y * up for x, y in ((-9, -9), (9, -9), (9, 9), (-9, 9))]
        mesh = bpy.data.meshes.new("square")
        mesh.from_pydata([tuple(corner) for corner in corners], [], [(0, 1, 2, 3)])
        white = bpy.data.materials.new("white")
        if white.node_tree is None:
            white.use_nodes = True
        assert white.node_tree is not None
        white.node_tree.nodes.clear()
        output = white.node_tree.nodes.new("ShaderNodeOutputMaterial")
        matte = white.node_tree.nodes.new("ShaderNodeBsdfDiffuse")
        matte.inputs["Color"].default_value = (1, 1, 1, 1)
        white.node_tree.links.new(matte.outputs["BSDF"], output.inputs["Surface"])
        mesh.materials.append(white)
        scene.collection.objects.link(bpy.data.objects.new("square", mesh))
        render(scene, folder / f"irradiance_{axis}.exr")


def main(folder):
    look_round(load_probe(folder / "probe.exr"), folder, "axis")
    scene, by_usd = import_usd(folder / "probe.usda")
    look_round(scene, folder, "usd")
    by_gltf = import_gltf(folder / "lights.gltf")
    (folder / "imported.json").write_text(json.dumps({"usd": by_usd, "gltf": by_gltf}))
    measure(str(folder / "lights.py"), folder)


if __name__ == "__main__":
    main(Path(sys.argv[1]))

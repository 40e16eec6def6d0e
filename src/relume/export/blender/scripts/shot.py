"""A shot for Blender 4.2 and newer, written by relume.

    blender --python shot.py                            opens it, in a scene of its own
    blender -b --python shot.py -- --render OUT.exr     renders the composite

The real surfaces are shadow catchers that carry their own reflectance, so that objects reflect them and take their
colour. The compositor multiplies the plate by what the objects change and puts the objects over it: its result is the
plate with the objects in it, scene-linear. The viewport's camera shows the developed plate.
"""

import os
import runpy
import sys

import bpy
from mathutils import Matrix, Vector

SHOT = {}  # relume writes the facts of the shot here

# Our +Y is up and Blender's +Z.
TO_BLENDER = Matrix(((1, 0, 0), (0, 0, -1), (0, 1, 0)))


def path_of(name):
    """The file beside this script or beside the .blend file."""
    folders = [os.path.dirname(os.path.realpath(__file__)), bpy.path.abspath("//")]
    folders += [os.path.dirname(bpy.path.abspath(text.filepath)) for text in bpy.data.texts if text.filepath]
    for folder in folders:
        if os.path.isfile(os.path.join(folder, name)):
            return os.path.join(folder, name)
    raise FileNotFoundError(f"{name} is not beside the script; put it there, or save the .blend file beside it")


def loaded(name, space=None):
    """An image file; its colours are taken as `space`, or as they are."""
    image = bpy.data.images.load(path_of(name), check_existing=True)
    if space is not None:
        image.colorspace_settings.name = space
    return image


def imported(name):
    """The meshes of a glTF file, by their names in it."""
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=path_of(name))
    new = sorted((each for each in bpy.data.objects if each not in before), key=lambda each: each.name)
    for each in new:
        each.select_set(False)
    return {each.name: each for each in new if each.type == "MESH"}


def named(found, name):
    """The mesh of that name, whatever number Blender put behind it."""
    return next(each for key, each in found.items() if key == name or key.startswith(name + "."))


def node_of(material, kind):
    """The first node of a kind in a material."""
    return next(node for node in material.node_tree.nodes if node.bl_idname == kind)


def set_camera(scene):
    """Make the camera of the shot."""
    facts = SHOT["camera"]
    data = bpy.data.cameras.new("relume camera")
    data.sensor_fit, data.sensor_width = "HORIZONTAL", facts["sensor"]
    data.lens = facts["lens"]
    data.shift_x, data.shift_y = facts["shift"]
    data.clip_start, data.clip_end = 0.01, 10000
    if facts["f_stop"] is not None:
        data.dof.use_dof = True
        data.dof.aperture_fstop, data.dof.focus_distance = facts["f_stop"], facts["focus"]
    data.show_background_images = True
    behind = data.background_images.new()
    behind.image, behind.alpha, behind.frame_method = loaded("plate.png"), 1.0, "STRETCH"
    camera = bpy.data.objects.new("relume camera", data)
    pose = Matrix([TO_BLENDER @ Vector(axis) for axis in facts["axes"]]).transposed().to_4x4()
    pose.translation = TO_BLENDER @ Vector(facts["position"])
    camera.matrix_world = pose
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = facts["size"]
    scene.render.resolution_percentage = 100


def set_real():
    """Real surfaces catch what the objects change of them, and are seen in the plate alone."""
    found = imported(SHOT["real"])
    for each in found.values():
        each.is_shadow_catcher = True
    for name, file in SHOT["albedo"].items():
        material = named(found, name).active_material
        texture = material.node_tree.nodes.new("ShaderNodeTexImage")
        texture.image = loaded(file, "Non-Color")
        principled = node_of(material, "ShaderNodeBsdfPrincipled")
        material.node_tree.links.new(texture.outputs["Color"], principled.inputs["Base Color"])


def set_distant():
    """The walls that the probe saw: they shine, and the camera looks through them at the plate."""
    found = imported(SHOT["distant"])
    for index, strength in enumerate(SHOT["steps"]):
        wall = named(found, f"distant_{index:02d}")
        # Lamps stand in the walls, half of each behind: they are not to hide them.
        wall.visible_camera = wall.visible_shadow = False
        # What catches no shadow counts as added: its light would be missing from the place without the objects.
        wall.is_shadow_catcher = True
        material = wall.active_material
        nodes, links = material.node_tree.nodes, material.node_tree.links
        nodes.clear()
        output, shine = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeEmission")
        texture, scale = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeVectorMath")
        texture.image = loaded("light.exr", "Non-Color")
        texture.extension = "EXTEND"
        # Cycles goes by this number when it chooses where to look for light; the colour is what is left of the map.
        shine.inputs["Strength"].default_value = strength
        scale.operation = "SCALE"
        scale.inputs["Scale"].default_value = 1 / strength
        links.new(texture.outputs["Color"], scale.inputs[0])
        links.new(scale.outputs["Vector"], shine.inputs["Color"])
        links.new(shine.outputs["Emission"], output.inputs["Surface"])


def set_lights():
    """World and lamps, by the script beside this one; the plate shows the lamps already."""
    runpy.run_path(path_of("light.py"))
    for lamp in bpy.data.collections["relume lights"].objects:
        lamp.visible_camera = False


def set_render(scene):
    """Set the renderer as relume sets its own."""
    scene.render.engine = "CYCLES"
    scene.cycles.samples = SHOT["samples"]
    for kind in ("max", "diffuse", "glossy", "transmission"):
        setattr(scene.cycles, kind + "_bounces", SHOT["depth"])
    # Neither is in the light that was measured.
    scene.cycles.sample_clamp_indirect = 0
    scene.cycles.blur_glossy = 0
    scene.render.film_transparent = True
    scene.view_layers[0].cycles.use_pass_shadow_catcher = True
    # A photograph's tones and no film look: what is linear here is so in the plate.
    scene.view_settings.view_transform, scene.view_settings.look = "Standard", "None"
    scene.view_settings.exposure, scene.view_settings.gamma = SHOT["exposure"], 1
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"


def set_compositor(scene):
    """The plate times what the objects change, and the objects over it."""
    newer = hasattr(scene, "compositing_node_group")
    if newer:
        tree = bpy.data.node_groups.new("relume composite", "CompositorNodeTree")
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        scene.compositing_node_group = tree
        output = tree.nodes.new("NodeGroupOutput")
        times = tree.nodes.new("ShaderNodeMix")
        times.data_type, times.blend_type = "RGBA", "MULTIPLY"
        factor, first, second = times.inputs[0], times.inputs[6], times.inputs[7]
        product = times.outputs[2]
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
        times = tree.nodes.new("CompositorNodeMixRGB")
        times.blend_type = "MULTIPLY"
        factor, first, second = times.inputs
        product = times.outputs[0]
    factor.default_value = 1
    layers, plate = tree.nodes.new("CompositorNodeRLayers"), tree.nodes.new("CompositorNodeImage")
    over = tree.nodes.new("CompositorNodeAlphaOver")
    layers.scene = scene
    plate.image = loaded("plate.exr", "Non-Color")
    behind, before = ("Background", "Foreground") if newer else (1, 2)
    tree.links.new(plate.outputs["Image"], first)
    tree.links.new(layers.outputs["Shadow Catcher"], second)
    tree.links.new(product, over.inputs[behind])
    tree.links.new(layers.outputs["Image"], over.inputs[before])
    tree.links.new(over.outputs[0], output.inputs[0])
    scene.render.use_compositing = True


def build():
    """Make the scene of the shot."""
    scene = bpy.data.scenes.new("relume shot")
    if bpy.context.window is not None:
        bpy.context.window.scene = scene
    with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        set_lights()
        set_camera(scene)
        set_render(scene)
        if SHOT["real"]:
            set_real()
        if SHOT["distant"]:
            set_distant()
        if SHOT["objects"]:
            imported(SHOT["objects"])
        set_compositor(scene)
    return scene


built = build()
arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
if "--render" in arguments:
    built.render.filepath = os.path.abspath(arguments[arguments.index("--render") + 1])
    bpy.ops.render.render(write_still=True, scene=built.name)

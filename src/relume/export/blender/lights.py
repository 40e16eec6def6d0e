"""A constellation as a Blender script: a Sun each, a Point for placed lights, and the background as the world.

Blender's +Z is up: our (x, y, z) is (x, −z, y) there, as its own importers turn glTF and OBJ. The middle of its
environment textures is +X, a quarter turn from where our −Z comes to lie, which the mapping node makes good.
"""

from __future__ import annotations

import numpy as np

from relume.export.lamps import LampFile, figure, figures

_SCRIPT = '''"""Lights for Blender, written by relume: run it in the Text Editor, or `blender --python THIS_FILE`.

{meaning}
Blender calls a Sun's strength W/m²; it is the irradiance on a surface that faces the Sun, number for number, as the
background's strength is 1. Set the exposure of the film (Color Management) where the numbers are large.
"""

import math
import os

import bpy
from mathutils import Matrix, Vector

BACKGROUND = {background!r}

# name, direction towards the light (+Y up), colour, strength, apparent diameter in radians
LIGHTS = (
{lights})

# Our +Y is up and Blender's +Z.
TO_BLENDER = Matrix(((1, 0, 0), (0, 0, -1), (0, 1, 0)))
COLLECTION = "relume lights"


def fresh_collection():
    """An empty collection in the scene: what an earlier run left is taken away."""
    earlier = bpy.data.collections.get(COLLECTION)
    if earlier is not None:
        for light in list(earlier.objects):
            bpy.data.objects.remove(light, do_unlink=True)
        bpy.data.collections.remove(earlier)
    collection = bpy.data.collections.new(COLLECTION)
    bpy.context.scene.collection.children.link(collection)
    return collection


def add_sun(collection, name, direction, colour, strength, angle):
    """A Sun shines along its own -Z."""
    sun = bpy.data.lights.new(name, "SUN")
    sun.color, sun.energy, sun.angle = colour, strength, angle
    lamp = bpy.data.objects.new(name, sun)
    lamp.rotation_mode = "QUATERNION"
    lamp.rotation_quaternion = Vector((0, 0, 1)).rotation_difference(TO_BLENDER @ Vector(direction))
    collection.objects.link(lamp)


def path_of(name):
    """The file beside this script or beside the .blend file."""
    folders = [os.path.dirname(os.path.realpath(__file__)), bpy.path.abspath("//")]
    folders += [os.path.dirname(bpy.path.abspath(text.filepath)) for text in bpy.data.texts if text.filepath]
    for folder in folders:
        if os.path.isfile(os.path.join(folder, name)):
            return os.path.join(folder, name)
    raise FileNotFoundError(f"{{name}} is not beside the script; put it there, or save the .blend file beside it")


def set_world(name):
    """The background all round; without one, black."""
    world = bpy.data.worlds.get("relume light") or bpy.data.worlds.new("relume light")
    bpy.context.scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    output, shader = nodes.new("ShaderNodeOutputWorld"), nodes.new("ShaderNodeBackground")
    links.new(shader.outputs["Background"], output.inputs["Surface"])
    shader.inputs["Color"].default_value = (0, 0, 0, 1)
    shader.inputs["Strength"].default_value = 1
    if name is None:
        return
    texture, mapping = nodes.new("ShaderNodeTexEnvironment"), nodes.new("ShaderNodeMapping")
    coordinates = nodes.new("ShaderNodeTexCoord")
    texture.image = bpy.data.images.load(path_of(name), check_existing=True)
    texture.projection = "EQUIRECTANGULAR"
    mapping.vector_type = "POINT"
    # The middle of the file is our -Z, Blender's +Y, and its texture's middle is +X.
    mapping.inputs["Rotation"].default_value = (0, 0, -math.pi / 2)
    links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    links.new(texture.outputs["Color"], shader.inputs["Color"])


set_world(BACKGROUND)
suns = fresh_collection()
for light in LIGHTS:
    add_sun(suns, *light)
'''
_POINTS = '''

# name, position in metres (+Y up), colour, strength in watts (4π times the intensity), radius in metres
POINTS = (
{points})


def add_point(collection, name, position, colour, strength, radius):
    """A Point light gives strength / 4π over the square of the distance."""
    point = bpy.data.lights.new(name, "POINT")
    point.color, point.energy, point.shadow_soft_size = colour, strength, radius
    lamp = bpy.data.objects.new(name, point)
    lamp.location = TO_BLENDER @ Vector(position)
    collection.objects.link(lamp)


for light in POINTS:
    add_point(suns, *light)
'''


def text(file: LampFile) -> str:
    """The lights as a Python script for Blender 3 and newer.

    The numbers go to Blender as they are, lights and background alike. Without a background the world is black, without
    angles shadows are hard. Placed lights are Point lights of 4π watts where our intensity is 1.
    """
    lines = [
        f"    ({lamp.name!r}, ({figures(lamp.direction, ', ')}), ({figures(lamp.colour, ', ')}), "
        f"{figure(lamp.intensity)}, {figure(lamp.angle)}),\n"
        for lamp in file.lamps
    ]
    script = _SCRIPT.format(meaning=file.meaning, background=file.background_name, lights="".join(lines))
    if file.points is None:
        return script
    placed = [
        f"    ({bulb.name!r}, ({figures(bulb.position, ', ')}), ({figures(bulb.colour, ', ')}), "
        f"{figure(4 * np.pi * bulb.strength)}, {figure(bulb.radius)}),\n"
        for bulb in file.bulbs
    ]
    return script + _POINTS.format(points="".join(placed))

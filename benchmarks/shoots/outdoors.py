"""A paved yard at noon and a pavement at night, as `place.Place` has them."""

from __future__ import annotations

import math

import numpy as np
from blender import box, cylinder, globe_light, quad, sphere
from materials import bpy, glow, principled
from objects import Spot, crafted_set
from place import Place, View, painted_box, plain, stones, wall_colours
from radiosity import Wall, globe, window

# A paved yard at noon


def _outdoor() -> None:
    nodes, links = bpy.context.scene.world.node_tree.nodes, bpy.context.scene.world.node_tree.links
    sky = nodes.new("ShaderNodeTexSky")
    sky.sky_type, sky.sun_disc = "MULTIPLE_SCATTERING", True
    sky.sun_elevation, sky.sun_rotation = math.radians(58), math.radians(215)
    links.new(sky.outputs[0], nodes["Background"].inputs["Color"])
    quad("grass", (0, 0, -0.03), (80, 0, 0), (0, 80, 0), plain("grass", (0.09, 0.14, 0.04)))
    quad("paving", (0, 0, 0), (8, 0, 0), (0, 8, 0), principled("paving", stones(24, 11), roughness=0.9))
    box("house", (-5, 5.5, -0.03), (6, 9, 4), plain("house", (0.7, 0.6, 0.45)))
    for x in (-3.2, 0.4, 3.4):
        box("pane", (x, 5.45, 0.9), (x + 1.1, 5.5, 2.4), plain("pane", (0.05, 0.06, 0.07), 0.2))
    box("hedge", (-6.5, -6, -0.03), (-5.6, 5, 1.5), plain("hedge", (0.05, 0.11, 0.03)))
    for x, y, z, r in ((6.5, 4, 2.5, 1.6), (6, -5, 2.2, 1.9), (-3, -8, 3.0, 2.1)):
        sphere("tree", (x, y, z), r, plain("tree", (0.06, 0.12, 0.03)), fine=24)
        cylinder("trunk", (x, y, z / 2 - 0.5), 0.18, z, plain("trunk", (0.12, 0.08, 0.05)))


OUTDOOR_SPOTS: dict[str, Spot] = {
    "vase_glazed": (-0.17, 0.08, 0), "sphere_marble": (0.03, 0.1, 0), "drum_steel": (0.19, 0.03, 0),
    "cube_clay": (-0.02, -0.12, 30),
}  # fmt: skip

# Clear glass and mirrors are left out here: no path tracer finds what they make of a sun half a degree wide.
OUTDOOR = Place(
    build=_outdoor,
    things=lambda: crafted_set(OUTDOOR_SPOTS, glaze=0.2),
    plate=View((0.31, -1.22, 0.66), (0.01, 0.03, 0.05), 33.0),
    size=(480, 320),
    region=(0.06, 0.1, 0.94, 0.85),
    ball=0.06,
    ball_cameras={"ball_0": (-0.009, -1.312, 0.214), "ball_90": (1.297, 0.012, 0.203)},
    board=0.005,
    tape={"balls": {"ball_0": [-0.01, 0.215, 1.31], "ball_90": [1.295, 0.205, -0.01]}, "paving": [8.0, 8.0]},
)

# A pavement at night, under two street lamps and a shop window


def _night() -> None:
    quad("pavement", (0, 1.1, 0), (6, 0, 0), (0, 5.8, 0), principled("slabs", stones(14, 12), roughness=0.6))
    lamps = []
    for name, centre, across, height, radiance in (
        ("shop window", (-0.9, 3.97, 1.4), (2.6, 0, 0), 1.7, (5.0, 3.9, 2.6)),
        ("sign", (2.4, 3.96, 2.4), (1.4, 0, 0), 0.25, (1.0, 6.0, 7.0)),
        ("lit room", (-4.5, -7.97, 3.5), (-1.2, 0, 0), 1.4, (1.6, 1.1, 0.5)),
        ("lit room", (3.6, -7.97, 3.5), (-1.2, 0, 0), 1.4, (1.6, 1.1, 0.5)),
    ):
        pane = Wall(np.array(centre), np.array(across, float), np.array([0, 0, height]))
        quad(name, centre, across, (0, 0, height), glow(name, radiance))
        lamps.append(window(pane, radiance))
    for name, (x, y, z), radiance in (
        ("sodium", (-2.3, 0.7, 2.9), (60.0, 30.0, 9.0)), ("white", (2.7, -1.3, 3.0), (42.0, 45.0, 48.0)),
    ):  # fmt: skip
        globe_light(name, (x, y, z), 0.3, radiance)
        lamps.append(globe((x, y, z), 0.3, radiance))
        cylinder("post", (x, y, (z - 0.3) / 2), 0.05, z - 0.32, plain("post", (0.1, 0.12, 0.1), 0.4))
    dark = [(0.12 + 0.22 * i, 0.5, 0.24 + 0.22 * i, 0.7, (0.03, 0.03, 0.04)) for i in range(4)]
    albedo = {
        "floor": wall_colours((0.06, 0.06, 0.065), [(0.0, 0.48, 1.0, 1.0, (0.28, 0.27, 0.25))], 6),
        "ceiling": wall_colours((0.01, 0.01, 0.015)),
        "left": wall_colours((0.3, 0.14, 0.1), dark, 7), "right": wall_colours((0.35, 0.32, 0.28), dark, 8),
        "back": wall_colours((0.4, 0.28, 0.22), dark, 9), "front": wall_colours((0.3, 0.2, 0.14), dark, 10),
    }  # fmt: skip
    painted_box((-8.0, -8.0, -0.12), (8.0, 4.0, 9.0), albedo, lamps)


NIGHT_SPOTS: dict[str, Spot] = {
    "vase_glazed": (0.18, 0.09, 0), "sphere_marble": (-0.18, 0.05, 0), "drum_steel": (0.0, 0.12, 0),
    "pebble_green": (0.06, -0.1, 0), "cube_clay": (-0.13, -0.13, 15),
}  # fmt: skip

NIGHT = Place(
    build=_night, things=lambda: crafted_set(NIGHT_SPOTS), plate=View((0.12, -1.26, 0.62), (0, 0.02, 0.04), 34.0),
    size=(448, 336), ball=0.04, ball_reflectance=0.92, board=0.002, region=(0.06, 0.1, 0.94, 0.82),
    ball_cameras={"ball_0": (0.004, -1.009, 0.158), "ball_90": (-1.013, 0.007, 0.163)},
    tape={
        "balls": {"ball_0": [0.005, 0.16, 1.01], "ball_90": [-1.015, 0.165, -0.005]},
        "street": {"low": [-8.0, -0.12, -4.0], "high": [8.0, 9.0, 8.0]},
        "lamps": [[-2.3, 2.9, -0.7], [2.7, 3.0, 1.3]],
    },
)  # fmt: skip

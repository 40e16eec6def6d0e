"""A sitting room by day and a product table, as `place.Place` has them."""

from __future__ import annotations

import numpy as np
from blender import box, quad, sphere
from materials import Triple, glow, image, principled
from objects import Spot, glossy_set
from place import Place, View, painted_box, plain, streaks, wall_colours
from radiosity import Lamp, Wall, globe, window

# A sitting room with three windows and a paper lamp


def _window(centre: Triple, across: Triple, height: float, inwards: Triple) -> list[Lamp]:
    """Sky above garden behind a cross of white wood."""
    c, a, n = (np.array(v, float) for v in (centre, across, inwards))
    up = np.array([0, 0, height])
    lamps = []
    parts = (("sky", (36.0, 42.0, 50.0), 0.225, 0.55), ("garden", (6.0, 8.0, 4.0), -0.275, 0.45))
    for name, radiance, middle, share in parts:
        pane = Wall(c + middle * up, a, share * up)
        quad(name, tuple(pane.centre), tuple(pane.across), tuple(pane.up), glow(name, radiance))
        lamps.append(window(pane, radiance))
    wood = glow("frame", (2.0, 2.1, 2.2), sampled=False)
    for half_across, half_up in ((a / 2, up * 0.02), (a * 0.02, up / 2)):
        ends = np.stack([c + 0.02 * n - half_across - half_up, c + 0.05 * n + half_across + half_up])
        box("bar", tuple(ends.min(0)), tuple(ends.max(0)), wood)
    return lamps


def _indoor() -> None:
    lamps = _window((-2.19, -0.95, 0.72), (0, 1.1, 0), 1.25, (1, 0, 0))
    lamps += _window((-2.19, 1.1, 0.72), (0, 1.2, 0), 1.25, (1, 0, 0))
    lamps += _window((1.3, 2.29, 0.72), (1.2, 0, 0), 1.15, (0, -1, 0))
    sphere("lamp", (1.65, -0.4, 1.15), 0.16, glow("lamp", (34.0, 20.0, 10.0)), fine=32)
    lamps.append(globe((1.65, -0.4, 1.15), 0.16, (34.0, 20.0, 10.0)))
    books = [
        (0.3 + 0.045 * i, 0.2 + 0.3 * (i % 2), 0.34 + 0.045 * i, 0.42 + 0.3 * (i % 2), colour)
        for i, colour in enumerate([(0.5, 0.08, 0.06), (0.08, 0.2, 0.4), (0.6, 0.5, 0.1), (0.1, 0.3, 0.12)] * 2)
    ]
    plaster = (0.72, 0.68, 0.6)
    albedo = {
        "floor": wall_colours((0.42, 0.26, 0.14), [(0.3, 0.3, 0.7, 0.7, (0.35, 0.12, 0.1))], 1),
        "ceiling": wall_colours((0.8, 0.8, 0.8)),
        "left": wall_colours(plaster, [(0.44, 0.45, 0.54, 0.75, (0.25, 0.3, 0.4))], 2),
        "right": wall_colours(plaster, [(0.28, 0.1, 0.7, 0.85, (0.3, 0.2, 0.12)), *books], 3),
        "back": wall_colours(
            plaster, [(0.1, 0.0, 0.35, 0.35, (0.7, 0.7, 0.68)), (0.12, 0.5, 0.3, 0.75, (0.5, 0.35, 0.15))], 4
        ),
        "front": wall_colours(
            plaster, [(0.45, 0.0, 0.87, 0.28, (0.12, 0.22, 0.26)), (0.1, 0, 0.25, 0.8, (0.3, 0.18, 0.1))], 5
        ),
    }
    painted_box((-2.2, -2.6, -0.74), (3.1, 2.3, 1.81), albedo, lamps)
    table = principled("table", streaks((0.62, 0.5, 0.4), 0.07, 2), roughness=0.3)
    quad("table", (0, 0, 0), (1.6, 0, 0), (0, 0.9, 0), table)
    box("table top", (-0.8, -0.45, -0.04), (0.8, 0.45, -0.0005), plain("edge", (0.3, 0.18, 0.1)))


INDOOR_SPOTS: dict[str, Spot] = {
    "suzanne_plastic": (-0.19, 0.05, 20), "sphere_mirror": (0.0, 0.13, 0), "sphere_gray": (0.19, 0.06, 0),
    "sphere_glass": (-0.03, -0.11, 0), "cube_gold": (0.17, -0.13, 25),
}  # fmt: skip

INDOOR = Place(
    build=_indoor, things=lambda: glossy_set(INDOOR_SPOTS), plate=View((-0.27, -1.13, 0.57), (0, 0.02, 0.04), 36.0),
    size=(480, 320), ball=0.05, board=0.003, region=(0.06, 0.12, 0.94, 0.82),
    ball_cameras={"ball_0": (0.013, -1.197, 0.181), "ball_90": (1.204, -0.011, 0.172)},
    tape={
        "balls": {"ball_0": [0.015, 0.18, 1.195], "ball_90": [1.205, 0.17, 0.01]},
        "room": {"low": [-2.2, -0.74, -2.3], "high": [3.1, 1.81, 2.6]}, "lamps": [[1.65, 1.15, 0.4]],
        "table": [1.6, 0.9],
    },
)  # fmt: skip


# A product table with three softboxes before a paper backdrop


def _product() -> None:
    laminate = principled("table", (0.62, 0.62, 0.6), roughness=0.25)
    quad("table", (0, 0, 0), (1.5, 0, 0), (0, 1.1, 0), laminate)
    box("table top", (-0.75, -0.55, -0.03), (0.75, 0.55, -0.0005), plain("edge", (0.5, 0.5, 0.5)))
    paper = np.linspace(1.0, 0.75, 64)[:, None, None] * np.array([0.5, 0.58, 0.68]) * np.ones((64, 64, 1))
    quad(
        "paper", (0, 0.549, 0.55), (1.5, 0, 0), (0, 0, 1.1), principled("paper", image("paper", paper), roughness=0.95)
    )
    lamps = [
        _softbox(name, np.array(at), width, height, radiance)
        for name, at, width, height, radiance in (
            ("key", (-1.1, -0.45, 0.95), 0.75, 0.75, (52.0, 52.0, 50.0)),
            ("fill", (1.25, -0.5, 0.7), 0.45, 0.9, (14.0, 15.0, 17.0)),
            ("strip", (0.1, 0.05, 1.45), 1.0, 0.25, (34.0, 33.0, 31.0)),
        )
    ]
    things = [(0.15, 0.0, 0.4, 0.6, (0.4, 0.1, 0.08)), (0.6, 0.1, 0.8, 0.8, (0.1, 0.15, 0.3))]
    grey = (0.22, 0.22, 0.23)
    albedo = {
        "floor": wall_colours((0.18, 0.16, 0.15)), "ceiling": wall_colours((0.4, 0.4, 0.4)),
        "left": wall_colours(grey, things, 0), "right": wall_colours(grey, things, 1),
        "back": wall_colours(grey, things, 2), "front": wall_colours(grey, things, 3),
    }  # fmt: skip
    painted_box((-2.5, -3.0, -0.85), (2.5, 2.0, 1.9), albedo, lamps)


def _softbox(name: str, at: np.ndarray, width: float, height: float, radiance: Triple) -> Lamp:
    """A white cloth that faces the middle of the table, with a black back."""
    facing = np.array([0, 0, 0.05]) - at
    facing /= np.linalg.norm(facing)
    across = np.cross([0.0, 1.0, 0.0] if abs(facing[2]) > 0.9 else [0.0, 0.0, 1.0], facing)
    across /= np.linalg.norm(across)
    up = np.cross(facing, across)
    quad(name, tuple(at), tuple(across * width), tuple(up * height), glow(name, radiance))
    quad(
        "black",
        tuple(at - 0.02 * facing),
        tuple(-across * width),
        tuple(up * height),
        plain("black", (0.02, 0.02, 0.02)),
    )
    return window(Wall(at, across * width, up * height), radiance)


PRODUCT_SPOTS: dict[str, Spot] = {
    "suzanne_plastic": (0.16, 0.09, -25), "sphere_mirror": (-0.16, 0.1, 0), "sphere_gray": (0.0, 0.05, 0),
    "sphere_glass": (0.13, -0.13, 0), "cube_gold": (-0.1, -0.14, 50),
}  # fmt: skip

PRODUCT = Place(
    build=_product, things=lambda: glossy_set(PRODUCT_SPOTS), plate=View((0.06, -1.31, 0.48), (0, 0.03, 0.06), 31.0),
    size=(480, 320), ball=0.04, board=0.0015, region=(0.1, 0.04, 0.95, 0.74),
    ball_cameras={"ball_0": (0.002, -0.943, 0.142), "ball_90": (0.951, -0.006, 0.151)},
    tape={
        "balls": {"ball_0": [0.0, 0.14, 0.945], "ball_90": [0.95, 0.15, 0.005]},
        "room": {"low": [-2.5, -0.85, -2.0], "high": [2.5, 1.9, 3.0]},
        "lamps": [[-1.1, 0.95, 0.45], [1.25, 0.7, 0.5], [0.1, 1.45, -0.05]],
        "table": [1.5, 1.1], "paper": {"low": [-0.75, 0.0, -0.56], "high": [0.75, 1.1, -0.549]},
    },
)  # fmt: skip

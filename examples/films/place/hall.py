"""A hall that was never built: its walls, floor and furniture, with the textures and the light they have in truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import relume as rl

WIDTH, HEIGHT, DEPTH = 5.0, 2.8, 4.2
GREY = rl.Diffuse((0.5, 0.5, 0.5))


def quad(corner, along, up, name, material) -> rl.Mesh:
    """A rectangle that faces along × up, its texture upright."""
    corner, along, up = (np.array(each, float) for each in (corner, along, up))
    vertices = np.array([corner, corner + along, corner + along + up, corner + up], np.float32)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    return rl.Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32), material, uv=uv, name=name)


def together(parts, name) -> rl.Mesh:
    """Meshes of one material as one."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return replace(
        parts[0], vertices=np.concatenate([part.vertices for part in parts]), name=name,
        faces=np.concatenate(faces).astype(np.int32), uv=np.concatenate([part.uv for part in parts]),
    )  # fmt: skip


def box(low, high, name, material) -> rl.Mesh:
    """A box on the floor, each of whose sides has the whole texture; it has no underside."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    w, h, d = x1 - x0, y1 - y0, z1 - z0
    sides = [
        quad((x0, y0, z1), (w, 0, 0), (0, h, 0), name, material),
        quad((x1, y0, z0), (-w, 0, 0), (0, h, 0), name, material),
        quad((x1, y0, z1), (0, 0, -d), (0, h, 0), name, material),
        quad((x0, y0, z0), (0, 0, d), (0, h, 0), name, material),
        quad((x0, y1, z1), (w, 0, 0), (0, 0, -d), name, material),
    ]
    return together(sides, name)


def texture(kind: str, size: int = 512) -> np.ndarray:
    """A painted surface (size, size, 3), reflectances."""
    y, x = np.meshgrid((np.arange(size) + 0.5) / size, (np.arange(size) + 0.5) / size, indexing="ij")
    random = np.random.default_rng(sum(map(ord, kind)))
    grain = 1 + 0.06 * random.standard_normal((size // 8, size // 8)).repeat(8, 0).repeat(8, 1)
    if kind == "tiles":
        column, row = (x * 10).astype(int), (y * 8.4).astype(int)
        colour = np.where(((column + row) % 2)[..., None], [0.62, 0.56, 0.47], [0.24, 0.17, 0.14])
        joint = (np.abs(x * 10 % 1 - 0.5) > 0.48) | (np.abs(y * 8.4 % 1 - 0.5) > 0.48)
        colour = np.where(
            joint[..., None], 0.1, colour * (1 + 0.12 * random.standard_normal((9, 10))[row, column])[..., None]
        )
    elif kind == "paper":
        stripe = np.sin(2 * np.pi * 14 * x) > 0
        colour = np.where(stripe[..., None], [0.66, 0.6, 0.48], [0.55, 0.52, 0.44])
        panel = y > 0.72
        colour = np.where(panel[..., None], [0.2, 0.27, 0.24], colour)
        colour = np.where((np.abs(y - 0.72) < 0.012)[..., None], 0.7, colour)
        frame = (np.abs(x - 0.5) < 0.17) & (np.abs(y - 0.4) < 0.17)
        inner = (np.abs(x - 0.5) < 0.15) & (np.abs(y - 0.4) < 0.15)
        hills = y > 0.42 + 0.05 * np.sin(20 * x) + 0.03 * np.sin(53 * x + 1)
        colour = np.where(frame[..., None], [0.35, 0.2, 0.08], colour)
        colour = np.where(inner[..., None], np.where(hills[..., None], [0.15, 0.3, 0.12], [0.35, 0.5, 0.7]), colour)
    elif kind == "wood":
        rings = 0.5 + 0.5 * np.sin(40 * x + 3 * np.sin(4 * y) + 2 * np.sin(9 * y + 3 * x))
        colour = np.array([0.42, 0.25, 0.13]) * (0.7 + 0.4 * rings)[..., None]
    else:
        colour = np.full((size, size, 3), 0.75)
    return np.clip(colour * grain[..., None], 0.02, 0.9).astype(np.float32)


def surfaces(painted: bool = True) -> tuple[rl.Mesh, ...]:
    """The hall's meshes: floor, walls, ceiling, window, table and cabinet.

    painted : of their true materials; else grey, as a model of the hall has them
    """

    def of(kind):
        return rl.Diffuse(texture(kind)) if painted else GREY

    w, d, h = WIDTH / 2, DEPTH / 2, HEIGHT
    paper = of("paper")
    walls = [
        quad((-w, 0, -d), (WIDTH, 0, 0), (0, h, 0), "walls", paper),
        quad((w, 0, d), (-WIDTH, 0, 0), (0, h, 0), "walls", paper),
        quad((w, 0, -d), (0, 0, DEPTH), (0, h, 0), "walls", paper),
        quad((-w, 0, d), (0, 0, -DEPTH), (0, h, 0), "walls", paper),
    ]
    panes = np.zeros((128, 192, 3), np.float32)
    panes[6:-6, 6:-6] = [9.0, 10.5, 12.0]
    panes[:, 62:66] = panes[:, 126:130] = panes[62:66] = 0.4
    pane = rl.Material((0.05, 0.05, 0.05), specular=0.0, emission=panes, name="window") if painted else GREY
    return (
        quad((-w, 0, d), (WIDTH, 0, 0), (0, 0, -DEPTH), "floor", of("tiles")),
        together(walls, "walls"),
        quad((-w, h, -d), (WIDTH, 0, 0), (0, 0, DEPTH), "ceiling", of("plaster")),
        quad((-w + 0.01, 0.9, 0.9), (0, 0, -1.8), (0, 1.3, 0), "window", pane),
        box((0.7, 0, -1.5), (1.9, 0.72, -0.7), "table", of("wood")),
        box((-0.9, 0, -2.05), (0.1, 1.25, -1.6), "cabinet", of("wood")),
    )


def hall() -> rl.Scene:
    """The true hall, lit by its window."""
    dark = rl.EnvironmentMap(np.zeros((4, 8, 3), np.float32))
    return rl.Scene(dark, local=surfaces())


def camera(eye, target, width=480, height=320, field_of_view=80.0) -> rl.Camera:
    """A camera in the hall; degrees across."""
    focal_length = width / 2 / np.tan(np.radians(field_of_view) / 2)
    return rl.Camera.looking_at(np.array(eye), np.array(target), width=width, height=height, focal_length=focal_length)


CAMERAS = [
    camera((2.1, 1.5, 1.8), (-0.6, 1.1, -0.6)),
    camera((-2.0, 1.6, 1.8), (0.8, 0.9, -0.7)),
    camera((2.2, 1.7, -0.3), (-1.5, 0.9, 0.3)),
    camera((-2.1, 1.5, -1.3), (1.2, 1.0, 0.9)),
    camera((0.2, 1.9, 1.9), (0.3, 0.3, -1.4)),
]
"""Five photographs of the hall."""

"""Three scenes for relume and Cycles alike: the Cornell box, light through a glass ball, balls in a place."""

from __future__ import annotations

import numpy as np

import relume as rl

WHITE, RED, GREEN = rl.Diffuse((0.73, 0.72, 0.68)), rl.Diffuse((0.63, 0.06, 0.05)), rl.Diffuse((0.14, 0.45, 0.09))
BLACK = rl.EnvironmentMap(np.zeros((4, 8, 3), np.float32))
SIDES = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)  # of a box whose corners count z fastest, counter-clockwise from outside


def quadrangle(corners: list[list[float]], material: rl.Diffuse | rl.Material, name: str) -> rl.Mesh:
    """Four corners, counter-clockwise from the side that is seen."""
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return rl.Mesh(np.array(corners, np.float32), faces, material, name=name)


def box(
    low: list[float], high: list[float], material: rl.Diffuse | rl.Material, name: str, turn: float = 0.0
) -> rl.Mesh:  # fmt: skip
    """A closed box turned about its own upright axis, degrees."""
    ends = np.array([low, high])
    corners = np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    middle, angle = ends.mean(0), np.radians(turn)
    spin = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    faces = np.array([[s[a] for a in half] for s in SIDES for half in ((0, 1, 2), (0, 2, 3))], np.int32)
    return rl.Mesh(((corners - middle) @ spin.T + middle).astype(np.float32), faces, material, name=name)


def ball(centre: list[float], radius: float, material: rl.Diffuse | rl.Material, name: str) -> rl.Mesh:
    """A sphere as 256 × 128 smooth quadrangles, for Cycles has no exact ones."""
    columns, rows = 256, 128
    theta, phi = np.meshgrid(
        np.linspace(0, np.pi, rows + 1), np.linspace(0, 2 * np.pi, columns, endpoint=False), indexing="ij"
    )
    normals = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], -1).reshape(-1, 3)
    row, column = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    first, right = row * columns + column, row * columns + (column + 1) % columns
    upper = np.stack([first, first + columns, right], -1)[1:]  # at the pole its two upper corners are one
    lower = np.stack([right, first + columns, right + columns], -1)[:-1]
    faces = np.concatenate([upper.reshape(-1, 3), lower.reshape(-1, 3)]).astype(np.int32)
    vertices = np.asarray(centre) + radius * normals
    return rl.Mesh(vertices.astype(np.float32), faces, material, normals.astype(np.float32), name=name)


def cornell_box(width: int) -> tuple[rl.Scene, rl.Camera]:
    """A room of a metre with two boxes, lit by a thin box under its ceiling; sizes and colours as published."""
    h = 0.5
    walls = [
        quadrangle([[-h, 0, h], [h, 0, h], [h, 0, -h], [-h, 0, -h]], WHITE, "floor"),
        quadrangle([[-h, 1, -h], [h, 1, -h], [h, 1, h], [-h, 1, h]], WHITE, "ceiling"),
        quadrangle([[-h, 0, -h], [h, 0, -h], [h, 1, -h], [-h, 1, -h]], WHITE, "back"),
        quadrangle([[-h, 0, h], [-h, 0, -h], [-h, 1, -h], [-h, 1, h]], RED, "left"),
        quadrangle([[h, 0, -h], [h, 0, h], [h, 1, h], [h, 1, -h]], GREEN, "right"),
    ]
    lamp = box([-0.12, 0.975, -0.1], [0.12, 0.98, 0.1], rl.Material((0, 0, 0), emission=(18.0, 13.0, 7.0)), "lamp")
    low = box([0.03, 0, 0.02], [0.33, 0.3, 0.32], WHITE, "low box", -17)
    high = box([-0.33, 0, -0.32], [-0.03, 0.6, -0.02], WHITE, "high box", 18)
    camera = rl.Camera.looking_at(
        np.array([0, 0.5, 1.9]), np.array([0, 0.5, 0]), width=width, height=width, focal_length=1.36 * width
    )
    return rl.Scene(BLACK, objects=(*walls, lamp, low, high)), camera


def glass_caustic(width: int) -> tuple[rl.Scene, rl.Camera]:
    """A glass ball over a table under a small lamp: nearly all that is bright on the table came through the glass."""
    table = quadrangle([[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]], WHITE, "table")
    glass = ball([0, 0.3, 0], 0.2, rl.Material(roughness=0.0, transmission=1.0, ior=1.5), "glass")
    lamp = rl.scene.SphereLight((-0.4, 1.13, 0.0), 0.03, (200.0, 200.0, 200.0))
    camera = rl.Camera.looking_at(
        np.array([0.2, 0.9, 1.6]),
        np.array([0.1, 0.15, 0]),
        width=width,
        height=width * 3 // 4,
        focal_length=1.5 * width,
    )
    return rl.Scene(BLACK, objects=(table, glass), lights=(lamp,)), camera


def natural_light(width: int, light: rl.EnvironmentMap | None = None) -> tuple[rl.Scene, rl.Camera]:
    """Balls of glass, metal and plastic on a pedestal inside a measured light, as in *Rendering with Natural Light*."""
    plastic = rl.Material((0.8, 0.1, 0.08), roughness=0.2)
    kinds = {
        "glass": rl.Material(roughness=0.0, transmission=1.0, ior=1.5),
        "plastic": plastic,
        "gold": rl.Material((1.0, 0.77, 0.34), metallic=1.0, roughness=0.15),
        "mirror": rl.Material((0.95, 0.95, 0.95), metallic=1.0, roughness=0.0),
        "matt": rl.Material((0.2, 0.3, 0.6), roughness=0.9),
    }
    places = [[0, 0.62, 0], [-0.36, 0.56, 0.1], [0.36, 0.56, 0.1], [-0.2, 0.52, 0.38], [0.2, 0.52, 0.38]]
    radii = [0.2, 0.14, 0.14, 0.1, 0.1]
    balls = [
        ball([x, 0.42 + radius, z], radius, kinds[name], name)
        for name, (x, _, z), radius in zip(kinds, places, radii, strict=True)
    ]
    stone = rl.Diffuse((0.45, 0.42, 0.38))
    pedestal = [box([-0.65, 0, -0.45], [0.65, 0.42, 0.6], stone, "pedestal", 0.0)]
    camera = rl.Camera.looking_at(
        np.array([0.3, 1.15, 2.1]),
        np.array([0, 0.5, 0.1]),
        width=width,
        height=width * 9 // 16,
        focal_length=1.5 * width,
    )
    return rl.Scene(sunlit() if light is None else light, objects=(*pedestal, *balls)), camera


def sunlit(rows: int = 256) -> rl.EnvironmentMap:
    """A light made for this: a graded sky with a soft sun and a brown ground, as bright as outdoors."""
    from relume.sphere.mappings.mapping import LatLong, pixel_directions

    ways = pixel_directions(LatLong(), rows)
    up = ways[..., 1:2]
    sky = np.array([0.35, 0.6, 1.0]) + (1 - np.maximum(up, 0)) ** 4 * np.array([0.6, 0.45, 0.2])
    ground = np.array([0.22, 0.17, 0.12])
    sun = np.array([-0.55, 0.6, 0.58]) / np.linalg.norm([-0.55, 0.6, 0.58])
    near = np.clip((np.clip(ways @ sun, -1, 1) - np.cos(np.radians(3.0))) / (1 - np.cos(np.radians(1.5))), 0, 1)
    radiance = np.where(up > 0, sky, ground) + near[..., None] * np.array([1500.0, 1350.0, 1100.0])
    return rl.EnvironmentMap(radiance.astype(np.float32))

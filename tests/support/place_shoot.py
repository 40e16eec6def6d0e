"""A virtual place: blocks of known sizes, five cameras, and the edges that a person would mark, with noise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from relume.image.files import write
from relume.image.radiance import RadianceMap
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse
from relume.scene.places.place_tables import BlockTable, PlaceTables
from relume.scene.places.quantities import Model, modelled
from relume.scene.shapes.shapes import Mesh
from relume.sphere.directions import rotation_about

SIZE = (1600, 1200)
BLOCKS: list[dict[str, Any]] = [
    {"name": "house", "kind": "box", "width": 8.0},
    {
        "name": "roof", "kind": "roof", "on": "house", "width": "house.width", "depth": "house.depth",
        "centre_x": "house.centre_x", "centre_z": "house.centre_z",
    },
    {"name": "tower", "kind": "box", "left": "house.right"},
    {"name": "annex", "kind": "box", "turn": "unknown"},
]  # fmt: skip
TRUTH = {
    "height of block 'house'": 5.0, "depth of block 'house'": 6.0, "height of block 'roof'": 2.5,
    "width of block 'tower'": 3.0, "height of block 'tower'": 9.0, "depth of block 'tower'": 3.5,
    "z of block 'tower'": 0.7, "width of block 'annex'": 4.0, "height of block 'annex'": 3.0,
    "depth of block 'annex'": 2.5, "x of block 'annex'": -3.0, "z of block 'annex'": 7.5,
}  # fmt: skip
TURN = 25.0
"""Of the annex, degrees."""
CAMERAS = tuple(
    Camera.looking_at(np.array(position), np.array([-0.5, 3.2, 1.0]), width=SIZE[0], height=SIZE[1], focal_length=focal)
    for position, focal in (
        ((11.0, 3.0, 15.0), 1400.0), ((-13.0, 4.0, 13.0), 1400.0), ((2.0, 2.0, 19.0), 1300.0),
        ((16.0, 6.0, -6.0), 1400.0), ((-9.0, 8.0, -15.0), 1500.0),
    )
)  # fmt: skip


def true_points(model: Model, index: int, vertices: Any) -> np.ndarray:
    """Points (N, 3) of a block as they truly are, world, metres."""
    one = np.array([1.0, *(TRUTH[name] for name in model.lengths)])
    known = model.turns[model.blocks[index].turn].angle
    turn = np.radians(TURN) if known is None else known
    return (model.points(index, vertices) @ one) @ rotation_about([0.0, 1.0, 0.0], turn).T


def marks(noise: float, seed: int, cameras: tuple[Camera, ...] = CAMERAS) -> dict[str, Any]:
    """Both ends of what each camera sees of every edge, pixels, with normal noise: photograph, block, edge."""
    random = np.random.default_rng(seed)
    model = modelled([BlockTable(**block) for block in BLOCKS])
    found: dict[str, Any] = {}
    for number, camera in enumerate(cameras):
        of_photograph: dict[str, Any] = {}
        for index, block in enumerate(model.blocks):
            points = true_points(model, index, range(len(block.body.vertices)))
            shown = camera.project(points)
            towards = set()
            for face in block.body.faces:
                a, b, c = points[list(face[:3])]
                if np.cross(b - a, c - a) @ (camera.position - a) > 0:
                    towards |= {frozenset(pair) for pair in zip(face, face[1:] + face[:1], strict=True)}
            edges = {}
            for name, (first, last) in block.body.edges.items():
                ends = shown[[first, last]]
                inside = np.all((ends > 0) & (ends < SIZE))
                if inside and frozenset((first, last)) in towards and np.linalg.norm(ends[1] - ends[0]) > 30:
                    edges[name] = (ends + random.normal(0, noise, (2, 2))).tolist()
            if edges:
                of_photograph[block.name] = edges
        found[f"photo{number}"] = of_photograph
    return found


def tables(noise: float = 0.5, seed: int = 0, **changed: Any) -> PlaceTables:
    """The place file of the shoot, its photographs not there."""
    photographs = [{"name": f"photo{k}", "file": f"photo{k}.jpg", "size": SIZE} for k in range(len(CAMERAS))]
    given = {"photographs": photographs, "blocks": BLOCKS, "marks": marks(noise, seed)}
    return PlaceTables.model_validate(given | changed)


def toml(noise: float = 0.5, seed: int = 0, blocks: list[dict[str, Any]] | None = None, **marked: Any) -> str:
    """The same as a place file's text."""
    lines = []
    for k in range(len(CAMERAS)):
        lines += ["[[photographs]]", f'name = "photo{k}"', f'file = "photo{k}.jpg"', f"size = {list(SIZE)}", ""]
    for block in BLOCKS if blocks is None else blocks:
        lines += ["[[blocks]]"]
        lines += [f"{key} = {value!r}" for key, value in block.items()] + [""]
    for photograph, edges in (marks(noise, seed) | marked).items():
        for block, points in edges.items():
            lines += [f"[marks.{photograph}.{block}]", *(f"{edge} = {each}" for edge, each in points.items()), ""]
    return "\n".join(lines)


def true_meshes() -> tuple[Mesh, ...]:
    """The blocks as they truly are."""
    model = modelled([BlockTable(**block) for block in BLOCKS])
    return tuple(
        Mesh(
            true_points(model, index, range(len(block.body.vertices))).astype(np.float32), block.body.triangles,
            Diffuse((0.5, 0.5, 0.5)),
        )
        for index, block in enumerate(model.blocks)
    )  # fmt: skip


def radiance_at(points: np.ndarray) -> np.ndarray:
    """What the blocks send out at points (…, 3), alike in all directions: smooth, from 0.2 to 4."""
    x, y, z = np.moveaxis(points, -1, 0)
    return np.stack([np.exp(1.2 * np.sin(0.5 * x)), 1 + 0.5 * np.cos(0.6 * z), np.exp(0.1 * y)], axis=-1)


def radiance_maps(folder: Path, width: int = 240) -> list[Path]:
    """A radiance map of each photograph, smaller than it was marked, in a folder."""
    meshes, paths = true_meshes(), []
    for number, whole in enumerate(CAMERAS):
        camera = whole.resized(width, width * SIZE[1] // SIZE[0])
        rays = camera.rays().reshape(-1, 3)
        distance = RayCaster.of(meshes).nearest(camera.position, rays).distance
        met = np.isfinite(distance)
        points = camera.position + np.where(met, distance, 0)[:, None] * rays
        shown = np.where(met[:, None], radiance_at(points), 0.05).reshape(camera.height, camera.width, 3)
        paths.append(folder / f"photo{number}.exr")
        write(paths[-1], RadianceMap(shown.astype(np.float32)))
    return paths

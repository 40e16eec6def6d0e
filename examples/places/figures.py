"""A place in photographs and marks, for docs/how-to/light/model.md: `python examples/places/figures.py [FOLDER]`.

A chapel of known sizes is rendered from five places, two minutes in all. Of every edge that a photograph shows, two
points are marked half a pixel off, which chapel.toml then holds; `rl.model_place` finds sizes and cameras again.
FOLDER/places.jpg: the marks over a photograph, the edges that were found over it, and the chapel that was found, seen
from where no photograph was taken.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

import relume as rl
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.places.place_tables import BlockTable
from relume.scene.places.quantities import Model, modelled
from relume.scene.toml_tables import read_toml

CHAPEL = Path(__file__).parent / "chapel.toml"
BELOW = "# Marks, which figures.py writes anew: half a pixel off.\n"
TRUTH = {
    "width of block 'nave'": 7.0, "height of block 'nave'": 8.0, "height of block 'roof'": 4.0,
    "width of block 'left_aisle'": 3.0, "height of block 'left_aisle'": 4.5, "height of block 'tower'": 15.0,
    "depth of block 'tower'": 6.0, "height of block 'spire'": 7.0, "width of block 'well'": 2.5,
    "height of block 'well'": 1.2, "x of block 'well'": -8.0, "z of block 'well'": 12.0,
}  # fmt: skip
SIZE = (1200, 900)
NOISE = 0.5
"""Of a mark, pixels."""


def camera(*position: float) -> rl.Camera:
    """A camera at a place, aimed at the chapel."""
    return rl.Camera.looking_at(
        np.array(position), np.array([0.0, 10.0, 4.0]), width=SIZE[0], height=SIZE[1], focal_length=900
    )


CAMERAS = {
    "front_left": camera(-22, 4, 32), "front_right": camera(18, 2.5, 34), "right": camera(30, 5, 4),
    "back_left": camera(-28, 9, -18), "above": camera(4, 14, 38),
}  # fmt: skip
ELSEWHERE = camera(-16, 18, 36)
SUN = rl.light.SunPosition(elevation=np.radians(38), azimuth=np.radians(140))
GREEN, ORANGE = (20, 150, 60), (255, 110, 10)


def true_corners(model: Model, index: int) -> np.ndarray:
    """The corners (N, 3) of a block as they truly are, world, metres."""
    one = np.array([1.0, *(TRUTH[name] for name in model.lengths)])
    return model.points(index, range(len(model.blocks[index].body.vertices))) @ one


def truth() -> tuple[Model, tuple[rl.Mesh, ...]]:
    """The chapel's blocks, and as they truly are."""
    tables = read_toml(CHAPEL, "place", rl.errors.InvalidPlace)["blocks"]
    model = modelled([BlockTable(**table) for table in tables])
    meshes = [
        rl.Mesh(true_corners(model, index).astype(np.float32), block.body.triangles, rl.Diffuse((0.5, 0.5, 0.5)))
        for index, block in enumerate(model.blocks)
    ]
    return model, tuple(meshes)


def marks() -> dict[str, dict[str, dict[str, np.ndarray]]]:
    """Of each photograph and block the points on edges that it shows, pixels: (N, 2), with noise."""
    model, meshes = truth()
    shapes, random = RayCaster.of(meshes), np.random.default_rng(3)
    found: dict[str, dict[str, dict[str, np.ndarray]]] = {}
    for photograph, view in CAMERAS.items():
        found[photograph] = {}
        for index, block in enumerate(model.blocks):
            edges: dict[str, np.ndarray] = {}
            for name, ring in block.body.edges.items():
                if len(ring) > 2 and name in ("bottom", "top"):
                    continue  # other names of the lowest and the highest ring
                ends = true_corners(model, index)[list(ring)]
                points = ends[::8] if len(ring) > 2 else ends[0] + np.array([[0.02], [0.98]]) * (ends[1] - ends[0])
                away = points - view.position
                far = np.linalg.norm(away, axis=-1)
                seen = points[~shapes.occluded(view.position, away / far[:, None], 0.999 * far)]
                shown = view.project(seen)
                if len(seen) > 1 and np.all((shown > 0) & (shown < SIZE)) and np.ptp(shown, axis=0).max() > 15:
                    edges[name] = shown + random.normal(0, NOISE, shown.shape)
            if edges:
                found[photograph][block.name] = edges
    return found


def as_toml(marked: dict[str, dict[str, dict[str, np.ndarray]]]) -> str:
    """Marks as a place file has them."""
    lines = []
    for photograph, blocks in marked.items():
        for block, edges in blocks.items():
            lines.append(f"\n[marks.{photograph}.{block}]")
            for name, points in edges.items():
                rows = [f"    [{x:.2f}, {y:.2f}]," for x, y in points.tolist()]
                lines += [f"{name} = [", *rows, "]"] if len(rows) > 3 else [f"{name} = {points.round(2).tolist()}"]
    return "\n".join(lines) + "\n"


def rendered(meshes: tuple[rl.Mesh, ...], view: rl.Camera) -> np.ndarray:
    """The blocks on the ground under a clear sky, developed: (H, W, 3) uint8."""
    light = rl.light.sky(rl.light.Sky(SUN), 128)
    ground = rl.Plane(rl.Diffuse((0.12, 0.14, 0.06)), (8000.0, 8000.0))
    stone = [rl.Mesh(mesh.vertices, mesh.faces, rl.Diffuse((0.55, 0.5, 0.42))) for mesh in meshes]
    picture = rl.render(rl.Scene(light, (ground, *stone)), view, rl.Mitsuba(samples=48, denoise=True))
    return rl.develop(picture.radiance, rl.Film(3e-5)).pixels


def drawn(picture: np.ndarray, lines: list[np.ndarray], colour: tuple[int, int, int], dots: bool = False) -> np.ndarray:
    """The picture with lines (N, 2), pixels, and with dots at their points."""
    picture = picture.copy()
    for line in lines:
        # Sixteenths of a pixel; OpenCV counts from the middle of the first one.
        at = np.round(16 * (line - 0.5)).astype(np.int32)
        cv2.polylines(picture, [at], False, colour, 3, cv2.LINE_AA, 4)
        for x, y in at.tolist() if dots else ():
            cv2.circle(picture, (x, y), 16 * 6, colour, -1, cv2.LINE_AA, 4)
    return picture


def main(out: Path) -> None:
    """Photographs, marks, and the picture of them."""
    out.mkdir(parents=True, exist_ok=True)
    marked, (_, meshes) = marks(), truth()
    for name, view in CAMERAS.items():
        rl.write(CHAPEL.parent / "photographs" / f"{name}.jpg", rl.Photograph(rendered(meshes, view)))
    CHAPEL.write_text(CHAPEL.read_text(encoding="utf-8").split(BELOW)[0] + BELOW + as_toml(marked), encoding="utf-8")
    place = rl.model_place(CHAPEL)
    print(place.facts())

    # Marks, what was found of them, and the place from elsewhere.
    taken = place.photograph("front_left")
    photograph = rl.read_photograph(taken.file).pixels
    green = [points for edges in marked["front_left"].values() for points in edges.values()]
    orange = [taken.camera.project(points) for block in place.blocks for points in block.edges.values()]
    shown = [drawn(photograph, green, GREEN, dots=True), drawn(photograph, orange, ORANGE)]
    both = np.concatenate([each[:, 200:1000] for each in (*shown, rendered(place.meshes(), ELSEWHERE))], axis=1)
    small = cv2.resize(both, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    rl.write(out / "places.jpg", rl.Photograph(small))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images"))

"""The picture of docs/light.md on modelled places: `python examples/places/figures.py [FOLDER]`, a minute.

A chapel of known sizes is rendered from five places. Of every edge that a photograph shows two points are marked, half
a pixel off, and `rl.model_place` finds the chapel and the cameras again. FOLDER/places.jpg shows a photograph with its
marks, and the chapel that was found, rendered from where no photograph was taken.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

import relume as rl
from relume.scene.places.place_tables import BlockTable
from relume.scene.places.quantities import modelled
from relume.scene.toml_tables import read_toml

HERE = Path(__file__).parent
SIZE = (1200, 900)
TRUTH = {
    "width of block 'nave'": 7.0, "height of block 'nave'": 8.0, "height of block 'roof'": 4.0,
    "width of block 'left_aisle'": 3.0, "height of block 'left_aisle'": 4.5, "height of block 'tower'": 15.0,
    "depth of block 'tower'": 6.0, "height of block 'spire'": 7.0, "width of block 'well'": 2.5,
    "height of block 'well'": 1.2, "x of block 'well'": -8.0, "z of block 'well'": 12.0,
}  # fmt: skip
PLACES = ((-22.0, 4.0, 32.0), (18.0, 2.5, 34.0), (30.0, 5.0, 4.0), (-28.0, 9.0, -18.0), (4.0, 14.0, 38.0))
SUN = rl.light.SunPosition(elevation=np.radians(38), azimuth=np.radians(215))
WHITE = rl.Diffuse((1.0, 1.0, 1.0))
GREEN, ORANGE = (60, 200, 90), (255, 120, 20)


def rendered(meshes: tuple[rl.Mesh, ...], camera: rl.Camera) -> np.ndarray:
    """The blocks on the ground under a clear sky, developed: (H, W, 3) uint8."""
    light = rl.light.sky(rl.light.Sky(SUN), 128)
    ground = rl.Plane(rl.Diffuse((0.28, 0.27, 0.2)), (400.0, 400.0))
    stone = [rl.Mesh(m.vertices, m.faces, rl.Diffuse((0.55, 0.5, 0.42)), name=m.name) for m in meshes]
    picture = rl.render(rl.Scene(light, (ground,), tuple(stone)), camera, rl.Mitsuba(samples=48, denoise=True))
    return rl.develop(picture.radiance, rl.Film(4.5e-5)).pixels


def free(walls: np.ndarray, points: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """Which points (N, 3) no triangle (M, 3, 3) hides from the eye; their own surfaces do not (Möller & Trumbore)."""
    a, ab, ac = walls[:, 0], walls[:, 1] - walls[:, 0], walls[:, 2] - walls[:, 0]
    away = (points - eye)[:, None]
    across = np.cross(away, ac)
    area = np.sum(ab * across, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.sum((eye - a) * across, axis=-1) / area
        turned = np.cross(eye - a, ab)
        v = np.sum(away * turned, axis=-1) / area
        share = np.sum(ac * turned, axis=-1) / area
    return ~np.any((u >= 0) & (v >= 0) & (u + v <= 1) & (share > 0) & (share < 0.999), axis=1)


def main(out: Path) -> None:
    tables = [BlockTable(**each) for each in read_toml(HERE / "chapel.toml", "place", rl.errors.InvalidPlace)["blocks"]]
    model = modelled(tables)
    one = np.array([1.0, *(TRUTH[name] for name in model.lengths)])
    cameras = [
        rl.Camera.looking_at(np.array(p), np.array([0.0, 10.0, 4.0]), width=SIZE[0], height=SIZE[1], focal_length=900)
        for p in PLACES
    ]
    truth = tuple(
        rl.Mesh((model.points(i, range(len(b.body.vertices))) @ one).astype(np.float32), b.body.triangles, WHITE)
        for i, b in enumerate(model.blocks)
    )
    walls = np.concatenate([mesh.vertices[mesh.faces] for mesh in truth]).astype(float)
    random = np.random.default_rng(3)
    text = (
        "".join(
            f'[[photographs]]\nname = "p{k}"\nfile = "p{k}.jpg"\nsize = {list(SIZE)}\n\n' for k in range(len(cameras))
        )
        + (HERE / "chapel.toml").read_text()
    )
    marked: dict[int, list[np.ndarray]] = {}
    for k, camera in enumerate(cameras):
        for index, block in enumerate(model.blocks):
            corners = model.points(index, range(len(block.body.vertices))) @ one
            text += f"\n[marks.p{k}.{block.name}]\n"
            for name, ring in block.body.edges.items():
                if len(ring) > 2 and name not in ("bottom", "top"):
                    continue  # other names of the same rings
                ends = corners[list(ring)]
                points = ends[::8] if len(ring) > 2 else ends[0] + np.array([[0.02], [0.98]]) * (ends[1] - ends[0])
                seen = points[free(walls, points, camera.position)]
                shown = camera.project(seen)
                if len(seen) > 1 and np.all((shown > 0) & (shown < SIZE)) and np.ptp(shown, axis=0).max() > 15:
                    shown = shown + random.normal(0, 0.5, shown.shape)
                    text += f"{name} = {shown.round(2).tolist()}\n"
                    marked.setdefault(k, []).append(shown)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "place.toml").write_text(text)
        place = rl.model_place(Path(folder) / "place.toml")
    for name, words in place.facts().items():
        print(name, words)
    # A photograph with its marks, and the place that was found from elsewhere.
    photograph = rendered(truth, cameras[0]).copy()
    found = place.photograph("p0").camera
    for block in place.blocks:
        for points in block.edges.values():
            line = np.round(found.project(points) * 8).astype(np.int32)
            cv2.polylines(photograph, [line], False, ORANGE, 2, cv2.LINE_AA, 3)
    for points in marked[0]:
        for point in points:
            cv2.circle(photograph, np.round(point * 8).astype(int).tolist(), 40, GREEN, -1, cv2.LINE_AA, 3)
    elsewhere = rl.Camera.looking_at(
        np.array([-14.0, 18.0, 38.0]), np.array([0.0, 10.0, 3.0]), width=SIZE[0], height=SIZE[1], focal_length=900
    )
    both = np.concatenate([photograph, rendered(place.meshes(), elsewhere)], axis=1)
    small = cv2.resize(both, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    rl.write(out / "places.jpg", rl.Photograph(small, "places"))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images"))

"""Makes a virtual shoot: photographs of a place that never was, and what the camera would have seen of the objects.

    BPY_PYTHON benchmarks/shoots/make.py NAME FOLDER [--samples N] [--small FACTOR]

BPY_PYTHON is a Python 3.11 with `pip install bpy "numpy<2" OpenEXR Pillow`. NAME is one of places.PLACES; FOLDER/NAME
gets what a photographer brings home (plate/, plate_grid.jpg, ball_0/, ball_90/, objects/, tape.json) and truth/:
plate.exr and with_all.exr, means of two seeds, with_all_1.exr and with_all_2.exr, each seed's own, mask_all.exr and
shoot.json. Pictures in renders/ are kept, so the same command goes on after a stop.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from blender import box, camera, empty, quad, render, sphere
from materials import bpy, glow, image, principled
from objects import write_glb
from photographs import photographs, records
from place import Place, View
from places import PLACES
from scipy.ndimage import uniform_filter

from virtual_camera import read, write

BALL_SIZE = (448, 448)
SUN, SUN_SAMPLES = 2e4, 16384
"""Radiance above which a ball shows the sun, and rays a pixel for it."""


def board(place: Place) -> None:
    """The chequered board on a slab of its thickness, a square of white around."""
    columns, rows = place.squares
    shades = np.full((rows + 2, columns + 2), 0.92)
    shades[1:-1, 1:-1] = np.where(np.indices((rows, columns)).sum(0) % 2, 0.92, 0.2)
    pixels = np.repeat(np.repeat(shades, 32, 0), 32, 1)[..., None] * np.ones(3)
    printed = principled("printed", image("board", pixels), roughness=0.8)
    across, up = (columns + 2) * place.square, (rows + 2) * place.square
    quad("board", (0, 0, place.board), (across, 0, 0), (0, up, 0), printed)
    white = principled("slab", (0.8, 0.8, 0.8), roughness=0.8)
    box("slab", (-across / 2, -up / 2, 0.00002), (across / 2, up / 2, place.board - 0.00002), white)


def ball(place: Place) -> None:
    silver = principled("silver", (place.ball_reflectance,) * 3, metallic=1.0, roughness=0.0)
    sphere("ball", (0, 0, place.ball), place.ball, silver, fine=256)


def look(view: View, size: tuple[int, int]) -> Any:
    return camera(view.position, view.look_at, view.field_of_view, size)


def mask(things: list[Any]) -> None:
    """Objects white, all else black."""
    white, black = glow("white", (1.0, 1.0, 1.0)), glow("black", (0.0, 0.0, 0.0))
    for each in bpy.context.scene.objects:
        if each.type == "MESH":
            each.data.materials.clear()
            each.data.materials.append(white if each in things else black)
    bpy.context.scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0


def pictures(place: Place, folder: Path, samples: int, small: float) -> None:
    """Renders what is not there yet; `small` divides the sizes, to try a place out.

    Plate and picture of one seed share what the objects do not change, noise and all, as relume's composite does.
    """
    raw = folder / "renders"
    for each in (raw, folder / "truth", folder / "objects"):
        each.mkdir(parents=True, exist_ok=True)
    few = max(samples // 4, 16)
    jobs: list[tuple[str, int, int]] = [
        ("plate", few, 1), ("plate_grid", few, 2), ("ball_0", few, 3), ("ball_90", few, 4), ("mask_all", 64, 5),
        ("plate_1", samples, 6), ("with_all_1", samples, 6), ("plate_2", samples, 7), ("with_all_2", samples, 7),
    ]  # fmt: skip
    for name, rays, seed in jobs:
        path = raw / f"{name}.exr"
        if path.is_file():
            continue
        empty()
        place.build()
        is_ball = name in place.ball_cameras
        view, size = (place.ball_view(name), BALL_SIZE) if is_ball else (place.plate, place.size)
        look(view, (round(size[0] / small), round(size[1] / small)))
        if name == "plate_grid":
            board(place)
        elif is_ball:
            ball(place)
        elif not name.startswith("plate"):
            things = place.things()
            for thing in things:
                write_glb(thing, folder / "objects" / f"{thing.name}.glb")
            if name == "mask_all":
                mask(things)
        render(path, samples=rays, seed=seed, region=place.region if name[-1] in "12" else None)
        if is_ball:
            refine_sun(path, seed)


def refine_sun(path: Path, seed: int) -> None:
    """Renders the sun in the ball, smaller than a pixel, by so many rays that its light is known to a per cent."""
    pixels = read(path)
    height, width = pixels.shape[:2]
    row, column = np.unravel_index(pixels.max(-1).argmax(), (height, width))
    if pixels[row, column].max() < SUN:
        return
    low, high = np.array([column - 8, row - 8]), np.array([column + 8, row + 8])
    region = (low[0] / width, 1 - high[1] / height, high[0] / width, 1 - low[1] / height)
    near = path.with_name(f"sun_in_{path.name}")
    render(near, samples=SUN_SAMPLES, seed=seed, region=tuple(map(float, region)))
    fine = read(near)
    inside = fine.any(-1, keepdims=True)
    write(path, np.where(inside, fine, pixels))


def truths(folder: Path) -> None:
    """plate.exr and with_all.exr, the means of two seeds; with_all_1.exr and _2.exr, each seed's own.

    What a plate's noise is known to be, against the mean of both, is taken out of the picture of the same seed as far
    as it is in there: a control variate, its weight the regression of one pair of differences on the other over
    windows of nine pixels, 0 on the objects. Outside of the place's region there is one picture of few rays, which is
    the plate and the truth alike.
    """
    raw = {name: read(folder / f"renders/{name}.exr") for name in
           ("plate", "plate_1", "plate_2", "with_all_1", "with_all_2", "mask_all")}  # fmt: skip
    inside = raw["plate_1"].any(-1, keepdims=True)
    plate = np.where(inside, (raw["plate_1"] + raw["plate_2"]) / 2, raw["plate"])
    there, without = raw["with_all_1"] - raw["with_all_2"], raw["plate_1"] - raw["plate_2"]
    common, own = (uniform_filter(product, size=(9, 9, 1)) for product in (there * without, without**2))
    share = np.clip(common / np.maximum(own, 1e-12), 0, 1) * (raw["mask_all"].mean(-1, keepdims=True) == 0)
    seeds = [np.where(inside, raw[f"with_all_{i}"] - share * (raw[f"plate_{i}"] - plate), raw["plate"]) for i in (1, 2)]
    done = {"plate": plate, "with_all": (seeds[0] + seeds[1]) / 2, "with_all_1": seeds[0], "with_all_2": seeds[1]}
    for name, pixels in {**done, "mask_all": raw["mask_all"]}.items():
        write(folder / f"truth/{name}.exr", pixels)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=PLACES)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--samples", type=int, default=512, help="rays a pixel of each of the truth's two seeds")
    parser.add_argument("--small", type=float, default=1.0, help="divides the plate's size, to try a place out")
    given = parser.parse_args()
    place, folder = PLACES[given.name], given.folder / given.name
    pictures(place, folder, given.samples, given.small)
    truths(folder)
    records(given.name, place, folder, photographs(given.name, place, folder))


if __name__ == "__main__":
    main()

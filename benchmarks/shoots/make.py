"""Makes a virtual shoot: photographs of a place that never was, and what the camera would have seen of the objects.

    BPY_PYTHON benchmarks/shoots/make.py NAME FOLDER [--samples N] [--small FACTOR]

BPY_PYTHON is a Python 3.11 with `pip install bpy "numpy<2" OpenEXR Pillow`. NAME is one of places.PLACES; FOLDER/NAME
gets what a photographer brings home (plate/, plate_grid.jpg, ball_0/, ball_90/, objects/, tape.json) and truth/:
plate.exr, with_all.exr, the mean of its seeds, with_all_1.exr and with_all_2.exr, the means of half of them each,
mask_all.exr and shoot.json. Pictures in renders/ are kept, so the same command goes on after a stop.
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
from scipy.ndimage import median_filter, uniform_filter

from virtual_camera import read, write

BALL_SIZE = (448, 448)
SUN, SUN_SAMPLES = 2e4, 16384
"""Radiance above which a ball shows the sun, and rays a pixel for it."""
TILE, TILES, MORE = 16, 48, 8
"""Pixels along a tile of the truth, how many of the noisiest are traced again, and by how many times as many rays."""


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


def pictures(place: Place, folder: Path, samples: int, seeds: int, small: float) -> None:
    """Renders what is not there yet; `small` divides the sizes, to try a place out.

    Plate and picture of one seed share what the objects do not change, noise and all, as relume's composite does.
    """
    raw = folder / "renders"
    for each in (raw, folder / "truth", folder / "objects"):
        each.mkdir(parents=True, exist_ok=True)
    few = max(samples // 4, 16)
    truth = [(f"{name}_{i}", samples, 5 + i) for i in range(1, seeds + 1) for name in ("plate", "with_all")]
    jobs: list[tuple[str, int, int]] = [
        ("plate", samples // 2, 1), ("plate_grid", few, 2), ("ball_0", few, 3), ("ball_90", few, 4),
        ("mask_all", 64, 5), *truth,
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
        region = place.region if (name, rays, seed) in truth else None
        render(path, samples=rays, seed=seed, region=region, denoised=name == "plate")
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


def truths(place: Place, folder: Path, samples: int, seeds: int) -> None:
    """plate.exr and with_all.exr, the mean of all seeds; with_all_1.exr and _2.exr, the means of each second one.

    The plate is denoised: it is what was photographed, whatever it shows, and noise of its own would stay in every
    composite where its light goes. What a seed's plate differs by is taken out of the picture of the same seed as far
    as it is in there: a control variate, its weight the regression of one's differences between seeds on the other's
    over windows of nine pixels, 0 on the objects. Outside of the place's region the plate is the truth. The tiles with
    most noise around the objects, glints and caustics, are traced again with MORE rays.
    """
    names = ["plate", "mask_all", *(f"{name}_{i + 1}" for i in range(seeds) for name in ("plate", "with_all"))]
    raw = {name: read(folder / f"renders/{name}.exr") for name in names}
    plate, inside = raw["plate"], raw["plate_1"].any(-1, keepdims=True)
    there, without = (np.stack([raw[f"{name}_{i + 1}"] for i in range(seeds)]) for name in ("with_all", "plate"))
    scatter = without - without.mean(0)
    common, own = (uniform_filter((each * scatter).sum(0), size=(9, 9, 1)) for each in (there - there.mean(0), scatter))
    beside = raw["mask_all"].mean(-1, keepdims=True) == 0
    share = np.clip(common / np.maximum(own, 1e-12), 0, 1) * beside
    each = np.where(inside, there - share * (without - plate), plate)
    halves = [each[::2].mean(0), each[1::2].mean(0)]
    # What a half changes, less what it changes around: fireflies, glints and caustics.
    changes = [half - plate for half in halves]
    noise = [np.abs(change - median_filter(change, (5, 5, 1))).sum(-1) for change in changes]
    noise = [
        each * beside[..., 0] * (np.abs(change).sum(-1) > 0.03 * plate.sum(-1))
        for each, change in zip(noise, changes, strict=True)
    ]
    halves = refined(place, folder, halves, noise, (samples, seeds))
    done = {"plate": plate, "with_all": (halves[0] + halves[1]) / 2, "with_all_1": halves[0], "with_all_2": halves[1]}
    for name, pixels in {**done, "mask_all": raw["mask_all"]}.items():
        write(folder / f"truth/{name}.exr", pixels)


def refined(
    place: Place, folder: Path, halves: list[np.ndarray], noise: list[np.ndarray], rays: tuple[int, int]
) -> list[np.ndarray]:  # fmt: skip
    """The two halves of the truth, their noisiest tiles traced again, each half by seeds of its own.

    noise : (H, W) of each half. It chooses the tiles of the other half: tiles that were chosen by the noise that is
        then averaged away would lose their fireflies, while those without keep their lack of them, and the sum
        would be too dark
    rays : a pixel of each seed, and seeds
    """
    samples, seeds = rays
    height, width = noise[0].shape
    rows, columns = height // TILE, width // TILE
    sums = [
        each[: rows * TILE, : columns * TILE].reshape(rows, TILE, columns, TILE).sum((1, 3)).ravel() for each in noise
    ]
    path = folder / f"renders/refined_{samples}_{seeds}_{width}x{height}.npz"
    if not path.is_file():
        empty()
        place.build()
        look(place.plate, (width, height))
        place.things()
        chosen = np.stack([np.argsort(sums[1 - half])[::-1][:TILES] for half in range(2)])
        traced = np.zeros((*chosen.shape, TILE, TILE, 3), np.float32)
        part = folder / "renders/tile.exr"
        for (half, index), tile in np.ndenumerate(chosen):
            top, left = (int(tile) // columns) * TILE, (int(tile) % columns) * TILE
            # A quarter of a pixel more, or rounding decides which pixels those are.
            low, high = height - top - TILE + 0.25, height - top + 0.25
            region = ((left + 0.25) / width, low / height, (left + TILE + 0.25) / width, high / height)
            render(part, samples=MORE * samples, seed=1000 + 2 * index + half, region=region)
            traced[half, index] = read(part)[top : top + TILE, left : left + TILE]
        part.unlink()
        np.savez(path, chosen=chosen, traced=traced)
    kept = np.load(path)
    for half, pixels in enumerate(halves):
        old_seeds = (seeds + 1 - half) // 2
        for tile, finer in zip(kept["chosen"][half], kept["traced"][half], strict=True):
            top, left = (int(tile) // columns) * TILE, (int(tile) % columns) * TILE
            # Weighted by their rays.
            old = pixels[top : top + TILE, left : left + TILE]
            pixels[top : top + TILE, left : left + TILE] = (old_seeds * old + MORE * finer) / (old_seeds + MORE)
    return halves


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=PLACES)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--samples", type=int, default=512, help="rays a pixel of each of the truth's seeds")
    parser.add_argument("--seeds", type=int, default=2, help="of the truth, two at least")
    parser.add_argument("--small", type=float, default=1.0, help="divides the plate's size, to try a place out")
    given = parser.parse_args()
    if given.seeds < 2:
        parser.error(f"--seeds is {given.seeds}; expected 2 or more, for the truth's noise is seen between two halves")
    place, folder = PLACES[given.name], given.folder / given.name
    pictures(place, folder, given.samples, given.seeds, given.small)
    truths(place, folder, given.samples, given.seeds)
    records(given.name, place, folder, photographs(given.name, place, folder))


if __name__ == "__main__":
    main()

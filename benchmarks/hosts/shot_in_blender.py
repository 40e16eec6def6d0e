"""Blender against our composite: the room shot handed over, rendered there and here, infinite and as a box.

Objects must stand in the same pixels, shadows fall the same way, and the grey sphere be as bright.

Usage: python benchmarks/hosts/shot_in_blender.py PYTHON_WITH_BPY LIGHT.exr [FOLDER]

LIGHT.exr is the light of a finished run, `relume insert examples/room/shot.toml -o …`.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from trial import finish, run_inside

import relume as rl
from relume.export.shot_files import SHOT_FORMATS, export_shot
from relume.light.constellations.residual import key_lights
from relume.project.insertion.prepared import PreparedShot
from relume.project.shot_file.objects import placed_meshes
from relume.renderers.raytrace.raycast import RayCaster
from relume.scene.scene import Box

ROOM = Path(__file__).resolve().parents[2] / "examples" / "room"
WIDTH, HEIGHT = 192, 128
SAMPLES = 196
TABLE = (0.3311, 0.1991, 0.1259)
"""Reflectance that a run of the room shot recovered; both sides get the same."""
LATELY = 0.03
"""Of the grey sphere's brightness: what the two renderers' materials differ by, and noise."""


def room(light: Path) -> PreparedShot:
    """The shot at a quarter of its size, with a plain table."""
    shot = rl.read_shot(ROOM / "shot.toml")
    camera = rl.camera_from_grid(rl.read_photograph(ROOM / "plate_grid.jpg"), squares=(9, 6), square=0.03)
    bracket = rl.read_bracket(shot.files(shot.plate.photographs))
    merged = rl.merge(bracket, rl.recover_response([bracket]).balanced_at(255).response).radiance
    by = merged.shape[1] // WIDTH
    plate = merged.reshape(HEIGHT, by, WIDTH, by, 3).mean((1, 3)).astype(np.float32)
    scene = rl.Scene(
        rl.as_environment(rl.read_radiance(light)),
        (rl.Plane(rl.Diffuse(TABLE), (1.7, 1.0)),),
        placed_meshes(shot),
    )
    return PreparedShot(scene, camera.resized(WIDTH, HEIGHT), rl.RadianceMap(plate), samples=SAMPLES)


def seen_as(value: PreparedShot, name: str) -> np.ndarray:
    """(H, W) bool: the pixels whose nearest object has this name."""
    ways = value.camera.rays().reshape(-1, 3)
    reach = np.array([RayCaster.of([m]).nearest(value.camera.position, ways).distance for m in value.scene.objects])
    names = [mesh.name for mesh in value.scene.objects]
    nearest = np.where(np.isfinite(reach.min(axis=0)), reach.argmin(axis=0), -1)
    return (nearest == names.index(name)).reshape(HEIGHT, WIDTH)


def blocks(picture: np.ndarray, side: int = 4) -> np.ndarray:
    """Means over side² pixels, where noise is less."""
    return picture.reshape(HEIGHT // side, side, WIDTH // side, side, -1).mean((1, 3))


def compare(python: str, value: PreparedShot, folder: Path, name: str) -> bool:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        export_shot(value, folder, SHOT_FORMATS["blender"])
    run_inside(python, Path(__file__).with_name("inside_shot.py"), str(folder), str(SAMPLES), needs="bpy")
    there = rl.read_radiance(folder / "composite.exr").radiance.astype(np.float64)
    cover = alpha(folder / "objects.exr")
    chosen = rl.Mitsuba(samples=SAMPLES)
    with_, without = (rl.render(scene, value.camera, chosen) for scene in (value.scene, value.scene.without_objects()))
    matte, plate = with_.matte.astype(np.float64), value.plate.radiance.astype(np.float64)
    share = with_.radiance / np.maximum(without.radiance, 1e-9)
    here = matte[..., None] * with_.radiance + (1 - matte[..., None]) * plate * share

    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    moved = max(abs(float((c * cover).sum() / cover.sum() - (c * matte).sum() / matte.sum())) for c in (rows, columns))
    apart = float(np.mean((cover > 0.5) != (matte > 0.5)))
    grey = seen_as(value, "sphere_gray") & (matte > 0.99)
    brightness = there[grey].mean(0) / here[grey].mean(0)
    # Only the table: the model has nothing behind the wall's pixels.
    table = (blocks(matte)[..., 0] == 0) & (np.arange(HEIGHT // 4) > HEIGHT // 4 // 2)[:, None]
    ours, theirs = (blocks(picture / plate - 1).mean(-1)[table] for picture in (here, there))
    alike = float(np.corrcoef(ours, theirs)[0, 1])
    deeper = float(theirs[ours < -0.1].mean() / ours[ours < -0.1].mean())
    print(f"{name}: objects {moved:.3f} pixels off, {apart:.2%} of the pixels on the other side of an edge")
    print(f"{name}: the grey sphere there is {np.round(brightness, 4).tolist()} times as bright as here")
    print(f"{name}: shadows correlate by {alike:.3f}, those deeper than 10 % are {deeper:.3f} times as deep")
    return moved < 0.25 and apart < 0.01 and bool(np.abs(brightness - 1).max() < LATELY) and alike > 0.9


def alpha(path: Path) -> np.ndarray:
    """The alpha channel of an EXR, (H, W)."""
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        return np.asarray(channels["RGBA"].pixels[..., 3] if "RGBA" in channels else channels["A"].pixels, np.float64)


def main(python: str, light: Path, folder: Path) -> None:
    infinite = room(light)
    box = Box((-2.5, -0.75, -2.0), (2.5, 1.95, 2.0))
    near = replace(infinite, scene=replace(infinite.scene, distant=box, probe=(0.0, 0.05, 0.0)))
    keys = key_lights(infinite.scene.light, 16)
    # Key lights are spheres where windows shone: off the probe they are not the same light, and are only reported.
    compare(python, replace(near, keys=keys), folder / "keys", "box with key lights, told and not judged")
    finish(
        compare(python, infinite, folder / "infinite", "infinite"),
        compare(python, near, folder / "box", "box"),
    )


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as temporary:
        main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3] if len(sys.argv) == 4 else temporary))

"""Debevec 1998, Fig. 4, 6 and 7, from the shots of examples/room: `relume demo -o out/demo` measures its light.

python examples/gallery/debevec_1998_figures.py out/demo docs/images

Fig. 4, the same objects in two lights: the room's, and a sky of clouds (CIE 110-1994, the standard overcast sky). Fig.
6, a map from two views of a ball, at three exposures, and what it lights. Fig. 7, the steps: the plate, the ball, the
room as the ball's map makes it, and objects on the table in its light. Fig. 5 and 8: `examples/insert/figures.py`.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import relume as rl
from relume.sphere.mappings.mapping import LatLong, pixel_directions

ROOM = Path(__file__).parents[1] / "room"
SIZE, SAMPLES = (480, 320), 64
STOPS = (-4.5, 0.0, 4.5)
BALL = ROOM / "ball_0" / "IMG_0007.jpg"
GROUND = 0.2
"""Reflectance of what lies below the horizon, CIE 110-1994's for a place without snow."""


def overcast(rows: int = 128) -> rl.EnvironmentMap:
    """A sky of clouds, three times as bright overhead as at the horizon, over ground that it lights."""
    up = pixel_directions(LatLong(), rows)[..., 1]
    # Radiance (1 + 2 sin γ) / 3 gives level ground the irradiance 7π / 9.
    radiance = np.where(up > 0, (1 + 2 * up) / 3, GROUND * 7 / 9)
    return rl.EnvironmentMap(np.repeat(radiance[..., None], 3, axis=-1).astype(np.float32))


def close_up(width: int, height: int) -> rl.Camera:
    """A camera before the objects, lower and nearer than the plate's."""
    return rl.Camera.looking_at(
        np.array([0.02, 0.25, 0.70]),
        np.array([0.0, 0.06, 0.0]),
        width=width,
        height=height,
        focal_length=1.05 * width,
    )


def film_for(radiance: np.ndarray, bright: float = 96) -> rl.Film:
    """A film that puts the bright end of a picture, that percentile of it, just below white."""
    return rl.Film(0.8 / max(float(np.percentile(radiance, bright)), 1e-30))


def rendered(scene: rl.Scene, camera: rl.Camera) -> np.ndarray:
    return rl.render(scene, camera, rl.Mitsuba(SAMPLES, denoise=True), seed=1).radiance


def room_of_the_map(scene: rl.Scene, camera: rl.Camera) -> np.ndarray:
    """What a camera sees of the model: the map, as the probe saw it, on the table's plane and on the room's box."""
    box = scene.distant
    assert isinstance(box, rl.scene.Box)
    rays, eye = camera.rays(), np.asarray(camera.position)
    with np.errstate(divide="ignore"):
        walls = np.maximum((np.array(box.low) - eye) / rays, (np.array(box.high) - eye) / rays).min(-1)
        table = np.where(rays[..., 1] < 0, -eye[1] / rays[..., 1], np.inf)
    there = eye + table[..., None] * rays
    on_it = (np.abs(there[..., 0]) < 0.85) & (np.abs(there[..., 2]) < 0.5)
    met = eye + np.where(on_it, table, walls)[..., None] * rays
    way = met - np.array(scene.probe)
    return scene.light.lookup(way / np.linalg.norm(way, axis=-1, keepdims=True))


def shown(axis: Axes, picture: np.ndarray, title: str) -> None:
    axis.imshow(picture, interpolation="nearest")
    axis.set_title(title, fontsize=10, loc="left")
    axis.set_axis_off()


def figure_4(scene: rl.Scene) -> Figure:
    """The same objects in two lights, each light's map in the corner."""
    page = Figure(figsize=(12, 4.3), dpi=100, layout="constrained")
    outdoors = rl.Scene(overcast(), scene.local, scene.objects)
    lit = {"(a) in the room's light": scene, "(b) under a sky of clouds": outdoors}
    for axis, (title, each) in zip(page.subplots(1, 2), lit.items(), strict=True):
        picture = rendered(each, close_up(*SIZE))
        shown(axis, rl.develop(picture, film_for(picture)).pixels, title)
        inset = axis.inset_axes((0.0, 0.79, 0.28, 0.21))
        inset.imshow(rl.develop(each.light.radiance, film_for(each.light.radiance)).pixels)
        inset.set_axis_off()
    return page


def figure_6(scene: rl.Scene) -> Figure:
    """The map at three exposures, and below it what it lights."""
    page = Figure(figsize=(12, 9.4), dpi=100, layout="constrained")
    above, below = page.subfigures(2, 1, height_ratios=(1, 3.3))
    even = film_for(scene.light.radiance, 99.5)
    for axis, stops in zip(above.subplots(1, 3), STOPS, strict=True):
        pixels = rl.develop(scene.light.radiance * np.float32(2.0**stops), even).pixels
        shown(axis, pixels, f"{stops:+.1f} stops".replace("+0.0", "0"))
    picture = rendered(scene, close_up(840, 480))
    shown(below.subplots(), rl.develop(picture, film_for(picture)).pixels, "objects in this light")
    return page


def figure_7(plate: np.ndarray, scene: rl.Scene, camera: rl.Camera, film: rl.Film) -> Figure:
    """The plate, the ball, the model of the room seen by the plate's camera, and the objects in it."""
    page = Figure(figsize=(12, 8.6), dpi=100, layout="constrained")
    pictures = {
        "(a) the background plate": plate,
        "(b) the light probe: a mirrored ball": rl.read_photograph(BALL).pixels,
        "(c) the light-based model, seen by the plate's camera": rl.develop(
            room_of_the_map(scene, camera), film
        ).pixels,
        "(d) objects and the table's reflectance, lit by the model": rl.develop(rendered(scene, camera), film).pixels,
    }
    for axis, (title, picture) in zip(page.subplots(2, 2).flat, pictures.items(), strict=True):
        shown(axis, picture, title)
    return page


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit(__doc__)
    work, folder = Path(sys.argv[1]), Path(sys.argv[2])
    room = rl.read_shot(ROOM / "shot.toml")
    ready = rl.prepare_shot(room, work)
    figures = {
        "4": figure_4(ready.scene),
        "6": figure_6(ready.scene),
        "7": figure_7(ready.picture().pixels, ready.scene, ready.camera.resized(*SIZE), ready.developed_by()),
    }
    for number, figure in figures.items():
        figure.savefig(folder / f"gallery_debevec_figure_{number}.jpg", pil_kwargs={"quality": 86})

"""What is made of a shoot's pictures: the virtual camera's photographs, and what was measured and is true there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from blender import focal_length
from place import Place

from virtual_camera import CAMERAS, Camera, read

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def photographs(name: str, place: Place, folder: Path) -> dict[str, Any]:
    """The virtual camera's JPEGs; seconds of the ball's photographs as its sensor saw them, by view."""
    cam: Camera = CAMERAS[name]
    plate = read(folder / "truth/plate.exr")
    lens = focal_length(place.plate.field_of_view)
    # Plate: from all but the brightest thousandth unclipped, four photographs.
    shortest = cam.seconds(float(np.quantile(plate.max(-1), 0.999)))
    for i in range(4):
        path = folder / f"plate/IMG_{i + 1:04d}.jpg"
        cam.photograph(path, plate, shortest * 2 ** (cam.plate_stops * i), lens, seed=100 + i, clock=i)
    cam.photograph(
        folder / "plate_grid.jpg", read(folder / "renders/plate_grid.exr"), shortest, lens, seed=110, clock=30
    )
    # Ball: from nothing clipped, nine photographs.
    seen = {}
    for number, view in enumerate(place.ball_cameras):
        picture = read(folder / f"renders/{view}.exr")
        lens = focal_length(place.ball_view(view).field_of_view)
        first = cam.seconds(float(picture.max()) / cam.ball_filter)
        times = [first * 2 ** (cam.ball_stops * i) for i in range(9)]
        for i, seconds in enumerate(times):
            path = folder / view / f"IMG_{i + 1:04d}.jpg"
            clock = 60 * (number + 1) + i
            cam.photograph(path, picture / cam.ball_filter, seconds, lens, seed=200 + 20 * number + i, clock=clock)
        seen[view] = [t / cam.ball_filter for t in times]
    return seen


def records(name: str, place: Place, folder: Path, times: dict[str, Any]) -> None:
    """tape.json, what was measured at the place; truth/shoot.json, what is really there."""
    width, height = place.size
    plate = read(folder / "truth/plate.exr")
    spot = [round(plate.shape[1] * 0.9), round(plate.shape[0] * 0.9)]
    tape = place.tape | {
        "frame": "metres, +Y up, origin on the surface below the middle of the board",
        "board": {"squares": list(place.squares), "square": place.square, "thickness": place.board},
        "ball": {"centre": [0, place.ball, 0], "radius": place.ball, "reflectance": place.ball_reflectance},
        "spot_meter": {"pixel_xy": spot, "luminance_cd_m2": float(plate[spot[1], spot[0]] @ LUMINANCE * 100)},
    }  # fmt: skip
    if CAMERAS[name].ball_filter != 1:
        tape |= {"ball_filter": CAMERAS[name].ball_filter, "ball_times": times}
    (folder / "tape.json").write_text(json.dumps(tape, indent=1))
    view = place.plate
    truth = {
        "frame": "metres, Z up, origin on the surface that objects stand on, below the middle of the board",
        "plate_camera": {
            "position": view.position, "look_at": view.look_at, "hfov_deg": view.field_of_view, "width": width,
            "height": height,
        },
        "grid": {"squares": place.squares, "square_m": place.square, "thickness_m": place.board},
        "ball": {"centre": [0, 0, place.ball], "radius_m": place.ball, "views": place.ball_cameras},
        "white_luminance_cd_m2": 100.0,
    }  # fmt: skip
    (folder / "truth/shoot.json").write_text(json.dumps(truth, indent=1))

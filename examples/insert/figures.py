"""The pictures of docs/how-to/insert.md, from a finished insert of the room.

relume insert examples/room/shot.toml -o out/room
python examples/insert/figures.py out/room docs/images
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
import trimesh
from PIL import Image, ImageDraw

import relume as rl
from relume.capture.exposure.bracket import read_bracket
from relume.image import files
from relume.image.response import Response
from relume.project.place_tables import distant_scene
from relume.project.shot_file.shot import Shot, read_shot
from relume.report import plots
from relume.scene.cameras.camera import Camera
from relume.scene.materials.materials import Diffuse, Material
from relume.scene.scene import Box
from relume.scene.shapes.shapes import Mesh
from relume.scene.shapes.smoothing import smoothed
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

ROOM = Path(__file__).parents[1] / "room" / "shot.toml"
WIDE, GAP, NAME = 480, 6, 18
SITS_IN = 2
"""The photograph of the plate's bracket that the room's picture sits in."""


def steps(out: Path, shot: Shot) -> Image.Image:
    """After Debevec 1998, Fig. 8: the plate, what is known of the place, what the objects change, the composite."""
    layers = files.read_layers(out / "layers.exr")
    bracket = read_bracket(shot.files(shot.plate.photographs))
    before = bracket.photographs[SITS_IN].pixels
    response = Response.from_json((out / "response.json").read_text())
    model = develop(layers["without"], Film(float(bracket.exposures[SITS_IN]), response)).pixels
    after = files.read_photograph(out / "composite.png").pixels
    change = layers["difference"]
    shown = [
        ("the plate", before),
        ("reflectance of the table, the light taken out", plots.exposed(layers["reflectance"], 1.0)),
        ("the model of the table without the objects", model),
        ("matte: what the objects cover", plots.grey(layers["matte"])),
        ("difference: the light they take (dark) and add", plots.signed(change, float(np.percentile(abs(change), 99)))),
        ("the composite", after),
    ]
    tiles = [_tile(name, picture) for name, picture in shown]
    high = tiles[0].height
    page = Image.new("RGB", (3 * WIDE + 2 * GAP, 2 * high + GAP), "white")
    for index, tile in enumerate(tiles):
        page.paste(tile, ((index % 3) * (WIDE + GAP), (index // 3) * (high + GAP)))
    return page


def light_on_the_box(light: EnvironmentMap, box: Box, probe: tuple[float, float, float]) -> Image.Image:
    """After Debevec 1998, Fig. 5: the room as the light's map makes it, its near walls and ceiling taken off."""
    middle = np.add(box.low, box.high) / 2 - [0, 0.15, 0]  # the ceiling is off
    eye = np.array([6.0, 6.3, 7.2])
    camera = Camera.looking_at(eye, middle, width=3 * WIDE, height=9 * WIDE // 4, focal_length=19 * WIDE / 5)
    rays = camera.rays()
    with np.errstate(divide="ignore"):
        near, far = (np.array(box.low) - eye) / rays, (np.array(box.high) - eye) / rays
    enters, leaves = np.minimum(near, far).max(-1), np.maximum(near, far).min(-1)
    walls = eye + leaves[..., None] * rays
    way = walls - np.array(probe)
    radiance = light.lookup(way / np.linalg.norm(way, axis=-1, keepdims=True))
    shown = np.where((enters < leaves)[..., None], radiance, 0).astype(np.float32)
    lit = radiance[enters < leaves]
    picture = develop(shown, Film(0.5 / float(np.percentile(lit, 80)))).pixels
    picture[enters >= leaves] = 255
    tile = Image.fromarray(picture)
    tile = tile.resize((tile.width // 2, tile.height // 2), Image.Resampling.LANCZOS)
    place = camera.project(np.array(probe)) / 2
    ImageDraw.Draw(tile).ellipse((*(place - 5), *(place + 5)), fill="red", outline="white", width=2)
    return tile


def facets_and_smooth(light: EnvironmentMap) -> Image.Image:
    """A ball and a can without normals in the room's light, as they are and with `smooth = 30`."""
    copper, table = Material((0.9, 0.5, 0.3), metallic=1.0, roughness=0.25), Diffuse((0.3, 0.25, 0.2))
    shapes = trimesh.creation.icosphere(2, 0.1), trimesh.creation.cylinder(0.08, 0.2, sections=24)
    stands = np.array([[-0.13, 0.1, 0], [0.13, 0.1, 0]])
    turns = np.eye(3), np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # the can's axis is z
    flat = [
        Mesh((shape.vertices @ turn.T + stand).astype(np.float32), np.asarray(shape.faces, np.int32), copper)
        for shape, turn, stand in zip(shapes, turns, stands, strict=True)
    ]
    eye, middle = np.array([0.0, 0.35, 0.8]), np.array([0.0, 0.09, 0.0])
    camera = Camera.looking_at(eye, middle, width=WIDE, height=9 * WIDE // 16, focal_length=1.4 * WIDE)
    pictures = [
        rl.Mitsuba(samples=256, denoise=True).render(rl.Scene(light, (rl.Plane(table),), objects), camera).radiance
        for objects in (tuple(flat), smoothed(flat, 30))
    ]
    film = Film(0.5 / float(np.percentile(pictures[0], 90)))
    page = Image.new("RGB", (2 * WIDE + GAP, camera.height), "white")
    for index, picture in enumerate(pictures):
        page.paste(Image.fromarray(develop(picture, film).pixels), (index * (WIDE + GAP), 0))
    return page


def _tile(name: str, picture: np.ndarray | bytes) -> Image.Image:
    opened = Image.open(io.BytesIO(picture)) if isinstance(picture, bytes) else Image.fromarray(picture)
    high = opened.height * WIDE // opened.width
    tile = Image.new("RGB", (WIDE, high + NAME), "white")
    tile.paste(opened.convert("RGB").resize((WIDE, high), Image.Resampling.LANCZOS), (0, NAME))
    ImageDraw.Draw(tile).text((0, 2), name, fill="black", font_size=13)
    return tile


def main(out: Path, images: Path) -> None:
    """Write the pictures."""
    shot = read_shot(ROOM)
    distant, ball = distant_scene(shot.light.distant, shot.folder), shot.light.ball
    assert isinstance(distant, Box) and ball is not None and ball.centre is not None  # as the room's file has them
    light = as_environment(files.read_radiance(out / "light.exr"))
    for name, path in (("before", shot.files(shot.plate.photographs)[SITS_IN]), ("after", out / "composite.png")):
        Image.fromarray(files.read_photograph(path).pixels).save(images / f"insert_{name}.jpg", quality=90)
    steps(out, shot).save(images / "insert_steps.jpg", quality=86)
    light_on_the_box(light, distant, ball.centre).save(images / "insert_box.jpg", quality=86)
    facets_and_smooth(light).save(images / "smooth_edges.jpg", quality=86)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))

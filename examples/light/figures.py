"""The pictures of docs/how-to/light, from the mirrored ball of the room.

python examples/light/figures.py docs/images
"""

from __future__ import annotations

import io
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from relume.cli import main as relume
from relume.image import files
from relume.image.colour import luminance
from relume.light.constellations.constellation import constellation
from relume.light.constellations.k_means import KMeans
from relume.light.constellations.rectangles import MedianCut, VarianceMinimisation
from relume.report.light_plot import light_plot, lights_plot
from relume.sphere.environment_files import as_environment
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.names import mapping_named
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

ROOM = Path(__file__).parents[1] / "room"
MAPPINGS = {
    "latlong": 200, "hemispheres": 200, "angular": 200, "ball": 200, "octahedral": 200, "equalarea": 200,
    "cross": 201, "cross-vertical": 200, "fisheye:equisolid:180": 200, "strip": 68,
}  # fmt: skip
GAP, NAME = 8, 16


def measured(folder: Path) -> EnvironmentMap:
    """The room's light from its two views of the ball, as the README's command makes it."""
    out = folder / "light.exr"
    words = ["probe", *sorted(map(str, (ROOM / "ball_0").glob("*.jpg")))]
    words += ["--second", *sorted(map(str, (ROOM / "ball_90").glob("*.jpg")))]
    words += ["--camera", "0,0.12,1", "--second-camera", "1,0.12,0", "-o", str(out), "-q"]
    if relume(words):
        raise SystemExit("the room's ball could not be read")
    return as_environment(files.read_radiance(out))


def film_for(light: EnvironmentMap, stops: float = 1.0) -> Film:
    return Film(2**stops * 0.18 * 4 * np.pi / float(luminance(light.total())))


def every_mapping(light: EnvironmentMap) -> Image.Image:
    tiles = []
    for name, rows in MAPPINGS.items():
        shown = develop(light.remapped(mapping_named(name), rows).radiance, film_for(light)).pixels
        tile = Image.new("RGB", (shown.shape[1], shown.shape[0] + NAME), "white")
        tile.paste(Image.fromarray(shown), (0, NAME))
        ImageDraw.Draw(tile).text((0, 1), name, fill="black")
        tiles.append(tile)
    rows = [tiles[0:2] + tiles[2:3], tiles[3:8], tiles[8:10]]
    wide = max(sum(t.width + GAP for t in row) for row in rows)
    page = Image.new("RGB", (wide, sum(max(t.height for t in row) + GAP for row in rows)), "white")
    top = 0
    for row in rows:
        left = 0
        for tile in row:
            page.paste(tile, (left, top))
            left += tile.width + GAP
        top += max(t.height for t in row) + GAP
    return page


def regions(light: EnvironmentMap) -> Image.Image:
    pictures = []
    for method in (MedianCut(), VarianceMinimisation(), KMeans()):
        lights = constellation(light, 64, method)
        png = lights_plot(light, lights, f"64 lights, {type(method).__name__}")
        pictures.append(Image.open(io.BytesIO(png)).convert("RGB"))
    width = 700
    scaled = [p.resize((width, p.height * width // p.width), Image.Resampling.LANCZOS) for p in pictures]
    page = Image.new("RGB", (width, sum(p.height for p in scaled)), "white")
    top = 0
    for picture in scaled:
        page.paste(picture, (0, top))
        top += picture.height
    return page


def main(out: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        light = measured(Path(folder))
    every_mapping(light).save(out / "light_mappings.jpg", quality=88)
    regions(light).save(out / "light_constellations.jpg", quality=88)
    drawn = Image.open(io.BytesIO(light_plot(light, "light.exr"))).convert("RGB")
    drawn.resize((drawn.width * 7 // 10, drawn.height * 7 // 10), Image.Resampling.LANCZOS).save(
        out / "light_drawn.jpg", quality=85
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))

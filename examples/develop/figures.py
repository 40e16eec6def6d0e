"""The pictures of glare and of film in docs/how-to/develop.md.

python examples/develop/figures.py CHURCH.hdr docs/images
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from relume.image import files
from relume.image.radiance import RadianceMap
from relume.image.resizing import resized
from relume.project.presets.preset import preset_of
from relume.virtual_camera.developing import develop
from relume.virtual_camera.tone.display.lettering import Words, lettered

PAGE, GAP, CAPTION = 28, 8, 24
SIDE = 300
GLARES: dict[str, dict[str, Any]] = {
    "as it is": {},
    "an eye by day": {"glare": {"kind": "eye", "adaptation": 100.0}},
    "an eye in the dark": {"glare": {"kind": "eye", "adaptation": 0.001}},
    "six blades, f/16": {"glare": {"kind": "camera", "blades": 6, "f_number": 16.0, "rotation": 10.0}},
    "seven blades, f/16": {"glare": {"kind": "camera", "blades": 7, "f_number": 16.0}},
    "round, f/16, halo 2 %": {
        "glare": {"kind": "camera", "blades": 9, "curvature": 1.0, "f_number": 16.0, "halo": 0.02}
    },
}
GREY = {"kind": "darkroom", "stock": "black-and-white"}
FILMS: dict[str, dict[str, Any]] = {
    **{f"negative exposed {stops:+d} stops": {"tone": GREY, "exposure": stops} for stops in (-4, -2, 2, 4)},
    "black-and-white, as metered": {"tone": GREY},
    "paper of grade 5": {"tone": {**GREY, "grade": 5}},
    "colour negative": {"tone": {"kind": "darkroom", "stock": "colour-negative"}},
    "slide": {"tone": {"kind": "darkroom", "stock": "slide"}},
}


def lamps() -> RadianceMap:
    """A small white lamp and a dim red one before a faint wall, 20° across."""
    radiance = np.full((SIDE, SIDE, 3), 0.01, np.float32)
    y, x = np.ogrid[:SIDE, :SIDE]
    radiance[np.hypot(y - 140, x - 130) < 2.5] = 2e4
    radiance[np.hypot(y - 230, x - 240) < 1.5] = (400, 60, 30)
    return RadianceMap(radiance, unit="cd/m²")


def developed(picture: RadianceMap, look: dict[str, Any], degrees: float) -> np.ndarray:
    camera = preset_of(look).camera
    return develop(picture, camera, camera.view(picture, field_of_view=float(np.radians(degrees)))).pixels


def page(cells: dict[str, np.ndarray], columns: int) -> Image.Image:
    """Pictures of one size in rows, with their captions below."""
    height, width = next(iter(cells.values())).shape[:2]
    down, across = height + CAPTION + GAP, width + GAP
    sheet = np.full((-(-len(cells) // columns) * down + GAP, columns * across + GAP, 3), PAGE, np.uint8)
    words = []
    for index, (caption, cell) in enumerate(cells.items()):
        y, x = GAP + index // columns * down, GAP + index % columns * across
        sheet[y : y + height, x : x + width] = cell
        words.append(Words(x + 2, y + height + 4, caption, 10.0))
    return Image.fromarray(lettered(sheet, words))


def main(church_file: Path, out: Path) -> None:
    """Write develop_glare.jpg and develop_film.jpg."""
    plain = {"tone": {"kind": "fixed", "gain": 2.0}}
    cells = {caption: developed(lamps(), {**plain, **look}, 20.0) for caption, look in GLARES.items()}
    page(cells, 3).save(out / "develop_glare.jpg", quality=85)
    church = files.read_radiance(church_file)
    small = resized(church, 272, 408)
    cells = {caption: developed(small, look, 50.0) for caption, look in FILMS.items()}
    page(cells, 4).save(out / "develop_film.jpg", quality=85)


if __name__ == "__main__":
    warnings.simplefilter("ignore", UserWarning)
    main(*(Path(word) for word in sys.argv[1:]))

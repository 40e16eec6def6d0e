"""Figure 9 of Debevec & Malik 1997, from their bracket of the memorial church: the picture of docs/how-to/develop.md.

python examples/develop/figure_9.py FOLDER_OF_THE_BRACKET docs/images

(a) a photograph, blurred; (b) radiance, blurred along the arc of a camera that turns and then photographed through the
recovered response; (c) the truth: the church put on a sphere and seen by a camera at 149 instants while it turns, the
views averaged and photographed. Their saturated areas are written below.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from relume.capture.brackets.merging import merge_brackets
from relume.capture.exposure.bracket import read_bracket
from relume.image.radiance import RadianceMap
from relume.sphere.environment_map import EnvironmentMap
from relume.sphere.mappings.mapping import LatLong
from relume.sphere.mappings.perspective import insert_view, perspective_view
from relume.virtual_camera.film.film import Film
from relume.virtual_camera.lens.motion.path import TurningCamera
from relume.virtual_camera.view import View

FIELD = np.radians(48)
"""Of the whole picture, supposed: the paper gives none."""
SEEN, SIZE = np.radians(38), (400, 540)
"""Of the panels: less than the picture, so that what comes into sight while the camera turns is known."""
PIXELS, INSTANTS, SATURATED = 37, 149, 0.98
FACING = np.eye(3)


def on_sphere(picture: RadianceMap) -> EnvironmentMap:
    """The picture where a camera that looks along −Z saw it, on a dark sphere as fine as the picture."""
    width = 2 * int(np.pi * picture.size[0] / FIELD)
    dark = np.zeros((width // 2, width, 3), np.float32)
    # Light is not below 0; the merge's noise in the dark may be.
    plain = RadianceMap(np.maximum(np.nan_to_num(picture.radiance), 0), unit=picture.unit)
    return insert_view(EnvironmentMap(dark, LatLong(), picture.unit), plain, FACING, FIELD)


def turned(camera: TurningCamera, time: float) -> np.ndarray:
    """The camera's rotation about its up axis at a time of the exposure, −½ to ½."""
    cosine, sine = np.cos(time * camera.yaw), np.sin(time * camera.yaw)
    return np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])


def panels(picture: RadianceMap, film: Film) -> tuple[list[np.ndarray], np.ndarray]:
    """The pixel values (H, W, 3), 0 to 1, of (a), (b) and (c), and the pixels (H, W) that are known throughout."""
    sphere, view = on_sphere(picture), View(SIZE[0] / 2 / np.tan(SEEN / 2))
    camera = TurningCamera(PIXELS / view.focal_length)
    sharp = perspective_view(sphere, FACING, SEEN, SIZE).radiance
    truth = np.zeros(sharp.shape)
    for time in (np.arange(INSTANTS) + 0.5) / INSTANTS - 0.5:
        truth += perspective_view(sphere, turned(camera, time), SEEN, SIZE).radiance / INSTANTS
    photograph = (film.pixel_values(sharp) / 255).astype(np.float32)
    shown = [camera.apply(photograph, view)]
    shown += [film.pixel_values(light) / 255 for light in (camera.apply(sharp, view), truth)]
    return shown, camera.coverage(sharp.shape[:2], view) > 0.999


def main(bracket: Path, out: Path) -> None:
    paths = sorted(path for path in bracket.iterdir() if path.suffix.lower() in (".png", ".jpg"))
    found = merge_brackets(read_bracket(paths))
    picture = found.brackets[0].picture
    middle = float(np.median(picture.radiance.mean(-1)))
    shown, known = panels(picture, Film(0.5 / middle, found.response))
    areas = [float(np.mean((values > SATURATED)[known])) for values in shown]
    names = ("(a) photograph, blurred", "(b) radiance, blurred, photographed", "(c) camera turned, photographed")
    page = Image.new("RGB", (3 * SIZE[0] + 32, SIZE[1] + 64), "white")
    font = ImageFont.load_default(17)
    for index, (values, name, area) in enumerate(zip(shown, names, areas, strict=True)):
        left = index * (SIZE[0] + 16)
        page.paste(Image.fromarray(np.rint(255 * values).astype(np.uint8)), (left, 0))
        text = f"{name}\nabove 0.98: {100 * area:.2f} % of the values"
        ImageDraw.Draw(page).multiline_text((left + 4, SIZE[1] + 8), text, "black", font)
    page.save(out / "develop_motion.jpg", quality=90)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        print(__doc__)
    else:
        main(Path(sys.argv[1]), Path(sys.argv[2]))

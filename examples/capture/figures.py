"""The pictures of docs/how-to/capture.md, from the hand-held bracket of the room.

python examples/capture/figures.py docs/images
"""

from __future__ import annotations

import io
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from relume.capture.brackets.merging import merge_brackets
from relume.capture.brackets.result import MergedBracket
from relume.capture.brackets.settings import MergeSettings
from relume.capture.exposure.bracket import Bracket, read_bracket
from relume.image.colour import encode_srgb
from relume.report import capture_plots, plots

ROOM = Path(__file__).parents[1] / "room"
WIDTH = 1100


def picture(png: bytes) -> Image.Image:
    return Image.open(io.BytesIO(png)).convert("RGB")


def crop(measured: MergedBracket) -> Image.Image:
    """The ball in the radiance map, enlarged."""
    radiance = measured.picture.radiance[125:205, 20:180]
    shown = encode_srgb(np.clip(radiance / np.percentile(radiance, 99), 0, 1))
    return Image.fromarray(np.rint(255 * shown).astype(np.uint8)).resize(
        (WIDTH // 2, WIDTH // 4), Image.Resampling.BICUBIC
    )


def walked_through(bracket: Bracket) -> Bracket:
    """The bracket with a dark thing that stands elsewhere in each photograph."""
    frames = []
    for index, photograph in enumerate(bracket.photographs):
        pixels = photograph.pixels.copy()
        left = 120 + 130 * index
        pixels[150:330, left : left + 70] = pixels[150:330, left : left + 70] // 3
        frames.append(type(photograph)(pixels, photograph.name, photograph.exposure, photograph.camera))
    return Bracket(tuple(frames))


def row(*images: Image.Image) -> Image.Image:
    height = min(image.height for image in images)
    scaled = [image.resize((image.width * height // image.height, height)) for image in images]
    whole = Image.new("RGB", (sum(image.width for image in scaled) + 8 * (len(scaled) - 1), height), "white")
    left = 0
    for image in scaled:
        whole.paste(image, (left, 0))
        left += image.width + 8
    return whole.resize((WIDTH, whole.height * WIDTH // whole.width), Image.Resampling.LANCZOS)


def main(out: Path) -> None:
    bracket = read_bracket(sorted((ROOM / "plate_handheld").glob("*.jpg")))
    found = merge_brackets(bracket)
    assert found.calibration is not None
    measured = found.brackets[0]
    plain = merge_brackets(bracket, settings=MergeSettings(align=False, deghost=False)).brackets[0]
    picture(plots.response_plot(found.calibration)).save(out / "capture_response.png")
    row(crop(plain), crop(measured)).save(out / "capture_aligned.jpg", quality=90)
    row(
        picture(capture_plots.false_colour(measured.picture)), picture(capture_plots.relative_error(measured.picture))
    ).save(out / "capture_certain.jpg", quality=88)
    tripod = read_bracket(sorted((ROOM / "plate").glob("*.jpg")))
    moving = walked_through(tripod)
    with_ghosts = merge_brackets(moving, profile=found.response, settings=MergeSettings(deghost=False)).brackets[0]
    without = merge_brackets(moving, profile=found.response).brackets[0]
    assert without.deghosted is not None
    white = float(np.percentile(without.picture.radiance, 99))
    row(
        picture(plots.exposed(with_ghosts.picture.radiance, white)),
        picture(plots.exposed(without.picture.radiance, white)),
        picture(capture_plots.marked(without.picture.radiance, [(without.deghosted.ghosts, capture_plots.GHOST)])),
    ).save(out / "capture_ghosts.jpg", quality=88)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        print(__doc__)
    else:
        main(Path(sys.argv[1]))

"""The pictures of docs/how-to/light-stage, from a virtual stage with its truth beside it, and the room's own light.

python examples/light_stage/figures.py STAGE docs/images        STAGE: the folder of the head's stage.json
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from relume.cli import main as relume
from relume.image import files
from relume.virtual_camera.developing import develop
from relume.virtual_camera.film.film import Film

ROOM = Path(__file__).parents[1] / "room"
GAP = 6
POINTS = {"point_0": "0.35125,0.48171,0.80286", "point_1": "-0.76835,0.32929,0.54882"}


def run(*words: object) -> None:
    """One command, as a user would give it."""
    if relume([str(word) for word in words]):
        raise SystemExit(f"failed: relume {' '.join(map(str, words))}")


def shown(radiance: np.ndarray, white: float, height: int = 320) -> Image.Image:
    picture = Image.fromarray(develop(radiance.astype(np.float32), Film(1 / white)).pixels)
    return picture.resize((round(picture.width * height / picture.height), height), Image.Resampling.LANCZOS)


def row(pictures: list[Image.Image]) -> Image.Image:
    width = sum(each.width for each in pictures) + GAP * (len(pictures) - 1)
    sheet = Image.new("RGB", (width, pictures[0].height), "white")
    left = 0
    for each in pictures:
        sheet.paste(each, (left, 0))
        left += each.width + GAP
    return sheet


def column(rows: list[Image.Image]) -> Image.Image:
    sheet = Image.new(
        "RGB", (max(each.width for each in rows), sum(each.height for each in rows) + GAP * (len(rows) - 1)), "white"
    )
    top = 0
    for each in rows:
        sheet.paste(each, (0, top))
        top += each.height + GAP
    return sheet


def white_of(radiance: np.ndarray) -> float:
    return float(np.percentile(radiance[radiance.max(axis=-1) > 0], 98))


def room_light(work: Path) -> Path:
    """The light of the example room, from its two views of the ball."""
    out = work / "room.exr"
    views = ["probe", *sorted((ROOM / "ball_0").glob("*.jpg")), "--second", *sorted((ROOM / "ball_90").glob("*.jpg"))]
    run(*views, "--camera", "0,0.12,1", "--second-camera", "1,0.12,0", "--size", "256", "-o", out)
    return out


def relit(stage: Path, light: Path, work: Path, out: Path) -> None:
    """In the room's light, turned, and under a lamp between the stage's, beside the truth."""
    pictures = []
    for turn in ("0", "90", "180"):
        run("stage", "relight", stage, "--light", light, "--rotate", turn, "-o", work / "a.exr")
        found = files.read_radiance(work / "a.exr").radiance
        pictures.append(shown(found, white_of(found)))
    run("stage", "relight", stage, "--direction", POINTS["point_0"], "-o", work / "a.exr")
    ours, truth = (files.read_radiance(path).radiance for path in (work / "a.exr", stage / "truth/point_0_front.exr"))
    white = white_of(truth)
    row([*pictures, shown(ours, white), shown(truth, white)]).save(out / "stage_relit.jpg", quality=88)


def seen(stage: Path, work: Path, out: Path) -> None:
    """From the second camera: ours and the truth."""
    place = ["--position", "2.1,0.1,3.63731", "--target", "0,-0.12,0", "--direction", POINTS["point_1"]]
    run("stage", "view", stage, "--mesh", stage / "objects/subject.glb", *place, "-o", work / "side.exr")
    layers = files.read_layers(work / "side.exr")
    truth = files.read_radiance(stage / "truth/point_1_right.exr").radiance
    white = white_of(truth)
    ours = layers["radiance"] * layers["alpha"][..., None]
    row([shown(ours, white), shown(truth, white)]).save(out / "stage_view.jpg", quality=88)


def functions(stage: Path, work: Path, out: Path) -> None:
    run("stage", "inspect", stage, "--functions", "16x20", "-o", work / "report")
    mosaic = files.read_radiance(work / "report/mosaic.exr").radiance
    shown(mosaic, white_of(mosaic), 480).save(out / "stage_mosaic.jpg", quality=88)


def maps(stage: Path, work: Path, out: Path) -> None:
    run("stage", "separate", stage, "-o", work / "maps")
    found = [Image.open(work / f"maps/{name}.png") for name in ("normal", "albedo", "specular_energy", "roughness")]
    row([each.resize((320, 320)) for each in found]).save(out / "stage_maps.jpg", quality=90)


def glass(stage: Path, work: Path, out: Path) -> None:
    run("stage", "matte", stage / "matte", "-o", work / "glass.exr")
    rows = []
    for name in ("blocks", "smooth"):
        run("stage", "matte", work / "glass.exr", "--over", stage / f"matte/backdrop_{name}.exr", "-o", work / "a.exr")
        ours, truth = (
            files.read_radiance(each).radiance for each in (work / "a.exr", stage / f"matte/truth_{name}.exr")
        )
        rows.append(row([shown(each, 1.0, 280) for each in (ours, truth, 4 * np.abs(ours - truth))]))
    column(rows).save(out / "stage_matte.jpg", quality=90)


def in_the_room(stage: Path, work: Path, out: Path) -> None:
    """The subject on the room's table, in its light."""
    text = (ROOM / "shot.toml").read_text("utf-8")
    head, tail = text[: text.index("[[objects]]")], text[text.index("[render]") :]
    subject = (
        f'[[objects]]\nmesh = "{stage / "objects/subject.glb"}"\nstage = "{stage}"\n'
        "scale = 0.12\nrotate = [0, 10, 0]\ntranslate = [0.0, 0.15, 0.05]\n\n"
    )
    shot = work / "room"
    shot.mkdir()
    for each in ROOM.iterdir():
        (shot / each.name).symlink_to(each.resolve())
    (shot / "staged.toml").write_text(head + subject + tail, "utf-8")
    run("insert", shot / "staged.toml", "-o", work / "composite")
    Image.open(work / "composite/composite.png").convert("RGB").save(out / "stage_in_room.jpg", quality=88)


def draw(stage: Path, out: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        light = room_light(work)
        relit(stage, light, work, out)
        seen(stage, work, out)
        functions(stage, work, out)
        maps(stage, work, out)
        glass(stage, work, out)
        in_the_room(stage, work, out)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit("usage: python examples/light_stage/figures.py STAGE docs/images")
    draw(Path(sys.argv[1]).resolve(), Path(sys.argv[2]))

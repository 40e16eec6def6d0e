"""What the reader of a page has: examples, photographs, maps and a light stage, all small, by the page's names."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

import relume as rl
from documents.pages import ROOT
from half_room import smaller
from relume.image.response import Response
from small_shot import write_small_shot
from small_stages import write_stage

SIZE = "size = [32, 24]"


def folder_of_examples(folder: Path) -> None:
    """Copy the examples, which are made once: the room's shot is the small one, and scene files show few pixels."""
    shutil.copytree(_made(), folder, dirs_exist_ok=True)


@cache
def _made() -> Path:
    made = tempfile.mkdtemp(prefix="relume-reader-")
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    folder = Path(made)
    examples = folder / "examples"
    for each in ("cornell_box", "spectral", "whitted"):
        shutil.copytree(ROOT / "examples" / each, examples / each)
        for path in (examples / each).glob("*.toml"):
            path.write_text(small_scene(path.read_text(encoding="utf-8")), encoding="utf-8")
    for path in (ROOT / "examples" / "room").rglob("*.*"):
        copy = examples / path.relative_to(ROOT / "examples")
        copy.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".jpg":
            smaller(path, copy)
        else:
            shutil.copyfile(path, copy)
    write_small_shot(examples / "room")
    write_small_shot(folder)
    write_small_shot(folder / "OUT")  # as `relume insert -o OUT/` wrote it
    _map(folder / "light.exr")  # with a sun
    return folder


def small_scene(text: str) -> str:
    """A scene file's text with a picture of few pixels."""
    return "\n".join(SIZE if line.startswith("size = [") else line for line in text.splitlines()) + "\n"


def provide(name: str, folder: Path) -> bool:
    """Make the file that a page names, if it is not there; whether it is there then.

    name : as it stands on the page, a file or a folder of a known kind
    """
    path = folder / name
    if path.exists():
        return True
    make = MAKERS.get(path.suffix.lower())
    unknown = path.suffix == ".toml" and path.name not in ("scene.toml", "film.toml")
    if make is None or unknown or Path(name).is_absolute() or ".." in path.parts or "*" in name:
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    make(path)
    return True


def _map(path: Path) -> None:
    radiance = np.full((64, 128, 3), 0.3, np.float32)
    radiance[12, 40] = 20_000 if path.suffix == ".exr" else 15  # a sun, which the small codings do not hold
    rl.write(path, rl.as_radiance_map(rl.EnvironmentMap(radiance)))


def calibrate(path: Path) -> None:
    """Bring a map to cd/m², which a page may ask for."""
    light = rl.read_environment(path)
    rl.write(path, rl.as_radiance_map(replace(light, unit="cd/m²")))


def _photograph(path: Path) -> None:
    # Several that lie beside each other are the exposures of a bracket.
    number = (3, 2, 4, 1)[len(list(path.parent.glob("*.jpg"))) % 4]
    smaller(ROOT / "examples" / "room" / "plate" / f"IMG_{number:04}.jpg", path)


def _painting(path: Path) -> None:
    rl.write(path, rl.Photograph(np.full((32, 64, 3), 128, np.uint8)))


def _mesh(path: Path) -> None:
    ball = trimesh.creation.icosphere(2, 0.05).apply_translation([0, 0.05, 0])
    if path.stem == "subject":  # the ball of the small light stage
        ball = trimesh.creation.icosphere(4, 1.0)
    exported = ball.export(file_type=path.suffix[1:])
    path.write_bytes(exported if isinstance(exported, bytes) else str(exported).encode())


def _floats(path: Path) -> None:
    path.write_bytes(np.full((384, 512, 3), 0.5, "<f4").tobytes())


def _scene(path: Path) -> None:
    text = small_scene((ROOT / "examples" / "whitted" / "figure_8.toml").read_text(encoding="utf-8"))
    if path.name == "film.toml":
        (path.parent / "shown.toml").write_text(f'{text}\n[sequence]\nframes = "1-2"\n', encoding="utf-8")
        text = 'scene = "shown.toml"\n\n[render]\nrenderer = "whitted"\n'
    path.write_text(text, encoding="utf-8")


MAKERS: dict[str, Callable[[Path], object]] = {
    **dict.fromkeys((".exr", ".hdr", ".pic"), _map),
    **dict.fromkeys((".jpg", ".jpeg"), _photograph),
    **dict.fromkeys((".png", ".tif"), _painting),
    **dict.fromkeys((".glb", ".obj"), _mesh),
    ".float": _floats,
    ".toml": _scene,
}


@cache
def _scene_file() -> rl.SceneFile:
    path = ROOT / "examples" / "cornell_box" / "cornell_box.toml"
    return rl.read_scene(path, size=(16, 16))


def _light() -> rl.EnvironmentMap:
    return rl.EnvironmentMap(np.full((16, 32, 3), 0.5, np.float32))


def _scan(density: float) -> rl.Photograph:
    ramp = np.linspace(2, 250, 64 * 48).reshape(48, 64, 1).repeat(3, 2)
    return rl.Photograph((ramp / density).astype(np.uint8), exposure=rl.Exposure(1.0, 8.0, 100))


def _response() -> Response:
    return rl.recover_response([rl.read_bracket(sorted((ROOT / "examples/room/plate").glob("*.jpg")))]).response


def _lamp() -> np.ndarray:
    y, x = np.mgrid[:96, :128]
    return np.hypot(x - 64, y - 48) < 3


def _lamp_in_the_dark() -> rl.RadianceMap:
    y, x = np.mgrid[:96, :128]
    halo = 0.5 / (1 + np.hypot(x - 64, y - 48) ** 2) + 0.001
    return rl.RadianceMap(np.where(_lamp(), 100, halo)[..., None].repeat(3, 2).astype(np.float32))


NAMES: dict[str, Callable[[], Any]] = {
    "scene": lambda: _scene_file().scene,
    "camera": lambda: _scene_file().camera,
    "new_camera": lambda: _scene_file().camera,
    "meshes": lambda: tuple(each for each in _scene_file().scene.local if isinstance(each, rl.Mesh)),
    "photographs": lambda: [(_scene_file().camera, rl.RadianceMap(np.full((16, 16, 3), 0.5, np.float32)))],
    "left": _light,
    "right": _light,
    "light": _light,
    "time": lambda: datetime(2026, 6, 21, 11, tzinfo=UTC),
    "numbers": lambda: np.random.default_rng(1).random((10, 2)),
    "thin_scan": lambda: _scan(1.0),
    "dense_scan": lambda: _scan(2.0),
    "response_of_thin_scans": _response,
    "response_of_dense_scans": _response,
    "lamp": _lamp,
    "lamp_in_the_dark": _lamp_in_the_dark,
}
"""What a page's text says that the reader has, by the name that the code gives it."""


FOLDERS: dict[str, tuple[str, ...]] = {
    "FOLDER": tuple(f"IMG_{number:04}.jpg" for number in (1, 2, 3, 4)),
    "PLACE": tuple(f"IMG_{number:04}.jpg" for number in (1, 2, 3, 4)),
    "photographs": tuple(f"IMG_{number:04}.jpg" for number in (1, 2, 3, 4)),
    "MAPS": ("a.exr", "b.exr"),
    "maps": ("map_1.exr", "map_2.exr"),
    "probe": ("probe_1.exr", "probe_2.exr"),
    "frames": ("frame_1.exr", "frame_2.exr"),
}
"""Folders that pages name, and what lies in them; photographs are those of the example's plate."""
STAGES = ("head", "head/", "stage/", "black/", "white/")
"""Folders of light stages, as pages name them."""
OUTPUTS = ("-o", "--out", "--report", "--picture", "--sheet", "--residual", "--export", "--slice")

SQUARE = {"angular", "fisheye", "ball"}
"""Mappings of maps that are as wide as high."""


def folders_and_files(words: list[str], folder: Path) -> list[str]:
    """A line's words with patterns as the files they stand for; what goes in is made, in a small size.

    words : of a command line, without the program
    folder : where the command will run
    """
    given: list[str] = []
    for before, word in zip(["", *words], words, strict=False):
        if before in OUTPUTS or word.startswith("-"):
            (folder / word).parent.mkdir(parents=True, exist_ok=True)
            given.append(word)
            continue
        if word in STAGES and not (folder / word).exists():
            write_stage(folder / word)
        for name in FOLDERS.get(word.strip("/"), ()):
            (folder / word).mkdir(exist_ok=True)
            if name.endswith(".jpg"):
                smaller(ROOT / "examples" / "room" / "plate" / name, folder / word / name)
            else:
                provide(f"{word.strip('/')}/{name}", folder)
        if "*" in word:
            given += matching(word, folder)
        else:
            name = word.rpartition("=")[0] or word
            provide(name, folder)
            square = words[0] == "convert" and SQUARE & {each.split(":")[0] for each in words}
            if (square or "--faces" in words) and (folder / name).is_file():
                rl.write(folder / name, rl.RadianceMap(np.full((64, 64, 3), 0.5, np.float32)))
            given.append(word)
    return given


def matching(pattern: str, folder: Path) -> list[str]:
    """The files of a pattern like `ball/*.jpg`: of photographs the example's ball, of others two."""
    place, _, name = pattern.rpartition("/")
    if any(folder.glob(pattern)):
        pass
    elif name.endswith(".jpg"):
        source = ROOT / "examples" / "room" / ("ball_0" if "ball" in place else "plate")
        for path in source.glob("*.jpg"):
            (folder / place).mkdir(parents=True, exist_ok=True)
            smaller(path, folder / place / path.name)
    else:
        for number in ("1", "2"):
            provide(pattern.replace("*", f"a_{number}"), folder)
    return sorted(path.relative_to(folder).as_posix() for path in folder.glob(pattern)) or [pattern]
